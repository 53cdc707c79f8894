"""From pictures and joint readings to a table and a calibration file."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import FieldError, wrong
from .._session import Session
from .._words import size_doubt, text_of_urdf
from ._camera import Camera
from ._detect import Detection, Limits, found, grey
from ._place import Place, place_of, radians_of, tip_frames
from ._poses import frame_doubt, poses
from ._targets import FAMILIES, Target, parse_toml, toml_of
from ._watch import Watcher


LEAST_FOCAL, MOST_FOCAL = 0.5, 2.0
"""A focal length that is a guess is not further off than that: beyond, something else is wrong."""


@dataclass(frozen=True)
class Table:
    """A table of joint readings and pixels, and what became of every picture.

    ``csv`` has the columns of the joint table without ``image``, then ``CAMERA_TARGET_u1, …_v1, …``: undistorted pixels. ``seen`` are
    the pictures with a reading, ``words`` says of every other picture why it has none, and ``doubts`` are sentences about all.
    """

    titles: list[str]
    rows: list[list[str]]
    seen: list[str]
    words: dict[str, str]
    detections: list[Detection]
    readings: list[list[str]]
    columns: dict[str, list[str]]
    doubts: list[str] = field(default_factory=list)

    @property
    def csv(self) -> str:
        """The table as text."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow([*self.titles, *(title for its in self.columns.values() for title in its)])
        for row, reading in zip(self.rows, self.readings):
            writer.writerow([*row, *reading])
        return out.getvalue()


def read_joints(path: str | PathLike[str]) -> tuple[list[str], dict[str, list[str]]]:
    """A table of joint readings with a column ``image``: the other titles, and the other cells by picture, as they stand there."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise wrong("joints", f"{path}: {error.strerror}", "name a CSV that can be read") from None
    except UnicodeDecodeError as error:
        raise wrong("joints", f"{path} is no text: {error.reason}", "write a CSV in UTF-8") from None
    lines = [line for line in csv.reader(io.StringIO(text)) if any(cell.strip() for cell in line)]
    if not lines:
        raise wrong("joints", f"{path} is empty", "write a line of titles, then a line for each picture")
    titles = [it.strip() for it in lines[0]]
    if "image" not in titles:
        mend = "add a column `image` with the file name of every row's picture"
        if len(titles) == 1 and ";" in titles[0]:
            mend = "separate cells by commas, and add a column `image`"
        raise wrong("joints", f"{path} does not say which picture belongs to which row", mend)
    if len(set(titles)) < len(titles) or "" in titles:
        raise wrong("joints", f"two columns of {path} have the same title, or one has none", "give each a title of its own")
    at = titles.index("image")
    rows: dict[str, list[str]] = {}
    for number, line in enumerate(lines[1:], 2):
        if len(line) != len(titles):
            raise wrong("joints", f"row {number} of {path} has {len(line)} cells, the titles {len(titles)}", "write a cell for each title")
        name = line[at].strip()
        if name in rows:
            raise wrong("joints", f"{name} stands in two rows of {path}", "write one row for each picture")
        cells = [cell.strip() for index, cell in enumerate(line) if index != at]
        for title, cell in zip((it for it in titles if it != "image"), cells):
            try:
                float(cell)
            except ValueError:
                raise wrong("joints", f"row {number} of {path}: {cell!r} in {title} is no number", "write the joint's reading") from None
        rows[name] = cells
    return [it for it in titles if it != "image"], rows


def detect_table(
    images: Iterable[tuple[str, Any]],
    target: Target,
    camera: Camera,
    joints: tuple[list[str], dict[str, list[str]]],
    limits: Limits | None = None,
) -> Table:
    """The table of pictures, given as (name, picture), whose joint readings ``read_joints`` gave.

    A picture without a row, a row without a picture, and a picture without a reading are told in ``words``, and left out.
    """
    titles, told = joints
    watcher = Watcher(camera, target, limits)
    columns = {
        channel: [f"{channel}_{axis}{index}" for index in range(1, len(side.point_names) + 1) for axis in "uv"]
        for channel, side in zip(watcher.channels, target.sides())
    }
    both = set(titles) & {title for its in columns.values() for title in its}
    if both:
        raise wrong(
            "joints", f"{', '.join(sorted(both))} is a title of a reading too", "call the joint, the camera or the target otherwise"
        )
    rows, seen, detections, readings = [], [], [], []
    words: dict[str, str] = {}
    shown: set[str] = set()
    unseen: list[Any] = []
    for name, image in images:
        if name in shown:
            raise wrong("images", f"two pictures are called {name}", "give each a name of its own")
        shown.add(name)
        if name not in told:
            words[name] = "no row of the joint table names it"
            continue
        try:
            look = watcher.look(image)
        except FieldError as error:
            raise wrong("images", f"{name}: {error.what}", error.mend) from None
        if not look.seen:
            words[name] = look.reason
            if not look.detection.names and len(unseen) < 5:
                unseen.append(image)
            continue
        cells = []
        for channel, its in columns.items():
            reading = look.measurements[channel]
            points = reading if reading is not None else [None] * (len(its) // 2)
            cells += [cell for point in points for cell in (["", ""] if point is None else [f"{value:.4f}" for value in point])]
        rows.append(told[name])
        seen.append(name)
        detections.append(look.detection)
        readings.append(cells)
    for name in told:
        if name not in shown:
            words[name] = "it is named by a row of the joint table, and is not among the pictures"
    doubts = list(camera.remarks)
    if not seen and unseen:
        doubts += _other_families(unseen, target)
    doubts += _depth_doubts(detections, camera)
    return Table(titles, rows, seen, words, detections, readings, columns, doubts)


def _other_families(images: Sequence[Any], target: Target) -> list[str]:
    """Which tags are there, where none of the target's is."""
    for family in FAMILIES:
        if family == target.family:
            continue
        # Small families read noise as tags: only the same id in several pictures counts.
        counts: dict[int, int] = {}
        for image in images:
            for id, _ in found(grey(image), family)[0]:
                counts[id] = counts.get(id, 0) + 1
        ids = [id for id, count in counts.items() if count >= min(2, len(images))]
        if ids:
            told = ", ".join(map(str, sorted(ids)[:5]))
            return [f"the pictures show {family} {told}, the target is of {target.family}: mend `family` and the ids"]
    return []


