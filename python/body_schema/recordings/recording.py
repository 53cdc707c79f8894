"""What a recording is, whatever wrote it: topics, joints and readings of sensors."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .tracks import Array, Camera, SensorTrack


@dataclass
class Topic:
    """What a recording holds of one topic or feature.

    ``role`` is ``joints``, ``sensor``, ``image``, ``camera`` or empty for what is not read. ``names`` are its joints, tags, markers
    or frames.
    """

    name: str
    type: str
    role: str
    count: int = 0
    rate_hz: float = 0.0
    longest_gap_s: float = 0.0
    names: list[str] = field(default_factory=list)
    note: str = ""


@dataclass(frozen=True)
class SensorSpec:
    """Which readings are asked for: ``NAME=TOPIC#PART`` or ``NAME=tf:PARENT,CHILD``."""

    name: str
    topic: str
    part: str = ""

    @property
    def written(self) -> str:
        """As it is written on the command line, without its name."""
        return f"{self.topic}#{self.part}" if self.part else self.topic


class Recording(ABC):
    """A recording that is open."""

    path: Path

    @abstractmethod
    def topics(self, whole: bool = True) -> list[Topic]:
        """Everything that it holds, with counts; rates, gaps and names too where the ``whole`` of it is read."""

    @abstractmethod
    def joints(self, topic: str) -> dict[str, tuple[Array, Array]]:
        """Times (s) and positions (as recorded) of every joint of a topic; readings that are no numbers are NaN."""

    @abstractmethod
    def sensor(self, spec: SensorSpec, links: dict[str, str]) -> SensorTrack:
        """The readings that are asked for, in the order in which they were recorded.

        ``links`` is the parent of each link of the robot whose joint moves: transforms between them are computed, not measured.
        """

    @abstractmethod
    def camera(self, spec: SensorSpec, topic: str | None, rectified: bool) -> tuple[Camera, Distortion]:
        """The camera of a sensor, of the named topic or the only one; as it is for ``rectified`` pictures, or for raw ones."""

    @abstractmethod
    def images(self, spec: SensorSpec) -> Iterator[tuple[float, Any]]:
        """Times (s) and pictures (height × width × 3, 8 bit, blue green red) of a topic."""

    @abstractmethod
    def began(self) -> float:
        """When its time was 0, seconds since 1970, by the clock of whoever recorded it."""

    def close(self) -> None:
        """Close what is open."""


@dataclass(frozen=True)
class Distortion:
    """A lens: its model by the name of ROS, its coefficients."""

    model: str
    coefficients: tuple[float, ...]

    @property
    def any(self) -> bool:
        """Whether there is any."""
        return any(abs(it) > 1e-12 for it in self.coefficients)


SAYS_NOTHING = ("camera_info", "image_raw", "image_rect", "image", "compressed", "observation", "images", "")


def word_of(topic: str) -> str:
    """A word for a topic or feature: the last part of its name but what says nothing."""
    parts = [part for part in re.split(r"[/.]", topic) if part not in SAYS_NOTHING]
    return re.sub(r"\W+", "_", parts[-1] if parts else "camera")


def summary(dropped: Counter[str]) -> str:
    """Reasons with counts, most frequent first."""
    return "; ".join(f"{number} {why}" for why, number in dropped.most_common())
