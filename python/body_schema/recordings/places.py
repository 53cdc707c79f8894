"""Where a camera and a tag are, roughly: where a calibration begins. The calibration itself finds both."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .._urdf import Joint
from .chain import Description
from .tracks import Array, Camera, homography


def tag_poses(camera: Camera, points_m: Array, pixels: Array) -> Array:
    """Poses of a flat body (z = 0) in the frame of the camera that sees its points: N × 4 × 4, by the homography of each picture.

    ``pixels`` is N × 2k, of the k ``points_m`` (k × 3), NaN of points that are not seen.
    """
    poses = np.full((len(pixels), 4, 4), np.nan)
    for index, row in enumerate(pixels.reshape(len(pixels), -1, 2)):
        seen = np.isfinite(row).all(axis=1)
        h = homography(points_m[seen], (row[seen] - camera.centre_px) / camera.focal_px)
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


@dataclass(frozen=True)
class Places:
    """Where a camera and a tag are: what the hand carries, in its frame, and what stands, in that of the base, 4 × 4 each. ``focal`` is how many times
    as long a guessed focal length seems to be, ``scale`` ± ``scale_sd`` how many times as large the tag is as was said."""

    carried: Array
    standing: Array
    focal: float
    scale: float
    scale_sd: float


def places_of(
    camera: Camera, points_m: Array, pixels: Array, description: Description, chain: list[Joint], positions: Array, on_hand: bool
) -> Places | None:
    """Where camera and tag are by the robot as described, from a tag's ``pixels`` at ``positions`` of the joints; ``on_hand`` says that the camera
    is what is carried. None where fewer than three postures tell.

    A focal length that is a guess is the one of a grid with which pixels are explained best, if that is clearly better than as it was said. Of a target that
    is seen in part the pictures with most of it count.
    """
    shown = np.isfinite(pixels[:, 0::2]).sum(axis=1)
    most = shown >= 0.5 * shown.max()
    if most.sum() >= 5:
        pixels, positions = pixels[most], positions[most]
    turned, place = description.hand(chain, positions)
    hand = np.tile(np.eye(4), (len(place), 1, 1))
    hand[:, :3, :3], hand[:, :3, 3] = turned, place
    points = np.hstack([points_m, np.ones((len(points_m), 1))]).T
    best: tuple[float, Places] | None = None
    for factor in (1.0, *map(float, np.geomspace(0.6, 1.7, 45))) if camera.learned else (1.0,):
        focal = np.array(camera.focal_px) * factor
        seen = tag_poses(replace(camera, focal_px=(float(focal[0]), float(focal[1]))), points_m, pixels)
        if on_hand:
            seen = np.asarray(np.linalg.inv(seen))
        found = carried_and_standing(description, chain, positions, seen)
        if found is None:
            continue
        scale, deviation, carried, standing = _scaled(hand, found, seen)
        # T X = Y S: of a carried camera S is the inverse of what it sees.
        predicted = np.linalg.inv(standing) @ hand @ carried
        predicted[:, :3, 3] /= scale
        at = (np.linalg.inv(predicted) if on_hand else predicted) @ points
        where = at[:, :2] / np.maximum(at[:, 2:3], 1e-3) * focal[:, None] + np.array(camera.centre_px)[:, None]
        off = np.linalg.norm(where.transpose(0, 2, 1) - pixels.reshape(len(pixels), -1, 2), axis=2)
        missed = float(np.nanmedian(off))
        if best is None or missed < (0.9 if best[1].focal == 1.0 else 1.0) * best[0]:
            best = (missed, Places(*found, factor, scale, deviation))
    return best and best[1]


def _scaled(hand: Array, found: tuple[Array, Array], seen: Array) -> tuple[float, float, Array, Array]:
    """The scale s of T X = Y S(s), whose poses S are s times as far away as ``seen``, its standard deviation, and X and Y with it; 1 and infinity
    where nothing tells it, as where the axes of a robot meet: then the target's distance from there is one with its size.

    By least squares of R_T x - y + p / s = R_Y t: all that is multiplied is the robot's, and what was seen stands alone.
    """
    carried, standing = found[0].copy(), found[1].copy()
    usable = np.isfinite(seen).all(axis=(1, 2))
    turned, place = hand[usable, :3, :3], hand[usable, :3, 3]
    away = seen[usable, :3, 3] @ standing[:3, :3].T
    equations = np.vstack([np.hstack([a, -np.eye(3), p[:, None]]) for a, p in zip(turned, place)])
    rows, sizes, directions = np.linalg.svd(equations, full_matrices=False)
    told = sizes > 1e-6 * sizes[0]
    if usable.sum() < 4 or (np.abs(directions[~told, 6]) > 1e-3).any():
        return 1.0, math.inf, carried, standing
    inverse = directions[told].T / sizes[told] @ rows[:, told].T
    solved = inverse @ away.ravel()
    # Coordinates of a picture err together.
    left = (equations @ solved - away.ravel()).reshape(-1, 3)
    parts = (inverse[6].reshape(-1, 3) * left).sum(axis=1)
    freedom = len(place) / max(len(place) - 7 / 3, 1.0)
    share, deviation = float(solved[6]), math.sqrt(float((parts**2).sum()) * freedom)
    if not share > 3 * deviation:
        return 1.0, math.inf, carried, standing
    carried[:3, 3], standing[:3, 3] = solved[:3] / share, solved[3:6] / share
    return 1 / share, deviation / share**2, carried, standing


def _rotation(matrix: Array) -> Array:
    """The rotation nearest to a matrix."""
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ v)))]) @ v)
