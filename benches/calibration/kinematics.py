"""A chain out of a URDF, and its forward kinematics, for the harness and for contestants that want it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np


def skew(v: np.ndarray) -> np.ndarray:
    """The matrix of the cross product; ``v`` is (…, 3)."""
    zero = np.zeros(v.shape[:-1])
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*v.shape[:-1], 3, 3)


def rotation(r: np.ndarray) -> np.ndarray:
    """exp of rotation vectors (…, 3): Rodrigues."""
    r = np.asarray(r, float)
    angle = np.linalg.norm(r, axis=-1)[..., None, None]
    k = skew(r)
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0 - angle**2 / 6, np.sin(safe) / safe)
    b = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.eye(3) + a * k + b * (k @ k)


def left_jacobian(r: np.ndarray) -> np.ndarray:
    """J with exp(r + d) = exp(J d) exp(r) to first order, 3 x 3."""
    angle, k = np.linalg.norm(r), skew(np.asarray(r, float))
    if angle < 1e-6:
        return np.eye(3) + k / 2
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * k + (angle - np.sin(angle)) / angle**3 * (k @ k)


def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    """log of rotations (…, 3, 3), by their quaternions."""
    q = quaternion(matrix)
    q = q * np.where(q[..., 3:] < 0, -1.0, 1.0)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., 3:])
    return q[..., :3] * np.where(sine < 1e-9, 2.0, angle / np.where(sine < 1e-9, 1.0, sine))


def quaternion(matrix: np.ndarray) -> np.ndarray:
    """x, y, z, w of rotations (…, 3, 3): the column of the largest of the four squares."""
    m = np.asarray(matrix, float)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    s = [m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]]
    d = [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]]
    table = np.stack(
        [1 + xx - yy - zz, s[0], s[1], d[0], s[0], 1 - xx + yy - zz, s[2], d[1],
         s[1], s[2], 1 - xx - yy + zz, d[2], d[0], d[1], d[2], 1 + xx + yy + zz], -1
    ).reshape(*m.shape[:-2], 4, 4)
    best = np.argmax(np.diagonal(table, axis1=-2, axis2=-1), -1)
    q = np.take_along_axis(table, best[..., None, None], -2)[..., 0, :]
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def of_quaternion(q: np.ndarray) -> np.ndarray:
    """Rotations of quaternions x, y, z, w (…, 4)."""
    q = np.asarray(q, float)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    k = skew(q[..., :3])
    return np.eye(3) + 2 * q[..., 3][..., None, None] * k + 2 * (k @ k)


def of_rpy(rpy: np.ndarray) -> np.ndarray:
    """Rz(yaw) Ry(pitch) Rx(roll) of (…, 3), as in a URDF."""
    rpy = np.asarray(rpy, float)
    x, y, z = (rotation(rpy[..., [k]] * np.eye(3)[k]) for k in range(3))
    return z @ y @ x


def pose(matrix: np.ndarray, place: np.ndarray) -> np.ndarray:
    """4 x 4 of a rotation and a place."""
    made = np.zeros((*np.shape(matrix)[:-2], 4, 4))
    made[..., :3, :3], made[..., :3, 3], made[..., 3, 3] = matrix, place, 1.0
    return made


@dataclass
class Joint:
    """A joint that moves: its frame in the one before it at rest, and its axis in its own frame."""

    name: str
    kind: str
    origin: np.ndarray
    axis: np.ndarray
    lower: float
    upper: float

    @property
    def slides(self) -> bool:
        return self.kind == "prismatic"

    def motion(self, q: np.ndarray) -> np.ndarray:
        """4 x 4 for positions (n,)."""
        q = np.asarray(q, float)
        if self.slides:
            return pose(np.broadcast_to(np.eye(3), (*q.shape, 3, 3)), q[..., None] * self.axis)
        return pose(rotation(q[..., None] * self.axis), np.zeros(3))


@dataclass
class Chain:
    """Joints from base to tip, each origin with the fixed joints before it, and the tip behind the last."""

    joints: list[Joint]
    tip: np.ndarray

    @classmethod
    def of_urdf(cls, path: Path, base: str, tip: str) -> Chain:
        by_child = {joint.find("child").get("link"): joint for joint in ElementTree.parse(path).getroot().findall("joint")}
        link, found = tip, []
        while link != base:
            if link not in by_child:
                raise ValueError(f"{path}: no joints lead from `{base}` to `{tip}`: nothing carries `{link}`; name other links")
            found.append(by_child[link])
            link = by_child[link].find("parent").get("link")
        joints, before = [], np.eye(4)
        for joint in reversed(found):
            origin = joint.find("origin")
            xyz, rpy = ((origin.get(key) if origin is not None else None) or "0 0 0" for key in ("xyz", "rpy"))
            before = before @ pose(of_rpy([float(x) for x in rpy.split()]), np.array([float(x) for x in xyz.split()]))
            kind = joint.get("type")
            if kind == "fixed":
                continue
            axis = joint.find("axis")
            axis = np.array([float(x) for x in (axis.get("xyz") if axis is not None else "1 0 0").split()])
            limit = joint.find("limit")
            lower, upper = (float((limit.get(key) if limit is not None else None) or 0) for key in ("lower", "upper"))
            if kind == "continuous":
                lower, upper = -np.pi, np.pi
            joints.append(Joint(joint.get("name"), kind, before, axis / np.linalg.norm(axis), lower, upper))
            before = np.eye(4)
        return cls(joints, before)

    def frames(self, q: np.ndarray, origins: list[np.ndarray] | None = None) -> tuple[list[np.ndarray], np.ndarray]:
        """For postures (n, joints) the frame of each joint before it moves, and that of the tip: (n, 4, 4) each."""
        at, frames = np.broadcast_to(np.eye(4), (len(q), 4, 4)), []
        for k, joint in enumerate(self.joints):
            at = at @ (joint.origin if origins is None else origins[k])
            frames.append(at)
            at = at @ joint.motion(q[:, k])
        return frames, at @ self.tip

    def axes(self, base: np.ndarray, origins: list[np.ndarray] | None = None) -> list[list[list[float]]]:
        """A point and a direction of every axis with all joints at 0, in the frame that ``base`` is given in."""
        frames, _ = self.frames(np.zeros((1, len(self.joints))), origins)
        found = [base @ frame[0] for frame in frames]
        return [[at[:3, 3].tolist(), (at[:3, :3] @ joint.axis).tolist()] for at, joint in zip(found, self.joints)]
