"""The held-out figure of a calibration, by yourdfpy: from the URDFs that it wrote and the table, knowing nothing of this project.

    python held_out.py FOLDER TABLE[,TABLE ...] [COLUMN COLUMN COLUMN]

FOLDER is what `calibrate --out` wrote. The three columns are those of the target's measured place (metres); without them a
target was held in sockets, which the columns `place` and `socket` tell. Writes JSON: the mean of the distances in
millimetres, and how many they are.
"""

import csv
import json
import math
import pathlib
import sys

import numpy
import yourdfpy


def frame(xyz, rpy):
    (sr, sp, sy), (cr, cp, cy) = numpy.sin(rpy), numpy.cos(rpy)
    pose = numpy.eye(4)
    pose[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    pose[:3, 3] = xyz
    return pose


def number(row, joint):
    for end, factor in [("", 1.0), ("_rad", 1.0), ("_deg", math.pi / 180), ("_m", 1.0), ("_mm", 1e-3)]:
        if joint + end in row:
            return float(row[joint + end]) * factor
    return 0.0


def predicted(urdf, chain, base, target, rows):
    robot = yourdfpy.URDF.load(str(urdf), load_meshes=False, build_collision_scene_graph=False)
    base = frame(base["xyz_m"], base["rpy_rad"])
    point = numpy.array([*target["xyz_m"], 1.0])
    for row in rows:
        robot.update_cfg([number(row, joint) for joint in robot.actuated_joint_names])
        yield (base @ robot.get_transform(target["link"], chain["base"]) @ point)[:3]


def distances(urdf, chain, base, target, rows, columns):
    points = list(predicted(urdf, chain, base, target, rows))
    if columns:
        measured = [[float(row[column]) for column in columns] for row in rows]
        return [numpy.linalg.norm(point - place) for point, place in zip(points, measured)]
    held = {}
    for row, point in zip(rows, points):
        held.setdefault((row["place"], row["socket"]), []).append(point)
    return [numpy.linalg.norm(point - numpy.mean(there, axis=0)) for there in held.values() for point in there]


def main(folder, tables, *columns):
    folder = pathlib.Path(folder)
    report = json.loads((folder / "report.json").read_text())
    # Rows are numbered on through all tables.
    rows = []
    for table in tables.split(","):
        with open(table, newline="") as file:
            rows += csv.DictReader(file)
    parts = [
        (folder / "folds" / str(fold["fold"]) / "calibrated.urdf", fold["rows"], fold["base"], fold["targets"][0])
        for fold in report["held_out"]["folds"]
    ]
    if not parts:
        held_out = sorted({reading["row"] for reading in report["residuals"] if reading["held_out"]})
        parts = [(folder / "calibrated.urdf", held_out, report["base"], report["targets"][0])]
    found = []
    for urdf, numbers, base, target in parts:
        chosen = [rows[number - 1] for number in numbers]
        found += distances(urdf, report["chain"], base, target, chosen, columns)
    json.dump({"mean_mm": float(numpy.mean(found)) * 1e3, "readings": len(found)}, sys.stdout)
    print()


main(*sys.argv[1:])
