"""The poses of all links of robots whose joints branch, at random postures, by yourdfpy.

    python link_poses.py FILE ...

writes JSON: of each URDF file, for each of a few postures the position of every joint by its name (radians, metres), and the pose
of every link by its name in the frame of the link `base`, a 4 x 4 matrix.
"""

import json
import sys

import numpy
import yourdfpy


def posture(robot, draws):
    positions = draws.uniform(-2.0, 2.0, robot.num_actuated_joints)
    robot.update_cfg(positions)
    poses = {link: robot.get_transform(link, "base").tolist() for link in robot.link_map}
    return {"positions": dict(zip(robot.actuated_joint_names, positions.tolist())), "poses": poses}


def main(paths, count=5):
    draws = numpy.random.default_rng(1)
    robots = [yourdfpy.URDF.load(path, load_meshes=False, build_collision_scene_graph=False) for path in paths]
    json.dump([[posture(robot, draws) for _ in range(count)] for robot in robots], sys.stdout)


main(sys.argv[1:])
