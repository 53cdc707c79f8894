"""Offsets of joints' readings, in PAL's files of calibration constants."""

from __future__ import annotations

import math

from .._errors import wrong
from .._transforms import dot, number, rotation_vector, times, transposed, turned
from .._urdf import Tree, floats
from ._edit import edited, parse_xml

FAR_M, FAR_RAD = 0.05, math.radians(20.0)


def joint_offsets(before: Tree, after: Tree) -> dict[str, tuple[float, float, float]]:
    """What is added to a joint's reading (rad, m), by joint that moves, and what no offset of a reading holds of its origin (m, rad).

    ``before`` is the description that was calibrated, ``after`` what came out. The offset is the turn about the joint's axis, or the shift
    along it, from the old origin to the new one. Raises ``FieldError`` where both are not of one robot.
    """
    found = {}
    for name, joint in after.joints.items():
        if not joint.moves:
            continue
        was = before.joints.get(name)
        if was is None or was.kind != joint.kind or math.dist(was.axis, joint.axis) > 1e-9:
            raise wrong(before.source, f"its joint `{name}` is missing, or is another", "name the URDF that was calibrated")
        turn = rotation_vector(times(transposed(was.origin.rotation), joint.origin.rotation))
        shift = turned(transposed(was.origin.rotation), [a - b for a, b in zip(joint.origin.at, was.origin.at)])
        if math.hypot(*turn) > FAR_RAD or math.hypot(*shift) > FAR_M:
            raise wrong(before.source, f"its joint `{name}` stands elsewhere", "name the URDF that was calibrated")
        inside = shift if joint.kind == "prismatic" else turn
        offset = dot(inside, joint.axis)
        rest = math.hypot(*(a - offset * b for a, b in zip(inside, joint.axis)))
        found[name] = (offset, rest, math.hypot(*turn)) if joint.kind == "prismatic" else (offset, math.hypot(*shift), rest)
    return found


def pal(before: Tree, after: Tree, text: str, *, source: str = "constants", joints: list[str] | None = None) -> tuple[str, list[str]]:
    """A file of calibration constants of PAL (``calibration_constants.urdf.xacro``) with new offsets of joints.

    Its properties ``JOINT_offset`` are the ``<offset>`` of a transmission, reading = actuator / reduction + offset: what was
    found is added to what stands there. All else stays. ``joints`` are those that were learned (default: all). Gives the new text, and
    what an offset of a reading does not hold, or the file has no place for. Raises ``FieldError`` where the file fits none of the joints.
    """
    found = joint_offsets(before, after)
    properties = {
        it.attributes.get("name", ""): it for it in parse_xml(text, source).walk() if it.tag.endswith(":property") or it.tag == "property"
    }
    edits, said, known = [], [], 0
    for name, (offset, shift, turn) in found.items():
        if joints is not None and name not in joints:
            continue
        its = properties.get(f"{name}_offset")
        if its is None:
            if offset:
                six = f"{name}_yaw_offset" in properties
                why = "six offsets, which are left" if six else f"no property {name}_offset"
                said.append(f"{name}: the file has {why}; its offset is {number(offset)}")
            continue
        known += 1
        if "value" not in its.spans:
            raise wrong(f"{source}: {name}_offset", "it has no value", "write one")
        old = floats(its.attributes["value"], 1, f"{source}: {name}_offset")[0]
        if offset:
            edits.append(its.set("value", number(old + offset)))
        if shift > 1e-6 or turn > 1e-6:
            said.append(f"{name}: {shift * 1e3:.2f} mm and {math.degrees(turn):.3f} degrees of its origin are no offset of a reading")
    if not known:
        what = f"it has no property of a joint, as {next(iter(found), 'arm_1_joint')}_offset"
        raise wrong(source, what, "name the robot's calibration_constants.urdf.xacro")
    return edited(text, edits), said
