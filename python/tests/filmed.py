"""The simulated SO-101 filmed while ``measure`` moves it: what a recorder beside it writes, as a bag (MCAP) and as a data set of LeRobot.

``python python/tests/filmed.py FIRST LAST`` takes the seeds through ``import`` and ``body-schema calibrate``, and tells how far off they are.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from body_schema.__main__ import main as command
from body_schema._urdf import parse_urdf
from body_schema.lerobot import MOTORS, Setup, SimulatedArm, measure, simulated_calibration, so101_urdf, truth_of, webcam
from body_schema.lerobot import _simulated
from body_schema.vision import Target
from body_schema.vision._targets import rigid_motion

START_NS = 1_700_000_000_000_000_000
LATENCY_S = 0.08
"""How late a picture is stamped."""
FPS = 10
"""Pictures a second, and readings in a data set of LeRobot."""
JOINTS_HZ = 50
STANDS_S, SPEED_DEG_S = 1.0, 45.0
CLEAR = {"shoulder_lift", "elbow_flex", "wrist_flex"}
"""Motors whose zeros are told while nobody knows where the camera stands and how the tag is turned."""


class FilmedArm(SimulatedArm):
    """The simulated arm, with all that a recorder beside it would have: readings and pictures over time, also on the way."""

    def __init__(self, *words: Any, **more: Any) -> None:
        super().__init__(*words, **more)
        self.now = 0.0
        self.readings: list[tuple[float, dict[str, float]]] = []
        self.pictures: list[tuple[float, Any]] = []
        self._noise_of, self._noise = self._noise, 0.0
        self._stands: tuple[dict[str, float], Any] | None = None

    def move_to(self, configuration: Mapping[str, float]) -> None:
        before, lagged = dict(self._read), dict(self._lag)
        super().move_to(configuration)
        after, lags = dict(self._read), dict(self._lag)
        way = max(abs(after[name] - before[name]) for name in MOTORS)
        if not self.readings:
            # It begins where it is first told to go.
            return
        lasts = max(way / math.radians(SPEED_DEG_S) * 1.6, 0.3)
        start = self.now
        for time, films in self._ticks(lasts):
            s = min((time - start) / lasts, 1.0)
            share = s**3 * (10 - 15 * s + 6 * s * s)
            self._read = {name: before[name] + share * (after[name] - before[name]) for name in MOTORS}
            # Gears lie against their other side soon after a turn.
            self._lag = {name: lagged[name] + min(5.0 * s, 1.0) * (lags[name] - lagged[name]) for name in MOTORS}
            self.readings.append((time, self.read_joints()))
            if films:
                self._film(time)
        self._read, self._lag = after, lags

    def grab(self) -> Any:
        for time, films in self._ticks(STANDS_S):
            self.readings.append((time, self.read_joints()))
            if films:
                self._film(time)
        return self.pictures[-1][1]

    def _film(self, time: float) -> None:
        """A picture; one of an arm that stands is rendered once, and has noise of its own each time."""
        if self._stands is None or self._stands[0] != self.truly():
            self._stands = self.truly(), super().grab().astype(np.float32)
        noisy = self._stands[1] + self._random.normal(0.0, self._noise_of, self._stands[1].shape)
        self.pictures.append((time, np.clip(np.round(noisy), 0, 255).astype(np.uint8)))

    def _ticks(self, lasts: float) -> Any:
        """Times of readings until so much later, and whether there is a picture too."""
        first, last = round(self.now * JOINTS_HZ) + 1, round((self.now + lasts) * JOINTS_HZ)
        for tick in range(first, last + 1):
            yield tick / JOINTS_HZ, tick % (JOINTS_HZ // FPS) == 0
        self.now = last / JOINTS_HZ


def setup_of(seed: int, movements: int) -> Setup:
    target = Target.tag(0, 0.04, name="tag")
    return Setup(so101_urdf(), "base", "gripper", simulated_calibration(), webcam(), target, seed=seed, movements=movements)


def filmed(setup: Setup) -> FilmedArm:
    """A run, and what was recorded of it."""
    fine, _simulated._FINE = _simulated._FINE, 1
    try:
        arm = FilmedArm(truth_of(setup), setup.camera, setup.target, setup.seed)
        try:
            measure(setup, arm, still_s=0.002, rate_hz=2000.0, say=lambda text: None)
        finally:
            arm.close()
    finally:
        _simulated._FINE = fine
    return arm


def bag(path: Path, setup: Setup, arm: FilmedArm) -> Path:
    """An MCAP of JointState, CompressedImage and CameraInfo."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types

    def header(time: float, frame: str = "") -> Any:
        ns = START_NS + round(time * 1e9)
        stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)

    nothing, camera = np.zeros(0), setup.camera
    (fx, fy), (cx, cy) = camera.focal_px, camera.centre_px
    k = np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1.0])
    region = types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    messages: list[tuple[float, str, str, Any]] = []
    for time, reading in arm.readings:
        kind = "sensor_msgs/msg/JointState"
        position = np.array([*reading.values(), 0.1])
        message = types[kind](header=header(time), name=[*reading, "gripper"], position=position, velocity=nothing, effort=nothing)
        messages.append((time, "/joint_states", kind, message))
    for time, picture in arm.pictures:
        head, kind = header(time + LATENCY_S, "camera"), "sensor_msgs/msg/CompressedImage"
        data = np.frombuffer(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes(), np.uint8)
        messages.append((time + LATENCY_S, "/camera/image_raw/compressed", kind, types[kind](header=head, format="jpeg", data=data)))
        kind = "sensor_msgs/msg/CameraInfo"
        message = types[kind](
            header=head, height=camera.size_px[1], width=camera.size_px[0], distortion_model="plumb_bob", d=np.array([-0.2, 0, 0, 0, 0.0]),
            k=k, r=np.eye(3).ravel(), p=np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1.0, 0]), binning_x=0, binning_y=0, roi=region,
        )  # fmt: skip
        messages.append((time + LATENCY_S, "/camera/camera_info", kind, message))
    messages.sort(key=lambda it: it[0])
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics: dict[str, Any] = {}
        for time, topic, kind, message in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], START_NS + round(time * 1e9), store.serialize_cdr(message, kind))
    return path


