"""The rows of a table: where the robot stands still, or the times of the sensor's readings.

Everything is at the time of the joints; a sensor's stamps are moved by its offset first.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from .tracks import Array, Flags, JointTrack, SensorTrack, jumps, matrices, quaternion, tell_a_plane

WINDOW_S = 0.2
"""Over so long a speed is the slope of a line, seconds."""
LEAST_SPEED = 1e-3
"""No robot is asked to stand stiller, rad/s and m/s."""
NOISES = 5.0
"""Slower than so many deviations of the slope of a joint that stands: it stands."""
OUTLIER = 6.0
"""A reading that is off the median of its moment by more than so many deviations is left out."""
FAR = 5e-4
"""A row while moving may have its joints beside their readings by so much at most (standard deviation, rad and m)."""
NEAR = 5e-3
"""Postures that differ by less, rad and m in every joint, are one."""
CHUNK = 500
UNSTEADY = 6.0
"""A moment in which a sensor's readings scatter so many times as much as usual is left out."""


@dataclass
class Reading:
    """What one sensor read in one row: ``values`` in the form of its track, of so many readings, with the standard deviation of the
    mean of the first coordinates (m or px; NaN of a single reading)."""

    values: Array
    samples: int
    deviation: float
    turn: float = math.nan
    """The standard deviation of the mean of a pose's rotation, rad."""


@dataclass
class Row:
    """One row: ``start`` and ``end`` (s, clock of the joints), ``positions`` (n), their deviations, and readings by sensor."""

    start: float
    end: float
    positions: Array
    deviations: Array
    samples: int
    readings: dict[str, Reading] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    """What was left out of it, and why."""
    dropped: str = ""
    """Why it is not in the table."""


@dataclass
class Standing:
    """What standing means in a recording: speeds below ``speeds`` (n, rad/s or m/s), and the intervals in which all joints do."""

    speeds: Array
    intervals: list[tuple[float, float]]
    too_short: int


def standing(joints: JointTrack, least_s: float, speed: float | None = None) -> Standing:
    """Find where all joints stand for at least ``least_s`` seconds, by a speed that the noise of the joints themselves tells."""
    slopes, left = _lines(joints)
    count = joints.positions.shape[1]
    per_window = max(WINDOW_S / max(joints.interval_s, 1e-6), 3.0)
    # σ of the slope of a line through n readings σ apart from it, evenly over the window.
    factor = math.sqrt(12.0 / per_window) / WINDOW_S
    # Most of a recording may be movement, which no line follows: noise is that of its quarter with the least. What a quarter of all
    # deviations of so few readings are below, beside σ, is by Wilson and Hilferty's quantile of χ².
    freedom = max(per_window - 1.0, 1.0)
    below = max(1.0 - 2.0 / (9.0 * freedom) - 0.6745 * math.sqrt(2.0 / (9.0 * freedom)), 0.2) ** 1.5
    speeds = np.empty(count)
    for joint in range(count):
        noise = _quantile(left[:, joint], 0.25) / below
        speeds[joint] = max(LEAST_SPEED, NOISES * factor * noise, 1.6 * _tick(joints.positions[:, joint]) / WINDOW_S)
    if speed is not None:
        speeds[:] = speed
    still: Flags = np.all(np.abs(slopes) <= speeds, axis=1)
    # Noise reaches beyond that now and then: standing goes on where it is not far beyond.
    nearly: Flags = np.all(np.abs(slopes) <= 2.0 * speeds, axis=1)
    intervals: list[tuple[float, float]] = []
    too_short = 0
    for first, last in _runs(nearly, joints):
        inside = first + np.flatnonzero(still[first : last + 1])
        if not len(inside):
            continue
        first, last = int(inside[0]), int(inside[-1])
        start, end = float(joints.times[first]) + WINDOW_S / 2, float(joints.times[last]) - WINDOW_S / 2
        if end - start >= least_s:
            intervals.append((start, end))
        elif last > first:
            too_short += 1
    return Standing(speeds, intervals, too_short)


