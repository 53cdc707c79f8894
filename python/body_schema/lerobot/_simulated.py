"""An SO-101 in MuJoCo: zeros that are off, play in its gears, a printed tag on its gripper, a webcam with a lens."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._errors import Error, MissingExtraError, wrong
from .._transforms import Pose, about, number, of_rpy, quaternion, vector
from .._urdf import Tree, parse_urdf
from ..exports._lerobot import MOTORS, STEPS_PER_DEG, Calibration, of_motors
from ..vision import Camera, Target
from ..vision._place import optical_pose
from ..vision._targets import bits_of
from ._description import BASE, TIP, mjcf_of, so101_urdf
from ._setup import Setup

Floats = NDArray[np.float64]

_CELL = 32
"""Pixels of the print to a cell of its tag."""
_FINE = 2
"""Rendered pixels to a side of a pixel."""
_WIDER = 1.25
"""How much larger the rendered picture is than what the lens shows of it."""


@dataclass
class Truth:
    """What nobody tells the estimator. Degrees and metres; places are in the frame of the base, the tag's in that of the gripper."""

    zeros_deg: dict[str, float]
    play_deg: dict[str, float]
    camera_at_m: tuple[float, float, float]
    camera_looks_at_m: tuple[float, float, float]
    tag_at_m: tuple[float, float, float]
    tag_rpy_deg: tuple[float, float, float]
    links_mm: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """By joint, by how much its origin is elsewhere than described."""

    def to_dict(self) -> dict[str, Any]:
        """As it is written to a file."""
        return asdict(self)

    @classmethod
    def of_dict(cls, told: Mapping[str, Any]) -> Truth:
        """What ``to_dict`` gave, out of a recording."""
        try:
            its: dict[str, Any] = {key: tuple(it) if isinstance(it, list) else it for key, it in told.items()}
            return cls(**its)
        except TypeError as error:
            raise wrong("--recording", f"its truth is none ({error})", "record again") from None

    def tree(self) -> Tree:
        """The true arm, its zeros as described."""
        tree = parse_urdf(so101_urdf())
        joints = {}
        for name, joint in tree.joints.items():
            off = self.links_mm.get(name, (0.0, 0.0, 0.0))
            at = vector([a + b / 1e3 for a, b in zip(joint.origin.at, off)])
            joints[name] = replace(joint, origin=replace(joint.origin, at=at))
        return replace(tree, joints=joints, above={it.child: it for it in joints.values()})

    def tag(self, tree: Tree, readings_rad: Mapping[str, float]) -> Pose:
        """Where the tag is in the frame of the base at readings (rad) without play; ``tree`` is ``tree()``."""
        angles = {name: readings_rad[name] + math.radians(self.zeros_deg.get(name, 0.0)) for name in MOTORS}
        return tree.pose(TIP, BASE, angles) @ Pose(of_rpy([math.radians(it) for it in self.tag_rpy_deg]), vector(self.tag_at_m))


def truth_of(setup: Setup) -> Truth:
    """A truth drawn by the setup's seed: zeros off by up to 8 degrees, play of 1 degree, camera and tag off from where they are taken to be,
    by up to what ``camera_within`` and ``tag_within`` say (the tag's place by two thirds, its angles by a third of that).
    """
    random = np.random.default_rng(setup.seed)
    zeros = {name: float(random.uniform(-8.0, 8.0)) for name in MOTORS}

    def within(radius: float) -> Floats:
        direction = random.normal(size=3)
        return np.asarray(direction / np.linalg.norm(direction) * radius * random.uniform() ** (1 / 3), np.float64)

    guessed, looks = np.array(setup.camera_at), np.array(setup.looks_at)
    at = guessed + within(setup.camera_within[0])
    ahead = looks - guessed
    # The camera is turned by up to that angle about any axis across where it looks; its picture stays upright.
    across = np.cross(ahead, within(1.0))
    angle = math.radians(setup.camera_within[1]) * random.uniform()
    turned = np.array(about([float(it) for it in across], angle)) @ ahead
    tag_at = np.array(setup.tag_at) + within(setup.tag_within[0] * 2 / 3)
    tag_rpy = np.array(setup.tag_rpy_deg) + random.uniform(-1.0, 1.0, 3) * setup.tag_within[1] / 3

    def three(it: Floats) -> tuple[float, float, float]:
        return (float(it[0]), float(it[1]), float(it[2]))

    return Truth(zeros, dict.fromkeys(MOTORS, 1.0), three(at), three(at + turned), three(tag_at), three(tag_rpy))


