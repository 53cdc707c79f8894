"""The tables: Markdown that docs/benchmark.md shows, and a page with plots."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from typing import Any

from . import plots
from .summary import Cell, Comparison, cell, compare, rows_until, tasks_of

BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"
ALLOWED = 1.02


def read(results: Path) -> list[dict[str, Any]]:
    """The records of results.jsonl; a line that an interrupted run left unfinished is passed over."""
    records = []
    for line in results.read_text().splitlines() if results.exists() else []:
        try:
            records.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return records


def _told(x: float | None, digits: int = 2) -> str:
    return "–" if x is None else f"{x:.{digits}f}"


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _table(titles: list[str], rows: list[list[str]], left: int = 1) -> list[str]:
    rule = ["---"] * left + ["---:"] * (len(titles) - left)
    return [_row(titles), _row(rule), *(_row(row) for row in rows), ""]


def _cells(records: list[dict[str, Any]]) -> dict[tuple[str, str, str], Cell]:
    grouped: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for r in records:
        grouped.setdefault((r["set"], r["task"], r["contestant"]), []).append(r)
    return {key: cell(of) for key, of in grouped.items()}


def comparisons(records, sets, contestants, default: str) -> list[Comparison]:
    others = [it.name for it in contestants if not it.ours]
    found = (compare(records, of.name, task, default, others) for of in sets for task in tasks_of(records, of.name))
    return [it for it in found if it is not None]


def write(records, sets, contestants, default: str) -> tuple[str, str]:
    """The Markdown and the page."""
    cells, names = _cells(records), [it.name for it in contestants]
    against = comparisons(records, sets, contestants, default)
    lines = [f"### {default[0].upper()}{default[1:]} against the best of the others", ""]
    held = sum(it.high <= ALLOWED for it in against)
    lines += [f"The upper end of the interval is at most {ALLOWED} at {held} of {len(against)} tasks; those where it is not are **bold**.", ""]
    lines += _table(
        ["set", "best other", "rows", "splits", "ours (mm)", "other (mm)", "ratio", "95 % interval"],
        [[it.set, it.other, it.task, str(it.splits), _told(it.ours_mm), _told(it.other_mm),
          f"**{it.ratio:.3f}**" if it.high > ALLOWED else f"{it.ratio:.3f}", f"{it.low:.3f} – {it.high:.3f}"] for it in against],
        left=2,
    )
    for of in sets:
        tasks = tasks_of(records, of.name)
        if not tasks:
            continue
        lines += [f"### {of.name}", "", f"{of.about[0].upper()}{of.about[1:]}. Mean held-out error in mm, by rows learned from, over the splits that each has played:", ""]
        there = [name for name in names if any((of.name, task, name) in cells for task in tasks)]
        mean = lambda name, task: _entry(cells.get((of.name, task, name)))
        played = lambda name: str(max(cells[(of.name, task, name)].splits for task in tasks if (of.name, task, name) in cells))
        lines += _table(["contestant", *tasks, "splits"], [[name, *(mean(name, task) for task in tasks), played(name)] for name in there])
        known = [cells[(of.name, "all", name)].mean_mm for name in there if (of.name, "all", name) in cells]
        best = min((x for x in known if x is not None), default=None)
        lines += ["With all rows; coverage is that of the fewest rows, of 12 or the next, and of all:", ""]
        rows = []
        for name in there:
            last = cells.get((of.name, "all", name))
            if last is None:
                continue
            until = rows_until(records, of.name, name, best) if best is not None else None
            covered = [cells.get((of.name, task, name)) for task in dict.fromkeys([tasks[0], tasks[min(2, len(tasks) - 1)], "all"])]
            rows.append([
                name, _told(last.mean_mm), _told(last.median_mm), _told(last.p95_mm), _told(last.mean_deg, 3),
                " ".join(_told(it.coverage if it else None) for it in covered), _told(until, 0),
                _told(last.axes_deg, 3), _told(last.axes_mm), _told(last.cpu_s, 1), _told(last.peak_mb, 0), f"{last.failed}/{last.splits}",
            ])
        lines += _table(["contestant", "mean", "median", "95 %", "deg", "coverage", "rows to 1.2 × best", "axes deg", "axes mm",
                         "CPU s", "MB", "failed"], rows)
    lines += ["### Coverage of 95 % intervals, all tasks", ""]
    every = lambda name: [c.coverage for (_, _, who), c in cells.items() if who == name and c.coverage is not None]
    covered = [(name, every(name)) for name in names]
    lines += _table(["contestant", "mean", "least", "most", "tasks"],
                    [[name, _told(sum(x) / len(x)), _told(min(x)), _told(max(x)), str(len(x))] for name, x in covered if x])
    versions = dict.fromkeys(it.version for it in contestants)
    lines += ["Versions: " + "; ".join(versions) + ".", ""]
    text = "\n".join(lines)
    return text, page(text, records, sets, names, cells)


def _entry(it: Cell | None) -> str:
    if it is None:
        return ""
    failed = f" ({it.failed} of {it.splits} failed)" if it.failed else ""
    return _told(it.mean_mm) + failed


def _markup(text: str) -> str:
    """A line of the tables as HTML: what stands between two pairs of asterisks is bold."""
    return re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", html.escape(text))


def page(text: str, records, sets, names: list[str], cells) -> str:
    """The same as a page, a plot above the tables of each set."""
    body, rows = [], []

    def flush() -> None:
        if rows:
            cell_of = lambda row, tag: "".join(f"<{tag}>{_markup(c.strip())}</{tag}>" for c in row.strip("| ").split(" | "))
            body.append("<table>" + "".join(f"<tr>{cell_of(row, 'td' if k else 'th')}</tr>" for k, row in enumerate(rows) if k != 1) + "</table>")
            rows.clear()

    named = {of.name for of in sets}
    for line in text.splitlines():
        if line.startswith("|"):
            rows.append(line)
            continue
        flush()
        if line.startswith("### "):
            body.append(f"<h2>{html.escape(line[4:])}</h2>")
            if line[4:] in named:
                body.append(plots.errors(line[4:], tasks_of(records, line[4:]), names, cells))
        elif line:
            body.append(f"<p>{_markup(line)}</p>")
    flush()
    return plots.PAGE.replace("BODY", "\n".join(body))


def into(document: Path, text: str) -> None:
    """Puts the tables between the marks of a document. Raises ``ValueError`` if it has none."""
    was = document.read_text()
    if BEGIN not in was or END not in was:
        raise ValueError(f"{document} has no place for the tables: it needs the lines {BEGIN} and {END}")
    before, rest = was.split(BEGIN, 1)
    document.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{rest.split(END, 1)[1]}")
