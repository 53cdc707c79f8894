"""Observations as rows, and a session as a short table."""

from __future__ import annotations

import html
import importlib
from collections.abc import Mapping, Sequence
from typing import Any

from ._errors import Error, wrong


def row_of(observation: Mapping[str, Any], joints: Sequence[str], channels: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """One observation as a flat row: joints by name, readings as in the table of ``to_csv``, and what was answered."""
    told, answer = observation["told"], observation["answer"]
    row: dict[str, Any] = {"number": observation["number"], "excluded": observation["excluded"]}
    row["suggestion_id"] = told.get("suggestion_id")
    row.update({name: told["configuration"].get(name) for name in joints})
    seen = told.get("measurements") or {}
    for channel in channels:
        row.update(_flat(str(channel["name"]), seen.get(channel["name"])))
    for key in ("seen", "innovation_sigmas", "outlier_probability", "expected_error_mm", "body_seems_changed"):
        row[key] = answer.get(key)
    return row


def _flat(name: str, reading: Any) -> dict[str, Any]:
    if isinstance(reading, Mapping) and "position" in reading:
        place, turn = reading["position"], reading["quaternion"]
        return {**dict(zip((f"{name}_{it}" for it in "xyz"), place)), **dict(zip((f"{name}_q{it}" for it in "xyzw"), turn))}
    if isinstance(reading, Mapping):
        return {name: next(iter(reading.values()), None)}
    if not isinstance(reading, Sequence) or isinstance(reading, str):
        return {} if reading is None else {name: reading}
    if reading and isinstance(reading[0], Sequence):
        return {f"{name}_{axis}{number}": it for number, pair in enumerate(reading, 1) for axis, it in zip("uv", pair)}
    return dict(zip((f"{name}_{it}" for it in "xyz"), reading))


def dataframe(answer: Mapping[str, Any], part: str) -> Any:
    """A list of an answer as a ``pandas.DataFrame``, a row for each of its entries (needs pandas).

    ``answer`` is what ``observability`` or a session's ``report`` gives, or ``report`` of a calibration; ``part`` names the list: ``deviations``, ``errors``,
    ``residuals``, ``joints``, … Nested numbers are columns ``outer.inner``. Raises ``FieldError``.
    """
    lists = [name for name, its in answer.items() if isinstance(its, list) and all(isinstance(it, dict) for it in its)]
    if part not in lists:
        raise wrong("part", f"{part!r} is no list of it", f"name one of {', '.join(lists) or 'none: it has no lists'}")
    return pandas().json_normalize(answer[part])


def pandas() -> Any:
    """The module pandas. Raises ``Error`` where it is missing."""
    try:
        return importlib.import_module("pandas")
    except ImportError:
        raise Error("a data frame needs pandas, which is missing; pip install pandas") from None


def pyplot() -> Any:
    """The module matplotlib.pyplot. Raises ``Error`` where it is missing."""
    try:
        return importlib.import_module("matplotlib.pyplot")
    except ImportError:
        raise Error("a plot needs matplotlib, which is missing; pip install matplotlib") from None


def axes(given: Any) -> Any:
    """Axes of matplotlib to draw in: the given ones, or new ones. Raises ``Error`` where matplotlib is missing."""
    return given if given is not None else pyplot().subplots(figsize=(6.4, 3.6), layout="constrained")[1]


def short_table(rows: Sequence[tuple[str, object]]) -> str:
    """Two columns as HTML."""
    cells = (f"<tr><th style='text-align:left'>{html.escape(head)}</th><td>{html.escape(str(it))}</td></tr>" for head, it in rows)
    return f"<table>{''.join(cells)}</table>"
