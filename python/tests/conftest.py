"""Where sessions are computed: here, and on a server, which is the program itself.

``BODY_SCHEMA_SERVER`` names the program. Without it that of the repository's ``target`` is taken, and what needs a server is skipped
where there is none.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
if sys.platform == "linux" and "DISPLAY" not in os.environ:
    # MuJoCo reads this once, when it is imported first.
    os.environ.setdefault("MUJOCO_GL", "egl")

import body_schema  # noqa: E402

TARGET = Path(__file__).resolve().parents[2] / "target"


class Program:
    """The program as a server, on a port of its own."""

    def __init__(self, binary: Path, *arguments: str) -> None:
        command = [str(binary), "serve", "--bind", "127.0.0.1:0", "--ephemeral", *arguments]
        environment = {**os.environ, "BODY_SCHEMA_LOG": "off"}
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True)
        assert self._process.stdout is not None
        said = ""
        while "http://" not in said:
            line = self._process.stdout.readline()
            assert line, f"it ended: {said}"
            said += line
        self.url = "http://" + said.split("http://")[1].split("/")[0].split()[0]
        # What it says later is read, so that it never waits.
        threading.Thread(target=self._process.stdout.read, daemon=True).start()

    def end(self) -> None:
        self._process.kill()
        self._process.wait()


@pytest.fixture(scope="session")
def binary() -> Path:
    """The program."""
    named = os.environ.get("BODY_SCHEMA_SERVER")
    if named is not None:
        assert Path(named).exists(), f"BODY_SCHEMA_SERVER names {named}, which is not there"
        return Path(named).resolve()
    for build in ("debug", "release"):
        if (TARGET / build / "body-schema").exists():
            return TARGET / build / "body-schema"
    pytest.skip("there is no server: build it with `cargo build`, or name one with BODY_SCHEMA_SERVER")


@pytest.fixture(scope="session")
def program(binary: Path) -> Iterator[Program]:
    """A server that keeps nothing."""
    program = Program(binary)
    yield program
    program.end()


@pytest.fixture
def client(program: Program) -> body_schema.Client:
    return body_schema.Client(program.url)


@pytest.fixture(params=["here", "there"])
def asking(request: pytest.FixtureRequest) -> object:
    """What opens sessions, here or on a server."""
    return body_schema.Session if request.param == "here" else request.getfixturevalue("client")
