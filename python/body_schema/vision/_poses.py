"""Where a target stands before a camera, as far as its pixels tell, and whether its size is right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._errors import FieldError, wrong
from ._camera import Camera
from ._detect import Detection
from ._targets import Target

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """A pose of a target in the optical frame: p = ``rotation`` q + ``translation_m``.

    ``rms_px`` is the root mean square of its reprojection error; ``chi2`` the sum of squared errors by the corners' covariances;
    ``probability`` its share among the poses that were found, exp(-chi2 / 2) of each, at equal prior odds.
    """

    rotation: Floats
    translation_m: Floats
    rms_px: float
    chi2: float
    probability: float = 1.0

    @property
    def sure(self) -> bool:
        """Whether no other pose explains the pixels nearly as well: a probability of 0.999 or more.

        Two poses of a small flat tag differ by a tilt to the other side, and by a fraction of a pixel.
        """
        return self.probability >= 0.999


def poses(detection: Detection, camera: Camera) -> list[Pose]:
    """The poses that explain what is seen of a target, the best first; none where fewer than four points are seen.

    Of a flat target both poses are given, with their reprojection errors, even where one is far better. Errors of pixels are taken to
    be at least 0.3 px here: no lens and no print are as exact as the noise of a tag's corners lets them seem.
    """
    pixels, points = detection.undistorted, detection.points_m
    if len(points) < 4:
        return []
    flat = detection.target.kind != "cube" or len({name.split("/")[0] for name in detection.names}) == 1
    pinhole = camera.pinhole()
    matrix = pinhole.K
    starts: list[tuple[Floats, Floats]] = []
    if flat:
        frame = _flat_frame(detection.target, points)
        flattened = (points - frame[1]) @ frame[0]
        flattened[:, 2] = 0.0
        _, turns, places, _ = cv2.solvePnPGeneric(flattened, pixels.reshape(-1, 1, 2), matrix, None, flags=cv2.SOLVEPNP_IPPE)
        for turn, place in zip(turns, places):
            rotation = np.asarray(cv2.Rodrigues(np.asarray(turn))[0], np.float64) @ frame[0].T
            starts.append((rotation, np.asarray(place, np.float64).ravel() - rotation @ frame[1]))
    else:
        good, turn, place = cv2.solvePnP(points, pixels.reshape(-1, 1, 2), matrix, None, flags=cv2.SOLVEPNP_SQPNP)
        if good:
            starts.append((np.asarray(cv2.Rodrigues(turn)[0], np.float64), np.asarray(place, np.float64).ravel()))
    found = []
    for rotation, place in starts:
        vector, moved = cv2.solvePnPRefineLM(
            points, pixels.reshape(-1, 1, 2), matrix, None, cv2.Rodrigues(rotation)[0], place.reshape(3, 1).copy()
        )
        refined = np.asarray(cv2.Rodrigues(vector)[0], np.float64)
        moved = np.asarray(moved, np.float64).ravel()
        off = pinhole.project(points, refined, moved) - pixels
        if not np.isfinite(off).all():
            continue
        covariances = detection.covariances + 0.3**2 * np.eye(2)
        chi2 = float(np.einsum("ij,ijk,ik->", off, np.linalg.inv(covariances), off))
        found.append(Pose(refined, moved, math.sqrt(float((off**2).sum(axis=1).mean())), chi2))
    found.sort(key=lambda it: it.chi2)
    if len(found) == 2 and np.abs(found[0].rotation - found[1].rotation).max() < 1e-4:
        found.pop()
    weights = [math.exp(-0.5 * (it.chi2 - found[0].chi2)) for it in found]
    return [Pose(it.rotation, it.translation_m, it.rms_px, it.chi2, weight / sum(weights)) for it, weight in zip(found, weights)]


def _flat_frame(target: Target, points: Floats) -> tuple[Floats, Floats]:
    """A frame in the plane of points: columns x, y, z in the target's frame, and the middle; z out of the print."""
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle)
    x, z = axes[0], axes[2]
    return np.column_stack([x, np.cross(z, x), z]), middle


@dataclass(frozen=True)
class Scale:
    """How many times as large places seem as they are: ``value`` ± ``sd``, and ``rms_m``, what is left of the fit."""

    value: float
    sd: float
    rms_m: float

    @property
    def words(self) -> str:
        """What this means for the size of a tag; empty where nothing is wrong beyond chance and a percent."""
        off = self.value - 1.0
        if abs(off) < max(0.01, 3 * self.sd):
            return ""
        return (
            f"places that the camera sees are {self.value:.4f} ± {self.sd:.4f} times as far apart as they are: the tag's black square is "
            f"{1 / self.value:.4f} times as large as its description says, or the focal length is wrong by as much: "
            "measure the print's ruler"
        )


