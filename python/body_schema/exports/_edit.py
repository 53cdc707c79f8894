"""Changes in a text: all other characters stay."""

from __future__ import annotations

import re
import xml.parsers.expat
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from .._errors import wrong

Edit = tuple[int, int, str]
"""From where to where, in characters, and what comes there."""


def edited(text: str, edits: Sequence[Edit]) -> str:
    """The text with the changes made, which must not overlap."""
    parts, done = [], 0
    for start, end, value in sorted(edits, key=lambda it: it[:2]):
        parts += [text[done:start], value]
        done = end
    return "".join([*parts, text[done:]])


@dataclass
class Element:
    """An element of an XML text, with the places of its tag and its attributes' values in the text."""

    tag: str
    attributes: dict[str, str]
    start: int
    parent: Element | None
    children: list[Element] = field(default_factory=list)
    spans: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    """By attribute where its name begins, and where its value begins and ends."""
    room: int = 0
    """Behind the tag's name: where an attribute can be added."""

    def walk(self) -> Iterator[Element]:
        """It and all below it, in the order of the text."""
        rest = [self]
        while rest:
            element = rest.pop()
            yield element
            rest += reversed(element.children)

    def set(self, name: str, value: str) -> Edit:
        """The change that gives an attribute a value."""
        if name in self.spans:
            _, start, end = self.spans[name]
            return (start, end, value)
        return (self.room, self.room, f' {name}="{value}"')


DEEPEST = 500

NAME = re.compile(r"<([^\s/>]+)")
ATTRIBUTE = re.compile(r"""\s+([^\s=]+)\s*=\s*("[^"]*"|'[^']*')""")


def parse_xml(text: str, source: str) -> Element:
    """The elements of an XML text. Raises ``FieldError`` where it is none."""
    data = text.encode("utf-8")
    parser = xml.parsers.expat.ParserCreate("utf-8")
    top: list[Element] = []
    open_: list[Element] = []
    # Expat counts bytes.
    whole = len(data) == len(text)
    place: Callable[[int], int] = (lambda it: it) if whole else (lambda it: len(data[:it].decode("utf-8")))

    def begins(tag: str, attributes: dict[str, str]) -> None:
        if len(open_) > DEEPEST:
            raise wrong(source, f"its elements are nested more than {DEEPEST} deep", "name a robot's file")
        start = place(parser.CurrentByteIndex)
        element = Element(tag, dict(attributes), start, open_[-1] if open_ else None)
        named = NAME.match(text, start)
        # A tag that an entity brings is not in the text.
        if named is not None and named[1] == tag:
            at = element.room = named.end()
            while found := ATTRIBUTE.match(text, at):
                element.spans[found[1]] = (found.start(1), found.start(2) + 1, found.end(2) - 1)
                at = found.end()
        (open_[-1].children if open_ else top).append(element)
        open_.append(element)

    def ends(_: str) -> None:
        open_.pop()

    parser.StartElementHandler, parser.EndElementHandler = begins, ends
    try:
        parser.Parse(data, True)
    except xml.parsers.expat.ExpatError as error:
        raise wrong(source, f"it is no XML ({error})", "correct it") from None
    return top[0]


LINE = re.compile(r"^([ ]*)(\"[^\"]*\"|'[^']*'|[^\s#:'\"\-][^:#]*?)[ ]*:(?:[ ]+|(?=\r?$))([^#\r]*?)[ ]*(#[^\r]*)?\r?$")


@dataclass(frozen=True)
class Scalar:
    """A value in a YAML text: its keys from the outside, where it begins and ends, and what it is."""

    keys: tuple[str, ...]
    start: int
    end: int
    value: str


def scalars(text: str) -> dict[tuple[str, ...], Scalar]:
    """The values of a YAML text that is mappings alone, one key a line, as drivers write it; other lines are passed over."""
    found: dict[tuple[str, ...], Scalar] = {}
    open_: list[tuple[int, str]] = []
    at = 0
    for line in text.split("\n"):
        matched = LINE.match(line)
        if matched is not None:
            depth, key = len(matched[1]), matched[2].strip("\"'")
            open_ = [it for it in open_ if it[0] < depth] + [(depth, key)]
            keys = tuple(it[1] for it in open_)
            found[keys] = Scalar(keys, at + matched.start(3), at + matched.end(3), matched[3])
        at += len(line) + 1
    return found
