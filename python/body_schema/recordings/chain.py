"""The chain of a URDF as described: which joints a table needs, and about where the hand is."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection
from dataclasses import dataclass
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from .._errors import FieldError
from .._words import text_of_urdf

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Joint:
    """A joint of a URDF. ``origin`` (4 × 4) is its frame in that of its parent link; ``axis`` a unit vector in its own frame."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axis: Array
    follows: tuple[str, float, float] | None
    """The joint that it mimics, with multiplier and offset."""

    @property
    def moves(self) -> bool:
        return self.kind in ("revolute", "continuous", "prismatic")


class Description:
    """The joints and links of a URDF, given as text or by the path of its file.

    Raises ``FieldError`` where it is no URDF of a tree.
    """

    def __init__(self, urdf: str | PathLike[str]) -> None:
        self.text = text_of_urdf(urdf)
        try:
            root = ElementTree.fromstring(self.text.lstrip("\ufeff \t\r\n"))
        except ElementTree.ParseError as error:
            raise _wrong("urdf", f"no XML: {error}", "name the URDF of the robot") from None
        if root.tag != "robot":
            raise _wrong("urdf", f"its outermost element is <{root.tag}>", "name a URDF, which has <robot>; run xacro first")
        self.name = root.get("name") or "robot"
        self.links = [link.get("name", "") for link in root.findall("link")]
        self.joints = {joint.name: joint for joint in map(_joint, root.findall("joint"))}
        self._above = {joint.child: joint for joint in self.joints.values()}

    def base(self) -> str:
        """The link that hangs on nothing."""
        roots = [link for link in self.links if link not in self._above]
        if len(roots) != 1:
            raise _wrong("base", f"{len(roots)} links hang on nothing: {', '.join(roots) or 'none'}", "name one with --base")
        return roots[0]

    def chain(self, base: str, tip: str) -> list[Joint]:
        """The joints from ``base`` to ``tip``, base first, fixed ones too."""
        for field, link in (("base", base), ("tip", tip)):
            if link not in self.links:
                raise _wrong(field, f"the URDF has no link `{link}`", f"name one of {', '.join(self.links)}")
        chain: list[Joint] = []
        link = tip
        while link != base:
            joint = self._above.get(link)
            if joint is None or len(chain) > len(self.joints):
                raise _wrong("tip", f"no chain of joints leads from `{base}` to `{tip}`", "name a tip that hangs on the base")
            chain.append(joint)
            link = joint.parent
        return chain[::-1]

    def tip(self, base: str, recorded: Collection[str]) -> str:
        """The end of the longest chain whose joints are all ``recorded``; it is asked for where two are equally long."""
        best: list[str] = []
        most = 0
        for link in self.links:
            try:
                reads = self.reads(self.chain(base, link))
            except FieldError:
                continue
            if not reads or not set(reads) <= set(recorded):
                continue
            if any(joint.parent == link and not joint.moves for joint in self.joints.values()):
                # A frame that is fixed on this link is further out.
                continue
            if len(reads) > most:
                best, most = [link], len(reads)
            elif len(reads) == most:
                best.append(link)
        if not best:
            raise _names(self.moving(), recorded)
        if len(best) > 1:
            raise _wrong("tip", f"{len(best)} links are ends of equally long chains: {', '.join(best)}", "name one with --tip")
        return best[0]

    def moving(self) -> list[str]:
        """The joints that move and follow no other."""
        return [joint.name for joint in self.joints.values() if joint.moves and joint.follows is None]

    def reads(self, chain: list[Joint]) -> list[str]:
        """The joints whose columns a table of this chain has, base first: those that move; for one that mimics, the one it follows."""
        names = (joint.follows[0] if joint.follows else joint.name for joint in chain if joint.moves)
        return list(dict.fromkeys(names))

    def needs(self, chain: list[Joint], recorded: Collection[str]) -> list[str]:
        """``reads``, refused where one of them is not ``recorded``."""
        reads = self.reads(chain)
        if not reads:
            raise _wrong("tip", "no joint between base and tip moves", "name other links with --base and --tip")
        if any(name not in recorded for name in reads):
            raise _names(reads, recorded)
        return reads

    def hand(self, chain: list[Joint], positions: Array) -> tuple[Array, Array]:
        """Where the tip is in the frame of the base, as described: rotations (N × 3 × 3) and places (N × 3, m).

        ``positions`` (N × n) are those of ``reads``, rad and m.
        """
        column = {name: positions[:, index] for index, name in enumerate(self.reads(chain))}
        turned = np.broadcast_to(np.eye(3), (len(positions), 3, 3)).copy()
        place = np.zeros((len(positions), 3))
        for joint in chain:
            place = place + turned @ joint.origin[:3, 3]
            turned = turned @ joint.origin[:3, :3]
            if not joint.moves:
                continue
            if joint.follows:
                name, multiplier, offset = joint.follows
                position = column[name] * multiplier + offset
            else:
                position = column[joint.name]
            if joint.kind == "prismatic":
                place = place + (turned @ joint.axis) * position[:, None]
            else:
                turned = turned @ _turns(joint.axis, position)
        return turned, place


