"""LeRobot's calibration file, the descriptions, and the real arm behind a fake of LeRobot's interface."""

from __future__ import annotations

import json
import math
import sys
import types
from pathlib import Path
from typing import Any

import pytest

from vision_extra import need

need()

import numpy as np  # noqa: E402

import body_schema  # noqa: E402
from body_schema import live  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from body_schema._urdf import parse_urdf  # noqa: E402
from body_schema.lerobot import (  # noqa: E402
    MOTORS,
    RealArm,
    Setup,
    mjcf_of,
    read_calibration,
    simulated_calibration,
    so101_urdf,
    webcam,
)
from body_schema.vision import Target  # noqa: E402


def written(folder: Path, **changes: dict[str, Any]) -> Path:
    motors = json.loads(simulated_calibration().to_json())
    for name, its in changes.items():
        motors[name] |= its
    path = folder / "my_arm.json"
    path.write_text(json.dumps(motors), encoding="utf-8")
    return path


def degrees(its: dict[str, int], actual: int) -> float:
    """What LeRobot reads with ``use_degrees`` where the encoder is at ``actual``: Feetech subtracts the offset, 0 is the middle."""
    return (actual - its["homing_offset"] - (its["range_min"] + its["range_max"]) / 2) * 360 / 4095


def test_an_offset_comes_off_the_homing_offset_and_all_else_stays(tmp_path: Path) -> None:
    before = read_calibration(written(tmp_path))
    after, moved, beyond = before.shifted({"shoulder_lift": 5.0, "elbow_flex": -7.5})
    assert not beyond and moved == {"shoulder_lift": -57, "elbow_flex": 85}
    for name in MOTORS:
        was, now = before.motors[name], after.motors[name]
        assert {key: it for key, it in was.items() if key != "homing_offset"} == {
            key: it for key, it in now.items() if key != "homing_offset"
        }
    # The joint that read 0 and was truly at 5 degrees now reads 5.
    assert degrees(after.motors["shoulder_lift"], 2047 + before.motors["shoulder_lift"]["homing_offset"]) == pytest.approx(5.0, abs=0.05)
    for name in ("gripper", "shoulder_pan", "wrist_roll"):
        assert after.motors[name] == before.motors[name]
    assert list(json.loads(after.to_json())) == list(before.motors)


def test_an_offset_that_lerobot_refuses_is_kept_and_a_shorter_range_is_said(tmp_path: Path) -> None:
    path = written(tmp_path, elbow_flex={"homing_offset": 2000, "range_min": 1000, "range_max": 3000})
    before = read_calibration(path)
    after, moved, beyond = before.shifted({"elbow_flex": -8.0, "wrist_flex": 1.0})
    assert after.motors["elbow_flex"] == before.motors["elbow_flex"] and set(moved) == {"wrist_flex"}
    shorter = beyond["elbow_flex"]
    assert 1000 <= shorter.range_min and shorter.range_max <= 3000
    # Where 0 is read by the shorter range, 8 degrees were read by the other: that is the true zero.
    by_old = (shorter.range_min + shorter.range_max) / 2 - 2000
    assert by_old * 360 / 4095 == pytest.approx(8.0, abs=0.1)
    assert before.shifted({"elbow_flex": 8.0})[1] == {"elbow_flex": -91}


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("{", "no JSON"),
        ("[1, 2]", "no motors"),
        ('{"gripper": {}}', "shoulder_pan"),
        ('{"a": 1}', "no motors"),
    ],
)
def test_what_is_no_calibration_file_is_refused(tmp_path: Path, content: str, told: str) -> None:
    path = tmp_path / "arm.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(body_schema.FieldError, match=told):
        read_calibration(path)
    with pytest.raises(body_schema.FieldError, match="No such file"):
        read_calibration(tmp_path / "none.json")


def test_numbers_that_are_no_steps_are_refused(tmp_path: Path) -> None:
    for wrong in ({"homing_offset": "12"}, {"range_min": True}, {"range_max": 1e9}, {"range_min": 2000, "range_max": 2010}):
        with pytest.raises(body_schema.FieldError, match="elbow_flex"):
            read_calibration(written(tmp_path, elbow_flex=wrong))


