"""Scores against ones by hand, and what results say together."""

from types import SimpleNamespace

import numpy as np
import pytest
from harness import summary, table
from harness.scores import Prediction, check_prediction, score
from harness.sets import Rows


def a_set(kind, readings, axes=None):
    of = SimpleNamespace(
        sockets=kind == "socket",
        manifest={"sensors": [{"kind": kind}]},
        chain=SimpleNamespace(joints=[SimpleNamespace(slides=False)] * (len(axes) if axes else 0)),
    )
    rows = Rows(np.zeros((len(readings), 1)), [[reading] for reading in readings])
    return of, SimpleNamespace(held_out=rows, pool=Rows(np.zeros((0, 1)), [], axes))


def test_errors_and_coverage_by_hand():
    of, split = a_set("position", [[0, 0, 0], [0.003, 0, 0.004], None, [0, 0.001, 0]])
    sd = np.full((4, 1, 3), 0.001)
    told = Prediction(np.zeros((4, 1, 3)), None, sd, None)
    found = score(told, of, split)
    # 0, 5 and 1 mm; of nine coordinates 3 mm and 4 mm are beyond 1.96 mm.
    assert (found.mean_mm, found.median_mm) == (pytest.approx(2.0), pytest.approx(1.0))
    assert found.p95_mm == pytest.approx(1 + 0.9 * 4)
    assert found.coverage == pytest.approx(7 / 9)
    assert found.mean_deg is None


def test_rotations_by_hand():
    half = np.sqrt(0.5)
    of, split = a_set("pose", [[0, 0, 0, 0, 0, half, half], [0, 0, 0, 0, 0, 0, -1]])
    said = {"mean": [[[0, 0, 0, 0, 0, 0, 1]], [[0, 0, 0, 0, 0, 0, 1]]]}
    assert score(check_prediction(said, of, split), of, split).mean_deg == pytest.approx(45.0)


def test_balls_scatter_about_the_mean_of_their_socket():
    of, split = a_set("socket", ["a/0", "a/0", "b/0", "b/0"])
    places = np.array([[0, 0, 0], [0.002, 0, 0], [5, 0, 0], [5, 0.004, 0]])[:, None]
    found = score(Prediction(places, None, None, None), of, split)
    assert found.mean_mm == pytest.approx(1.5)
    assert found.coverage is None


def test_axes_by_hand():
    # The first is parallel and 3 mm away, whichever of its points is told; the second is 90 degrees off.
    true = [[[0, 0, 0], [0, 0, 1]], [[0, 0, 1], [1, 0, 0]]]
    of, split = a_set("position", [[0, 0, 0]], true)
    told = Prediction(np.zeros((1, 1, 3)), None, None, np.array([[[0.003, 0, 7], [0, 0, 2]], [[0, 0, 1], [0, 1, 0]]]))
    found = score(told, of, split)
    assert found.axes_deg == pytest.approx(45.0)
    assert found.axes_mm == pytest.approx(1.5)


def record(contestant, split, mm, task="8", budget=8):
    scores = None if mm is None else {**dict.fromkeys(("median_mm", "p95_mm", "mean_deg", "coverage", "axes_deg", "axes_mm")), "mean_mm": mm}
    return {"set": "s", "task": task, "budget": budget, "contestant": contestant, "split": split, "scores": scores,
            "cpu_s": 1.0, "peak_mb": 1.0, "key": "k", "error": None if scores else "broke"}


def test_the_best_of_the_others_and_its_interval():
    records = [record(who, k, mm + 0.01 * k) for who, mm in (("a", 1.0), ("b", 2.0), ("c", 1.1)) for k in range(20)]
    found = summary.compare(records, "s", "8", "a", ["b", "c"])
    assert (found.other, found.splits) == ("c", 20)
    assert found.ratio == pytest.approx(1.095 / 1.195)
    assert found.low <= found.ratio <= found.high < 1


def test_one_that_failed_is_counted_and_is_no_rival():
    records = [record("a", k, 1.0) for k in range(5)] + [record("b", k, 0.1 if k else None) for k in range(5)]
    assert summary.compare(records, "s", "8", "a", ["b"]) is None
    found = summary.cell([r for r in records if r["contestant"] == "b"])
    assert (found.splits, found.failed, found.mean_mm) == (5, 1, pytest.approx(0.1))


def test_rows_until_near_the_best():
    records = [record("a", k, mm, str(n), n) for k in range(3) for n, mm in ((8, 2.0), (12, 1.15), (20, 1.0))]
    assert summary.rows_until(records, "s", "a", 1.0) == 12
    assert summary.rows_until(records, "s", "a", 0.1) is None


def test_a_line_that_was_interrupted_is_passed_over(tmp_path):
    (tmp_path / "results.jsonl").write_text('{"key": "1"}\n{"key": "2", "sc')
    assert [r["key"] for r in table.read(tmp_path / "results.jsonl")] == ["1"]