def data_set(path: Path, arm: FilmedArm) -> Path:
    """A data set of LeRobot, version 3, of one episode: states in degrees, and a video (AV1, as LeRobot compresses it)."""
    os.environ.setdefault("SVT_LOG", "1")
    import av
    import pyarrow
    import pyarrow.parquet as parquet

    key, names = "observation.images.front", [f"{name}.pos" for name in (*MOTORS, "gripper")]
    # A frame has the picture that had come last.
    times = [time for time, _ in arm.pictures]
    ticks = np.arange(math.ceil((times[0] + LATENCY_S) * FPS), int(times[-1] * FPS)) / FPS
    at = dict(zip((round(time * JOINTS_HZ) for time, _ in arm.readings), (reading for _, reading in arm.readings)))
    states = [[*map(math.degrees, at[round(tick * JOINTS_HZ)].values()), 50.0] for tick in ticks]
    shown = [arm.pictures[int(np.searchsorted(times, tick - LATENCY_S + 1e-9)) - 1][1] for tick in ticks]
    height, width = shown[0].shape[:2]
    features: dict[str, Any] = {
        "observation.state": {"dtype": "float32", "shape": [6], "names": names},
        "action": {"dtype": "float32", "shape": [6], "names": names},
        key: {"dtype": "video", "shape": [height, width, 3], "names": ["height", "width", "channels"], "info": {"video.fps": FPS}},
    }
    for name in ("timestamp", "frame_index", "episode_index", "index", "task_index"):
        features[name] = {"dtype": "float32" if name == "timestamp" else "int64", "shape": [1], "names": None}
    info = {
        "codebase_version": "v3.0", "robot_type": "so101_follower", "fps": FPS, "features": features, "chunks_size": 1000,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
    }  # fmt: skip
    count = len(ticks)
    state = pyarrow.array(states, pyarrow.list_(pyarrow.float32()))
    table = pyarrow.table({
        "observation.state": state, "action": state, "timestamp": pyarrow.array(np.arange(count) / FPS, pyarrow.float32()),
        "frame_index": pyarrow.array(range(count)), "episode_index": pyarrow.array([0] * count), "index": pyarrow.array(range(count)),
        "task_index": pyarrow.array([0] * count),
    })  # fmt: skip
    episode = {
        "episode_index": 0, f"videos/{key}/chunk_index": 0, f"videos/{key}/file_index": 0, f"videos/{key}/from_timestamp": 0.0,
        f"videos/{key}/to_timestamp": count / FPS,
    }  # fmt: skip
    for folder in ("meta/episodes/chunk-000", "data/chunk-000", f"videos/{key}/chunk-000"):
        (path / folder).mkdir(parents=True)
    (path / "meta" / "info.json").write_text(json.dumps(info))
    parquet.write_table(table, path / "data" / "chunk-000" / "file-000.parquet")
    parquet.write_table(pyarrow.Table.from_pylist([episode]), path / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    with av.open(str(path / "videos" / key / "chunk-000" / "file-000.mp4"), "w") as container:
        stream = container.add_stream("libsvtav1", rate=FPS, options={"g": "2", "crf": "30", "preset": "10", "svtav1-params": "lp=1"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for index, picture in enumerate(shown):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
            frame.pts, frame.time_base = index, Fraction(1, FPS)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def files_of(folder: Path, setup: Setup, arm: FilmedArm) -> dict[str, list[str]]:
    """What a recorder and its owner have in a folder; gives the words after ``import``, by what was recorded."""
    (folder / "so101.urdf").write_text(so101_urdf(), encoding="utf-8")
    setup.target.to_toml(folder / "tag.toml")
    setup.camera.to_yaml(folder / "camera.yaml")
    known = ["--urdf", str(folder / "so101.urdf"), "--tip", "gripper", "--target", str(folder / "tag.toml"), "--learn", "zeros"]
    run, episodes = bag(folder / "run", setup, arm), data_set(folder / "set", arm)
    return {
        "mcap": [str(run), *known, "--sensor", "tag=/camera/image_raw/compressed", "--raw", "--max-offset", "2"],
        "lerobot": [
            str(episodes), *known, "--sensor", "tag=observation.images.front", "--camera", str(folder / "camera.yaml"),
            "--unit", "deg", "--max-offset", "2",
        ],
    }  # fmt: skip


def off(setup: Setup, arm: FilmedArm, calibrated: Path) -> dict[str, Any]:
    """How far what `body-schema calibrate --out CALIBRATED` wrote is from the truth: zeros in degrees, and the tag, mm up to one motion."""
    report = json.loads((calibrated / "report.json").read_text(encoding="utf-8"))
    tree = parse_urdf((calibrated / "calibrated.urdf").read_text(encoding="utf-8"))
    truth, limits, random = arm.truth, setup.limits_deg(), np.random.default_rng(0)
    true_tree, mounted = truth.tree(), np.array(report["targets"][0]["xyz_m"])
    postures = [{name: math.radians(float(random.uniform(*limits[name]))) for name in MOTORS} for _ in range(300)]
    poses = [tree.pose("gripper", "base", it) for it in postures]
    predicted = np.array([np.array(it.rotation) @ mounted + it.at for it in poses])
    true = np.array([truth.tag(true_tree, it).at for it in postures])
    turn, shift, _, _ = rigid_motion(predicted, true)
    zeros = {it["name"]: it["offset"]["value"] - truth.zeros_deg[it["name"]] for it in report["joints"] if it["name"] in CLEAR}
    return {
        "zeros_deg": zeros,
        "tag_mm": 1e3 * float(np.linalg.norm(predicted @ turn.T + shift - true, axis=1).mean()),
        "rows": report["rows"],
        "undetermined": report["parameters"]["undetermined"],
    }


def calibrated(binary: str | Path, words: list[str], out: Path, *more: str) -> Path:
    """Take a recording through ``import`` and ``body-schema calibrate``."""
    assert command(["import", *words, "--name", "arm", "--out", str(out)]) == 0
    program = [str(binary), "calibrate", str(out / "arm.toml"), "--out", str(out / "out"), *more]
    ran = subprocess.run(program, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return out / "out"


def main() -> None:
    """Seeds, each through both ways, with 20 movements."""
    binary = os.environ.get("BODY_SCHEMA_SERVER") or Path(__file__).resolve().parents[2] / "target" / "debug" / "body-schema"
    for seed in range(int(sys.argv[1]), int(sys.argv[2]) + 1):
        setup = setup_of(seed, 20)
        arm = filmed(setup)
        with tempfile.TemporaryDirectory() as name:
            for kind, words in files_of(Path(name), setup, arm).items():
                with open(os.devnull, "w", encoding="utf-8") as nowhere, contextlib.redirect_stdout(nowhere):
                    found = off(setup, arm, calibrated(binary, words, Path(name) / kind))
                zeros = ", ".join(f"{motor} {it:+.2f}" for motor, it in found["zeros_deg"].items())
                print(f"seed {seed}, {kind}: {found['rows']} rows; zeros are off by {zeros} deg; the tag by {found['tag_mm']:.2f} mm", flush=True)


if __name__ == "__main__":
    main()
