"""Corners of printed targets in a picture, with their covariances, and why others were not taken.

OpenCV finds and reads the tags. Its corners are off by some tenths of a pixel, more where the picture is not sharp. So each tag is
fitted anew: with T the printed cells, G a Gaussian blur of width σ and q = H x the homography from the print to undistorted pixels,

    I(p) = a(p) + b(p) · f((G_σ * T)(H⁻¹ undistort(p))) + noise,    a, b linear in p (light and shade),
    f(t) = t + c t (1 - t) + d t (1 - t) (1 - 2 t)                   (the tone curve of a camera),

is fitted to the pixels p in and around the tag, by Gauss-Newton over the four corners, σ, a, b, c and d, with weights that fall for pixels
that do not fit (glare, a finger). All edges of the cells tell about the corners, and the normal equations tell how well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._errors import wrong
from ._camera import Camera
from ._targets import Tag, Target, bits_of, dictionary

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

FLOOR_PX = 0.02
"""Deviation that is added to a tag's corners: for prints that are not quite flat, and lenses that are not quite as calibrated."""
BOARD_FLOOR_PX = 0.03
"""The same of a board's corners."""
TOGETHER_PX = 10.0
"""Pixels over which errors of the model are taken to be one: with it motion blur and a camera's sharpening keep within the covariances."""


@dataclass(frozen=True)
class Limits:
    """When a tag is not taken."""

    least_cell_px: float = 2.5
    """Edge of a cell, px."""
    least_contrast: float = 30.0
    """White minus black, of 255."""
    greatest_blur_cells: float = 0.6
    """Width σ of the blur, in cells."""
    greatest_tilt_deg: float = 75.0
    """Between the print's normal and the line of sight."""
    greatest_misfit: float = 0.12
    """Share of pixels that are off by more than a quarter of the contrast."""
    border_px: float = 2.0
    """Nearest distance of a corner from the border of the picture."""


@dataclass(frozen=True)
class Rejection:
    """A part of a target that is not taken: ``reason`` is one word, ``words`` is a sentence.

    Reasons: ``blur``, ``grazing``, ``small``, ``contrast``, ``glare``, ``border``, ``lens``, ``mirrored``, ``twice``, ``other``,
    ``unreadable``, ``unseen``.
    """

    part: str
    reason: str
    words: str

    def __str__(self) -> str:
        return self.words


@dataclass(frozen=True)
class Detection:
    """Points of a target that are seen in a picture, by name; any part of them.

    ``pixels`` (M × 2) are as seen, ``undistorted`` (M × 2) as a pinhole of the same K would show them, and ``covariances`` (M × 2 × 2,
    px²) those of the undistorted ones. ``rejections`` says what was not taken, and why.
    """

    target: Target
    names: tuple[str, ...]
    pixels: Floats
    undistorted: Floats
    covariances: Floats
    rejections: tuple[Rejection, ...] = ()
    blur_px: dict[int, float] = field(default_factory=dict)
    """Width σ of the blur by tag."""

    @property
    def points_m(self) -> Floats:
        """The points that are seen, in the target's frame, M × 3, m, in the order of ``names``."""
        order = {name: index for index, name in enumerate(self.target.point_names)}
        return self.target.points_m[[order[name] for name in self.names]].reshape(-1, 3)

    @property
    def whole(self) -> bool:
        """Whether every point of the target is seen."""
        return len(self.names) == len(self.target.point_names)

    def reading(self) -> list[list[float] | None]:
        """Undistorted pixels of all points of the target in their order; ``None`` for one that is not seen."""
        seen = {name: [float(u), float(v)] for name, (u, v) in zip(self.names, self.undistorted)}
        return [seen.get(name) for name in self.target.point_names]

    def of(self, side: Target) -> Detection:
        """The same of one of the target's ``sides``."""
        names = set(side.point_names)
        kept = [index for index, name in enumerate(self.names) if name in names]
        parts = {f"tag{tag.id}" for tag in side.tags}
        return Detection(
            side,
            tuple(self.names[index] for index in kept),
            self.pixels[kept],
            self.undistorted[kept],
            self.covariances[kept],
            tuple(it for it in self.rejections if it.part in parts or it.part == self.target.name),
            {tag.id: self.blur_px[tag.id] for tag in side.tags if tag.id in self.blur_px},
        )


