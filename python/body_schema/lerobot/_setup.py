"""What is known before the first movement: the arm, its calibration file, the camera, the tag, and where both are, about."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._errors import wrong
from .._session import Session
from .._urdf import Tree, parse_urdf
from ..exports._lerobot import MOTORS, Calibration, of_motors
from ..vision import Camera, Target, Watcher

Three = tuple[float, float, float]

CAMERA_AT, LOOKS_AT = (0.42, -0.32, 0.45), (0.22, 0.0, 0.2)
"""Where a webcam sees most of what the gripper's upper side does, m, in the frame of an SO-101's base."""
TAG_AT, TAG_RPY_DEG = (0.03, 0.0, -0.05), (-90.0, 0.0, -90.0)
"""A tag on the upper side of an SO-101's gripper, its upper edge ahead, in the frame of the gripper; m and degrees."""
CAMERA_WITHIN, TAG_WITHIN = (0.1, 15.0), (0.03, 15.0)
"""How well these are known by eye, m and degrees."""

MARGIN_DEG = 6.0
"""How far movements stay away from the ends of the ranges."""
APPROACH_DEG = 4.0
"""How far before a posture the side begins from which it is approached; less than the margin."""
GIVEN_DEG = 0.5
"""A camera or a tag whose direction is known to this is given: the zero that it decides is learned."""

CLEAR_M, FINGERS_M = 0.07, 0.1
"""How far the middles of hand and arm stay apart, and how long the fingers are."""

CAMERA_KEYS = ("size_px", "focal_px", "centre_px", "distortion", "model", "name", "known_to_px", "distortion_known_to")
"""What a recording says of its camera."""

# What an arm's own zero cannot be told from.
BY_CAMERA, BY_TAG = MOTORS[0], MOTORS[-1]


