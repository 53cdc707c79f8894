#!/usr/bin/env python3
"""What SciPy's `direct` takes for what `cargo bench --bench choosing` times: one choice of a posture with 600 evaluations of the
posterior's trace, written with NumPy by the textbook's formulas, on the same arm, covariance and limits.

    pip install numpy scipy
    benches/choosing/scipy_direct.py            # builds and runs the benchmark itself, so that both take turns

Every problem carries postures with their criterion; the script's own must agree with them to 1e-9 before it is timed.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.optimize import direct

EVALUATIONS = 600
ROUNDS = 5


def rotation(axis, angle):
    """exp([axis]× angle), by Rodrigues."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * (skew @ skew)


class Problem:
    """One arm whose next posture is to be chosen."""

    def __init__(self, data):
        self.name, self.sigma, self.checks = data["name"], data["sigma_m"], data["checks"]
        self.joints = [{key: np.array(value) for key, value in joint.items()} for joint in data["joints"]]
        self.marker, self.weights = np.array(data["marker_m"]), np.array(data["weights"])
        self.covariance, self.limits = np.array(data["covariance"]), data["limits_rad"]

    def jacobian(self, posture):
        """3 × 4n: the marker's derivative by each axis, two coordinates of its point (m), two of its direction (rad)."""
        turns = [rotation(joint["direction"], angle) for joint, angle in zip(self.joints, posture)]
        arms, point = [], self.marker
        for joint, turn in zip(reversed(self.joints), reversed(turns)):
            arms.insert(0, point - joint["point_m"])
            point = turn @ arms[0] + joint["point_m"]
        columns, frame = [], np.eye(3)
        for joint, turn, arm, angle in zip(self.joints, turns, arms, posture):
            axis, basis = joint["direction"], joint["basis"]
            along = axis @ arm
            columns += [frame @ (b - turn @ b) for b in basis]
            columns += [
                frame @ (np.sin(angle) * np.cross(b, arm) + (1.0 - np.cos(angle)) * (axis * (b @ arm) + b * along))
                for b in basis
            ]
            frame = frame @ turn
        return np.column_stack(columns)

    def trace(self, posture):
        """tr(W (P − P Hᵀ S⁻¹ H P)), S = H P Hᵀ + σ² I."""
        h = self.jacobian(posture)
        numerator = self.covariance @ h.T
        s = h @ numerator + self.sigma**2 * np.eye(3)
        posterior = self.covariance - numerator @ np.linalg.solve(s, numerator.T)
        return self.weights @ np.diag(posterior)

    def choose(self):
        """The least trace that is found."""
        return direct(self.trace, self.limits, maxfun=EVALUATIONS, maxiter=10_000, locally_biased=True, eps=1e-4).fun


def benchmark(*arguments):
    """Runs the benchmark; what it prints."""
    command = ["cargo", "bench", "--locked", "--bench", "choosing", "--", *arguments]
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    return subprocess.run(command, cwd=root, env=environment, check=True, text=True, stdout=subprocess.PIPE).stdout


def main():
    with tempfile.NamedTemporaryFile(suffix=".json") as file:
        benchmark("--write", file.name)
        problems = [Problem(data) for data in json.load(file)]
    for problem in problems:
        for check in problem.checks:
            ours = problem.trace(np.array(check["posture_rad"]))
            if abs(ours - check["criterion"]) > 1e-9 * abs(check["criterion"]):
                sys.exit(f"{problem.name}: NumPy says {ours!r}, the engine {check['criterion']!r}")
    ours, theirs = {problem.name: [] for problem in problems}, {problem.name: [] for problem in problems}
    least = {}
    for _ in range(ROUNDS):
        for line in benchmark("--once").splitlines():
            name, microseconds, value = line.split()
            ours[name].append(float(microseconds))
            least[name] = float(value)
        for problem in problems:
            began = time.perf_counter()
            value = problem.choose()
            theirs[problem.name].append((time.perf_counter() - began) * 1e6)
            least[problem.name] = (least[problem.name], value)
    print(f"{'':10} {'ours, µs':>10} {'SciPy, µs':>12} {'times':>8} {'(least to most)':>18}   least value: ours, SciPy's")
    for name in ours:
        ratios = sorted(b / a for a, b in zip(ours[name], theirs[name]))
        print(
            f"{name:10} {statistics.median(ours[name]):10.0f} {statistics.median(theirs[name]):12.0f} "
            f"{statistics.median(ratios):8.0f} {f'({ratios[0]:.0f} to {ratios[-1]:.0f})':>18}   "
            f"{least[name][0]:.6e} {least[name][1]:.6e}"
        )


if __name__ == "__main__":
    main()
