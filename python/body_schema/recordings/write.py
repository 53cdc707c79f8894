"""The table, its calibration file, and what became of the recording, as files."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._errors import wrong
from .._transforms import rpy_of
from .._urdf import Joint
from .._words import size_doubt
from .chain import Description
from .moments import Row
from .places import places_of
from .tracks import LEAST_POINTS, SensorTrack, homogeneous

if TYPE_CHECKING:
    from .taken import Taken

COMPONENTS = {"position": ["x", "y", "z"], "pose": ["x", "y", "z", "qx", "qy", "qz", "qw"]}
LEAST_M, LEAST_DEG, LEAST_PX = 1e-4, 0.02, 0.05
"""Nobody's sensor is stated to be better, however many readings were averaged."""


def columns(sensor: SensorTrack) -> list[str]:
    """The titles of a sensor's columns."""
    if sensor.kind == "pixels":
        assert sensor.camera is not None
        count = sensor.values.shape[1] // 2
        return [f"{sensor.camera.name}_{sensor.name}_{axis}{point + 1}" for point in range(count) for axis in "uv"]
    return [f"{sensor.name}_{component}" for component in COMPONENTS[sensor.kind]]


def titles(joints: Sequence[str], sensors: Sequence[SensorTrack]) -> list[str]:
    """The titles of a table: joints, then the columns of every sensor."""
    all_of = [*joints, *(title for sensor in sensors for title in columns(sensor))]
    if len(set(all_of)) != len(all_of):
        twice = next(title for title in all_of if all_of.count(title) > 1)
        raise wrong("sensor", f"two columns would be called {twice}", "name the sensor otherwise, as --sensor NAME=TOPIC")
    return all_of


def cells(row: Row, sensors: Sequence[SensorTrack], on_hand: dict[str, bool]) -> list[str]:
    """A row under these titles: joints in rad and m, then what every sensor read, empty where it read nothing.

    The poses of a sensor that is on the hand are turned round: those of the sensor in the frame of its target.
    """
    found = [f"{position:.9g}" for position in row.positions]
    for sensor in sensors:
        reading = row.readings.get(sensor.name)
        if reading is None:
            found += [""] * len(columns(sensor))
            continue
        values = reading.values
        if sensor.kind == "pose" and on_hand[sensor.name]:
            values = _turned_round(values)
        # A point that is not seen is an empty cell.
        found += [f"{value:.9g}" if math.isfinite(value) else "" for value in values]
    return found


def csv_of(rows: Iterable[Sequence[str]]) -> str:
    """Rows of cells as CSV."""
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def table(joints: Sequence[str], sensors: Sequence[SensorTrack], rows: Sequence[Row], on_hand: dict[str, bool]) -> str:
    """The table as CSV."""
    return csv_of([titles(joints, sensors), *(cells(row, sensors, on_hand) for row in rows)])


