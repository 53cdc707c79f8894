"""Places, offsets and origins in the files of tf, easy_handeye2, PAL and xacro, and what the command refuses."""

from __future__ import annotations

import csv
import json
import math
import re
import subprocess
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")
np = pytest.importorskip("numpy")

from export_robots import SCENARIOS, disturbed, forward, motion, off, postures, turn  # noqa: E402

from body_schema import FieldError  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from body_schema.exports import pal, parse_urdf, xacro  # noqa: E402


def calibrated(binary: Path, folder: Path, scenario: str) -> Path:
    subprocess.run([binary, "calibrate", SCENARIOS / f"{scenario}.toml", "--out", folder], check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def ur10(binary: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A real calibration: poses of what the hand carries, by a camera that stands still."""
    return calibrated(binary, tmp_path_factory.mktemp("ur10") / "out", "ur10-camera")


@pytest.fixture(scope="module")
def fr3(binary: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A real calibration: poses of a camera on the hand, in the frame of a board."""
    if not SCENARIOS.joinpath("fr3-hand-eye.toml").exists():
        pytest.skip("the measurements of the Franka Research 3 do not ship")
    return calibrated(binary, tmp_path_factory.mktemp("fr3") / "out", "fr3-hand-eye")


def of_xyzw(at: dict[str, float], turned: dict[str, float]) -> np.ndarray:
    x, y, z, w = (turned[key] for key in "xyzw")
    assert math.isclose(math.hypot(x, y, z, w), 1, abs_tol=1e-12)
    m = motion([at[key] for key in "xyz"], [0, 0, 0])
    angle = 2 * math.atan2(math.hypot(x, y, z), w)
    if angle:
        m[:3, :3] = turn((x, y, z), angle)[:3, :3]
    return m


def rows(scenario: str) -> list[dict[str, float]]:
    with (SCENARIOS / f"{scenario}.csv").open() as file:
        lines = [line for line in file if not line.startswith("#")]
    return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(lines)]


def launch(text: str) -> dict[tuple[str, str], np.ndarray]:
    """What static_transform_publisher makes of a launch file, by parent and child."""
    found = {}
    for entry in yaml.safe_load(text)["launch"]:
        node = entry["node"]
        assert (node["pkg"], node["exec"]) == ("tf2_ros", "static_transform_publisher") and node["name"]
        words = node["args"].split()
        given = {key.removeprefix("--"): value for key, value in zip(words[::2], words[1::2])}
        at = {key: float(given[key]) for key in "xyz"}
        found[given["frame-id"], given["child-frame-id"]] = of_xyzw(at, {key: float(given["q" + key]) for key in "xyzw"})
    return found


def test_tf_puts_what_a_camera_saw_where_it_was(ur10: Path, tmp_path: Path) -> None:
    out = tmp_path / "places.launch.yaml"
    command = ["export", "tf", str(ur10), "--camera-frame", "camera_optical_frame", "--frame", "target=board", "--out"]
    assert main([*command, str(out)]) == 0 and main([*command, str(tmp_path / "places.json")]) == 0
    found = launch(out.read_text())
    assert set(found) == {("base_link", "camera_optical_frame"), ("tool0", "board")}
    for it in json.loads((tmp_path / "places.json").read_text())["transforms"]:
        same = found[it["header"]["frame_id"], it["child_frame_id"]]
        assert off(of_xyzw(it["transform"]["translation"], it["transform"]["rotation"]), same) < 1e-12
    # The chain from the camera to what the hand carries gives the measurements themselves.
    urdf = (ur10 / "calibrated.urdf").read_text()
    misses = []
    for row in rows("ur10-camera"):
        hand = forward(urdf, "base_link", "tool0", row) @ found["tool0", "board"]
        seen = np.linalg.inv(found["base_link", "camera_optical_frame"]) @ hand
        misses.append(np.linalg.norm(seen[:3, 3] - [row[f"target_{key}"] for key in "xyz"]))
    assert np.mean(misses) < 0.004
    print(f"UR10: {np.mean(misses) * 1e3:.2f} mm on average from what the camera measured")
    # The other way round with a frame of the measurements.
    assert main(["export", "tf", str(ur10), "--world-frame", "world", "--out", str(out), "--force"]) == 0
    back = launch(out.read_text())["world", "base_link"]
    assert off(back @ found["base_link", "camera_optical_frame"], np.eye(4)) < 1e-12


def hand_eye(path: Path) -> tuple[dict[str, object], np.ndarray]:
    """As easy_handeye2 loads it: set_message_fields takes these fields, of these types."""
    said = yaml.safe_load(path.read_text())
    assert list(said) == ["parameters", "transform"] and list(said["transform"]) == ["translation", "rotation"]
    texts = ["name", "calibration_type", "robot_base_frame", "robot_effector_frame", "tracking_base_frame", "tracking_marker_frame"]
    kinds = {**dict.fromkeys(texts, str), "freehand_robot_movement": bool, "move_group_namespace": str, "move_group": str}
    assert {key: type(value) for key, value in said["parameters"].items()} == kinds
    assert all(type(it) is float for part in said["transform"].values() for it in part.values())
    return said["parameters"], of_xyzw(said["transform"]["translation"], said["transform"]["rotation"])


def test_a_camera_on_the_hand_for_easy_handeye2(fr3: Path, tmp_path: Path) -> None:
    out = tmp_path / "mine.calib"
    command = ["export", "easy-handeye2", str(fr3), "--type", "eye_in_hand", "--camera-frame", "camera_color_optical_frame"]
    assert main([*command, "--out", str(out)]) == 0
    said, camera = hand_eye(out)
    assert said["name"] == "mine" and said["robot_effector_frame"] == "panda_link8" and said["robot_base_frame"] == "panda_link0"
    base = json.loads((fr3 / "report.json").read_text())["base"]
    urdf = (fr3 / "calibrated.urdf").read_text()
    # The board stands still: the camera is where the hand and the transform take it.
    misses = []
    for row in rows("fr3-hand-eye"):
        seen = motion(base["xyz_m"], base["rpy_rad"]) @ forward(urdf, "panda_link0", "panda_link8", row) @ camera
        misses.append(np.linalg.norm(seen[:3, 3] - [row[f"camera_{key}"] for key in "xyz"]))
    assert np.median(misses) < 0.0015
    # In another link of the hand, which stands fixed to it.
    assert main([*command, "--effector-frame", "panda_link7", "--out", str(tmp_path / "other.calib")]) == 0
    _, other = hand_eye(tmp_path / "other.calib")
    assert off(forward(urdf, "panda_link7", "panda_link8", {}) @ camera, other) < 1e-12


def test_a_camera_that_stands_still_for_easy_handeye2(ur10: Path, tmp_path: Path) -> None:
    out = tmp_path / "mine.calib"
    command = ["export", "easy-handeye2", str(ur10), "--type", "eye_on_base", "--camera-frame", "optical", "--out", str(out)]
    assert main(command) == 0
    said, camera = hand_eye(out)
    assert said["calibration_type"] == "eye_on_base" and said["robot_base_frame"] == "base_link"
    base = json.loads((ur10 / "report.json").read_text())["base"]
    assert off(np.linalg.inv(motion(base["xyz_m"], base["rpy_rad"])), camera) < 1e-12


CONSTANTS = """<?xml version="1.0"?>
<robot xmlns:xacro="http://ros.org/wiki/xacro">
  <!-- where the camera is: ½ -->
  <xacro:property name="camera_position_x" value="0.0908" />
  <xacro:property name="arm_1_joint_offset" value="0.0" />
  <xacro:property value='0.01' name='arm_2_joint_offset' />
  <xacro:property name="arm_3_joint_offset" value="0.0" />
</robot>
"""


def test_pal_adds_what_a_reading_lacks() -> None:
    urdf = (SCENARIOS / "tiago.urdf").read_text()
    found = dict.fromkeys(["arm_1_joint", "arm_2_joint"], 0.0) | {"arm_1_joint": 0.02, "arm_2_joint": -0.03}
    calibrated = urdf
    for name, angle in found.items():
        # All axes of the arm are z: a turn behind `rpy` is one of the reading.
        block = re.search(rf'<joint name="{name}" type.*?</joint>', urdf, re.S)
        assert block is not None and 'xyz="0 0 1"' in block[0]
        rpy = [float(it) for it in re.search(r'rpy="([^"]*)"', block[0])[1].split()]  # type: ignore[index]
        m = motion([0, 0, 0], rpy) @ turn((0, 0, 1), angle)
        new = [math.atan2(m[2, 1], m[2, 2]), math.asin(-m[2, 0]), math.atan2(m[1, 0], m[0, 0])]
        changed = re.sub(r'rpy="[^"]*"', f'rpy="{" ".join(map(repr, new))}"', block[0])
        calibrated = calibrated.replace(block[0], changed)
    text, said = pal(parse_urdf(urdf), parse_urdf(calibrated), CONSTANTS)
    assert said == []
    values = {it.get("name"): float(it.get("value", "")) for it in xml.fromstring(text)}
    assert values["camera_position_x"] == 0.0908 and values["arm_3_joint_offset"] == 0
    # What stood there belongs to the readings that were calibrated: the transmission's new reading is the old one and the offset.
    added = {"arm_1_joint": values["arm_1_joint_offset"], "arm_2_joint": values["arm_2_joint_offset"] - 0.01}
    for readings in postures(["arm_1_joint", "arm_2_joint", "arm_3_joint"]):
        moved = {name: value + added.get(name, 0.0) for name, value in readings.items()}
        links = ("torso_lift_link", "arm_3_link")
        assert off(forward(urdf, *links, moved), forward(calibrated, *links, readings)) < 1e-9
    number = r"""(?<=value=["'])[^"']*"""
    assert re.sub(number, "", text) == re.sub(number, "", CONSTANTS)
    # What is no offset of a reading is told.
    _, said = pal(parse_urdf(urdf), parse_urdf(disturbed(urdf, size=0.002)), CONSTANTS, joints=["arm_1_joint", "arm_4_joint"])
    assert len(said) == 2 and "no offset of a reading" in said[0] and "no property arm_4_joint_offset" in said[1]
    with pytest.raises(FieldError, match="calibration_constants"):
        pal(parse_urdf(urdf), parse_urdf(calibrated), CONSTANTS.replace("arm_", "leg_"))


XACRO = """<?xml version="1.0"?>
<robot xmlns:xacro="http://ros.org/wiki/xacro" name="arm">
  <xacro:property name="height" value="0.3"/>
  <xacro:property name="pi" value="3.141592653589793"/>
  <xacro:macro name="arm" params="prefix">
    <link name="${prefix}base"/> <link name="${prefix}a"/> <link name="${prefix}b"/> <link name="${prefix}c"/>
    <joint name="${prefix}j1" type="revolute">
      <parent link="${prefix}base"/> <child link="${prefix}a"/>
      <origin xyz="0.0  0 ${height}" rpy="0 0 0.5"/> <!-- the shoulder --> <axis xyz="0 0 1"/>
    </joint>
    <joint name="${prefix}j2" type="revolute">
      <parent link="${prefix}a"/> <child link="${prefix}b"/><axis xyz="0 0 1"/>
      <origin rpy="${pi / 2} 0 0" xyz="0.1 0 0.2"/>
    </joint>
    <joint name="${prefix}j3" type="revolute"><parent link="${prefix}b"/><child link="${prefix}c"/>
      <origin xyz="0.4 0 0"/><axis xyz="0 0 1"/></joint>
    <transmission name="t"><joint name="${prefix}j1"><hardwareInterface>x</hardwareInterface></joint></transmission>
  </xacro:macro>
  <xacro:arm prefix="left_"/>
</robot>
"""


def expanded(text: str) -> str:
    """What xacro makes of it: its properties' values, and the macro called once."""
    values = {it[0]: float(it[1]) for it in re.findall(r'<xacro:property name="(\w+)" value="([^"]*)"/>', text)}
    inside = re.search(r"<xacro:macro[^>]*>(.*)</xacro:macro>", text, re.S)
    assert inside is not None
    return "<robot>" + re.sub(r"\$\{([^}]*)\}", lambda it: str(eval(it[1], {**values, "prefix": "left_"})), inside[1]) + "</robot>"


def test_xacro_has_numbers_in_their_places_and_tells_the_rest() -> None:
    urdf = disturbed(expanded(XACRO))
    assert urdf != expanded(XACRO)
    text, by_hand, said = xacro(parse_urdf(urdf), XACRO)
    # The property of that name stands for this height alone: it is set, and that is told.
    assert len(said) == 1
    assert re.fullmatch(r"left_j1: the property height \(line 3\), which nothing else in this file uses, is \S+ now", said[0])
    assert len(by_hand) == 1 and 'name="height" value="0.3"' not in text and "${height}" in text
    roll = re.fullmatch(r"left_j2 \(line 11\): roll is \$\{pi / 2\}; it must be (\S+)", by_hand[0])
    assert roll is not None
    done = text.replace("${pi / 2}", roll[1])
    for readings in postures(["left_j1", "left_j2", "left_j3"]):
        assert off(forward(expanded(done), "left_base", "left_c", readings), forward(urdf, "left_base", "left_c", readings)) < 1e-9
    assert "<!-- the shoulder -->" in text and text.count("\n") == XACRO.count("\n")
    assert xacro(parse_urdf(expanded(XACRO)), XACRO)[0] == XACRO
    shared = XACRO.replace("<!-- the shoulder -->", "<!-- ${height} -->")
    text, by_hand, _ = xacro(parse_urdf(urdf), shared)
    assert 'name="height" value="0.3"' in text
    assert re.fullmatch(r"left_j1 \(line 7\): z is the property height \(line 3\); set it to \S+", by_hand[0]) is not None


def test_a_joint_that_cannot_be_told_from_another_is_refused() -> None:
    both = XACRO.replace("${prefix}j2", "${prefix}j1")
    with pytest.raises(FieldError, match="may be each of them"):
        xacro(parse_urdf(expanded(XACRO)), both, joints=["left_j1"])
    with pytest.raises(FieldError, match="none of the joints"):
        xacro(parse_urdf((SCENARIOS / "panda.urdf").read_text()), XACRO)


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert main(["export", *map(str, arguments)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ") and "Traceback" not in said
    return said


def test_what_was_given_wrong_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    urdf = tmp_path / "calibrated.urdf"
    urdf.write_text(expanded(XACRO).replace("<robot>", '<robot name="arm">'))
    user = tmp_path / "arm.xacro"
    user.write_text(XACRO)
    out = tmp_path / "out.xacro"
    assert "--out" in refused(capsys, "xacro", urdf, "--file", user)
    assert "--file" in refused(capsys, "xacro", urdf, "--out", out)
    assert "--prefix" in refused(capsys, "xacro", urdf, "--file", user, "--out", out, "--prefix", "left_")
    assert "no such folder" in refused(capsys, "xacro", tmp_path / "none", "--file", user, "--out", out)
    assert "report.json" in refused(capsys, "tf", urdf, "--out", out)
    assert "report.json" in refused(capsys, "tf", tmp_path, "--out", out)
    assert "none.xacro" in refused(capsys, "xacro", urdf, "--file", tmp_path / "none.xacro", "--out", out)
    assert "NAME=NAME" in refused(capsys, "mjcf", urdf, "--file", user, "--out", out, "--body", "a")
    assert "no XML" in refused(capsys, "xacro", urdf, "--file", __file__, "--out", out)
    assert "--force" in refused(capsys, "xacro", urdf, "--file", user, "--out", urdf)
    (tmp_path / "report.json").write_text("{")
    assert "no JSON" in refused(capsys, "tf", tmp_path, "--out", out)
    (tmp_path / "report.json").write_text('{"chain": null}')
    assert "no URDF" in refused(capsys, "tf", tmp_path, "--out", out)
    (tmp_path / "report.json").write_text('{"chain": {"base": "b"}, "base": {"xyz_m": [0, 0], "rpy_rad": [0, 0, 0]}}')
    assert "no place" in refused(capsys, "tf", tmp_path, "--world-frame", "w", "--out", out)
    user.write_bytes(b"\xff\xfe")
    assert "UTF-8" in refused(capsys, "xacro", urdf, "--file", user, "--out", out)
    assert not out.exists()


def test_a_dry_run_writes_nothing_and_what_is_left_gives_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    urdf, user, out = tmp_path / "c.urdf", tmp_path / "arm.xacro", tmp_path / "out.xacro"
    urdf.write_text(disturbed(expanded(XACRO)))
    user.write_text(XACRO)
    command = ["export", "xacro", str(urdf), "--file", str(user), "--out", str(out)]
    assert main([*command, "--dry-run"]) == 1
    said = capsys.readouterr().out
    assert not out.exists() and "# by hand: left_j2" in said and said.startswith("<?xml")
    assert main(command) == 1 and out.read_text() == said[: len(out.read_text())] and user.read_text() == XACRO

def test_what_a_calibration_did_not_find_is_not_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A ball in sockets: its place on the hand is found, but neither how it is turned nor where the base stands."""
    places = {"xyz_m": [0, 0, 0.1], "rpy_rad": None}
    report = {
        "chain": {"urdf": "a.urdf", "base": "base", "tip": "tip"},
        "verdict": {"use": "no", "because": "it misses"},
        "base": {"xyz_m": [0, 0, 0], "rpy_rad": [0, 0, 0], "xyz_sd_m": None, "rotation_sd_rad": None},
        "targets": [{"name": "ball", "link": "tip", **places}],
    }
    (tmp_path / "report.json").write_text(json.dumps(report))
    out = tmp_path / "out.yaml"
    assert "as given" in refused(capsys, "tf", tmp_path, "--world-frame", "w", "--out", out)
    assert "not how it is turned" in refused(capsys, "tf", tmp_path, "--out", out)
    hand = ["easy-handeye2", tmp_path, "--camera-frame", "c", "--out", out, "--type"]
    assert "not how it is turned" in refused(capsys, *hand, "eye_in_hand")
    assert "as given" in refused(capsys, *hand, "eye_on_base")
    report["targets"].append({"name": "tag", "link": "tip", "xyz_m": [0, 0, 0], "rpy_rad": [0, 0, 0]})  # type: ignore[attr-defined]
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert "--target" in refused(capsys, *hand, "eye_in_hand")
    assert "letters" in refused(capsys, "tf", tmp_path, "--frame", "tag=a b", "--out", out)
    assert not out.exists()
    assert main(["export", "tf", str(tmp_path), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "left out: ball" in said and "do not use it: it misses" in said and list(launch(out.read_text())) == [("tip", "tag")]


def test_the_command_writes_every_kind_that_takes_a_description(tmp_path: Path) -> None:
    tiago = SCENARIOS / "tiago.urdf"
    urdf, constants, mine = tmp_path / "c.urdf", tmp_path / "constants.xacro", tmp_path / "mine.xacro"
    urdf.write_text(disturbed(tiago.read_text(), size=0.002))
    constants.write_text(CONSTANTS)
    command = ["export", "pal", str(urdf), "--file", str(constants), "--out", str(mine)]
    assert main(command) == 2 and main([*command, "--original", str(tiago)]) == 0
    assert mine.read_text() == pal(parse_urdf(tiago.read_text()), parse_urdf(urdf.read_text()), CONSTANTS)[0] != CONSTANTS
    # In place, with --force alone.
    here = ["export", "pal", str(urdf), "--original", str(tiago), "--file", str(constants), "--out", str(constants)]
    assert main(here) == 2 and constants.read_text() == CONSTANTS
    assert main([*here, "--force"]) == 0 and constants.read_bytes() == mine.read_bytes()
    model, arm, out = tmp_path / "arm.xml", tmp_path / "arm.urdf", tmp_path / "out.xml"
    model.write_text(
        '<mujoco><worldbody><body name="left_a" pos="0 0 0.3" euler="0 0 28.64788975654116"><joint axis="0 0 1"/>'
        '<body name="elbow" pos="0.1 0 0.2" euler="90 0 0"><joint axis="0 0 1"/></body></body></worldbody></mujoco>'
    )
    arm.write_text(disturbed(expanded(XACRO)))
    command = ["export", "mjcf", str(arm), "--file", str(model), "--out", str(out), "--body"]
    assert main([*command, "left_b=elbo"]) == 2 and not out.exists()
    assert main([*command, "left_b=elbow"]) == 0
    pose = parse_urdf(arm.read_text()).joints["left_j2"].origin.at
    assert f'name="elbow" pos="{" ".join(map(repr, pose))}"' in out.read_text()


def test_a_file_nested_without_end_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    urdf, user = tmp_path / "c.urdf", tmp_path / "deep.xml"
    urdf.write_text(expanded(XACRO))
    user.write_text("<mujoco>" + "<default>" * 20000 + "</default>" * 20000 + "</mujoco>")
    assert "deep" in refused(capsys, "mjcf", urdf, "--file", user, "--out", tmp_path / "o.xml")


def test_a_camera_whose_pictures_were_measured_is_in_the_base_or_on_its_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = {"xyz_m": [1.25, -0.55, 0.75], "rpy_rad": [-1.9, 0.1, 1.1]}
    report = {
        "chain": {"urdf": "a.urdf", "base": "base", "tip": "tip"},
        "verdict": {"use": "yes", "because": "it fits"},
        "base": {"xyz_m": [0, 0, 0], "rpy_rad": [0, 0, 0], "xyz_sd_m": None, "rotation_sd_rad": None},
        "targets": [{"name": "tag", "link": "tip", "xyz_m": [0, 0, 0.1], "rpy_rad": [0, 0, 0]}],
        "cameras": [{"name": "webcam", "link": "base", **place}, {"name": "wrist", "link": "tip", "xyz_m": [0, 0.1, 0], "rpy_rad": [0, 0, 0]}],
    }
    (tmp_path / "report.json").write_text(json.dumps(report))
    out = tmp_path / "out.yaml"
    wanted = motion(place["xyz_m"], place["rpy_rad"])
    assert main(["export", "tf", str(tmp_path), "--out", str(out), "--camera-frame", "webcam_optical", "--frame", "wrist=eye"]) == 0
    found = launch(out.read_text())
    assert list(found) == [("base", "webcam_optical"), ("tip", "tag"), ("tip", "eye")]
    assert np.abs(found["base", "webcam_optical"] - wanted).max() < 1e-9
    assert main(["export", "tf", str(tmp_path), "--out", str(out), "--force"]) == 0
    assert ("base", "webcam") in launch(out.read_text())
    hand = ["export", "easy-handeye2", str(tmp_path), "--camera-frame", "c", "--target", "tag", "--type", "eye_on_base", "--out", str(tmp_path / "a.calib")]
    assert main(hand) == 0
    said = yaml.safe_load((tmp_path / "a.calib").read_text())["transform"]
    assert np.abs(of_xyzw(said["translation"], said["rotation"]) - wanted).max() < 1e-9
    # Where the base was found as well, the frame of the measurements is another one's than the camera's.
    deviations = {"xyz_sd_m": [1e-3] * 3, "rotation_sd_rad": [1e-3] * 3}
    report["base"] = {"xyz_m": [0.3, 0.2, 0.1], "rpy_rad": [0.1, 0.2, 0.3], **deviations}
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert main(["export", "tf", str(tmp_path), "--out", str(out), "--force", "--camera-frame", "webcam_optical"]) == 0
    found = launch(out.read_text())
    assert np.abs(found["base", "webcam_optical"] - wanted).max() < 1e-9 and ("base", "webcam") not in found
    assert main([*hand, "--force"]) == 0
    said = yaml.safe_load((tmp_path / "a.calib").read_text())["transform"]
    assert np.abs(of_xyzw(said["translation"], said["rotation"]) - wanted).max() < 1e-9
    # On the hand it is the camera that is written, not the tag that it sees.
    hand = ["export", "easy-handeye2", str(tmp_path), "--camera-frame", "c", "--type", "eye_in_hand", "--out", str(tmp_path / "b.calib")]
    report["targets"] = [{"name": "tag", "link": "base", "xyz_m": [1, 0.2, 0.1], "rpy_rad": [0, 0, 0]}]
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert main(hand) == 0
    said = yaml.safe_load((tmp_path / "b.calib").read_text())
    assert said["parameters"]["robot_effector_frame"] == "tip"
    assert said["transform"]["translation"] == {"x": 0.0, "y": 0.1, "z": 0.0}
    assert "--target" in refused(capsys, *hand[1:-1], tmp_path / "c.calib", "--target", "tag")
    report["cameras"] = report["cameras"][:1]  # type: ignore[index]
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert "eye_on_base" in refused(capsys, *hand[1:-1], tmp_path / "c.calib")
    report["cameras"].append({"name": "other", "link": "base", **place})  # type: ignore[attr-defined]
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert "2 cameras stand" in refused(capsys, "tf", tmp_path, "--camera-frame", "c", "--out", tmp_path / "b.yaml")


LEARNED = {"xyz_m": [0.3, 0.2, 0.1], "rpy_rad": [0.1, 0.2, 0.3], "xyz_sd_m": [1e-3] * 3, "rotation_sd_rad": [1e-3] * 3}
GIVEN = {"xyz_m": [0, 0, 0], "rpy_rad": [0, 0, 0], "xyz_sd_m": None, "rotation_sd_rad": None}


def reported(folder: Path, base: object, targets: dict[str, str], cameras: dict[str, str]) -> None:
    """A report of targets and cameras by the links that they are on, each at a place of its own."""
    links = enumerate((targets | cameras).items())
    at = [{"name": name, "link": link, "xyz_m": [0.1 * k, 0.2, 0], "rpy_rad": [0, 0, 0]} for k, (name, link) in links]
    report = {"chain": {"base": "base"}, "base": base, "targets": at[: len(targets)], "cameras": at[len(targets) :]}
    (folder / "report.json").write_text(json.dumps(report))


def test_easy_handeye2_has_the_camera_on_its_link_and_never_what_it_sees(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.calib"
    hand = ["easy-handeye2", str(tmp_path), "--camera-frame", "c", "--out", str(out), "--type"]
    # On the hand before a tag that stands, and on the head with the tag in the hand.
    for tag, eye in (("base", "tip"), ("tip", "head")):
        reported(tmp_path, GIVEN, {"tag": tag}, {"eye": eye})
        for more in ([], ["--target", "eye"]):
            assert main(["export", *hand, "eye_in_hand", *more, "--force"]) == 0
            said, camera = hand_eye(out)
            assert said["robot_effector_frame"] == eye and camera[0, 3] == 0.1
        out.unlink()
        assert "no camera `tag`" in refused(capsys, *hand, "eye_in_hand", "--target", "tag")
    reported(tmp_path, GIVEN, {"tag": "base"}, {"eye": "tip"})
    assert "no target is on the hand; write eye_in_hand" in refused(capsys, *hand, "eye_on_base")
    reported(tmp_path, GIVEN, {"tag": "tip"}, {"eye": "base"})
    assert "no camera is on the hand; write eye_on_base" in refused(capsys, *hand, "eye_in_hand")
    reported(tmp_path, GIVEN, {"tag": "base"}, {"left": "tip", "right": "tip"})
    assert "there are 2 cameras; name one of left, right" in refused(capsys, *hand, "eye_in_hand")
    assert not out.exists()
    # Poses of what the hand carries, in the frame of a board that has a place as well.
    reported(tmp_path, LEARNED, {"board": "base", "camera": "tip"}, {})
    assert main(["export", *hand, "eye_in_hand"]) == 0 and hand_eye(out)[1][0, 3] == 0.1


def test_of_cameras_that_stand_beside_a_base_that_was_learned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.yaml"
    command = ["tf", str(tmp_path), "--out", str(out)]
    reported(tmp_path, LEARNED, {"tag": "tip"}, {"webcam": "base"})
    assert main(["export", *command, "--camera-frame", "c"]) == 0
    found = launch(out.read_text())
    assert list(found) == [("base", "c"), ("tip", "tag")] and found["base", "c"][0, 3] == 0.1
    # Of two each has a name: what is refused says what writes both.
    reported(tmp_path, LEARNED, {"tag": "tip"}, {"webcam": "base", "other": "base"})
    said = refused(capsys, *command, "--camera-frame", "c", "--force")
    assert "2 cameras stand" in said and "export tf" in said and "--frame CAMERA=FRAME" in said
    hand = ["easy-handeye2", str(tmp_path), "--camera-frame", "c", "--out", str(tmp_path / "a.calib"), "--type", "eye_on_base"]
    assert "export tf" in refused(capsys, *hand)
    assert main(["export", *command, "--frame", "webcam=a", "--frame", "other=b", "--force"]) == 0
    assert list(launch(out.read_text())) == [("tip", "tag"), ("base", "a"), ("base", "b")]
