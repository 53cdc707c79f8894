"""Scenarios that run by themselves."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from os import PathLike, fspath

from . import _engine
from .answers import Comparison, Simulation


def simulate(
    scenario: str | PathLike[str], *, seed: int = 1, steps: int | None = None, learners: Sequence[str] | None = None
) -> Simulation:
    """Run a scenario once: a built-in one by its name, or one of a file that ends with ``.toml``.

    Gives ``{"result": {…}, "curve": […]}``: what ``body-schema run --json`` writes, and one flat row of metrics per learner and
    step, as ``pandas.DataFrame(simulate("arm-6dof")["curve"])`` takes them. Lengths end with ``_m``, angles with ``_deg``.
    """
    names = None if learners is None else list(learners)
    answer: Simulation = json.loads(_engine.simulate(fspath(scenario), seed, steps, names))
    return answer


def compare(
    scenario: str | PathLike[str],
    seeds: Iterable[int] = range(1, 21),
    *,
    steps: int | None = None,
    learners: Sequence[str] | None = None,
) -> Comparison:
    """Run a scenario over many seeds, on all cores.

    Gives what ``body-schema compare --json`` writes: by learner its ``runs``, its ``summary`` and its ``curve``, each of them
    rows of numbers.
    """
    names = None if learners is None else list(learners)
    answer: Comparison = json.loads(_engine.compare(fspath(scenario), [int(seed) for seed in seeds], steps, names))
    return answer
