"""The poses of all links of described robots at random postures, by pinocchio.

    python link_poses.py [FILE ...]

writes a line of JSON for each URDF file, and for each of the collection of the package example-robot-data if it is installed: the path,
and for each of a few postures the position of every joint of one coordinate by its name (radians, metres) and the pose of every link by
its name in the frame of the root, 3 x 4 numbers. Joints that mimic others have positions of their own. What pinocchio cannot read is
left out.
"""

import glob
import json
import math
import os
import sys

import numpy
import pinocchio


def posture(model, data, draws):
    configuration, positions = pinocchio.neutral(model), {}
    for name, joint in list(zip(model.names, model.joints))[1:]:
        if joint.nv != 1:
            continue
        position = draws.uniform(-1.5, 1.5)
        turned = [math.cos(position), math.sin(position)] if joint.nq == 2 else [position]
        configuration[joint.idx_q : joint.idx_q + joint.nq] = turned
        positions[name] = position
    pinocchio.framesForwardKinematics(model, data, configuration)
    links = [(frame.name, data.oMf[index]) for index, frame in enumerate(model.frames) if frame.type == pinocchio.FrameType.BODY]
    return {"positions": positions, "poses": {name: pose.homogeneous[:3].tolist() for name, pose in links}}


def main(paths, count=3):
    beside = os.path.join(os.path.dirname(pinocchio.__file__), *[os.pardir] * 4, "share", "example-robot-data", "robots")
    draws = numpy.random.default_rng(1)
    for path in paths + sorted(glob.glob(os.path.join(beside, "**", "*.urdf"), recursive=True)):
        try:
            model = pinocchio.buildModelFromUrdf(path)
        except Exception as error:
            print(f"{path}: {error}", file=sys.stderr)
            continue
        data = model.createData()
        print(json.dumps({"path": path, "postures": [posture(model, data, draws) for _ in range(count)]}))


main(sys.argv[1:])
