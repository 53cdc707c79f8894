"""Bodies of a user's MJCF at the origins of a calibrated description."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from .._errors import wrong
from .._transforms import (
    EYE,
    Matrix,
    Pose,
    Vector,
    about,
    angle_between,
    cross,
    dot,
    euler,
    euler_order,
    least_turn,
    number,
    of_euler,
    of_quaternion,
    quaternion,
    rotation_vector,
    transposed,
    turned,
    unit,
    vector,
)
from .._urdf import Tree, floats
from ._edit import Edit, Element, edited, parse_xml

TURNS = ("quat", "euler", "axisangle", "xyaxes", "zaxis")

SAME_M, SAME_RAD = 1e-9, 1e-9
FAR_M, FAR_RAD = 0.05, math.radians(20.0)
"""What no calibration changes."""


@dataclass(frozen=True)
class Compiler:
    """How an MJCF writes angles: ``scale`` takes them to radians, ``sequence`` are the axes of ``euler``."""

    scale: float
    sequence: str

    def rotation(self, element: Element, source: str) -> Matrix:
        """The rotation that an element has."""
        written = [it for it in TURNS if it in element.attributes]
        field = f"{source}: {_called(element)}"
        if len(written) > 1:
            raise wrong(field, f"it is turned twice, by {' and '.join(written)}", "leave one")
        if not written:
            return EYE
        counts = {"quat": 4, "euler": 3, "axisangle": 4, "xyaxes": 6, "zaxis": 3}
        values = floats(element.attributes[written[0]], counts[written[0]], f"{field}: {written[0]}")
        if written[0] == "euler":
            return of_euler(self.sequence, [it * self.scale for it in values])
        try:
            if written[0] == "quat":
                return of_quaternion(values)
            if written[0] == "axisangle":
                return about(values[:3], values[3] * self.scale)
            if written[0] == "zaxis":
                return least_turn(EYE[2], values)
            x = unit(values[:3])
            y = unit([b - dot(x, values[3:]) * a for a, b in zip(x, values[3:])])
            return transposed((x, y, cross(x, y)))
        except ZeroDivisionError:
            raise wrong(f"{field}: {written[0]}", "a length in it is zero", "write a rotation") from None

    def changed(self, element: Element, was: Matrix, now: Matrix, source: str) -> Edit:
        """The change that turns an element from one rotation to another, in the words that it has."""
        word = next((it for it in TURNS if it in element.attributes), "quat")
        old = floats(element.attributes[word], None, source) if word in element.attributes else []
        values: Sequence[float]
        if word == "euler":
            angles = euler(self.sequence, now, [it * self.scale for it in old])
            values = [it / self.scale for it in angles]
        elif word == "axisangle":
            turn = rotation_vector(now)
            angle = math.hypot(*turn)
            axis = vector([it / angle for it in turn]) if angle else vector(old[:3])
            # The axis stays on its side.
            side = -1.0 if dot(axis, old[:3]) < 0 else 1.0
            values = [*(side * it for it in axis), side * angle / self.scale]
        elif word == "xyaxes":
            columns = transposed(now)
            values = [*columns[0], *columns[1]]
        else:
            values = quaternion(now)
            if word == "quat" and old and dot(values, old) < 0:
                values = [-it for it in values]
        text = " ".join(map(number, values))
        if word == "zaxis":
            # It leaves the turn about z open, which a calibration does not.
            start, _, end = element.spans[word]
            return (start, end + 1, f'quat="{text}"')
        return element.set(word, text)


def _called(element: Element) -> str:
    name = element.attributes.get("name")
    return f"<{element.tag}>" if name is None else f"{element.tag} `{name}`"


class _Model:
    """An MJCF's bodies by name, with compiler settings and defaults."""

    def __init__(self, text: str, source: str) -> None:
        self.source = source
        self.root = parse_xml(text, source)
        if self.root.tag != "mujoco":
            raise wrong(source, f"it begins with <{self.root.tag}>, not with <mujoco>", "name an MJCF")
        settings: dict[str, str] = {}
        for element in self.root.children:
            if element.tag == "compiler":
                settings |= element.attributes
        if settings.get("coordinate", "local") != "local":
            raise wrong(f"{source}: compiler", "its coordinates are global", "write it with local ones, as MuJoCo saves it")
        sequence = settings.get("eulerseq", "xyz")
        order = euler_order(sequence)[1] if len(sequence) == 3 and set(sequence.lower()) <= set("xyz") else [0, 0, 0]
        # The same axis twice in succession leaves a direction out.
        if order[0] == order[1] or order[1] == order[2]:
            raise wrong(f"{source}: compiler eulerseq", f"{sequence!r} is no sequence of axes", "write three of x, y, z, X, Y, Z")
        self.compiler = Compiler(1.0 if settings.get("angle", "degree") == "radian" else math.pi / 180, sequence)
        self.included = [it.attributes.get("file", "") for it in self.root.walk() if it.tag == "include"]
        self.defaults: dict[str, dict[str, str]] = {}
        for element in self.root.children:
            if element.tag == "default":
                self._read_defaults(element, {}, is_top=True)
        self.bodies: dict[str, Element] = {}
        for element in self.root.walk():
            if element.tag == "body" and "name" in element.attributes:
                if element.attributes["name"] in self.bodies:
                    raise wrong(source, f"two bodies are called `{element.attributes['name']}`", "give each a name of its own")
                self.bodies[element.attributes["name"]] = element

    def _read_defaults(self, element: Element, above: Mapping[str, str], is_top: bool = False) -> None:
        its = dict(above)
        for child in element.children:
            if child.tag == "joint":
                its |= child.attributes
        name = element.attributes.get("class", "main" if is_top else "")
        self.defaults[name] = its
        if is_top:
            self.defaults["main"] = its
        for child in element.children:
            if child.tag == "default":
                self._read_defaults(child, its)

    def joint(self, element: Element) -> dict[str, str]:
        """The attributes of a joint, with those of its class."""
        name = element.attributes.get("class")
        above = element.parent
        while name is None and above is not None:
            name, above = above.attributes.get("childclass"), above.parent
        if name is not None and name not in self.defaults and not self.included:
            raise wrong(f"{self.source}: {_called(element)}", f"there is no class `{name}`", "correct it")
        return {**self.defaults.get(name or "main", self.defaults.get("main", {})), **element.attributes}

    def local(self, element: Element) -> Pose:
        """The pose of a body or a frame in what it stands in, without its joints."""
        at = [0.0, 0.0, 0.0]
        if "pos" in element.attributes:
            at = floats(element.attributes["pos"], 3, f"{self.source}: {_called(element)}: pos")
        return Pose(self.compiler.rotation(element, self.source), vector(at))

    def up(self, body: Element, named: Mapping[str, str]) -> tuple[Pose, Element | None]:
        """The pose of what a body stands in, in the next body above with a link, and that body; ``None`` for the world."""
        pose, above = Pose(), body.parent
        while above is not None and above.tag not in ("worldbody", "mujoco"):
            if above.tag == "body" and above.attributes.get("name") in named:
                return pose, above
            if above.tag not in ("body", "frame"):
                raise wrong(f"{self.source}: {_called(body)}", f"it stands in a <{above.tag}>", "write the bodies one by one")
            if any(it.tag in ("joint", "freejoint") for it in above.children):
                what = f"{_called(above)} above it moves, and has no link"
                raise wrong(f"{self.source}: {_called(body)}", what, "say which link it is: --body LINK=BODY")
            pose = self.local(above) @ pose
            above = above.parent
        return pose, None


