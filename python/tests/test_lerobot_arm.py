"""A whole run: an SO-101 in MuJoCo whose zeros are off and whose gears have play, a webcam, a printed tag.

``BODY_SCHEMA_LEROBOT_SEEDS=1,2,3,4,5,6,7,8,9,10 pytest -rP python/tests/test_lerobot_arm.py`` runs other seeds, and tells what is found.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from vision_extra import need

need()
pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install mujoco")

import numpy as np  # noqa: E402

import body_schema  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from body_schema._urdf import parse_urdf  # noqa: E402
from body_schema.lerobot import MOTORS, Setup, SimulatedArm, conclude, measure, simulated_calibration, so101_urdf, truth_of, webcam  # noqa: E402
from body_schema.lerobot._found import _longer, _other_links, against  # noqa: E402
from body_schema.vision import Camera, Target  # noqa: E402

SEEDS = [int(it) for it in os.environ.get("BODY_SCHEMA_LEROBOT_SEEDS", "1012").split(",")]
QUICK: dict[str, Any] = {"still_s": 0.002, "rate_hz": 2000.0, "say": lambda text: None}


@pytest.fixture(scope="module", autouse=True)
def renders() -> None:
    """Skips, with a word, where MuJoCo cannot render."""
    setup = Setup(so101_urdf(), "base", "gripper", simulated_calibration(), webcam(), Target.tag(0, 0.04))
    try:
        SimulatedArm(truth_of(setup), setup.camera, setup.target).close()
    except body_schema.Error as error:
        pytest.skip(str(error))


def simulated(words: list[str], out: Path, capsys: pytest.CaptureFixture[str]) -> tuple[str, dict[str, Any]]:
    """What the command says and reports of a simulated arm, whose zeros it finds to half a degree and whose tag to 2 mm."""
    assert main(["lerobot", "--robot", "simulated", *words, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    print("\n".join(line for line in said.splitlines() if line.startswith(("of ", "truth", "doubt", "camera:", "  it moves"))))
    report: dict[str, Any] = json.loads((out / "report.json").read_text(encoding="utf-8"))
    off = report["against_truth"]
    assert set(off["zeros_deg"]) == {"shoulder_lift", "elbow_flex", "wrist_flex"}
    for name, it in off["zeros_deg"].items():
        assert abs(it) < 0.5 and abs(it) < 3 * report["zeros_deg"][name]["sd"]
    assert off["tag_mm"] < 2.0
    return said, report


@pytest.mark.parametrize("seed", SEEDS)
def test_from_an_arm_to_its_files_and_again_from_the_recording(seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, record = tmp_path / "out", tmp_path / "record"
    said, report = simulated(["--seed", str(seed), "--record", str(record)], out, capsys)
    off = report["against_truth"]
    assert report["movements"] == 20
    # Play of 1 degree is half a degree to either side.
    assert max(map(abs, off["half_play_deg"].values())) < 0.2
    assert 1.0 < report["play_mm"] < 10.0
    assert "a convention" in said and "Not both" in said and "leader" in said and "do not fit any more" in said

    # By the new file a joint that reads 0 is at its true zero.
    before, after = simulated_calibration().motors, json.loads((out / "calibration.json").read_text(encoding="utf-8"))
    for name, truth in report["truth"]["zeros_deg"].items():
        steps = after[name]["homing_offset"] - before[name]["homing_offset"]
        if name in off["zeros_deg"]:
            assert abs(truth + steps * 360 / 4095) < 0.5
        else:
            assert steps == 0
    assert after["gripper"] == before["gripper"]
    assert all(after[name][key] == before[name][key] for name in MOTORS for key in ("range_min", "range_max", "id", "drive_mode"))
    # The description has the same corrections.
    import mujoco

    tree = parse_urdf((out / "calibrated.urdf").read_text(encoding="utf-8"))
    model = mujoco.MjModel.from_xml_path(str(out / "calibrated.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert np.abs(data.body("gripper").xpos - tree.pose("gripper", "base").at).max() < 1e-9
    assert np.abs(np.array(tree.pose("gripper").at) - parse_urdf(so101_urdf()).pose("gripper").at).max() > 1e-3

    # Files are kept, and the recording gives the same again.
    assert main(["lerobot", "--robot", "recorded", "--recording", str(record), "--out", str(out)]) == 2
    assert "--force" in capsys.readouterr().err
    assert main(["lerobot", "--robot", "recorded", "--recording", str(record), "--out", str(tmp_path / "again")]) == 0
    again = json.loads((tmp_path / "again" / "report.json").read_text(encoding="utf-8"))
    for name, its in report["zeros_deg"].items():
        assert again["zeros_deg"][name]["value"] == pytest.approx(its["value"], abs=1e-6)
    assert main(["lerobot", "--robot", "simulated", "--record", str(record)]) == 2
    assert "not empty" in capsys.readouterr().err


def test_a_camera_that_nobody_calibrated_is_learned_with_the_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its field of view is 56 degrees, its k1 -0.2; 65 degrees and no lens are taken at first."""
    out, record = tmp_path / "out", tmp_path / "record"
    _, report = simulated(["--fov-deg", "65", "--seed", str(SEEDS[0]), "--record", str(record)], out, capsys)
    assert not report["doubts"]
    learned, true = report["camera"], webcam()
    for value, truth, name in zip(learned["focal_px"], true.focal_px, ("fx", "fy")):
        assert abs(value - truth) < min(4 * learned["sd"][name], 20.0)
    assert abs(learned["distortion"][0] - true.distortion[0]) < min(4 * learned["sd"]["k1"], 0.1)
    assert Camera.read(out / "camera.yaml").distortion == tuple(learned["distortion"])
    # The recording knows that its camera was a guess.
    assert main(["lerobot", "--robot", "recorded", "--recording", str(record), "--out", str(tmp_path / "again")]) == 0
    again = json.loads((tmp_path / "again" / "report.json").read_text(encoding="utf-8"))
    assert again["camera"]["focal_px"] == pytest.approx(learned["focal_px"], abs=1e-3)