def grey(image: Any, camera: Camera | None = None) -> Image:
    """A picture as one grey byte a pixel; an array of bytes, H × W, or H × W × 3 in the order blue, green, red as OpenCV reads it."""
    array = np.asarray(image)
    if array.dtype != np.uint8 or array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (1, 3, 4)) or array.size == 0:
        what = f"an array of shape {array.shape} and type {array.dtype} is no picture"
        raise wrong("image", what, "pass H x W or H x W x 3 bytes (uint8), as cv2.imread gives them")
    if array.ndim == 3:
        code = {1: None, 3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}[array.shape[2]]
        array = array[:, :, 0] if code is None else np.asarray(cv2.cvtColor(array, code))
    if camera is not None and (array.shape[1], array.shape[0]) != tuple(camera.size_px):
        what = f"the picture has {array.shape[1]} x {array.shape[0]} pixels, its camera {camera.size_px[0]} x {camera.size_px[1]}"
        raise wrong("image", what, "take pictures as large as those that the camera was calibrated with")
    return np.ascontiguousarray(array)


def detect(image: Any, target: Target, camera: Camera | None = None, limits: Limits | None = None) -> Detection:
    """The target's points in a picture (bytes, H × W or H × W × 3 as OpenCV reads them).

    Without ``camera`` pixels are taken to be undistorted. Raises ``FieldError`` for what is no picture, or one of another size than
    the camera's.
    """
    picture = grey(image, camera)
    limits = limits or Limits()
    if target.kind == "charuco":
        return _board(picture, target, camera, limits)
    return _tags(picture, target, camera, limits)


# Tags.


@lru_cache(maxsize=8)
def _detector(family: str) -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    parameters.minDistanceToBorder = 0  # what is cut is to be told
    parameters.minMarkerPerimeterRate = 0.02
    return cv2.aruco.ArucoDetector(dictionary(family), parameters)


def found(picture: Image, family: str) -> tuple[list[tuple[int, Floats]], list[Floats]]:
    """Tags of a family as (id, corners 4 × 2), and squares in which nothing could be read."""
    corners, ids, unread = _detector(family).detectMarkers(picture)
    numbers: list[int] = [] if ids is None else [int(it) for it in np.asarray(ids).ravel()]
    tags = [(id, np.asarray(its, np.float64).reshape(4, 2)) for id, its in zip(numbers, corners)]
    return tags, [np.asarray(it, np.float64).reshape(4, 2) for it in unread]


def _tags(picture: Image, target: Target, camera: Camera | None, limits: Limits) -> Detection:
    seen, unread = found(picture, target.family)
    noise = _noise(picture) if seen else 0.0
    wanted = {tag.id: tag for tag in target.tags}
    rejections: list[Rejection] = []
    names: list[str] = []
    pixels: list[Floats] = []
    ideal: list[Floats] = []
    covariances: list[Floats] = []
    blurs: dict[int, float] = {}
    for id, tag in wanted.items():
        part = f"tag{id}"
        places = _distinct([corners for other, corners in seen if other == id])
        if len(places) > 1:
            rejections.append(Rejection(part, "twice", f"tag {id} is seen {len(places)} times: keep one print of it in view"))
        elif places:
            fitted, why = _one(picture, target, tag, places[0], camera, limits, noise)
            if why is not None:
                rejections.append(why)
            if fitted is not None:
                names += [f"{part}/{corner}" for corner in range(4)]
                pixels.append(fitted.pixels)
                ideal.append(fitted.ideal)
                covariances.append(fitted.covariances)
                blurs[id] = fitted.blur_px
    if not names and not rejections:
        rejections += _why_unseen(picture, target, seen, unread, limits)
    return Detection(
        target,
        tuple(names),
        np.concatenate([np.zeros((0, 2)), *pixels]),
        np.concatenate([np.zeros((0, 2)), *ideal]),
        np.concatenate([np.zeros((0, 2, 2)), *covariances]),
        tuple(rejections),
        blurs,
    )


