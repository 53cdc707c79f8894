"""What a calibration wrote."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from .._errors import wrong
from .._urdf import Tree, parse_urdf


def read_text(path: str | PathLike[str]) -> str:
    """The text of a file in UTF-8, its line ends as they are."""
    path = Path(path)
    if path.is_dir():
        raise wrong(str(path), "it is a folder", "name a file")
    try:
        return path.read_bytes().decode("utf-8")
    except UnicodeDecodeError:
        raise wrong(str(path), "it is no text in UTF-8", "name a text file") from None


@dataclass(frozen=True)
class Calibrated:
    """What a calibration found: its description, where it has one, and its report, where a folder was named."""

    source: Path
    urdf: Path | None
    report: Mapping[str, Any] | None

    def tree(self) -> Tree:
        """The joints of the calibrated description."""
        if self.urdf is None:
            raise wrong(str(self.source), "it has no calibrated.urdf", "calibrate with a URDF, or name a URDF")
        return parse_urdf(read_text(self.urdf), str(self.urdf))

    def need_report(self) -> Mapping[str, Any]:
        """The report. Raises ``FieldError`` where only a URDF was named."""
        if self.report is None:
            raise wrong(str(self.source), "places are in report.json", "name the folder that `calibrate` wrote")
        return self.report

    def learned(self, tree: Tree) -> list[str]:
        """The joints that may have changed: those of the report, or all that move."""
        if self.report is not None and isinstance(its := self.report.get("joints"), list):
            names = [it["name"] for it in its if isinstance(it, dict) and it.get("name") in tree.joints]
            if names:
                return names
        return [name for name, joint in tree.joints.items() if joint.moves]


def read_calibrated(path: str | PathLike[str]) -> Calibrated:
    """A folder that ``body-schema calibrate`` wrote, or a calibrated URDF. Raises ``FieldError`` where it is neither."""
    path = Path(path)
    if not path.is_dir():
        if not path.exists():
            raise wrong(str(path), "there is no such folder or file", "name the folder that `calibrate` wrote, or a URDF")
        return Calibrated(path, path, None)
    urdf, said = path / "calibrated.urdf", path / "report.json"
    if not said.exists():
        raise wrong(str(path), "it has no report.json", "name the folder that `calibrate` wrote, or a URDF")
    try:
        report = json.loads(read_text(said))
    except (ValueError, RecursionError) as error:
        raise wrong(str(said), f"it is no JSON ({error})", "calibrate again") from None
    if not isinstance(report, dict):
        raise wrong(str(said), "it is no report", "calibrate again")
    return Calibrated(path, urdf if urdf.exists() else None, report)
