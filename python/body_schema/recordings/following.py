"""A folder to which recordings are added, and the table that grows with it.

The table is all that is kept: a row names its recording, so that after a restart none is taken twice. Rows of a recording are appended in
one write; where that was cut off, the next one completes it.
"""

from __future__ import annotations

import csv
import io
import os
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

from .._errors import Error, wrong
from .lerobot import DataSet, is_data_set
from .recording import Recording
from .ros import Bag, is_bag
from .write import csv_of

RECORDING, TIME = "recording", "time"
"""The first titles of the table."""
Stamp = tuple[tuple[str, int, int], ...]


class Unfinished(Error):
    """The table ends with a part of somebody else's line."""


@dataclass(frozen=True)
class Candidate:
    """A recording in the folder: ``name`` as the table has it, and the ``stamp`` of its files: names, sizes, times of change (ns)."""

    name: str
    path: Path
    stamp: Stamp
    episode: int | None = None

    @property
    def is_data_set(self) -> bool:
        """Whether it is a data set of LeRobot."""
        return is_data_set(self.path)

    def episodes(self) -> list[Candidate]:
        """The episodes of a data set. Raises ``Error`` where it cannot be read."""
        return [replace(self, name=f"{self.name}#{it}", episode=it) for it in DataSet(self.path).episodes()]

    def open(self, stamps: str) -> Recording:
        """The recording."""
        return DataSet(self.path, self.episode) if self.is_data_set else Bag(self.path, stamps)

    def age_s(self) -> float:
        """How long ago its files changed last, seconds; below 0 where a clock is wrong."""
        return time.time() - max((changed for _, _, changed in self.stamp), default=0) * 1e-9


class Folder:
    """What is put into a folder: bags, in folders and as files, and data sets of LeRobot, episode by episode; at any depth."""

    def __init__(self, path: Path) -> None:
        if not path.is_dir():
            raise wrong("recording", f"{path} is no folder", "name the folder that recordings are put into")
        if (path / "metadata.yaml").exists():
            raise wrong("recording", f"{path} is one bag", "name the folder that bags are put into, or leave --follow out")
        self.path = path

    def candidates(self) -> list[Candidate]:
        """All that there is, by name; a data set is one, whatever episodes it has."""
        found = []
        for path in self._paths():
            try:
                found.append(Candidate(self._name(path), path, _stamp(path)))
            except OSError:
                # It was moved away meanwhile.
                continue
        return found

    def _name(self, path: Path) -> str:
        return path.resolve().name if path == self.path else path.relative_to(self.path).as_posix()

    def _paths(self) -> list[Path]:
        if is_data_set(self.path):
            return [self.path]
        found: list[Path] = []
        for at, folders, files in os.walk(self.path):
            here = Path(at)
            folders[:] = sorted(it for it in folders if not it.startswith("."))
            whole = [it for it in folders if (here / it / "metadata.yaml").exists() or is_data_set(here / it)]
            found += [here / it for it in whole]
            folders[:] = [it for it in folders if it not in whole]
            # Files beside no metadata.yaml below the folder are parts of a bag that is being recorded, or was cut off.
            found += [here / it for it in files if not it.startswith(".") and is_bag(here / it) and not _is_part(here, files, self.path)]
        return sorted(found)

    def unfinished(self) -> list[str]:
        """Folders with parts of a bag and no ``metadata.yaml``."""
        walked = ((Path(at), files) for at, _, files in os.walk(self.path))
        return sorted(self._name(here) for here, files in walked if _is_part(here, files, self.path) and here != self.path)


def _is_part(here: Path, files: Sequence[str], top: Path) -> bool:
    """Whether the files of a folder are those of one bag of rosbag2: called as the folder is, with a number or without."""
    parts = [it for it in files if Path(it).suffix in (".mcap", ".db3")]
    numbered = re.compile(re.escape(here.name) + r"(_\d+)?$")
    return here != top and "metadata.yaml" not in files and bool(parts) and all(numbered.match(Path(it).stem) for it in parts)


