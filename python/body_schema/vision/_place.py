"""Where a camera and a target stand, roughly: from pictures and the robot as its URDF has it.

The engine learns both places; it needs a guess to start from. Corners of all pictures are fitted by robust least squares (Huber,
Levenberg-Marquardt) over the camera's place in the base's frame, the target's in the tip's, and, to doubt a wrong size, the scale of the
target. The robot's own errors stay in the residuals, so that this is a guess and no calibration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._errors import wrong
from .._session import Session
from ._camera import Camera
from ._detect import Detection
from ._poses import Pose, angles_of, poses

Floats = NDArray[np.float64]

HUBER_PX = 5.0


@dataclass(frozen=True)
class Place:
    """A guess of where things stand: ``at_m`` and ``rpy_deg`` of the camera's optical frame in the base's frame, and of the target in the
    tip's; ``rms_px`` is what is left, by most pictures (median), ``scale`` ± ``scale_sd`` how many times as large the
    target seems to be as described.
    """

    camera_at_m: tuple[float, float, float]
    camera_rpy_deg: tuple[float, float, float]
    target_at_m: tuple[float, float, float]
    target_rpy_deg: tuple[float, float, float]
    rms_px: float
    scale: float
    scale_sd: float
    target_in_base_m: Floats
    """Where the target is at every posture, N × 3."""
    focal: float = 1.0
    """How many times as long the focal length of a camera that is a guess seems to be."""


def tip_frames(
    urdf: str, base: str | None, tip: str | None, configurations: Sequence[Mapping[str, float]]
) -> tuple[list[Floats], list[Floats]]:
    """Rotations (3 × 3) and places (m) of the tip in the base's frame, as the URDF has them: the engine's predictions of three points."""
    fixed = {"at_m": [0, 0, 0], "rpy_deg": [0, 0, 0]}
    points = []
    for at in ([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]):
        target = {"name": "point", "at_m": at, "known": {"to_m": 1e-6}}
        session = Session.from_urdf(urdf, base, tip, target=[target], base_=fixed)
        points.append(np.array(session.predict(list(configurations)), float))
    places, x, y = points[0], (points[1] - points[0]) * 10, (points[2] - points[0]) * 10
    turns = [np.column_stack([a, b, np.cross(a, b)]) for a, b in zip(x, y)]
    return turns, list(places)


def optical_pose(at: tuple[float, float, float], looks_at: tuple[float, float, float]) -> tuple[Floats, Floats]:
    """Base → optical frame of a camera whose picture is upright: p' = R p + t."""
    ahead = np.array(looks_at, float) - np.array(at, float)
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    turn = np.array([right, np.cross(ahead, right), ahead])
    return turn, -turn @ np.array(at, float)


