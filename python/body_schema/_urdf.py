"""A URDF's tree of joints."""

from __future__ import annotations

import math
import xml.etree.ElementTree as xml
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ._errors import wrong
from ._transforms import Pose, Vector, about, of_quaternion, of_rpy, unit, vector

MOVING = ("revolute", "continuous", "prismatic")


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
    follows: tuple[str, float, float] | None = None
    """The joint that it mimics, with multiplier and offset."""

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
    name: str
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
            if kind in MOVING:
                raise wrong(f"{field}: axis", "it is zero", "write a direction")
            axis = [1.0, 0.0, 0.0]
        follows = None
        if (mimic := element.find("mimic")) is not None:
            its = [floats(mimic.get(key, usual), 1, f"{field}: mimic {key}")[0] for key, usual in (("multiplier", "1"), ("offset", "0"))]
            follows = (mimic.get("joint", ""), its[0], its[1])
        joints[name] = above[ends[1]] = Joint(name, kind, ends[0], ends[1], Pose(rotation, at), unit(axis), follows)
    for link in links:
        walked, at_link = 0, link
        while at_link in above:
            at_link, walked = above[at_link].parent, walked + 1
            if walked > len(above):
                raise wrong(source, f"`{link}` hangs on itself", "correct <parent> and <child>")
    return Tree(source, root.get("name") or "robot", joints, above, links)
