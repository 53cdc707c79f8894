"""Pictures as readings: what finds a target in them is a detector, and comes from elsewhere."""

from __future__ import annotations

import importlib
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable
from os import PathLike
from typing import Any, Protocol

import numpy as np

from .._errors import Error, wrong
from .tracks import Camera, SensorTrack, tell_a_plane


class Detector(Protocol):
    """What finds a target in a picture, as ``body_schema.vision.Watcher`` does."""

    def look(self, image: Any) -> Any:
        """The points of the target, ``[[u, v], …]`` (px, undistorted; ``None`` for one that is not seen), or the reason why there are none, as text.

        ``image`` is height × width × 3, 8 bit, blue, green, red. What has ``reading`` and ``reason``, as a
        ``body_schema.vision.Look`` has, is taken too.
        """


def vision() -> Any:
    """The module of the extra ``vision``."""
    try:
        return importlib.import_module("body_schema.vision")
    except ImportError:
        raise Error("pictures need the extra `vision`, which is missing; pip install 'body-schema[vision]'") from None


def detector(target: str | PathLike[str] | None, camera: Callable[[], Any]) -> Any:
    """The detector of the extra ``vision``, for a target file and a camera."""
    its = vision()
    if target is None:
        raise wrong("target", "nothing says what to look for in the pictures", "name the file of `print-target` with --target FILE")
    wanted = its.Target.read(target)
    if len(wanted.sides()) != 1:
        raise wrong("target", f"{wanted.name} has several faces", "name a flat target; `python -m body_schema detect` takes cubes")
    return its.Watcher(camera(), wanted)


def _kind(reason: str) -> str:
    """A reason without what was measured: pictures in which that alone differs have one reason."""
    return re.sub(r"\d+\.\d+|\b\d+(?= (degrees|of 255))", "…", reason)


def track(
    name: str,
    source: str,
    pictures: Iterable[tuple[float, Any]],
    detector: Detector,
    camera: Camera | None = None,
    points_m: Any = None,
    facing: tuple[float, float, float] | None = None,
) -> SensorTrack:
    """What a detector sees in pictures with times, as readings; pictures in which it sees nothing are counted by its reason.

    ``camera`` is the pinhole that the points are seen by, ``points_m`` the target's points in its own frame, m, and ``facing`` the side
    from which they are seen.
    """
    times: list[float] = []
    rows: list[list[float]] = []
    dropped: Counter[str] = Counter()
    for time, picture in pictures:
        looked = detector.look(picture)
        if hasattr(looked, "reading"):
            looked = looked.reading if looked.reading is not None else str(looked.reason)
        if looked is None or isinstance(looked, str):
            dropped[_kind(looked) if looked else "nothing was seen"] += 1
            continue
        row = [float(it) for pair in looked for it in (pair if pair is not None else (math.nan, math.nan))]
        if points_m is not None and not tell_a_plane(np.array(points_m, float)[np.isfinite(row[0::2])]):
            dropped["the points of it that are seen do not tell where it lies: three of four are in a line"] += 1
            continue
        if rows and len(row) != len(rows[0]):
            dropped["another number of points than before"] += 1
            continue
        times.append(time)
        rows.append(row)
    if not rows:
        seen = ", ".join(f"{count} × {why}" for why, count in dropped.most_common(3)) or "there are no pictures"
        raise wrong("sensor", f"the target is in no picture of {source}: {seen}", "look at the pictures, and at the target file")
    points = None if points_m is None else [[float(x) for x in point] for point in points_m]
    return SensorTrack(name, "pixels", np.array(times), np.array(rows), "", source, dropped, camera, facing, points)
