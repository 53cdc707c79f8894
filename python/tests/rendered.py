"""Pictures of printed targets from known poses, with the truth of every corner.

Every pixel is the mean over the area that it sees: rays through a grid of sub-pixels are traced through the lens onto flat sheets.
Blur, uneven light and noise come after that. Nothing here uses ``body_schema.vision``: its corners are held against these.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from body_schema.vision._place import optical_pose

SUB = 4
"""Sub-pixels to a side of a pixel; half as many where a sheet is large."""
CELL = 24
"""Pixels of a sheet's texture to a cell of its tag."""


@dataclass
class Lens:
    """A camera of the plumb-bob model; ``k`` is k1, k2, p1, p2, k3."""

    size: tuple[int, int] = (640, 480)
    focal: tuple[float, float] = (600.0, 600.0)
    centre: tuple[float, float] = (319.5, 239.5)
    k: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def matrix(self) -> np.ndarray:
        return np.array([[self.focal[0], 0, self.centre[0]], [0, self.focal[1], self.centre[1]], [0, 0, 1.0]])

    def distorted(self, ideal: np.ndarray) -> np.ndarray:
        """Where points of the plane z = 1 are seen, px (N × 2)."""
        x, y = ideal[:, 0], ideal[:, 1]
        k1, k2, p1, p2, k3 = self.k
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return np.column_stack([u * self.focal[0] + self.centre[0], v * self.focal[1] + self.centre[1]])

    def rays(self, pixels: np.ndarray) -> np.ndarray:
        """Points of the plane z = 1 that are seen at pixels (N × 2), by a fixed point of many rounds."""
        seen = (pixels - np.array(self.centre)) / np.array(self.focal)
        ideal = seen.copy()
        for _ in range(60 if any(self.k) else 0):
            step = seen - (self.distorted(ideal) - np.array(self.centre)) / np.array(self.focal)
            ideal += step
            if np.abs(step).max() < 1e-7:
                break
        return ideal

    def projected(self, points: np.ndarray) -> np.ndarray:
        """Where points in the camera's frame (z ahead, x to the right, y down; m) are seen, px."""
        return self.distorted(points[:, :2] / points[:, 2:])


@dataclass
class Sheet:
    """A flat print: its texture, and where its middle, its right and its up are in the target's frame, m."""

    texture: np.ndarray
    size_m: tuple[float, float]
    middle: np.ndarray = field(default_factory=lambda: np.zeros(3))
    right: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    up: np.ndarray = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))


def dictionary(name: str) -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def tag_sheet(name: str, id: int, size_m: float, *, mirrored: bool = False, turned: int = 0, **place: np.ndarray) -> Sheet:
    """A tag with a white margin of one cell and a half; ``size_m`` is the edge of its black square."""
    kind = dictionary(name)
    cells = kind.markerSize + 2
    image = cv2.aruco.generateImageMarker(kind, id, cells * CELL)
    margin = CELL * 3 // 2
    image = cv2.copyMakeBorder(image, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=255)
    image = np.rot90(image, turned)
    if mirrored:
        image = image[:, ::-1]
    whole = size_m * image.shape[0] / (cells * CELL)
    return Sheet(np.ascontiguousarray(image), (whole, whole), **place)


def square(size_m: float) -> np.ndarray:
    """The corners of a tag's black square: top left, top right, bottom right, bottom left; x to the right, y up."""
    h = size_m / 2
    return np.array([[-h, h, 0.0], [h, h, 0.0], [h, -h, 0.0], [-h, -h, 0.0]])


def facing_pose(
    distance: float, tilt_deg: float = 0.0, about_deg: float = 0.0, roll_deg: float = 0.0, at: tuple[float, float] = (0.0, 0.0)
):
    """A pose that the camera sees from the front: rotation (target → camera) and translation, m.

    ``tilt_deg`` is between the print's normal and the optical axis, ``about_deg`` says which way, ``at`` is x/z and y/z.
    """
    flip = np.diag([1.0, -1.0, -1.0])  # x right, y up, z out of the print: seen from the front
    spin = rotation([0, 0, 1], roll_deg)
    a = np.radians(about_deg)
    lean = rotation([np.cos(a), np.sin(a), 0.0], tilt_deg)
    return lean @ flip @ spin, distance * np.array([at[0], at[1], 1.0])


