"""The types of answers are those of what is answered, here and on a server, and those of the server's own description."""

from __future__ import annotations

import json
import types
import typing
import urllib.request
from typing import Any

import pytest

from body_schema import answers
from conftest import Program
from robot import Robot, calibration, urdf

#: The types that the server's description calls otherwise.
ELSEWHERE = {"Observed": "Answer", "Estimate": "ModelReport", "Told": "Observation"}
TYPES = {
    name: it for name, it in vars(answers).items() if typing.is_typeddict(it) and not name.startswith("_") and name != "Channel"
}


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


@pytest.mark.parametrize("name", TYPES)
def test_types_have_the_keys_of_the_description(name: str, program: Program) -> None:
    with urllib.request.urlopen(f"{program.url}/v1/openapi.json") as answer:
        schemas = json.load(answer)["components"]["schemas"]
    described = schemas[ELSEWHERE.get(name, name)]
    assert TYPES[name].__annotations__.keys() | TYPES[name].__required_keys__ == described["properties"].keys()
    assert TYPES[name].__required_keys__ == set(described.get("required", []))
