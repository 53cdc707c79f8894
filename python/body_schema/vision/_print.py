"""Targets on paper, in true scale: vectors in SVG and PDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from .._errors import wrong
from ._targets import Target, bits_of

PAPERS = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4)}
"""Width and height of sheets, mm."""
RULER_MM = 100.0
_SIDE, _HEAD, _FOOT = 10.0, 34.0, 30.0
_STRIP = 7.0
"""Above a tag, for the mark which side is up: it stays on the tag when that is cut out."""

Rect = tuple[float, float, float, float]


@dataclass
class _Sheet:
    """What is on a page, in mm from its top left corner, y down."""

    width: float
    height: float
    black: list[list[Rect]] = field(default_factory=list)
    """Each list is one area: rectangles that touch have no seam between them."""
    triangles: list[list[tuple[float, float]]] = field(default_factory=list)
    lines: list[tuple[float, float, float, float, float, float]] = field(default_factory=list)
    """x1, y1, x2, y2, width, grey."""
    texts: list[tuple[float, float, float, str]] = field(default_factory=list)
    """x, y of the base line, size, text."""


def _sheet(target: Target, paper: str) -> _Sheet:
    if paper not in PAPERS:
        raise wrong("paper", f"{paper!r} is no paper", f"write one of {', '.join(PAPERS)}")
    wide, high = _extent_mm(target)
    width, height = PAPERS[paper]
    if wide > width - 2 * _SIDE or high > height - _HEAD - _FOOT:
        width, height = height, width
    if wide > width - 2 * _SIDE or high > height - _HEAD - _FOOT:
        short, long = PAPERS[paper]
        rooms = " or ".join(f"{w - 2 * _SIDE:.0f} x {h - _HEAD - _FOOT:.0f}" for w, h in ((short, long), (long, short)))
        what = f"{wide:.1f} x {high:.1f} mm do not fit {paper}, which has room for {rooms}"
        raise wrong("paper", what, "take a larger paper or a smaller target")
    sheet = _Sheet(width, height)
    left, top = (width - wide) / 2, _HEAD + (height - _HEAD - _FOOT - high) / 2
    for row, line in enumerate(_legend(target)):
        sheet.texts.append((_SIDE, 13.0 + 4.6 * row, 4.2 if row == 0 else 3.2, line))
    _ruler(sheet)
    if target.kind == "tag":
        _draw_tag(sheet, target, left, top)
    elif target.kind == "cube":
        _draw_cube(sheet, target, left, top)
    else:
        _draw_board(sheet, target, left, top)
    return sheet


def _extent_mm(target: Target) -> tuple[float, float]:
    """How much of the page a target takes with its white margin."""
    if target.kind == "tag":
        size = target.size_m * 1e3
        cells = len(bits_of(target.family, target.tags[0].id))
        return size * (cells + 2) / cells, size * (cells + 2) / cells + _STRIP
    if target.kind == "cube":
        edge = target.edge_m * 1e3
        boxes = [_NET[tag.face][:2] for tag in target.tags]
        columns, rows = [it[0] for it in boxes], [it[1] for it in boxes]
        return edge * (max(columns) - min(columns) + 1), edge * (max(rows) - min(rows) + 1)
    return target.columns * target.square_m * 1e3, target.rows * target.square_m * 1e3


def _legend(target: Target) -> list[str]:
    mm = 1e3
    ids = ", ".join(str(tag.id) for tag in target.tags)
    if target.kind == "tag":
        return [
            f"{target.name}: {target.family} id {ids}, black square {target.size_m * mm:g} mm",
            'Print at 100 % ("actual size"). Cut at the grey marks: the white margin belongs to the target.',
            "Glue it flat onto something stiff.",
        ]
    if target.kind == "cube":
        faces = ", ".join(f"{tag.face} id {tag.id}" for tag in target.tags)
        return [
            f"{target.name}: cube of {target.edge_m * mm:g} mm, {target.family}, black squares {target.size_m * mm:g} mm",
            f'Print at 100 % ("actual size"), cut along the outline, and glue it around a cube of {target.edge_m * mm:g} mm.',
            f"{faces}. Triangles point up on the sides, and to the back on the top.",
        ]
    return [
        f"{target.name}: {target.columns} x {target.rows} squares of {target.square_m * mm:g} mm, {target.family} {target.tags[0].id} to "
        f"{target.tags[-1].id}, {target.size_m * mm:g} mm",
        'Print at 100 % ("actual size"). Glue it flat onto something stiff: glass, or a board.',
    ]


def _tag_cells(target: Target, id: int, size: float, quarter_turns: int) -> list[Rect]:
    """Black rectangles of a tag with its top left corner at 0, 0, mm; turned counterclockwise."""
    bits = np.rot90(bits_of(target.family, id), quarter_turns)
    cell = size / len(bits)
    rects: list[Rect] = []
    for y, row in enumerate(bits):
        x = 0
        while x < len(row):
            if row[x]:
                x += 1
                continue
            end = x
            while end < len(row) and not row[end]:
                end += 1
            rects.append((x * cell, y * cell, (end - x) * cell, cell))
            x = end
    return rects


def _shifted(rects: Sequence[Rect], x: float, y: float) -> list[Rect]:
    return [(a + x, b + y, w, h) for a, b, w, h in rects]


def _up(sheet: _Sheet, x: float, y: float, size: float, quarter_turns: int = 0) -> None:
    """A triangle around x, y that points up, turned counterclockwise."""
    shape = [(0.0, -size), (size * 0.8, size * 0.6), (-size * 0.8, size * 0.6)]
    for _ in range(quarter_turns % 4):
        shape = [(b, -a) for a, b in shape]
    sheet.triangles.append([(x + a, y + b) for a, b in shape])


def _draw_tag(sheet: _Sheet, target: Target, left: float, top: float) -> None:
    size = target.size_m * 1e3
    wide, high = _extent_mm(target)
    margin = (wide - size) / 2
    sheet.black.append(_shifted(_tag_cells(target, target.tags[0].id, size, 0), left + margin, top + _STRIP + margin))
    _corner_marks(sheet, left, top, wide, high)
    _up(sheet, left + margin + 2.0, top + 4.0, 1.8)
    room = left + wide - (left + margin + 5.0)
    id = target.tags[0].id
    for words in (f"UP  {target.family} id {id}", f"UP  id {id}", "UP"):
        # Helvetica's letters are about 0.56 as wide as they are high.
        if 0.56 * 2.8 * len(words) < room:
            sheet.texts.append((left + margin + 5.0, top + 5.0, 2.8, words))
            break


def _draw_board(sheet: _Sheet, target: Target, left: float, top: float) -> None:
    square, size = target.square_m * 1e3, target.size_m * 1e3
    wide, high = target.columns * square, target.rows * square
    whites = set()
    for tag in target.tags:
        column = round((tag.middle[0] * 1e3 + wide / 2) / square - 0.5)
        row = round((high / 2 - tag.middle[1] * 1e3) / square - 0.5)
        whites.add((column, row))
        cells = _tag_cells(target, tag.id, size, 0)
        margin = (square - size) / 2
        sheet.black.append(_shifted(cells, left + column * square + margin, top + row * square + margin))
    squares = [
        (left + x * square, top + y * square, square, square)
        for y in range(target.rows)
        for x in range(target.columns)
        if (x, y) not in whites
    ]
    sheet.black.append(squares)
    _up(sheet, left + wide / 2, top - 4.0, 2.2)
    sheet.texts.append((left + wide / 2 + 3.0, top - 2.6, 4.0, "UP"))


_NET = {
    "back": (1, 0, 2),
    "left": (0, 1, 3),
    "top": (1, 1, 0),
    "right": (2, 1, 1),
    "front": (1, 2, 0),
    "bottom": (1, 3, 2),
}
"""Column and row of a face in the net, and by how many quarter turns counterclockwise it is turned there."""


def _draw_cube(sheet: _Sheet, target: Target, left: float, top: float) -> None:
    edge, size = target.edge_m * 1e3, target.size_m * 1e3
    beside = {"back": (1.05, 0.12), "left": (0.0, -0.04), "right": (0.06, -0.04), "front": (1.05, 0.95), "bottom": (1.05, 0.95)}
    first = [min(_NET[tag.face][axis] for tag in target.tags) for axis in (0, 1)]
    for tag in target.tags:
        column, row, turns = _NET[tag.face]
        x, y = left + (column - first[0]) * edge, top + (row - first[1]) * edge
        margin = (edge - size) / 2
        sheet.black.append(_shifted(_tag_cells(target, tag.id, size, turns), x + margin, y + margin))
        for x1, y1, x2, y2 in ((0, 0, 1, 0), (1, 0, 1, 1), (1, 1, 0, 1), (0, 1, 0, 0)):
            sheet.lines.append((x + x1 * edge, y + y1 * edge, x + x2 * edge, y + y2 * edge, 0.15, 0.6))
        if tag.face in beside:
            across, down = beside[tag.face]
            sheet.texts.append((x + across * edge, y + down * edge, 3.2, f"{tag.face}, id {tag.id}"))
        # The mark lies in the outer part of the margin, so that one cell beside the tag stays white.
        cell = size / len(bits_of(target.family, tag.id))
        room = margin - cell
        if room >= 1.2:
            mark = min(room * 0.4, 1.6)
            ahead = edge / 2 - room / 2
            dx, dy = {0: (0, -1), 1: (-1, 0), 2: (0, 1), 3: (1, 0)}[turns]
            _up(sheet, x + edge / 2 + dx * ahead, y + edge / 2 + dy * ahead, mark, turns)


def _corner_marks(sheet: _Sheet, left: float, top: float, wide: float, high: float) -> None:
    """Where to cut, outside the white margin."""
    for x, sx in ((left, -1), (left + wide, 1)):
        for y, sy in ((top, -1), (top + high, 1)):
            sheet.lines.append((x, y, x + 3.0 * sx, y, 0.15, 0.6))
            sheet.lines.append((x, y, x, y + 3.0 * sy, 0.15, 0.6))


def _ruler(sheet: _Sheet) -> None:
    y, x = sheet.height - 18.0, (sheet.width - RULER_MM) / 2
    sheet.lines.append((x, y, x + RULER_MM, y, 0.2, 0.0))
    for mm in range(0, 101, 5):
        length = 3.0 if mm % 10 == 0 else 1.6
        sheet.lines.append((x + mm, y - length, x + mm, y, 0.2, 0.0))
        if mm % 50 == 0:
            sheet.texts.append((x + mm - 0.278 * 3.0 * len(str(mm)), y - 4.0, 3.0, str(mm)))
    said = "This line is 100 mm long. If it is not, print again at 100 %, or tell what it measures: --measured-ruler-mm"
    sheet.texts.append(((sheet.width - 142.0) / 2, y + 5.0, 3.0, said))


def page(target: Target, *, paper: str = "a4", form: str = "svg") -> bytes:
    """The print of a target as ``svg`` or ``pdf``, in true scale, with a ruler of 100 mm and a mark which side is up.

    ``paper`` is ``a4``, ``a3`` or ``letter``. Raises ``FieldError`` where the target does not fit it.
    """
    sheet = _sheet(target, paper)
    if form == "svg":
        return _svg(sheet).encode("ascii")
    if form == "pdf":
        return _pdf(sheet)
    raise wrong("form", f"{form!r} is no form of a page", "write svg or pdf")


def write_page(path: str | PathLike[str], target: Target, *, paper: str = "a4") -> None:
    """``page`` to a file whose name ends with ``.svg`` or ``.pdf``."""
    suffix = Path(path).suffix.lower()
    if suffix not in (".svg", ".pdf"):
        raise wrong("path", f"{path} ends with neither .svg nor .pdf", "name such a file")
    Path(path).write_bytes(page(target, paper=paper, form=suffix[1:]))


def _n(number: float) -> str:
    text = f"{number:.4f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _svg(sheet: _Sheet) -> str:
    out = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_n(sheet.width)}mm" height="{_n(sheet.height)}mm" '
        f'viewBox="0 0 {_n(sheet.width)} {_n(sheet.height)}">',
        f'<rect width="{_n(sheet.width)}" height="{_n(sheet.height)}" fill="#fff"/>',
    ]
    for area in sheet.black:
        path = "".join(f"M{_n(x)} {_n(y)}h{_n(w)}v{_n(h)}h{_n(-w)}z" for x, y, w, h in area)
        out.append(f'<path fill="#000" d="{path}"/>')
    for shape in sheet.triangles:
        out.append('<polygon fill="#000" points="' + " ".join(f"{_n(x)},{_n(y)}" for x, y in shape) + '"/>')
    for x1, y1, x2, y2, width, grey in sheet.lines:
        level = round(grey * 255)
        out.append(
            f'<line x1="{_n(x1)}" y1="{_n(y1)}" x2="{_n(x2)}" y2="{_n(y2)}" '
            f'stroke="rgb({level},{level},{level})" stroke-width="{_n(width)}"/>'
        )
    for x, y, size, text in sheet.texts:
        safe = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
        out.append(f'<text x="{_n(x)}" y="{_n(y)}" font-family="Helvetica, Arial, sans-serif" font-size="{_n(size)}">{safe}</text>')
    return "\n".join([*out, "</svg>", ""])


def _pdf(sheet: _Sheet) -> bytes:
    """A PDF 1.6 of one page; its stream is not compressed, so that what it draws can be read."""
    point = 72 / 25.4
    ops = [f"{point:.9f} 0 0 {-point:.9f} 0 {sheet.height * point:.6f} cm", "0 g"]
    for area in sheet.black:
        ops += [f"{_n(x)} {_n(y)} {_n(w)} {_n(h)} re" for x, y, w, h in area]
        ops.append("f")
    for shape in sheet.triangles:
        ops += [f"{_n(x)} {_n(y)} {'m' if index == 0 else 'l'}" for index, (x, y) in enumerate(shape)]
        ops.append("f")
    for x1, y1, x2, y2, width, grey in sheet.lines:
        ops.append(f"{_n(grey)} G {_n(width)} w {_n(x1)} {_n(y1)} m {_n(x2)} {_n(y2)} l S")
    for x, y, size, text in sheet.texts:
        safe = text.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
        ops.append(f"BT /F1 {_n(size)} Tf 1 0 0 -1 {_n(x)} {_n(y)} Tm ({safe}) Tj ET")
    stream = "\n".join(ops).encode("ascii")
    box = f"[0 0 {sheet.width * point:.6f} {sheet.height * point:.6f}]"
    objects = [
        # Viewers that heed it do not scale the page.
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>".encode("ascii"),
        b"<< /Length %d >>\nstream\n" % len(stream) + stream + b"\nendstream",
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>",
    ]
    out = bytearray(b"%PDF-1.6\n%\xe2\xe3\xcf\xd3\n")
    starts = []
    for index, body in enumerate(objects):
        starts.append(len(out))
        out += b"%d 0 obj\n" % (index + 1) + body + b"\nendobj\n"
    table = len(out)
    out += b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    out += b"".join(b"%010d 00000 n \n" % start for start in starts)
    out += b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (len(objects) + 1, table)
    return bytes(out)