def _distinct(places: list[Floats]) -> list[Floats]:
    """Places of a tag without those that OpenCV gives twice."""
    kept: list[Floats] = []
    for corners in places:
        size = float(np.linalg.norm(corners[0] - corners[2]))
        if all(float(np.abs(corners - other).max()) > 0.2 * size for other in kept):
            kept.append(corners)
    return kept


def _near_border(corners: Floats, picture: Image, limits: Limits) -> bool:
    height, width = picture.shape
    low, high = corners.min(axis=0), corners.max(axis=0)
    edge = limits.border_px
    return bool(low[0] < edge or low[1] < edge or high[0] > width - 1 - edge or high[1] > height - 1 - edge)


def _outside(ideal: Floats, camera: Camera) -> bool:
    """Whether undistorted pixels are where the engine takes a pinhole to see nothing: a twentieth of the picture's size outside it."""
    size = np.array(camera.size_px, float)
    return bool(((ideal < -0.05 * size) | (ideal > 1.05 * size)).any())


def _why_unseen(picture: Image, target: Target, seen: list[tuple[int, Floats]], unread: list[Floats], limits: Limits) -> list[Rejection]:
    """Why no tag of a target is seen, as far as the picture tells."""
    name = target.name
    wanted = {tag.id for tag in target.tags}
    mirrored, _ = found(np.ascontiguousarray(picture[:, ::-1]), target.family)
    if any(id in wanted for id, _ in mirrored):
        words = f"{name}: a mirrored print of it is seen: print it again, or do not flip the camera's picture"
        return [Rejection(name, "mirrored", words)]
    if seen:
        ids = ", ".join(str(id) for id in sorted({id for id, _ in seen}))
        its = ", ".join(str(id) for id in sorted(wanted))
        return [Rejection(name, "other", f"{name}: {target.family} {ids} is seen, not {its}: show the other tag, or mend its id")]
    cells = dictionary(target.family).markerSize + 2
    squares = sorted(unread, key=lambda it: -abs(cv2.contourArea(it.astype(np.float32))))
    for corners in squares:
        edge = math.sqrt(abs(cv2.contourArea(corners.astype(np.float32))))
        if edge < 8:
            break
        low, high, blur = _edges(picture, corners, cells)
        tiny = edge / cells < limits.least_cell_px
        if high - low < (limits.least_contrast if tiny else 12):
            continue
        if _near_border(corners, picture, limits):
            return [Rejection(name, "border", f"{name}: a square is cut by the border of the picture: move it into view")]
        if tiny:
            words = f"{name}: a square of {edge:.1f} px is too small to be read: come nearer, or print it larger"
            return [Rejection(name, "small", words)]
        if high - low < limits.least_contrast:
            words = f"{name}: a square has a contrast of {high - low:.0f} of 255: more light on it, no glare"
            return [Rejection(name, "contrast", words)]
        if blur > limits.greatest_blur_cells * edge / cells:
            return [Rejection(name, "blur", f"{name}: a square is blurred by {blur:.1f} px: focus, or let the robot stand still first")]
        words = f"{name}: a square cannot be read: it is covered, in glare, or no {target.family}"
        return [Rejection(name, "unreadable", words)]
    return [Rejection(name, "unseen", f"{name}: no tag is seen")]


