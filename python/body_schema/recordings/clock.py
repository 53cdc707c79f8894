"""By how much the clock of a sensor is behind that of the joints.

Offset δ: a reading stamped s belongs to where the joints were at s + δ. It is found without knowing where sensor and target are,
nor whether the description is right: where a target is, y, is linear in functions Φ of the joints, and so are differences,

    y(s′) − y(s) = B [Φ(q(s′ + δ)) − Φ(q(s + δ))],

with an unknown matrix B. Φ holds the hand as described, seen from the base and the base seen from the hand, and sines and cosines of
all joints with their products, which take up what the description has wrong. For every δ, B is fitted by least squares (with a small
ridge), and the share of ‖y(s′) − y(s)‖² that it predicts in parts of the recording it was not fitted to is what δ is judged by.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .._urdf import Joint
from .chain import Description
from .tracks import Array, Indices, JointTrack, SensorTrack, jumps, usual_interval

APART_S = 0.3
"""How far apart the two readings of a difference are, or as far as neighbours are, seconds: long beside noise, short beside movements."""
LONGER_S = (1.5, 4.0)
"""Further apart, where the readings do not move within that."""
STILL = "the sensor's readings hardly move"
STEP_S = 0.05
"""Steps in which offsets are tried first, seconds: a part of the time in which a movement begins."""
FINE_S = 0.01
"""Steps around the best of them, through which a parabola is laid, seconds."""
BLOCKS, FOLDS = 20, 5
"""The parts of a recording that are drawn anew for the deviation, and the folds of these parts."""
DRAWS = 200
MOST_ROWS = 3000
"""More differences than so many are thinned out evenly."""
LEAST_ROWS = 20
RIDGE = 1e-4
"""Beside the mean square of a feature."""
LEAST_DRIFT_S = 0.005
"""A clock that drifts by less is not told."""
LEAST_EXPLAINED, LEAST_OF_LONGER = 0.5, 0.9
"""The least share of the sensor's motion that the joints must explain, of short differences and of the few that are longer."""
SURE = 3.0
"""By how many standard errors another offset must be worse, or it is a rival."""


@dataclass
class Offset:
    """What is known of a sensor's clock.

    ``seconds`` is added to its stamps, and has the standard deviation ``deviation_s``; both are NaN where it cannot be told, and
    ``why`` says why. ``explained`` is the share of the sensor's motion that the joints explain. ``rivals`` are other offsets that
    fit as well, in seconds. ``on_hand``: the sensor moves with the hand, and the target stands.
    """

    seconds: float = math.nan
    deviation_s: float = math.nan
    explained: float = math.nan
    rivals: list[float] = field(default_factory=list)
    why: str = ""
    on_hand: bool = False
    rows: int = 0
    quarters_s: list[float] = field(default_factory=list)
    """The offset in each quarter of the recording, where these differ by more than chance; that is in the deviation."""

    @property
    def told(self) -> bool:
        """Whether there is one offset that fits best."""
        return math.isfinite(self.seconds) and not self.why


Features = Callable[[Array], Array]


def estimate(joints: JointTrack, sensor: SensorTrack, description: Description, chain: list[Joint], most_s: float) -> Offset:
    """The offset of a sensor's clock, looked for within ± ``most_s`` seconds. What cannot be told is said, and raises nothing."""
    found = Offset()
    for apart in (APART_S, *LONGER_S):
        # Where readings were taken only while the robot stood, those of one posture and the next tell.
        found = _estimate(joints, sensor, description, chain, most_s, apart)
        if math.isfinite(found.seconds) or math.isnan(found.explained) and found.why != STILL:
            break
    return found