def calibration(name: str, taken: Taken, moving: bool, learn: str) -> tuple[str, list[str]]:
    """The calibration file of the table ``NAME.csv`` and the URDF ``robot.urdf`` beside it, and doubts; ``learn`` is ``axes`` or ``zeros``."""
    doubts: list[str] = []
    description, chain, joints, rows = taken.description, taken.chain, taken.joints.names, taken.kept
    base, tip = taken.ends
    lines = [f"# Calibration of {name}: body-schema calibrate {name}.toml", "# Made of a recording by `python -m body_schema import`.", ""]
    lines += [f"name = {_text(name)}", "", "[robot]", 'urdf = "robot.urdf"', f"base = {_text(base)}", f"tip = {_text(tip)}"]
    if learn == "zeros":
        lines += ["# The zeros of all joints, and no axis.", 'learn = "zeros"']
    if moving:
        lines += _reading_sigmas(chain, joints, rows)
    for sensor in taken.sensors:
        on_hand = taken.on_hand[sensor.name]
        kept = [row.readings[sensor.name] for row in rows if sensor.name in row.readings]
        sigma = _median([reading.deviation for reading in kept])
        if sensor.kind == "pixels":
            more, doubtful = _pixels(sensor, description, chain, tip, rows, on_hand, sigma)
            lines, doubts = lines + more, doubts + doubtful
            continue
        lines += ["", "# Where it is on the tip is found.", "[[target]]", f"name = {_text(sensor.name)}"]
        lines += ["", "[[sensor]]", f'channel = "{sensor.kind}"', f"target = {_text(sensor.name)}"]
        lines += [f"columns = [{', '.join(map(_text, columns(sensor)))}]"]
        lines += ["# By how much readings of one moment differ; how much noise there is, is learned."]
        lines += [f"sigma_m = {_stated(sigma, LEAST_M)}"]
        if sensor.kind == "pose":
            turn = _median([reading.turn for reading in kept])
            lines += [f"sigma_deg = {_stated(math.degrees(turn), LEAST_DEG)}"]
    lines += ["", "[measurements]", f"file = {_text(name + '.csv')}", ""]
    lines += ["# What nothing is learned from: it says how good the calibration is on data that it has not seen.", "[held_out]"]
    lines += [f"folds = {max(2, min(5, len(rows)))}", ""]
    if learn == "zeros":
        lines += ["# How well the zeros were set: by eye.", "[prior]", "offset_rad = 0.1", "offset_m = 0.01", ""]
    else:
        lines += ["# How well the description is known: about half a degree and a few millimetres.", "[prior]"]
        lines += ["direction_rad = 0.01", "point_m = 0.005", ""]
    return "\n".join(lines), doubts


def written(folder: Path, files: dict[str, str], overwrite: bool) -> None:
    """Write files that have their names only once they are whole. Those that are there are replaced only with ``overwrite``."""
    there = [name for name in files if (folder / name).exists()]
    if there and not overwrite:
        raise wrong("out", f"{folder} has {', '.join(there)} already", "name another folder with --out, or add --overwrite")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            part = folder / f".{name}.part"
            part.write_bytes(text.encode("utf-8"))
            os.replace(part, folder / name)
    except OSError as error:
        raise wrong("out", f"{error.filename or folder}: {error.strerror}", "name a folder that can be written, with --out") from None


