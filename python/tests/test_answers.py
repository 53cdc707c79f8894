"""The types of answers are those of what is answered, here and on a server, and those of the server's own description.

Types of what no server describes are held against answers that have every part of them.
"""

from __future__ import annotations

import json
import types
import typing
import urllib.request
from pathlib import Path
from typing import Any

import pytest

import body_schema
from body_schema import answers
from conftest import Program
from robot import Robot, calibration, urdf

#: The types that the server's description calls otherwise.
ELSEWHERE = {"Observed": "Answer", "Estimate": "ModelReport", "Told": "Observation"}
TYPES = {
    name: getattr(answers, name)
    for name in answers.__all__
    if getattr(answers, name).__module__.endswith(("_sessions", "_runs")) and name not in ("Channel", "Simulation")
}
RUNS = [name for name in TYPES if TYPES[name].__module__.endswith("_runs")]
#: No answer of the server has them: they are what `compare` gives.
COMPARED = {"Comparison", "ConvergenceSummary", "ErrorCurve", "LearnerComparison", "Quantiles", "RunSummary", "SeedRun", "SelectionTime"}
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def misfit(value: Any, wanted: Any, where: str) -> str | None:
    """What of a value is not as its type says; ``None`` where all is."""
    if wanted is Any:
        return None
    if typing.is_typeddict(wanted):
        hints = typing.get_type_hints(wanted)
        if not isinstance(value, dict):
            return f"{where} is {value!r}"
        if unknown := value.keys() - hints.keys():
            return f"{where} has {unknown}"
        if missing := wanted.__required_keys__ - value.keys():
            return f"{where} lacks {missing}"
        return next((it for key in value if (it := misfit(value[key], hints[key], f"{where}.{key}"))), None)
    origin, inner = typing.get_origin(wanted), typing.get_args(wanted)
    if origin is list:
        parts = enumerate(value) if isinstance(value, list) else [(0, ...)]
        return next((it for index, part in parts if (it := misfit(part, inner[0], f"{where}[{index}]"))), None)
    if origin is dict:
        parts = value.items() if isinstance(value, dict) else [("", ...)]
        return next((it for key, part in parts if (it := misfit(part, inner[1], f"{where}.{key}"))), None)
    if origin is typing.Literal:
        return None if value in inner else f"{where} is {value!r}"
    if origin in (typing.Union, types.UnionType):
        misfits = [misfit(value, one, where) for one in inner]
        return None if None in misfits else misfits[0]
    is_number = wanted is float and isinstance(value, int) and not isinstance(value, bool)
    return None if is_number or type(value) is wanted else f"{where} is {value!r}"


def test_answers_are_of_their_types(asking: Any) -> None:
    session, robot = asking.from_urdf(urdf(), "base", "tip", **calibration()), Robot(1)
    first = session.suggest(2)
    told = first["suggestions"][0]["configuration"]
    found = {
        "suggest": (first, answers.Suggestions),
        "observe": (session.observe(told, marker=robot.sees(told)), answers.Observed),
        "miss": (session.observe(session.pending()[0]["configuration"]), answers.Observed),
        "suggestions": (session.suggestions(), list[answers.Suggestion]),
        "observations": (session.observations(), list[answers.ToldObservation]),
        "channels": (session.channels(), list[answers.Channel]),
        "status": (session.status(), answers.Status),
        "description": (session.description(), answers.Description),
        "estimate": (session.estimate(), answers.Estimate),
        "model": (session.model(), answers.Model),
    }
    assert [it for name, (value, wanted) in found.items() if (it := misfit(value, wanted, name))] == []


def test_a_value_of_another_type_is_told() -> None:
    assert misfit({"observations": 3, "expected_error_mm": "much", "wanted_mm": 2.0}, answers.Enough, "it") is not None
    assert misfit({"observations": 3, "wanted_mm": 2.0}, answers.Enough, "it") == "it lacks {'expected_error_mm'}"
    assert misfit({"observations": True, "expected_error_mm": 1, "wanted_mm": 2.0}, answers.Enough, "it") is not None