def _estimate(
    joints: JointTrack, sensor: SensorTrack, description: Description, chain: list[Joint], most_s: float, apart: float
) -> Offset:
    """The same, by readings that are about ``apart`` seconds apart."""
    rough, pairs = _Pairs(joints, sensor, MOST_ROWS // 3, apart), _Pairs(joints, sensor, MOST_ROWS, apart)
    if why := pairs.refusal:
        return Offset(why=why, rows=pairs.count)

    def hand(positions: Array) -> Array:
        return _seen_from_base(description, chain, positions)

    def base(positions: Array) -> Array:
        return _seen_from_hand(description, chain, positions)

    def squares(seen: Features) -> Features:
        return lambda positions: _squares(seen(positions))

    def both(positions: Array) -> Array:
        turned, place = description.hand(chain, positions)
        return np.hstack([place, turned.reshape(-1, 9), _back(turned, place)])

    simple: list[Features] = [both, _turns]
    coarse = np.arange(-math.floor(most_s / STEP_S), math.floor(most_s / STEP_S) + 1) * STEP_S
    scores = np.array([rough.score(simple, lag) for lag in coarse])
    if not np.isfinite(scores).any():
        return Offset(why="joints and sensor were never recorded at the same time, by their stamps", rows=pairs.count)
    candidates = [float(coarse[index]) for index in _peaks(scores)]
    # Features by what predicts best what they were not fitted to, at the best of the first look.
    kinds: list[list[Features]] = [[hand], [base], simple, [*simple, _products]]
    if sensor.kind == "pixels":
        kinds += [[hand, squares(hand)], [base, squares(base)]]
    kind = max(kinds, key=lambda it: pairs.score(it, candidates[0]))
    refined: list[tuple[float, float]] = []
    for candidate in candidates[:6]:
        lag = _climb(lambda it: pairs.score(kind, it), candidate)
        if all(abs(lag - other) > 2 * STEP_S for _, other in refined):
            refined.append((pairs.score(kind, lag), lag))
    refined.sort(reverse=True)
    explained, best = refined[0]
    found = Offset(explained=explained, rows=pairs.count)
    if explained < (LEAST_EXPLAINED if apart <= APART_S else LEAST_OF_LONGER):
        found.why = f"at no offset within ± {most_s:g} s do the joints explain how the sensor's readings move (at most {explained:.0%})"
        return found
    if abs(best) > most_s - 2 * STEP_S:
        found.why = f"the best offset is at the end of the search, ± {most_s:g} s: search further with --max-offset"
        return found
    at_best = pairs.errors(kind, best)
    found.rivals = [lag for share, lag in refined[1:] if share > explained / 2 and not _worse(pairs.errors(kind, lag), at_best)]
    low, high = pairs.plateau(kind, best, at_best, most_s)
    found.seconds, found.deviation_s = pairs.bootstrap(kind, best)
    if high - low > 3.0 * STEP_S:
        # As where readings were taken in the middle of standing: anything between fits.
        found.seconds, found.deviation_s = (low + high) / 2.0, (high - low) / math.sqrt(12.0)
        found.rivals = [lag for lag in found.rivals if not low - STEP_S <= lag <= high + STEP_S]
    elif quarters := pairs.quarters(kind, found.seconds):
        drift = max(quarters) - min(quarters)
        if drift > max(LEAST_DRIFT_S, 9.0 * found.deviation_s):
            # A quarter is known half as well as the whole: that is no chance.
            found.quarters_s = quarters
            found.deviation_s = math.hypot(found.deviation_s, drift / math.sqrt(12.0))
    found.on_hand = max(pairs.score([base], best), pairs.score([base, squares(base)], best)) > max(
        pairs.score([hand], best), pairs.score([hand, squares(hand)], best)
    )
    found.rivals = [lag for lag in found.rivals if not abs(lag - found.seconds) < 5.0 * found.deviation_s]
    if found.rivals:
        others = ", ".join(f"{lag:+.2f}" for lag in found.rivals)
        found.why = f"{found.seconds:+.3f} s fits best, but {others} s as well: the movements repeat themselves"
    return found


class _Pairs:
    """Differences of readings, and how well differences of features predict them."""

    def __init__(self, joints: JointTrack, sensor: SensorTrack, most: int, apart: float) -> None:
        self.joints = joints
        known = ~jumps(sensor)
        times, values = sensor.times[known], _scaled(sensor)[known]
        self.refusal = ""
        self.count = 0
        if len(times) < LEAST_ROWS:
            self.refusal = f"{len(times)} readings are too few to tell by"
            return
        interval = usual_interval(times)
        apart = max(apart, interval)
        first = np.arange(len(times))
        second = np.clip(np.searchsorted(times, times + apart - interval / 2), 0, len(times) - 1)
        steps = times[second] - times[first]
        usable = (second > first) & (steps > 0.2 * apart) & (steps < 4.0 * apart)
        first, second = first[usable], second[usable]
        if len(first) > most:
            chosen = np.linspace(0, len(first) - 1, most).round().astype(int)
            first, second = first[chosen], second[chosen]
        self.count = len(first)
        if self.count < LEAST_ROWS:
            self.refusal = f"{self.count} differences of readings are too few to tell by"
            return
        self.start, self.end = times[first], times[second]
        self.moved = values[second] - values[first]
        sizes = np.linalg.norm(self.moved, axis=1)
        self.weights = np.ones(self.count)
        self.blocks = np.arange(self.count) * BLOCKS // self.count
        # Readings that are far apart tell nothing of noise.
        noise = _noise(values) if interval < APART_S / 2 else 0.0
        if float(np.quantile(sizes, 0.95)) < 6.0 * noise:
            self.refusal = STILL
        elif not _moves(joints):
            self.refusal = "the joints hardly move"

    def rows(self, kind: list[Features], lag: float) -> tuple[Array, Array, Array, Indices]:
        """Differences of features and of readings, with weights and blocks, where the joints are known."""
        start, _ = self.joints.at(self.start + lag)
        end, _ = self.joints.at(self.end + lag)
        known = np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1)
        if known.sum() < max(LEAST_ROWS, 0.3 * self.count):
            empty = np.zeros((0, 1))
            return empty, empty, np.zeros(0), np.zeros(0, dtype=int)
        both = np.vstack([start[known], end[known]])
        features = np.hstack([feature(both) for feature in kind])
        half = len(features) // 2
        return features[half:] - features[:half], self.moved[known], self.weights[known], self.blocks[known]

    def grams(self, kind: list[Features], lag: float) -> tuple[Array, Array, Array] | None:
        """XᵀWX, XᵀWY and tr(YᵀWY) of every block; none where too little is known."""
        x, y, weights, blocks = self.rows(kind, lag)
        if not len(x):
            return None
        xx = np.zeros((BLOCKS, x.shape[1], x.shape[1]))
        xy = np.zeros((BLOCKS, x.shape[1], y.shape[1]))
        yy = np.zeros(BLOCKS)
        for block in np.unique(blocks):
            here = blocks == block
            weighted = x[here] * weights[here, None]
            xx[block], xy[block] = weighted.T @ x[here], weighted.T @ y[here]
            yy[block] = float((weights[here, None] * y[here] ** 2).sum())
        return xx, xy, yy

    def errors(self, kind: list[Features], lag: float) -> Array:
        """Squared errors block by block, each by a fit to the other folds, as shares of all that moved; NaN where nothing is known."""
        grams = self.grams(kind, lag)
        if grams is None:
            return np.full(BLOCKS, np.nan)
        xx, xy, yy = grams
        errors = np.full(BLOCKS, np.nan)
        # A fold is one stretch of time, so that no movement is in two.
        folds = np.arange(BLOCKS) * FOLDS // BLOCKS
        for fold in range(FOLDS):
            fitted = _solve(xx[folds != fold].sum(axis=0), xy[folds != fold].sum(axis=0))
            for block in np.flatnonzero(folds == fold):
                if yy[block] > 0.0:
                    errors[block] = yy[block] - 2.0 * (fitted * xy[block]).sum() + (fitted * (xx[block] @ fitted)).sum()
        return errors / max(float(yy.sum()), 1e-300)

    def score(self, kind: list[Features], lag: float) -> float:
        """The share of the sensor's motion that is explained, in what was not fitted; −∞ where nothing is known."""
        errors = self.errors(kind, lag)
        return 1.0 - float(np.nansum(errors)) if np.isfinite(errors).any() else -math.inf

    def weigh(self, kind: list[Features], lag: float) -> None:
        """Weights by what is left of every difference beside how far it reaches (Cauchy's), so that wrong detections hardly count."""
        x, y, _, _ = self.rows(kind, lag)
        weights = np.ones(len(x))
        reach = 0.05 * np.linalg.norm(y, axis=1)
        for _ in range(5):
            fitted = _solve((x * weights[:, None]).T @ x, (x * weights[:, None]).T @ y)
            left = np.linalg.norm(y - x @ fitted, axis=1)
            weights = 1.0 / (1.0 + (left / (reach + max(3.0 * float(np.median(left)), 1e-12))) ** 2)
        start, _ = self.joints.at(self.start + lag)
        end, _ = self.joints.at(self.end + lag)
        known = np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1)
        self.weights = np.full(self.count, float(np.median(weights)))
        self.weights[known] = weights

    def around(self, kind: list[Features], lag: float, step: float) -> tuple[Array, list[tuple[Array, Array, Array]]] | None:
        """Offsets around one, and the sums of every block at each; none where joints are not known at all of them."""
        lags: Array = lag + step * np.arange(-4.0, 5.0)
        grams = [it for it in (self.grams(kind, lag) for lag in lags) if it is not None]
        return (lags, grams) if len(grams) == len(lags) else None

    def bootstrap(self, kind: list[Features], best: float) -> tuple[float, float]:
        """The offset at the top of a parabola, and its standard deviation over recordings drawn of the blocks of this one."""
        step, top = FINE_S, best
        while True:
            for _ in range(5):
                # Weights are those of an offset, and draw towards it: again at the new one.
                self.weigh(kind, top)
                near = self.around(kind, top, step)
                if near is None:
                    return top, math.nan
                lags, grams = near
                before, top = top, _vertex(lags, np.array([_left(*it, np.ones(BLOCKS)) for it in grams]))
                if abs(top - before) < step / 20:
                    break
            random = np.random.default_rng(1)
            tops = []
            for _ in range(DRAWS):
                drawn = np.bincount(random.integers(0, BLOCKS, BLOCKS), minlength=BLOCKS).astype(float)
                tops.append(_vertex(lags, np.array([_left(*it, drawn) for it in grams])))
            deviation = float(np.std(tops))
            if deviation < step or step > 0.08:
                return float(top), deviation
            # As far as the parabola reached, anything may be the top: further apart.
            step *= 3.0


    def quarters(self, kind: list[Features], lag: float) -> list[float]:
        """The offset in each quarter of the recording, by one fit to all of it; s."""
        near = self.around(kind, lag, 3.0 * FINE_S)
        if near is None:
            return []
        lags, grams = near
        fits = [_solve(xx.sum(axis=0), xy.sum(axis=0)) for xx, xy, _ in grams]
        tops = []
        for part in range(4):
            here = np.arange(BLOCKS) * 4 // BLOCKS == part
            errors = []
            for (xx, xy, yy), fitted in zip(grams, fits):
                fit = (fitted * (xx[here].sum(axis=0) @ fitted)).sum() - 2.0 * (fitted * xy[here].sum(axis=0)).sum()
                errors.append(float(yy[here].sum() + fit))
            tops.append(_vertex(lags, np.array(errors)))
        return tops

    def plateau(self, kind: list[Features], best: float, at_best: Array, most_s: float) -> tuple[float, float]:
        """How far to both sides offsets fit about as well, s: with errors that are above the least ones by no more than chance.

        A sum of n squares of noise has the deviation √(2/n) of itself; a tenth is allowed in any case.
        """
        ends, most = [], (1.0 + max(0.1, 3.0 * math.sqrt(2.0 / self.moved.size))) * float(np.nansum(at_best))
        for sign in (-1.0, 1.0):
            lag = best
            while abs(lag) < most_s and 1.0 - self.score(kind, lag + sign * STEP_S / 2) <= most:
                lag += sign * STEP_S / 2
            ends.append(lag)
        return ends[0], ends[1]