def still_rows(
    joints: JointTrack, sensors: list[SensorTrack], offsets: dict[str, tuple[float, float]], found: Standing
) -> list[Row]:
    """One row for every interval in which the robot stands, with what the sensors read meanwhile, averaged.

    ``offsets`` are seconds and their deviation by sensor. A reading that may have been taken before or after, by three
    deviations, is left out.
    """
    rows = []
    for start, end in found.intervals:
        inside = (joints.times >= start) & (joints.times <= end)
        here = joints.positions[inside]
        samples = len(here)
        deviations = here.std(axis=0, ddof=1) / math.sqrt(samples) if samples > 1 else np.full(here.shape[1], np.nan)
        unlike: list[str] = []
        row = Row(start, end, np.median(here, axis=0) if samples < 3 else _trimmed(here), deviations, samples)
        for sensor in sensors:
            seconds, deviation = offsets[sensor.name]
            times = sensor.times + seconds
            margin = 3.0 * deviation if math.isfinite(deviation) else 0.0
            chosen = (times >= start + margin) & (times <= end - margin)
            if chosen.any():
                reading = _average(sensor, chosen, row.notes)
                if sensor.points_m is not None and not tell_a_plane(np.array(sensor.points_m)[np.isfinite(reading.values[0::2])]):
                    unlike.append(f"{sensor.name}: other points of it are seen from one reading to the next")
                else:
                    row.readings[sensor.name] = reading
        row.notes += unlike
        if unlike and not row.readings:
            row.dropped = unlike[0]
        rows.append(row)
    _leave_out_unsteady(rows, sensors)
    vague = max((deviation for _, deviation in offsets.values()), default=0.0)
    for row in rows:
        if not row.readings and not row.dropped:
            row.dropped = "no sensor read anything while the robot stood"
            if vague > 0.05:
                row.dropped += f", as far as its clock is known (± {vague:.2f} s; --offset states it)"
    return rows


def moving_rows(
    joints: JointTrack, sensors: list[SensorTrack], offsets: dict[str, tuple[float, float]], every_s: float
) -> list[Row]:
    """One row for every ``every_s`` seconds: the reading at which the joints are slowest, with the joints interpolated at its time.

    A joint's deviation is its speed times how well the time is known; where it is above ``FAR`` the row is left out, and where the
    posture is that of the row before, too. Readings of several sensors that are nearer to each other than a
    hundredth of a second are one row.
    """
    rows: list[Row] = []
    for sensor in sensors:
        seconds, deviation = offsets[sensor.name]
        times = sensor.times + seconds
        positions, speeds = joints.at(times)
        odd = jumps(sensor)
        known: Flags = np.all(np.isfinite(positions), axis=1)
        fastest = np.where(known & ~odd, np.abs(speeds).max(axis=1), np.inf)
        bins = np.floor((times - times[0]) / every_s).astype(int)
        before: Array | None = None
        for number in np.unique(bins):
            here = np.flatnonzero(bins == number)
            index = int(here[np.argmin(fastest[here])])
            time = float(times[index])
            row = Row(time, time, positions[index], np.abs(speeds[index]) * deviation, 1)
            if not known[index]:
                row.dropped = "no joint readings near it"
            elif odd[index]:
                row.dropped = "the reading jumps away from those before and after it"
            elif row.deviations.max() > FAR:
                row.dropped = "the joints move too fast for how well its time is known"
            elif before is not None and np.abs(row.positions - before).max() < NEAR:
                row.dropped = "the posture is that of the row before"
            else:
                before = row.positions
            row.readings[sensor.name] = Reading(sensor.values[index], 1, math.nan)
            rows.append(row)
    rows.sort(key=lambda row: row.start)
    merged: list[Row] = []
    for row in rows:
        last = merged[-1] if merged else None
        if last and row.start - last.start < 0.01 and not set(row.readings) & set(last.readings) and last.dropped == row.dropped:
            last.readings.update(row.readings)
        else:
            merged.append(row)
    return merged


def _average(sensor: SensorTrack, chosen: Flags, notes: list[str]) -> Reading:
    """The mean of the chosen readings, without those that are far from their median; of a point over those that show it."""
    values = sensor.values[chosen]
    places = values[:, :3] if sensor.kind == "pose" else values
    if len(places) >= 4:
        with warnings.catch_warnings():
            # A point that none of them shows is NaN, and stays so.
            warnings.simplefilter("ignore", RuntimeWarning)
            off = np.sqrt(np.nanmean((places - np.nanmedian(places, axis=0)) ** 2, axis=1))
        usual = max(float(np.median(off)), 1e-9)
        keep = off <= OUTLIER * usual
        if not keep.all():
            notes.append(f"{int((~keep).sum())} of {len(keep)} readings of {sensor.name} are far from the others")
        values, places = values[keep], places[keep]
    count, known = len(values), np.isfinite(values)
    # A point that few of them show is left out: it would be a mean of others than the rest.
    known &= 2 * known.sum(axis=0) > count
    mean = np.where(known.any(axis=0), np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1), np.nan)
    turn = math.nan
    if sensor.kind == "pose":
        turned = matrices(values[:, 3:])
        mean[3:] = quaternion(turned.mean(axis=0))
        if count > 1:
            # ‖R − R̄‖² is twice the squared angle between them, where that is small.
            squares = ((turned - matrices(mean[None, 3:])) ** 2).sum(axis=(1, 2)) / 2.0
            turn = math.sqrt(float(squares.sum()) / (count - 1) / 3.0 / count)
        known = known[:, :3]
    deviation = math.nan
    if count > 1:
        # Of the columns that two readings have, at least.
        of, shared = known.sum(axis=0), known.sum(axis=0) > 1
        apart = np.where(known, places - np.where(known, places, 0.0).sum(axis=0) / np.maximum(of, 1), 0.0)
        if shared.any():
            deviation = math.sqrt(float(((apart[:, shared] ** 2).sum(axis=0) / (of[shared] - 1) / of[shared]).mean()))
    return Reading(mean, count, deviation, turn)


