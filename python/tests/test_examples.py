"""What the examples promise."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_lerobots_zeros_are_found() -> None:
    text = (EXAMPLES / "lerobot.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL))
    ran: dict[str, object] = {"__name__": "lerobot"}
    exec(compile(code, "lerobot.md", "exec"), ran)
    found, left = ran["found_deg"], ran["left_deg"]
    assert set(found) == {"shoulder_lift", "elbow_flex", "wrist_flex"}
    assert all(abs(degrees) < 0.4 for degrees in left.values()), left
    assert ran["session"].status()["observations"] < 40
    assert ran["calibrated"]["shoulder_pan"] == ran["CALIBRATION"]["shoulder_pan"]


def test_a_person_calibrates_with_a_ball() -> None:
    ran = subprocess.run([sys.executable, EXAMPLES / "socket_by_hand.py"], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "scatter at the seven other places" in ran.stdout
    expected = [float(mm) for mm in re.findall(r"([\d.]+) mm are expected", ran.stdout)]
    assert len(expected) == 20 and expected[-1] < 10.0 < expected[0], expected


def test_a_panda_in_pybullet() -> None:
    pytest.importorskip("pybullet")
    ran = subprocess.run([sys.executable, EXAMPLES / "panda_pybullet.py", "--seeds", "3"], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert ran.stdout.count("seed ") == 3
