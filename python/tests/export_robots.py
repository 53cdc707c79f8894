"""Robots for the tests of exports: descriptions with errors of known size, and readers that share no code with what they read."""

from __future__ import annotations

import math
import random
import re
import xml.etree.ElementTree as xml
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def rot(axis: Sequence[float], angle: float) -> np.ndarray:
    """The rotation about an axis, by Rodrigues' formula."""
    x, y, z = np.array(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def motion(xyz: Sequence[float], rpy: Sequence[float]) -> np.ndarray:
    """xyz and rpy of a URDF as a 4 × 4 matrix."""
    m = np.eye(4)
    m[:3, :3] = rot((0, 0, 1), rpy[2]) @ rot((0, 1, 0), rpy[1]) @ rot((1, 0, 0), rpy[0])
    m[:3, 3] = xyz
    return m


def turn(axis: Sequence[float], angle: float) -> np.ndarray:
    m = np.eye(4)
    m[:3, :3] = rot(axis, angle)
    return m


def forward(urdf: str, base: str, tip: str, readings: Mapping[str, float]) -> np.ndarray:
    """Forward kinematics of a URDF, 4 × 4."""
    above = {}
    for joint in xml.fromstring(urdf).findall("joint"):
        if joint.find("child") is not None:
            above[joint.find("child").get("link")] = joint  # type: ignore[union-attr]
    m, link = np.eye(4), tip
    while link != base:
        joint = above[link]
        origin, axis = joint.find("origin"), joint.find("axis")
        three = {key: [float(it) for it in (origin.get(key, "0 0 0") if origin is not None else "0 0 0").split()] for key in ("xyz", "rpy")}
        own = motion(three["xyz"], three["rpy"])
        if joint.get("type") in ("revolute", "continuous"):
            own = own @ turn([float(it) for it in axis.get("xyz").split()], readings.get(joint.get("name"), 0.0))  # type: ignore
        if joint.get("type") == "prismatic":
            step = np.eye(4)
            step[:3, 3] = np.array([float(it) for it in axis.get("xyz").split()]) * readings.get(joint.get("name"), 0.0)  # type: ignore
            own = own @ step
        m, link = own @ m, joint.find("parent").get("link")  # type: ignore
    return m


def disturbed(urdf: str, seed: int = 1, size: float = 0.01) -> str:
    """A URDF whose moving joints' origins are off by up to ``size`` (m, rad)."""
    draw = random.Random(seed)

    def joint(found: re.Match[str]) -> str:
        def values(it: re.Match[str]) -> str:
            return f'{it[1]}="{" ".join(repr(float(v) + draw.uniform(-size, size)) for v in it[2].split())}"'

        return re.sub(r"\b(xyz|rpy)=\"([^\"]*)\"", values, found[0])

    pattern = r"<joint name=\"[^\"]*\" type=\"(?:revolute|continuous|prismatic)\">.*?</joint>"
    return re.sub(pattern, lambda it: re.sub(r"<origin[^>]*>", joint, it[0]), urdf, flags=re.S)


def postures(names: Sequence[str], count: int = 20, seed: int = 5) -> list[dict[str, float]]:
    draw = random.Random(seed)
    return [{name: draw.uniform(-2, 2) for name in names} for _ in range(count)]


def off(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).max())
