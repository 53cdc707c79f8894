"""Whether robots hit themselves at random postures, by the meshes of their descriptions: with pinocchio and coal.

    python collisions.py

writes a line of JSON for each of some robots of the package example-robot-data: the path of the URDF, the links between which its joints
are taken, and postures, each with the position of every joint by its name (radians, metres) and whether two links meet of which neither
is the other nor carries it. What other joints move stands at 0.
"""

import json
import os

import coal
import numpy
import pinocchio

POSTURES = 2000
ROBOTS = [
    ("UR10", "ur_description/urdf/ur10_robot.urdf", "base_link", ["tool0"]),
    ("UR3", "ur_description/urdf/ur3_robot.urdf", "base_link", ["tool0"]),
    ("Panda", "panda_description/urdf/panda.urdf", "panda_link0", ["panda_hand"]),
    ("xArm 7", "xarm_description/urdf/xarm7.urdf", "link_base", ["link_eef"]),
    ("SO-101", "so_arm_description/urdf/so101.urdf", "base_link", ["gripper_link"]),
    ("Z1", "z1_description/urdf/z1.urdf", "link00", ["gripperStator"]),
]


def share():
    return os.path.abspath(os.path.join(os.path.dirname(pinocchio.__file__), *[os.pardir] * 4, "share"))


def reduced(path, base, tips):
    """The joints between base and tips with the shapes of all links; the others stand at 0."""
    whole = pinocchio.buildModelFromUrdf(path)
    shapes = pinocchio.buildGeomFromUrdf(whole, path, pinocchio.GeometryType.COLLISION, package_dirs=[share()])

    def carrier(link):
        return whole.frames[whole.getFrameId(link, pinocchio.FrameType.BODY)].parentJoint

    moved = set()
    for tip in tips:
        joint = carrier(tip)
        while joint and joint != carrier(base):
            moved.add(joint)
            joint = whole.parents[joint]
    others = [joint for joint in range(1, whole.njoints) if joint not in moved]
    return pinocchio.buildReducedModel(whole, shapes, others, pinocchio.neutral(whole))


def postures(path, base, tips, draws):
    model, shapes = reduced(path, base, tips)
    data, placed = model.createData(), shapes.createData()
    lower = numpy.maximum(model.lowerPositionLimit, -numpy.pi)
    upper = numpy.minimum(model.upperPositionLimit, numpy.pi)
    parts = list(enumerate(shapes.geometryObjects))

    def is_pair(a, b):
        a, b = a.parentJoint, b.parentJoint
        return a != b and model.parents[a] != b and model.parents[b] != a

    pairs = [(i, j) for i, a in parts for j, b in parts[i + 1 :] if is_pair(a, b)]

    def meet(i, j):
        (a, at), (b, bt) = ((shapes.geometryObjects[k].geometry, placed.oMg[k]) for k in (i, j))
        first, second = (coal.Transform3s(it.rotation, it.translation) for it in (at, bt))
        return coal.collide(a, first, b, second, coal.CollisionRequest(), coal.CollisionResult()) > 0

    for _ in range(POSTURES):
        positions = lower + (upper - lower) * draws.random(model.nq)
        pinocchio.forwardKinematics(model, data, positions)
        pinocchio.updateGeometryPlacements(model, data, shapes, placed)
        yield {"positions": dict(zip(list(model.names)[1:], positions.tolist())), "meets": any(meet(i, j) for i, j in pairs)}


def main():
    for name, file, base, tips in ROBOTS:
        path = os.path.join(share(), "example-robot-data", "robots", file)
        drawn = list(postures(path, base, tips, numpy.random.default_rng(1)))
        print(json.dumps({"name": name, "path": path, "base": base, "tips": tips, "postures": drawn}), flush=True)


main()
