"""Print a target in true scale, as PDF or SVG by the ending of the file, and write its description beside it.

  python -m body_schema print-target tag tag.pdf --id 3 --size-mm 40
  python -m body_schema print-target charuco board.pdf --columns 7 --rows 9 --square-mm 25 --size-mm 18
  python -m body_schema print-target cube cube.svg --edge-mm 50 --size-mm 36 --ids top=0,front=1,right=2,back=3,left=4

The description (tag.toml) is what `detect` and `intrinsics` take; its [[target]] goes into a calibration file. If the ruler on the print
does not measure 100 mm, print again at 100 %, or say what it measures: --measured-ruler-mm writes the description of such a print.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from .._errors import FieldError
from . import write_all

if TYPE_CHECKING:
    from ..vision import Target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``print-target``."""
    parser.add_argument("kind", choices=["tag", "charuco", "cube"], help="a tag, a chessboard with tags, a cube with tags")
    parser.add_argument("out", type=Path, metavar="FILE", help="a .pdf or .svg")
    parser.add_argument("--name", help="the target's name in tables (default: tag, board or cube)")
    parser.add_argument("--family", help="family of the tags, as tag36h11 (the default of tags and cubes) or aruco_5x5_100 (of boards)")
    parser.add_argument("--size-mm", type=float, metavar="MM", help="edge of a tag's black square (default: 40; boards 18, cubes 36)")
    parser.add_argument("--id", type=int, help="which tag of the family (tag; default 0)")
    parser.add_argument("--columns", type=int, help="squares from left to right (charuco; default 7)")
    parser.add_argument("--rows", type=int, help="squares from top to bottom (charuco; default 9)")
    parser.add_argument("--square-mm", type=float, metavar="MM", help="edge of a square (charuco; default 25)")
    parser.add_argument("--edge-mm", type=float, metavar="MM", help="edge of the cube (cube; default 50)")
    parser.add_argument("--ids", metavar="FACE=ID,…", help="tags of the faces (cube; default top=0,front=1,right=2,back=3,left=4)")
    parser.add_argument("--paper", choices=["a4", "a3", "letter"], default="a4", help="(default: a4)")
    parser.add_argument("--description", type=Path, metavar="FILE", help="where the description goes (default: FILE with .toml)")
    parser.add_argument("--measured-ruler-mm", type=float, metavar="MM", help="what the ruler on the print measures: no page is written")
    parser.add_argument("--dry-run", action="store_true", help="write nothing, show the description")
    parser.add_argument("--force", action="store_true", help="write over files that are there")


def _target(args: argparse.Namespace) -> Target:
    from ..vision import Target

    takes = {"tag": {"id"}, "charuco": {"columns", "rows", "square_mm"}, "cube": {"edge_mm", "ids"}}
    for key in set().union(*takes.values()) - takes[args.kind]:
        if getattr(args, key) is not None:
            option = "--" + key.replace("_", "-")
            raise FieldError(f"`{option}`: a {args.kind} has none; leave it out", option, f"a {args.kind} has none", "leave it out")
    named = {key: getattr(args, key) for key in ("name", "family") if getattr(args, key) is not None}

    def metres(option: str, default: float) -> float:
        value = getattr(args, option)
        return (default if value is None else value) / 1e3

    if args.kind == "tag":
        return Target.tag(0 if args.id is None else args.id, metres("size_mm", 40.0), **named)
    if args.kind == "charuco":
        columns, rows = args.columns or 7, args.rows or 9
        return Target.charuco(columns, rows, metres("square_mm", 25.0), metres("size_mm", 18.0), **named)
    ids: dict[str, int] = {}
    for part in (args.ids or "top=0,front=1,right=2,back=3,left=4").split(","):
        face, _, id = part.partition("=")
        if not id.strip().isdigit() or face.strip() in ids:
            raise FieldError(
                f"`--ids`: {part!r} is no face with an id; write top=0,front=1",
                "--ids",
                f"{part!r} is no face with an id",
                "write top=0,front=1",
            )
        ids[face.strip()] = int(id)
    return Target.cube(ids, metres("edge_mm", 50.0), metres("size_mm", 36.0), **named)


def run(args: argparse.Namespace) -> int:
    """Print a target."""
    from ..vision import page

    try:
        target = _target(args)
    except FieldError as error:
        if not error.field.endswith("_m"):
            raise
        option, mend = f"--{error.field[:-2]}-mm", f"{error.mend} (the option takes millimetres)"
        raise FieldError(f"`{option}`: {error.what}; {mend}", option, error.what, mend) from None
    form = args.out.suffix.lower()
    if form not in (".pdf", ".svg"):
        what = f"{args.out} ends with neither .pdf nor .svg"
        raise FieldError(f"`FILE`: {what}; name such a file", "FILE", what, "name such a file")
    drawn = page(target, paper=args.paper, form=form[1:])
    printed = target
    if args.measured_ruler_mm is not None:
        if not 50 < args.measured_ruler_mm < 200:
            option, what = "--measured-ruler-mm", f"{args.measured_ruler_mm} mm is no ruler of 100 mm on a print"
            raise FieldError(f"`{option}`: {what}; measure it in millimetres", option, what, "measure it in millimetres")
        printed = target.scaled(args.measured_ruler_mm / 100.0)
    described = args.description or args.out.with_suffix(".toml")
    files: dict[Path, str | bytes] = {} if args.measured_ruler_mm is not None else {args.out: drawn}
    files[described] = printed.to_toml()
    if args.dry_run:
        print(printed.to_toml(), end="")
        print(f"# would write {', '.join(str(path) for path in files)}")
        return 0
    write_all(files, args.force)
    for path in files:
        print(f"wrote {path}")
    if args.measured_ruler_mm is None:
        print('print it at 100 % ("actual size"), and measure the ruler on it: 100 mm; if it is not, say --measured-ruler-mm MM')
    return 0
