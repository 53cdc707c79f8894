"""A robot cell that records a short bag each morning: an arm before a tracker, and a joint whose zero moves.

``python python/tests/mornings.py FOLDER`` writes ``FOLDER/first``, a bag to calibrate from, and twelve mornings in ``FOLDER/mornings``.
"""

from __future__ import annotations

import math
import sys
from datetime import date, timedelta
from pathlib import Path

from recorded import Arm, Run, bag

SEED, OFFSET_S = 1071, 0.4
FIRST_DAY, OFF_FROM, JOINT, OFF_DEG = date(2026, 6, 1), 8, "elbow_joint", 1.0
START_NS = 1_780_272_000_000_000_000
"""2026-06-01 at midnight, UTC."""
DAY_NS = 86_400_000_000_000


class Morning(Run):
    """A run whose joints read by so much more (degrees) than is true."""

    def __init__(self, seed: int, movements: int, off_deg: dict[str, float]) -> None:
        super().__init__(seed, movements)
        self.arm, self.off_deg = Arm(SEED), off_deg

    def joint_messages(self, rate_hz: float = 100.0, faults: bool = True) -> list[tuple[float, list[str], list[float]]]:
        def read(name: str, position: float) -> float:
            return position + math.radians(self.off_deg.get(name, 0.0))

        found = super().joint_messages(rate_hz, faults)
        return [(time, names, [read(*it) for it in zip(names, positions)]) for time, names, positions in found]


def first(folder: Path) -> Path:
    """The bag to calibrate from."""
    return bag(folder / "first", "mcap", Morning(SEED, 30, {}), OFFSET_S, start_ns=START_NS - 7 * DAY_NS)


def name_of(day: int) -> str:
    """The name of the bag of a morning, counted from 1."""
    return (FIRST_DAY + timedelta(day - 1)).isoformat()


def morning(folder: Path, day: int, movements: int = 3) -> Path:
    """The bag of a morning, at eight."""
    off = {JOINT: OFF_DEG} if day >= OFF_FROM else {}
    start = START_NS + (day - 1) * DAY_NS + DAY_NS // 3
    return bag(folder / name_of(day), "mcap", Morning(SEED + day, movements, off), OFFSET_S, start_ns=start)


if __name__ == "__main__":
    top = Path(sys.argv[1])
    first(top)
    (top / "mornings").mkdir()
    for number in range(1, 13):
        morning(top / "mornings", number)
