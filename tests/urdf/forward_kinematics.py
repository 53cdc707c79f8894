"""The pose of a link of a URDF at random postures, by yourdfpy.

    python forward_kinematics.py FILE BASE TIP

writes JSON: the joints that move, so many postures of them (radians, metres), and for each the tip link's pose in the base
link's frame as a 4 x 4 matrix.
"""

import json
import sys

import numpy
import yourdfpy


def main(path, base, tip, count=20):
    robot = yourdfpy.URDF.load(path, load_meshes=False, build_collision_scene_graph=False)
    draws = numpy.random.default_rng(1)
    postures, poses = [], []
    for _ in range(count):
        posture = draws.uniform(-1.5, 1.5, robot.num_actuated_joints)
        robot.update_cfg(posture)
        postures.append(posture.tolist())
        poses.append(robot.get_transform(tip, base).tolist())
    json.dump({"joints": robot.actuated_joint_names, "postures": postures, "poses": poses}, sys.stdout)
    print()


main(*sys.argv[1:])