def run_of(setup: Setup, told: Setup | None = None, **links: tuple[float, float, float]) -> tuple[Any, Any]:
    """A truth and what was measured of it; ``told`` is what the loop is told of the arm, where that is another setup."""
    truth = truth_of(setup)
    truth.links_mm = links
    arm = SimulatedArm(truth, webcam(), setup.target, setup.seed)
    try:
        return truth, measure(told or setup, arm, **QUICK)
    finally:
        arm.close()


def setup_of(seed: int, **more: Any) -> Setup:
    camera = more.pop("camera", webcam())
    return Setup(so101_urdf(), "base", "gripper", simulated_calibration(), camera, Target.tag(0, 0.04), seed=seed, **more)


def test_where_base_and_tag_are_given_all_five_zeros_are_told() -> None:
    setup = setup_of(1013, camera_within=(0.0, 0.0), tag_within=(0.0, 0.0))
    truth, run = run_of(setup)
    off = against(setup, conclude(setup, run), truth)
    print({name: round(it, 3) for name, it in off["zeros_deg"].items()}, off["tag_mm"])
    assert set(off["zeros_deg"]) == set(MOTORS) and max(map(abs, off["zeros_deg"].values())) < 0.5
    assert off["tag_mm"] < 2.0


def _sizes(setup: Setup) -> list[float]:
    """The sizes of the tag (mm) by the doubts about 42 mm of an arm whose tag has 40, which has some doubt at least."""
    told = replace(setup, target=Target.tag(0, 0.042))
    _, run = run_of(setup, told)
    doubts = conclude(told, run).doubts
    print(doubts)
    assert doubts
    return [float(it.split(" mm, and")[0].rsplit(" ", 1)[1]) for it in doubts if "--tag says 42.0" in it]


def test_a_tag_of_another_size_is_doubted() -> None:
    """The arm's links take it up, so that no picture is missed: their lengths say it."""
    (size,) = _sizes(setup_of(SEEDS[0]))
    assert abs(size - 40.0) < 0.8


def test_a_tag_of_another_size_is_doubted_beside_a_camera_that_is_learned() -> None:
    """There some end at a wrong explanation of the pictures, which is doubted by other words: 20 of the seeds 1001 to 1024 name the tag, and all have a doubt."""
    found = [_sizes(setup_of(seed, camera=Camera.guess((640, 480)))) for seed in (1012, 1013, 1014, 1020)]
    named = [size for sizes in found for size in sizes]
    assert len(named) >= 2 and all(abs(size - 40.0) < 0.8 for size in named)