def _edges(picture: Image, corners: Floats, cells: int) -> tuple[float, float, float]:
    """Dark and bright beside the edges of a square, of 255, and the width σ of their blur, px."""
    middle = corners.mean(axis=0)
    # From one cell inside to one outside.
    reach = np.linspace(-0.9, 0.9, 37) * 2 / cells
    profiles, widths = [], []
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        along = b - a
        normal = np.array([along[1], -along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
        for part in (0.3, 0.4, 0.5, 0.6, 0.7):
            out = a + part * along - middle
            points = (middle + (1 + reach[:, None]) * out).astype(np.float32)
            line = cv2.remap(picture, points[None, :, 0], points[None, :, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            profiles.append(np.asarray(line, np.float64).ravel())
            widths.append(abs(float(normal @ out)) * (reach[1] - reach[0]))
    lines = np.array(profiles)
    low, high = float(np.median(lines[:, 4:12])), float(np.median(lines[:, -12:-4]))
    steepest = float(np.median(np.abs(np.diff(lines, axis=1)).max(axis=1) / np.maximum(widths, 1e-9)))
    return low, high, abs(high - low) / max(steepest * math.sqrt(2 * math.pi), 1e-9)


@dataclass(frozen=True)
class _Fit:
    pixels: Floats
    ideal: Floats
    covariances: Floats
    blur_px: float
    contrast: float
    misfit: float


def _one(
    picture: Image, target: Target, tag: Tag, start: Floats, camera: Camera | None, limits: Limits, noise: float
) -> tuple[_Fit | None, Rejection | None]:
    part = f"tag{tag.id}"
    cells = dictionary(target.family).markerSize + 2

    def no(reason: str, words: str) -> tuple[None, Rejection]:
        return None, Rejection(part, reason, f"tag {tag.id} {words}")

    if _near_border(start, picture, limits):
        return no("border", "is cut by the border of the picture, or nearly so: move it into view")
    area = math.sqrt(abs(cv2.contourArea(start.astype(np.float32))))
    if area / cells < limits.least_cell_px:
        words = f"is {area:.1f} px large, and {limits.least_cell_px * cells:.1f} are needed: come nearer, or print it larger"
        return no("small", words)
    low, high, blur = _edges(picture, start, cells)
    if high - low < limits.least_contrast:
        return no("contrast", f"has a contrast of {high - low:.0f} of 255: more light on it, no glare")
    fitted = _fit(picture, bits_of(target.family, tag.id), start, camera, noise)
    if fitted is None:
        lens = camera is not None and not np.isfinite(camera.undistort(start)).all()
        if lens:
            return no("lens", "is where the model of the lens has no inverse: move it nearer to the middle of the picture")
        if blur > limits.greatest_blur_cells * area / cells:
            return no("blur", f"is blurred by {blur:.1f} px, cells have {area / cells:.1f}: focus, or let the robot stand still first")
        return no("glare", "does not look like its print: glare, something before it, or a print that is not flat")
    if fitted.contrast < limits.least_contrast:
        return no("contrast", f"has a contrast of {fitted.contrast:.0f} of 255: more light on it, no glare")
    if fitted.blur_px > limits.greatest_blur_cells * area / cells:
        return no(
            "blur", f"is blurred by {fitted.blur_px:.1f} px, cells have {area / cells:.1f}: focus, or let the robot stand still first"
        )
    if fitted.misfit > limits.greatest_misfit:
        return no("glare", f"does not look like its print in {fitted.misfit * 100:.0f} % of its pixels: glare, or something before it")
    if _near_border(fitted.pixels, picture, limits):
        return no("border", "is cut by the border of the picture, or nearly so: move it into view")
    if camera is not None and _outside(fitted.ideal, camera):
        return no("border", "is outside the picture once the lens is taken out: move it nearer to the middle")
    tilt = _tilt(fitted.ideal, tag.size_m, camera, picture)
    if tilt > limits.greatest_tilt_deg:
        return no("grazing", f"is seen at {tilt:.0f} degrees from its normal: turn it towards the camera")
    return fitted, None


def _tilt(ideal: Floats, size_m: float, camera: Camera | None, picture: Image) -> float:
    """The angle between a tag's normal and the line of sight, deg; of its two poses the one that fits better."""
    matrix = camera.K if camera is not None else _guess(picture)
    half = size_m / 2
    square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]], np.float64)
    _, turns, places, _ = cv2.solvePnPGeneric(square, ideal.reshape(4, 1, 2), matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    if not turns:
        return 90.0
    normal = cv2.Rodrigues(np.asarray(turns[0]))[0][:, 2]
    sight = np.asarray(places[0], np.float64).ravel()
    cosine = -float(normal @ sight) / max(float(np.linalg.norm(sight)), 1e-12)
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


def _guess(picture: Image) -> Floats:
    height, width = picture.shape
    return np.array([[width, 0, (width - 1) / 2], [0, width, (height - 1) / 2], [0, 0, 1]], float)


TEXTURE = 16
"""Texture pixels to a cell."""
MARGIN = 0.45
"""How far outside the black square pixels count, in cells."""


@lru_cache(maxsize=64)
def _texture(bits: bytes, cells: int, blur: float) -> NDArray[np.float32]:
    """The print with a white margin of one cell, 0 to 1, blurred by ``blur`` texture pixels."""
    pattern = np.pad(np.frombuffer(bits, np.uint8).reshape(cells, cells), 1, constant_values=1)
    drawn = np.kron(pattern, np.ones((TEXTURE, TEXTURE))).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(drawn, (0, 0), blur) if blur > 0.3 else drawn, np.float32)


def _sampled(texture: NDArray[np.float32], places: Floats) -> Floats:
    """The texture at places (N × 2; x, y) between its pixels; beyond its border as at it. OpenCV 4 rounds places to 1/32."""
    last = texture.shape[0] - 1
    inside = np.clip(places, 0.0, last - 1e-6)
    corner = inside.astype(np.int64)
    (x, y), (a, b) = corner.T, (inside - corner).T
    flat = texture.ravel()
    at = y * (last + 1) + x
    above = flat[at] * (1 - a) + flat[at + 1] * a
    below = flat[at + last + 1] * (1 - a) + flat[at + last + 2] * a
    return np.asarray(above * (1 - b) + below * b, np.float64)


def _lens_over(camera: Camera | None, region: tuple[int, int, int, int]) -> Callable[[Floats, Floats], Floats] | None:
    """``undistort`` over a region (x, y, width, height), as a polynomial; gives len(ys) × len(xs) × 2. ``None`` where it has no inverse."""
    if camera is None:
        return lambda xs, ys: np.stack(np.meshgrid(xs, ys), axis=-1)
    x0, y0, w, h = region

    def powers(at: Floats, low: float, length: float) -> Floats:
        return np.asarray(np.polynomial.chebyshev.chebvander((at - low) / length * 2 - 1, 5))

    nodes = np.cos((np.arange(12) + 0.5) * np.pi / 12) * 0.5 + 0.5
    xs, ys = x0 - 1 + nodes * (w + 1), y0 - 1 + nodes * (h + 1)
    known = camera.undistort(np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)).reshape(12, 12, 2)
    if not np.isfinite(known).all():
        return None
    over_x, over_y = np.linalg.pinv(powers(xs, x0 - 1, w + 1)), np.linalg.pinv(powers(ys, y0 - 1, h + 1))
    coefficients = np.einsum("ai,ijk,bj->abk", over_y, known, over_x)
    return lambda at_x, at_y: np.einsum(
        "ia,abk,jb->ijk", powers(at_y, y0 - 1, h + 1), coefficients, powers(at_x, x0 - 1, w + 1), optimize=True
    )