def _depth_doubts(detections: Sequence[Detection], camera: Camera) -> list[str]:
    """What two lengths of one target say of each other: the edge of a cube, or of squares, and the size of tags."""
    target = detections[0].target if detections else None
    if target is None or target.kind != "cube":
        return []
    ratios = []
    for detection in detections:
        faces = [it for it in map(detection.of, target.sides()) if it.whole]
        if len(faces) < 2:
            continue
        ratio = cube_ratio(detection, camera)
        if ratio is not None:
            ratios.append(ratio)
    if len(ratios) < 3:
        return []
    value = float(np.median(ratios))
    sd = 1.4826 * float(np.median(np.abs(np.array(ratios) - value))) / math.sqrt(len(ratios))
    if abs(value - 1) < max(0.02, 4 * sd):
        return []
    return [
        f"tags of the cube are {value:.3f} ± {sd:.3f} times as large against its edge as described: measure `size_m` and `edge_m`, "
        "and whether each tag is on the face that `ids` says"
    ]


def cube_ratio(detection: Detection, camera: Camera) -> float | None:
    """How many times as large a cube's tags are against its edge as described, of a picture that shows two faces or more.

    The tags' size is varied, the edge is kept, and the pose refitted; ``None`` where fewer than two faces are seen.
    """
    seen = {name.split("/")[0] for name in detection.names}
    if len(seen) < 2 or detection.target.kind != "cube":
        return None

    def off(factor: float) -> float:
        its = replace(detection, target=detection.target.scaled(factor))
        found = poses(its, camera)
        return found[0].chi2 if found else math.inf

    # Golden section over the factor, which the sum of squares has one minimum of.
    low, high = 0.6, 1.7
    golden = (math.sqrt(5) - 1) / 2
    a, b = high - golden * (high - low), low + golden * (high - low)
    at_a, at_b = off(a), off(b)
    while high - low > 1e-4:
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = high - golden * (high - low)
            at_a = off(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + golden * (high - low)
            at_b = off(b)
    return (low + high) / 2


def ends_of(urdf: str | PathLike[str], base: str | None, tip: str | None) -> tuple[str, str]:
    """The links that are the ends of the chain, where they are told or where the URDF leaves no choice."""
    if base is None or tip is None:
        robot = parse_toml(Session.from_urdf(urdf, base, tip).to_toml())["robot"]
        return str(robot["base"]), str(robot["tip"])
    return base, tip


def guess_place(table: Table, camera: Camera, urdf: str | PathLike[str], base: str | None, tip: str | None) -> Place | None:
    """Where camera and target stand, by the robot as its URDF has it; ``None`` where fewer than five pictures tell."""
    text = text_of_urdf(urdf)
    joints = Session.from_urdf(text, base, tip).joints
    configurations = [radians_of(joints, table.titles, row) for row in table.rows]
    if len(configurations) < 5:
        return None
    turns, places = tip_frames(text, base, tip, configurations)
    return place_of(camera, table.detections, turns, places)


def place_doubts(place: Place, given_rpy_deg: Sequence[float] | None, table: Table, camera: Camera) -> list[str]:
    """What a guessed place says of the target's size and of a camera's place as it was told."""
    doubts = size_doubt("the target", place.scale, place.scale_sd, camera.is_guess)
    if not LEAST_FOCAL < place.focal < MOST_FOCAL:
        doubts.append(
            f"pictures fit the URDF best with a focal length {place.focal:.3g} times as long as --fov-deg makes it: check signs, units and order of "
            "the joints, which row belongs to which picture, and --fov-deg"
        )
    if place.rms_px > 40:
        doubts.append(
            f"pictures and joint readings do not fit the URDF, by {place.rms_px:.0f} px: check signs, units and order of the joints, and "
            "which row belongs to which picture"
        )
    if given_rpy_deg is not None:
        best = [poses(it, camera)[0] for it in table.detections]
        doubt = frame_doubt(best, place.target_in_base_m, given_rpy_deg)
        if doubt:
            doubts.append(f"camera: {doubt}")
    return doubts


def calibration_toml(
    table: Table,
    camera: Camera,
    target: Target,
    *,
    file: str,
    urdf: str | None,
    base: str | None,
    tip: str | None,
    camera_place: dict[str, Any] | None,
    place: Place | None,
    name: str = "webcam-calibration",
) -> str:
    """The calibration file of a table; what is not known is a comment that says what to write."""
    lens = "as the camera gives them: its lens is learned" if camera.is_guess else "undistorted: the camera has no lens here"
    lines = [f"# Written by `python -m body_schema detect`. Pixels are {lens}.\n", toml_of({"name": name})]
    if place is not None and LEAST_FOCAL < place.focal < MOST_FOCAL:
        camera = replace(camera, focal_px=(camera.focal_px[0] * place.focal, camera.focal_px[1] * place.focal))
    if urdf is not None:
        robot = {"urdf": urdf} | ({"base": base} if base else {}) | ({"tip": tip} if tip else {})
        lines += ["\n[robot]\n", toml_of(robot)]
    else:
        lines.append('\n# Write here: [robot] with urdf = "robot.urdf", base = "…", tip = "…".\n')
    for section in target.sections():
        if place is not None:
            # Faces of a cube stand in one frame.
            section |= {
                "at_m": _rounded(place.target_at_m, 4),
                "rpy_deg": _rounded(place.target_rpy_deg, 2),
                "known": {"to_m": 0.03, "to_deg": 15.0},
            }
        lines += ["\n[[target]]\n", toml_of(section)]
        if place is None:
            lines.append("# Where it is on its link, if you know: at_m, rpy_deg, known = { to_m = 0.02, to_deg = 10.0 }.\n")
    lines += ["\n[[camera]]\n", toml_of(camera.section())]
    if camera_place is not None:
        lines.append(toml_of(camera_place))
    elif place is not None:
        lines.append("# Guessed from the pictures and the URDF.\n")
        lines.append(
            toml_of(
                {
                    "at_m": _rounded(place.camera_at_m, 4),
                    "rpy_deg": _rounded(place.camera_rpy_deg, 2),
                    "known": {"to_m": 0.1, "to_deg": 10.0},
                }
            )
        )
    else:
        lines.append("# Write here where it stands: at_m, and looks_at_m or rpy_deg (optical frame: z ahead, x right, y down),\n")
        lines.append("# and how well you know it, as known = { to_m = 0.1, to_deg = 15.0 }.\n")
    deviations = [math.sqrt(float(np.trace(it)) / 2) for detection in table.detections for it in detection.covariances]
    sigma = max(0.1, float(np.median(deviations))) if deviations else 0.5
    for channel, side in zip(table.columns, target.sides()):
        section = {
            "channel": "pixels",
            "camera": camera.name,
            "target": side.name,
            "sigma_px": round(sigma, 3),
            "columns": table.columns[channel],
        }
        lines += ["\n[[sensor]]\n", toml_of(section)]
    if urdf is not None:
        lines += [
            "\n# Where the base stands is the frame in which the camera's place is told.\n[base]\n",
            toml_of({"at_m": [0.0] * 3, "rpy_deg": [0.0] * 3}),
        ]
    lines += ["\n[measurements]\n", toml_of({"file": file}), "\n[held_out]\n", toml_of({"folds": 5})]
    return "".join(lines)


def _rounded(values: Sequence[float], digits: int) -> list[float]:
    return [round(float(it), digits) + 0.0 for it in values]