def test_links_as_no_part_of_the_arm_is_are_told() -> None:
    straight = {name: {"shift_mm": [0.5, -0.5, 2.0], "turn_deg": [0.5, 0.0, 1.0]} for name in MOTORS}
    assert _other_links(straight) == {}
    away = {**straight, "elbow_flex": {"shift_mm": [0.0, -11.0, 2.0], "turn_deg": [0.0] * 3}, "wrist_roll": {"shift_mm": [0.0] * 3, "turn_deg": [4.0, 4.0, 0.0]}}
    assert list(_other_links(away)) == ["elbow_flex", "wrist_roll"]


def test_one_link_that_is_longer_is_no_tag_of_another_size() -> None:
    setup = setup_of(SEEDS[0])
    described = {name: setup.tree().joints[name].origin.at for name in MOTORS}
    links = {name: {"shift_mm": [0.0] * 3, "turn_deg": [0.0] * 3} for name in MOTORS}
    for name in MOTORS:
        one = {**links, name: {"shift_mm": [it * 40.0 for it in described[name]], "turn_deg": [0.0] * 3}}
        assert _longer(setup, one) == 1.0
    together = {name: {"shift_mm": [it * 40.0 + 0.2 for it in at], "turn_deg": [0.0] * 3} for name, at in described.items()}
    assert abs(_longer(setup, together) - 1.04) < 0.005


def test_a_link_that_is_shorter_than_described_is_told() -> None:
    setup = setup_of(1015, movements=16)
    truth, run = run_of(setup, wrist_flex=(2.0, 0.0, 0.0))
    found = conclude(setup, run)
    off = against(setup, found, truth)
    zeros = {name: (round(it, 2), round(found.zeros_deg[name].sd, 2)) for name, it in off["zeros_deg"].items()}
    print(zeros, off["tag_mm"], found.links)
    assert found.links["wrist_flex"]["shift_mm"][0] == pytest.approx(2.0, abs=0.5)
    assert off["tag_mm"] < 2.0
    # A turn of a link's own line is a turn of its zero: deviations say so.
    assert all(abs(it) < 3.0 * sd for it, sd in zeros.values())


def test_ctrl_c_keeps_what_was_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    shots = 0
    grab = SimulatedArm.grab

    def interrupted(self: SimulatedArm) -> Any:
        nonlocal shots
        shots += 1
        if shots > stop:
            raise KeyboardInterrupt
        return grab(self)

    monkeypatch.setattr(SimulatedArm, "grab", interrupted)
    stop = 9
    assert main(["lerobot", "--robot", "simulated", "--seed", "1014", "--out", str(tmp_path), "--record", str(tmp_path / "r")]) == 0
    said = capsys.readouterr().out
    assert "interrupted" in said and "of 9 movements" in said
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["ended"] == "interrupted"
    assert len((tmp_path / "r" / "readings.jsonl").read_text(encoding="utf-8").splitlines()) == 9

    # In the last fit, too: movements are dearer than a fit.
    def cut(*_: Any) -> Any:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("body_schema.lerobot.conclude", cut)
        assert main(["lerobot", "--robot", "recorded", "--recording", str(tmp_path / "r"), "--out", str(tmp_path / "cut")]) == 130
    assert "is kept in" in capsys.readouterr().err
    assert body_schema.Session.load(tmp_path / "cut" / "session.json").status()["observations"] == 9
    # Too few say so, and write nothing.
    shots, stop = 0, 3
    assert main(["lerobot", "--robot", "simulated", "--seed", "1014", "--out", str(tmp_path / "few")]) == 2
    assert "8 are needed" in capsys.readouterr().err and not (tmp_path / "few").exists()


def test_a_dry_run_moves_and_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(SimulatedArm, "move_to", lambda *_: pytest.fail("it moved"))
    assert main(["lerobot", "--robot", "simulated", "--dry-run", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "first posture" in said and "would make 20 movements" in said and not (tmp_path / "out").exists()