def simulated_calibration() -> Calibration:
    """The calibration file of the simulated arm."""
    limits = {"shoulder_pan": 1250, "shoulder_lift": 1130, "elbow_flex": 1100, "wrist_flex": 1075, "wrist_roll": 2047}
    motors: dict[str, dict[str, int]] = {}
    for index, name in enumerate(MOTORS):
        half = limits[name]
        offset = 140 * index - 310
        motors[name] = {"id": index + 1, "drive_mode": 0, "homing_offset": offset, "range_min": 2047 - half, "range_max": 2047 + half}
    motors["gripper"] = {"id": 6, "drive_mode": 0, "homing_offset": 1020, "range_min": 2020, "range_max": 3480}
    return of_motors(motors, "simulated")


def webcam() -> Camera:
    """The camera of the simulated arm, as its intrinsics say: 640 × 480, with a lens of k1 = -0.2."""
    return Camera((640, 480), (600.0, 600.0), (319.5, 239.5), (-0.2,), name="webcam")


class SimulatedArm:
    """An arm in MuJoCo. Its joints go where they are told to but for 0.2 degrees, are read in steps of the encoder, and lag behind: by
    half of their play, towards where they came from. Needs MuJoCo: ``pip install mujoco``.
    """

    def __init__(self, truth: Truth, camera: Camera, target: Target, seed: int = 0, *, noise: float = 2.0, blur_px: float = 0.7) -> None:
        if sys.platform == "linux" and not any(key in os.environ for key in ("DISPLAY", "WAYLAND_DISPLAY")):
            os.environ.setdefault("MUJOCO_GL", "egl")
        try:
            import mujoco  # type: ignore[import-untyped,unused-ignore]
        except ImportError as error:
            raise MissingExtraError(f"--robot simulated needs MuJoCo, which cannot be imported ({error}); pip install mujoco") from None
        self.truth, self.camera, self.target = truth, camera, target
        self._noise, self._blur = noise, blur_px
        self._random = np.random.default_rng([seed, 7])
        self._read = dict.fromkeys(MOTORS, 0.0)
        self._lag = dict.fromkeys(MOTORS, 0.0)
        width, height = camera.size_px
        size = [math.ceil(it * _WIDER) * _FINE for it in (width, height)]
        sheet, whole_m = _sheet(target)
        scene = self._scene(size, whole_m)
        try:
            self._model = mujoco.MjModel.from_xml_string(scene, {"tag.png": sheet})
            self._data = mujoco.MjData(self._model)
            self._renderer = mujoco.Renderer(self._model, size[1], size[0])
        except Exception as error:
            what = f"MuJoCo cannot render here ({' '.join(str(error).split())[:120]})"
            raise Error(f"--robot simulated: {what}; set MUJOCO_GL=egl or MUJOCO_GL=osmesa, and install that library") from None
        self._mujoco = mujoco
        # Where every fine pixel of the picture lies in the rendered one.
        step = [(np.arange(it * _FINE) + 0.5) / _FINE - 0.5 for it in (width, height)]
        grid = np.stack(np.meshgrid(*step), -1).reshape(-1, 2)
        ideal = grid.copy()
        for _ in range(40):
            # `undistort` is exact at the rims of any lens, and slow: the lens of this camera contracts.
            off = grid - camera.distort(ideal)
            ideal += off
            if float(np.abs(off).max()) < 1e-4:
                break
        ideal = (ideal - np.array(camera.centre_px)) / np.array(camera.focal_px)
        wide = ideal * camera.focal_px[1] * _FINE + (np.array(size) - 1) / 2
        self._across, self._down = (wide[:, axis].astype(np.float32).reshape(height * _FINE, width * _FINE) for axis in range(2))

    def _scene(self, size: list[int], whole_m: float) -> str:
        truth = self.truth
        tag_turn = " ".join(map(number, quaternion(of_rpy([math.radians(it) for it in truth.tag_rpy_deg]))))
        half = whole_m / 2
        place = " ".join(map(number, truth.tag_at_m))
        inside = (
            '<geom type="box" pos="0 0 -0.02" size="0.012 0.02 0.022" rgba="0.15 0.15 0.16 1"/>\n'
            '<geom type="box" pos="0 0.016 -0.07" size="0.008 0.004 0.03" rgba="0.8 0.65 0.2 1"/>\n'
            '<geom type="box" pos="0 -0.016 -0.07" size="0.008 0.004 0.03" rgba="0.8 0.65 0.2 1"/>\n'
            f'<geom type="mesh" mesh="tag" pos="{place}" quat="{tag_turn}" material="tag" contype="0" conaffinity="0"/>\n'
            f'<body pos="{place}" quat="{tag_turn}"><geom type="box" pos="0 0 -0.0012" size="{half} {half} 0.001" rgba="0.7 0.7 0.7 1"/></body>'
        )
        base = '<geom type="box" pos="0 0 0.02" size="0.05 0.035 0.02" rgba="0.8 0.65 0.2 1"/>'
        scene = mjcf_of(truth.tree(), {}, {TIP: inside, BASE: base})
        turn, shift = optical_pose(truth.camera_at_m, truth.camera_looks_at_m)
        at = -turn.T @ shift
        axes = " ".join(map(number, [*turn[0], *(-turn[1])]))
        fovy = math.degrees(2 * math.atan(size[1] / 2 / (self.camera.focal_px[1] * _FINE)))
        more = (
            f'<visual><global offwidth="{size[0]}" offheight="{size[1]}"/><quality offsamples="4"/><map znear="0.02" zfar="20"/>'
            '<headlight ambient="0.55 0.55 0.55" diffuse="0.25 0.25 0.25" specular="0 0 0"/></visual>'
            '<asset><texture name="tag" type="2d" file="tag.png"/>'
            '<material name="tag" texture="tag" specular="0" shininess="0" reflectance="0"/>'
            f'<mesh name="tag" inertia="shell" vertex="{-half} {half} 0 {half} {half} 0 {half} {-half} 0 {-half} {-half} 0" '
            'texcoord="0 0 1 0 1 1 0 1" face="0 2 1 0 3 2"/></asset>'
        )
        scene = scene.replace("  <worldbody>\n", f"  {more}\n  <worldbody>\n", 1)
        eye = f'<camera name="eye" pos="{" ".join(map(number, at))}" xyaxes="{axes}" fovy="{number(fovy)}"/>'
        world = (
            '<light pos="0.3 0.2 1.5" dir="-0.1 -0.1 -1" diffuse="0.35 0.35 0.35" specular="0 0 0" castshadow="true"/>'
            '<geom type="box" pos="0 0 -0.01" size="1.2 1.2 0.01" rgba="0.62 0.58 0.5 1"/>'
        )
        return scene.replace("  </worldbody>", f"    {eye}{world}\n  </worldbody>", 1)

    def move_to(self, configuration: Mapping[str, float]) -> None:
        """Go to joint positions (rad)."""
        for name in MOTORS:
            aim = configuration[name] + math.radians(float(self._random.normal(0.0, 0.2)))
            way = aim - self._read[name]
            if abs(way) > 1e-6:
                self._lag[name] = -math.copysign(math.radians(self.truth.play_deg.get(name, 0.0)) / 2, way)
            self._read[name] = aim

    def read_joints(self) -> dict[str, float]:
        """What the encoders read, rad, in their steps."""
        return {name: math.radians(round(math.degrees(it) * STEPS_PER_DEG) / STEPS_PER_DEG) for name, it in self._read.items()}

    def truly(self) -> dict[str, float]:
        """Where the joints truly are, rad."""
        return {name: it + math.radians(self.truth.zeros_deg.get(name, 0.0)) + self._lag[name] for name, it in self._read.items()}

    def grab(self) -> NDArray[np.uint8]:
        """The picture of the webcam, bytes, H × W × 3."""
        for name, angle in self.truly().items():
            self._data.joint(name).qpos[0] = angle
        self._mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, camera="eye")
        rendered = self._renderer.render()[:, :, ::-1].astype(np.float32)
        lens = cv2.remap(rendered, self._across, self._down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        width, height = self.camera.size_px
        picture = lens.reshape(height, _FINE, width, _FINE, 3).mean((1, 3))
        if self._blur > 0:
            picture = cv2.GaussianBlur(picture, (0, 0), self._blur)
        picture = picture + self._random.normal(0.0, self._noise, picture.shape)
        return np.asarray(np.clip(np.round(picture), 0, 255), np.uint8)

    def close(self) -> None:
        """Let go of the renderer."""
        self._renderer.close()


def _sheet(target: Target) -> tuple[bytes, float]:
    """The print of a tag with its white margin, as PNG, and how large all of it is, m."""
    tag = target.tags[0]
    cells = np.pad(bits_of(target.family, tag.id), 1, constant_values=1)
    large = np.kron(cells, np.ones((_CELL, _CELL), np.uint8)) * np.uint8(255)
    _, coded = cv2.imencode(".png", large)
    return coded.tobytes(), tag.size_m * len(cells) / (len(cells) - 2)