def plain(value: Any) -> Any:
    """What JSON can hold: numbers that are none as null."""
    if isinstance(value, dict):
        return {str(key): plain(it) for key, it in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(it) for it in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return round(value, 9) if math.isfinite(value) else None
    return value


def as_json(value: dict[str, Any]) -> str:
    return json.dumps(plain(value), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _pixels(
    sensor: SensorTrack, description: Description, chain: list[Joint], tip: str, rows: Sequence[Row], on_hand: bool, sigma: float
) -> tuple[list[str], list[str]]:
    """The sections of a sensor of pixels, and what is doubtful of them."""
    camera = sensor.camera
    assert camera is not None and sensor.points_m is not None
    seen = [row for row in rows if sensor.name in row.readings]
    points = np.array(sensor.points_m)
    guess = None
    if len(seen) >= 3 and np.abs(points[:, 2]).max() > 1e-9:
        raise wrong("sensor", f"the points of {sensor.name} are not in the plane z = 0", "name a target with one flat print")
    if len(seen) >= 3:
        positions, pixels = np.array([row.positions for row in seen]), np.array([row.readings[sensor.name].values for row in seen])
        guess = places_of(camera, points, pixels, description, chain, positions, on_hand)
    if guess is None:
        raise wrong("sensor", f"{sensor.name} was seen at {len(seen)} postures: too few to place its camera", "record more postures")
    camera = replace(camera, focal_px=(camera.focal_px[0] * guess.focal, camera.focal_px[1] * guess.focal))
    target, eye = (guess.standing, guess.carried) if on_hand else (guess.carried, guess.standing)
    base = description.base()

    def place(pose: Any, link: str | None) -> list[str]:
        at = ", ".join(f"{float(it):.4f}" for it in pose[:3, 3])
        angles = ", ".join(f"{math.degrees(it):.2f}" for it in rpy_of(pose[:3, :3]))
        linked = [f"link = {_text(link)}"] if link else []
        return [*linked, f"at_m = [{at}]", f"rpy_deg = [{angles}]", "known = { to_m = 0.1, to_deg = 10.0 }"]

    lines = ["", "# Places by the robot as described and the recording; both are learned.", "[[target]]", f"name = {_text(sensor.name)}"]
    lines += place(target, base if on_hand else tip)
    lines += [f"points_m = [{', '.join('[' + ', '.join(f'{x:.6g}' for x in point) + ']' for point in points)}]"]
    if sensor.is_partly_seen:
        lines += ["partly_seen = true", f"least_points = {LEAST_POINTS}"]
    if sensor.facing is not None:
        lines += [f"facing = [{', '.join(f'{it:.6g}' for it in sensor.facing)}]"]
    lines += ["", "[[camera]]", f"name = {_text(camera.name)}", *place(eye, tip if on_hand else None)]
    lines += [f"{key} = [{pair[0]:.6g}, {pair[1]:.6g}]" for key, pair in _lens(camera)]
    if camera.learned:
        lines += ["# Nobody has calibrated it: focal lengths, centre and lens are learned from pixels as they are."]
        lines += [f"{key} = {json.dumps(value)}" for key, value in camera.learned.items()]
    # Where the robot stands is a matter of the camera's place: the frame of the measurements is that of the base.
    lines += ["", "[base]", "at_m = [0.0, 0.0, 0.0]", "rpy_deg = [0.0, 0.0, 0.0]"]
    lines += ["", "[[sensor]]", 'channel = "pixels"', f"camera = {_text(camera.name)}", f"target = {_text(sensor.name)}"]
    lines += [f"columns = [{', '.join(map(_text, columns(sensor)))}]", f"sigma_px = {_stated(sigma, LEAST_PX)}"]
    return lines, size_doubt(sensor.name, guess.scale, guess.scale_sd, bool(camera.learned))


def _lens(camera: Any) -> list[tuple[str, tuple[float, float]]]:
    return [("size_px", camera.size_px), ("focal_px", camera.focal_px), ("centre_px", camera.centre_px)]


def _reading_sigmas(chain: list[Joint], joints: Sequence[str], rows: Sequence[Row]) -> list[str]:
    """How far joints stand beside their readings because the time is not known better: root mean squares over rows."""
    kinds = {joint.name: joint.kind for joint in chain}
    sizes = np.sqrt(np.mean(np.square([row.deviations for row in rows]), axis=0))
    turning = [math.degrees(size) for name, size in zip(joints, sizes) if kinds.get(name) != "prismatic"]
    sliding = [float(size) for name, size in zip(joints, sizes) if kinds.get(name) == "prismatic"]
    lines = ["# Speed times the deviation of the clock's offset: by so much joints stand beside what was interpolated."]
    if turning:
        lines += [f"reading_sigma_deg = [{', '.join(f'{max(it, 1e-4):.4g}' for it in turning)}]"]
    if sliding:
        lines += [f"reading_sigma_m = [{', '.join(f'{max(it, 1e-6):.4g}' for it in sliding)}]"]
    return lines


def _turned_round(pose: Any) -> Any:
    """The inverse of a pose x, y, z, qx, qy, qz, qw."""
    place = homogeneous(np.asarray(pose)[None])[0]
    back = -place[:3, :3].T @ place[:3, 3]
    return np.array([*back, *(-np.asarray(pose[3:6])), pose[6]])


def _stated(sigma: float, least: float) -> str:
    return f"{max(sigma, least) if math.isfinite(sigma) else least * 5:.3g}"


def _median(values: Sequence[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return float(np.median(finite)) if finite else math.nan


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
