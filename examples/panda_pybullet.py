#!/usr/bin/env python3
"""A Panda in PyBullet that is not as its URDF says: body_schema asks where to move, PyBullet moves and measures.

    pip install ./python pybullet numpy
    python examples/panda_pybullet.py --seeds 10
    python examples/panda_pybullet.py --url http://localhost:8080     # the same through a server

Every joint's frame is shifted by up to 1 cm and turned by up to 3 degrees, a marker hangs somewhere on the last link, and its
position is read with noise of 0.5 mm. Nobody says how wrong the URDF is. After 20 movements the learned URDF is loaded back into
PyBullet and predicts the marker at 200 postures that nobody has seen.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import random
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import body_schema

BASE, TIP = "panda_link0", "panda_link8"
SIGMA_M = 0.0005
HELD_OUT = 200


@contextlib.contextmanager
def quiet():
    """Without what PyBullet prints of links that weigh nothing."""
    sys.stdout.flush()
    kept, nothing = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nothing)


with quiet():
    import pybullet
    import pybullet_data


def described() -> str:
    """PyBullet's Panda without what is only drawn."""
    tree = ElementTree.parse(Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf")
    for link in tree.getroot().iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    return ElementTree.tostring(tree.getroot(), encoding="unicode")


def perturbed(urdf: str, draw: random.Random) -> str:
    """The same with the frames of its seven joints elsewhere."""
    root = ElementTree.fromstring(urdf)
    for joint in root.iter("joint"):
        if joint.get("type") != "revolute":
            continue
        origin = joint.find("origin")
        xyz = [float(x) for x in origin.get("xyz", "0 0 0").split()]
        rpy = [float(x) for x in origin.get("rpy", "0 0 0").split()]
        shift = [draw.uniform(-0.01, 0.01) for _ in range(3)]
        turn = pybullet.getQuaternionFromEuler([math.radians(draw.uniform(-3.0, 3.0)) for _ in range(3)])
        at, rotation = pybullet.multiplyTransforms(xyz, pybullet.getQuaternionFromEuler(rpy), shift, turn)
        origin.set("xyz", " ".join(map(repr, at)))
        origin.set("rpy", " ".join(map(repr, pybullet.getEulerFromQuaternion(rotation))))
    return ElementTree.tostring(root, encoding="unicode")


class Arm:
    """A robot in PyBullet, with a marker on its last link."""

    def __init__(self, urdf: str, marker: list[float], world: int) -> None:
        with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file, quiet():
            file.write(urdf)
            file.flush()
            self._body = pybullet.loadURDF(file.name, useFixedBase=True, physicsClientId=world)
        self._world, self._marker = world, marker
        self._joints, self._tip, self.limits = {}, -1, {}
        for index in range(pybullet.getNumJoints(self._body, physicsClientId=world)):
            info = pybullet.getJointInfo(self._body, index, physicsClientId=world)
            name, link = info[1].decode(), info[12].decode()
            if info[2] == pybullet.JOINT_REVOLUTE:
                self._joints[name], self.limits[name] = index, (info[8], info[9])
            if link == TIP:
                self._tip = index

    def marker_at(self, configuration: dict[str, float]) -> list[float]:
        """Moves there, and tells where the marker is then, m."""
        for name, position in configuration.items():
            pybullet.resetJointState(self._body, self._joints[name], position, physicsClientId=self._world)
        state = pybullet.getLinkState(self._body, self._tip, computeForwardKinematics=True, physicsClientId=self._world)
        at, _ = pybullet.multiplyTransforms(state[4], state[5], self._marker, [0, 0, 0, 1])
        return list(at)


def run(seed: int, movements: int, url: str | None, token: str | None) -> float:
    """The mean error of the learned URDF in PyBullet at postures that nobody has seen, mm."""
    draw = random.Random(seed)
    world = pybullet.connect(pybullet.DIRECT)
    try:
        urdf = described()
        robot = Arm(perturbed(urdf, draw), [draw.uniform(-0.1, 0.1) for _ in range(3)], world)
        asking = body_schema.Client(url, token=token) if url else body_schema.Session
        session = asking.from_urdf(urdf, BASE, TIP, seed=seed, target=[{"name": "marker"}])
        for _ in range(movements):
            target = session.suggest()["suggestions"][0]["configuration"]
            seen = [x + draw.gauss(0.0, SIGMA_M) for x in robot.marker_at(target)]
            answer = session.observe(target, marker=seen)
        # What a URDF does not hold: where the robot stands, and where the marker is on its link.
        report = session.report()
        base, marker = report["base"], report["targets"][0]["xyz_m"]
        learned = Arm(session.to_urdf(), marker, world)
        turn = pybullet.getQuaternionFromEuler(base["rpy_rad"])
        errors = []
        for _ in range(HELD_OUT):
            posture = {name: draw.uniform(*robot.limits[name]) for name in session.joints}
            predicted, _ = pybullet.multiplyTransforms(base["xyz_m"], turn, learned.marker_at(posture), [0, 0, 0, 1])
            errors.append(math.dist(predicted, robot.marker_at(posture)))
        error_mm = sum(errors) / len(errors) * 1e3
        expected = answer["expected_error_mm"]
        print(f"seed {seed}: {error_mm:.2f} mm after {movements} movements, {expected:.2f} mm were expected", flush=True)
        return error_mm
    finally:
        pybullet.disconnect(world)


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--seeds", type=int, default=3, help="how many robots [default: 3]")
    arguments.add_argument("--movements", type=int, default=20, help="how many movements each [default: 20]")
    arguments.add_argument("--below-mm", type=float, default=0.9, help="fail unless all are better [default: 0.9]")
    arguments.add_argument("--url", help="a server of body-schema; without one everything is computed here")
    arguments.add_argument("--token", help="what the server asks for")
    given = arguments.parse_args()
    errors = [run(seed, given.movements, given.url, given.token) for seed in range(1, given.seeds + 1)]
    return 0 if max(errors) < given.below_mm else 1


if __name__ == "__main__":
    sys.exit(main())