def mjcf(
    after: Tree,
    text: str,
    *,
    bodies: Mapping[str, str] | None = None,
    before: Tree | None = None,
    base: str | None = None,
    source: str = "MJCF",
) -> tuple[str, list[str]]:
    """An MJCF whose bodies stand where a calibrated description has their links.

    A body is the link of its name, or that of ``bodies`` (body by link). Places and rotations are written in the words that the file
    has (``pos``, and ``quat``, ``euler``, ``axisangle`` or ``xyaxes``; ``zaxis`` becomes ``quat``), with its ``compiler`` and ``default``;
    joints and all else stay. Frames are taken to be those of the links; where they are others, ``before``, the description that was
    calibrated, tells by how much. ``base`` is the link that the world stands for where no body is it (default: the root). Gives
    the new text, and what is to be said. Raises ``FieldError`` where joints or frames do not fit.
    """
    model = _Model(text, source)
    named: dict[str, str] = {}
    for link, body in (bodies or {}).items():
        if link not in after.links:
            raise wrong("--body", f"there is no link `{link}`", f"links are {', '.join(after.links)}")
        if body not in model.bodies:
            more = f"; it includes {', '.join(model.included)}" if model.included else ""
            raise wrong("--body", f"there is no body `{body}`{more}", f"bodies are {', '.join(model.bodies) or 'none'}")
        if body in named:
            raise wrong("--body", f"the body `{body}` is two links", "name each once")
        named[body] = link
    told = set(named.values())
    named |= {body: body for body in model.bodies if body in after.links and body not in named and body not in told}
    if not named:
        more = f"; it includes {', '.join(model.included)}" if model.included else ""
        raise wrong(source, f"no body has the name of a link{more}", "say which is which: --body LINK=BODY")
    shifted: dict[str, Pose] = {}
    edits: list[Edit] = []
    moved: set[str] = set()
    said: list[str] = []
    for body, element in _downwards(model.root, named):
        outer, above = model.up(element, named)
        link = named[body]
        if above is None:
            start = (base or _root(after)) if link != base else link
            if link == start or not after.path(link):
                # The base itself: where it stands in the world is the user's.
                shifted[body] = Pose()
                continue
            carrier = _world(model, element, outer, before, link, start)
        else:
            parent = above.attributes["name"]
            start, carrier = named[parent], shifted[parent]
        joints = after.path(link, start)
        moved |= {it.name for it in joints if it.moves}
        was = model.local(element)
        turning = [it for it in joints if it.moves]
        if len(turning) > 1:
            what = f"{len(turning)} joints lie between it and what it stands on: {', '.join(it.name for it in turning)}"
            raise wrong(f"{source}: body `{body}`", what, "say which body each of their links is: --body LINK=BODY")
        inside = Pose()
        # Of frames behind the joint the first is that of the joint; what is fixed to it is part of the body's frame.
        for joint in joints[joints.index(turning[0]) + 1 :] if turning else []:
            inside = inside @ joint.origin
        origin = Pose()
        for joint in joints[: joints.index(turning[0]) + 1] if turning else joints:
            origin = origin @ joint.origin
        ref = _ref(model, element, turning[0].name if turning else None, after)
        neutral = turning[0].motion(ref) if turning else Pose()
        if before is not None:
            old = before.pose(link, start, {turning[0].name: ref} if turning else None)
            shifted[body] = old.inverse() @ carrier @ outer @ was
        else:
            shifted[body] = Pose()
        at_link = origin @ neutral @ inside
        now = outer.inverse() @ carrier.inverse() @ at_link @ shifted[body]
        if turning:
            said += _fit(model, element, turning[0].axis, turning[0].kind, inside @ shifted[body], turning[0].name)
        if math.dist(was.at, now.at) > FAR_M or angle_between(was.rotation, now.rotation) > FAR_RAD:
            far, turn = math.dist(was.at, now.at) * 1e3, math.degrees(angle_between(was.rotation, now.rotation))
            what = f"it stands {far:.0f} mm and {turn:.0f} degrees from its link `{link}`"
            mend = "name the URDF that was calibrated: --original" if before is None else "name the right body: --body LINK=BODY"
            raise wrong(f"{source}: body `{body}`", what, mend)
        if math.dist(was.at, now.at) > 1e-12:
            edits.append(element.set("pos", " ".join(map(number, now.at))))
        if angle_between(was.rotation, now.rotation) > 1e-12:
            edits.append(model.compiler.changed(element, was.rotation, now.rotation, source))
    for joint in after.joints.values():
        if joint.moves and joint.name not in moved and (before is None or before.joints.get(joint.name) != joint):
            said.append(f"{joint.name}: no body is `{joint.child}`; it stays as it is")
    return edited(text, edits), said