def scale_between(seen_m: ArrayLike, known_m: ArrayLike) -> Scale:
    """The scale of places that a camera saw (N × 3, in its frame) against the same places in another frame, m.

    A least-squares similarity (S. Umeyama, "Least-squares estimation of transformation parameters", 1991). Places are those of one
    point of the target, such as its middle, at three postures or more that are not on a line. Mirrored places are refused.
    """
    a, b = np.array(seen_m, float), np.array(known_m, float)
    if a.ndim != 2 or a.shape != b.shape or a.shape[1] != 3 or len(a) < 3 or not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise wrong("seen_m", f"{a.shape} and {b.shape} are no two equal lists of places", "pass N x 3 finite numbers each, N at least 3")
    ma, mb = a - a.mean(axis=0), b - b.mean(axis=0)
    u, values, vt = np.linalg.svd(ma.T @ mb)
    if values[1] < 1e-6 * values[0] or values[0] <= 0:
        raise wrong("known_m", "the places are on a line", "move to places that are not")
    proper = float(np.sign(np.linalg.det(vt.T @ u.T)))
    if proper < 0 and values[2] > 0.05 * values[0]:
        raise wrong("seen_m", "the places are mirrored", "check whether the camera's picture is flipped, and the signs of the joints")
    turn = vt.T @ np.diag([1, 1, proper]) @ u.T
    length2 = float((mb**2).sum())
    value = float((ma @ turn.T * mb).sum()) / length2
    left = ma @ turn.T - value * mb
    freedom = max(3 * len(a) - 7, 1)
    variance = float((left**2).sum()) / freedom
    return Scale(value, math.sqrt(variance / length2), math.sqrt(float((left**2).sum(axis=1).mean())))


def optical_from_link(rpy_deg: Sequence[float]) -> tuple[float, float, float]:
    """``rpy_deg`` of a camera's optical frame (z ahead, x right, y down) from that of its link frame (x ahead, y left, z up).

    A calibration file takes the optical frame; a URDF's ``camera_link`` is the other one.
    """
    if len(rpy_deg) != 3 or not all(math.isfinite(it) for it in rpy_deg):
        raise wrong("rpy_deg", f"{list(rpy_deg)} are no three angles", "write roll, pitch, yaw in degrees")
    between = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    return angles_of(matrix_of(rpy_deg) @ between)


def matrix_of(rpy_deg: Sequence[float]) -> Floats:
    """The rotation of roll, pitch, yaw as a URDF has them, deg: Rz(yaw) Ry(pitch) Rx(roll)."""
    (a, b, c) = (math.radians(it) for it in rpy_deg)
    x = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    y = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    z = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    return np.asarray(z @ y @ x, np.float64)


def angles_of(rotation: Floats) -> tuple[float, float, float]:
    """Roll, pitch, yaw of a rotation, deg; where pitch is ± 90 degrees yaw is 0."""
    pitch = math.asin(max(-1.0, min(1.0, -float(rotation[2, 0]))))
    if abs(rotation[2, 0]) > 1 - 1e-9:
        sign = -float(rotation[2, 0])
        roll = math.atan2(sign * float(rotation[0, 1]), float(rotation[1, 1]))
        return math.degrees(roll), math.degrees(pitch), 0.0
    roll = math.atan2(float(rotation[2, 1]), float(rotation[2, 2]))
    yaw = math.atan2(float(rotation[1, 0]), float(rotation[0, 0]))
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)


def frame_doubt(poses_of_target: Sequence[Pose], known_m: ArrayLike, camera_rpy_deg: Sequence[float]) -> str:
    """Whether a camera's ``rpy_deg`` is that of its link frame instead of its optical frame; empty where it is not, or cannot be told.

    ``known_m`` (N × 3) are the places of the target in the frame of the measurements, one for each pose. The rotation that takes
    what is seen onto them is compared with both.
    """
    a = np.array([it.translation_m for it in poses_of_target], float).reshape(-1, 3)
    b = np.array(known_m, float).reshape(-1, 3)
    try:
        if len(a) < 4 or scale_between(a, b).rms_m > 0.3 * float(np.linalg.norm(b - b.mean(axis=0), axis=1).mean()):
            return ""
    except FieldError:
        return ""
    u, _, vt = np.linalg.svd((a - a.mean(axis=0)).T @ (b - b.mean(axis=0)))
    turn = vt.T @ np.diag([1, 1, float(np.sign(np.linalg.det(vt.T @ u.T)))]) @ u.T

    def off_deg(rpy: Sequence[float]) -> float:
        cosine = (float(np.trace(matrix_of(rpy).T @ turn)) - 1) / 2
        return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))

    optical = optical_from_link(camera_rpy_deg)
    if off_deg(camera_rpy_deg) > 60 > 2 * off_deg(optical):
        told = ", ".join(f"{it:.1f}" for it in optical)
        return f"rpy_deg is that of the camera's link frame (x ahead): write the optical frame's, rpy_deg = [{told}]"
    return ""
