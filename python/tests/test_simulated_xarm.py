"""The simulated arm of docs/xarm.md: its pictures are detected, and its true origins as a kinematics file are no error."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

from vision_extra import need

need()

from simulated_xarm import judge, write  # noqa: E402

from body_schema.__main__ import main  # noqa: E402


def test_pictures_give_readings_and_the_truth_is_no_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm, out = tmp_path / "arm", tmp_path / "measured"
    write(arm, count=6)
    assert main(["print-target", "tag", str(arm / "tag.pdf"), "--id", "3", "--size-mm", "60"]) == 0
    files = {"target": "tag.toml", "camera": "camera.yaml", "joints": "joints.csv", "urdf": "xarm7.urdf"}
    options = [word for name, file in files.items() for word in (f"--{name}", str(arm / file))]
    assert main(["detect", str(arm / "pictures"), *options, "--tip", "link_eef", "--out", str(out)]) == 0
    with (out / "observations.csv").open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) == 6 and all(float(row["camera_tag_u1"]) > 0 for row in rows)
    kinematics = tmp_path / "xarm7_kinematics_true.yaml"
    assert main(["export", "xarm", str(arm / "truth.urdf"), "--out", str(kinematics)]) == 0
    capsys.readouterr()
    judge(arm, kinematics, count=50)
    described, true, _ = (float(it) for it in re.findall(r"([\d.]+) mm on average", capsys.readouterr().out))
    assert described > 1 and true == 0