def test_the_mjcf_moves_as_the_urdf() -> None:
    mujoco = pytest.importorskip("mujoco")
    tree = parse_urdf(so101_urdf())
    model = mujoco.MjModel.from_xml_string(mjcf_of(tree, dict.fromkeys(MOTORS, (-1.0, 1.0))))
    data = mujoco.MjData(model)
    random = np.random.default_rng(3)
    for _ in range(20):
        angles = {name: float(random.uniform(-1, 1)) for name in MOTORS}
        for name, it in angles.items():
            data.joint(name).qpos[0] = it
        mujoco.mj_forward(model, data)
        pose = tree.pose("gripper", "base", angles)
        assert np.abs(data.body("gripper").xpos - pose.at).max() < 1e-9
        assert np.abs(data.body("gripper").xmat.reshape(3, 3) - pose.rotation).max() < 1e-9
    # An SO-101 in the middle of its ranges: upper arm up, forearm ahead.
    at = tree.pose("gripper", "base").at
    assert at[0] == pytest.approx(0.254, abs=1e-3) and abs(at[1]) < 1e-3 and at[2] == pytest.approx(0.267, abs=1e-3)


# The real arm.


class Follower:
    """LeRobot's ``SO101Follower`` as far as it is used: keys end in ``.pos``, values are degrees."""

    name = "so_follower"

    def __init__(self, config: types.SimpleNamespace) -> None:
        assert config.use_degrees and config.port == "/dev/arm" and config.id == "my_arm"
        self.config, self.sent, self.connected = config, [], False
        told = json.loads((config.calibration_dir / f"{config.id}.json").read_text(encoding="utf-8"))
        self.calibration = {name: types.SimpleNamespace(**its) for name, its in told.items()}
        self.is_calibrated = True
        # Folded, as an arm at rest.
        self.at = {f"{name}.pos": 0.0 for name in (*MOTORS, "gripper")} | {"shoulder_lift.pos": -30.0}
        Follower.last = self

    def connect(self, calibrate: bool = True) -> None:
        assert not calibrate, "nobody is asked by LeRobot"
        self.connected = True

    def disconnect(self) -> None:
        self.connected = False

    def get_observation(self) -> dict[str, float]:
        return dict(self.at)

    def send_action(self, action: dict[str, float]) -> dict[str, float]:
        assert self.connected and set(action) == {f"{name}.pos" for name in MOTORS}
        self.sent.append(dict(action))
        self.at |= action
        return action


class Video:
    size = (640, 480)

    def __init__(self, which: Any) -> None:
        self.which = which

    def isOpened(self) -> bool:
        return self.which == 0

    def set(self, key: int, value: float) -> bool:
        return True

    def read(self) -> tuple[bool, Any]:
        return True, np.full((*reversed(self.size), 3), 120, np.uint8)

    def release(self) -> None:
        pass


@pytest.fixture
def lerobot(monkeypatch: pytest.MonkeyPatch) -> None:
    package = types.ModuleType("lerobot.robots.so_follower")
    package.SO101Follower, package.SO101FollowerConfig = Follower, lambda **its: types.SimpleNamespace(**its)  # type: ignore[attr-defined]
    for name in ("lerobot", "lerobot.robots"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, "lerobot.robots.so_follower", package)
    monkeypatch.setattr("cv2.VideoCapture", Video)


def opened(folder: Path, **more: Any) -> RealArm:
    path = written(folder)
    setup = Setup(so101_urdf(), "base", "gripper", read_calibration(path), webcam(), Target.tag(0, 0.04))
    return RealArm(setup, path, "/dev/arm", more.pop("camera", "0"), say=lambda text: None, sleep=lambda s: None, **more)


@pytest.mark.usefixtures("lerobot")
def test_a_real_arm_moves_slowly_and_goes_home(tmp_path: Path) -> None:
    arm = opened(tmp_path, speed_deg_s=15.0)
    target = dict.fromkeys(MOTORS, 0.0) | {"wrist_flex": 0.5}
    arm.move_to(target)
    assert arm.read_joints() == pytest.approx(target)
    its = Follower.last
    ways = [its.sent[0], *its.sent]
    for before, after in zip(ways, ways[1:]):
        assert max(abs(after[key] - before[key]) for key in after) <= 15.0 / RealArm.RATE_HZ + 1e-9
    assert arm.grab().shape == (480, 640, 3)
    arm.close()
    assert not its.connected and its.at["shoulder_lift.pos"] == pytest.approx(-30.0) and its.at["gripper.pos"] == 0.0


