"""What results of many splits say together: by set, task and contestant, and one contestant against the best of the others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

# Error relative to the best one at which a contestant is said to have arrived.
ARRIVED = 1.2
RESAMPLES = 2000


@dataclass
class Cell:
    """A contestant at a task of a set: means over its splits, and how many it failed in."""

    splits: int
    failed: int
    mean_mm: float | None
    median_mm: float | None
    p95_mm: float | None
    mean_deg: float | None
    coverage: float | None
    axes_deg: float | None
    axes_mm: float | None
    cpu_s: float | None
    peak_mb: float | None


@dataclass
class Comparison:
    """The default against the best of the others at a task: the ratio of mean errors, and its 95 % interval."""

    set: str
    task: str
    splits: int
    ours_mm: float
    other: str
    other_mm: float
    ratio: float
    low: float
    high: float


def task_order(task: str) -> int:
    return 10**9 if task == "all" else int(task)


def tasks_of(records: list[dict[str, Any]], set_name: str) -> list[str]:
    return sorted({r["task"] for r in records if r["set"] == set_name}, key=task_order)


def _mean(numbers: list[float | None]) -> float | None:
    there = [x for x in numbers if x is not None]
    return float(np.mean(there)) if there else None


def cell(records: list[dict[str, Any]]) -> Cell:
    """Summarises the records of one contestant at one task of one set."""
    scored = [r["scores"] for r in records if r["scores"]]
    of = lambda key: _mean([scores[key] for scores in scored])
    return Cell(
        len(records), len(records) - len(scored),
        *(of(key) for key in ("mean_mm", "median_mm", "p95_mm", "mean_deg", "coverage", "axes_deg", "axes_mm")),
        _mean([r["cpu_s"] for r in records]), _mean([r["peak_mb"] for r in records]),
    )


def by_split(records: list[dict[str, Any]]) -> dict[int, float]:
    return {r["split"]: r["scores"]["mean_mm"] for r in records if r["scores"]}


def ratio_interval(ours: np.ndarray, other: np.ndarray, seed: int = 1) -> tuple[float, float, float]:
    """The ratio of means over splits, and its 95 % interval by the paired bootstrap."""
    drawn = np.random.default_rng(seed).integers(0, len(ours), (RESAMPLES, len(ours)))
    ratios = ours[drawn].mean(1) / other[drawn].mean(1)
    low, high = np.quantile(ratios, [0.025, 0.975])
    return float(ours.mean() / other.mean()), float(low), float(high)


def compare(records: list[dict[str, Any]], set_name: str, task: str, default: str, others: list[str]) -> Comparison | None:
    """The default against that of the others whose mean error is least beside its own, on the splits of both.

    One that failed in any split is no rival there.
    """
    here = [r for r in records if r["set"] == set_name and r["task"] == task]
    ours = by_split([r for r in here if r["contestant"] == default])
    best: Comparison | None = None
    for name in others:
        mine = [r for r in here if r["contestant"] == name]
        common = sorted(ours.keys() & by_split(mine).keys())
        if len(common) < 2 or any(r["scores"] is None for r in mine):
            continue
        a, b = (np.array([of[k] for k in common]) for of in (ours, by_split(mine)))
        ratio, low, high = ratio_interval(a, b)
        if best is None or ratio > best.ratio:
            best = Comparison(set_name, task, len(common), float(a.mean()), name, float(b.mean()), ratio, low, high)
    return best


def rows_until(records: list[dict[str, Any]], set_name: str, contestant: str, best_mm: float) -> float | None:
    """The median over splits of the fewest rows with which the error is at most 1.2 times the best; ``None`` if most never arrive."""
    reached: dict[int, float] = {}
    for r in records:
        if r["set"] == set_name and r["contestant"] == contestant:
            arrived = r["scores"] and r["scores"]["mean_mm"] <= ARRIVED * best_mm
            reached[r["split"]] = min(reached.get(r["split"], np.inf), r["budget"] if arrived else np.inf)
    median = float(np.median(list(reached.values()))) if reached else np.inf
    return median if np.isfinite(median) else None
