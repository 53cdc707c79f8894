"""Kinematics files of Universal Robots and xArm give the forward kinematics of the calibrated URDF."""

from __future__ import annotations

import math
import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")
np = pytest.importorskip("numpy")

from export_robots import SCENARIOS, disturbed, forward, motion, off, postures, turn  # noqa: E402

from body_schema import FieldError  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from body_schema.exports import parse_urdf, ur_kinematics, xarm_kinematics  # noqa: E402

JOINTS = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
SECTIONS = ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"]
LINKS = ["shoulder_link", "upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link"]

UR10 = [
    [0, 0, 0.1273, 0, 0, 0],
    [0, 0, 0, math.pi / 2, 0, 0],
    [-0.612, 0, 0, 0, 0, 0],
    [-0.5723, 0, 0.163941, 0, 0, 0],
    [0, -0.1157, 0, math.pi / 2, 0, 0],
    [0, 0.0922, 0, math.pi / 2, math.pi, math.pi],
]


def kinematics_file(rows: list[list[float]] = UR10) -> str:
    text = "# extracted from the controller\r\nkinematics:\r\n"
    for section, row in zip(SECTIONS, rows):
        text += f"  {section}:\r\n"
        text += "".join(f"    {key}: {value!r}   # {key}\r\n" for key, value in zip(("x", "y", "z", "roll", "pitch", "yaw"), row))
    return text + "  hash: calib_12788084448423163542\r\n"


def driver(text: str, readings: Mapping[str, float], prefix: str = "") -> np.ndarray:
    """The reader: ur_macro.xacro's chain from base_link to tool0, which is wrist_3_link."""
    said = yaml.safe_load(text)["kinematics"]
    m = motion([0, 0, 0], [0, 0, math.pi])
    for section, joint in zip(SECTIONS, JOINTS):
        its = said[section]
        m = m @ motion([its["x"], its["y"], its["z"]], [its["roll"], its["pitch"], its["yaw"]])
        m = m @ turn((0, 0, 1), readings[prefix + joint])
    # wrist_3-flange and flange-tool0.
    flange = motion([0, 0, 0], [0, -math.pi / 2, -math.pi / 2]) @ motion([0, 0, 0], [math.pi / 2, 0, math.pi / 2])
    return m @ flange


def described(prefix: str, rows: list[list[float]] = UR10) -> str:
    """A URDF as ur_macro.xacro makes it."""
    names = ["base_link", "base_link_inertia", *LINKS, "flange", "tool0"]
    parts = [f'<link name="{prefix}{it}"/>' for it in names]
    for joint, parent, child, row in zip(JOINTS, ["base_link_inertia", *LINKS], LINKS, rows):
        xyz, rpy = (" ".join(map(repr, its)) for its in (row[:3], row[3:]))
        parts.append(
            f'<joint name="{prefix}{joint}" type="revolute"><parent link="{prefix}{parent}"/><child link="{prefix}{child}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/></joint>'
        )
    for name, parent, child, rpy in [
        ("base", "base_link", "base_link_inertia", (0, 0, math.pi)),
        ("fl", "wrist_3_link", "flange", (0, -math.pi / 2, -math.pi / 2)),
        ("tool", "flange", "tool0", (math.pi / 2, 0, math.pi / 2)),
    ]:
        parts.append(
            f'<joint name="{prefix}{name}" type="fixed"><parent link="{prefix}{parent}"/><child link="{prefix}{child}"/>'
            f'<origin xyz="0 0 0" rpy="{" ".join(map(repr, rpy))}"/></joint>'
        )
    return f'<robot name="ur">{"".join(parts)}</robot>'


@pytest.mark.parametrize("prefix", ["", "left_"])
def test_a_description_of_the_driver_is_taken_as_it_is(prefix: str) -> None:
    urdf = disturbed(described(prefix))
    text, said = ur_kinematics(parse_urdf(urdf), kinematics_file())
    assert said == []
    for readings in postures([prefix + it for it in JOINTS]):
        assert off(driver(text, readings, prefix), forward(urdf, f"{prefix}base_link", f"{prefix}tool0", readings)) < 1e-9
        # Without the export it is another robot.
        assert off(driver(kinematics_file(), readings, prefix), forward(urdf, f"{prefix}base_link", f"{prefix}tool0", readings)) > 1e-3


