"""Origins of joints in a user's xacro."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from .._errors import wrong
from .._transforms import number, rpy_of
from .._urdf import Tree
from ._edit import Edit, Element, edited, parse_xml

PART = re.compile(r"(?:\$\{[^}]*\}|\$\([^)]*\)|[^\s$])+")
PROPERTY = re.compile(r"^\$\{\s*([A-Za-z_]\w*)\s*\}$")
EXPRESSION = re.compile(r"\$\{[^}]*\}|\$\([^)]*\)")


def _fits(written: str, name: str) -> bool:
    """Whether a name with expressions, as ``${prefix}joint1``, may be this one."""
    fixed = EXPRESSION.split(written)
    return re.fullmatch(".*".join(map(re.escape, fixed)), name) is not None


def _line(text: str, element: Element) -> int:
    return text.count("\n", 0, element.start) + 1


def xacro(
    after: Tree, text: str, *, joints: Sequence[str] | None = None, source: str = "xacro"
) -> tuple[str, list[str], list[str]]:
    """A xacro with the origins of a calibrated description, where they are numbers.

    ``joints`` are those to write (default: all that move). A number is written in its place, or in that of the ``xacro:property`` of the same
    file that stands for it and for nothing else; where another expression stands, what to set by hand is told. Gives the new text, what is to be set by hand,
    and what is to be said. Raises ``FieldError`` where the file has none of the joints, or where a joint cannot be told from another.
    """
    root = parse_xml(text, source)
    elements = [it for it in root.walk() if it.tag == "joint" and "name" in it.attributes and _has_origin_or_ends(it)]
    properties = {it.attributes.get("name"): it for it in root.walk() if it.tag.endswith(":property")}
    edits: list[Edit] = []
    by_hand: list[str] = []
    said: list[str] = []
    used: dict[int, str] = {}
    for name in joints if joints is not None else [it.name for it in after.joints.values() if it.moves]:
        exact = [it for it in elements if it.attributes["name"] == name]
        found = exact or [it for it in elements if "$" in it.attributes["name"] and _fits(it.attributes["name"], name)]
        # `${prefix}joint1` fits more closely than `${name}`.
        closest = max((len(EXPRESSION.sub("", it.attributes["name"])) for it in found), default=0)
        found = [it for it in found if len(EXPRESSION.sub("", it.attributes["name"])) == closest]
        if not found:
            said.append(f"{name}: the file has no such joint")
            continue
        if len(found) > 1 or found[0].start in used:
            lines = [str(_line(text, it)) for it in found]
            what = f"{name} may be each of them" if len(found) > 1 else f"{used[found[0].start]} and {name} are this joint"
            raise wrong(f"{source}: line {', '.join(lines)}", what, "write the joints one by one, or name another file")
        used[found[0].start] = name
        _origin(after, name, found[0], text, properties, edits, by_hand, said)
    if not used:
        raise wrong(source, "it has none of the joints", "name the file with the joints' <origin>")
    return edited(text, edits), by_hand, said


def _has_origin_or_ends(element: Element) -> bool:
    """Whether it places a link, and is no joint of a transmission or of a controller."""
    return any(it.tag in ("origin", "parent", "child") for it in element.children)


def _origin(
    after: Tree,
    name: str,
    element: Element,
    text: str,
    properties: dict[str | None, Element],
    edits: list[Edit],
    by_hand: list[str],
    said: list[str],
) -> None:
    place = after.joints[name].origin
    origins = [it for it in element.children if it.tag == "origin"]
    line = _line(text, element)
    if not origins or "quat_xyzw" in origins[0].attributes:
        xyz, rpy = (" ".join(map(number, its)) for its in (place.at, rpy_of(place.rotation)))
        what = "a quaternion" if origins else "no <origin> of its own"
        by_hand.append(f'{name} (line {line}) has {what}: write <origin xyz="{xyz}" rpy="{rpy}"/>')
        return
    origin = origins[0]
    for attribute in ("xyz", "rpy"):
        written = origin.attributes.get(attribute, "0 0 0")
        parts = list(PART.finditer(written))
        near = [0.0, 0.0, 0.0]
        for k, part in enumerate(parts[:3]):
            near[k] = _number(part[0], properties)
        values = place.at if attribute == "xyz" else rpy_of(place.rotation, near)
        if attribute not in origin.spans:
            if any(abs(it) > 0 for it in values):
                edits.append(origin.set(attribute, " ".join(map(number, values))))
            continue
        start = origin.spans[attribute][1]
        raw = text[start : origin.spans[attribute][2]]
        if len(parts) != 3 or raw != written:
            whole = " ".join(map(number, values))
            by_hand.append(f"{name} (line {line}): {attribute} is {written!r}; it must be {whole}")
            continue
        for axis, part, value in zip(("x", "y", "z") if attribute == "xyz" else ("roll", "pitch", "yaw"), parts, values):
            try:
                if float(part[0]) != value:
                    edits.append((start + part.start(), start + part.end(), number(value)))
                continue
            except ValueError:
                pass
            alone = PROPERTY.match(part[0])
            if alone is None:
                by_hand.append(f"{name} (line {line}): {axis} is {part[0]}; it must be {number(value)}")
            else:
                its = properties.get(alone[1])
                if its is not None and _is_own(alone[1], its, text):
                    if float(its.attributes["value"]) != value:
                        edits.append(its.set("value", number(value)))
                        said.append(f"{name}: the property {alone[1]} (line {_line(text, its)}), which nothing else in this file uses, is {number(value)} now")
                    continue
                where = "" if its is None else f" (line {_line(text, its)})"
                by_hand.append(f"{name} (line {line}): {axis} is the property {alone[1]}{where}; set it to {number(value)}")


def _is_own(name: str, its: Element, text: str) -> bool:
    """Whether a property is a number in its place, and stands for nothing but the one part that uses it."""
    try:
        float(its.attributes.get("value", ""))
    except ValueError:
        return False
    uses = sum(len(re.findall(rf"\b{re.escape(name)}\b", it)) for it in EXPRESSION.findall(text))
    defined = len(re.findall(rf"<xacro:property\b[^>]*\bname\s*=\s*([\"']){re.escape(name)}\1", text))
    return uses == 1 and defined == 1 and "value" in its.spans


def _number(text: str, properties: dict[str | None, Element]) -> float:
    """A number, or that of a property; 0 where it is another expression."""
    alone = PROPERTY.match(text)
    if alone is not None and alone[1] in properties:
        text = properties[alone[1]].attributes.get("value", "")
    try:
        value = float(text)
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0
