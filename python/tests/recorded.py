"""A robot that is recorded: an arm whose URDF is a little wrong moves from posture to posture, before a sensor with a clock of its own.

The kinematics here are their own, so that a mistake in those of the package shows.
"""

from __future__ import annotations

import math
import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

URDF = Path(__file__).resolve().parents[2] / "scenarios" / "ur10.urdf"
BASE, TIP = "base_link", "tool0"
START_NS = 1_700_000_000_000_000_000
NAN = float("nan")


def rotation(axis: Any, angle: float) -> Any:
    """Rodrigues."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def quaternion(r: Any) -> list[float]:
    """x, y, z, w of a rotation matrix, by its angle and axis."""
    angle = math.acos(max(-1.0, min(1.0, (np.trace(r) - 1) / 2)))
    axis = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    if np.linalg.norm(axis) < 1e-8:
        if angle < 1.0:
            return [0.0, 0.0, 0.0, 1.0]
        axis = np.linalg.eigh((r + r.T) / 2)[1][:, -1]
    axis = axis / np.linalg.norm(axis) * math.sin(angle / 2)
    return [float(axis[0]), float(axis[1]), float(axis[2]), math.cos(angle / 2)]


class Arm:
    """The true arm: the URDF's, with every joint turned by about half a degree and shifted by some millimetres."""

    def __init__(self, seed: int, wrong: float = 1.0) -> None:
        random = np.random.default_rng(seed)
        joints = {it.find("child").get("link"): it for it in ElementTree.parse(URDF).getroot().findall("joint")}  # type: ignore[union-attr]
        chain = []
        link = TIP
        while link != BASE:
            chain.append(joints[link])
            link = joints[link].find("parent").get("link")  # type: ignore[union-attr]
        self.joints: list[tuple[str, Any, Any, Any]] = []
        self.names: list[str] = []
        for joint in reversed(chain):
            origin = joint.find("origin")
            rpy = [float(it) for it in origin.get("rpy", "0 0 0").split()] if origin is not None else [0.0] * 3
            at = np.array([float(it) for it in origin.get("xyz", "0 0 0").split()] if origin is not None else [0.0] * 3)
            turned = rotation([0, 0, 1], rpy[2]) @ rotation([0, 1, 0], rpy[1]) @ rotation([1, 0, 0], rpy[0])
            name, axis = "", np.zeros(3)
            if joint.get("type") in ("revolute", "continuous"):
                name = joint.get("name", "")
                axis = np.array([float(it) for it in joint.find("axis").get("xyz").split()])  # type: ignore[union-attr]
                self.names.append(name)
                error = random.normal(0.0, 0.006 * wrong, 3) + 1e-12
                turned = turned @ rotation(error, float(np.linalg.norm(error)))
                at = at + random.normal(0.0, 0.003 * wrong, 3)
            self.joints.append((name, turned, at, axis))
        # Where the tag is on the hand, and the base before the sensor.
        self.tag = (rotation([0.3, -1, 0.2], 0.7), np.array([0.05, -0.03, 0.08]))
        self.base = (rotation([0.1, 0.2, 1], 0.8), np.array([0.4, -0.6, 0.2]))

    def hand(self, positions: dict[str, float]) -> tuple[Any, Any]:
        r, p = np.eye(3), np.zeros(3)
        for name, turned, at, axis in self.joints:
            p = p + r @ at
            r = r @ turned
            if name:
                r = r @ rotation(axis, positions[name])
        return r, p

    def tag_at(self, positions: dict[str, float]) -> tuple[Any, Any]:
        """The tag in the frame of the sensor."""
        r, p = self.hand(positions)
        place = p + r @ self.tag[1]
        return self.base[0] @ r @ self.tag[0], self.base[0] @ place + self.base[1]


