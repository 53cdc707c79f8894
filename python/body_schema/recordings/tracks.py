"""Joint positions and readings over time, put in order."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int_]

GAP_INTERVALS = 4.0
"""Between two joint readings that are further apart than so many usual intervals nothing is interpolated."""
LEAST_POINTS = 4
"""So many points of a flat target tell where it lies, at least."""
LEAST_GAP_S = 0.1
"""Nearer ones are always interpolated, seconds."""


AT_ONCE, MOST_AT_ONCE_S = 0.15, 0.002
"""Readings that are nearer than this share of the usual time between them, and than so many seconds, are one."""


@dataclass
class JointTrack:
    """Where the joints were: ``times`` (N, s, increasing) and ``positions`` (N × n, rad or m; NaN where a joint was not read)."""

    names: list[str]
    times: Array
    positions: Array
    dropped: Counter[str] = field(default_factory=Counter)
    """Readings that were left out, by reason."""

    def __post_init__(self) -> None:
        self.interval_s = usual_interval(self.times)
        self.gap_s = max(GAP_INTERVALS * self.interval_s, LEAST_GAP_S)
        self._slopes = _slopes(self.times, self.positions)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Positions and velocities at other times (M × n each), by cubic Hermite splines; NaN outside and in gaps."""
        if len(self.times) < 2:
            nothing = np.full((len(times), len(self.names)), np.nan)
            return nothing, nothing
        before = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        width = self.times[before + 1] - self.times[before]
        s = ((times - self.times[before]) / width)[:, None]
        h = width[:, None]
        p0, p1, m0, m1 = self.positions[before], self.positions[before + 1], self._slopes[before], self._slopes[before + 1]
        rise = p1 - p0
        places = p0 + s * (h * m0 + s * ((3 * rise - h * (2 * m0 + m1)) + s * (h * (m0 + m1) - 2 * rise)))
        speeds = m0 + s * (2 * (3 * rise / h - 2 * m0 - m1) + 3 * s * (m0 + m1 - 2 * rise / h))
        bad = (s < 0.0) | (s > 1.0) | (h > self.gap_s)
        return np.where(bad, np.nan, places), np.where(bad, np.nan, speeds)


@dataclass
class SensorTrack:
    """What a sensor read: ``times`` (M, s, increasing, of its own clock) and ``values``, one row per reading.

    ``kind`` says what a row is: ``position`` (x, y, z, m), ``pose`` (x, y, z, m, qx, qy, qz, qw) or ``pixels`` (u, v, u, v, …,
    px). ``frame`` is that of the readings.
    """

    name: str
    kind: str
    times: Array
    values: Array
    frame: str = ""
    source: str = ""
    dropped: Counter[str] = field(default_factory=Counter)
    camera: Camera | None = None
    """The camera of ``pixels``."""
    facing: tuple[float, float, float] | None = None
    """The direction from which the points are seen, in the target's own frame, where they are seen from one side only."""
    points_m: list[list[float]] | None = None
    """The points that ``pixels`` are of, in the target's own frame, m."""
    _completed: tuple[Array, Array] | None = field(default=None, repr=False, compare=False)

    @property
    def is_partly_seen(self) -> bool:
        """Whether a reading lacks some of the target's points (NaN)."""
        return self.kind == "pixels" and bool(np.isnan(self.values).any())

    def completed(self) -> Array:
        """``values`` with the points that a reading lacks where the homography of its others has them: for what looks at readings as wholes."""
        if not self.is_partly_seen or self.points_m is None:
            return self.values
        if self._completed is not None and self._completed[0] is self.values:
            return self._completed[1]
        points = np.array(self.points_m)
        flat = np.column_stack([points[:, :2], np.ones(len(points))])
        whole = self.values.copy()
        for index in np.flatnonzero(np.isnan(whole).any(axis=1)):
            pixels = whole[index].reshape(-1, 2)
            lacking = np.isnan(pixels).any(axis=1)
            there = flat[lacking] @ homography(points[~lacking], pixels[~lacking]).T
            pixels[lacking] = there[:, :2] / there[:, 2:]
        self._completed = (self.values, whole)
        return whole

    def linear(self) -> Array:
        """Rows that are linear in where the target is: a pose as x, y, z and the nine entries of its rotation."""
        if self.kind != "pose":
            return self.completed()
        return np.hstack([self.values[:, :3], matrices(self.values[:, 3:]).reshape(-1, 9)])


