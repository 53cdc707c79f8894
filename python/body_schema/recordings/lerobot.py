"""Data sets of LeRobot, versions 2.0 to 3: tables in Parquet, pictures in videos."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import Error, wrong
from .need import need
from .recording import Distortion, Recording, SensorSpec, Topic
from .tracks import Array, Camera, SensorTrack, usual_interval

APART_S = 1000.0
"""How far apart episodes are put, seconds: further than any offset that is looked for."""
STATE = "observation.state"
FRAMES = ("timestamp", "episode_index", "frame_index", "index", "task_index")


class DataSet(Recording):
    """A data set in a folder with ``meta/info.json``, or one ``episode`` of it. Episodes follow each other in time, far apart; times are
    seconds."""

    def __init__(self, path: Path, episode: int | None = None) -> None:
        self.path = path
        self._only = None if episode is None else [("episode_index", "==", episode)]
        (self._parquet,) = need("lerobot", "pyarrow.parquet")
        try:
            info = json.loads((path / "meta" / "info.json").read_text(encoding="utf-8"))
            self._features: dict[str, dict[str, Any]] = dict(info["features"])
            for feature in self._features.values():
                _size(feature), _names(feature)
            self._version = str(info.get("codebase_version", ""))
            self._info = info
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise _unreadable(path / "meta" / "info.json", error) from None
        if not self._version.startswith(("v2", "v3")):
            what = f"{path} is of version {self._version or 'unknown'}"
            raise wrong("recording", what, "convert it to v2.1 or v3.0 with LeRobot")
        self._files = sorted((path / "data").rglob("*.parquet"))
        if not self._files:
            raise wrong("recording", f"{path} has no data/**/*.parquet", "download the whole data set")
        self._last_file = self._files[-1]
        frames = self._columns(["timestamp", "episode_index"])
        episodes = np.asarray(frames["episode_index"], dtype=int).ravel()
        stamps = np.asarray(frames["timestamp"], dtype=float).ravel()
        if not len(stamps):
            what = f"{path} holds no frame" + ("" if episode is None else f" of episode {episode}")
            raise wrong("recording", what, "name another data set")
        self._starts: dict[int, float] = {}
        start = 0.0
        for episode in np.unique(episodes):
            self._starts[int(episode)] = start
            start += float(stamps[episodes == episode].max()) + APART_S
        self._episodes = episodes
        self._times = stamps + np.array([self._starts[int(it)] for it in episodes])

    def episodes(self) -> list[int]:
        """The numbers of its episodes, but for those that ``meta/info.json`` does not count yet."""
        counted = self._info.get("total_episodes")
        return [it for it in self._starts if not isinstance(counted, int) or it < counted]

    def began(self) -> float:
        # It has no dates: its last frame is taken to be as old as the file that holds it.
        return self._last_file.stat().st_mtime - float(self._times.max())

    def topics(self, whole: bool = True) -> list[Topic]:
        found = []
        steps = np.diff(np.sort(self._times))
        steps = steps[steps < APART_S / 2]
        rate = 1.0 / usual_interval(np.sort(self._times)) if len(self._times) > 1 else 0.0
        longest = float(steps.max()) if len(steps) else 0.0
        for name, feature in self._features.items():
            if name in FRAMES:
                continue
            kind = str(feature.get("dtype"))
            role = "image" if kind in ("video", "image") else "joints" if name == STATE else ""
            if not role and _components(feature):
                role = "sensor"
            names = _names(feature) if role in ("joints", "sensor") else []
            shape = " × ".join(str(it) for it in feature.get("shape", []))
            found.append(Topic(name, f"{kind} {shape}".strip(), role, len(self._times), rate, longest, names))
        return found

    def joints(self, topic: str) -> dict[str, tuple[Array, Array]]:
        feature = self._feature(topic)
        names = [name.removesuffix(".pos") for name in _names(feature)]
        if not names or len(names) != _size(feature):
            what = f"meta/info.json names {len(names)} of the {_size(feature)} values of {topic}"
            raise wrong("joints", what, f"write features.{topic}.names")
        values = self._numbers(topic)
        return {name: (self._times, values[:, index]) for index, name in enumerate(names)}

    def sensor(self, spec: SensorSpec, links: dict[str, str]) -> SensorTrack:
        feature = self._feature(spec.topic)
        components = _components(feature)
        if not components:
            what = f"{spec.topic} is no place or pose: its values are {', '.join(_names(feature)) or 'not named'}"
            raise wrong("sensor", what, "name a feature whose names end with x, y, z, or with x, y, z, qx, qy, qz, qw")
        kind = "pose" if len(components) == 7 else "position"
        values = self._numbers(spec.topic)[:, components]
        if kind == "pose":
            lengths = np.linalg.norm(values[:, 3:], axis=1, keepdims=True)
            values[:, 3:] = np.where(lengths > 1e-3, values[:, 3:] / np.maximum(lengths, 1e-3), math.nan)
        return SensorTrack(spec.name, kind, self._times, values, "", spec.topic)

    def camera(self, spec: SensorSpec, topic: str | None, rectified: bool) -> tuple[Camera, Distortion]:
        raise wrong("camera", "data sets of LeRobot do not say what their cameras are", "name a camera file with --camera FILE, or learn it: --fov-deg 65")

    def images(self, spec: SensorSpec) -> Iterator[tuple[float, Any]]:
        feature = self._feature(spec.topic)
        if feature.get("dtype") != "video":
            raise wrong("sensor", f"{spec.topic} is {feature.get('dtype')}, no video", "name a feature that is a video")
        (av,) = need("lerobot", "av")
        for episode, start in self._starts.items():
            path, begin, end = self._video(spec.topic, episode)
            times = np.sort(self._times[self._episodes == episode])
            half = 0.5 * usual_interval(times)
            try:
                with av.open(str(path)) as container:
                    stream = container.streams.video[0]
                    container.seek(int(Fraction(begin) / stream.time_base), stream=stream)
                    for frame in container.decode(stream):
                        at = float(frame.pts * stream.time_base) - begin
                        if at < -half:
                            continue
                        if at > end - begin + half:
                            break
                        yield start + at, frame.to_ndarray(format="bgr24")
            except Error:
                raise
            except (OSError, ValueError, IndexError) as error:
                raise _unreadable(path, error) from None

    def _video(self, key: str, episode: int) -> tuple[Path, float, float]:
        """The file of an episode's video, and where in it the episode begins and ends, s."""
        last = float(self._times[self._episodes == episode].max()) - self._starts[episode]
        pattern = str(self._info.get("video_path") or "")
        if self._version.startswith("v2"):
            chunk = episode // int(self._info.get("chunks_size") or 1000)
            named = pattern.format(episode_chunk=chunk, episode_index=episode, video_key=key)
            return self.path / named, 0.0, last
        for file in sorted((self.path / "meta" / "episodes").rglob("*.parquet")):
            try:
                rows = self._parquet.read_table(file).to_pylist()
            except Exception as error:
                raise _unreadable(file, error) from None
            for row in rows:
                if row.get("episode_index") == episode:
                    part = f"videos/{key}/"
                    named = pattern.format(
                        video_key=key, chunk_index=row[f"{part}chunk_index"], file_index=row[f"{part}file_index"]
                    )
                    begin = float(row[f"{part}from_timestamp"])
                    return self.path / named, begin, begin + last
        raise wrong("recording", f"meta/episodes tells no video of episode {episode}", "download the whole data set")

    def _feature(self, name: str) -> dict[str, Any]:
        if name not in self._features:
            there = ", ".join(it for it in self._features if it not in FRAMES)
            raise wrong("topic", f"the data set has no {name}", f"name one of {there}")
        return self._features[name]

    def _numbers(self, name: str) -> Array:
        values = [[math.nan if it is None else float(it) for it in np.atleast_1d(row)] for row in self._columns([name])[name]]
        size = _size(self._feature(name))
        if any(len(row) != size for row in values):
            raise wrong("recording", f"rows of {name} have other than {size} values", "mend meta/info.json")
        return np.array(values, dtype=float).reshape(-1, size)

    def _columns(self, names: list[str]) -> dict[str, list[Any]]:
        columns: dict[str, list[Any]] = {name: [] for name in names}
        for file in self._files:
            try:
                table = self._parquet.read_table(file, columns=names, filters=self._only)
                if len(table):
                    self._last_file = file
                for name in names:
                    columns[name] += table.column(name).to_pylist()
            except Exception as error:
                raise _unreadable(file, error) from None
        return columns