def place_of(
    camera: Camera,
    detections: Sequence[Detection],
    turns: Sequence[Floats],
    places: Sequence[Floats],
    *,
    guess: tuple[Floats, Floats, Floats, Floats] | None = None,
    hold: tuple[bool, bool] = (False, False),
) -> Place | None:
    """Where camera and target stand, of detections and the tip's frames at the same postures; ``None`` where five do not suffice.

    ``guess`` is begun with too: rotation and translation from the base's frame to the optical one, the target's rotation and place in the
    tip's frame. ``hold`` says whether camera and target are where it has them.
    """
    rows: list[tuple[Detection, Pose, Floats, Floats]] = []
    for detection, turn, place in zip(detections, turns, places):
        its = poses(detection, camera)
        if its:
            rows.append((detection, its[0], turn, place))
    if len(rows) < 5:
        return None
    # The camera sees the target near where the tip is: a rigid motion from places, then the target's turn as their mean.
    seen = np.array([pose.translation_m for _, pose, _, _ in rows])
    at = np.array([place for _, _, _, place in rows])
    pinhole = camera if camera.is_guess else camera.pinhole()
    focal = [0.0] * camera.is_guess
    best: tuple[float, Floats] | None = None
    for _ in range(3):
        a, b = seen - seen.mean(axis=0), at - at.mean(axis=0)
        u, _, vt = np.linalg.svd(a.T @ b)
        turn = vt.T @ np.diag([1, 1, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
        shift = at.mean(axis=0) - turn @ seen.mean(axis=0)
        # Target in the tip's frame, by every pose.
        mean = sum(tip.T @ turn @ pose.rotation for _, pose, tip, _ in rows)
        left, _, right = np.linalg.svd(mean)
        mounted = left @ np.diag([1, 1, np.sign(np.linalg.det(left @ right))]) @ right
        offset = np.median([tip.T @ (turn @ pose.translation_m + shift - place) for _, pose, tip, place in rows], axis=0)
        # Camera to base and its inverse: what is fitted takes base to camera.
        start = np.concatenate([cv2.Rodrigues(turn.T)[0].ravel(), -turn.T @ shift, cv2.Rodrigues(mounted)[0].ravel(), offset, focal])
        fitted = _levenberg(pinhole, rows, start)
        if best is None or fitted[0] < best[0]:
            best = fitted
        at = np.array([place + tip @ fitted[1][9:12] for _, _, tip, place in rows])
    assert best is not None
    held: list[int] = []
    if guess is not None:
        turn, shift, mounted, offset = guess
        start = np.concatenate([cv2.Rodrigues(turn)[0].ravel(), shift, cv2.Rodrigues(mounted)[0].ravel(), offset, focal])
        held = [*(range(6) if hold[0] else ()), *(range(6, 12) if hold[1] else ())]
        fitted = _levenberg(pinhole, rows, start, held)
        if fitted[0] < best[0] or held:
            best = fitted
    x = best[1]
    with_scale = _levenberg(pinhole, rows, np.append(x, 0.0), held)[1]
    scale_sd = _scale_sd(pinhole, rows, with_scale)
    off, _ = _residuals(pinhole, rows, x)
    each = [math.sqrt(float((it**2).sum(axis=1).mean())) for it in off]
    world = np.asarray(np.asarray(cv2.Rodrigues(x[:3])[0]).T, np.float64)
    inside = [tip @ x[9:12] + place for _, _, tip, place in rows]
    return Place(
        _three(-world @ x[3:6]),
        angles_of(world),
        _three(x[9:12]),
        angles_of(np.asarray(cv2.Rodrigues(x[6:9])[0], np.float64)),
        float(np.median(each)),
        float(math.exp(with_scale[-1])),
        scale_sd,
        np.array(inside),
        float(math.exp(x[12])) if camera.is_guess else 1.0,
    )


def _three(vector: Floats) -> tuple[float, float, float]:
    return (float(vector[0]), float(vector[1]), float(vector[2]))


def _residuals(pinhole: Camera, rows: Sequence[tuple[Detection, Pose, Floats, Floats]], x: Floats) -> tuple[list[Floats], float]:
    """What pictures miss the model by, px, and the cost. ``x`` has rotation vector and place of base and target, then logarithms: of the
    focal length's factor where the camera is a guess, and of the target's scale where it is asked for."""
    world, mounted = np.asarray(cv2.Rodrigues(x[:3])[0]), np.asarray(cv2.Rodrigues(x[6:9])[0])
    more = [math.exp(float(it)) for it in x[12:]]
    focal = more.pop(0) if pinhole.is_guess else 1.0
    (size,) = more or [1.0]
    all_of, cost = [], 0.0
    for detection, _, tip, place in rows:
        points = (size * detection.points_m @ mounted.T + x[9:12]) @ tip.T + place
        camera = points @ world.T + x[3:6]
        # Behind the camera is far off, and the way back is downhill.
        camera[:, 2] = np.maximum(camera[:, 2], 0.02)
        off = focal * (pinhole.project(camera) - pinhole.centre_px) + pinhole.centre_px - detection.undistorted
        length = np.linalg.norm(off, axis=1)
        cost += float(np.where(length < HUBER_PX, 0.5 * length**2, HUBER_PX * (length - 0.5 * HUBER_PX)).sum())
        all_of.append(off)
    return all_of, cost


def _linear(pinhole: Camera, rows: Sequence[tuple[Detection, Pose, Floats, Floats]], x: Floats) -> tuple[Floats, Floats]:
    """Whitened residuals and their Jacobian."""
    off = np.concatenate(_residuals(pinhole, rows, x)[0])
    weight = np.sqrt(1.0 / np.maximum(1.0, np.linalg.norm(off, axis=1) / HUBER_PX))[:, None]
    columns = []
    for index in range(len(x)):
        step = np.zeros(len(x))
        step[index] = 1e-6
        ahead = np.concatenate(_residuals(pinhole, rows, x + step)[0])
        behind = np.concatenate(_residuals(pinhole, rows, x - step)[0])
        columns.append((weight * (ahead - behind) / 2e-6).ravel())
    return (weight * off).ravel(), np.column_stack(columns)


def _levenberg(
    pinhole: Camera, rows: Sequence[tuple[Detection, Pose, Floats, Floats]], start: Floats, held: Sequence[int] = ()
) -> tuple[float, Floats]:
    x, damping = start.copy(), 1e-3
    cost = _residuals(pinhole, rows, x)[1]
    for _ in range(60):
        off, jacobian = _linear(pinhole, rows, x)
        jacobian[:, list(held)] = 0.0
        normal = jacobian.T @ jacobian
        improved = False
        for _ in range(8):
            step = np.linalg.lstsq(normal + damping * np.diag(np.diag(normal) + 1e-9), -jacobian.T @ off, rcond=None)[0]
            moved = _residuals(pinhole, rows, x + step)[1]
            if moved < cost:
                improved = cost - moved > 1e-7 * cost
                x, cost, damping = x + step, moved, max(damping / 5, 1e-9)
                break
            damping *= 5
        if not improved:
            break
    return cost, x


def _scale_sd(pinhole: Camera, rows: Sequence[tuple[Detection, Pose, Floats, Floats]], x: Floats) -> float:
    """Standard deviation of the scale; corners of a picture err together, so that pictures count, and not corners."""
    off, jacobian = _linear(pinhole, rows, x)
    normal = jacobian.T @ jacobian
    middle = np.zeros_like(normal)
    start = 0
    for detection, _, _, _ in rows:
        end = start + 2 * len(detection.names)
        part = jacobian[start:end].T @ off[start:end]
        middle += np.outer(part, part)
        start = end
    inverse = np.linalg.pinv(normal)
    return math.sqrt(max(float((inverse @ middle @ inverse)[-1, -1]), 0.0) * len(rows) / max(len(rows) - 7, 1))


def radians_of(joints: Sequence[str], titles: Sequence[str], row: Sequence[str]) -> dict[str, float]:
    """Positions of joints by name (rad, m) from a row of a table whose titles may end with a unit."""
    units = {"": 1.0, "_rad": 1.0, "_deg": math.pi / 180, "_m": 1.0, "_cm": 0.01, "_mm": 0.001}
    told: dict[str, Any] = {}
    for joint in joints:
        for unit, factor in units.items():
            if joint + unit in titles:
                told[joint] = float(row[list(titles).index(joint + unit)]) * factor
                break
        else:
            raise wrong("joints", f"the table has no column of the joint {joint}", f"title it {joint} or {joint}_deg")
    return told