class Run:
    """A run: standing for ``dwell_s``, moving for a second or two, ``movements`` times."""

    def __init__(self, seed: int, movements: int = 30, dwell_s: float = 1.0, repeats: bool = False) -> None:
        random = np.random.default_rng(seed + 77)
        self.arm = Arm(seed)
        count = len(self.arm.names)
        self.dwell_s = dwell_s
        self.postures = [random.uniform(-1.2, 1.2, count) for _ in range(movements + 1)]
        self.durations = [float(random.uniform(1.0, 2.0)) for _ in range(movements)]
        if repeats:
            self.postures = [self.postures[index % 2] for index in range(movements + 1)]
            self.durations = [1.5] * movements
        self.leaves = [dwell_s]
        for duration in self.durations[:-1]:
            self.leaves.append(self.leaves[-1] + duration + dwell_s)
        self.end_s = self.leaves[-1] + self.durations[-1] + dwell_s
        self.random = random

    def at(self, time: float) -> dict[str, float]:
        """Where the joints truly are."""
        q = self.postures[0]
        for index, (leave, duration) in enumerate(zip(self.leaves, self.durations)):
            if time <= leave:
                break
            s = min((time - leave) / duration, 1.0)
            q = self.postures[index] + (self.postures[index + 1] - self.postures[index]) * s**3 * (10 - 15 * s + 6 * s * s)
        return {name: float(it) for name, it in zip(self.arm.names, q)}

    def standing(self, time: float) -> bool:
        return not any(leave < time < leave + duration for leave, duration in zip(self.leaves, self.durations))

    def joint_messages(self, rate_hz: float = 100.0, faults: bool = True) -> list[tuple[float, list[str], list[float]]]:
        """Stamps, names and positions; with faults in another order each time, some missing, doubled or not a number."""
        messages = []
        for index in range(int(self.end_s * rate_hz)):
            time = index / rate_hz + (float(self.random.normal(0.0, 0.001)) if faults else 0.0)
            true = self.at(time)
            names = [*true, "finger"]
            positions = {name: it + float(self.random.normal(0.0, 5e-5)) for name, it in {**true, "finger": 0.01}.items()}
            if faults:
                self.random.shuffle(names)
                if self.random.random() < 0.02 or 20.0 < time < 20.4:
                    continue
                if self.random.random() < 0.005:
                    positions[names[0]] = NAN
            messages.append((time, names, [positions[name] for name in names]))
            if faults and self.random.random() < 0.01:
                messages.append(messages[-1])
        return messages

    def readings(
        self, offset_s: float, rate_hz: float = 30.0, faults: bool = True, moving: bool = True
    ) -> list[tuple[float, float, list[float]]]:
        """When it was, the stamp (``offset_s`` behind), and the pose x, y, z, qx, qy, qz, qw."""
        readings = []
        for index in range(int(self.end_s * rate_hz)):
            time = (index + 0.5) / rate_hz
            # Drawn whether it is read or not, so that runs that differ in what is recorded have the same noise.
            lost, jumps, none = (faults and bool(self.random.random() < share) for share in (0.1, 0.01, 0.01))
            late, jump = float(self.random.normal(0.0, 0.001)), self.random.normal(0.0, 0.3, 3)
            noise, shake = self.random.normal(0.0, 5e-4, 3), self.random.normal(0.0, 1e-3, 3)
            if lost or not (moving or self.standing(time)):
                continue
            r, p = self.arm.tag_at(self.at(time))
            p = p + noise + (jump if jumps else 0.0)
            r = r @ rotation(shake, float(np.linalg.norm(shake)))
            if none:
                p = np.full(3, NAN)
            readings.append((time, time - offset_s + (late if faults else 0.0), [*map(float, p), *quaternion(r)]))
        return readings


