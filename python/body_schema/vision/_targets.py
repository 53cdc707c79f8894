"""Printed targets: which points they have, how these are called, and where they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._errors import FieldError, wrong

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]

FAMILIES: dict[str, str] = {
    "tag16h5": "DICT_APRILTAG_16h5",
    "tag25h9": "DICT_APRILTAG_25h9",
    "tag36h10": "DICT_APRILTAG_36h10",
    "tag36h11": "DICT_APRILTAG_36h11",
    **{f"aruco_{bits}x{bits}_{count}": f"DICT_{bits}X{bits}_{count}" for bits in (4, 5, 6, 7) for count in (50, 100, 250, 1000)},
    "aruco_original": "DICT_ARUCO_ORIGINAL",
    "aruco_mip_36h12": "DICT_ARUCO_MIP_36h12",
}
"""Families of tags by name, and what OpenCV calls them."""

FACES: dict[str, tuple[Vector, Vector, Vector]] = {
    "top": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "right": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "back": ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "left": ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "bottom": ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
}
"""Faces of a cube: the normal, and where right and up of the tag on it point, in the cube's frame."""


def dictionary(family: str) -> cv2.aruco.Dictionary:
    """OpenCV's dictionary of a family."""
    if family not in FAMILIES:
        raise wrong("family", f"{family!r} is no family of tags", f"write one of {', '.join(FAMILIES)}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family]))


def bits_of(family: str, id: int) -> NDArray[np.uint8]:
    """The cells of a tag with its black border, row by row from the top: 0 is black, 1 is white."""
    kind = dictionary(family)
    cells = kind.markerSize + 2
    return (cv2.aruco.generateImageMarker(kind, id, cells) > 127).astype(np.uint8)


@dataclass(frozen=True)
class Tag:
    """One tag of a target: ``size_m`` is the edge of its black square; the rest is in the target's frame."""

    id: int
    size_m: float
    middle: Vector = (0.0, 0.0, 0.0)
    right: Vector = (1.0, 0.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    face: str = ""

    @property
    def normal(self) -> Floats:
        """Out of the print, towards whoever reads it."""
        normal: Floats = np.cross(np.array(self.right), np.array(self.up))
        return normal

    @property
    def corners_m(self) -> Floats:
        """Top left, top right, bottom right, bottom left of the black square, as printed with the mark UP on top; 4 × 3, m."""
        half = self.size_m / 2
        right, up = np.array(self.right) * half, np.array(self.up) * half
        return np.asarray(np.array(self.middle) + np.array([up - right, up + right, right - up, -right - up]), np.float64)


@dataclass(frozen=True)
class Target:
    """What is printed, and what is known of its points. Made by ``tag``, ``cube``, ``charuco`` or ``read``.

    The frame of a tag and of a board has its origin in the middle of the print, x to the right, y up and z out of the print; that
    of a cube its origin in the middle of the cube, z out of the face ``top``, -y out of ``front`` and x out of ``right``.

    ========  ================================================================================================
    kind      names of the points, in their order
    ========  ================================================================================================
    tag       ``tagID/0`` … ``tagID/3``: top left, top right, bottom right, bottom left of the black square
    cube      the same, face by face
    charuco   ``corner/0`` …: inner corners of the chessboard, row by row from the top left
    ========  ================================================================================================
    """

    name: str
    kind: str
    family: str
    tags: tuple[Tag, ...]
    columns: int = 0
    rows: int = 0
    square_m: float = 0.0
    edge_m: float = 0.0
    placed: tuple[tuple[Vector, Vector, Vector], Vector] | None = None
    """Another frame in which the points are written: p = R q + t of the points q above."""

    @classmethod
    def tag(cls, id: int, size_m: float, *, family: str = "tag36h11", name: str = "tag") -> Target:
        """One tag; ``size_m`` is the edge of its black square."""
        return cls(name_of(name), "tag", family, (Tag(_id(family, id, "id"), _length("size_m", size_m)),))

    @classmethod
    def cube(cls, ids: dict[str, int], edge_m: float, size_m: float, *, family: str = "tag36h11", name: str = "cube") -> Target:
        """A cube of the edge ``edge_m`` with a tag of the edge ``size_m`` in the middle of each of the faces that ``ids`` names.

        Faces are ``top``, ``front``, ``right``, ``back``, ``left`` and ``bottom``. The tag's up is the cube's z on the sides, and
        its y on top and bottom.
        """
        _length("edge_m", edge_m)
        cells = dictionary(family).markerSize + 2
        if _length("size_m", size_m) * (cells + 2) > edge_m * cells * (1 + 1e-9):
            what = f"a tag of {size_m * 1e3:g} mm with a white margin of one cell does not fit a face of {edge_m * 1e3:g} mm"
            raise wrong("size_m", what, f"write at most {edge_m * cells / (cells + 2):.6f}, which is {edge_m * 1e3 * cells / (cells + 2):.3f} mm")
        if not ids or not set(ids) <= set(FACES):
            raise wrong("ids", f"{', '.join(map(str, ids)) or 'nothing'} are not the faces", f"write an id for some of {', '.join(FACES)}")
        if len(set(ids.values())) < len(ids):
            raise wrong("ids", "two faces have the same id", "give every face an id of its own")
        tags = []
        for face, (normal, right, up) in FACES.items():
            if face in ids:
                x, y, z = (edge_m / 2 * part for part in normal)
                tags.append(Tag(_id(family, ids[face], f"ids.{face}"), size_m, (x, y, z), right, up, face))
        return cls(name_of(name), "cube", family, tuple(tags), edge_m=edge_m)

    @classmethod
    def charuco(
        cls, columns: int, rows: int, square_m: float, size_m: float, *, family: str = "aruco_5x5_100", name: str = "board"
    ) -> Target:
        """A chessboard of ``columns`` × ``rows`` squares of ``square_m``, with tags of ``size_m`` in its white squares."""
        for field, number in (("columns", columns), ("rows", rows)):
            if isinstance(number, bool) or not isinstance(number, int) or not 3 <= number <= 40:
                raise wrong(field, f"{number!r} is no number of squares", "write a whole number from 3 to 40")
        _length("square_m", square_m)
        if _length("size_m", size_m) > 0.85 * square_m:
            what = f"a tag of {size_m * 1e3:g} mm leaves no white margin in a square of {square_m * 1e3:g} mm"
            raise wrong("size_m", what, f"write at most {0.85 * square_m:.6f}, which is {850 * square_m:.3f} mm")
        kind = dictionary(family)
        count = len(kind.bytesList)
        if columns * rows // 2 > count:
            raise wrong(
                "family", f"{family} has {count} tags, and {columns * rows // 2} are needed", "take a larger family or fewer squares"
            )
        board = cv2.aruco.CharucoBoard((columns, rows), square_m, size_m, kind)
        width, height = columns * square_m, rows * square_m
        tags = []
        for id, corners in zip(np.asarray(board.getIds()).ravel(), board.getObjPoints()):
            x, y, _ = np.asarray(corners, float).reshape(4, 3).mean(axis=0)
            tags.append(Tag(int(id), size_m, (float(x) - width / 2, height / 2 - float(y), 0.0)))
        return cls(name_of(name), "charuco", family, tuple(tags), columns, rows, square_m)

    @property
    def point_names(self) -> list[str]:
        """The names of the points, in their order."""
        if self.kind == "charuco":
            return [f"corner/{index}" for index in range((self.columns - 1) * (self.rows - 1))]
        return [f"tag{tag.id}/{corner}" for tag in self.tags for corner in range(4)]

    @property
    def points_m(self) -> Floats:
        """The points in the target's frame, N × 3, m."""
        if self.kind == "charuco":
            points = np.array(
                [
                    [(x - self.columns / 2) * self.square_m, (self.rows / 2 - y) * self.square_m, 0.0]
                    for y in range(1, self.rows)
                    for x in range(1, self.columns)
                ]
            )
        else:
            points = np.concatenate([tag.corners_m for tag in self.tags])
        if self.placed is None:
            return points
        turn, shift = self.placed
        moved: Floats = points @ np.array(turn).T + np.array(shift)
        return moved

    @property
    def facing(self) -> Vector | None:
        """The direction from which a flat target is seen, in its frame; ``None`` of a cube."""
        if self.kind == "cube" and len(self.tags) > 1:
            return None
        normal = self.tags[0].normal
        if self.placed is not None:
            normal = np.array(self.placed[0]) @ normal
        x, y, z = (float(part) + 0.0 for part in normal)
        return (x, y, z)

    @property
    def size_m(self) -> float:
        """The edge of the black square of its tags, m."""
        return self.tags[0].size_m

    def scaled(self, factor: float) -> Target:
        """The target as a printer made it that draws everything ``factor`` times as large."""
        if not (math.isfinite(factor) and 0.5 < factor < 2.0):
            raise wrong("factor", f"{factor!r} is no scale of a print", "write a number near 1")
        x = [
            replace(tag, size_m=tag.size_m * factor, middle=_scaled(tag.middle, 1.0 if self.kind == "cube" else factor))
            for tag in self.tags
        ]
        return replace(self, tags=tuple(x), square_m=self.square_m * factor)

    def sides(self) -> list[Target]:
        """The target in parts that are seen whole: of a cube its faces, in the cube's frame; of a flat target itself.

        The engine takes a body that is seen whole or not at all; of a cube nobody sees that.
        """
        if self.kind != "cube":
            return [self]
        return [replace(self, name=f"{self.name}_{tag.face}", tags=(tag,)) for tag in self.tags]

    @property
    def least_points(self) -> int:
        """How many points make a reading: all, but for a board."""
        return min(4, len(self.point_names)) if self.kind == "charuco" else len(self.point_names)

    def sections(self) -> list[dict[str, Any]]:
        """The tables ``[[target]]`` of a calibration file: ``name``, ``points_m``, ``facing``, ``facing_within_deg``.

        Of a board any points are a reading, four at least: ``partly_seen``, ``least_points``.
        """
        partly = {"partly_seen": True, "least_points": self.least_points} if self.kind == "charuco" else {}
        return [
            {
                "name": side.name,
                "points_m": [[round(float(x), 9) + 0.0 for x in point] for point in side.points_m],
                "facing": list(side.facing or (0.0, 0.0, 1.0)),
                "facing_within_deg": 70.0,
                **partly,
            }
            for side in self.sides()
        ]

    def to_toml(self, path: str | PathLike[str] | None = None) -> str:
        """The description as ``read`` takes it, with the ``[[target]]`` of a calibration file; written to ``path`` if there is one."""
        printed: dict[str, Any] = {"kind": self.kind, "name": self.name, "family": self.family}
        if self.kind == "tag":
            printed |= {"id": self.tags[0].id, "size_m": self.size_m}
        elif self.kind == "cube":
            printed |= {"edge_m": self.edge_m, "size_m": self.size_m, "ids": {tag.face: tag.id for tag in self.tags}}
        else:
            printed |= {"columns": self.columns, "rows": self.rows, "square_m": self.square_m, "size_m": self.size_m}
        text = "# What is printed: `size_m` is the edge of a tag's black square.\n[printed]\n" + toml_of(printed)
        text += "\n# For the calibration file. " + _ORDER[self.kind] + "\n"
        text += "\n".join("[[target]]\n" + toml_of(section) for section in self.sections())
        if path is not None:
            Path(path).write_text(text, encoding="utf-8")
        return text

    @classmethod
    def read(cls, path: str | PathLike[str]) -> Target:
        """The target of a file that ``to_toml`` or ``print-target`` wrote.

        ``points_m`` may be written in another frame: the same points, turned and moved. Points that are mirrored, of another size or
        in another order are refused, with what is wrong.
        """
        table = read_toml(path)
        printed = table.get("printed")
        if not isinstance(printed, dict):
            raise wrong("printed", f"{path} does not say what is printed", "write the file with `python -m body_schema print-target`")
        target = cls._of(printed)
        sections = table.get("target", [])
        if not isinstance(sections, list):
            raise wrong("target", "it is no list of tables", "write [[target]]")
        return target._checked(sections) if sections else target

    @classmethod
    def _of(cls, printed: dict[str, Any]) -> Target:
        keys = {
            "tag": ("id", "size_m"),
            "cube": ("ids", "edge_m", "size_m"),
            "charuco": ("columns", "rows", "square_m", "size_m"),
        }
        kind = printed.get("kind")
        if kind not in keys:
            raise wrong("printed.kind", f"{kind!r} is no kind of target", f"write one of {', '.join(keys)}")
        for key in keys[kind]:
            if key not in printed:
                raise wrong(f"printed.{key}", "missing", "write it as `print-target` does")
        for key in printed:
            if key not in (*keys[kind], "kind", "name", "family"):
                raise wrong(f"printed.{key}", "there is no such key", f"leave it out; there are {', '.join(keys[kind])}, name, family")
        given = {key: printed[key] for key in keys[kind]} | {key: printed[key] for key in ("name", "family") if key in printed}
        if kind == "cube" and not isinstance(given["ids"], dict):
            raise wrong("printed.ids", "it is no table", "write { top = 0, front = 1 }")
        try:
            makers: dict[str, Callable[..., Target]] = {"tag": cls.tag, "cube": cls.cube, "charuco": cls.charuco}
            return makers[kind](**given)
        except FieldError as error:
            raise wrong(f"printed.{error.field}", error.what, error.mend) from None

    def _checked(self, sections: list[Any]) -> Target:
        """The target with the points of its sections, which must be the same as its own but for their frame."""
        mine = self.sides()
        if [it.get("name") if isinstance(it, dict) else None for it in sections] != [side.name for side in mine]:
            raise wrong(
                "target", "the names are not those of what is printed", f"write {', '.join(side.name for side in mine)}, in this order"
            )
        written = []
        for index, (section, side) in enumerate(zip(sections, mine)):
            field = f"target[{index}].points_m"
            try:
                points = np.array(section["points_m"], float)
            except (KeyError, TypeError, ValueError):
                raise wrong(field, "missing, or no list of [x, y, z]", "write it as `print-target` does") from None
            if points.shape != side.points_m.shape or not np.isfinite(points).all():
                raise wrong(field, f"these are not the {len(side.points_m)} points of what is printed", "write it as `print-target` does")
            written.append(points)
        theirs, ours = np.concatenate(written), np.concatenate([side.points_m for side in mine])
        size = float(np.sqrt(((ours - ours.mean(axis=0)) ** 2).sum(axis=1).mean()))
        its = float(np.sqrt(((theirs - theirs.mean(axis=0)) ** 2).sum(axis=1).mean()))
        if abs(its / size - 1) > 0.002:
            what = f"the points are {its / size:.4g} times as large as what is printed"
            raise wrong("target.points_m", what, "measure the black square, and correct size_m or points_m")
        turn, shift, off, mirrored = rigid_motion(ours, theirs)
        facing = sections[0].get("facing", [0.0, 0.0, 1.0])
        flipped = self.facing is not None and float(np.array(facing, float) @ (turn @ np.array(self.facing))) < 0
        if mirrored or (flipped and off <= 0.002 * size):
            what = "the points are mirrored: seen from the front they run the other way round"
            raise wrong("target.points_m", what, "tell them as top left, top right, bottom right, bottom left, seen from the front")
        if off > 0.002 * size:
            what = f"the points do not fit what is printed, by {off * 1e3:.2g} mm"
            raise wrong("target.points_m", what, f"check their order: {_ORDER[self.kind]}")
        if np.abs(turn - np.eye(3)).max() < 1e-6 and np.abs(shift).max() < 1e-9:
            return self
        rows = [(float(a), float(b), float(c)) for a, b, c in turn]
        return replace(self, placed=((rows[0], rows[1], rows[2]), (float(shift[0]), float(shift[1]), float(shift[2]))))


_ORDER = {
    "tag": "Order of the points, as printed: top left, top right, bottom right, bottom left.",
    "cube": "Order of the points of a face, as printed: top left, top right, bottom right, bottom left.",
    "charuco": "Order of the points, as printed: row by row from the top left.",
}


def rigid_motion(ours: Floats, theirs: Floats) -> tuple[Floats, Floats, float, bool]:
    """The rigid motion from ``ours`` to ``theirs``, the largest distance that it leaves, and whether a mirror fits far better."""
    a, b = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    u, values, vt = np.linalg.svd(a.T @ b)
    sign = np.sign(np.linalg.det(vt.T @ u.T))

    def off(last: float) -> tuple[Floats, float]:
        turn: Floats = vt.T @ np.diag([1.0, 1.0, last]) @ u.T
        return turn, float(np.linalg.norm(a @ turn.T - b, axis=1).max())

    turn, left = off(sign)
    # Flat points fit a mirror as well as a turn.
    mirrored = values[2] > 1e-9 * values[0] and off(-sign)[1] < 0.1 * left
    return turn, theirs.mean(axis=0) - turn @ ours.mean(axis=0), left, bool(mirrored)


def _scaled(vector: Vector, factor: float) -> Vector:
    x, y, z = vector
    return (x * factor, y * factor, z * factor)


def name_of(name: object) -> str:
    """A name as titles of tables take it."""
    if not isinstance(name, str) or not name or not all((it.isascii() and it.isalnum()) or it in "_-" for it in name):
        raise wrong("name", f"{name!r} is no name", "write letters, digits, _ and -")
    return name


def _id(family: str, id: object, field: str) -> int:
    count = len(dictionary(family).bytesList)
    if isinstance(id, bool) or not isinstance(id, int) or not 0 <= id < count:
        raise wrong(field, f"{id!r} is no tag of {family}", f"write a whole number from 0 to {count - 1}")
    return id


def _length(field: str, length: object) -> float:
    if isinstance(length, bool) or not isinstance(length, (int, float)) or not 1e-4 <= length <= 10.0:
        raise wrong(field, f"{length!r} is no length of a print in metres", "write it in metres, from 0.0001 to 10")
    return float(length)


def toml_of(table: dict[str, Any]) -> str:
    """Lines ``key = value`` of texts, numbers, lists and flat tables."""

    def value(it: Any) -> str:
        if isinstance(it, bool):
            return "true" if it else "false"
        if isinstance(it, str):
            return '"' + it.replace("\\", "\\\\").replace('"', '\\"') + '"'
        if isinstance(it, dict):
            return "{ " + ", ".join(f"{key} = {value(part)}" for key, part in it.items()) + " }"
        if isinstance(it, (list, tuple)):
            return "[" + ", ".join(value(part) for part in it) + "]"
        return str(it) if isinstance(it, int) else repr(float(it))

    return "".join(f"{key} = {value(it)}\n" for key, it in table.items())


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of TOML; ``ValueError`` where it is none."""
    try:
        import tomllib
    except ImportError:  # Python 3.10
        import tomli as tomllib  # type: ignore[import-not-found,no-redef,unused-ignore]
    return tomllib.loads(text)


def read_toml(path: str | PathLike[str]) -> dict[str, Any]:
    """The tables of a TOML file."""
    try:
        return parse_toml(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise wrong("target", f"{path}: {error.strerror}", "name a file that can be read") from None
    except ValueError as error:
        raise wrong("target", f"{path}: {error}", "write TOML, as `print-target` does") from None
