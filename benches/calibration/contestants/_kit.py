"""What contestants in Python share: the protocol's side of a contestant, and prediction with deviations. Nobody has to use it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from kinematics import Chain, left_jacobian, of_quaternion, of_rpy, pose, quaternion, rotation, rotation_vector, skew  # noqa: E402,F401


class Task:
    """The task in a folder, and the conversation about it over standard input and output."""

    def __init__(self, folder: str) -> None:
        self.folder = Path(folder)
        self.said: dict[str, Any] = json.loads((self.folder / "task.json").read_text())
        robot = self.said["robot"]
        self.urdf = self.folder / robot["urdf"]
        self.chain = Chain.of_urdf(self.urdf, robot["base"], robot["tip"])
        self.sensors: list[dict[str, Any]] = self.said["sensors"]
        self.kind: str = self.sensors[0]["kind"]
        self.pool, self.test = np.array(self.said["pool"]), np.array(self.said["test"])
        self.order: list[int] = self.said["order"]
        self.budgets: list[int] = self.said["budgets"]
        self.rows: list[int] = []
        self.readings: list[list[Any]] = []

    def _say(self, line: dict[str, Any]) -> dict[str, Any]:
        print(json.dumps(line), file=_out, flush=True)
        answer = sys.stdin.readline()
        if not answer:
            sys.exit("the harness has hung up")
        return json.loads(answer)

    def ask(self, rows: list[int]) -> list[list[Any]]:
        """The readings of rows of the pool; they are kept in ``rows`` and ``readings``."""
        got = self._say({"ask": [int(row) for row in rows]})["readings"]
        self.rows += rows
        self.readings += got
        return got

    def fill(self, budget: int) -> None:
        """Asks for the next rows in random order, up to a budget."""
        self.ask([row for row in self.order if row not in self.rows][: budget - len(self.rows)])

    def predict(self, mean: np.ndarray, sd: np.ndarray | None = None, axes: Any = None) -> None:
        """Delivers (rows, sensors, 3 or 7), deviations (rows, sensors, 3) or none, and axes or none."""
        listed = lambda it: it if it is None or isinstance(it, list) else np.asarray(it).tolist()
        self._say({"predict": {"mean": listed(mean), "sd": listed(sd), "axes": listed(axes)}})

    def fail(self, why: str) -> None:
        """Says that there is no prediction for the next budget, and why; it counts as failed."""
        self._say({"fail": why})


def main(name: str, version: str, play) -> None:
    """``python FILE [variant …] FOLDER`` plays; ``python FILE --version`` says what it is."""
    if sys.argv[1:] == ["--version"]:
        print(f"{name} {version}")
        return
    play(Task(sys.argv[-1]), *sys.argv[1:-1])


# Libraries that print must not spoil the conversation.
_out, sys.stdout = sys.stdout, sys.stderr
if sys.argv[1:] == ["--version"]:
    sys.stdout = _out


class Model:
    """A chain whose joint origins, base and targets are off by small motions, and how its readings change with them.

    Parameters are motions (3 of place, then a rotation vector) behind each joint's origin, behind the base, and behind each
    target: T = B t(b) · O₁ t(p₁) M₁ … Oₙ t(pₙ) Mₙ · tip · E t(e). Sockets are places in the frame of the base.
    """

    def __init__(self, task: Task, origins: list[np.ndarray] | None = None, motions=None) -> None:
        self.task, self.chain = task, task.chain
        self.origins = origins or [joint.origin for joint in task.chain.joints]
        self.motions = motions or (lambda q: [joint.motion(q[:, k]) for k, joint in enumerate(task.chain.joints)])
        self.n = len(self.origins)
        self.base = np.eye(4)
        self.mounts = [np.eye(4) for _ in task.sensors]
        self.sockets = sorted({row[0] for row in task.readings}) if task.kind == "socket" else []
        self.size = 6 * (self.n + 1 + len(self.mounts)) + 3 * len(self.sockets)
        self.joints = slice(0, 6 * self.n)

    def at(self, x: np.ndarray, k: int) -> np.ndarray:
        part = x[6 * k : 6 * k + 6]
        return pose(rotation(part[3:]), part[:3])

    def place(self, q: np.ndarray, x: np.ndarray, jacobian: bool = True):
        """Poses (sensors, rows, 4, 4) and, if wanted, their twists by the parameters (sensors, rows, 6, size) in the common frame."""
        rows = len(q)
        frames = [np.broadcast_to(self.base, (rows, 4, 4))]
        at = frames[0] @ self.at(x, self.n)
        for k, motion in enumerate(self.motions(q)):
            frames.append(at @ self.origins[k])
            at = frames[-1] @ self.at(x, k) @ motion
        at = at @ self.chain.tip
        poses, twists = [], []
        for sensor, mount in enumerate(self.mounts):
            before = at @ mount
            poses.append(before @ self.at(x, self.n + 1 + sensor))
            if not jacobian:
                continue
            j = np.zeros((rows, 6, self.size))
            place = poses[-1][:, :3, 3]
            for k, frame in [(self.n, frames[0]), *enumerate(frames[1:]), (self.n + 1 + sensor, before)]:
                r, part = frame[:, :3, :3], x[6 * k : 6 * k + 6]
                turn = r @ left_jacobian(part[3:])
                # The rotation is about the origin that is already moved by the part's place.
                arm = place - (frame[:, :3, 3] + r @ part[:3])
                j[:, :3, 6 * k : 6 * k + 3] = r
                j[:, :3, 6 * k + 3 : 6 * k + 6] = -skew(arm) @ turn
                j[:, 3:, 6 * k + 3 : 6 * k + 6] = turn
            twists.append(j)
        return np.array(poses), np.array(twists) if jacobian else None

    def residuals(self, q: np.ndarray, readings: list[list[Any]], x: np.ndarray):
        """Whitened differences from readings, and their Jacobian."""
        poses, twists = self.place(q, x)
        r, j = [], []
        for s, sensor in enumerate(self.task.sensors):
            seen = [k for k, row in enumerate(readings) if row[s] is not None]
            place = poses[s, seen, :3, 3]
            by = twists[s, seen]
            if self.task.kind == "socket":
                which = np.array([self.sockets.index(readings[k][s]) for k in seen])
                first = self.size - 3 * len(self.sockets)
                by = by.copy()
                for row, socket in enumerate(which):
                    by[row, :3, first + 3 * socket : first + 3 * socket + 3] -= np.eye(3)
                target = x[first:].reshape(-1, 3)[which]
            else:
                target = np.array([readings[k][s][:3] for k in seen]).reshape(-1, 3)
            r.append(((place - target) / sensor["sigma_m"]).ravel())
            j.append((by[:, :3] / sensor["sigma_m"]).reshape(-1, self.size))
            if self.task.kind == "pose":
                seen_as = of_quaternion(np.array([readings[k][s][3:] for k in seen]).reshape(-1, 4))
                turned = rotation_vector(poses[s, seen, :3, :3] @ np.swapaxes(seen_as, 1, 2))
                r.append((turned / sensor["sigma_rad"]).ravel())
                j.append((by[:, 3:] / sensor["sigma_rad"]).reshape(-1, self.size))
        if self.task.kind == "socket" and len(self.sockets) == 2:
            sensor, first = self.task.sensors[0], self.size - 6
            apart = x[first : first + 3] - x[first + 3 :]
            length = max(np.linalg.norm(apart), 1e-9)
            row = np.zeros((1, self.size))
            row[0, first : first + 3], row[0, first + 3 :] = apart / length, -apart / length
            r.append(np.array([(length - sensor["distance_m"]) / sensor["sigma_distance_m"]]))
            j.append(row / sensor["sigma_distance_m"])
        return np.concatenate(r), np.concatenate(j)

    def deviations_of_prior(self) -> np.ndarray:
        """Standard deviations of the parameters: as told for joints, a metre and a radian for base and targets."""
        prior = self.task.said["prior"]
        joints = np.tile([prior["point_m"]] * 3 + [prior["direction_rad"]] * 3, self.n)
        mounts = np.tile([0.3 if self.task.kind == "socket" else 1.0] * 3 + [1.0] * 3, len(self.mounts))
        return np.concatenate([joints, np.ones(6), mounts, np.full(3 * len(self.sockets), 10.0)])

    def rigid(self) -> np.ndarray:
        """Base, targets and sockets for the chain as described, by Gauss-Newton with damping from several starts; joints at 0."""
        free = np.arange(self.joints.stop, self.size)
        if self.task.kind == "socket":
            free = free[6:]
        q = self.task.pool[self.task.rows]
        best, least = np.zeros(self.size), np.inf
        # With more rows it is near where it was with fewer.
        before = getattr(self.task, "rigid", None)
        starts = [before] if before else [(pose(turn, np.zeros(3)), self.mounts) for turn in self._starts()]
        for base, mounts in starts:
            self.base, self.mounts = base, list(mounts)
            x, damping = np.zeros(self.size), 1e-3
            if self.task.kind == "socket":
                places = self.place(q, x, False)[0][0, :, :3, 3]
                for k, socket in enumerate(self.sockets):
                    first = self.size - 3 * len(self.sockets) + 3 * k
                    x[first : first + 3] = places[[row[0] == socket for row in self.task.readings]].mean(0)
            r, j = self.residuals(q, self.task.readings, x)
            for _ in range(60):
                a = j[:, free]
                weak = 1.0 / self.deviations_of_prior()[free] ** 2
                h = a.T @ a + np.diag(damping * (a * a).sum(0) + weak)
                trial = x.copy()
                trial[free] -= np.linalg.solve(h, a.T @ r + weak * x[free])
                tried, by = self.residuals(q, self.task.readings, trial)
                if tried @ tried <= r @ r:
                    done = r @ r - tried @ tried < 1e-9 * (1 + r @ r)
                    x, r, j, damping = trial, tried, by, damping / 5
                else:
                    damping *= 8
                    done = damping > 1e6
                if self.task.kind != "socket":
                    # The base goes along, so that its rotation stays small.
                    self.base, x[6 * self.n : 6 * self.n + 6] = self.base @ self.at(x, self.n), 0.0
                    for s in range(len(self.mounts)):
                        k = self.n + 1 + s
                        self.mounts[s], x[6 * k : 6 * k + 6] = self.mounts[s] @ self.at(x, k), 0.0
                    r, j = self.residuals(q, self.task.readings, x)
                if done:
                    break
            if r @ r < least:
                best, least, kept = x, r @ r, (self.base, list(self.mounts))
        self.base, self.mounts = kept
        if self.task.kind != "socket":
            self.task.rigid = kept
        return best

    def _starts(self) -> list[np.ndarray]:
        if self.task.kind == "socket":
            return [np.eye(3)]
        return [rotation(np.array(v) * np.pi / 2) for v in ([0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, -1], [2, 0, 0], [0, 2, 0])]

    def predict(self, x: np.ndarray, covariance: np.ndarray | None, noise: np.ndarray) -> None:
        """Delivers predictions at the test postures, with deviations √(J P Jᵀ + σ²); ``noise`` is σ per sensor, metres."""
        poses, twists = self.place(self.task.test, x, covariance is not None)
        mean = np.moveaxis(poses[..., :3, 3], 0, 1)
        if self.task.kind == "pose":
            mean = np.concatenate([mean, np.moveaxis(quaternion(poses[..., :3, :3]), 0, 1)], -1)
        spread = 0.0
        if covariance is not None:
            by = twists[:, :, :3]
            spread = np.moveaxis(np.einsum("srip,pq,sriq->sri", by, covariance, by), 0, 1)
        sd = np.sqrt(np.maximum(spread, 0) + (noise**2)[None, :, None] + np.zeros((len(mean), len(self.mounts), 3)))
        origins = [origin @ self.at(x, k) for k, origin in enumerate(self.origins)]
        self.task.predict(mean, sd, self.chain.axes(self.base @ self.at(x, self.n), origins))


def noise_of(model: Model, r: np.ndarray, parameters: float) -> tuple[float, np.ndarray]:
    """The factor by which noise exceeds what is stated, by all residuals and the parameters they paid for; and σ per sensor, metres."""
    scale = float(np.sqrt(r @ r / max(len(r) - parameters, 0.1 * len(r))))
    return scale, scale * np.array([sensor["sigma_m"] for sensor in model.task.sensors])
