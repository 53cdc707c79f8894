"""A URDF's tree of joints, and what a calibration wrote."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as xml
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from .._errors import FieldError
from ._transforms import Pose, Vector, about, of_quaternion, of_rpy, unit, vector

MOVING = ("revolute", "continuous", "prismatic")


def wrong(field: str, what: str, mend: str) -> FieldError:
    """The error of a field: what is wrong with it, and how to mend it."""
    return FieldError(f"`{field}`: {what}; {mend}", field, what, mend)


def read_text(path: str | PathLike[str]) -> str:
    """The text of a file in UTF-8, its line ends as they are."""
    path = Path(path)
    if path.is_dir():
        raise wrong(str(path), "it is a folder", "name a file")
    try:
        return path.read_bytes().decode("utf-8")
    except UnicodeDecodeError:
        raise wrong(str(path), "it is no text in UTF-8", "name a text file") from None


def floats(text: str, count: int | None, field: str) -> list[float]:
    """The finite numbers of an attribute; ``count`` of them where it is given."""
    try:
        values = [float(it) for it in text.split()]
    except ValueError:
        values = []
    if not values or not all(map(math.isfinite, values)) or count not in (None, len(values)):
        raise wrong(field, f"{text!r} is not {count or 'a list of'} numbers", "correct it")
    return values


@dataclass(frozen=True)
class Joint:
    """A joint of a URDF: its ``origin`` in the parent link's frame (m), its ``axis`` (unit vector) in its own frame."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Pose
    axis: Vector

    @property
    def moves(self) -> bool:
        """Whether it turns or slides."""
        return self.kind in MOVING

    def motion(self, value: float) -> Pose:
        """What it does at a reading (rad or m)."""
        if self.kind == "prismatic":
            return Pose(at=vector([it * value for it in self.axis]))
        return Pose(about(self.axis, value)) if self.moves else Pose()


@dataclass(frozen=True)
class Tree:
    """The joints of a URDF by name, and by the link that each carries."""

    source: str
    joints: Mapping[str, Joint]
    above: Mapping[str, Joint]
    links: Sequence[str]

    def path(self, tip: str, base: str | None = None) -> list[Joint]:
        """The joints from ``base`` (the root where it is ``None``) to ``tip``, in this order."""
        for link in (tip, base):
            if link is not None and link not in self.links:
                raise wrong(self.source, f"there is no link `{link}`", f"links are {', '.join(self.links)}")
        path: list[Joint] = []
        link = tip
        while link != base and link in self.above:
            path.append(self.above[link])
            link = path[-1].parent
        if base is not None and link != base:
            raise wrong(self.source, f"`{tip}` does not hang on `{base}`", "name a link nearer to the root as base")
        return path[::-1]

    def pose(self, tip: str, base: str | None = None, readings: Mapping[str, float] | None = None) -> Pose:
        """The pose of a link in the frame of ``base`` at readings (rad, m) by joint; a joint that is not named is at 0."""
        pose = Pose()
        for joint in self.path(tip, base):
            pose = pose @ joint.origin @ joint.motion((readings or {}).get(joint.name, 0.0))
        return pose


def parse_urdf(text: str, source: str = "URDF") -> Tree:
    """The joints of a URDF. Raises ``FieldError`` where it is no URDF, or where a joint is broken."""
    try:
        # Only the root decides about the encoding: text is decoded already.
        root = xml.fromstring(text.encode("utf-8"))
    except (xml.ParseError, ValueError, LookupError) as error:
        raise wrong(source, f"it is no XML ({error})", "name a URDF") from None
    if root.tag != "robot":
        raise wrong(source, f"it begins with <{root.tag}>, not with <robot>", "name a URDF")
    links = [it.get("name", "") for it in root.findall("link")]
    joints: dict[str, Joint] = {}
    above: dict[str, Joint] = {}
    for element in root.findall("joint"):
        name, kind = element.get("name", ""), element.get("type", "")
        field = f"{source}: joint `{name}`"
        ends = [it.get("link", "") if (it := element.find(end)) is not None else "" for end in ("parent", "child")]
        if not name or name in joints:
            raise wrong(field, "its name is missing or taken", "give every joint a name of its own")
        if not all(end in links for end in ends):
            raise wrong(field, "it names no link as parent or child", "correct <parent> and <child>")
        if ends[1] in above:
            raise wrong(field, f"`{ends[1]}` hangs on `{above[ends[1]].name}` too", "let a link hang on one joint")
        origin = element.find("origin")
        written = {} if origin is None else origin.attrib
        if any("$" in it for it in written.values()):
            raise wrong(field, "its origin is an expression of xacro", "name the URDF that xacro makes")
        at = vector(floats(written.get("xyz", "0 0 0"), 3, f"{field}: xyz"))
        if "quat_xyzw" in written:
            x, y, z, w = floats(written["quat_xyzw"], 4, f"{field}: quat_xyzw")
            if not any((x, y, z, w)):
                raise wrong(f"{field}: quat_xyzw", "it is zero", "write a rotation")
            rotation = of_quaternion([w, x, y, z])
        else:
            rotation = of_rpy(floats(written.get("rpy", "0 0 0"), 3, f"{field}: rpy"))
        axis_of = element.find("axis")
        axis = [1.0, 0.0, 0.0] if axis_of is None else floats(axis_of.get("xyz", "1 0 0"), 3, f"{field}: axis")
        if not any(axis):
            raise wrong(f"{field}: axis", "it is zero", "write a direction")
        joints[name] = above[ends[1]] = Joint(name, kind, ends[0], ends[1], Pose(rotation, at), unit(axis))
    for link in links:
        walked, at_link = 0, link
        while at_link in above:
            at_link, walked = above[at_link].parent, walked + 1
            if walked > len(above):
                raise wrong(source, f"`{link}` hangs on itself", "correct <parent> and <child>")
    return Tree(source, joints, above, links)


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
