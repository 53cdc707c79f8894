"""Scores of predictions: held-out errors, coverage, and errors of axes where the truth is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from kinematics import of_quaternion, rotation_vector

from .sets import Set
from .splits import Split

# Of a normal number: 95 % lie within so many standard deviations.
WITHIN = 1.959964


@dataclass
class Scores:
    """Of one prediction. Errors of positions in mm (of sockets: distances from their means), of rotations in degrees."""

    mean_mm: float
    median_mm: float
    p95_mm: float
    mean_deg: float | None
    # The share of coordinates within what is stated for 95 %; ``None`` where nothing is stated, and for sockets.
    coverage: float | None
    # Mean errors of axes: between directions, and of the true axis' point from the line.
    axes_deg: float | None = None
    axes_mm: float | None = None
    # Root mean square, which the authors of some data report.
    rms_mm: float | None = None


@dataclass
class Prediction:
    """Means (rows, sensors, 3), rotations, standard deviations, and axes, as far as they are told."""

    places: np.ndarray
    turned: np.ndarray | None
    sd: np.ndarray | None
    axes: np.ndarray | None


def check_prediction(said: Any, of: Set, split: Split) -> Prediction:
    """Reads a prediction. Raises ``ValueError`` that says what is wrong."""
    if not isinstance(said, dict) or "mean" not in said:
        raise ValueError("`predict` has no `mean`")
    sensors, rows = of.manifest["sensors"], len(split.held_out.postures)
    width = 7 if sensors[0]["kind"] == "pose" else 3

    def numbers(key: str, shape: tuple[int, ...]) -> np.ndarray | None:
        if said.get(key) is None:
            return None
        try:
            found = np.array(said[key], float)
        except (TypeError, ValueError):
            raise ValueError(f"`{key}` is no array of numbers") from None
        if found.shape != shape:
            raise ValueError(f"`{key}` has the shape {found.shape}, not {shape}")
        if not np.isfinite(found).all():
            raise ValueError(f"`{key}` has a number that is not finite")
        return found

    mean = numbers("mean", (rows, len(sensors), width))
    if mean is None:
        raise ValueError("`predict` has no `mean`")
    sd = numbers("sd", (rows, len(sensors), 3))
    if sd is not None and (sd <= 0).any():
        raise ValueError("`sd` has a deviation that is not above 0")
    turned = None
    if width == 7:
        if (np.linalg.norm(mean[..., 3:], axis=-1) < 1e-6).any():
            raise ValueError("`mean` has a quaternion of zeros")
        turned = of_quaternion(mean[..., 3:])
    return Prediction(mean[..., :3], turned, sd, numbers("axes", (len(of.chain.joints), 2, 3)))


def score(told: Prediction, of: Set, split: Split) -> Scores:
    readings = split.held_out.readings
    if of.sockets:
        errors, inside, degrees = _scatter(told.places[:, 0], [row[0] for row in readings]), None, None
    else:
        errors, inside, degrees = [], [], []
        for row, channels in enumerate(readings):
            for sensor, reading in enumerate(channels):
                if reading is None:
                    continue
                off = told.places[row, sensor] - np.array(reading[:3])
                errors.append(np.linalg.norm(off))
                if told.sd is not None:
                    inside.extend(np.abs(off) <= WITHIN * told.sd[row, sensor])
                if told.turned is not None:
                    between = told.turned[row, sensor].T @ of_quaternion(np.array(reading[3:]))
                    degrees.append(np.degrees(np.linalg.norm(rotation_vector(between))))
    errors = np.array(errors) * 1e3
    axes = (None, None)
    if told.axes is not None and split.pool.axes is not None:
        axes = _axes(told.axes, np.array(split.pool.axes), [joint.slides for joint in of.chain.joints])
    return Scores(
        float(errors.mean()), float(np.median(errors)), float(np.percentile(errors, 95)),
        float(np.mean(degrees)) if degrees else None, float(np.mean(inside)) if inside else None, *axes,
        rms_mm=float(np.sqrt((errors**2).mean())),
    )


def _scatter(places: np.ndarray, sockets: list[str]) -> list[float]:
    """The distances of predicted balls from the mean of their socket."""
    names = np.array(sockets)
    return [float(d) for name in dict.fromkeys(sockets)
            for d in np.linalg.norm(places[names == name] - places[names == name].mean(0), axis=1)]


def _axes(found: np.ndarray, true: np.ndarray, slides: list[bool]) -> tuple[float, float | None]:
    """The mean angle between axes in degrees, and the mean distance of a true axis' point from the found line in mm."""
    directions = found[:, 1] / np.linalg.norm(found[:, 1], axis=1, keepdims=True)
    angles = np.degrees(np.arctan2(np.linalg.norm(np.cross(directions, true[:, 1]), axis=1), (directions * true[:, 1]).sum(1)))
    turns = [k for k, sliding in enumerate(slides) if not sliding]
    distances = np.linalg.norm(np.cross(true[turns, 0] - found[turns, 0], directions[turns]), axis=1) * 1e3
    return float(angles.mean()), float(distances.mean()) if turns else None
