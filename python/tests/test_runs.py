"""Scenarios that run by themselves."""

from __future__ import annotations

import pytest

import body_schema


def test_a_run_is_flat_rows_beside_its_result() -> None:
    run = body_schema.simulate("arm-6dof", seed=2, steps=5, learners=["active", "random"])
    assert run["result"]["seed"] == 2 and run["result"]["steps"] == 5
    assert [(row["step"], row["learner"]) for row in run["curve"]][:3] == [(0, "active"), (0, "random"), (1, "active")]
    assert len(run["curve"]) == 12
    assert all(isinstance(value, (int, float, str, bool, type(None))) for row in run["curve"] for value in row.values())
    assert run["curve"][-1]["location_m"] > 0.0
    assert body_schema.simulate("arm-6dof", seed=2, steps=5, learners=["random"])["curve"][-1] == run["curve"][-1]


def test_a_comparison_is_what_the_command_writes() -> None:
    compared = body_schema.compare("arm-6dof", range(1, 4), steps=4, learners=["random"])
    (learner,) = compared["learners"]
    assert [run["seed"] for run in learner["runs"]] == [1, 2, 3]
    assert [point["movements"] for point in learner["curve"]] == [0, 1, 2, 3, 4]


def test_what_is_not_there_is_named() -> None:
    with pytest.raises(body_schema.FieldError, match="did you mean `arm-6dof`") as refused:
        body_schema.simulate("arm-6df")
    assert refused.value.field == "scenario"
    with pytest.raises(body_schema.FieldError) as refused:
        body_schema.compare("arm-6dof", [1], learners=["nobody"])
    assert refused.value.field == "learners"
    with pytest.raises(body_schema.EngineError, match="missing.toml"):
        body_schema.simulate("missing.toml")
