"""One picture at a time: what a session takes, or why there is nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .._errors import wrong
from ._camera import Camera
from ._detect import Detection, Limits, detect
from ._poses import Pose, poses
from ._targets import Target


@dataclass(frozen=True)
class Look:
    """What a picture shows of a target.

    ``measurements`` has an entry ``CAMERA_TARGET`` for every part of the target that is seen, whole or, of a board, four points at least
    with ``None`` for the others: ``session.observe(executed, measurements=look.measurements)``. ``reason`` says why there is none, and is empty otherwise; ``detection`` has every
    point that is seen.
    """

    measurements: dict[str, list[list[float] | None] | None]
    reason: str
    detection: Detection

    @property
    def seen(self) -> bool:
        """Whether there is a reading."""
        return any(it is not None for it in self.measurements.values())

    @property
    def reading(self) -> list[list[float] | None] | None:
        """The reading of a target of one part, ``[[u, v], …]``, px, undistorted: ``session.observe(executed, webcam_tag=look.reading)``."""
        if len(self.measurements) != 1:
            raise wrong("reading", "this target has several parts", "pass `measurements`")
        return next(iter(self.measurements.values()))


class Watcher:
    """Looks for a target in the pictures of a camera.

    Channels are called ``CAMERA_TARGET`` by the names of both, as in a calibration file; of a cube every face is a target of its own,
    ``CAMERA_CUBE_FACE``.
    """

    def __init__(self, camera: Camera, target: Target, limits: Limits | None = None) -> None:
        self.camera = camera
        self.target = target
        self.limits = limits or Limits()

    @property
    def channels(self) -> list[str]:
        """The names of the channels that ``look`` tells."""
        return [f"{self.camera.name}_{side.name}" for side in self.target.sides()]

    def look(self, image: Any) -> Look:
        """What a picture (bytes, H × W or H × W × 3 as OpenCV reads them) shows.

        Raises ``FieldError`` for what is no picture of this camera.
        """
        detection = detect(image, self.target, self.camera, self.limits)
        measurements: dict[str, list[list[float] | None] | None] = {}
        for channel, side in zip(self.channels, self.target.sides()):
            reading = detection.of(side).reading()
            is_enough = sum(point is not None for point in reading) >= side.least_points
            measurements[channel] = reading if is_enough else None
        reason = ""
        if not any(measurements.values()):
            reason = "; ".join(it.words for it in detection.rejections[:3]) or f"{self.target.name} is seen in part"
            if detection.names:
                count, all_of = len(detection.names), len(self.target.point_names)
                needs = "all" if self.target.kind != "charuco" else self.target.least_points
                reason = f"{self.target.name}: {count} of {all_of} points are seen, and a reading needs {needs}; {reason}"
        return Look(measurements, reason, detection)

    def poses(self, look: Look) -> list[Pose]:
        """The poses of the target that explain a look, the best first; of a flat one both (see ``body_schema.vision.poses``)."""
        return poses(look.detection, self.camera)
