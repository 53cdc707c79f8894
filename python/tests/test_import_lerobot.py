"""Data sets of LeRobot become tables too."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

np = pytest.importorskip("numpy", reason="needs numpy: pip install 'body-schema[lerobot]'")
pyarrow = pytest.importorskip("pyarrow", reason="needs pyarrow: pip install 'body-schema[lerobot]'")
import pyarrow.parquet as parquet  # noqa: E402

from body_schema.__main__ import main  # noqa: E402
from body_schema._commands.import_recording import opened  # noqa: E402
from body_schema.recordings.images import track  # noqa: E402
from body_schema.recordings.recording import SensorSpec  # noqa: E402
from recorded import BASE, TIP, URDF, Run  # noqa: E402

ROBOT = ["--urdf", str(URDF), "--base", BASE, "--tip", TIP]
FPS, LATENCY_S = 30, 0.12
WIDTH, HEIGHT = 320, 240


def dot(run: Run, time: float) -> tuple[float, float]:
    """Where a camera beside the robot sees the marker, px."""
    _, p = run.arm.hand(run.at(time))
    return WIDTH / 2 + 130 * p[1] / (p[0] + 3.5), HEIGHT / 2 - 130 * (p[2] - 0.3) / (p[0] + 3.5)


def frame(u: float, v: float) -> Any:
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    bright = 255.0 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * 4.0**2))
    return np.repeat(bright[:, :, None], 3, axis=2).astype(np.uint8)


class Dot:
    """Finds the middle of what is bright."""

    def look(self, image: Any) -> Any:
        bright = image.astype(float).mean(axis=2)
        bright[bright < 60] = 0.0
        if bright.sum() < 2000:
            return "nothing bright"
        rows, columns = np.indices(bright.shape)
        return [[float((columns * bright).sum() / bright.sum()), float((rows * bright).sum() / bright.sum())]]


def data_set(path: Path, version: str, runs: list[Run], videos: bool = False) -> Path:
    """What LeRobot writes: two episodes, states in degrees, a marker that is late, and a camera."""
    old = version.startswith("v2")
    names = [f"{name}.pos" for name in runs[0].arm.names] + ["gripper.pos"]
    state = {"dtype": "float32", "shape": [len(names)], "names": {"motors": names} if old else names}
    features: dict[str, Any] = {
        "observation.state": state,
        "observation.marker": {"dtype": "float32", "shape": [3], "names": ["x", "y", "z"]},
        "action": state,
    }
    for name in ("timestamp", "frame_index", "episode_index", "index", "task_index"):
        features[name] = {"dtype": "float32" if name == "timestamp" else "int64", "shape": [1], "names": None}
    info: dict[str, Any] = {"codebase_version": version, "robot_type": "ur10", "fps": FPS, "features": features, "chunks_size": 1000}
    if old:
        info["data_path"] = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
        info["video_path"] = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"
    else:
        info["data_path"] = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
        info["video_path"] = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
    if videos:
        features["observation.images.front"] = {
            "dtype": "video", "shape": [HEIGHT, WIDTH, 3], "names": ["height", "width", "channels"], "info": {"video.fps": FPS},
        }  # fmt: skip
    (path / "meta").mkdir(parents=True)
    (path / "meta" / "info.json").write_text(json.dumps(info))
    (path / "data" / "chunk-000").mkdir(parents=True)
    tables, episodes, at = [], [], 0.0
    for number, run in enumerate(runs):
        stamps = np.arange(int(run.end_s * FPS)) / FPS
        degrees = np.degrees([list(run.at(time).values()) for time in stamps])
        degrees += run.random.normal(0.0, 0.003, degrees.shape)
        states = np.column_stack([degrees, np.full(len(stamps), 50.0)])
        markers = np.array([run.arm.tag_at(run.at(max(time - LATENCY_S, 0.0)))[1] for time in stamps])
        markers += run.random.normal(0.0, 5e-4, markers.shape)
        columns = {
            "observation.state": pyarrow.array(states.tolist(), pyarrow.list_(pyarrow.float32())),
            "observation.marker": pyarrow.array(markers.tolist(), pyarrow.list_(pyarrow.float32())),
            "action": pyarrow.array(states.tolist(), pyarrow.list_(pyarrow.float32())),
            "timestamp": pyarrow.array(stamps, pyarrow.float32()),
            "frame_index": pyarrow.array(range(len(stamps))),
            "episode_index": pyarrow.array([number] * len(stamps)),
            "index": pyarrow.array(range(len(stamps))),
            "task_index": pyarrow.array([0] * len(stamps)),
        }
        tables.append(pyarrow.table(columns))
        key = "videos/observation.images.front/"
        episodes.append({"episode_index": number, f"{key}chunk_index": 0, f"{key}file_index": 0, f"{key}from_timestamp": at,
                         f"{key}to_timestamp": at + len(stamps) / FPS})  # fmt: skip
        at += len(stamps) / FPS
    if old:
        for number, table in enumerate(tables):
            parquet.write_table(table, path / info["data_path"].format(episode_chunk=0, episode_index=number))
    else:
        parquet.write_table(pyarrow.concat_tables(tables), path / info["data_path"].format(chunk_index=0, file_index=0))
        (path / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
        parquet.write_table(pyarrow.Table.from_pylist(episodes), path / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    if videos:
        pictures = [[frame(*dot(run, max(index / FPS - LATENCY_S, 0.0))) for index in range(int(run.end_s * FPS))] for run in runs]
        key = "observation.images.front"
        if old:
            for number, shown in enumerate(pictures):
                video(path / info["video_path"].format(episode_chunk=0, episode_index=number, video_key=key), shown)
        else:
            video(path / info["video_path"].format(video_key=key, chunk_index=0, file_index=0), [it for shown in pictures for it in shown])
    return path


def video(path: Path, pictures: list[Any]) -> None:
    import av

    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=FPS)
        stream.width, stream.height, stream.pix_fmt, stream.bit_rate = WIDTH, HEIGHT, "yuv420p", 4_000_000
        for index, picture in enumerate(pictures):
            shown = av.VideoFrame.from_ndarray(picture, format="bgr24")
            shown.pts, shown.time_base = index, Fraction(1, FPS)
            container.mux(stream.encode(shown))
        container.mux(stream.encode())


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert main(["import", *map(str, words)]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ") and told.count("\n") == 1 and "Traceback" not in told, told
    return told


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_a_data_set_becomes_a_table(version: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs = [Run(1031, movements=10), Run(1032, movements=8)]
    runs[1].arm = runs[0].arm
    recorded = data_set(tmp_path / "set", version, runs)
    assert main(["import", str(recorded), "--list"]) == 0
    listed = capsys.readouterr().out
    assert "observation.state" in listed and "elbow_joint.pos" in listed and "30.0 Hz" in listed
    assert "--unit deg" in refused(capsys, recorded, *ROBOT)
    assert main(["import", str(recorded), *ROBOT, "--unit", "deg", "--out", str(tmp_path / "table")]) == 0
    told = capsys.readouterr().out
    record = json.loads((tmp_path / "table" / "set.json").read_text())
    assert abs(record["sensors"][0]["offset_s"] + LATENCY_S) < 0.01, told
    lines = (tmp_path / "table" / "set.csv").read_text().splitlines()
    assert lines[0].split(",")[6:] == ["marker_x", "marker_y", "marker_z"]
    assert len(lines) - 1 == 11 + 9
    for line, posture in zip(lines[1:], runs[0].postures + runs[1].postures):
        row = np.array([float(it) for it in line.split(",")])
        assert np.abs(row[:6] - posture).max() < 2e-4
        _, place = runs[0].arm.tag_at(dict(zip(runs[0].arm.names, posture)))
        assert np.linalg.norm(row[6:] - place) < 1e-3


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_pictures_of_a_video_are_readings(version: str, tmp_path: Path) -> None:
    pytest.importorskip("av", reason="needs av: pip install 'body-schema[lerobot]'")
    runs = [Run(1033, movements=2), Run(1034, movements=2)]
    recording = opened(data_set(tmp_path / "set", version, runs, videos=True))
    spec = SensorSpec("dot", "observation.images.front")
    found = track("dot", spec.written, recording.images(spec), Dot())
    joints = recording.joints("observation.state")["elbow_joint"][0]
    assert len(found.times) == len(joints) and np.abs(np.sort(joints) - found.times).max() < 1e-3
    first = int(runs[0].end_s * FPS)
    for index in range(0, len(found.times), 7):
        run, number = (runs[0], index) if index < first else (runs[1], index - first)
        assert np.linalg.norm(found.values[index] - dot(run, max(number / FPS - LATENCY_S, 0.0))) < 1.0, index


def test_what_a_data_set_lacks_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recorded = data_set(tmp_path / "set", "v2.1", [Run(1035, movements=2)])
    words = [recorded, *ROBOT, "--unit", "deg"]
    assert "action is no place or pose: its values are shoulder_pan_joint.pos" in refused(capsys, *words, "--sensor", "action")
    assert "the data set has no nothing" in refused(capsys, *words, "--sensor", "nothing")
    info = json.loads((recorded / "meta" / "info.json").read_text())

    def written(**more: Any) -> None:
        (recorded / "meta" / "info.json").write_text(json.dumps({**info, **more}))

    written(codebase_version="v1.6")
    assert "convert it" in refused(capsys, recorded, "--list")
    state = {**info["features"]["observation.state"], "names": None}
    written(features={**info["features"], "observation.state": state})
    assert "names 0 of the 7 values" in refused(capsys, *words)
    for features in ("all", [1], {"observation.state": 1}, {"observation.state": {"shape": ["many"]}}):
        written(features=features)
        assert "cannot be read" in refused(capsys, recorded, "--list"), features
    (recorded / "meta" / "info.json").write_text("{")
    assert "cannot be read" in refused(capsys, recorded, "--list")
    written()
    file = next((recorded / "data").rglob("*.parquet"))
    file.write_bytes(file.read_bytes()[:1000])
    assert "cannot be read" in refused(capsys, recorded, "--list")
    file.unlink()
    assert "no data" in refused(capsys, recorded, "--list")