def _root(tree: Tree) -> str:
    return next(link for link in tree.links if link not in tree.above)


def _downwards(root: Element, named: Mapping[str, str]) -> Iterator[tuple[str, Element]]:
    for element in root.walk():
        if element.tag == "body" and element.attributes.get("name", "") in named:
            yield element.attributes["name"], element


def _world(model: _Model, element: Element, outer: Pose, before: Tree | None, link: str, start: str) -> Pose:
    """The frame of the world in the base link: that of the base, or as the first body stands."""
    if before is None:
        return Pose()
    name = next((it.name for it in before.path(link, start) if it.moves), None)
    ref = _ref(model, element, name, before)
    stands = outer @ model.local(element)
    return before.pose(link, start, {name: ref} if name else None) @ stands.inverse()


def _joints(element: Element) -> list[Element]:
    return [it for it in element.children if it.tag in ("joint", "freejoint")]


def _ref(model: _Model, element: Element, name: str | None, tree: Tree) -> float:
    """The reading (rad, m) at which a body stands as it is written."""
    its = _joints(element)
    field = f"{model.source}: {_called(element)}"
    if name is None:
        if its:
            raise wrong(field, "it moves, and its link does not", "name the right body: --body LINK=BODY")
        return 0.0
    if len(its) != 1 or its[0].tag == "freejoint":
        raise wrong(field, f"it has {len(its)} joints, and its link hangs on {name} alone", "name the right body: --body LINK=BODY")
    attributes = model.joint(its[0])
    kind = attributes.get("type", "hinge")
    wanted = "slide" if tree.joints[name].kind == "prismatic" else "hinge"
    if kind != wanted:
        raise wrong(field, f"its joint is a {kind}, and {name} is a {wanted}", "name the right body: --body LINK=BODY")
    ref = floats(attributes.get("ref", "0"), 1, f"{field}: ref")[0]
    return ref * (model.compiler.scale if wanted == "hinge" else 1.0)


