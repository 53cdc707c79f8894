"""Pictures and joint readings as a table and a calibration file, on a rendered arm."""

from __future__ import annotations

import csv
import math
import subprocess
from pathlib import Path

import pytest

from vision_extra import need

need()

import cv2  # noqa: E402
import numpy as np  # noqa: E402

import body_schema  # noqa: E402
from body_schema import FieldError, Session  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from body_schema.vision import Camera, Target  # noqa: E402
from body_schema.vision._place import optical_pose  # noqa: E402
from body_schema.vision._tables import read_joints  # noqa: E402
from rendered import MOTORS, Arm, arm_urdf  # noqa: E402

ZEROS = {"shoulder_lift": 4.0, "elbow_flex": -6.0, "wrist_flex": 2.5}
COUNT = 18


def titles(rows: list[list[str]]) -> str:
    return "\n".join(",".join(row) for row in [["image", *(f"{motor}_deg" for motor in MOTORS)], *rows]) + "\n"


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with pictures of an arm, one of them empty, its joint readings, its camera and its URDF."""
    folder = tmp_path_factory.mktemp("arm")
    (folder / "pictures").mkdir()
    random = np.random.default_rng(4)
    arm = Arm(ZEROS)
    rows: list[list[str]] = []
    while len(rows) < COUNT:
        reading = arm.move({motor: random.uniform(-1.2, 1.2) for motor in MOTORS})
        if not arm.shows() and not (len(rows) == 5):
            continue
        name = f"{len(rows) + 1}.png"
        picture = arm.picture() if len(rows) != 5 else np.full((480, 640), 120, np.uint8)
        cv2.imwrite(str(folder / "pictures" / name), picture)
        rows.append([name, *(f"{math.degrees(reading[motor]):.4f}" for motor in MOTORS)])
    (folder / "joints.csv").write_text(titles(rows))
    (folder / "robot.urdf").write_text(arm_urdf())
    Target.tag(3, 0.04).to_toml(folder / "tag.toml")
    lens = arm.lens
    Camera(lens.size, lens.focal, lens.centre, lens.k, name="webcam").to_yaml(folder / "camera.yaml")
    return folder


def run(folder: Path, out: Path, *more: str, **files: str) -> int:
    named = {"target": "tag.toml", "camera": "camera.yaml", "joints": "joints.csv", **files}
    options = [text for key, file in named.items() for text in (f"--{key}", str(folder / file))]
    return main(["detect", str(folder / "pictures"), *options, "--out", str(out), *more])


def test_pictures_and_readings_become_a_calibration(
    shot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    out = tmp_path / "measured"
    assert run(shot, out, "--urdf", str(shot / "robot.urdf")) == 0
    said = capsys.readouterr().out
    assert "6.png: left out: tag:" in said and f"{COUNT - 1} pictures give a reading, 1 do not" in said and "doubt" not in said, said
    table = list(csv.reader((out / "observations.csv").open()))
    assert table[0] == [*(f"{motor}_deg" for motor in MOTORS), *(f"webcam_tag_{axis}{corner}" for corner in range(1, 5) for axis in "uv")]
    assert len(table) == COUNT
    # The engine reads the file as it is; and what it says of the camera is near the truth.
    session = Session.from_config(out / "calibration.toml")
    assert session.channels() == [{"name": "webcam_tag", "channel": "pixels", "points": 4}] and session.joints == MOTORS
    text = (out / "calibration.toml").read_text()
    at = [float(it) for it in text.split("[[camera]]")[1].split("at_m = [")[1].split("]")[0].split(",")]
    assert np.abs(np.array(at) - Arm(ZEROS).at).max() < 0.06, at
    assert run(shot, out, "--urdf", str(shot / "robot.urdf")) == 0, "the same again is no loss"
    (out / "calibration.toml").write_text(text + "# mine\n")
    assert run(shot, out, "--urdf", str(shot / "robot.urdf")) == 2 and "--force" in capsys.readouterr().err
    assert (out / "calibration.toml").read_text().endswith("# mine\n")
    binary = request.getfixturevalue("binary")
    ran = subprocess.run([binary, "calibrate", out / "calibration.toml", "--json", "-"], capture_output=True, text=True, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    import json

    report = json.loads(ran.stdout)
    before, after = (report["held_out"][key]["mean_px"] for key in ("before", "after"))
    print(f"held out: {before:.2f} px as described, {after:.2f} px calibrated")
    assert after < 0.8 * before


def test_a_camera_that_nobody_calibrated_is_learned(shot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The focal length is 600 px; 40 degrees make 879 of it."""
    lens = Arm(ZEROS).lens
    options = ["detect", str(shot / "pictures"), "--target", str(shot / "tag.toml"), "--joints", str(shot / "joints.csv")]
    options += ["--urdf", str(shot / "robot.urdf"), "--tip", "gripper"]
    with pytest.raises(SystemExit):
        main([*options, "--out", str(tmp_path)])
    assert "--fov-deg" in capsys.readouterr().err
    assert main([*options, "--fov-deg", "40", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "calibration.toml").read_text()
    assert "its lens is learned" in text and "known_to_px" in text
    # Where things stand is guessed with a focal length that the robot's movements tell.
    guessed = float(text.split("focal_px = [")[1].split(",")[0])
    assert abs(guessed / lens.focal[0] - 1) < 0.1, guessed
    # A sign that is wrong is not taken up by the focal length without a word.
    rows = list(csv.reader((shot / "joints.csv").open()))
    turned = [[row[0], row[1], *(f"{-float(it)}" for it in row[2:3]), *row[3:]] for row in rows[1:]]
    (tmp_path / "turned.csv").write_text(titles(turned))
    given = [str(tmp_path / "turned.csv") if it.endswith("joints.csv") else it for it in options]
    capsys.readouterr()
    assert main([*given, "--fov-deg", "60", "--out", str(tmp_path / "turned"), "--dry-run"]) == 0
    assert "check signs" in capsys.readouterr().out
    report = body_schema.calibrate(tmp_path / "calibration.toml", folds=0).report
    for it in report["intrinsics"]:
        print(it)
    (focal,) = [it for it in report["intrinsics"] if it["name"] == "fx"]
    assert abs(focal["value"] - lens.focal[0]) < min(4 * focal["sd"], 40.0)
    (k1,) = [it for it in report["distortion"] if it["name"] == "k1"]
    assert abs(k1["value"] - lens.k[0]) < min(4 * k1["sd"], 0.15), k1


def test_without_a_urdf_the_file_says_what_to_write(shot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(shot, tmp_path) == 0
    text = (tmp_path / "calibration.toml").read_text()
    assert '[robot] with urdf = "robot.urdf"' in text and "Write here where it stands" in text
    assert "what the comments" in capsys.readouterr().out


def test_a_wrong_size_and_a_wrong_frame_are_told(shot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Target.tag(3, 0.05).to_toml(shot / "large.toml")
    assert run(shot, tmp_path / "a", "--urdf", str(shot / "robot.urdf"), target="large.toml") == 0
    said = capsys.readouterr().out
    assert "doubt: the target seems 0." in said and "measure its black square" in said, said
    scale = float(said.split("the target seems ")[1].split()[0])
    assert scale == pytest.approx(0.8, abs=0.05)
    turn, _ = optical_pose(Arm(ZEROS).at, Arm(ZEROS).looks_at)
    from body_schema.vision._poses import angles_of

    for frame, wrong in ((np.eye(3), False), (np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]), True)):
        rpy = [f"{it:.2f}" for it in angles_of(turn.T @ frame)]
        place = ["--camera-at", "0.45", "-0.3", "0.5", "--camera-rpy-deg", *rpy]
        assert run(shot, tmp_path / f"b{wrong}", "--urdf", str(shot / "robot.urdf"), *place) == 0
        assert ("camera's link frame" in capsys.readouterr().out) == wrong


def test_joints_that_do_not_belong_to_the_pictures_are_doubted(shot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (shot / "joints.csv").read_text().splitlines()
    names, cells = zip(*(line.split(",", 1) for line in lines[1:]))
    (shot / "shifted.csv").write_text("\n".join([lines[0], *(f"{name},{its}" for name, its in zip(names, cells[3:] + cells[:3]))]))
    assert run(shot, tmp_path, "--urdf", str(shot / "robot.urdf"), joints="shifted.csv") == 0
    assert "do not fit the URDF" in capsys.readouterr().out


def test_other_ids_and_families_are_told(shot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Target.tag(4, 0.04).to_toml(shot / "four.toml")
    assert run(shot, tmp_path / "a", target="four.toml") == 2
    said = capsys.readouterr()
    assert "tag36h11 3 is seen, not 4" in said.out and "no picture gives a reading" in said.err
    Target.tag(3, 0.04, family="aruco_4x4_50").to_toml(shot / "other.toml")
    assert run(shot, tmp_path / "b", target="other.toml") == 2
    assert "the pictures show tag36h11 3" in capsys.readouterr().out
    assert not (tmp_path / "a").exists() and not (tmp_path / "b").exists()


def test_rows_and_pictures_without_each_other_are_named(shot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (shot / "joints.csv").read_text().splitlines()
    (shot / "fewer.csv").write_text("\n".join([*lines[:4], lines[4].replace("4.png", "99.png")]))
    assert run(shot, tmp_path, joints="fewer.csv") == 0
    said = capsys.readouterr().out
    assert "99.png: left out: it is named by a row" in said and "4.png: left out: no row" in said and "3 pictures give a reading" in said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("pan,lift\n1,2\n", "which picture belongs to which row"),
        ("image;pan\na.png;1\n", "separate cells by commas"),
        ("image,pan,pan\na.png,1,2\n", "the same title"),
        ("image,pan\na.png,1,2\n", "row 2 of .* has 3 cells"),
        ("image,pan\na.png,1\na.png,2\n", "two rows"),
        ("image,pan\na.png,up\n", "'up' in pan is no number"),
        (b"image,pan\n\xff\xfe,1\n", "is no text"),
    ],
)
def test_wrong_joint_tables_are_refused(tmp_path: Path, text: str | bytes, said: str) -> None:
    (tmp_path / "joints.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(FieldError, match=said) as refused:
        read_joints(tmp_path / "joints.csv")
    assert refused.value.field == "joints" and refused.value.mend


def test_wrong_calls_are_refused(shot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = np.zeros((240, 320), np.uint8)
    (shot / "small").mkdir(exist_ok=True)
    cv2.imwrite(str(shot / "small" / "1.png"), small)
    options = [
        "--target",
        str(shot / "tag.toml"),
        "--camera",
        str(shot / "camera.yaml"),
        "--joints",
        str(shot / "joints.csv"),
        "--out",
        str(tmp_path),
    ]
    for more, said in [
        ([str(shot / "small"), *options], "1.png: the picture has 320 x 240"),
        ([str(shot / "missing"), *options], "is not there"),
        ([str(shot / "pictures"), *options, "--camera-at", "0", "0", "1"], "a point and a direction"),
        ([str(shot / "pictures"), *options, "--urdf", str(shot / "missing.urdf")], "missing.urdf"),
        ([str(shot / "pictures"), *options, "--urdf", str(shot / "robot.urdf"), "--tip", "hand"], "hand"),
        ([str(shot / "pictures"), *options, "--camera-name", "a b"], "'a b' is no name"),
        ([str(shot / "pictures"), str(shot / "pictures" / "1.png"), *options], "two pictures are called 1.png"),
    ]:
        assert main(["detect", *more]) == 2, more
        said_now = capsys.readouterr().err
        assert said in said_now and "Traceback" not in said_now, said_now
    assert list(tmp_path.iterdir()) == []