def _leave_out_unsteady(rows: list[Row], sensors: list[SensorTrack]) -> None:
    """Take away readings that scatter far more than usual: whatever carries the target or the sensor moved while the joints stood."""
    for sensor in sensors:
        scatter = {
            index: reading.deviation * math.sqrt(reading.samples)
            for index, row in enumerate(rows)
            if (reading := row.readings.get(sensor.name)) and reading.samples > 2 and math.isfinite(reading.deviation)
        }
        if len(scatter) < 4:
            continue
        usual = float(np.median(list(scatter.values())))
        for index, size in scatter.items():
            if size > UNSTEADY * usual:
                del rows[index].readings[sensor.name]
                why = f"{sensor.name} moved while the joints stood: its readings scatter {size / usual:.0f} times as much as usual"
                rows[index].notes.append(why)
                if not rows[index].readings:
                    rows[index].dropped = why


def tally(rows: list[Row]) -> Counter[str]:
    """Rows that are not in the table, by reason."""
    return Counter(row.dropped.split(":")[0] for row in rows if row.dropped)


def _lines(joints: JointTrack) -> tuple[Array, Array]:
    """Slopes of lines through the readings within a window around each time, and the deviations from these lines (N × n)."""
    times, positions = joints.times, joints.positions
    number = np.arange(len(times))
    # At least a reading to each side.
    first = np.minimum(np.searchsorted(times, times - WINDOW_S / 2 - 1e-9), np.maximum(number - 1, 0))
    last = np.maximum(np.searchsorted(times, times + WINDOW_S / 2 + 1e-9), np.minimum(number + 2, len(times)))
    slope, left = np.zeros_like(positions), np.zeros_like(positions)
    # Sums of a short part at a time, so that they are differences of numbers that are not large.
    for start in range(0, len(times), CHUNK):
        here = slice(start, min(start + CHUNK, len(times)))
        part = slice(int(first[here].min()), int(last[here].max()))
        low, high = first[here] - part.start, last[here] - part.start
        t = (times[part] - times[start])[:, None]
        q = positions[part] - positions[start]

        def sums(values: Array, low: Array = low, high: Array = high) -> Array:
            total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
            return np.asarray(total[high] - total[low])

        count = (high - low)[:, None].astype(float)
        mean_t, mean_q = sums(t) / count, sums(q) / count
        spread = np.maximum(sums(t * t) - count * mean_t**2, 1e-12)
        slope[here] = (sums(t * q) - count * mean_t * mean_q) / spread
        around = sums(q * q) - count * mean_q**2 - slope[here] ** 2 * spread
        left[here] = np.sqrt(np.maximum(around, 0.0) / np.maximum(count - 2.0, 1.0))
    return slope, left


def _runs(still: Flags, joints: JointTrack) -> list[tuple[int, int]]:
    """First and last index of every stretch in which the joints stand, cut where readings are missing."""
    runs: list[tuple[int, int]] = []
    first: int | None = None
    for index in range(len(still)):
        gap = index > 0 and joints.times[index] - joints.times[index - 1] > joints.gap_s
        if first is not None and (gap or not still[index]):
            runs.append((first, index - 1))
            first = None
        if first is None and still[index]:
            first = index
    if first is not None:
        runs.append((first, len(still) - 1))
    return runs


def _tick(column: Array) -> float:
    """The step of an encoder whose readings repeat themselves; 0 where they do not."""
    values = np.unique(column)
    if len(values) < 3 or len(values) > len(column) / 2:
        return 0.0
    return _quantile(np.diff(values), 0.05)


def _trimmed(values: Array) -> Array:
    """The mean of what is not far from the median, column by column."""
    middle = np.median(values, axis=0)
    off = np.abs(values - middle)
    keep = off <= OUTLIER * np.maximum(np.median(off, axis=0), 1e-9)
    return np.asarray((values * keep).sum(axis=0) / keep.sum(axis=0))


def _quantile(values: Array, share: float) -> float:
    return float(np.quantile(values, share)) if len(values) else 0.0