@dataclass(frozen=True)
class Camera:
    """A pinhole: size, focal lengths and centre, px."""

    name: str
    size_px: tuple[float, float]
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    learned: dict[str, Any] = field(default_factory=dict)
    """Of a camera whose intrinsics are a guess, the keys of ``[[camera]]`` by which they are learned."""


def homography(points_m: Array, pixels: Array) -> Array:
    """H (3 × 3) of the points of a plane z = 0 (k × 3, that ``tell_a_plane``) to their pixels (k × 2), by the least singular vector."""
    return np.asarray(np.linalg.svd(_equations(points_m[:, :2], pixels))[2][-1].reshape(3, 3))


def tell_a_plane(points_m: Array) -> bool:
    """Whether the pixels of points of a plane z = 0 (k × 3) tell a homography: four of them, no three in a line, or more."""
    if len(points_m) < LEAST_POINTS:
        return False
    flat = points_m[:, :2] - points_m[:, :2].mean(axis=0)
    flat /= max(float(np.abs(flat).max()), 1e-12)
    left = np.linalg.svd(_equations(flat, flat), compute_uv=False)
    return bool(left[7] > 1e-6 * left[0])


def _equations(flat: Array, pixels: Array) -> Array:
    (u, v), zero = pixels.T, np.zeros((len(pixels), 3))
    flat = np.column_stack([flat, np.ones(len(pixels))])
    return np.vstack([np.hstack([flat, zero, -u[:, None] * flat]), np.hstack([zero, flat, -v[:, None] * flat])])


def in_order(times: Array, values: Array, dropped: Counter[str], partly_seen: bool = False) -> tuple[Array, Array]:
    """Rows by time, without those in which a number is missing or whose stamp is there already; ``dropped`` counts them. Of a target that is
    ``partly_seen`` points may be missing."""
    there = np.isfinite(values).any(axis=1) if partly_seen else np.isfinite(values).all(axis=1)
    finite = np.isfinite(times) & there if values.size else np.zeros(len(times), dtype=bool)
    _count(dropped, "not a number", int((~finite).sum()))
    times, values = times[finite], values[finite]
    if len(times) > 1:
        _count(dropped, "out of order, sorted", int((np.diff(times) < 0.0).sum()))
    order = np.argsort(times, kind="stable")
    times, values = times[order], values[order]
    new = np.concatenate([[True], np.diff(times) > 1e-9]) if len(times) else np.zeros(0, dtype=bool)
    _count(dropped, "stamp was there already", int((~new).sum()))
    return times[new], values[new]


def _merged(times: Array, column: Array, dropped: Counter[str]) -> tuple[Array, Array]:
    """Readings, of which those that come nearly at once, as from two publishers, are their mean: between them noise is no movement."""
    if len(times) < 3:
        return times, column
    steps = np.diff(times)
    apart = steps > min(AT_ONCE * float(np.quantile(steps, 0.75)), MOST_AT_ONCE_S)
    if apart.all():
        return times, column
    first = np.flatnonzero(np.concatenate([[True], apart]))
    count = np.diff(np.append(first, len(times)))
    _count(dropped, "stands for several at once", int((count - 1).sum()))
    return np.add.reduceat(times, first) / count, np.add.reduceat(column, first) / count