def rotation(axis: list[float], degrees: float) -> np.ndarray:
    vector = np.array(axis, float)
    return cv2.Rodrigues(vector / np.linalg.norm(vector) * np.radians(degrees))[0]


def render(
    lens: Lens,
    sheets: list[Sheet],
    turn: np.ndarray,
    place: np.ndarray,
    *,
    blur_px: float = 0.6,
    noise: float = 2.0,
    black: float = 30.0,
    white: float = 215.0,
    background: float = 120.0,
    seed: int = 0,
    strokes: list[tuple[np.ndarray, int, float]] | None = None,
) -> np.ndarray:
    """A grey picture (uint8) of sheets in a target's frame that stands at ``turn``, ``place`` in the camera's frame.

    ``strokes`` are drawn behind them: lines through pixels (N × 2), their width in px, their grey.
    """
    random = np.random.default_rng(seed)
    w, h = lens.size
    picture = np.full((h, w), background, np.float32)
    picture += np.linspace(-8, 8, w, dtype=np.float32)[None, :]
    for _ in range(12):  # things that are no targets
        x, y = random.uniform(0, w), random.uniform(0, h)
        grey = float(random.uniform(background - 40, background + 40))
        cv2.ellipse(picture, (int(x), int(y)), (int(random.uniform(5, 60)), int(random.uniform(5, 60))), 0, 0, 360, grey, -1)
    for pixels, width, shade in strokes or []:
        cv2.polylines(picture, [np.clip(pixels, -1e4, 1e4).round().astype(np.int32)], False, shade, width, cv2.LINE_AA)
    for sheet in sorted(sheets, key=lambda it: -float((turn @ it.middle + place)[2])):
        normal = turn @ np.cross(sheet.right, sheet.up)
        middle = turn @ sheet.middle + place
        right, up = turn @ sheet.right, turn @ sheet.up
        if normal @ middle >= 0:
            continue
        a, b = sheet.size_m[0] / 2, sheet.size_m[1] / 2
        edge = np.linspace(-1, 1, 41)
        rim = np.concatenate([np.stack([edge, edge * 0 + s], 1) for s in (-1, 1)] + [np.stack([edge * 0 + s, edge], 1) for s in (-1, 1)])
        outline = middle + rim[:, :1] * a * right + rim[:, 1:] * b * up
        if (outline[:, 2] <= 1e-3).any():
            continue
        seen = lens.projected(outline)
        x0, y0 = np.maximum(np.floor(seen.min(0)).astype(int) - 1, 0)
        x1, y1 = np.minimum(np.ceil(seen.max(0)).astype(int) + 2, [w, h])
        if x0 >= x1 or y0 >= y1:
            continue
        sub = SUB if (x1 - x0) * (y1 - y0) < 200**2 else SUB // 2
        step = (np.arange((x1 - x0) * sub) + 0.5) / sub - 0.5 + x0
        stem = (np.arange((y1 - y0) * sub) + 0.5) / sub - 0.5 + y0
        grid = np.stack(np.meshgrid(step, stem), -1).reshape(-1, 2)
        rays = np.column_stack([lens.rays(grid), np.ones(len(grid))])
        points = rays * ((normal @ middle) / (rays @ normal))[:, None] - middle
        u, v = points @ right, points @ up
        rows, columns = sheet.texture.shape
        texture_x = ((u / (2 * a) + 0.5) * columns - 0.5).astype(np.float32)
        texture_y = ((0.5 - v / (2 * b)) * rows - 0.5).astype(np.float32)
        # What a sub-pixel sees of the texture is averaged in the texture.
        per = columns / max(1e-6, float(np.linalg.norm(seen.max(0) - seen.min(0))) * sub / 1.4)
        texture = cv2.GaussianBlur(sheet.texture, (0, 0), per / 2) if per > 1.5 else sheet.texture
        shape = ((y1 - y0) * sub, (x1 - x0) * sub)
        sample = cv2.remap(
            texture.astype(np.float32),
            texture_x.reshape(shape),
            texture_y.reshape(shape),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        inside = ((np.abs(u) <= a) & (np.abs(v) <= b)).reshape(shape).astype(np.float32)
        sample = black + (white - black) * sample / 255
        under = np.repeat(np.repeat(picture[y0:y1, x0:x1], sub, 0), sub, 1)
        mixed = inside * sample + (1 - inside) * under
        picture[y0:y1, x0:x1] = mixed.reshape(y1 - y0, sub, x1 - x0, sub).mean((1, 3))
    if blur_px > 0:
        picture = cv2.GaussianBlur(picture, (0, 0), blur_px)
    picture += random.normal(0, noise, picture.shape)
    return np.clip(np.round(picture), 0, 255).astype(np.uint8)


# An arm.

MOTORS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
_ORIGINS = [(0, 0, 0.055), (0.03, 0, 0.055), (0.028, 0, 0.113), (0.135, 0, 0.005), (0.061, 0, 0)]
_AXES = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (0, 1, 0), (1, 0, 0)]
_LINKS = ["base", "shoulder", "upper_arm", "lower_arm", "wrist", "gripper"]
LIMIT_RAD = 1.6