def seen(value: Any, wanted: Any, into: set[str]) -> set[str]:
    """The types, and their keys that need not be there, of which a value has one: ``TYPE`` and ``TYPE.KEY``."""
    if typing.is_typeddict(wanted):
        into.add(wanted.__name__)
        into |= {f"{wanted.__name__}.{key}" for key in value if key in wanted.__optional_keys__}
        for key, its in typing.get_type_hints(wanted).items():
            if key in value:
                seen(value[key], its, into)
        return into
    for inner in typing.get_args(wanted) if value is not None else ():
        if isinstance(value, list):
            for part in value:
                seen(part, inner, into)
        elif typing.is_typeddict(inner) or typing.get_origin(inner) is list:
            seen(value, inner, into)
    return into


def test_reports_are_of_their_types(asking: Any) -> None:
    session, robot = asking.from_urdf(urdf(), "base", "tip", **calibration()), Robot(2)
    for _ in range(8):
        told = session.suggest()["suggestions"][0]["configuration"]
        session.observe(told, marker=robot.sees(told))
    for folds in (0, 2):
        assert misfit(session.report(folds=folds), answers.CalibrationReport, f"report of {folds} folds") is None


#: No answer of the test has them: designs that nobody asked for, joints that give way, lenses and noise that are learned.
UNSEEN = {"BestDesign", "FoundCompliance", "JointCompliance", "LensCoefficient", "NoiseReport"}


def test_what_is_calibrated_and_run_is_of_its_type(tmp_path: Path) -> None:
    into: set[str] = set()

    def check(value: Any, wanted: Any, where: str) -> None:
        assert misfit(value, wanted, where) is None
        seen(value, wanted, into)

    for name in ("positioner.urdf", "positioner.csv"):
        (tmp_path / name).write_text((SCENARIOS / name).read_text(encoding="utf-8"), encoding="utf-8")
    text = (SCENARIOS / "positioner.toml").read_text(encoding="utf-8").replace("[robot]", '[robot]\nlearn = "zeros"')
    (tmp_path / "zeros.toml").write_text(text, encoding="utf-8")
    tables: list[tuple[Path, dict[str, Any]]] = [
        (SCENARIOS / "positioner.toml", {}),
        (SCENARIOS / "kinova-sockets.toml", {}),
        (SCENARIOS / "tiago-mocap.toml", {"active": 12}),
        (SCENARIOS / "fr3-hand-eye.toml", {"folds": 0}),
        (tmp_path / "zeros.toml", {"folds": 0}),
    ]
    for file, more in tables:
        check(body_schema.calibrate(file, **more).report, answers.CalibrationReport, file.stem)
    check(body_schema.observability(SCENARIOS / "positioner.toml", postures=2), answers.Observability, "observability")
    for name in ("arm-6dof-outliers", "arm-6dof"):
        check(body_schema.simulate(name, steps=4, learners=["global"]), answers.Simulation, name)
    check(body_schema.compare("arm-6dof", range(1, 3), steps=3), answers.Comparison, "compare")
    told = {name for name in answers.__all__ if not getattr(answers, name).__module__.endswith("_sessions")}
    assert told - into == UNSEEN


@pytest.mark.parametrize("name", sorted(TYPES.keys() - COMPARED))
def test_types_have_the_keys_of_the_description(name: str, program: Program) -> None:
    with urllib.request.urlopen(f"{program.url}/v1/openapi.json") as answer:
        schemas = json.load(answer)["components"]["schemas"]
    described = schemas[ELSEWHERE.get(name, name)]
    assert TYPES[name].__annotations__.keys() | TYPES[name].__required_keys__ == described["properties"].keys()
    # What is always written, though it need not be read, is there in a run.
    required = set(described.get("required", []))
    assert TYPES[name].__required_keys__ >= required if name in RUNS else TYPES[name].__required_keys__ == required