def is_data_set(path: Path) -> bool:
    """Whether it looks like a data set of LeRobot."""
    return (path / "meta" / "info.json").exists()


def _size(feature: dict[str, Any]) -> int:
    return math.prod(int(it) for it in feature.get("shape") or [0])


def _components(feature: dict[str, Any]) -> list[int]:
    """Which values are x, y, z, or x, y, z, qx, qy, qz, qw, by the ends of their names; none of anything else."""
    ends = [re.split(r"[_.]", name.lower())[-1] for name in _names(feature)]
    if not str(feature.get("dtype")).startswith("float") or len(ends) != _size(feature):
        return []
    wanted = ["x", "y", "z", "qx", "qy", "qz", "qw"][: len(ends)]
    return [ends.index(end) for end in wanted] if len(ends) in (3, 7) and sorted(ends) == sorted(wanted) else []


def _names(feature: dict[str, Any]) -> list[str]:
    """Names of values: a list, or lists by what they are of."""
    names = feature.get("names")
    if isinstance(names, dict):
        names = [name for part in names.values() if isinstance(part, list) for name in part]
    return [str(name) for name in names] if isinstance(names, list) else []


def _unreadable(path: Path, error: Exception) -> Error:
    text = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
    if isinstance(error, KeyError):
        text = f"{text} is missing"
    return wrong("recording", f"{path} cannot be read: {text}", "download it again, or name a data set of LeRobot, version 2 or 3")
