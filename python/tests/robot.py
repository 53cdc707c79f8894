"""An arm of three joints that is not quite as its URDF says."""

from __future__ import annotations

import math
import random

JOINTS = ["pan", "lift", "elbow"]
_LINKS = ["base", "a", "b", "tip"]


def urdf(errors: dict[str, tuple[float, float, float]] | None = None) -> str:
    """The description, or the true robot with its joints elsewhere, m."""
    places = {"pan": (0.0, 0.0, 0.3), "lift": (0.05, 0.0, 0.1), "elbow": (0.4, 0.0, 0.0)}
    axes = {"pan": "0 0 1", "lift": "0 1 0", "elbow": "0 1 0"}
    text = '<robot name="three">' + "".join(f'<link name="{link}"/>' for link in _LINKS)
    for index, name in enumerate(JOINTS):
        x, y, z = (a + b for a, b in zip(places[name], (errors or {}).get(name, (0.0, 0.0, 0.0))))
        text += (
            f'<joint name="{name}" type="revolute"><origin xyz="{x} {y} {z}"/><parent link="{_LINKS[index]}"/>'
            f'<child link="{_LINKS[index + 1]}"/><axis xyz="{axes[name]}"/>'
            '<limit lower="-1.5" upper="1.5" effort="1" velocity="1"/></joint>'
        )
    return text + "</robot>"


def calibration() -> dict[str, object]:
    """Short searches."""
    return {
        "target": [{"name": "marker", "at_m": [0.3, 0.0, 0.05], "known": {"to_m": 0.1}}],
        "base_": {"at_m": [0, 0, 0], "rpy_deg": [0, 0, 0]},
        "prior": {"direction_rad": 0.02, "point_m": 0.01},
        "smoother": {"hypotheses": 2, "spawned": 1},
        "selection": {"evaluations": 60, "ahead": 4},
        "settled": {"expected_prediction_m": 0.002},
    }


class Robot:
    """The true arm; its marker is read with noise of half a millimetre."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self.errors = {name: tuple(self._random.uniform(-0.008, 0.008) for _ in range(3)) for name in JOINTS}
        self.marker = (0.31, -0.02, 0.06)

    def at(self, configuration: dict[str, float]) -> list[float]:
        """Where the marker truly is, m."""
        point = self.marker
        for name in reversed(JOINTS):
            place = {"pan": (0.0, 0.0, 0.3), "lift": (0.05, 0.0, 0.1), "elbow": (0.4, 0.0, 0.0)}[name]
            c, s = math.cos(configuration[name]), math.sin(configuration[name])
            x, y, z = point
            turned = (c * x - s * y, s * x + c * y, z) if name == "pan" else (c * x + s * z, y, c * z - s * x)
            point = tuple(a + b + e for a, b, e in zip(turned, place, self.errors[name]))
        return list(point)

    def sees(self, configuration: dict[str, float]) -> list[float]:
        return [x + self._random.gauss(0.0, 5e-4) for x in self.at(configuration)]

    def anywhere(self) -> dict[str, float]:
        return {name: self._random.uniform(-1.5, 1.5) for name in JOINTS}