def _worse(errors: Array, than: Array) -> bool:
    """Whether errors are larger by more than chance, block by block."""
    more = errors - than
    more = more[np.isfinite(more)]
    if len(more) < 2:
        return True
    return bool(more.sum() >= SURE * more.std(ddof=1) * math.sqrt(len(more)))


def _left(xx: Array, xy: Array, yy: Array, counts: Array) -> float:
    """What a fit to blocks, each counted so often, leaves, as a share."""
    cross = np.tensordot(counts, xy, 1)
    fitted = _solve(np.tensordot(counts, xx, 1), cross)
    total = float(counts @ yy)
    return (total - float((fitted * cross).sum())) / max(total, 1e-300)


def _solve(xx: Array, xy: Array) -> Array:
    diagonal = np.diag(xx)
    scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-12 * max(float(diagonal.max(initial=0.0)), 1e-300)))
    normal = xx * scale[:, None] * scale[None, :] + RIDGE * np.eye(len(xx))
    return np.asarray(scale[:, None] * np.linalg.solve(normal, scale[:, None] * xy))


def _vertex(lags: Array, errors: Array) -> float:
    """Where a parabola through the errors nearest to the least one is lowest; within the lags."""
    least = int(np.clip(np.argmin(errors), 2, len(lags) - 3))
    near = slice(least - 2, least + 3)
    curve, slope, _ = np.polyfit(lags[near] - lags[least], errors[near], 2)
    if curve <= 0.0:
        return float(lags[int(np.argmin(errors))])
    return float(np.clip(lags[least] - slope / (2.0 * curve), lags[0], lags[-1]))


