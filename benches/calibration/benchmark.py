#!/usr/bin/env python3
"""The benchmark of calibration: runs every contestant on every set and split, and writes the tables. See docs/benchmark.md."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
# What a thread of linear algebra more would take from the next contestant.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from harness import protocol, sets, splits, table  # noqa: E402


@dataclass
class Contestant:
    """A program and its arguments; ``name`` is what tables call it."""

    name: str
    file: Path
    arguments: list[str] = field(default_factory=list)
    ours: bool = False
    # Only the task with all rows: of programs that take minutes.
    all_rows_only: bool = False
    # No more splits than these.
    splits: int = splits.FROZEN
    # The virtual environment, beside the one that this runs in, of a library that shares no environment with the others.
    environment: str = ""
    # Kinds of sensors that it has no model of.
    without: list[str] = field(default_factory=list)
    version: str = ""

    @property
    def program(self) -> list[str]:
        """What starts it, without its arguments."""
        python = str(Path(sys.prefix).parent / self.environment / "bin" / "python") if self.environment else sys.executable
        return [python, str(self.file)] if self.file.suffix == ".py" else [str(self.file)]

    @property
    def command(self) -> list[str]:
        return [*self.program, *self.arguments]

    def digest(self) -> str:
        """A hash of its program, its version and what all contestants share."""
        folder = self.file.parent
        shared = [folder / "_kit.py", HERE / "kinematics.py"]
        parts = [self.version.encode(), json.dumps(self.arguments).encode(), self.file.read_bytes()]
        parts += [path.read_bytes() for path in shared if path.exists()]
        return hashlib.sha256(b"\0".join(parts)).hexdigest()


def lineup(path: Path, entered: list[Path]) -> tuple[list[Contestant], str]:
    """The contestants of a line-up and those that are entered by their files, and the name of the default."""
    said = json.loads(path.read_text())
    found = [Contestant(**{**entry, "file": (path.parent / "contestants" / entry["file"])}) for entry in said["contestants"]]
    return found + [Contestant(file.stem, file.resolve()) for file in entered], said["default"]


def named(contestants: list[Contestant], text: str) -> list[Contestant]:
    """The contestants that a text names, with ``;`` between them. Raises ``LookupError`` that says which there are."""
    names = [name.strip() for name in text.split(";")]
    unknown = [name for name in names if name not in [it.name for it in contestants]]
    if unknown:
        raise LookupError(f"there is no contestant {unknown[0]!r}; there are {'; '.join(it.name for it in contestants)}")
    return [it for it in contestants if it.name in names]


def versions(contestants: list[Contestant]) -> list[Contestant]:
    """Those that can run here, with what they say they are; others are told and left out."""
    able, known = [], {}
    for it in contestants:
        if it.file not in known:
            try:
                known[it.file] = subprocess.run(
                    [*it.program, "--version"], capture_output=True, text=True, timeout=120, env=protocol.environment()
                )
            except (OSError, subprocess.TimeoutExpired) as error:
                known[it.file] = error
        said = known[it.file]
        if isinstance(said, Exception) or said.returncode != 0:
            lines = [str(said)] if isinstance(said, Exception) else said.stderr.strip().splitlines()[-1:]
            print(f"{it.name}: left out, it does not start: {''.join(lines)}", file=sys.stderr)
            continue
        it.version = said.stdout.strip()
        able.append(it)
    return able


def key_of(it: Contestant, of: sets.Set, split: splits.Split) -> str:
    return hashlib.sha256("/".join([str(protocol.VERSION), it.digest(), str(it.all_rows_only), of.digest, split.digest]).encode()).hexdigest()[:16]


def play(it: Contestant, of: sets.Set, number: int, timeout_s: float, key: str) -> list[dict[str, Any]]:
    """The results of one contestant on one split, a record per budget."""
    split = splits.split(of, number)
    count = split.budgets[-1]
    if it.all_rows_only:
        split = replace(split, budgets=[count])
    return [
        {"key": key, "contestant": it.name, "set": of.name, "split": number,
         "task": "all" if answer.budget == count else str(answer.budget), **asdict(answer)}
        for answer in protocol.run(it.command, of, split, timeout_s)
    ]


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--splits", type=int, default=splits.FROZEN, help=f"of {splits.FROZEN} per set, for a short run [default: all]")
    parser.add_argument("--sets", help="only these, with commas between")
    parser.add_argument("--contestants", help="only these, by name, with semicolons between")
    parser.add_argument("--enter", type=Path, action="append", default=[], help="the file of another contestant")
    parser.add_argument("--more-sets", type=Path, action="append", default=[], help="a folder with more manifests")
    parser.add_argument("--jobs", type=int, default=2, help="contestants that run at once [default: 2]")
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds that a contestant may take for a split [default: 600]")
    parser.add_argument("--out", type=Path, default=HERE.parent.parent / "target" / "benchmark", help="where results.jsonl and tables go")
    parser.add_argument("--tables-only", action="store_true", help="write the tables of the results that are there")
    parser.add_argument("--document", type=Path, help="put the tables into this page too, between its marks, and the plots beside it")
    parser.add_argument("--freeze", action="store_true", help="write splits.json for sets that are not in it")
    return parser.parse_args()


def main() -> int:
    asked = arguments()
    contestants, default = lineup(HERE / "lineup.json", asked.enter)
    try:
        contestants = named(contestants, asked.contestants) if asked.contestants else contestants
    except LookupError as error:
        print(error.args[0], file=sys.stderr)
        return 2
    try:
        found = sets.found([HERE / "sets", *asked.more_sets], lambda line: print(line, file=sys.stderr))
        if asked.sets:
            found = [of for of in found if of.name in asked.sets.split(",")]
        splits.check(found, asked.freeze)
    except sets.SetError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    asked.out.mkdir(parents=True, exist_ok=True)
    results = asked.out / "results.jsonl"
    contestants = versions(contestants)
    done = {record["key"] for record in table.read(results)}
    wanted, keys = [], set()
    # Split by split, so that an interrupted run has something of everything.
    for number in range(asked.splits):
        for of in found:
            for it in contestants:
                if number < it.splits and of.manifest["sensors"][0]["kind"] not in it.without:
                    key = key_of(it, of, splits.split(of, number))
                    keys.add(key)
                    if key not in done:
                        wanted.append((it, of, number, key))
    if not asked.tables_only:
        work(wanted, asked, results)
    records = [record for record in table.read(results) if record["key"] in keys]
    text, page = table.write(records, found, contestants, default)
    (asked.out / "table.md").write_text(text)
    (asked.out / "benchmark.html").write_text(page)
    if asked.document:
        table.into(asked.document, text)
        asked.document.with_suffix(".html").write_text(page)
    print(text)
    return 0


def work(wanted: list[tuple], asked: argparse.Namespace, results: Path) -> None:
    with ThreadPoolExecutor(asked.jobs) as pool, results.open("a") as file:
        pending = {pool.submit(play, it, of, number, asked.timeout, key): (it, of, number) for it, of, number, key in wanted}
        for count, finished in enumerate(as_completed(pending), 1):
            for record in finished.result():
                file.write(json.dumps(record) + "\n")
                if record["error"]:
                    print(f"{record['contestant']}, {record['set']}, split {record['split']}, {record['task']}: {record['error']}", file=sys.stderr)
            file.flush()
            if count % 20 == 0 or count == len(pending):
                print(f"{count} of {len(pending)} runs", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
