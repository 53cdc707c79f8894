"""Frozen splits: which rows are to be learned from, in which random order, and which are held out.

A split is made by sorting: row r of set S in split k has the key sha256("1/S/k/r"). So it depends on no library and no version,
and what is frozen is a hash of them all, in splits.json, that a run compares before it begins.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from .sets import Rows, Set, SetError, simulate

SEED = 1
FROZEN = 50
HELD_OUT = 0.3
# Rows of one posture, to this many rad or m, are never on both sides.
REPEATS = 1e-4
BUDGETS = (8, 10, 12, 20, 40)
FILE = Path(__file__).resolve().parent.parent / "splits.json"


@dataclass
class Split:
    """Rows to learn from in random order, and rows that are held out."""

    set: str
    number: int
    pool: Rows
    held_out: Rows
    budgets: list[int]
    # As they are frozen.
    digest: str


def _key(*parts: object) -> str:
    return hashlib.sha256("/".join(str(part) for part in (SEED, *parts)).encode()).hexdigest()


def groups_of(postures: np.ndarray) -> list[list[int]]:
    """Rows by posture, in order of their first rows."""
    groups: dict[int, list[int]] = {}
    for row, posture in enumerate(postures):
        first = int(np.argmax(np.abs(postures - posture).max(1) <= REPEATS))
        groups.setdefault(first, []).append(row)
    return list(groups.values())


def rows_of(of: Set, number: int) -> tuple[list[int], list[int]]:
    """The rows to learn from, in random order, and those that are held out."""
    rows = range(len(of.rows.postures))
    order = lambda chosen: sorted(chosen, key=lambda row: _key(of.name, number, row))
    if of.sockets:
        places = [of.rows.readings[row][0].rsplit("/", 1)[0] for row in rows]
        place = min(set(places), key=lambda place: _key(of.name, number, "place", place))
        there = order(row for row in rows if places[row] == place)
        return there[: round((1 - HELD_OUT / 2) * len(there))], [row for row in rows if places[row] != place]
    groups = sorted(groups_of(of.rows.postures), key=lambda group: _key(of.name, number, "group", group[0]))
    wanted, held_out = round(HELD_OUT * len(rows)), []
    while len(held_out) < wanted:
        held_out += groups.pop()
    return order(row for group in groups for row in group), sorted(held_out)


def picked(of: Set, rows: list[int]) -> Rows:
    """These rows of a set."""
    return Rows(of.rows.postures[rows], [of.rows.readings[row] for row in rows])


@lru_cache(maxsize=None)
def split(of: Set, number: int) -> Split:
    """Split ``number`` of a set."""
    if of.simulated:
        pool, held_out = simulate(of, number)
        text = np.concatenate([pool.postures, held_out.postures]).round(9).tolist()
    else:
        learn, judge = rows_of(of, number)
        text = [learn, judge]
        pool, held_out = picked(of, learn), picked(of, judge)
    count = len(pool.postures)
    budgets = [budget for budget in BUDGETS if budget < count] + [count]
    return Split(of.name, number, pool, held_out, budgets, hashlib.sha256(json.dumps(text).encode()).hexdigest())


def digest(of: Set) -> str:
    """One hash of all frozen splits of a set."""
    return hashlib.sha256("".join(split(of, number).digest for number in range(FROZEN)).encode()).hexdigest()


def check(sets: list[Set], freeze: bool = False) -> None:
    """Compares the splits with the frozen ones; ``freeze`` writes them for sets that have none yet."""
    frozen = json.loads(FILE.read_text()) if FILE.exists() else {}
    for of in sets:
        found = digest(of)
        if of.name not in frozen and freeze:
            frozen[of.name] = found
        if of.name in frozen and frozen[of.name] != found:
            raise SetError(f"{of.name}: its splits are not the frozen ones (splits.json); results would not compare: look what has changed")
    if freeze:
        FILE.write_text(json.dumps(frozen, indent=1, sort_keys=True) + "\n")