def _climb(score: Callable[[float], float], start: float) -> float:
    """The best lag near one of the first look, in fine steps."""
    step, at, value = STEP_S / 2, start, score(start)
    while step > FINE_S / 2:
        for other in (at - step, at + step):
            if (there := score(other)) > value:
                at, value = other, there
                break
        else:
            step /= 2
    return at


def _peaks(scores: Array) -> list[int]:
    """Local maxima, best first."""
    padded = np.concatenate([[-math.inf], np.where(np.isfinite(scores), scores, -math.inf), [-math.inf]])
    tops = np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:]))
    return sorted((int(top) for top in tops), key=lambda top: -padded[top + 1])


def _scaled(sensor: SensorTrack) -> Array:
    """Readings in which places and rotations of a pose count about equally."""
    values = sensor.linear()
    if sensor.kind != "pose" or len(values) < 2:
        return values
    spread = [float(np.linalg.norm(np.diff(part, axis=0), axis=1).mean()) for part in (values[:, :3], values[:, 3:])]
    return np.hstack([values[:, :3], values[:, 3:] * min(spread[0] / max(spread[1], 1e-12), 1e3)])


def _noise(values: Array) -> float:
    """The norm of what neighbours differ by beyond a straight line, robustly: that of noise where a robot stands."""
    if len(values) < 3:
        return 0.0
    bend = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return float(np.quantile(np.linalg.norm(bend, axis=1), 0.25)) / math.sqrt(6.0)


