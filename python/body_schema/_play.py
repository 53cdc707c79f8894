"""Play of joints, from postures that were approached from both sides."""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ._errors import Error
from ._words import Asking


STEP = 1e-4
"""Of differences, rad and m."""


@dataclass(frozen=True)
class Stop:
    """A posture in which a robot stood: its number, from which side each joint came (1 from above, -1 from below), what the joints read (rad, m), and
    what was seen, by channel."""

    posture: int
    sides: Mapping[str, int]
    reading: Mapping[str, float]
    seen: Mapping[str, Any]


@dataclass(frozen=True)
class HalfPlay:
    """How far a joint stands to either side of what it reads, rad or m, with its standard deviation: half of the play of its gears."""

    value: float
    sd: float


def half_play(session: Asking, stops: Sequence[Stop]) -> tuple[dict[str, HalfPlay], int]:
    """Half of the play by joint, and the number of postures that were seen from both sides.

    With y what a channel read, ŷ the session's prediction at what the joints read, J its derivative by the joints, and s the sides: between the two
    stops of a posture (y - ŷ)' - (y - ŷ) = J (s' - s) h, least squares for h over all postures and channels, each channel by the scatter of
    its own residuals. Errors of the robot's description cancel between the two. Deviations are those of the postures' scores (sandwich). Joints are left
    out of which fewer than two postures tell. Needs numpy.
    """
    pairs = _pairs(stops)
    names = session.joints
    if len(pairs) < 2:
        return {}, len(pairs)
    np = numpy()
    blocks: list[tuple[int, str, Any, Any]] = []
    for number, (above, below) in enumerate(pairs):
        moved = [{**above.reading, name: above.reading[name] + by} for name in names for by in (STEP, -STEP)]
        predicted = session.predict_readings([dict(above.reading), dict(below.reading), *moved])
        turned = np.array([above.sides[name] - below.sides[name] for name in names], float)
        for channel in set(above.seen) & set(below.seen):
            read, other = _flat(above.seen[channel]), _flat(below.seen[channel])
            its = [_flat(it.get(channel)) for it in predicted]
            if not read or any(len(it) != len(read) for it in (other, *its)):
                continue
            left = (np.array(read) - its[0]) - (np.array(other) - its[1])
            slopes = np.column_stack([(np.array(its[2 + 2 * k]) - its[3 + 2 * k]) / (2 * STEP) for k in range(len(names))])
            whole = np.isfinite(left) & np.isfinite(slopes).all(axis=1)
            blocks.append((number, channel, left[whole], slopes[whole] * turned))
    if not blocks:
        return {}, len(pairs)
    telling = np.zeros((len(pairs), len(names)), bool)
    for number, _, _, slope in blocks:
        telling[number] |= (np.abs(slope) > 1e-9).any(axis=0)
    scales = dict.fromkeys((channel for _, channel, _, _ in blocks), 1.0)
    for _ in range(3):
        white = np.concatenate([left / scales[channel] for _, channel, left, _ in blocks])
        columns = np.concatenate([slope / scales[channel] for _, channel, _, slope in blocks])
        size = np.linalg.norm(columns, axis=0)
        tells = size > 0
        if not tells.any() or len(white) <= tells.sum():
            return {}, len(pairs)
        inverse = np.zeros((len(names), len(white)))
        inverse[tells] = np.linalg.pinv(columns[:, tells] / size[tells], rcond=1e-6) / size[tells, None]
        found = inverse @ white
        for channel in scales:
            rest = np.concatenate([left - slope @ found for _, it, left, slope in blocks if it == channel])
            scales[channel] = max(float(np.sqrt(np.mean(rest**2))), 1e-12)
    scores, start = np.zeros((len(pairs), len(names))), 0
    for number, channel, left, slope in blocks:
        scores[number] += inverse[:, start : start + len(left)] @ ((left - slope @ found) / scales[channel])
        start += len(left)
    sds = np.sqrt((scores**2).sum(axis=0) * len(white) / (len(white) - tells.sum()))
    told = telling.sum(axis=0) >= 2
    return {name: HalfPlay(float(found[k]), float(sds[k])) for k, name in enumerate(names) if told[k]}, len(pairs)


def play_mm(session: Asking, stops: Sequence[Stop], half: Mapping[str, HalfPlay]) -> float | None:
    """By how much the play moves the hand, mm: √ mean Σ (‖∂p/∂q‖ h)² over the joints, of whose sides nothing is known, and the mean over the postures that
    were seen. ``None`` where no play is told."""
    seen = [stop.reading for stop in stops if stop.seen]
    if not half or not seen:
        return None
    total = 0.0
    for name, it in half.items():
        ends = [session.predict([{**reading, name: reading[name] + by} for reading in seen]) for by in (STEP, -STEP)]
        total += sum((math.dist(one, other) / (2 * STEP) * it.value) ** 2 for one, other in zip(*ends))
    return 1e3 * math.sqrt(total / len(seen))


def numpy() -> Any:
    """The module numpy. Raises ``Error`` where it is missing."""
    try:
        return importlib.import_module("numpy")
    except ImportError:
        raise Error("play needs numpy, which is missing; pip install numpy") from None


def _pairs(stops: Sequence[Stop]) -> list[tuple[Stop, Stop]]:
    """The stops of each posture that was seen from two sides."""
    by_posture: dict[int, Stop] = {}
    pairs = []
    for stop in stops:
        if not stop.seen:
            continue
        before = by_posture.setdefault(stop.posture, stop)
        if before is not stop:
            pairs.append((before, stop))
    return pairs


def _flat(reading: Any) -> list[float]:
    """A reading as numbers, NaN of a point that is not seen; none of sockets. Of a pose its place alone counts."""
    if hasattr(reading, "tolist"):
        reading = reading.tolist()
    if reading is None or isinstance(reading, str):
        return []
    if isinstance(reading, Mapping):
        return _flat(reading.get("position", next(iter(reading.values()), None)))
    if isinstance(reading, (int, float)):
        return [float(reading)]
    flat: list[float] = []
    for it in reading:
        flat += [math.nan, math.nan] if it is None else _flat(it)
    return flat
