"""pybotics: its modified Denavit-Hartenberg chain, tool and world, by ``least_squares`` without a prior, as its examples do.

It knows positions of one tool. Of several targets the chains share their parameters, and each has its tool.
"""

import importlib.metadata

import numpy as np
from _kit import Model, main
from pybotics.kinematic_chain import MDHKinematicChain
from pybotics.link import PrismaticMDHLink, RevoluteMDHLink
from pybotics.optimization import OptimizationHandler
from pybotics.robot import Robot
from pybotics.tool import Tool
from scipy.optimize import least_squares


def angle(one, other, about):
    """From one direction to another about an axis, rad."""
    return float(np.arctan2(np.cross(one, other) @ about, one @ other))


def normal(point, axis, other, other_axis):
    """The common normal of two lines: where it leaves the first, and its direction."""
    across = np.cross(axis, other_axis)
    size, between = np.linalg.norm(across), other - point
    if size > 1e-9:
        across /= size
        foot = point + (np.cross(between, other_axis) @ across / size) * axis
        return foot, across if across @ (other - foot) >= 0 else -across
    apart = between - (between @ axis) * axis
    if np.linalg.norm(apart) < 1e-9:
        apart = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    return point, apart / np.linalg.norm(apart)


def described(chain):
    """The links of a chain in MDH's form, the frame before the first, and the tip behind the last."""
    frames, tip = chain.frames(np.zeros((1, len(chain.joints))))
    points = [frame[0, :3, 3] for frame in frames]
    axes = [frame[0, :3, :3] @ joint.axis for frame, joint in zip(frames, chain.joints)]
    feet, across = [], []
    for k in range(len(axes)):
        last = k + 1 == len(axes)
        foot, x = normal(points[k], axes[k], points[k] if last else points[k + 1], axes[k] if last else axes[k + 1])
        feet.append(foot)
        across.append(x)
    stood = [np.block([[np.column_stack([x, np.cross(z, x), z]), p[:, None]], [np.eye(4)[3:]]]) for x, z, p in zip(across, axes, feet)]
    links = []
    for k, joint in enumerate(chain.joints):
        before = max(k - 1, 0)
        z, x, x_before, between = axes[k], across[k], across[before], feet[k] - feet[before]
        numbers = [angle(axes[before], z, x_before), between @ x_before, angle(x_before, x, z), between @ z]
        links.append((PrismaticMDHLink if joint.slides else RevoluteMDHLink)(*numbers))
    return links, stood[0], np.linalg.inv(stood[-1]) @ tip[0]


class Robots:
    """A handler for each target, whose chain and world are the same."""

    def __init__(self, task):
        model = Model(task)
        x = model.rigid()
        links, first, tip = described(task.chain)
        world = model.base @ model.at(x, model.n) @ first
        free = [False] * 4 + [True] * (4 * (len(links) - 1))
        self.handlers = []
        for target, mount in enumerate(model.mounts):
            tool = Tool(tip @ mount @ model.at(x, model.n + 1 + target))
            robot = Robot(kinematic_chain=MDHKinematicChain(links), tool=tool, world_frame=world)
            self.handlers.append(OptimizationHandler(robot, free, [True] * 3 + [False] * 3, True))
        self.links = 4 * (len(links) - 1)
        vectors = [handler.generate_optimization_vector() for handler in self.handlers]
        self.start = np.concatenate([vectors[0][: self.links], vectors[0][-6:], *(vector[self.links : -6] for vector in vectors)])

    def places(self, y, postures):
        """Where the targets are, (rows, targets, 3)."""
        places = []
        for target, handler in enumerate(self.handlers):
            tool = y[self.links + 6 + 3 * target :][:3]
            handler.apply_optimization_vector(np.concatenate([y[: self.links], tool, y[self.links : self.links + 6]]))
            places.append([handler.robot.fk(q)[:3, 3] for q in postures])
        return np.moveaxis(np.array(places), 0, 1)

    def axes(self, y):
        """A point and a direction of every axis at 0."""
        self.places(y, [])
        robot = self.handlers[0].robot
        at, axes = robot.world_frame, []
        for transform in robot.kinematic_chain.transforms(np.zeros(robot.ndof)):
            at = at @ transform
            axes.append([at[:3, 3].tolist(), at[:3, 2].tolist()])
        return axes


def play(task):
    for budget in task.budgets:
        task.fill(budget)
        robots, q = Robots(task), task.pool[task.rows]
        sigmas = np.array([sensor["sigma_m"] for sensor in task.sensors])[:, None]
        seen = np.array([[reading is not None for reading in row] for row in task.readings])
        read = np.array([[reading[:3] if reading else [0.0] * 3 for reading in row] for row in task.readings])

        def residuals(y):
            return ((robots.places(y, q) - read) / sigmas)[seen].ravel()

        found = least_squares(residuals, robots.start, x_scale="jac", max_nfev=50)
        free = len(found.fun) - np.linalg.matrix_rank(found.jac)
        scale = np.sqrt(2 * found.cost / free) if free > 3 else 1.0
        covariance = scale**2 * np.linalg.pinv(found.jac.T @ found.jac)
        mean = robots.places(found.x, task.test)
        steps = 1e-6 * np.eye(len(found.x))
        by = np.stack([(robots.places(found.x + step, task.test) - mean) / 1e-6 for step in steps], -1)
        spread = np.einsum("rsip,pq,rsiq->rsi", by, covariance, by)
        task.predict(mean, np.sqrt(np.maximum(spread, 0) + (scale * sigmas) ** 2), robots.axes(found.x))


if __name__ == "__main__":
    main("pybotics", importlib.metadata.version("pybotics"), play)
