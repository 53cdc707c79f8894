"""Bags of ROS become tables that ``body-schema calibrate`` takes; what is wrong with them is said in a sentence."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

np = pytest.importorskip("numpy", reason="needs numpy: pip install 'body-schema[ros]'")
pytest.importorskip("rosbags", reason="needs rosbags: pip install 'body-schema[ros]'")

import body_schema  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from recorded import BASE, NAN, START_NS, TIP, URDF, Run, bag, quaternion, rotation  # noqa: E402

SEED = 1021
ROBOT = ["--urdf", str(URDF), "--base", BASE, "--tip", TIP]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bags")


@pytest.fixture(scope="module")
def bags(folder: Path) -> dict[str, Path]:
    """One run in three formats, its sensor's clock 0.4 s behind."""
    return {kind: bag(folder / kind, kind, Run(SEED), 0.4) for kind in ("sqlite3", "mcap", "bag")}


def imported(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert main(["import", *map(str, words)]) == 0, capsys.readouterr().err
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert main(["import", *map(str, words)]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ") and told.count("\n") == 1 and "Traceback" not in told, told
    return told


def held_out(binary: Path, table: Path, name: str) -> dict[str, Any]:
    ran = subprocess.run([binary, "calibrate", table / f"{name}.toml", "--json", "-"], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    report: dict[str, Any] = json.loads(ran.stdout)
    return report


@pytest.mark.parametrize("kind", ["sqlite3", "mcap", "bag"])
def test_what_a_bag_holds_is_listed(kind: str, bags: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(bags[kind].parent.rglob("*"))
    told = imported(capsys, bags[kind], "--list")
    assert sorted(bags[kind].parent.rglob("*")) == before
    lines = told.splitlines()
    joints = next(line for line in lines if line.startswith("/joint_states"))
    assert "sensor_msgs/msg/JointState" in joints and joints.endswith("joints") and "0.4" in joints
    rate = float(re.search(r"([\d.]+) Hz", joints).group(1))  # type: ignore[union-attr]
    assert 95.0 < rate < 100.0
    assert "elbow_joint, finger, shoulder_lift_joint" in told
    assert next(line for line in lines if line.startswith("/mocap/tag")).endswith("sensor")


@pytest.mark.parametrize("kind", ["sqlite3", "mcap", "bag"])
def test_a_bag_becomes_a_table(
    kind: str, bags: dict[str, Path], binary: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = imported(capsys, bags[kind], *ROBOT, "--out", tmp_path / "table", "--name", "run", "--verbose")
    record = json.loads((tmp_path / "table" / "run.json").read_text())
    (sensor,) = record["sensors"]
    assert abs(sensor["offset_s"] - 0.4) < 0.01 and sensor["offset_deviation_s"] < 0.005
    assert sensor["left_out"]["not a number"] > 5 and record["joints"]["left_out"]["stamp was there already"] > 50
    assert record["joints"]["left_out"]["not a number"] > 5
    rows = (tmp_path / "table" / "run.csv").read_text().splitlines()
    names = Run(SEED).arm.names
    titles = [f"tag_{part}" for part in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    assert rows[0].split(",") == [*names, *titles]
    assert len(rows) - 1 == sum(row["row"] is not None for row in record["rows"]) >= 28
    assert re.search(r"clock: \+0\.(39|40)\d\d ± 0\.00\d\d s", told) and told.count(": row ") == len(rows) - 1
    # Every row is one of the postures, in which the robot truly stood.
    run = Run(SEED)
    for line in rows[1:]:
        positions = np.array([float(it) for it in line.split(",")[: len(names)]])
        assert min(np.abs(positions - posture).max() for posture in run.postures) < 1e-4, line
    if kind == "mcap":
        still = bag(tmp_path / "still", "mcap", Run(SEED), 0.0, moving=False)
        imported(capsys, still, *ROBOT, "--out", tmp_path / "reference", "--name", "run", "--offset", "0")
        reference = held_out(binary, tmp_path / "reference", "run")["held_out"]["after"]["mean_mm"]
        report = held_out(binary, tmp_path / "table", "run")
        assert report["verdict"]["use"] == "yes" and not report["doubts"], report["verdict"]
        assert report["held_out"]["after"]["mean_mm"] < 1.1 * reference, (report["held_out"], reference)
        assert report["held_out"]["before"]["mean_mm"] > 5.0 * reference


def test_rows_while_the_robot_moves(
    bags: dict[str, Path], binary: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    imported(capsys, bags["mcap"], *ROBOT, "--moving", "--out", tmp_path, "--name", "run")
    assert re.search(r"reading_sigma_deg = \[0\.0\d+, ", (tmp_path / "run.toml").read_text())
    rows = [[float(it) for it in line.split(",")] for line in (tmp_path / "run.csv").read_text().splitlines()[1:]]
    run = Run(SEED)
    moving = [row for row in rows if min(np.abs(np.array(row[:6]) - posture).max() for posture in run.postures) > 0.01]
    assert len(rows) > 35 and len(moving) > 5
    for row in rows:
        # Where the true arm has the tag at these joints: half a millimetre of noise, and speed times a millisecond or two.
        _, place = run.arm.tag_at(dict(zip(run.arm.names, row[:6])))
        assert np.linalg.norm(place - row[6:9]) < 0.006, row
    report = held_out(binary, tmp_path, "run")
    assert report["held_out"]["after"]["mean_mm"] < 1.5 < report["held_out"]["before"]["mean_mm"]


def test_an_offset_that_is_given_counts_and_is_compared(bags: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    told = imported(capsys, bags["mcap"], *ROBOT, "--offset", "tag=0", "--dry-run")
    assert re.search(r"warning: \+0\.0000 s were given, and count, but the recording says \+0\.(39|40)", told)
    assert "nothing is written" in told
    told = refused(capsys, bags["mcap"], *ROBOT, "--offset", "nobody=0")
    assert "NAME=seconds with one of tag" in told


def test_nothing_is_overwritten_unless_asked(bags: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mcap.csv").write_text("mine")
    quick = [bags["mcap"], *ROBOT, "--out", tmp_path, "--max-offset", "1"]
    assert "mcap.csv already" in refused(capsys, *quick)
    assert (tmp_path / "mcap.csv").read_text() == "mine" and len(list(tmp_path.iterdir())) == 1
    imported(capsys, *quick, "--overwrite")
    assert (tmp_path / "mcap.csv").read_text().startswith("shoulder_pan_joint,")


def transforms(run: Run, offset_s: float) -> Any:
    """The tag in tf: camera → optical (static) → tag, and the robot's own joints."""

    def messages(store: Any, header: Any) -> Any:
        types = store.types
        vector, turn = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]

        def stamped(time: float, above: str, below: str, place: Any, r: Any) -> Any:
            return types["geometry_msgs/msg/TransformStamped"](
                header=header(time, above),
                child_frame_id=below,
                transform=types["geometry_msgs/msg/Transform"](translation=vector(*map(float, place)), rotation=turn(*quaternion(r))),
            )

        optical, shift = rotation([1, 0, 0], -1.5), np.array([0.01, 0.02, 0.03])
        message = types["tf2_msgs/msg/TFMessage"]
        found = [(0.0, "/tf_static", "tf2_msgs/msg/TFMessage", message([stamped(0.0, "camera", "optical", shift, optical)]))]
        for time, stamp, pose in run.readings(offset_s, faults=False):
            r, p = run.arm.tag_at(run.at(time))
            tag = stamped(stamp, "optical", "tag36h11:7", optical.T @ (p - shift), optical.T @ r)
            link = stamped(time, "base_link", "shoulder_link", [0, 0, 0.1], np.eye(3))
            found.append((time, "/tf", "tf2_msgs/msg/TFMessage", message([tag, link])))
        return found

    return messages


def test_transforms(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = Run(1022, movements=12)
    recorded = bag(tmp_path / "tf", "mcap", run, extra=transforms(run, 1.0))
    assert "optical → tag36h11:7" in imported(capsys, recorded, "--list")
    imported(capsys, recorded, *ROBOT, "--sensor", "tag=tf:camera,tag36h11:7", "--out", tmp_path / "table", "--max-offset", "3")
    record = json.loads((tmp_path / "table" / "tf.json").read_text())
    assert abs(record["sensors"][0]["offset_s"] - 1.0) < 0.01
    for line in (tmp_path / "table" / "tf.csv").read_text().splitlines()[1:]:
        row = [float(it) for it in line.split(",")]
        r, p = run.arm.tag_at(dict(zip(run.arm.names, row[:6])))
        assert np.linalg.norm(p - row[6:9]) < 2e-4
        assert abs(abs(np.dot(quaternion(r), row[9:13])) - 1.0) < 1e-6
    told = refused(capsys, recorded, *ROBOT, "--sensor", "tf:base_link,shoulder_link")
    assert "computed from the URDF, not measured" in told
    assert "no chain of transforms leads from camera to nobody" in refused(capsys, recorded, *ROBOT, "--sensor", "tf:camera,nobody")
    assert "0 transforms between" in refused(capsys, recorded, *ROBOT, "--sensor", "tf:camera,optical")


SIZE_M, FOCAL, CENTRE = 0.08, (900.0, 905.0), (640.0, 360.0)
VIEW = rotation([0, 0, 1], 0.2) @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
CORNERS = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * SIZE_M / 2


def tags(run: Run, offset_s: float, poses: bool) -> Any:
    """Detections of two tags by a camera beside the robot: corners (``apriltag_msgs``) or poses (``apriltag_ros``)."""

    def messages(store: Any, header: Any) -> Any:
        from rosbags.typesys import get_types_from_msg

        from body_schema.recordings.ros import DEFINITIONS

        for name, text in DEFINITIONS.items():
            store.register(get_types_from_msg(text, name))
        types = store.types
        package = "apriltag_ros" if poses else "apriltag_msgs"
        array, detection = (types[f"{package}/msg/AprilTagDetection{end}"] for end in ("Array", ""))
        found: list[Any] = []
        for time, stamp, _ in run.readings(offset_s, faults=False):
            r, p = run.arm.hand(run.at(time))
            # The tag looks back at the camera about as often as not; one that does not is not seen.
            r, p = VIEW @ r, VIEW @ (p + r @ [0.05, 0.0, 0.08]) + [0.0, 0.1, 2.5]
            seen = []
            if r[2, 2] > 0.2:
                points = (CORNERS @ r.T + p) + run.random.normal(0.0, 1e-5, (4, 3))
                pixels = points[:, :2] / points[:, 2:] * FOCAL + CENTRE + run.random.normal(0.0, 0.1, (4, 2))
                place = types["geometry_msgs/msg/Pose"](
                    types["geometry_msgs/msg/Point"](*map(float, p)), types["geometry_msgs/msg/Quaternion"](*quaternion(r))
                )
                for number in (3, 5):
                    if poses:
                        covered = types["geometry_msgs/msg/PoseWithCovariance"](pose=place, covariance=np.zeros(36))
                        posed = types["geometry_msgs/msg/PoseWithCovarianceStamped"](header=header(stamp, "camera"), pose=covered)
                        seen.append(detection(id=np.array([number], dtype=np.int32), size=np.array([SIZE_M]), pose=posed))
                    else:
                        point = types["apriltag_msgs/msg/Point"]
                        corners = [point(float(u), float(v)) for u, v in pixels + number]
                        seen.append(
                            detection(
                                family="36h11", id=number, hamming=0, goodness=0.0, decision_margin=50.0,
                                centre=point(0.0, 0.0), corners=corners, homography=np.zeros(9),
                            )
                        )
            found.append((time, "/tags", f"{package}/msg/AprilTagDetectionArray", array(header=header(stamp, "camera"), detections=seen)))
        if not poses:
            region = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
            k = [FOCAL[0], 0.0, CENTRE[0], 0.0, FOCAL[1], CENTRE[1], 0.0, 0.0, 1.0]
            p34 = [FOCAL[0], 0.0, CENTRE[0], 0.0, 0.0, FOCAL[1], CENTRE[1], 0.0, 0.0, 0.0, 1.0, 0.0]
            info = types["sensor_msgs/msg/CameraInfo"](
                header=header(0.0, "camera"), height=720, width=1280, distortion_model="plumb_bob", d=np.array([0.1, 0.0, 0.0, 0.0, 0.0]),
                k=np.array(k), r=np.eye(3).ravel(), p=np.array(p34), binning_x=0, binning_y=0, roi=region,
            )
            found.append((0.1, "/camera/camera_info", "sensor_msgs/msg/CameraInfo", info))
        return found

    return messages


def test_corners_of_a_tag(binary: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = Run(1023, movements=30)
    recorded = bag(tmp_path / "tags", "mcap", run, extra=tags(run, -0.4, poses=False))
    listed = imported(capsys, recorded, "--list")
    assert re.search(r"/tags .*\n +3, 5\n", listed) and re.search(r"/camera/camera_info .*camera\n", listed)
    assert "holds 3 (" in refused(capsys, recorded, *ROBOT, "--sensor", "/tags")
    assert "holds no 4, but 3 (" in refused(capsys, recorded, *ROBOT, "--sensor", "/tags#4")
    words = [recorded, *ROBOT, "--sensor", "/tags#3", "--max-offset", "3"]
    assert "--tag-size" in refused(capsys, *words)
    assert "--raw or --rectified" in refused(capsys, *words, "--tag-size", "0.08")
    imported(capsys, *words, "--tag-size", "0.08", "--rectified", "--out", tmp_path / "table")
    record = json.loads((tmp_path / "table" / "tags.json").read_text())
    assert abs(record["sensors"][0]["offset_s"] + 0.4) < 0.01
    title = (tmp_path / "table" / "tags.csv").read_text().splitlines()[0]
    assert title.endswith("camera_tag_3_u1,camera_tag_3_v1,camera_tag_3_u2,camera_tag_3_v2,camera_tag_3_u3,camera_tag_3_v3,"
                          "camera_tag_3_u4,camera_tag_3_v4")
    report = held_out(binary, tmp_path / "table", "tags")
    after, before = report["held_out"]["after"], report["held_out"]["before"]
    assert report["unit"] == "px" and after["mean_px"] < 0.3 and before["mean_px"] > 3.0 * after["mean_px"], (before, after)


def test_poses_of_a_tag_in_ros_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = Run(1024, movements=14)
    recorded = bag(tmp_path / "tags", "bag", run, extra=tags(run, 0.4, poses=True))
    imported(capsys, recorded, *ROBOT, "--sensor", "hand=/tags#5", "--out", tmp_path / "table", "--max-offset", "3")
    record = json.loads((tmp_path / "table" / "tags.json").read_text())
    assert abs(record["sensors"][0]["offset_s"] - 0.4) < 0.01 and record["sensors"][0]["frame"] == "camera"
    for line in (tmp_path / "table" / "tags.csv").read_text().splitlines()[1:]:
        row = [float(it) for it in line.split(",")]
        r, p = run.arm.hand(dict(zip(run.arm.names, row[:6])))
        assert np.linalg.norm(VIEW @ (p + r @ [0.05, 0.0, 0.08]) + [0.0, 0.1, 2.5] - row[6:9]) < 1e-3


def test_a_camera_on_the_hand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What it sees stands still: poses are turned round, the camera in the frame of the tag."""
    run = Run(1030, movements=14)
    mount = (rotation([1, 2, 0], 0.6), np.array([0.03, 0.0, 0.06]))
    tag = (rotation([0, 1, 1], 0.4), np.array([0.7, 0.2, 0.1]))

    def camera(positions: dict[str, float]) -> Any:
        """The camera in the frame of the tag."""
        r, p = run.arm.hand(positions)
        return tag[0].T @ r @ mount[0], tag[0].T @ (p + r @ mount[1] - tag[1])

    def poses(store: Any, header: Any) -> Any:
        types = store.types
        found: list[Any] = []
        for time, stamp, _ in run.readings(-0.8, faults=False):
            r, p = camera(run.at(time))
            place = types["geometry_msgs/msg/Point"](*map(float, -r.T @ p + run.random.normal(0.0, 3e-4, 3)))
            turn = types["geometry_msgs/msg/Quaternion"](*quaternion(r.T))
            pose = types["geometry_msgs/msg/Pose"](position=place, orientation=turn)
            message = types["geometry_msgs/msg/PoseStamped"](header=header(stamp, "camera"), pose=pose)
            found.append((time, "/camera/tag", "geometry_msgs/msg/PoseStamped", message))
        return found

    recorded = bag(tmp_path / "hand", "mcap", run, extra=poses)
    told = imported(capsys, recorded, *ROBOT, "--sensor", "/camera/tag", "--out", tmp_path / "table", "--max-offset", "2")
    assert "it moves with the hand" in told and ("clock: -0.79" in told or "clock: -0.80" in told)
    rows = [[float(it) for it in line.split(",")] for line in (tmp_path / "table" / "hand.csv").read_text().splitlines()[1:]]
    assert len(rows) >= 14
    for row in rows:
        r, p = camera(dict(zip(run.arm.names, row[:6])))
        assert np.linalg.norm(p - row[6:9]) < 5e-4 and abs(abs(np.dot(quaternion(r), row[9:13])) - 1.0) < 1e-6
    told = imported(capsys, recorded, *ROBOT, "--sensor", "/camera/tag", "--mounted", "beside", "--dry-run", "--max-offset", "1.5")
    assert "moves with the hand" not in told


def test_markers_of_a_type_that_the_bag_defines(tmp_path: Path) -> None:
    """The definition is in the bag alone; a type of the same name in another package is not taken for it."""
    from rosbags.typesys import get_types_from_msg

    from body_schema._commands.import_recording import opened
    from body_schema.recordings.recording import SensorSpec

    marker = "int8 id_type\nint32 marker_index\nstring marker_name\ngeometry_msgs/Point translation\n"
    run = Run(1031, movements=2)

    def markers(store: Any, header: Any) -> Any:
        for package in ("mocap4r2_msgs", "other_msgs"):
            store.register(get_types_from_msg(marker, f"{package}/msg/Marker"))
            text = f"std_msgs/Header header\nuint32 frame_number\n{package}/Marker[] markers\n"
            store.register(get_types_from_msg(text, f"{package}/msg/Markers"))
        point = store.types["geometry_msgs/msg/Point"]
        found: list[Any] = []
        for index in range(20):
            for package in ("mocap4r2_msgs", "other_msgs"):
                single, several = store.types[f"{package}/msg/Marker"], store.types[f"{package}/msg/Markers"]
                both = [single(0, number, name, point(float(index), float(number), 0.0)) for number, name in ((1, "elbow"), (2, "hand"))]
                message = several(header(index / 10, "world"), index, both)
                found.append((index / 10, f"/{package}", f"{package}/msg/Markers", message))
        return found

    recording = opened(bag(tmp_path / "markers", "mcap", run, extra=markers))
    topics = {topic.name: topic for topic in recording.topics()}
    assert topics["/mocap4r2_msgs"].names == ["elbow", "hand"] and topics["/other_msgs"].role == ""
    track = recording.sensor(SensorSpec("hand", "/mocap4r2_msgs", "hand"), {})
    assert track.kind == "position" and track.frame == "world" and track.values.tolist() == [[float(it), 2.0, 0.0] for it in range(20)]
    with pytest.raises(body_schema.FieldError, match="no reading of a sensor"):
        recording.sensor(SensorSpec("hand", "/other_msgs", "hand"), {})
    recording.close()


def test_pictures_need_the_extra_that_looks_at_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def pictures(store: Any, header: Any) -> Any:
        image = store.types["sensor_msgs/msg/Image"]
        data = np.zeros(12, dtype=np.uint8)
        return [
            (time / 10, "/camera/image_raw", "sensor_msgs/msg/Image",
             image(header=header(time / 10, "camera"), height=2, width=2, encoding="bgr8", is_bigendian=0, step=6, data=data))
            for time in range(30)
        ]  # fmt: skip

    recorded = bag(tmp_path / "pictures", "mcap", Run(1025, movements=3), extra=pictures)
    assert "pictures" in imported(capsys, recorded, "--list")
    told = refused(capsys, recorded, *ROBOT, "--sensor", "tag=/camera/image_raw")
    assert "body-schema[vision]" in told or "--target FILE" in told


def test_what_is_no_bag_is_refused(bags: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "is not there" in refused(capsys, tmp_path / "nothing", "--list")
    assert "neither a bag" in refused(capsys, tmp_path, "--list")
    text = tmp_path / "text.mcap"
    text.write_text("this is no bag")
    assert "cannot be read" in refused(capsys, text, "--list")
    (tmp_path / "empty.mcap").write_bytes(b"")
    assert "cannot be read" in refused(capsys, tmp_path / "empty.mcap", "--list")
    (tmp_path / "text.bag").write_text("nor is this")
    assert "cannot be read" in refused(capsys, tmp_path / "text.bag", "--list")
    (tmp_path / "text.db3").write_text("nor this")
    assert "cannot be read" in refused(capsys, tmp_path / "text.db3", "--list")
    (tmp_path / "yaml").mkdir()
    (tmp_path / "yaml" / "metadata.yaml").write_text("- a list")
    assert "cannot be read" in refused(capsys, tmp_path / "yaml", "--list")
    whole = next(bags["mcap"].glob("*.mcap")).read_bytes()
    for share in (0.001, 0.5, 0.999):
        cut = tmp_path / f"cut{share}.mcap"
        cut.write_bytes(whole[: int(len(whole) * share)])
        assert "cannot be read" in refused(capsys, cut, *ROBOT), share
        cut = tmp_path / f"cut{share}.bag"
        cut.write_bytes(bags["bag"].read_bytes()[: int(bags["bag"].stat().st_size * share)])
        assert "cannot be read" in refused(capsys, cut, *ROBOT), share
    shutil.copytree(bags["sqlite3"], tmp_path / "half")
    next((tmp_path / "half").glob("*.db3")).unlink()
    assert "missing" in refused(capsys, tmp_path / "half", "--list")


def test_broken_bytes_are_refused_or_read(bags: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Bytes that are overwritten at random: a sentence, or a list; never a traceback."""
    whole = next(bags["mcap"].glob("*.mcap")).read_bytes()
    random = np.random.default_rng(1026)
    for _ in range(12):
        broken = bytearray(whole)
        for at in random.integers(0, len(broken), 40):
            broken[at] = int(random.integers(256))
        (tmp_path / "broken.mcap").write_bytes(broken)
        assert main(["import", str(tmp_path / "broken.mcap"), "--list"]) in (0, 2)
        capsys.readouterr()


def test_what_a_recording_lacks_is_said(bags: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    without = bag(tmp_path / "without", "mcap", Run(1027, movements=2), joints=False)
    assert "has no joint positions" in refused(capsys, without, *ROBOT)
    from rosbags.rosbag2 import Writer

    empty = tmp_path / "empty"
    with Writer(empty, version=9):
        pass
    assert "holds no message" in refused(capsys, empty, "--list") and "no joint positions" in refused(capsys, empty, *ROBOT)
    other = tmp_path / "other.urdf"
    other.write_text(URDF.read_text().replace("elbow_joint", "my_elbow"))
    told = refused(capsys, bags["mcap"], "--urdf", other, "--base", BASE, "--tip", TIP)
    assert "my_elbow of the URDF not in the recording" in told and "--rename" in told
    told = imported(capsys, bags["mcap"], "--urdf", other, "--base", BASE, "--tip", TIP, "--rename", "elbow_joint=my_elbow",
                    "--dry-run", "--max-offset", "1")  # fmt: skip
    assert "nothing is written" in told
    assert "ee_link, tool0; name one with --tip" in refused(capsys, bags["mcap"], "--urdf", URDF)
    assert "no link `hand`" in refused(capsys, bags["mcap"], "--urdf", URDF, "--tip", "hand")
    assert "name it with --urdf" in refused(capsys, bags["mcap"])
    (tmp_path / "no.urdf").write_text("<robot")
    assert "no XML" in refused(capsys, bags["mcap"], "--urdf", tmp_path / "no.urdf")
    assert "the recording has no /nothing" in refused(capsys, bags["mcap"], *ROBOT, "--sensor", "/nothing")
    assert "is no reading of a sensor" in refused(capsys, bags["mcap"], *ROBOT, "--sensor", "/joint_states")
    assert "no joint positions" in refused(capsys, bags["mcap"], *ROBOT, "--joints", "/mocap/tag")
    assert "never stands for 60 s" in refused(capsys, bags["mcap"], *ROBOT, "--still", "60", "--max-offset", "1")
    assert "more than 0" in refused(capsys, bags["mcap"], *ROBOT, "--still", "-1")


def test_joints_in_degrees_and_messages_of_a_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = Run(1028, movements=8)

    def halves(store: Any, header: Any) -> Any:
        joints = store.types["sensor_msgs/msg/JointState"]
        nothing = np.zeros(0)
        found: list[Any] = []
        for index in range(int(run.end_s * 50)):
            for part, names in (("/left", run.arm.names[:3]), ("/right", run.arm.names[3:])):
                time = index / 50 + (0.005 if part == "/right" else 0.0)
                at = run.at(time)
                degrees = np.array([np.degrees(at[name]) + 1e-3 * run.random.normal() for name in names])
                message = joints(header=header(time, ""), name=list(names), position=degrees, velocity=nothing, effort=nothing)
                found.append((time, part, "sensor_msgs/msg/JointState", message))
        return found

    recorded = bag(tmp_path / "halves", "sqlite3", run, 0.2, joints=False, extra=halves)
    assert "--unit deg" in refused(capsys, recorded, *ROBOT)
    imported(capsys, recorded, *ROBOT, "--unit", "deg", "--out", tmp_path / "table", "--max-offset", "2")
    rows = (tmp_path / "table" / "halves.csv").read_text().splitlines()[1:]
    assert len(rows) == 9
    for line, posture in zip(rows, run.postures):
        assert np.abs(np.array([float(it) for it in line.split(",")[:6]]) - posture).max() < 1e-4


def test_help_needs_no_extra() -> None:
    code = (
        "import sys\n"
        "class Gone:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in ('numpy', 'rosbags', 'pyarrow', 'av', 'cv2'):\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Gone())\n"
        "import body_schema\n"
        "from body_schema.__main__ import main\n"
        "for words in (['--help'], ['import', '--help']):\n"
        "    try:\n"
        "        main(words)\n"
        "    except SystemExit as end:\n"
        "        assert end.code == 0\n"
        "sys.exit(main(['import', sys.argv[1], '--list']))\n"
    )
    ran = subprocess.run([sys.executable, "-c", code, str(Path(__file__).parent)], capture_output=True, text=True)
    assert ran.returncode == 2 and "pip install 'body-schema[ros]'" in ran.stderr and "Traceback" not in ran.stderr, ran.stderr
    assert "--max-offset" in ran.stdout


def test_stamps_that_are_missing_are_those_of_the_recording(tmp_path: Path) -> None:
    """A header without a stamp counts as when it was received."""
    from body_schema._commands.import_recording import opened
    from body_schema.recordings.recording import SensorSpec

    def unstamped(store: Any, header: Any) -> Any:
        types = store.types
        empty = types["std_msgs/msg/Header"](stamp=types["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id="world")
        point = types["geometry_msgs/msg/PointStamped"]
        place = types["geometry_msgs/msg/Point"]
        return [(float(time), "/point", "geometry_msgs/msg/PointStamped", point(empty, place(1.0, NAN, 0.0))) for time in range(5)]

    recorded = bag(tmp_path / "points", "mcap", Run(1029, movements=1), extra=unstamped)
    recording = opened(recorded)
    track = recording.sensor(SensorSpec("point", "/point"), {})
    recording.close()
    assert np.allclose(np.diff(track.times), 1.0) and abs(track.times[0]) < 0.1 and START_NS > 0