def bag(
    path: Path,
    kind: str,
    run: Run,
    offset_s: float = 0.0,
    *,
    moving: bool = True,
    faults: bool = True,
    joints: bool = True,
    extra: Any = None,
    start_ns: int = START_NS,
) -> Path:
    """Write a run as ``sqlite3``, ``mcap`` or ``bag`` (ROS 1); gives what to open. ``extra(typestore, ros2)`` gives more messages."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    ros2 = kind != "bag"
    store = get_typestore(Stores.ROS2_HUMBLE if ros2 else Stores.ROS1_NOETIC)
    types = store.types
    header_more = {} if ros2 else {"seq": 0}

    def header(time: float, frame: str) -> Any:
        ns = start_ns + round(time * 1e9)
        return types["std_msgs/msg/Header"](
            stamp=types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9), frame_id=frame, **header_more
        )

    messages: list[tuple[float, str, str, Any]] = []
    if joints:
        nothing = np.zeros(0)
        for time, names, positions in run.joint_messages(faults=faults):
            message = types["sensor_msgs/msg/JointState"](
                header=header(time, ""), name=names, position=np.array(positions), velocity=nothing, effort=nothing
            )
            messages.append((time, "/joint_states", "sensor_msgs/msg/JointState", message))
    for time, stamp, pose in run.readings(offset_s, faults=faults, moving=moving):
        message = types["geometry_msgs/msg/PoseStamped"](
            header=header(stamp, "world"),
            pose=types["geometry_msgs/msg/Pose"](
                position=types["geometry_msgs/msg/Point"](*pose[:3]), orientation=types["geometry_msgs/msg/Quaternion"](*pose[3:])
            ),
        )
        messages.append((time + 0.02, "/mocap/tag", "geometry_msgs/msg/PoseStamped", message))
    if extra is not None:
        messages += extra(store, header)
    messages.sort(key=lambda it: it[0])
    if ros2:
        writer: Any = Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3)
    else:
        path = path.with_suffix(".bag")
        writer = Writer1(path)
    with writer:
        topics = {}
        for received, topic, name, message in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, name, typestore=store)
            raw = store.serialize_cdr(message, name) if ros2 else store.serialize_ros1(message, name)
            writer.write(topics[topic], start_ns + round(max(received, 0.0) * 1e9), raw)
    return path


def joints(run: Run) -> Any:
    """A run's joint readings as the package has them."""
    from body_schema.recordings.tracks import joint_track

    series: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in run.arm.names}
    for time, names, positions in run.joint_messages():
        for name, position in zip(names, positions):
            if name in series:
                series[name][0].append(time)
                series[name][1].append(position)
    arrays = {name: (np.array(times), np.array(positions)) for name, (times, positions) in series.items()}
    return joint_track(run.arm.names, arrays, set(), Counter())


def sensor(kind: str, times: Any, values: Any) -> Any:
    """Readings as the package has them."""
    from body_schema.recordings.tracks import SensorTrack, in_order

    return SensorTrack("tag", kind, *in_order(np.array(times), np.array(values), Counter()))


def seen(run: Run, offset_s: float, kind: str, **more: Any) -> Any:
    """What the sensor read in a run, as ``pose`` or as ``position``."""
    readings = run.readings(offset_s, **more)
    rows = [pose if kind == "pose" else pose[:3] for _, _, pose in readings]
    return sensor(kind, [stamp for _, stamp, _ in readings], rows)


def main() -> None:
    """Tell how far off the offsets of clocks are that are found: ``python recorded.py FIRST LAST``, seeds."""
    from body_schema.recordings import clock
    from body_schema.recordings.chain import Description

    description = Description(URDF)
    errors, sure = [], []
    for seed in range(int(sys.argv[1]), int(sys.argv[2]) + 1):
        offset_s = float(np.random.default_rng(seed).uniform(-5.0, 5.0))
        run = Run(seed)
        kind = ("pose", "position")[seed % 2]
        found = clock.estimate(joints(run), seen(run, offset_s, kind), description, description.chain(BASE, TIP), 10.0)
        errors.append(abs(found.seconds - offset_s))
        sure.append(found.deviation_s)
        print(f"seed {seed}, {kind}: {offset_s:+.3f} s, found {found.seconds:+.4f} ± {found.deviation_s:.4f} s {found.why}", flush=True)
    ratio = np.array(errors) / np.array(sure)
    print(f"off by {1e3 * np.median(errors):.2f} ms (median), {1e3 * np.max(errors):.2f} ms (at most)")
    print(f"off by {np.median(ratio):.2f} of the deviation that is stated (median), {np.max(ratio):.1f} (at most)")


if __name__ == "__main__":
    main()
