"""``import --follow``: recordings that are put into a folder become rows of a table that grows."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from .._errors import Error, MissingExtraError, wrong

if TYPE_CHECKING:
    from ..recordings.following import Candidate, Folder, Growing, Stamp

LOOK_EVERY_S = 1.0
"""The interval at which the folder is looked at."""


def follow(args: argparse.Namespace) -> int:
    """Take what is in a folder, and what comes, until Ctrl-C; with ``--once`` what is there, and 1 is returned where something of it was left out."""
    from ..recordings.following import Folder, Growing

    for option, given in (("list", args.list), ("overwrite", args.overwrite), ("name", args.name), ("plot", args.plot)):
        if given:
            raise wrong(option, "it has no meaning with --follow", "leave it out")
    if args.out is None:
        raise wrong("out", "nothing says which table is to grow", "name it, as --out mornings.csv")
    if args.urdf is None:
        raise wrong("urdf", "the robot's description is missing", "name it with --urdf FILE")
    if not args.settle >= 0.0:
        raise wrong("settle", f"{args.settle:g} is no time to wait", "write seconds")
    folder = Folder(args.recording)
    table = None if args.dry_run else Growing(args.out)
    try:
        return _followed(_Following(folder, table, args), args)
    finally:
        if table is not None:
            table.close()


def _followed(following: _Following, args: argparse.Namespace) -> int:
    goes_on = not (args.once or args.dry_run)
    try:
        following.look()
        if goes_on:
            print(f"waiting for recordings in {args.recording} (Ctrl-C ends it)", flush=True)
        while goes_on:
            time.sleep(LOOK_EVERY_S)
            following.look()
    except KeyboardInterrupt:
        if not goes_on:
            raise
        print()
    print("nothing is written (--dry-run)" if args.dry_run else f"{following.added} rows added to {args.out}")
    return 1 if args.once and (following.refused or following.waiting) else 0


class _Following:
    """What is known of a folder: what the table has, what was left out as it was then, and since when what has stood still."""

    def __init__(self, folder: Folder, table: Growing | None, args: argparse.Namespace) -> None:
        self.folder, self.table, self.args, self.added = folder, table, args, 0
        there = table.recordings() if table is not None else _there(args.out)
        # The last one may have been cut off while it was written: it is taken again, and what is missing is added.
        self.done, self.left_out = set(there if table is None else there[:-1]), dict[str, "Stamp"]()
        self.last = there[-1] if there else None
        self.since: dict[str, tuple[Stamp, float]] = {}
        self.refused: set[str] = set()
        self.unfinished = ""
        self.told: dict[str, str] = {}
        self.waiting: dict[str, tuple[Candidate, list[str], list[list[str]], str]] = {}

    def look(self) -> None:
        """Take all that is whole and is not in the table."""
        for name in self.folder.unfinished():
            self._tell(name, "has no metadata.yaml: it is being recorded, or was cut off (`ros2 bag reindex` mends it)")
        # What was cut off while it was written is completed before anything comes after it.
        begun = (self.last, self.last.rpartition("#")[0]) if self.last else ()
        for it in sorted(self.folder.candidates(), key=lambda it: it.name not in begun):
            if not self._is_new(it):
                continue
            if not self._stands(it):
                if self.args.once or self.args.dry_run:
                    self._tell(it.name, f"has changed in the last {self.args.settle:g} s: it is left for later")
                continue
            if not it.is_data_set:
                self._try(it)
                continue
            try:
                episodes = it.episodes()
            except MissingExtraError:
                raise
            except Error as error:
                self._refuse(it, f"cannot be read yet: {error}")
                continue
            for episode in episodes:
                if self._is_new(episode):
                    self._try(episode)
            # Until something is added to it.
            self.left_out[it.name] = it.stamp
            self.refused.discard(it.name)
        # Whose line it was that was cut off, has completed it now; or whoever else had begun it.
        for waiting in list(self.waiting.values()):
            self._append(*waiting)
        if self.waiting:
            self._tell("warning", self.unfinished)
        else:
            self.told.pop("warning", None)

    def _is_new(self, it: Candidate) -> bool:
        """Whether it is neither in the table, nor waits to be, nor was left out as it is."""
        return it.name not in self.done and it.name not in self.waiting and self.left_out.get(it.name) != it.stamp

    def _try(self, it: Candidate) -> None:
        try:
            self._take(it)
        except MissingExtraError:
            raise
        except Error as error:
            self._refuse(it, f"left out: {error}")
        except (ArithmeticError, LookupError, ValueError) as error:
            # One recording that nobody has thought of does not hold up the others.
            self._refuse(it, f"left out: it cannot be taken ({type(error).__name__}: {error}), which is a fault of this program")

    def _refuse(self, it: Candidate, what: str) -> None:
        """Leave it until it changes."""
        self.left_out[it.name] = it.stamp
        self.refused.add(it.name)
        self._tell(it.name, what)

    def _stands(self, it: Candidate) -> bool:
        """Whether nobody writes it any more: its files have not changed for as long as ``--settle`` says."""
        settle = float(self.args.settle)
        if it.age_s() >= settle:
            return True
        stamp, since = self.since.get(it.name, (None, 0.0))
        if stamp != it.stamp:
            self.since[it.name] = it.stamp, time.monotonic()
            return settle == 0.0
        return time.monotonic() - since >= settle

    def _take(self, it: Candidate) -> None:
        from ..recordings import moments
        from ..recordings.following import RECORDING, TIME, date
        from ..recordings.taken import taken
        from ..recordings.write import cells, titles

        said: list[str] = []
        recording = it.open(self.args.stamps)
        try:
            found = taken(recording, self.args, said.append)
            began = recording.began()
        finally:
            recording.close()
        for sensor in found.sensors:
            if sensor.kind == "pose" and self.args.mounted is None:
                what = f"{sensor.name} is a pose, and a short recording may not tell whether its sensor is on the hand"
                raise wrong("mounted", what, "say --mounted hand or --mounted beside")
        # Joints may be stamped by a clock that does not know the date.
        first = float(found.joints.times[0])
        rows = [[it.name, date(began + row.start - first), *cells(row, found.sensors, found.on_hand)] for row in found.kept]
        if self.args.verbose:
            print("\n".join(said))
        left_out = "; ".join(f"{count} left out: {why}" for why, count in moments.tally(found.rows).most_common())
        found.check()
        columns = [RECORDING, TIME, *titles(found.joints.names, found.sensors)]
        warnings = "".join(f"\n  {line.strip()}" for line in said if line.strip().startswith("warning"))
        self._append(it, columns, rows, (f"; {left_out}" if left_out else "") + warnings)

    def _append(self, it: Candidate, columns: list[str], rows: list[list[str]], words: str) -> None:
        """Add rows to the table, or keep them until its last line is ended."""
        from ..recordings.following import Unfinished

        try:
            added = len(rows) if self.table is None else self.table.append(columns, rows)
        except Unfinished as error:
            self.waiting[it.name] = it, columns, rows, words
            self.unfinished = str(error)
            return
        self.waiting.pop(it.name, None)
        self.done.add(it.name)
        self.refused.discard(it.name)
        self.added += added
        if it.name != self.last or added:
            print(f"{it.name}: {added} rows{words}", flush=True)

    def _tell(self, name: str, what: str) -> None:
        """Say it once."""
        if self.told.get(name) != what:
            self.told[name] = what
            print(f"{name}: {what}", flush=True)


def _there(path: Path) -> list[str]:
    """The recordings of a table that is not written to."""
    from ..recordings.following import recordings_of

    return recordings_of(path) if path.exists() else []
