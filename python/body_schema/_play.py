"""Play of joints, from postures that were approached from both sides."""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ._errors import Error
from ._words import Asking


@dataclass(frozen=True)
class Stop:
    """A posture in which a robot stood: its number, from which side each joint came (1 from above, -1 from below, 0 from neither), what the joints read
    (rad, m), and what was seen, by channel."""

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
    out where fewer than two postures tell, or readings do not depend on them. Needs numpy.
    """
    pairs = _pairs(stops)
    names = session.joints
    if len(pairs) < 2:
        return {}, len(pairs)
    try:
        np: Any = importlib.import_module("numpy")
    except ImportError:
        raise Error("play needs numpy, which is missing; pip install numpy") from None
    blocks: list[tuple[str, Any, Any]] = []
    for above, below in pairs:
        moved = [{**above.reading, name: above.reading[name] + by} for name in names for by in (STEP, -STEP)]
        predicted = session.predict_readings([dict(above.reading), dict(below.reading), *moved])
        turned = np.array([above.sides.get(name, 0) - below.sides.get(name, 0) for name in names], float)
        for channel in set(above.seen) & set(below.seen):
            read, other = _flat(above.seen[channel]), _flat(below.seen[channel])
            its = [_flat(it.get(channel)) for it in predicted]
            if not read or any(len(it) != len(read) for it in (other, *its)):
                continue
            left = (np.array(read) - its[0]) - (np.array(other) - its[1])
            slopes = np.column_stack([(np.array(its[2 + 2 * k]) - its[3 + 2 * k]) / (2 * STEP) for k in range(len(names))])
            whole = np.isfinite(left) & np.isfinite(slopes).all(axis=1)
            blocks.append((channel, left[whole], slopes[whole] * turned))
    if not blocks:
        return {}, len(pairs)
    scales = dict.fromkeys((channel for channel, _, _ in blocks), 1.0)
    found = np.zeros(len(names))
    for _ in range(3):
        white = np.concatenate([left / scales[channel] for channel, left, _ in blocks])
        columns = np.concatenate([slope / scales[channel] for channel, _, slope in blocks])
        size = np.linalg.norm(columns, axis=0)
        tells = size > 1e-9 * max(float(size.max()), 1e-300)
        inverse = np.zeros((len(names), len(white)))
        inverse[tells] = np.linalg.pinv(columns[:, tells] / size[tells], rcond=1e-6) / size[tells, None]
        found = inverse @ white
        for channel in scales:
            rest = np.concatenate([left - slope @ found for it, left, slope in blocks if it == channel])
            scales[channel] = max(float(np.sqrt(np.mean(rest**2))), 1e-12)
    scores, start = np.zeros(len(names)), 0
    for channel, left, slope in blocks:
        part = inverse[:, start : start + len(left)] @ ((left - slope @ found) / scales[channel])
        scores += part**2
        start += len(left)
    freedom = start / max(start - int(tells.sum()), 1)
    return {
        name: HalfPlay(float(found[k]), math.sqrt(float(scores[k]) * freedom)) for k, name in enumerate(names) if tells[k] and start > tells.sum()
    }, len(pairs)


STEP = 1e-4
"""Of differences, rad and m."""


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
    """A reading as numbers, NaN of what is not seen. Of a pose its place alone counts."""
    if reading is None:
        return []
    if isinstance(reading, Mapping):
        return _flat(reading.get("position"))
    if isinstance(reading, (int, float)):
        return [float(reading)]
    flat: list[float] = []
    for it in reading:
        flat += [math.nan, math.nan] if it is None else _flat(it) if not isinstance(it, (int, float)) else [float(it)]
    return flat
