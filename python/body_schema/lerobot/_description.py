"""The SO-101's description, and a description as MJCF."""

from __future__ import annotations

import math
from collections.abc import Mapping

from .._transforms import number, quaternion
from .._urdf import Joint, Tree

BASE, TIP = "base", "gripper"

_HALF = math.pi / 2
_SO101: dict[str, tuple[tuple[float, float, float], tuple[float, float, float], float]] = {
    "shoulder_pan": ((0.0, 0.0, 0.09488), (math.pi, 0.0, math.pi), 1.91986),
    "shoulder_lift": ((-0.0304, -0.01828, -0.0542), (-_HALF, -_HALF, 0.0), 1.74533),
    "elbow_flex": ((-0.11257, -0.028, 0.0), (0.0, 0.0, _HALF), 1.69),
    "wrist_flex": ((-0.1349, 0.0052, 0.0), (0.0, 0.0, -_HALF), 1.65806),
    "wrist_roll": ((0.0, -0.0611, 0.0181), (_HALF, 0.0, math.pi), 2.79253),
}
"""By joint: place (m) and roll, pitch, yaw (rad) of its origin, and its limit to both sides (rad)."""


def so101_urdf() -> str:
    """The five joints of an SO-101 follower, as a URDF without shapes.

    Distances and zeros (every joint in the middle of its range) are those that The Robot Studio publishes as ``so101_new_calib.urdf``
    (github.com/TheRobotStudio/SO-ARM100, Apache-2.0), to 0.01 mm. The frame of ``base`` is another: it stands on the table under the
    axis of the first joint, x ahead, y to the left, z up.
    """
    links = [BASE, "shoulder", "upper_arm", "lower_arm", "wrist", TIP]
    text = '<robot name="so101">\n' + "".join(f'  <link name="{link}"/>\n' for link in links)
    for index, (name, (at, turn, limit)) in enumerate(_SO101.items()):
        place, rpy = (" ".join(map(number, it)) for it in (at, turn))
        text += (
            f'  <joint name="{name}" type="revolute">\n    <origin xyz="{place}" rpy="{rpy}"/>\n'
            f'    <parent link="{links[index]}"/>\n    <child link="{links[index + 1]}"/>\n    <axis xyz="0 0 1"/>\n'
            f'    <limit lower="{-limit}" upper="{limit}" effort="10" velocity="10"/>\n  </joint>\n'
        )
    return text + "</robot>\n"


def mjcf_of(tree: Tree, limits_rad: Mapping[str, tuple[float, float]], inside: Mapping[str, str] | None = None) -> str:
    """A description's joints as MJCF: every link a body, drawn as a capsule to the next joint.

    ``inside`` has more elements by link, as texts. Masses are those of capsules of MuJoCo's density: it is a model of the kinematics.
    """
    below: dict[str, list[Joint]] = {}
    for joint in tree.joints.values():
        below.setdefault(joint.parent, []).append(joint)

    def content(link: str, indent: str) -> str:
        text = ""
        ends = below.get(link, [])
        for joint in ends:
            at = joint.origin.at
            if math.hypot(*at) > 0.02:
                to = " ".join(map(number, at))
                text += f'{indent}<geom type="capsule" fromto="0 0 0 {to}" size="0.011" rgba="0.25 0.25 0.27 1"/>\n'
        if not ends or not text:
            text += f'{indent}<geom type="sphere" size="0.013" rgba="0.2 0.2 0.22 1"/>\n'
        for part in (inside or {}).get(link, "").splitlines():
            text += f"{indent}{part}\n"
        for joint in ends:
            place, turn = " ".join(map(number, joint.origin.at)), " ".join(map(number, quaternion(joint.origin.rotation)))
            text += f'{indent}<body name="{joint.child}" pos="{place}" quat="{turn}">\n'
            if joint.moves:
                axis, kind = " ".join(map(number, joint.axis)), "slide" if joint.kind == "prismatic" else "hinge"
                limit = ""
                if joint.name in limits_rad:
                    limit = f' range="{" ".join(map(number, limits_rad[joint.name]))}"'
                text += f'{indent}  <joint name="{joint.name}" type="{kind}" axis="{axis}"{limit}/>\n'
            text += content(joint.child, indent + "  ") + f"{indent}</body>\n"
        return text

    root = next(link for link in tree.links if link not in tree.above)
    return (
        f'<mujoco model="{tree.name}">\n  <compiler angle="radian" autolimits="true"/>\n  <worldbody>\n'
        f'    <body name="{root}">\n{content(root, "      ")}    </body>\n  </worldbody>\n</mujoco>\n'
    )
