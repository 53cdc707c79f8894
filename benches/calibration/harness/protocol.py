"""The protocol: a contestant gets a folder, asks for readings by row, and predicts; it never meets what is held out.

docs/benchmark.md describes it. The harness keeps time and memory of the contestant's process, and writes one result per budget.
"""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .scores import Scores, check_prediction, score
from .sets import Set
from .splits import Split

VERSION = 1
HERE = Path(__file__).resolve().parent.parent
TICKS = os.sysconf("SC_CLK_TCK")


def environment() -> dict[str, str]:
    """One thread for linear algebra, and the kit where Python finds it."""
    path = os.pathsep.join(filter(None, [str(HERE / "contestants"), os.environ.get("PYTHONPATH")]))
    threads = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")
    return {**os.environ, **dict.fromkeys(threads, "1"), "PYTHONPATH": path}


class Foul(Exception):
    """Something that a contestant may not do, or that nobody can read; its task has failed."""


def task_of(of: Set, split: Split) -> dict[str, Any]:
    """What a contestant is told: everything but readings."""
    sensors = []
    for said in of.manifest["sensors"]:
        sensor = {key: said[key] for key in ("target", "kind", "sigma_m", "distance_m", "sigma_distance_m") if key in said}
        if said["kind"] == "pose":
            sensor["sigma_rad"] = float(np.radians(said["sigma_deg"]))
        sensors.append(sensor)
    return {
        "protocol": VERSION,
        "set": of.name,
        "split": split.number,
        "robot": {
            "urdf": "robot.urdf",
            "base": of.manifest["base"],
            "tip": of.manifest["tip"],
            "joints": [joint.name for joint in of.chain.joints],
        },
        "sensors": sensors,
        "prior": {"point_m": 0.005, "direction_rad": 0.01},
        "pool": split.pool.postures.tolist(),
        "order": list(range(len(split.pool.postures))),
        "budgets": split.budgets,
        "test": split.held_out.postures.tolist(),
    }


@dataclass
class Answer:
    """What a contestant has done for one budget, or why it has not."""

    budget: int
    rows: int
    scores: Scores | None
    error: str | None
    cpu_s: float | None
    peak_mb: float | None


def _cpu_s(pid: int) -> float:
    """Processor time of a process and of its children that have ended."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return sum(int(fields[k]) for k in (11, 12, 13, 14)) / TICKS


def _peak_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return next((int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmHWM")), 0.0)


class Host:
    """One task and its rules: what was handed out, and which budget is next."""

    def __init__(self, of: Set, split: Split) -> None:
        self.of, self.split = of, split
        self.handed: list[int] = []
        # Budget, rows that were handed out, and scores, or why there are none.
        self.done: list[tuple[int, int, Scores | str]] = []

    @property
    def budget(self) -> int | None:
        """The budget to be predicted for next."""
        return self.split.budgets[len(self.done)] if len(self.done) < len(self.split.budgets) else None

    def hear(self, line: str) -> dict[str, Any]:
        """Answers one line. Raises ``Foul``."""
        try:
            said = json.loads(line)
            if not isinstance(said, dict):
                raise ValueError("it is no object")
        except ValueError as error:
            raise Foul(f"a line that is no JSON object: {error}") from None
        if "ask" in said:
            return {"readings": self._ask(said["ask"])}
        if "predict" in said:
            return {"ok": self._predict(said["predict"])}
        if "fail" in said:
            if self.budget is None:
                raise Foul("failed more often than there are budgets")
            self.done.append((self.budget, len(self.handed), str(said["fail"])[:300]))
            return {"ok": self.done[-1][0]}
        raise Foul("a line that neither asks, nor predicts, nor fails")

    def _ask(self, rows: Any) -> list[Any]:
        if not isinstance(rows, list) or not all(isinstance(row, int) and not isinstance(row, bool) for row in rows):
            raise Foul("`ask` is no list of row numbers")
        count = len(self.split.pool.postures)
        beyond = [row for row in rows if not 0 <= row < count]
        if beyond:
            raise Foul(f"asked for row {beyond[0]}; the pool has rows 0 to {count - 1}, and nothing else is handed out")
        asked = dict.fromkeys([*self.handed, *rows])
        if len(asked) > (self.budget or 0):
            raise Foul(f"asked for {len(asked)} rows before it has predicted from {self.budget}")
        self.handed = list(asked)
        return [self.split.pool.readings[row] for row in rows]

    def _predict(self, prediction: Any) -> int:
        budget = self.budget
        if budget is None:
            raise Foul("predicted more often than there are budgets")
        try:
            told = check_prediction(prediction, self.of, self.split)
        except ValueError as error:
            raise Foul(str(error)) from None
        self.done.append((budget, len(self.handed), score(told, self.of, self.split)))
        return budget


def run(command: list[str], of: Set, split: Split, timeout_s: float) -> list[Answer]:
    """Runs a contestant on a split: an answer per budget, with an error where it has none."""
    folder = Path(tempfile.mkdtemp(prefix="benchmark-"))
    try:
        (folder / "task.json").write_text(json.dumps(task_of(of, split)))
        shutil.copy(of.urdf, folder / "robot.urdf")
        with (folder / "stderr").open("wb") as stderr:
            return _converse(command, folder, Host(of, split), timeout_s, stderr)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _converse(command: list[str], folder: Path, host: Host, timeout_s: float, stderr: Any) -> list[Answer]:
    process = subprocess.Popen(
        [*command, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=stderr, cwd=folder, env=environment()
    )
    answers: list[Answer] = []
    error, before, peak, begun = None, 0.0, 0.0, time.monotonic()
    lines = _lines(process, begun + timeout_s)
    try:
        for line in lines:
            was = len(host.done)
            answer = host.hear(line)
            if len(host.done) > was:
                cpu, peak = _cpu_s(process.pid), _peak_mb(process.pid)
                budget, rows, scores = host.done[-1]
                failed = isinstance(scores, str)
                answers.append(Answer(budget, rows, None if failed else scores, scores if failed else None, cpu - before, peak))
                before = cpu
            process.stdin.write((json.dumps(answer) + "\n").encode())
            process.stdin.flush()
            if host.budget is None:
                break
    except (Foul, TimeoutError) as foul:
        error = str(foul)
    except BrokenPipeError:
        pass
    finally:
        with contextlib.suppress(BrokenPipeError):
            process.stdin.close()
        if error is not None:
            process.terminate()
        try:
            code = process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            code = process.wait()
        process.stdout.close()
    if host.budget is not None and error is None:
        stderr.flush()
        last = (folder / "stderr").read_text(errors="replace").strip().splitlines()[-1:]
        error = f"ended with code {code}" + (f": {last[0][:300]}" if last else "")
    for budget in host.split.budgets[len(answers):]:
        answers.append(Answer(budget, len(host.handed), None, error, None, None))
    return answers


def _lines(process: subprocess.Popen, until: float):
    """The lines that a process writes, until it ends or its time is over."""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        kept = b""
        while True:
            left = until - time.monotonic()
            if left <= 0 or not selector.select(left):
                raise TimeoutError("took longer than it may")
            part = os.read(process.stdout.fileno(), 1 << 20)
            if not part:
                return
            kept += part
            while b"\n" in kept:
                line, kept = kept.split(b"\n", 1)
                if line.strip():
                    yield line.decode(errors="replace")