def test_all_else_of_the_file_stays() -> None:
    before = kinematics_file()
    after, _ = ur_kinematics(parse_urdf(disturbed(described(""))), before)
    number = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?=   #)"
    assert re.sub(number, "#", before) == re.sub(number, "#", after) and before != after
    # Nothing is learned, nothing is written.
    assert ur_kinematics(parse_urdf(described("")), before)[0] == before


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_another_description_of_the_same_robot_gives_the_same_hand(seed: int) -> None:
    urdf = disturbed((SCENARIOS / "ur10.urdf").read_text(), seed)
    text, said = ur_kinematics(parse_urdf(urdf), kinematics_file())
    assert len(said) == 1 and "other frames" in said[0]
    for readings in postures(JOINTS):
        assert off(driver(text, readings), forward(urdf, "base_link", "tool0", readings)) < 1e-9


def test_a_calibration_of_a_real_ur10_reaches_its_driver(binary: Path, tmp_path: Path) -> None:
    out = tmp_path / "ur10"
    subprocess.run([binary, "calibrate", "ur10-camera", "--out", out], check=True, capture_output=True)
    (tmp_path / "default_kinematics.yaml").write_bytes(kinematics_file().encode())
    written = tmp_path / "mine.yaml"
    assert main(["export", "ur", str(out), "--file", str(tmp_path / "default_kinematics.yaml"), "--out", str(written)]) == 0
    urdf, text = (out / "calibrated.urdf").read_text(), written.read_bytes().decode()
    worst = max(off(driver(text, it), forward(urdf, "base_link", "tool0", it)) for it in postures(JOINTS))
    assert worst < 1e-9
    print(f"UR10, calibrated.urdf and its kinematics file: {worst:.1e} m, rad at most")


def xarm(prefix: str, count: int) -> str:
    rpy = [0, -1.5708, 1.5708, 1.5708, 1.5708, 1.5708, -1.5708]
    xyz = [(0, 0, 0.267), (0, 0, 0), (0, -0.293, 0), (0.0525, 0, 0), (0.0775, -0.3425, 0), (0, 0, 0), (0.076, 0.097, 0)]
    links = ["link_base", *(f"link{it + 1}" for it in range(count))]
    parts = [f'<link name="{prefix}{it}"/>' for it in links]
    for k in range(count):
        parts.append(
            f'<joint name="{prefix}joint{k + 1}" type="revolute"><parent link="{prefix}{links[k]}"/><child link="{prefix}{links[k + 1]}"/>'
            f'<origin xyz="{" ".join(map(str, xyz[k]))}" rpy="{rpy[k]} 0 0"/><axis xyz="0 0 1"/></joint>'
        )
    return f'<robot name="xarm">{"".join(parts)}</robot>'


@pytest.mark.parametrize("prefix, count", [("", 7), ("L_", 6)])
def test_xarm_reads_its_kinematics(prefix: str, count: int) -> None:
    urdf = disturbed(xarm(prefix, count))
    new, _ = xarm_kinematics(parse_urdf(urdf))
    old, _ = xarm_kinematics(parse_urdf(xarm(prefix, count)))
    patched, _ = xarm_kinematics(parse_urdf(urdf), old)
    for text in (new, patched):
        said = yaml.safe_load(text)["kinematics"]
        assert list(said) == [f"joint{it + 1}" for it in range(count)]
        for readings in postures([f"{prefix}joint{it + 1}" for it in range(count)]):
            m = np.eye(4)
            for name, its in said.items():
                m = m @ motion([its["x"], its["y"], its["z"]], [its["roll"], its["pitch"], its["yaw"]])
                m = m @ turn((0, 0, 1), readings[prefix + name])
            assert off(m, forward(urdf, f"{prefix}link_base", f"{prefix}link{count}", readings)) < 1e-9


@pytest.mark.parametrize(
    "text, wanted",
    [
        ("kinematics:\n  shoulder:\n    x: 0\n", "kinematics.shoulder.y"),
        ("", "kinematics.shoulder.x"),
        (kinematics_file().replace("-0.612", "nan"), "forearm.x"),
        (kinematics_file().replace("-0.612", "-0.425"), "forearm is 1"),
        (kinematics_file().replace("-0.612", "minus"), "forearm.x"),
    ],
)
def test_a_file_that_does_not_fit_is_refused(text: str, wanted: str) -> None:
    with pytest.raises(FieldError, match=re.escape(wanted)):
        ur_kinematics(parse_urdf(described("")), text)


def test_two_robots_ask_for_a_prefix() -> None:
    both = described("left_").replace("</robot>", "") + described("right_").split(">", 1)[1]
    with pytest.raises(FieldError, match="left_"):
        ur_kinematics(parse_urdf(both), kinematics_file())
    assert ur_kinematics(parse_urdf(both), kinematics_file(), prefix="right_")[0] == kinematics_file()
    with pytest.raises(FieldError, match="no joint `shoulder_pan_joint`"):
        ur_kinematics(parse_urdf((SCENARIOS / "panda.urdf").read_text()), kinematics_file())
