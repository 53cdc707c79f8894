"""How far a long computation is."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Union

Hear = Callable[[str, int, int], object]
"""Called with the name of a stage, the steps that are done, and all its steps."""

Progress = Union[bool, Hear, None]
"""``True`` for a bar on standard error, ``False`` for none, ``None`` for one where somebody looks, or a function of one's own."""

_WIDTH = 30


@contextmanager
def hearing(progress: Progress) -> Iterator[Hear | None]:
    """What is told how far it is, while it lasts; a bar is wiped off in the end."""
    if callable(progress):
        yield progress
    elif progress or (progress is None and _looked_at()):
        bar = _Bar()
        try:
            yield bar
        finally:
            bar.wipe()
    else:
        yield None


def _looked_at() -> bool:
    """Whether standard error is a terminal's or a notebook's."""
    return "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())


class _Bar:
    """A line that is written over."""

    def __init__(self) -> None:
        self._longest = 0

    def __call__(self, what: str, done: int, steps: int) -> None:
        full = round(_WIDTH * done / max(steps, 1))
        line = f"{what} [{'#' * full}{'.' * (_WIDTH - full)}] {done}/{steps}"
        self._write(line.ljust(self._longest))
        self._longest = max(self._longest, len(line))

    def wipe(self) -> None:
        if self._longest:
            self._write(" " * self._longest + "\r")

    @staticmethod
    def _write(text: str) -> None:
        sys.stderr.write("\r" + text)
        sys.stderr.flush()
