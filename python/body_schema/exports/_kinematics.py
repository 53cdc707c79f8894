"""Origins of joints as YAML: the kinematics parameters of Universal Robots and of xArm."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from .._errors import wrong
from .._transforms import EYE, Pose, about, angle_between, dot, least_turn, number, of_rpy, rpy_of, times, transposed, turned, vector
from .._urdf import Joint, Tree, floats
from ._edit import Edit, Scalar, edited, scalars

KEYS = ("x", "y", "z", "roll", "pitch", "yaw")

UR = {
    "shoulder": "shoulder_pan_joint",
    "upper_arm": "shoulder_lift_joint",
    "forearm": "elbow_joint",
    "wrist_1": "wrist_1_joint",
    "wrist_2": "wrist_2_joint",
    "wrist_3": "wrist_3_joint",
}
"""By section of the file the joint whose origin it holds."""

FAR_M, FAR_RAD = 0.05, math.radians(10.0)
"""What no calibration changes: beyond, a file is of another robot or counts its zeros otherwise."""


def prefix_of(tree: Tree, names: Sequence[str], prefix: str | None) -> str:
    """What stands before ``names`` in the joints of a description, as ``left_``; ``prefix`` where it is told."""
    found = [it.removesuffix(names[0]) for it in tree.joints if it.endswith(names[0])] if prefix is None else [prefix]
    whole = [it for it in found if all(it + name in tree.joints for name in names)]
    if len(whole) == 1:
        return whole[0]
    if whole:
        raise wrong("--prefix", f"there are {len(whole)} such robots", f"write one of {', '.join(map(repr, whole))}")
    missing = [name for name in names if (found or [""])[0] + name not in tree.joints]
    what = f"there is no joint `{(found or [''])[0]}{missing[0]}`; joints are {', '.join(tree.joints)}"
    raise wrong(tree.source, what, "name the robot's own URDF, or its --prefix")


def _written(text: str, sections: Sequence[str], source: str) -> tuple[list[Pose], list[list[float]], list[list[Scalar]]]:
    """The origins that a file holds, roll pitch yaw as written, and where they stand."""
    found = scalars(text)
    poses, angles, places = [], [], []
    for section in sections:
        its = []
        for key in KEYS:
            field = f"{source}: kinematics.{section}.{key}"
            scalar = found.get(("kinematics", section, key))
            if scalar is None or not scalar.value:
                raise wrong(field, "it is missing", "name a file of the driver, with one key a line")
            its.append(scalar)
        values = [floats(it.value, 1, f"{source}: {'.'.join(it.keys)}")[0] for it in its]
        poses.append(Pose(of_rpy(values[3:]), vector(values[:3])))
        angles.append(values[3:])
        places.append(its)
    return poses, angles, places


def _along_z(joints: Sequence[Joint]) -> bool:
    chained = all(joint.parent == before.child for before, joint in zip(joints, joints[1:]))
    return chained and all(math.dist(joint.axis, EYE[2]) < 1e-12 for joint in joints)


def _changed(
    nominal: Sequence[Pose], origins: Sequence[Pose], angles: Sequence[Sequence[float]], places: Sequence[Sequence[Scalar]]
) -> list[Edit]:
    edits: list[Edit] = []
    for was, origin, near, its in zip(nominal, origins, angles, places):
        # Angles that say it already stay as they are written.
        stays = angle_between(was.rotation, origin.rotation) < 1e-14
        values = [*origin.at, *(near if stays else rpy_of(origin.rotation, near))]
        edits += [(it.start, it.end, number(value)) for it, value in zip(its, values) if float(it.value) != value]
    return edits


def _check_near(section: str, was: Pose, now: Pose, source: str) -> None:
    far, turn = math.dist(was.at, now.at), angle_between(was.rotation, now.rotation)
    if far > FAR_M or turn > FAR_RAD:
        what = f"{section} is {far * 1e3:.0f} mm and {math.degrees(turn):.0f} degrees from the calibrated robot"
        raise wrong(source, what, "name the file of this robot's model")


def ur_kinematics(tree: Tree, text: str, *, prefix: str | None = None, source: str = "kinematics") -> tuple[str, list[str]]:
    """A kinematics file of Universal Robots (``default_kinematics.yaml``) with the origins of a calibrated description.

    ``text`` is the user's own file, whose hash and all else stay; ``prefix`` stands before joints and links. The driver's
    description turns every joint about z, and the first one stands on ``base_link_inertia``, half a turn about z from ``base_link``.
    Origins of a description of that kind are taken as they are. Of another one, the same axes are written in frames next to those of the
    file: forward kinematics from ``base_link`` to ``tool0`` stay the same. Gives the new text, and what is to be said. Raises
    ``FieldError`` where joints or keys are missing, or where the file is of another robot.
    """
    prefix = prefix_of(tree, list(UR.values()), prefix)
    joints = [tree.joints[prefix + name] for name in UR.values()]
    nominal, angles, places = _written(text, list(UR), source)
    said: list[str] = []
    if _along_z(joints) and joints[0].parent == f"{prefix}base_link_inertia":
        origins = [joint.origin for joint in joints]
    else:
        origins, said = _moved(tree, prefix, joints, nominal, source)
    for section, was, now in zip(UR, nominal, origins):
        _check_near(section, was, now, source)
    return edited(text, _changed(nominal, origins, angles, places)), said


def _moved(tree: Tree, prefix: str, joints: Sequence[Joint], nominal: Sequence[Pose], source: str) -> tuple[list[Pose], list[str]]:
    """The axes of a description in frames next to those of the file, the last of them that of the tool."""
    base, tool = f"{prefix}base_link", f"{prefix}tool0"
    said = [f"{tree.source} has other frames than the driver's description: the same axes are written in the driver's frames"]
    before = beside = Pose(about(EYE[2], math.pi))
    origins = []
    for joint, was, section in zip(joints, nominal, UR):
        beside = beside @ was
        here = tree.pose(joint.child, base)
        direction = turned(here.rotation, joint.axis)
        upward = transposed(beside.rotation)[2]
        off = [a - b for a, b in zip(beside.at, here.at)]
        along = dot(off, direction)
        foot = vector([a + along * b for a, b in zip(here.at, direction)])
        if dot(upward, direction) < math.cos(FAR_RAD) or math.dist(foot, beside.at) > FAR_M:
            what = f"the axis of {joint.name} is not that of {section} at zero readings"
            raise wrong(source, what, "name the file of this robot's model, and a URDF with the driver's zeros and signs")
        frame = Pose(times(least_turn(upward, direction), beside.rotation), foot)
        if joint is joints[-1]:
            frame, more = _at_tool(tree, base, tool, joint, frame, direction)
            said += more
        origins.append(before.inverse() @ frame)
        before = frame
    return origins, said


def _at_tool(
    tree: Tree, base: str, tool: str, joint: Joint, frame: Pose, direction: Sequence[float]
) -> tuple[Pose, list[str]]:
    """The last frame: the driver has ``tool0`` there."""
    if tool not in tree.links:
        return frame, [f"{tree.source} has no {tool}: the turn of {joint.child} about its axis, and its place along it, are the file's"]
    its = tree.pose(tool, base)
    off = [a - b for a, b in zip(its.at, frame.at)]
    along = dot(off, direction)
    aside = math.hypot(*(a - along * b for a, b in zip(off, direction)))
    tilt = math.dist(transposed(its.rotation)[2], direction)
    held = not any(it.moves for it in tree.path(tool, joint.child))
    if held and aside < 1e-9 and tilt < 1e-9:
        return its, []
    return frame, [f"{tool} does not lie on the axis of {joint.name}, where the driver has it"]


def xarm_kinematics(
    tree: Tree, text: str | None = None, *, prefix: str | None = None, source: str = "kinematics"
) -> tuple[str, list[str]]:
    """A kinematics file of xArm (``config/kinematics/user/….yaml``) with the origins of a calibrated description.

    ``text`` is the user's own file, of which all else stays; without it a new one is written. Joints are ``joint1`` … with ``prefix``,
    and turn about z. Gives the new text, and what is to be said. Raises ``FieldError`` where joints or keys are missing, or do not fit.
    """
    first = "joint1"
    if prefix is None:
        prefix = prefix_of(tree, [first], None)
    count = next(it for it in range(1, 100) if f"{prefix}joint{it}" not in tree.joints) - 1
    if count < 5:
        what = f"it has {count} of the joints {prefix}joint1 to {prefix}joint5"
        raise wrong(tree.source, what, "name the URDF of an xArm, or its --prefix")
    sections = [f"joint{it + 1}" for it in range(count)]
    joints = [tree.joints[prefix + it] for it in sections]
    if not _along_z(joints):
        what = "its joints are no chain of axes along z, as xarm_description has them"
        raise wrong(tree.source, what, "name the URDF that xarm_description makes")
    origins = [joint.origin for joint in joints]
    if text is None:
        lines = ["kinematics:\n"]
        for section, origin in zip(sections, origins):
            values: Mapping[str, float] = dict(zip(KEYS, [*origin.at, *rpy_of(origin.rotation)]))
            lines += [f"  {section}:\n", *(f"    {key}: {number(value)}\n" for key, value in values.items())]
        return "".join(lines), []
    nominal, angles, places = _written(text, sections, source)
    for section, was, now in zip(sections, nominal, origins):
        _check_near(section, was, now, source)
    return edited(text, _changed(nominal, origins, angles, places)), []
