"""Where a camera and a tag are, roughly: where a calibration begins. The calibration itself finds both."""

from __future__ import annotations

import math

import numpy as np

from .._urdf import Joint
from .chain import Description
from .tracks import Array, Camera


def tag_poses(camera: Camera, points_m: Array, pixels: Array) -> Array:
    """Poses of a flat body (z = 0) in the frame of the camera that sees its points: N × 4 × 4, by the homography of each picture.

    ``pixels`` is N × 2k, of the k ``points_m`` (k × 3). NaN where there is none.
    """
    poses = np.full((len(pixels), 4, 4), np.nan)
    for index, row in enumerate(pixels):
        u = (row[0::2] - camera.centre_px[0]) / camera.focal_px[0]
        v = (row[1::2] - camera.centre_px[1]) / camera.focal_px[1]
        x, y, one, zero = points_m[:, 0], points_m[:, 1], np.ones(len(u)), np.zeros((len(u), 3))
        flat = np.column_stack([x, y, one])
        equations = np.vstack([np.hstack([flat, zero, -u[:, None] * flat]), np.hstack([zero, flat, -v[:, None] * flat])])
        h = np.linalg.svd(equations)[2][-1].reshape(3, 3)
        h /= math.copysign(float(np.sqrt(np.linalg.norm(h[:, 0]) * np.linalg.norm(h[:, 1]))), h[2, 2])
        poses[index] = np.eye(4)
        poses[index, :3, :3] = _rotation(np.column_stack([h[:, 0], h[:, 1], np.cross(h[:, 0], h[:, 1])]))
        poses[index, :3, 3] = h[:, 2]
    return poses


def carried_and_standing(description: Description, chain: list[Joint], positions: Array, seen: Array) -> tuple[Array, Array] | None:
    """X, fixed on the hand, and Y, fixed beside the base, such that T X = Y S for the hand as described, T, and poses S (4 × 4 each).

    Rotations first, as the least singular vector of R_T R_X − R_Y R_S = 0, then places. None where fewer than three postures tell.
    """
    turned, place = description.hand(chain, positions)
    usable = np.isfinite(seen).all(axis=(1, 2))
    if usable.sum() < 3:
        return None
    turned, place, seen = turned[usable], place[usable], seen[usable]
    rows = [np.hstack([np.kron(a, np.eye(3)), -np.kron(np.eye(3), b[:3, :3].T)]) for a, b in zip(turned, seen)]
    found = np.linalg.svd(np.vstack(rows))[2][-1]
    if np.linalg.det(found[:9].reshape(3, 3)) < 0.0:
        found = -found
    carried, standing = np.eye(4), np.eye(4)
    carried[:3, :3], standing[:3, :3] = _rotation(found[:9].reshape(3, 3)), _rotation(found[9:].reshape(3, 3))
    equations = np.vstack([np.hstack([a, -np.eye(3)]) for a in turned])
    right = np.concatenate([standing[:3, :3] @ b[:3, 3] - p for b, p in zip(seen, place)])
    both = np.linalg.lstsq(equations, right, rcond=None)[0]
    carried[:3, 3], standing[:3, 3] = both[:3], both[3:]
    return carried, standing


def _rotation(matrix: Array) -> Array:
    """The rotation nearest to a matrix."""
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ v)))]) @ v)
