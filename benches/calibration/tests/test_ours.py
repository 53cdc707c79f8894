"""This project's own contestant, where its package is installed."""

import sys
from pathlib import Path

import pytest
from harness import protocol, sets, splits

pytest.importorskip("body_schema")
HERE = Path(__file__).resolve().parent.parent


def play(of, split, *arguments):
    answers = protocol.run([sys.executable, str(HERE / "contestants" / "ours.py"), *arguments], of, split, 300.0)
    assert [a.error for a in answers] == [None] * len(answers)
    return answers


def shipped():
    """TIAGo as `tiago-mocap-3` ships: 37 rows of one session, 59 of another."""
    of = sets.load(HERE / "sets" / "tiago.json")
    pick = lambda rows: sets.Rows(of.rows.postures[rows], [of.rows.readings[row] for row in rows])
    return of, splits.Split(of.name, -1, pick(list(range(37))), pick(list(range(37, 96))), [37], "")


def test_it_predicts_as_the_report_of_the_same_rows_says():
    of, split = shipped()
    assert play(of, split, "r", "axes")[-1].scores.mean_mm == pytest.approx(2.38, abs=0.02)
    # Base and targets are fitted anew to the extended model, so that it is not the same to the digit.
    assert play(of, split, "r", "extended")[-1].scores.mean_mm == pytest.approx(1.92, abs=0.05)


def test_it_chooses_rows_and_is_better_than_the_description():
    of = sets.load(HERE / "sets" / "ur10.json")
    split = splits.split(of, 0)
    ours = play(of, split, "i", "extended")
    nominal = protocol.run([sys.executable, str(HERE / "contestants" / "nominal.py")], of, split, 120.0)
    assert [a.rows for a in ours] == split.budgets
    assert all(a.scores.mean_mm < 0.6 * b.scores.mean_mm for a, b in zip(ours, nominal))
