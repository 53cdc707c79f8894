#!/usr/bin/env python3
"""TIAGo by the split of figaroh's authors: 37 rows of one session to learn from, 59 of a later one to judge by. See docs/benchmark.md."""

from __future__ import annotations

import argparse
from pathlib import Path

import benchmark
from harness import protocol, sets, splits

HERE = Path(__file__).resolve().parent
# The rows of the first of the set's tables; the others are those of the second.
LEARNED = 37


def split_of(of: sets.Set) -> splits.Split:
    rows = list(range(len(of.rows.postures)))
    return splits.Split(of.name, 0, splits.picked(of, rows[:LEARNED]), splits.picked(of, rows[LEARNED:]), [LEARNED], "published")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    names = "ours;ours, axes alone;SciPy;Pinocchio + SciPy;figaroh, structural;nominal"
    parser.add_argument("--contestants", default=names, help="names, with ; between them [default: %(default)s]")
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds that a contestant may take [default: 600]")
    asked = parser.parse_args()
    try:
        contestants = benchmark.named(benchmark.lineup(HERE / "lineup.json", [])[0], asked.contestants)
    except LookupError as error:
        parser.error(error.args[0])
    print("| set | contestant | rms mm | mean mm | 95 % mm | coverage |\n|---|---|---|---|---|---|")
    failed = False
    for of in [of for of in sets.found([HERE / "sets"]) if of.name in ("tiago-1-point", "tiago")]:
        for it in contestants:
            for answer in protocol.run(it.command, of, split_of(of), asked.timeout):
                found = answer.scores
                failed |= found is None
                if found is None:
                    print(f"| {of.name} | {it.name} | {answer.error} | | | |", flush=True)
                    continue
                coverage = "–" if found.coverage is None else f"{found.coverage:.2f}"
                print(f"| {of.name} | {it.name} | {found.rms_mm:.2f} | {found.mean_mm:.2f} | {found.p95_mm:.2f} | {coverage} |", flush=True)
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