def joint_track(names: list[str], series: dict[str, tuple[Array, Array]], turns: set[str], dropped: Counter[str]) -> JointTrack:
    """One track of joints that may come in different messages: at the times of all messages.

    ``series`` holds times and positions by joint, ``turns`` the joints that turn without end, which are unwrapped.
    """
    clean: dict[str, tuple[Array, Array]] = {}
    for name in names:
        times, positions = in_order(series[name][0], series[name][1][:, None], dropped)
        column = positions[:, 0]
        clean[name] = _merged(times, np.unwrap(column) if name in turns else column, dropped)
    first = clean[names[0]][0]
    if all(len(it[0]) == len(first) and np.array_equal(it[0], first) for it in clean.values()):
        return JointTrack(names, first, np.column_stack([clean[name][1] for name in names]), dropped)
    # Messages of a part of the joints, or readings that are missing: each joint is interpolated by itself.
    finest = max(clean.values(), key=lambda it: len(it[0]))[0]
    columns = []
    for name in names:
        alone = JointTrack([name], clean[name][0], clean[name][1][:, None])
        columns.append(alone.at(finest)[0][:, 0])
    positions = np.column_stack(columns)
    known = np.isfinite(positions).all(axis=1)
    _count(dropped, "a joint had no reading near it", int((~known).sum()))
    return JointTrack(names, finest[known], positions[known], dropped)


def usual_interval(times: Array) -> float:
    """The median time between readings, s; 0 where there are fewer than two."""
    return float(np.median(np.diff(times))) if len(times) > 1 else 0.0


def jitter(times: Array) -> float:
    """How unevenly stamps stand, as the standard deviation of one, s; robust, so that dropouts do not count."""
    if len(times) < 8:
        return 0.0
    steps = np.diff(times)
    return float(1.4826 * np.median(np.abs(steps - np.median(steps))) / np.sqrt(2.0))


def jumps(sensor: SensorTrack) -> Flags:
    """Readings that leave both neighbours by far more than these leave each other: wrong detections."""
    places = sensor.values[:, :3] if sensor.kind == "pose" else sensor.completed()
    odd = np.zeros(len(places), dtype=bool)
    if len(places) < 5:
        return odd
    before = np.linalg.norm(places[1:-1] - places[:-2], axis=1)
    after = np.linalg.norm(places[2:] - places[1:-1], axis=1)
    across = np.linalg.norm(places[2:] - places[:-2], axis=1)
    usual = float(np.quantile(before, 0.9))
    odd[1:-1] = np.minimum(before, after) > 3.0 * across + 3.0 * usual
    return odd


def matrices(quaternions: Array) -> Array:
    """Rotations (N × 3 × 3) of quaternions x, y, z, w (N × 4), which need not be of unit length."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def homogeneous(poses: Array) -> Array:
    """Poses x, y, z, qx, qy, qz, qw (N × 7) as N × 4 × 4."""
    places = np.zeros((len(poses), 4, 4))
    places[:, :3, :3], places[:, :3, 3], places[:, 3, 3] = matrices(poses[:, 3:]), poses[:, :3], 1.0
    return places


def quaternion(rotation: Array) -> Array:
    """The quaternion x, y, z, w of a rotation (3 × 3), w not below 0; by the largest eigenvector, so that a sum of rotations gives
    their mean."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    k = np.array(
        [
            [a - e - i, b + d, c + g, h - f],
            [b + d, e - a - i, f + h, c - g],
            [c + g, f + h, i - a - e, d - b],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    found = np.linalg.eigh(k)[1][:, -1]
    return np.asarray(found if found[3] >= 0.0 else -found)


def _slopes(times: Array, positions: Array) -> Array:
    """Derivatives at the times themselves: of the parabola through three neighbours."""
    if len(times) < 3:
        steps = np.diff(positions, axis=0) / np.diff(times)[:, None] if len(times) == 2 else np.zeros((1, positions.shape[1]))
        return np.repeat(steps, max(len(times), 1), axis=0)[: len(times)]
    return np.asarray(np.gradient(positions, times, axis=0))


def _count(dropped: Counter[str], why: str, number: int) -> None:
    if number:
        dropped[why] += number