def _fit(model: _Model, element: Element, axis: Vector, kind: str, frame: Pose, name: str) -> list[str]:
    """Refuses a joint whose axis is not that of the description; ``frame`` is the body's in that of the joint."""
    attributes = model.joint(_joints(element)[0])
    field = f"{model.source}: {_called(element)}"
    its = unit(floats(attributes.get("axis", "0 0 1"), 3, f"{field}: axis"))
    inside = turned(transposed(frame.rotation), axis)
    off = math.atan2(math.hypot(*cross(its, inside)), dot(its, inside))
    anchor = vector(floats(attributes.get("pos", "0 0 0"), 3, f"{field}: joint pos"))
    zero = frame.inverse().at
    aside = math.hypot(*cross(vector([a - b for a, b in zip(anchor, zero)]), inside)) if kind != "prismatic" else 0.0
    if off > 0.01 or aside > 0.001:
        what = f"the axis of its joint is {math.degrees(off):.1f} degrees and {aside * 1e3:.1f} mm from that of {name}"
        raise wrong(field, what, "name the URDF that was calibrated (--original), or the right body (--body LINK=BODY)")
    if off > SAME_RAD or aside > SAME_M:
        return [f"{name}: the file's axis is {off * 1e3:.3g} mrad and {aside * 1e3:.3g} mm from the description's, which stays so"]
    return []
