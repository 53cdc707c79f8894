"""What xacro itself makes of exported files is the calibrated robot."""

from __future__ import annotations

from pathlib import Path

import pytest

np = pytest.importorskip("numpy")
pytest.importorskip("yaml")
expander = pytest.importorskip("xacro")

from export_robots import disturbed, forward, off, postures  # noqa: E402
from test_exports_kinematics import JOINTS, LINKS, SECTIONS, described, kinematics_file, xarm  # noqa: E402
from test_exports_places import CONSTANTS, XACRO  # noqa: E402

from body_schema.__main__ import main  # noqa: E402
from body_schema.exports import pal, parse_urdf, xacro, xarm_kinematics  # noqa: E402


def expanded(text: str, path: Path) -> str:
    path.write_text(text)
    return str(expander.process_file(str(path)).toxml())


def test_xacro_expands_what_was_exported(tmp_path: Path) -> None:
    urdf = disturbed(expanded(XACRO, tmp_path / "arm.xacro"))
    text, by_hand, _ = xacro(parse_urdf(urdf), XACRO)
    text = text.replace("${pi / 2}", by_hand[0].split()[-1])
    done = expanded(text, tmp_path / "done.xacro")
    for readings in postures(["left_j1", "left_j2", "left_j3"]):
        assert off(forward(done, "left_base", "left_c", readings), forward(urdf, "left_base", "left_c", readings)) < 1e-9
    parse_urdf(done)


def loading(names: list[str], joints: list[str], links: list[str], base: str, file: Path) -> str:
    """A description that reads its origins from YAML, as those of UR and xArm do."""
    text = f'<robot xmlns:xacro="http://ros.org/wiki/xacro" name="r"><xacro:property name="k" value="${{xacro.load_yaml(\'{file}\')}}"/>'
    text += f'<xacro:property name="its" value="${{k[\'kinematics\']}}"/><link name="{base}"/>'
    for name, joint, parent, child in zip(names, joints, [base, *links], links):
        xyz, rpy = (" ".join(f"${{its['{name}']['{key}']}}" for key in keys) for keys in (("x", "y", "z"), ("roll", "pitch", "yaw")))
        text += f'<link name="{child}"/><joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        text += f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/></joint>'
    return text + "</robot>"


def test_xacro_loads_the_kinematics_of_ur(tmp_path: Path) -> None:
    urdf, mine, out = tmp_path / "calibrated.urdf", tmp_path / "default_kinematics.yaml", tmp_path / "mine.yaml"
    urdf.write_text(disturbed(described("")))
    mine.write_bytes(kinematics_file().encode())
    assert main(["export", "ur", str(urdf), "--file", str(mine), "--out", str(out)]) == 0
    made = expanded(loading(SECTIONS, JOINTS, LINKS, "base_link_inertia", out), tmp_path / "ur.xacro")
    for readings in postures(JOINTS):
        wanted = forward(urdf.read_text(), "base_link_inertia", "wrist_3_link", readings)
        assert off(forward(made, "base_link_inertia", "wrist_3_link", readings), wanted) < 1e-9


def test_xacro_loads_the_kinematics_of_xarm(tmp_path: Path) -> None:
    urdf, file = disturbed(xarm("", 7)), tmp_path / "xarm7_kinematics_mine.yaml"
    file.write_text(xarm_kinematics(parse_urdf(urdf))[0])
    names = [f"joint{it + 1}" for it in range(7)]
    made = expanded(loading(names, names, [f"link{it + 1}" for it in range(7)], "link_base", file), tmp_path / "xarm.xacro")
    for readings in postures(names):
        assert off(forward(made, "link_base", "link7", readings), forward(urdf, "link_base", "link7", readings)) < 1e-9


def test_xacro_reads_offsets_of_pal(tmp_path: Path) -> None:
    before = expanded(XACRO, tmp_path / "arm.xacro")
    after = before.replace('xyz="0.4 0 0"', 'xyz="0.4 0 0" rpy="0 0 0.02"')
    assert after != before
    text, said = pal(parse_urdf(before), parse_urdf(after), CONSTANTS.replace("arm_2_joint", "left_j3"))
    made = expanded(text.replace("</robot>", '<offset value="${left_j3_offset}"/></robot>'), tmp_path / "constants.xacro")
    assert said == [] and abs(float(made.split('<offset value="')[1].split('"')[0]) - 0.03) < 1e-12