@dataclass(frozen=True)
class Setup:
    """All that a run begins with. Metres and degrees; the camera's place is in the frame of the base link, the tag's in the tip's.

    ``camera_within`` and ``tag_within`` say how well these places are known, in m and degrees; 0 is exactly. ``shapes`` are those of the
    links, by which no posture is asked for in which they meet: the text of a file as ``init`` writes it beside a calibration file.
    """

    urdf: str
    base: str
    tip: str
    calibration: Calibration
    camera: Camera
    target: Target
    camera_at: Three = CAMERA_AT
    looks_at: Three = LOOKS_AT
    camera_within: tuple[float, float] = CAMERA_WITHIN
    tag_at: Three = TAG_AT
    tag_rpy_deg: Three = TAG_RPY_DEG
    tag_within: tuple[float, float] = TAG_WITHIN
    movements: int = 20
    both_sides_every: int = 3
    minimum_height: float = 0.05
    seed: int = 0
    shapes: str | None = None

    def __post_init__(self) -> None:
        if self.target.kind != "tag":
            raise wrong("--tag", f"a {self.target.kind} is no single tag", "print one: print-target tag")
        tree = self.tree()
        names = [joint.name for joint in tree.path(self.tip, self.base) if joint.moves]
        if names != list(MOTORS):
            what = f"its joints from {self.base} to {self.tip} are {', '.join(names) or 'none'}"
            raise wrong("--urdf", what, f"name them as LeRobot does: {', '.join(MOTORS)}")
        for option, within in (("--camera-within", self.camera_within), ("--tag-within", self.tag_within)):
            if not (0 <= within[0] <= 1 and 0 <= within[1] <= 60):
                what = f"{within[0] * 1e3:g} mm and {within[1]:g} degrees are no guess"
                raise wrong(option, what, "write at most 1000 mm and 60 degrees")
        for key in ("camera_at", "looks_at", "tag_at", "tag_rpy_deg"):
            if not all(map(math.isfinite, getattr(self, key))):
                raise wrong("--" + key.replace("_", "-"), "a number is not finite", "write three numbers")
        if not (math.isfinite(self.minimum_height) and abs(self.minimum_height) <= 0.5):
            raise wrong("--minimum-height-mm", f"{self.minimum_height * 1e3:g} is out of range", "write -500 to 500")
        if not 6 <= self.movements <= 500:
            raise wrong("--movements", f"{self.movements} is out of range", "write 6 to 500")
        if not 0 <= self.seed < 2**32:
            raise wrong("--seed", f"{self.seed} is out of range", "write 0 or more, below 2^32")
        if math.dist(self.camera_at, self.looks_at) < 0.05:
            raise wrong("--looks-at", "it is where the camera stands", "name a point in the middle of its picture")

    def tree(self) -> Tree:
        """The joints as described."""
        return parse_urdf(self.urdf, "--urdf")

    def limits_deg(self) -> dict[str, tuple[float, float]]:
        """Where movements end: the ranges of the calibration file, with a margin, within the limits of the description."""
        limits = {}
        for name, (lower, upper) in _described_deg(self.urdf, self.base, self.tip).items():
            half = self.calibration.half_range_deg(name) - MARGIN_DEG
            limits[name] = (max(-half, lower), min(half, upper))
            if limits[name][1] - limits[name][0] < 5.0:
                what = f"range of the calibration file and limits of the description leave {name} no room"
                raise wrong("--urdf", what, "take the description whose zeros are the middles of the ranges (so101_new_calib.urdf)")
        return limits

    def touches(self, tree: Tree, configuration: Mapping[str, float]) -> str:
        """What the hand would come too near to at joint positions (rad), by the description; empty where it stays clear.

        Hand and forearm beyond the elbow are the lines between wrist, last joint, tag and what lies as far ahead of the last joint as an
        SO-101's fingers; they stay ``CLEAR_M`` away from the upper arm and from the column of the base.
        """
        chain = [joint for joint in tree.path(self.tip, self.base) if joint.moves]
        poses = [tree.pose(joint.child, self.base, configuration) for joint in chain]
        places = [np.array(it.at) for it in poses]
        tip = np.array(poses[-1].rotation)
        ahead = places[4] - places[3]
        fingers = places[4] + ahead / max(float(np.linalg.norm(ahead)), 1e-9) * FINGERS_M
        hand = np.concatenate([_line(places[3], places[4]), _line(places[4], fingers), (places[4] + tip @ np.array(self.tag_at))[None]])
        column = _line(places[0] * np.array([1.0, 1.0, 0.0]), places[0])
        bodies = {"the base": np.concatenate([column, _line(places[0], places[1])]), "the upper arm": _line(places[1], places[2])}
        for name, body in bodies.items():
            near = float(np.linalg.norm(hand[:, None] - body[None], axis=2).min())
            if near < CLEAR_M:
                return f"the hand would be {near * 1e3:.0f} mm from {name}"
        return ""

    def zeros(self) -> list[str]:
        """The motors whose zeros are learned."""
        camera, tag = self.given
        return [name for name in MOTORS if (name != BY_CAMERA or camera) and (name != BY_TAG or tag)]

    @property
    def given(self) -> tuple[bool, bool]:
        """Whether the directions of camera and tag are known to half a degree."""
        return self.camera_within[1] <= GIVEN_DEG, self.tag_within[1] <= GIVEN_DEG

    def watcher(self) -> Watcher:
        """What finds the tag."""
        return Watcher(self.camera, self.target)

    def session(self, *, links: bool = False) -> Session:
        """A session of this robot.

        With ``links`` it is the one that concludes: links are learned too, to 0.5 mm and 0.2 degrees. Without it is the one that asks where
        to go: links are held, and camera and tag known by eye, whatever is known of them. It would otherwise stay at one posture, which
        tells the zeros and nothing else.
        """
        tag: dict[str, Any] = {**self.target.sections()[0], "link": self.tip, "at_m": list(self.tag_at), "rpy_deg": list(self.tag_rpy_deg)}
        eye: dict[str, Any] = {**self.camera.section(), "at_m": list(self.camera_at), "looks_at_m": list(self.looks_at)}
        for its, within, usual in ((tag, self.tag_within, TAG_WITHIN), (eye, self.camera_within, CAMERA_WITHIN)):
            metres, degrees = within if links else map(max, within, usual)
            if metres > 0 or degrees > 0:
                its["known"] = {"to_m": max(metres, 1e-5), "to_deg": max(degrees, 1e-3)}
        robot: dict[str, Any] = {"offsets": self.zeros() if links else list(MOTORS[1:-1])}
        if self.shapes is not None:
            robot["shapes"] = self.shapes
        prior: dict[str, Any] = {"offset_rad": 0.1}
        if links:
            # The first joint's place is that of the base, and the last one's goes along with the tag's.
            robot["hold"] = [BY_CAMERA, BY_TAG]
            prior |= {"point_m": 0.0005, "direction_rad": 0.003}
        else:
            robot["hold"] = list(MOTORS)
        return Session.from_urdf(
            self.urdf,
            self.base,
            self.tip,
            target=[tag],
            camera=[eye],
            sensor={"channel": "pixels", "camera": self.camera.name, "target": self.target.name, "sigma_px": 0.3},
            base_={"at_m": [0, 0, 0], "rpy_deg": [0, 0, 0]},
            robot=robot,
            prior=prior,
            constraints={"minimum_height_m": self.minimum_height, "limits_deg": {k: list(v) for k, v in self.limits_deg().items()}},
            view={"visible_pose_deg": [0.0] * len(MOTORS)},
            seed=self.seed,
        )

    def to_dict(self) -> dict[str, Any]:
        """All of it, as it goes into a recording."""
        camera, tag = self.camera, self.target.tags[0]
        kept = ("urdf", "base", "tip", "camera_at", "looks_at", "camera_within", "tag_at", "tag_rpy_deg", "tag_within")
        return {
            **{key: getattr(self, key) for key in (*kept, "movements", "both_sides_every", "minimum_height", "seed", "shapes")},
            "calibration": {"source": self.calibration.source, "motors": self.calibration.motors},
            "camera": {key: getattr(camera, key) for key in CAMERA_KEYS},
            "target": {"id": tag.id, "size_m": tag.size_m, "family": self.target.family, "name": self.target.name},
        }


def _line(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points between two, both included."""
    return np.asarray(a + np.linspace(0.0, 1.0, 9)[:, None] * (b - a), np.float64)


@cache
def _described_deg(urdf: str, base: str, tip: str) -> dict[str, tuple[float, float]]:
    """The limits of a description's joints."""
    joints = Session.from_urdf(urdf, base, tip).description()["joints"]
    within = math.degrees(1e-6)
    return {it["name"]: (math.degrees(it["limits"][0]) + within, math.degrees(it["limits"][1]) - within) for it in joints}


def of_dict(told: Mapping[str, Any], source: str) -> Setup:
    """The setup of a recording. Raises ``FieldError`` where it is none."""
    try:
        its = dict(told)
        tag, calibration = its.pop("target"), its.pop("calibration")
        camera: dict[str, Any] = {key: tuple(it) if isinstance(it, list) else it for key, it in its.pop("camera").items()}
        its = {key: tuple(it) if isinstance(it, list) else it for key, it in its.items()}
        return Setup(
            calibration=of_motors(calibration["motors"], str(calibration["source"])),
            camera=Camera(**camera),
            target=Target.tag(tag["id"], tag["size_m"], family=tag["family"], name=tag["name"]),
            **its,
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise wrong("--recording", f"{source} is no setup ({error})", "name a folder that --record wrote") from None