def _moves(joints: JointTrack) -> bool:
    """Whether any joint changes by more than its noise, and by more than a thousandth (rad, m)."""
    for column in joints.positions.T:
        span = float(np.quantile(column, 0.98) - np.quantile(column, 0.02))
        bends = np.abs(column[2:] - 2.0 * column[1:-1] + column[:-2])
        if span > max(1e-3, 6.0 * float(np.quantile(bends, 0.25))):
            return True
    return False


def _seen_from_base(description: Description, chain: list[Joint], positions: Array) -> Array:
    turned, place = description.hand(chain, positions)
    return np.hstack([place, turned.reshape(-1, 9)])


def _seen_from_hand(description: Description, chain: list[Joint], positions: Array) -> Array:
    return _back(*description.hand(chain, positions))


def _back(turned: Array, place: Array) -> Array:
    """The base seen from the hand, but for the sign of its place."""
    back = np.swapaxes(turned, 1, 2)
    return np.hstack([np.einsum("nij,nj->ni", back, place), back.reshape(-1, 9)])


def _squares(features: Array) -> Array:
    """All products of two features: what perspective adds, nearly."""
    rows, columns = np.triu_indices(features.shape[1])
    return features[:, rows] * features[:, columns]


def _turns(positions: Array) -> Array:
    return np.hstack([positions, np.sin(positions), np.cos(positions)])


def _products(positions: Array) -> Array:
    """Sines and cosines of every joint, and their products for all pairs: what is smooth in the joints, nearly."""
    waves = np.stack([np.sin(positions), np.cos(positions)], axis=2)
    parts = [positions, waves.reshape(len(positions), -1)]
    count = positions.shape[1]
    for first in range(count):
        for second in range(first + 1, count):
            parts.append((waves[:, first, :, None] * waves[:, second, None, :]).reshape(len(positions), 4))
    return np.hstack(parts)


