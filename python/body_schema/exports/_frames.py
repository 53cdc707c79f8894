"""Places of cameras, targets and of the base: static transforms, and hand-eye calibrations."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .._errors import wrong
from .._transforms import Pose, number, of_rpy, quaternion, vector
from ._calibrated import Calibrated


@dataclass(frozen=True)
class Transform:
    """The pose of the frame ``child`` in the frame ``parent``, as tf has it: ``pose`` takes points of the child into the parent (m)."""

    parent: str
    child: str
    pose: Pose

    @property
    def xyzw(self) -> tuple[float, float, float, float]:
        """Its rotation as a quaternion x y z w."""
        w, x, y, z = quaternion(self.pose.rotation)
        return (x, y, z, w)


def _pose(said: object, field: str) -> Pose | None:
    """A place in a report; ``None`` where it has no rotation."""
    try:
        assert isinstance(said, Mapping)
        at = vector([float(it) for it in said["xyz_m"]])
        rpy = said["rpy_rad"]
        return None if rpy is None else Pose(of_rpy([float(it) for it in rpy]), at)
    except (AssertionError, KeyError, TypeError, ValueError):
        raise wrong(f"report.json: {field}", "it is no place", "calibrate again") from None


def _base_link(report: Mapping[str, Any]) -> str:
    chain = report.get("chain")
    if not isinstance(chain, Mapping) or not isinstance(chain.get("base"), str):
        raise wrong("report.json: chain", "the calibration had no URDF", "calibrate with a URDF, whose links are the frames")
    return str(chain["base"])


def _found_base(report: Mapping[str, Any]) -> Pose | None:
    """The base link in the frame of the measurements; ``None`` where the calibration took its place as given."""
    base = report.get("base")
    pose = _pose(base, "base")
    given = not isinstance(base, Mapping) or base.get("xyz_sd_m") is None or base.get("rotation_sd_rad") is None
    return None if given else pose


def _standing(report: Mapping[str, Any]) -> tuple[str | None, Pose]:
    """The camera that stands still, in the base link: that whose pictures were measured, or else that in whose frame all was (no name)."""
    stand = [(name, pose) for name, (link, pose) in _places(report, "cameras").items() if link == _base_link(report) and pose is not None]
    if len(stand) > 1:
        mend = "write them with `export tf`, without --camera-frame; --frame CAMERA=FRAME names the frame of each"
        raise wrong("--camera-frame", f"{len(stand)} cameras stand", mend)
    # The frame of the measurements is another one's where a camera has a place of its own.
    return stand[0] if stand else (None, _base(report).inverse())


def _base(report: Mapping[str, Any]) -> Pose:
    """The base link in the frame of the measurements. Refused where the calibration did not find it."""
    pose = _found_base(report)
    if pose is None:
        raise wrong("report.json: base", "the calibration took the base's place as given", "calibrate with poses or positions")
    return pose


def _places(report: Mapping[str, Any], kind: str) -> dict[str, tuple[str, Pose | None]]:
    """By name of a target or a camera the link that it is on, and its pose there; ``None`` where only its place is known."""
    found: dict[str, tuple[str, Pose | None]] = {}
    for it in report.get(kind) or []:
        if not isinstance(it, Mapping) or not isinstance(it.get("name"), str) or not isinstance(it.get("link"), str):
            raise wrong(f"report.json: {kind}", "one has no name or link", "calibrate again")
        found[it["name"]] = (it["link"], _pose(it, f"{kind}.{it['name']}"))
    return found


def transforms(
    calibrated: Calibrated, *, world: str | None = None, camera: str | None = None, frames: Mapping[str, str] | None = None
) -> tuple[list[Transform], list[str]]:
    """The places that a calibration found, as static transforms.

    ``world`` names the frame of the measurements: it carries the base link. ``camera`` names the optical frame (z ahead, x right, y down) of
    the camera that stands still, whose pictures were measured or in whose frame all poses were: the base link carries it. ``frames`` names
    the frames of targets and cameras (default: their own names); each hangs on its link, and a target that is a camera on the hand is in its
    optical frame if the poses of the table were. Gives them, and what is left out. Raises ``FieldError`` where nothing is left.
    """
    report = calibrated.need_report()
    if world is not None and camera is not None:
        raise wrong("--world-frame", "the frame of the measurements is named twice", "write one of --world-frame and --camera-frame")
    found: list[Transform] = []
    left: list[str] = []
    link, cameras = _base_link(report), _places(report, "cameras")
    targets = _places(report, "targets") | cameras
    if world is not None:
        found.append(Transform(world, link, _base(report)))
    elif camera is not None:
        own, stands = _standing(report)
        found.append(Transform(link, camera, stands))
        targets = {name: it for name, it in targets.items() if name != own}
    elif not cameras:
        left.append(f"{link}: say how the frame of the measurements is called: --world-frame, or --camera-frame if it is a camera's")
    for name in frames or {}:
        if name not in targets:
            raise wrong("--frame", f"there is no target or camera `{name}`", f"there are {', '.join(targets) or 'none'}")
    for name, (on, pose) in targets.items():
        if pose is None:
            left.append(f"{name}: only its place was found, not how it is turned")
        else:
            found.append(Transform(on, (frames or {}).get(name, name), pose))
    if not found:
        raise wrong(str(calibrated.source), "there is no transform to write: " + "; ".join(left), "name its frames")
    children = [it.child for it in found]
    for it in found:
        if children.count(it.child) > 1 or it.child == it.parent or not it.child or not it.parent:
            raise wrong("--frame", f"the frame `{it.child}` has two places, or no name", "give every frame a name of its own")
    return found, left


def tf_json(found: Sequence[Transform]) -> str:
    """Static transforms as JSON, in the layout of ``tf2_msgs/TFMessage``; time stamps are 0."""
    messages = []
    for it in found:
        translation, rotation = dict(zip("xyz", it.pose.at)), dict(zip("xyzw", it.xyzw))
        header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": it.parent}
        messages.append({"header": header, "child_frame_id": it.child, "transform": {"translation": translation, "rotation": rotation}})
    return json.dumps({"transforms": messages}, indent=2, ensure_ascii=False) + "\n"


def _text(value: str) -> str:
    """A text in YAML; JSON's strings are YAML's."""
    return json.dumps(value, ensure_ascii=False)


def tf_launch(found: Sequence[Transform]) -> str:
    """Static transforms as a launch file of ROS 2 in YAML: a ``static_transform_publisher`` of ``tf2_ros`` each."""
    lines = ["# Poses of child frames in their parents: metres, quaternions x y z w.\n"]
    lines += ["# A camera's frame is its optical one: z ahead, x right, y down.\nlaunch:\n"]
    for k, it in enumerate(found):
        for name in (it.parent, it.child):
            if any(letter.isspace() or letter in "\"'$\\" for letter in name):
                raise wrong("--frame", f"{name!r} is no name of a frame", "write letters, digits, _ and /")
        options = list(zip(("x", "y", "z", "qx", "qy", "qz", "qw"), [*it.pose.at, *it.xyzw]))
        args = " ".join(f"--{key} {number(value)}" for key, value in options)
        lines += ["- node:\n    pkg: tf2_ros\n    exec: static_transform_publisher\n", f"    name: calibrated_transform_{k + 1}\n"]
        lines += [f"    args: {_text(f'{args} --frame-id {it.parent} --child-frame-id {it.child}')}\n"]
    return "".join(lines)


def easy_handeye2(
    calibrated: Calibrated,
    kind: str,
    camera: str,
    *,
    name: str = "calibration",
    target: str | None = None,
    effector: str | None = None,
    marker: str = "tracking_marker_frame",
) -> str:
    """A hand-eye calibration in the layout that easy_handeye2 loads (``~/.ros2/easy_handeye2/calibrations/NAME.calib``).

    ``kind`` is ``eye_in_hand``: the table had pictures of a camera on the hand, or its poses in the frame of what it looks at, and
    ``target`` names the camera; or ``eye_on_base``: pictures of a camera that stands still, or poses in its frame, of ``target``, which the
    hand carries. ``camera`` names the camera's optical frame, ``marker`` that of what is seen, ``effector`` the link of the hand (default:
    the target's). The transform is the camera's pose in the hand's link, or in the base link. Raises ``FieldError`` where the calibration
    did not find it.
    """
    report = calibrated.need_report()
    base = _base_link(report)
    if kind not in ("eye_in_hand", "eye_on_base"):
        raise wrong("--type", f"{kind!r} is none", "write eye_in_hand or eye_on_base")
    # Poses of a camera are those of a target; where pictures were measured the camera is one itself. What stands is on no hand.
    what = "camera" if kind == "eye_in_hand" and report.get("cameras") else "target"
    carried = {name: it for name, it in _places(report, f"{what}s").items() if it[0] != base}
    if not carried:
        other = "eye_on_base" if kind == "eye_in_hand" else "eye_in_hand"
        raise wrong("--type", f"no {what} is on the hand", f"write {other}")
    if target is None:
        if len(carried) != 1:
            raise wrong("--target", f"there are {len(carried)} {what}s", f"name one of {', '.join(carried)}")
        target = next(iter(carried))
    if target not in carried:
        raise wrong("--target", f"on the hand there is no {what} `{target}`", f"write {' or '.join(carried)}")
    link, pose = carried[target]
    if kind == "eye_on_base":
        _, pose = _standing(report)
    elif pose is None:
        raise wrong("--target", f"of `{target}` only the place was found, not how it is turned", "calibrate with poses of the camera")
    elif effector not in (None, link):
        # The pose is in the frame of its link; another link of the hand stands fixed to it.
        path = (tree := calibrated.tree()).path(link, effector)
        if any(joint.moves for joint in path):
            raise wrong("--effector-frame", f"a joint moves between `{effector}` and `{link}`", f"name {link}, or leave it out")
        pose = tree.pose(link, effector) @ pose
    parameters = {
        "name": name,
        "calibration_type": kind,
        "robot_base_frame": base,
        "robot_effector_frame": effector or link,
        "tracking_base_frame": camera,
        "tracking_marker_frame": marker,
    }
    lines = ["parameters:\n", *(f"  {key}: {_text(value)}\n" for key, value in parameters.items())]
    lines += ["  freehand_robot_movement: true\n", '  move_group_namespace: "/"\n', '  move_group: "manipulator"\n']
    w, x, y, z = quaternion(pose.rotation)
    lines += ["transform:\n  translation:\n", *(f"    {key}: {_real(value)}\n" for key, value in zip("xyz", pose.at))]
    lines += ["  rotation:\n", *(f"    {key}: {_real(value)}\n" for key, value in zip("xyzw", (x, y, z, w)))]
    return "".join(lines)


def _real(value: float) -> str:
    """A number that no reader of YAML takes for an integer: fields of messages are real."""
    text = number(value)
    return text if "." in text else f"{text}.0"