def _turns(axis: Array, angles: Array) -> Array:
    """Rotations about an axis, N × 3 × 3."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, versine = np.sin(angles)[:, None, None], (1.0 - np.cos(angles))[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))


def _joint(element: ElementTree.Element) -> Joint:
    name = element.get("name", "")

    def link(kind: str) -> str:
        found = element.find(kind)
        named = None if found is None else found.get("link")
        if not named:
            raise _wrong(f"joint {name}", f"it has no <{kind} link=…>", "mend the URDF")
        return named

    def numbers(tag: str, key: str, default: list[float]) -> Array:
        found = element.find(tag)
        text = None if found is None else found.get(key)
        try:
            values = default if text is None else [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != 3 or not all(map(math.isfinite, values)):
            raise _wrong(f"joint {name}", f"<{tag} {key}=…> is not three numbers: {text}", "mend the URDF")
        return np.array(values)

    def number(found: ElementTree.Element, key: str, default: float) -> float:
        try:
            return float(found.get(key, default))
        except ValueError:
            raise _wrong(f"joint {name}", f"<mimic {key}=…> is no number: {found.get(key)}", "mend the URDF") from None

    axis = numbers("axis", "xyz", [1.0, 0.0, 0.0])
    kind = element.get("type", "fixed")
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        if kind in ("revolute", "continuous", "prismatic"):
            raise _wrong(f"joint {name}", "its axis is zero", "mend the URDF")
        length = 1.0
    roll, pitch, yaw = numbers("origin", "rpy", [0.0, 0.0, 0.0])
    origin = np.eye(4)
    for direction, angle in (([0.0, 0.0, 1.0], yaw), ([0.0, 1.0, 0.0], pitch), ([1.0, 0.0, 0.0], roll)):
        origin[:3, :3] = origin[:3, :3] @ _turns(np.array(direction), np.array([angle]))[0]
    origin[:3, 3] = numbers("origin", "xyz", [0.0, 0.0, 0.0])
    mimic = element.find("mimic")
    follows = None
    if mimic is not None:
        follows = (mimic.get("joint", ""), number(mimic, "multiplier", 1.0), number(mimic, "offset", 0.0))
    return Joint(name, kind, link("parent"), link("child"), origin, axis / length, follows)


def _names(wanted: list[str], recorded: Collection[str]) -> FieldError:
    missing = [name for name in wanted if name not in recorded]
    other = [name for name in recorded if name not in wanted]
    what = f"{', '.join(missing)} of the URDF not in the recording, which has {', '.join(recorded) or 'no joints'}"
    example = f"--rename {other[0]}={missing[0]}" if other and missing else "--rename RECORDED=URDF"
    return _wrong("joints", what, f"say which is which, as {example}, or name a shorter chain with --tip")


def _wrong(field: str, what: str, mend: str) -> FieldError:
    return FieldError(f"`{field}`: {what}; {mend}", field, what, mend)