def _stamp(path: Path) -> Stamp:
    files = sorted(it for it in path.rglob("*") if it.is_file()) if path.is_dir() else [path]
    found = []
    for file in files:
        status = file.stat()
        found.append((file.relative_to(path).as_posix(), status.st_size, status.st_mtime_ns))
    return tuple(found)


class Growing:
    """A table that is appended to. Only one process follows into it at a time, where the system can lock files."""

    def __init__(self, path: Path) -> None:
        if path.is_dir():
            raise wrong("out", f"{path} is a folder", "name the table, as --out mornings.csv")
        self.path = path
        self._open()

    def _open(self) -> None:
        path = self.path
        try:
            # It begins as an empty file, so that `watch --follow` finds one.
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666)
        except OSError as error:
            raise wrong("out", f"{path}: {error.strerror}", "name a table in a folder that is there and can be written") from None
        self._lock()

    def close(self) -> None:
        """Let go of it."""
        os.close(self._file)

    def recordings(self) -> list[str]:
        """The recordings that have rows in it, in the order in which they came."""
        return recordings_of(self.path)

    def append(self, titles: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
        """Append the rows of one recording, but for those that are there; gives how many were appended.

        ``titles`` begin with ``RECORDING`` and ``TIME``. Raises ``Error`` where the table has other titles, or somebody else's
        unfinished line.
        """
        self._reopen()
        there = _rows(self.path)
        mine = [list(row) for row in rows]
        lines = [csv_of([row]) for row in mine]
        if not there:
            lines.insert(0, csv_of([titles]))
        elif there[0] != list(titles):
            what = f"{self.path} has the columns {', '.join(there[0])}, and these rows {', '.join(titles)}"
            raise wrong("out", what, "name another table with --out")
        elif rows:
            # Times may be those of files, which change.
            before = [row for row in there[1:] if row and row[0] == mine[0][0]]
            if [row[2:] for row in before] != [row[2:] for row in mine[: len(before)]]:
                # It was taken with other options; it is not taken again.
                return 0
            lines = lines[len(before) :]
        rest = "".join(lines).encode("utf-8")
        begun = self._begun()
        if not rest:
            return 0
        if not rest.startswith(begun):
            raise Unfinished(f"the last line of {self.path} is not ended, and is none of this recording: end it, or delete it")
        self._write(rest[len(begun) :])
        return len(lines) - (0 if there else 1)

    def _reopen(self) -> None:
        """Go on in the file that has the name now, where another was put in its place."""
        try:
            if os.path.samestat(os.stat(self.path), os.fstat(self._file)):
                return
        except FileNotFoundError:
            pass
        self.close()
        self._open()

    def _begun(self) -> bytes:
        return self.path.read_bytes().rpartition(b"\n")[2]

    def _write(self, rest: bytes) -> None:
        while rest:
            rest = rest[os.write(self._file, rest) :]
        os.fsync(self._file)

    def _lock(self) -> None:
        try:
            import fcntl
        except ImportError:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._file)
            raise wrong("out", f"another program follows into {self.path}", "end it first, or name another table") from None
        except OSError:
            # A file system without locks.
            return


def recordings_of(path: Path) -> list[str]:
    """The recordings that have rows in a table, in the order in which they came."""
    titles, *rows = _rows(path) or [[]]
    if titles and titles[:2] != [RECORDING, TIME]:
        what = f"{path} is there, and does not begin with the columns {RECORDING} and {TIME}"
        raise wrong("out", what, "name a table that --follow began, or another")
    return list(dict.fromkeys(row[0] for row in rows if row and row[0]))


def _rows(path: Path) -> list[list[str]]:
    """The rows that are whole, titles first."""
    whole = path.read_bytes().rpartition(b"\n")[0]
    try:
        return list(csv.reader(io.StringIO(whole.decode("utf-8"))))
    except (UnicodeDecodeError, csv.Error) as error:
        raise wrong("out", f"{path} is no table: {error}", "name another with --out") from None


def date(seconds: float) -> str:
    """Seconds since 1970 as ISO 8601 in UTC, to a millisecond."""
    moment = datetime.fromtimestamp(round(seconds, 3), timezone.utc)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")