def arm_urdf() -> str:
    """Five joints with about the lengths of an SO-101."""
    text = '<robot name="arm">' + "".join(f'<link name="{link}"/>' for link in _LINKS)
    for index, motor in enumerate(MOTORS):
        origin, axis = (" ".join(map(str, it[index])) for it in (_ORIGINS, _AXES))
        text += (
            f'<joint name="{motor}" type="revolute"><origin xyz="{origin}"/><parent link="{_LINKS[index]}"/>'
            f'<child link="{_LINKS[index + 1]}"/><axis xyz="{axis}"/>'
            f'<limit lower="{-LIMIT_RAD}" upper="{LIMIT_RAD}" effort="10" velocity="10"/></joint>'
        )
    return text + "</robot>"


def arm_tip(angles: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and place of the gripper's frame in the base's; rad, m."""
    turn, place = np.eye(3), np.zeros(3)
    for motor, origin, axis in zip(MOTORS, _ORIGINS, _AXES):
        place = place + turn @ np.array(origin, float)
        turn = turn @ cv2.Rodrigues(np.array(axis, float) * angles[motor])[0]
    return turn, place


@dataclass
class Arm:
    """An arm whose zeros are off and whose gears have play, with a tag on its gripper that a webcam sees.

    ``zeros_deg`` is where a joint truly is when it reads 0. With play a joint lags behind: by half of ``play_deg``, towards where it
    came from.
    """

    zeros_deg: dict[str, float]
    play_deg: float = 1.0
    lens: Lens = field(default_factory=lambda: Lens(k=(-0.2, 0.0, 0.0, 0.0, 0.0)))
    at: tuple[float, float, float] = (0.45, -0.30, 0.50)
    looks_at: tuple[float, float, float] = (0.22, 0.0, 0.16)
    family: str = "DICT_APRILTAG_36h11"
    id: int = 3
    size_m: float = 0.04
    mounted_at: tuple[float, float, float] = (0.04, 0.005, 0.02)
    mounted_deg: tuple[float, float, float] = (3.0, -4.0, 94.0)
    noise: float = 2.0
    blur_px: float = 0.7
    seed: int = 0

    def __post_init__(self) -> None:
        self._read = {motor: 0.0 for motor in MOTORS}
        self._lag = {motor: 0.0 for motor in MOTORS}
        self._shots = 0

    def move(self, target: dict[str, float]) -> dict[str, float]:
        """Go there; gives what the joints read, rad."""
        for motor in MOTORS:
            way = target[motor] - self._read[motor]
            if abs(way) > 1e-6:
                self._lag[motor] = -np.sign(way) * np.radians(self.play_deg) / 2
        self._read = {motor: float(target[motor]) for motor in MOTORS}
        return dict(self._read)

    def truly(self) -> dict[str, float]:
        return {motor: self._read[motor] + np.radians(self.zeros_deg.get(motor, 0.0)) + self._lag[motor] for motor in MOTORS}

    def tag_in_camera(self) -> tuple[np.ndarray, np.ndarray]:
        """Tag → optical frame."""
        turn, place = arm_tip(self.truly())
        a, b, c = self.mounted_deg
        mounted = rotation([0, 0, 1], c) @ rotation([0, 1, 0], b) @ rotation([1, 0, 0], a)
        camera_turn, camera_place = optical_pose(self.at, self.looks_at)
        return camera_turn @ turn @ mounted, camera_turn @ (turn @ np.array(self.mounted_at) + place) + camera_place

    def picture(self) -> np.ndarray:
        self._shots += 1
        sheet = tag_sheet(self.family, self.id, self.size_m)
        turn, place = self.tag_in_camera()
        seed = self.seed * 1000 + self._shots
        return render(self.lens, [sheet], turn, place, blur_px=self.blur_px, noise=self.noise, seed=seed, strokes=self._links())

    def _links(self) -> list[tuple[np.ndarray, int, float]]:
        """The arm as lines in the picture, thicker where it is nearer."""
        camera_turn, camera_place = optical_pose(self.at, self.looks_at)
        turn, place, points = np.eye(3), np.zeros(3), [np.zeros(3)]
        angles = self.truly()
        for motor, origin, axis in zip(MOTORS, _ORIGINS, _AXES):
            place = place + turn @ np.array(origin, float)
            turn = turn @ cv2.Rodrigues(np.array(axis, float) * angles[motor])[0]
            points.append(place)
        points.append(place + turn @ (np.array(self.mounted_at) - [0, 0, 0.006]))
        seen = np.array(points) @ camera_turn.T + camera_place
        strokes = []
        for a, b in zip(seen, seen[1:]):
            if min(a[2], b[2]) > 0.05:
                width = max(2, round(0.028 * self.lens.focal[0] / float((a[2] + b[2]) / 2)))
                strokes += [(self.lens.projected(np.array([a, b])), width, 70.0), (self.lens.projected(np.array([b])), width + 8, 50.0)]
        return strokes

    def shows(self) -> bool:
        """Whether the whole tag is in the picture and faces the camera within 65 degrees."""
        turn, place = self.tag_in_camera()
        if place[2] < 0.05 or -(turn[:, 2] @ place) / np.linalg.norm(place) < np.cos(np.radians(65)):
            return False
        pixels = self.lens.projected(square(self.size_m) @ turn.T + place)
        return bool(((pixels > 8) & (pixels < np.array(self.lens.size) - 9)).all())


def main(path: str) -> None:
    """The picture of docs/webcam.md: what the webcam sees, and the corners that are found."""
    from body_schema.vision import Camera, Target, detect

    arm = Arm({"shoulder_lift": 4.0, "elbow_flex": -6.0, "wrist_flex": 2.5})
    arm.noise = 0.8
    arm.move({"shoulder_pan": 0.1, "shoulder_lift": 0.2, "elbow_flex": -0.35, "wrist_flex": 0.35, "wrist_roll": -0.1})
    picture = arm.picture()
    lens = arm.lens
    detection = detect(picture, Target.tag(arm.id, arm.size_m), Camera(lens.size, lens.focal, lens.centre, lens.k))
    shown = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    middle = detection.pixels.mean(axis=0)
    for name, pixel in zip(detection.names, detection.pixels):
        x, y = pixel.round().astype(int)
        cv2.circle(shown, (int(x), int(y)), 4, (0, 90, 255), 1, cv2.LINE_AA)
        u, v = (middle + 1.9 * (pixel - middle)).round().astype(int)
        at = (int(u) - 22, int(v) + 4)
        cv2.putText(shown, name, at, cv2.FONT_HERSHEY_SIMPLEX, 0.42, (255, 255, 255), 3, cv2.LINE_AA)
        cv2.putText(shown, name, at, cv2.FONT_HERSHEY_SIMPLEX, 0.42, (0, 60, 220), 1, cv2.LINE_AA)
    cv2.imwrite(path, shown[60:420, 90:570], [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    import sys

    main(sys.argv[1])
