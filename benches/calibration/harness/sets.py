"""Sets of measurements: what their manifests say, read and checked; and simulated robots."""

from __future__ import annotations

import csv
import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from kinematics import Chain, of_quaternion, of_rpy, pose, quaternion, rotation

HERE = Path(__file__).resolve().parent.parent


class SetError(ValueError):
    """A manifest or a file of it that is not as it should be."""


@dataclass
class Rows:
    """Postures (n, joints), and per row and sensor a reading: 3 or 7 numbers, or the name of a socket."""

    postures: np.ndarray
    readings: list[list[Any]]
    # Of simulated robots: a point and a direction of every axis.
    axes: list[list[list[float]]] | None = None


@dataclass(eq=False)
class Set:
    """A set as its manifest says it; ``rows`` are those of all its tables."""

    name: str
    about: str
    manifest: dict[str, Any]
    urdf: Path
    chain: Chain
    rows: Rows | None
    digest: str = field(default="")

    @property
    def sockets(self) -> bool:
        return self.manifest["sensors"][0]["kind"] == "socket"

    @property
    def simulated(self) -> dict[str, Any] | None:
        return self.manifest.get("simulated")


def digest_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _file(folder: Path, entry: dict[str, str], manifest: Path) -> Path:
    path = (folder / entry["file"]).resolve()
    if not path.is_file():
        raise FileNotFoundError(entry["file"])
    found = digest_of(path)
    if found != entry["sha256"]:
        raise SetError(
            f"{manifest.name}: {entry['file']} is another file than the manifest means (sha256 {found}, not {entry['sha256']}); "
            "bring the right one, or write a manifest of its own for this one"
        )
    return path


def _position(row: dict[str, str], joint: str, named: dict[str, Any], where: str) -> float:
    """A joint's position, rad or m: from the column of its name, or from the one that the manifest names, in units of `scale`."""
    of = named.get(joint, {})
    column = of.get("column", joint)
    if column not in row:
        raise SetError(f'{where}: there is no column {column}; name that of the joint: "joints": {{"{joint}": {{"column": "…", "scale": 1.0}}}}')
    try:
        return float(row[column]) * of.get("scale", 1.0)
    except (TypeError, ValueError):
        raise SetError(f"{where}: {row[column]!r} in {column} is no position of a joint") from None


def _reading(row: dict[str, str], sensor: dict[str, Any], where: str) -> Any:
    """The reading of one sensor, ``None`` where a cell is empty."""
    cells = [row[column] for column in sensor["columns"]]
    if sensor["kind"] == "socket":
        return "/".join(cells)
    if any(cell.strip().lower() in ("", "nan", "na", "none", "null", "-") for cell in cells):
        return None
    try:
        numbers = np.array([float(cell) for cell in cells]) * sensor.get("scale", 1.0)
    except ValueError as error:
        raise SetError(f"{where}: {error}; write numbers, or leave the cells empty") from None
    if sensor["kind"] == "position":
        return numbers.tolist()
    turned = of_rpy(numbers[3:]) if sensor["rotation"] == "rpy" else of_quaternion(numbers[3:])
    return [*numbers[:3].tolist(), *quaternion(turned).tolist()]


def load(manifest: Path) -> Set:
    """Reads a manifest and its files. Raises ``FileNotFoundError`` where one is absent, ``SetError`` where one is wrong."""
    try:
        said = json.loads(manifest.read_text())
        folder = manifest.parent
        urdf = _file(folder, said["urdf"], manifest)
        chain = Chain.of_urdf(urdf, said["base"], said["tip"])
        rows = None
        if "simulated" not in said:
            postures, readings = [], []
            for entry in said["tables"]:
                path = _file(folder, entry, manifest)
                with path.open(newline="") as file:
                    for line, row in enumerate(csv.DictReader(file), start=2):
                        where = f"{path.name}, line {line}"
                        readings.append([_reading(row, sensor, where) for sensor in said["sensors"]])
                        postures.append([_position(row, joint.name, said.get("joints", {}), where) for joint in chain.joints])
            rows = Rows(np.array(postures), readings)
    except (KeyError, json.JSONDecodeError) as error:
        raise SetError(f"{manifest.name}: {error} is missing or wrong; the keys are those of the other manifests") from error
    digest = hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()
    return Set(manifest.stem, said["about"], said, urdf, chain, rows, digest)


def found(folders: list[Path], say=print) -> list[Set]:
    """All sets of some folders; one whose files are absent is told and left out."""
    sets: list[Set] = []
    for manifest in sorted(path for folder in folders for path in folder.glob("*.json")):
        try:
            sets.append(load(manifest))
        except FileNotFoundError as error:
            say(f"{manifest.stem}: left out, {error} is not here")
    return sets


def simulate(of: Set, split: int) -> tuple[Rows, Rows]:
    """A robot of its own for a split: rows to learn from, and rows that are held out, with the sensors' noise on both."""
    said = of.manifest["simulated"]
    random = np.random.default_rng(int(hashlib.sha256(f"{of.name}/{split}".encode()).hexdigest()[:15], 16))
    origins = []
    for joint in of.chain.joints:
        turn = rotation(random.normal(0, said["direction_rad"], 3))
        offset = joint.motion(np.array(random.normal(0, said["offset_rad"])))
        origins.append(joint.origin @ pose(turn, random.normal(0, said["point_m"], 3)) @ offset)
    base = pose(rotation(random.normal(0, 0.2, 3)), random.normal(0, 0.3, 3))
    mounted = pose(rotation(random.normal(0, 0.3, 3)), random.uniform(0.03, 0.12, 3))
    sensor = of.manifest["sensors"][0]

    def rows(count: int) -> Rows:
        lower, upper = (np.array([getattr(j, side) for j in of.chain.joints]) for side in ("lower", "upper"))
        middle, reach = (lower + upper) / 2, np.minimum((upper - lower) / 2, said["range_rad"])
        postures = middle + reach * random.uniform(-1, 1, (count, len(middle)))
        at = base @ of.chain.frames(postures, origins)[1] @ mounted
        places = at[:, :3, 3] + random.normal(0, sensor["sigma_m"], (count, 3))
        if sensor["kind"] == "position":
            return Rows(postures, [[place.tolist()] for place in places])
        turned = at[:, :3, :3] @ rotation(random.normal(0, np.radians(sensor["sigma_deg"]), (count, 3)))
        return Rows(postures, [[[*p.tolist(), *q.tolist()]] for p, q in zip(places, quaternion(turned))])

    learn, judge = rows(said["rows"]), rows(said["held_out"])
    learn.axes = of.chain.axes(base, origins)
    return learn, judge