@pytest.mark.usefixtures("lerobot")
def test_a_way_that_comes_down_is_refused(tmp_path: Path) -> None:
    arm = opened(tmp_path)
    # Leaning ahead, the forearm points up before and back after; on the way it points down.
    leaning = dict.fromkeys(MOTORS, 0.0) | {"shoulder_lift": 90.0}
    start, low, end = ({**leaning, "elbow_flex": it} for it in (-90.0, 0.0, 85.0))
    assert arm.lowest_m(start) > 0.06 and arm.lowest_m(end) > 0.06 and arm.lowest_m(low) < 0.0
    Follower.last.at |= {f"{name}.pos": it for name, it in start.items()}
    with pytest.raises(live.Unreachable, match="comes down"):
        arm.move_to({name: math.radians(it) for name, it in end.items()})
    assert not Follower.last.sent
    # From a folded arm, which lies low, it comes up.
    Follower.last.at |= {f"{name}.pos": it for name, it in low.items()}
    arm.move_to(dict.fromkeys(MOTORS, 0.0))
    assert Follower.last.sent


@pytest.mark.usefixtures("lerobot")
def test_a_real_arm_that_is_not_as_said_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(body_schema.FieldError, match="--camera"):
        opened(tmp_path, camera="7")
    monkeypatch.setattr(Video, "size", (1280, 720))
    with pytest.raises(body_schema.FieldError, match="1280 x 720"):
        opened(tmp_path)
    monkeypatch.setattr(Video, "size", (640, 480))

    class Another(Follower):
        def __init__(self, config: Any) -> None:
            super().__init__(config)
            self.is_calibrated = False

    monkeypatch.setattr(sys.modules["lerobot.robots.so_follower"], "SO101Follower", Another)
    with pytest.raises(body_schema.FieldError, match="another calibration"):
        opened(tmp_path)
    assert not Follower.last.connected


def test_without_lerobot_a_sentence_says_what_to_install(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    webcam().to_yaml(tmp_path / "camera.yaml")
    given = ["lerobot", "--robot", "so101", "--port", "x", "--calibration", str(written(tmp_path)), "--camera", "0"]
    given += ["--intrinsics", str(tmp_path / "camera.yaml")]
    # Nobody answers here, so that --yes is asked for before anything is opened.
    assert main(given) == 2 and "--yes" in capsys.readouterr().err
    if "lerobot" not in sys.modules:
        assert main([*given, "--yes"]) == 2
        assert "pip install" in capsys.readouterr().err


@pytest.mark.usefixtures("lerobot")
def test_a_camera_needs_no_calibration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["lerobot", "--robot", "so101", "--port", "x", "--calibration", str(written(tmp_path)), "--camera", "0", "--tag", "40mm"]
    assert main([*given, "--out", str(tmp_path / "out"), "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert "field of view is taken for 65 degrees" in said and "camera.yaml" in said
    for wrong, told in ((["--fov-deg", "200"], "20 to 120"), (["--camera", "7"], "cannot be opened")):
        assert main([*given, *wrong]) == 2
        assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["--robot", "so101"], "--port"),
        (["--robot", "so100", "--port", "x", "--camera", "0", "--intrinsics", "c.yaml"], "--urdf"),
        (["--robot", "recorded"], "--recording"),
        (["--robot", "recorded", "--recording", "nowhere"], "recording.json"),
        (["--robot", "simulated", "--port", "x"], "--port"),
        (["--robot", "simulated", "--tag", "forty"], "forty"),
        (["--robot", "simulated", "--movements", "2"], "--movements"),
        (["--robot", "simulated", "--seed", "-1"], "--seed"),
        (["--robot", "simulated", "--speed-deg-s", "0"], "--speed-deg-s"),
        (["--robot", "simulated", "--camera-at", "nan", "0", "0"], "camera"),
        (["--robot", "simulated", "--camera-within", "-1", "0"], "--camera-within"),
    ],
)
def test_what_is_missing_is_said(given: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lerobot", *given]) == 2
    error = capsys.readouterr().err
    assert told in error and error.startswith("error: ") and error.count("\n") == 1
