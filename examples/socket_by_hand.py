#!/usr/bin/env python3
"""A real Panda that is calibrated by hand: a person pushes a ball into sockets where the session asks for it.

    pip install ./python
    python examples/socket_by_hand.py

Nothing is read but the joints. Here the person is a table of what was measured of a real robot (scenarios/panda-sockets.csv): it
answers each prompt with the nearest posture that it holds. How far the predicted ball scatters at seven places that nothing was
learned from is what counts.
"""

from __future__ import annotations

import csv
import math
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import body_schema

SCENARIOS = Path(__file__).resolve().parent.parent / "scenarios"
BASE, TIP, PLACE = "panda_link0", "panda_link8", "front_center"
MOVEMENTS = 20

Posture = dict[str, float]


def table() -> list[tuple[str, Posture]]:
    """Every row: place and socket, and where the joints were, rad."""
    with open(SCENARIOS / "panda-sockets.csv", newline="", encoding="utf-8") as file:
        return [
            (f"{row.pop('place')}/{row.pop('socket')}", {joint: float(q) for joint, q in row.items()})
            for row in csv.DictReader(file)
        ]


def rotated(rotation: list[list[float]], vector: list[float]) -> list[float]:
    return [sum(a * b for a, b in zip(row, vector)) for row in rotation]


def product(a: list[list[float]], b: list[list[float]]) -> list[list[float]]:
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def about(axis: list[float], angle: float) -> list[list[float]]:
    """The rotation about a unit axis."""
    (x, y, z), c, s = axis, math.cos(angle), math.sin(angle)
    across = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return [[c * (i == j) + (1 - c) * axis[i] * axis[j] + s * across[i][j] for j in range(3)] for i in range(3)]


def places_of(urdf: str, ball: list[float], rows: list[tuple[str, Posture]]) -> list[list[float]]:
    """Where a URDF has the ball at every row, m, in the frame of the base link."""
    joints = {joint.find("child").get("link"): joint for joint in ElementTree.fromstring(urdf).iter("joint")}
    chain, link = [], TIP
    while link != BASE:
        chain.insert(0, joints[link])
        link = joints[link].find("parent").get("link")

    def numbers(joint: ElementTree.Element, tag: str, name: str, usual: str) -> list[float]:
        element = joint.find(tag)
        return [float(x) for x in (usual if element is None else element.get(name, usual)).split()]

    def at(posture: Posture) -> list[float]:
        point = list(ball)
        for joint in reversed(chain):
            angle = posture.get(joint.get("name"), 0.0)
            point = rotated(about(numbers(joint, "axis", "xyz", "1 0 0"), angle), point)
            roll, pitch, yaw = numbers(joint, "origin", "rpy", "0 0 0")
            turn = product(about([0, 0, 1], yaw), product(about([0, 1, 0], pitch), about([1, 0, 0], roll)))
            point = [a + b for a, b in zip(rotated(turn, point), numbers(joint, "origin", "xyz", "0 0 0"))]
        return point

    return [at(posture) for _, posture in rows]


def scatter_mm(urdf: str, ball: list[float], rows: list[tuple[str, Posture]]) -> float:
    """How far the ball is from its mean over the same socket, mean over all rows, mm."""
    by_socket: dict[str, list[list[float]]] = {}
    for (socket, _), at in zip(rows, places_of(urdf, ball, rows)):
        by_socket.setdefault(socket, []).append(at)
    errors = []
    for places in by_socket.values():
        mean = [sum(at[k] for at in places) / len(places) for k in range(3)]
        errors.extend(math.dist(at, mean) for at in places)
    return sum(errors) / len(errors) * 1e3


def main() -> int:
    rows = table()
    left = [row for row in rows if row[0].startswith(f"{PLACE}/")]
    elsewhere = [row for row in rows if not row[0].startswith(f"{PLACE}/")]
    beginnings = {socket: posture for socket, posture in reversed(left)}
    session = body_schema.Session.from_urdf(
        SCENARIOS / "panda.urdf",
        BASE,
        TIP,
        # The person has pushed the ball into both sockets once, to begin with.
        socket=[
            {"place": PLACE, "name": socket.split("/")[1], "posture_deg": [math.degrees(q) for q in posture.values()]}
            for socket, posture in sorted(beginnings.items())
        ],
        sockets={"sigma_m": 0.0002, "distance_m": 0.05, "sigma_distance_m": 0.0001},
        smoother={"hypotheses": 2, "spawned": 1},
        selection={"criterion": "d"},
    )

    def judged() -> tuple[float, list[float]]:
        ball = session.report()["targets"][0]["xyz_m"]
        return scatter_mm(session.to_urdf(), ball, elsewhere), ball

    for movement in range(1, MOVEMENTS + 1):
        asked = session.suggest()["suggestions"][0]

        def away(row: tuple[str, Posture]) -> float:
            return max(abs(q - asked["configuration"][joint]) for joint, q in row[1].items())

        found = min((row for row in left if row[0] == asked["socket"]), key=away)
        left.remove(found)
        socket, posture = found
        answer = session.observe(posture, socket=socket)
        print(f"{movement:2}: into {asked['socket']}, {away(found):.2f} rad from what was asked; ", end="")
        print(f"{answer['expected_error_mm']:6.2f} mm are expected")
    after, ball = judged()
    before = scatter_mm((SCENARIOS / "panda.urdf").read_text(encoding="utf-8"), ball, elsewhere)
    print(f"scatter at the seven other places: {before:.2f} mm as described, {after:.2f} mm after {MOVEMENTS} movements")
    return 0 if after < 0.7 and after < before else 1


if __name__ == "__main__":
    sys.exit(main())