def _homography(corners: Floats) -> Floats:
    """From the unit square (top left, top right, bottom right, bottom left; y down) to four pixels."""
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    rows = []
    for (x, y), (u, v) in zip(unit, corners):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y])
    h = np.linalg.solve(np.array(rows, float), corners.reshape(8))
    return np.append(h, 1.0).reshape(3, 3)


def _mapped(h: Floats, points: Floats) -> Floats:
    x, y = points[:, 0], points[:, 1]
    w = h[2, 0] * x + h[2, 1] * y + h[2, 2]
    return np.column_stack([(h[0, 0] * x + h[0, 1] * y + h[0, 2]) / w, (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / w])


def _fit(picture: Image, bits: NDArray[np.uint8], start: Floats, camera: Camera | None, noise: float) -> _Fit | None:
    """The tag fitted to the pixels; ``None`` where that does not converge."""
    cells = bits.shape[0]
    area = math.sqrt(abs(cv2.contourArea(start.astype(np.float32))))
    # A large tag has more pixels than it needs: means of squares of them are fitted.
    pack = max(1, int(area // 90))
    cell = area / cells / pack
    sub = 3
    spread = (start - start.mean(axis=0)) * (1 + 2.6 / cells) + start.mean(axis=0)
    low = np.floor(np.minimum(start - 4, spread - 2).min(axis=0)).astype(int)
    high = np.ceil(np.maximum(start + 4, spread + 2).max(axis=0)).astype(int)
    height, width = picture.shape
    x0, y0 = max(int(low[0]), 0), max(int(low[1]), 0)
    w, h = (min(int(high[0]) + 1, width) - x0) // pack, (min(int(high[1]) + 1, height) - y0) // pack
    if min(w, h) < 8:
        return None
    seen = picture[y0 : y0 + h * pack, x0 : x0 + w * pack].astype(np.float64).reshape(h, pack, w, pack).mean(axis=(1, 3))
    corners = start.copy() if camera is None else camera.undistort(start)
    if not np.isfinite(corners).all():
        return None
    lens = _lens_over(camera, (x0, y0, w * pack, h * pack))
    if lens is None:
        return None

    def ideal_at(per: int) -> Floats:
        """Where the middles of w · per × h · per equal squares would be without the lens."""
        xs = (np.arange(w * per) + 0.5) * pack / per - 0.5 + x0
        ys = (np.arange(h * per) + 0.5) * pack / per - 0.5 + y0
        return lens(xs, ys)

    fine = ideal_at(sub).reshape(-1, 2)
    grid = ideal_at(1)
    coarse = grid.reshape(-1, 2)
    du_x, du_y = np.gradient(grid, axis=1), np.gradient(grid, axis=0)

    texture = _texture(bits.tobytes(), cells, 0.35 * TEXTURE / (cell * sub))
    light = np.stack([np.ones((h, w)), *np.meshgrid(np.linspace(-1, 1, w), np.linspace(-1, 1, h))], axis=-1)

    def drawn(at: Floats) -> Floats | None:
        """The print at these corners before it is blurred, h × w."""
        try:
            back = np.linalg.inv(_homography(at))
        except np.linalg.LinAlgError:
            return None
        place = (_mapped(np.asarray(back, np.float64), fine) * cells + 1) * TEXTURE - 0.5
        return np.asarray(_sampled(texture, place).reshape(h, sub, w, sub).mean(axis=(1, 3)), np.float64)

    blur = min(max(0.3 * cell, 0.8), 2.5)
    normal = np.zeros((0, 0))
    noise2 = 1.0
    first = corners.copy()
    weights = np.ones((h, w))
    tone = np.zeros(2)
    most = math.inf
    for _ in range(16):
        sharp = drawn(corners)
        if sharp is None:
            return None
        linear = np.asarray(cv2.GaussianBlur(sharp, (0, 0), blur))
        wider = np.asarray(cv2.GaussianBlur(sharp, (0, 0), blur + 0.05))
        # What a camera makes of light: concave, and steeper or flatter in the middle.
        bends = np.stack([linear * (1 - linear), linear * (1 - linear) * (1 - 2 * linear)], axis=-1)
        model = linear + bends @ tone
        rise = 1 + tone[0] * (1 - 2 * linear) + tone[1] * (1 - 6 * linear + 6 * linear**2)
        h_now = _homography(corners)
        inner = _mapped(np.asarray(np.linalg.inv(h_now), np.float64), coarse)
        edge = MARGIN / cells
        inside = ((inner > -edge) & (inner < 1 + edge)).all(axis=1).reshape(h, w)
        if inside.sum() < 60:
            return None
        lit = np.concatenate([light, light * model[:, :, None]], axis=-1)[inside]
        value = seen[inside]
        weight = weights[inside]
        amounts = np.linalg.lstsq(lit * weight[:, None], value * weight, rcond=None)[0]
        left = value - lit @ amounts
        gain = light[inside] @ amounts[3:]
        scale = max(1.4826 * float(np.median(np.abs(left))), 0.5)
        weight = 1.0 / np.maximum(1.0, np.abs(left) / (2.5 * scale))
        weight = np.sqrt(weight)
        weights[inside] = weight
        # How the picture changes as a corner moves: against its gradient, taken along undistorted pixels.
        gx, gy = np.gradient(model, axis=1)[inside], np.gradient(model, axis=0)[inside]
        ax, ay = du_x[inside], du_y[inside]
        det = ax[:, 0] * ay[:, 1] - ax[:, 1] * ay[:, 0]
        gu = (gx * ay[:, 1] - gy * ax[:, 1]) / det
        gv = (gy * ax[:, 0] - gx * ay[:, 0]) / det
        print_points = inner[inside.ravel()]
        columns = []
        for index in range(8):
            moved = corners.copy().reshape(8)
            moved[index] += 1e-3
            shift = (_mapped(_homography(moved.reshape(4, 2)), print_points) - coarse[inside.ravel()]) / 1e-3
            columns.append(-(gu * shift[:, 0] + gv * shift[:, 1]) * gain)
        columns.append((rise * (wider - linear))[inside] / 0.05 * gain)
        columns += [bends[inside][:, 0] * gain, bends[inside][:, 1] * gain]
        jacobian = np.column_stack([*columns, lit]) * weight[:, None]
        normal = jacobian.T @ jacobian
        try:
            step = np.linalg.solve(normal + 1e-9 * np.diag(np.diag(normal)) + 1e-12 * np.eye(len(normal)), jacobian.T @ (left * weight))
        except np.linalg.LinAlgError:
            return None
        move = step[:8].reshape(4, 2)
        most = float(np.abs(move).max())
        if not math.isfinite(most):
            return None
        shrink = min(1.0, 0.35 * max(cell, 2.0) * pack / max(most, 1e-12))
        corners = corners + move * shrink
        blur = min(max(blur + float(np.clip(step[8], -0.5, 0.5)) * shrink, 0.15), 12.0)
        tone = np.clip(tone + np.clip(step[9:11], -0.3, 0.3) * shrink, -0.95, 0.95)
        noise2 = float((weight**2 * left**2).sum() / max(len(left) - 17, 1))
        if most < 3e-3 * pack:
            break
    # Where a picture is as sharp as its pixels, width and tone go on to and fro; corners no longer do.
    if most > 0.02 * pack or float(np.abs(corners - first).max()) > max(4.0, 1.5 * cell * pack):
        return None
    contrast = float(np.median(gain))
    misfit = float((np.abs(left) > 0.25 * abs(contrast)).mean()) if contrast > 0 else 1.0
    try:
        # What is left beyond the picture's noise is the model's, and errs together over neighbouring pixels.
        excess2 = max(0.0, noise2 - (noise / pack) ** 2)
        spread_of = np.linalg.inv(normal) * (noise2 + (TOGETHER_PX - 1) * excess2)
    except np.linalg.LinAlgError:
        return None
    covariances = np.array([spread_of[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] for i in range(4)]) + FLOOR_PX**2 * np.eye(2)
    as_seen = corners if camera is None else camera.distort(corners)
    return _Fit(as_seen, corners, covariances, blur * pack, contrast, misfit)


# Boards.


def _board(picture: Image, target: Target, camera: Camera | None, limits: Limits) -> Detection:
    """Corners of a chessboard, between the tags that are read."""
    board = cv2.aruco.CharucoBoard((target.columns, target.rows), target.square_m, target.size_m, dictionary(target.family))
    detector = cv2.aruco.CharucoDetector(board)
    corners, ids, tags, tag_ids = detector.detectBoard(picture)
    empty = (np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    name = target.name
    if ids is None or len(ids) == 0:
        if tag_ids is not None and len(tag_ids) > 0:
            read = sorted({int(it) for it in np.asarray(tag_ids).ravel()})
            words = f"{name}: {len(read)} tags are read, and no corner is between them: show more of the board, or mend its description"
            return Detection(target, (), *empty, (Rejection(name, "other", words),))
        seen, unread = found(picture, target.family)
        return Detection(target, (), *empty, tuple(_why_unseen(picture, target, seen, unread, limits)))
    pixels = np.asarray(corners, np.float64).reshape(-1, 2)
    numbers = [int(it) for it in np.asarray(ids).ravel()]
    # Some versions of OpenCV give corners of boards with half a pixel on top.
    # The window ends before the tags begin.
    margin = _least_distance(target.points_m[numbers, :2], pixels) * (target.square_m - target.size_m) / 2
    reach = int(np.clip(margin, 2, 8))
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-4)
    start = np.ascontiguousarray(pixels.reshape(-1, 1, 2), np.float32)
    pixels = np.asarray(cv2.cornerSubPix(picture, start, (reach, reach), (-1, -1), criteria), np.float64).reshape(-1, 2)
    gx = np.asarray(cv2.Sobel(picture, cv2.CV_64F, 1, 0, ksize=3)) / 8
    gy = np.asarray(cv2.Sobel(picture, cv2.CV_64F, 0, 1, ksize=3)) / 8
    noise = _noise(picture)
    ideal = pixels.copy() if camera is None else camera.undistort(pixels)
    points = target.points_m[numbers, :2]
    kept, covariances, rejections = [], [], []
    fits = _board_misfit(points, ideal)
    for index, (pixel, number) in enumerate(zip(pixels, numbers)):
        part = f"corner/{number}"
        if _near_border(pixel[None, :], picture, limits):
            rejections.append(Rejection(part, "border", f"{name}: {part} is at the border of the picture"))
            continue
        if not np.isfinite(ideal[index]).all():
            rejections.append(Rejection(part, "lens", f"{name}: {part} is where the model of the lens has no inverse"))
            continue
        if camera is not None and _outside(ideal[index][None, :], camera):
            words = f"{name}: {part} is outside the picture once the lens is taken out"
            rejections.append(Rejection(part, "border", words))
            continue
        if fits[index]:
            rejections.append(Rejection(part, "unreadable", f"{name}: {part} does not fit the other corners"))
            continue
        # cornerSubPix solves sum g gT (q - p) = 0 over a window: its covariance is that of its gradients.
        u, v = (int(round(float(it))) for it in pixel)
        window = (slice(max(v - reach, 0), v + reach + 1), slice(max(u - reach, 0), u + reach + 1))
        a, b = gx[window].ravel(), gy[window].ravel()
        tensor = np.array([[a @ a, a @ b], [a @ b, b @ b]])
        if np.linalg.eigvalsh(tensor)[0] < 20 * noise**2:
            rejections.append(Rejection(part, "contrast", f"{name}: {part} has too little contrast"))
            continue
        covariances.append(np.linalg.inv(tensor) * noise**2 + BOARD_FLOOR_PX**2 * np.eye(2))
        kept.append(index)
    return Detection(
        target,
        tuple(f"corner/{numbers[index]}" for index in kept),
        pixels[kept].reshape(-1, 2),
        ideal[kept].reshape(-1, 2),
        np.array(covariances).reshape(-1, 2, 2),
        tuple(rejections),
    )


def _least_distance(points: Floats, pixels: Floats) -> float:
    """The least distance of two corners in the picture over their distance on the board, px per m."""
    if len(points) < 2:
        return 20.0 / 0.03
    apart = np.linalg.norm(points[:, None] - points[None, :], axis=2) + np.eye(len(points))
    seen = np.linalg.norm(pixels[:, None] - pixels[None, :], axis=2) + 1e9 * np.eye(len(points))
    return float((seen / apart).min())


def _noise(picture: Image) -> float:
    """Standard deviation of a picture's noise, of 255 (J. Immerkaer, "Fast noise variance estimation", 1996; by the median)."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float64)
    left = np.asarray(cv2.filter2D(picture, cv2.CV_64F, kernel))
    return max(float(np.median(np.abs(left))) / 0.6745 / 6, 0.3)


def _board_misfit(points: Floats, pixels: Floats) -> list[bool]:
    """Corners that are far off the homography of most."""
    usable = np.isfinite(pixels).all(axis=1)
    if int(usable.sum()) < 8:
        return [False] * len(points)
    plane = points[usable].astype(np.float64)
    homography, _ = cv2.findHomography(plane, pixels[usable], cv2.RANSAC, 3.0)
    if homography is None:
        return [False] * len(points)
    off = np.linalg.norm(_mapped(np.asarray(homography, np.float64), points) - np.nan_to_num(pixels), axis=1)
    # A lens that is not known bends the board by some pixels.
    return [bool(it) for it in off > max(8.0, 5 * float(np.median(off[usable])))]
