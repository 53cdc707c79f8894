"""What is taken of a recording, as the arguments of ``import`` say: its joints, what its sensors read, their clocks, and rows."""

from __future__ import annotations

import argparse
import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._errors import wrong
from .._urdf import Joint
from . import clock, moments
from .chain import Description
from .clock import Offset
from .images import detector, track, vision
from .lerobot import DataSet
from .moments import Row, Standing
from .need import need
from .recording import Distortion, Recording, SensorSpec, Topic, summary, word_of
from .tracks import Camera, JointTrack, SensorTrack, in_order, jitter, joint_track, usual_interval


LEAST_OF_DRIFT_S = 30.0
"""Quarters of a shorter recording hold a movement or two each: what they differ by is no drift that is told."""


@dataclass
class Taken:
    """What was taken: ``found`` is what is known of each sensor's clock, ``used`` the offset that counts, with its deviation (s)."""

    recording: Recording
    description: Description
    ends: tuple[str, str]
    """The links at the ends of the chain."""
    chain: list[Joint]
    joints: JointTrack
    sensors: list[SensorTrack]
    found: dict[str, Offset]
    used: dict[str, tuple[float, float]]
    standing: Standing | None
    rows: list[Row]
    if_none: tuple[str, str]
    """What is said where the robot never stands, and what to do where no row is left."""

    @property
    def kept(self) -> list[Row]:
        """The rows of the table."""
        return [row for row in self.rows if not row.dropped]

    @property
    def on_hand(self) -> dict[str, bool]:
        """By sensor, whether it moves with the hand."""
        return {sensor.name: self.found[sensor.name].on_hand for sensor in self.sensors}

    def check(self) -> None:
        """Raises ``FieldError`` where no row is left."""
        if not self.kept:
            what = f"no row is left of {len(self.rows)}" if self.rows else self.if_none[0]
            raise wrong("recording", what, self.if_none[1])


def taken(recording: Recording, args: argparse.Namespace, say: Callable[[str], None]) -> Taken:
    """Take it; ``say`` hears a summary, line by line. Raises ``Error`` with a sentence where it cannot be done."""
    if args.urdf is None:
        raise wrong("urdf", "the robot's description is missing", "name it with --urdf FILE, or see what there is with --list")
    description = Description(args.urdf)
    topics = recording.topics(whole=False)
    series, from_topics = _series(recording, topics, args, description)
    base = args.base or description.base()
    tip = args.tip or description.tip(base, list(series))
    chain = description.chain(base, tip)
    names = description.needs(chain, list(series))
    joints = _joints(description, names, series, recording, args)
    specs = _specs(topics, args)
    pictures = {topic.name for topic in topics if topic.role == "image"}
    if args.fov_deg is not None and not any(spec.topic in pictures for spec in specs):
        raise wrong("fov-deg", "nothing is looked for in pictures", "leave it out, or name a topic of pictures with --sensor")
    links = {joint.child: joint.parent for joint in description.joints.values() if joint.moves}
    sensors = [_sensor(recording, spec, links, topics, args) for spec in specs]
    given = _offsets(args, [sensor.name for sensor in sensors])

    say(f"{recording.path}: {len(joints.times)} readings of {len(names)} joints from {', '.join(from_topics)}")
    if joints.dropped:
        say(f"  left out: {summary(joints.dropped)}")
    found: dict[str, Offset] = {}
    used: dict[str, tuple[float, float]] = {}
    for sensor in sensors:
        rate = f"{1.0 / interval:.1f} Hz" if (interval := usual_interval(sensor.times)) else "no rate"
        say(f"{sensor.name}: {len(sensor.times)} readings of {sensor.source} ({sensor.kind}, {rate})")
        if sensor.dropped:
            say(f"  left out: {summary(sensor.dropped)}")
        its = clock.estimate(joints, sensor, description, chain, args.max_offset)
        used[sensor.name] = _decided(sensor.name, its, given, float(np.ptp(joints.times)), args, say)
        found[sensor.name] = its if args.mounted is None else replace(its, on_hand=args.mounted == "hand")
        if found[sensor.name].on_hand:
            say("  it moves with the hand, and what it sees stands still")

    standing = None
    if args.moving:
        used = {sensor.name: (used[sensor.name][0], math.hypot(used[sensor.name][1], jitter(sensor.times))) for sensor in sensors}
        rows = moments.moving_rows(joints, sensors, used, args.every)
    else:
        standing = moments.standing(joints, args.still, args.still_speed)
        rows = moments.still_rows(joints, sensors, used, standing)
        speeds = ", ".join(f"{speed:.3g}" for speed in standing.speeds)
        say(f"the robot stands {len(standing.intervals)} times for {args.still:g} s or longer (slower than {speeds} rad/s or m/s)")
        if standing.too_short:
            say(f"  {standing.too_short} times it stands for less")
    mend = "see what was left out with --verbose" if args.moving else "add --moving, or let it stand longer when recording"
    if_none = f"the robot never stands for {args.still:g} s", mend
    return Taken(recording, description, (base, tip), chain, joints, sensors, found, used, standing, rows, if_none)


def _series(
    recording: Recording, topics: list[Topic], args: argparse.Namespace, description: Description
) -> tuple[dict[str, Any], list[str]]:
    """Times and positions by the URDF's names, and the topics that they are from."""
    there = [topic for topic in topics if topic.role == "joints" and topic.count]
    if not there:
        held = ", ".join(f"{topic.name} ({topic.type})" for topic in topics) or "nothing"
        what = f"{recording.path} has no joint positions (sensor_msgs/JointState or observation.state), but {held}"
        raise wrong("joints", what, "record /joint_states too")
    renamed: dict[str, str] = {}
    for pair in args.rename:
        recorded, equals, urdf = pair.partition("=")
        if not equals or urdf not in description.joints:
            what = f"{pair} names no joint of the URDF" if equals else f"{pair} is no pair"
            raise wrong("rename", what, f"write RECORDED=URDF, with one of {', '.join(description.moving())}")
        renamed[recorded] = urdf
    chosen = [topic.name for topic in there]
    if args.joints is not None:
        if args.joints not in chosen:
            raise wrong("joints", f"{args.joints} has no joint positions", f"name one of {', '.join(chosen)}")
        chosen = [args.joints]
    read = {topic: {renamed.get(name, name): it for name, it in recording.joints(topic).items()} for topic in chosen}
    useful = {topic: it for topic, it in read.items() if set(it) & set(description.moving())} or read
    merged: dict[str, Any] = {}
    for topic, it in useful.items():
        if twice := set(it) & set(merged) & set(description.moving()):
            what = f"{', '.join(sorted(twice))} stands in {len(useful)} topics: {', '.join(useful)}"
            raise wrong("joints", what, "name one with --joints TOPIC")
        merged.update(it)
    return merged, list(useful)


def _joints(
    description: Description, names: list[str], series: dict[str, Any], recording: Recording, args: argparse.Namespace
) -> JointTrack:
    unit = args.unit
    if unit is None and isinstance(recording, DataSet):
        what = "LeRobot records degrees, radians or a share of the range, as the arm was set up"
        raise wrong("unit", what, "say which with --unit deg or --unit rad; a share of the range cannot be calibrated")
    kinds = {name: description.joints[name].kind for name in names}
    scaled = {
        name: (series[name][0], series[name][1] * (math.pi / 180.0 if unit == "deg" and kinds[name] != "prismatic" else 1.0))
        for name in names
    }
    track = joint_track(names, scaled, {name for name in names if kinds[name] == "continuous"}, Counter())
    if len(track.times) < 2:
        why = f"; {summary(track.dropped)}" if track.dropped else ""
        raise wrong("joints", f"{len(track.times)} joint readings are left{why}", "look at the recording with --list")
    furthest = float(np.abs(track.positions).max())
    turning = [index for index, name in enumerate(names) if kinds[name] == "revolute"]
    if unit != "deg" and turning and float(np.abs(track.positions[:, turning]).max()) > 4 * math.pi:
        raise wrong("unit", f"a joint with limits stands at {furthest:.0f} rad", "add --unit deg if these are degrees")
    return track


def _specs(topics: list[Topic], args: argparse.Namespace) -> list[SensorSpec]:
    specs = []
    for text in args.sensor:
        head, equals, rest = text.partition("=")
        name, topic = (head, rest) if equals else ("", text)
        if not topic.startswith("tf:"):
            topic, _, part = topic.partition("#")
        else:
            part = ""
        specs.append((name, topic, part))
    if not specs:
        there = [topic for topic in topics if topic.role == "sensor" and topic.count]
        there = [topic for topic in there if not topic.type.endswith(("TFMessage", "tfMessage"))]
        if len(there) != 1:
            others = [topic.name for topic in topics if topic.role in ("sensor", "image") and topic.count]
            what = f"{len(there)} topics could be the sensor's: {', '.join(others) or 'none'}"
            raise wrong("sensor", what, "name one with --sensor TOPIC, or a transform as --sensor tf:PARENT,CHILD")
        specs = [("", there[0].name, "")]
    made: list[SensorSpec] = []
    for name, topic, part in specs:
        if not name:
            words = [word for word in re.split(r"[/,.]", topic) if word] or ["marker"]
            name = f"tag_{part}" if part.isdigit() else part or words[-1]
        name = re.sub(r"\W+", "_", name).strip("_") or "marker"
        if any(name == it.name for it in made):
            raise wrong("sensor", f"two sensors are called {name}", "name them, as --sensor NAME=TOPIC")
        made.append(SensorSpec(name, topic, part))
    return made


def _sensor(
    recording: Recording, spec: SensorSpec, links: dict[str, str], topics: list[Topic], args: argparse.Namespace
) -> SensorTrack:
    kinds = {topic.name: topic.role for topic in topics}
    if kinds.get(spec.topic) == "image":
        watcher = detector(args.target, lambda: _camera(recording, spec, args))
        seen = watcher.camera
        learned = {key: it for key, it in seen.section().items() if key in ("known_to_px", "learn_distortion_to")}
        camera = Camera(seen.name, tuple(seen.size_px), tuple(seen.focal_px), tuple(seen.centre_px), learned)
        found = track(spec.name, spec.written, recording.images(spec), watcher, camera, watcher.target.points_m, watcher.target.facing)
    else:
        found = recording.sensor(spec, links)
        if found.kind == "pixels":
            _corners(recording, spec, found, args)
    found.times, found.values = in_order(found.times, found.values, found.dropped, found.is_partly_seen)
    if not len(found.times):
        raise wrong("sensor", f"no reading of {spec.written} is left; {summary(found.dropped)}", "name another, or look with --list")
    return found


def _camera(recording: Recording, spec: SensorSpec, args: argparse.Namespace) -> Any:
    """The camera of pictures, for ``body_schema.vision``: of a file, or as the recording tells it."""
    its = vision().Camera
    if args.camera is not None:
        return its.read(args.camera, rectified=args.rectified)
    if args.fov_deg is not None:
        for _, picture in recording.images(spec):
            return its.guess((picture.shape[1], picture.shape[0]), fov_deg=args.fov_deg, name=word_of(spec.topic))
        raise wrong("sensor", f"{spec.topic} holds no picture", "name another, or look with --list")
    seen, distortion = recording.camera(spec, args.camera_info, args.rectified)
    _lens_is_told(distortion, "pictures", args)
    size = (round(seen.size_px[0]), round(seen.size_px[1]))
    lens = (distortion.coefficients, distortion.model) if distortion.any else ()
    return its(size, seen.focal_px, seen.centre_px, *lens, name=seen.name)


def _lens_is_told(distortion: Distortion, what: str, args: argparse.Namespace) -> None:
    if distortion.any and not (args.raw or args.rectified):
        told = f"the camera distorts ({distortion.model}), and nothing says whether {what} are raw or rectified"
        raise wrong("camera-info", told, "add --raw or --rectified")


def _corners(recording: Recording, spec: SensorSpec, found: SensorTrack, args: argparse.Namespace) -> None:
    """A tag's corners: its size, its camera, and pixels as a pinhole sees them."""
    if args.tag_size is None or not 1e-3 < args.tag_size < 10.0:
        raise wrong("tag-size", "corners in pixels need the size of the tag", "measure the black square, and write --tag-size M, metres")
    assert found.points_m is not None
    found.points_m = [[x * args.tag_size for x in point] for point in found.points_m]
    found.camera, distortion = recording.camera(spec, args.camera_info, args.rectified)
    _lens_is_told(distortion, "the pictures of corners", args)
    if distortion.any:
        _undistort(found, distortion)


def _undistort(found: SensorTrack, distortion: Distortion) -> None:
    (cv2,) = need("vision", "cv2")
    camera = found.camera
    assert camera is not None
    k = np.array([[camera.focal_px[0], 0, camera.centre_px[0]], [0, camera.focal_px[1], camera.centre_px[1]], [0, 0, 1.0]])
    d = np.array(distortion.coefficients)
    points = found.values.reshape(-1, 1, 2)
    if distortion.model in ("plumb_bob", "rational_polynomial"):
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
        straight = cv2.undistortPointsIter(points, k, d, None, k, criteria)
        flat = (straight.reshape(-1, 2) - [k[0, 2], k[1, 2]]) / [k[0, 0], k[1, 1]]
        rays = np.column_stack([flat, np.ones(len(flat))])
        again = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), k, d)[0]
    elif distortion.model in ("equidistant", "fisheye"):
        straight = cv2.fisheye.undistortPoints(points, k, d[:4], P=k)
        flat = (straight.reshape(-1, 1, 2) - [k[0, 2], k[1, 2]]) / [k[0, 0], k[1, 1]]
        again = cv2.fisheye.distortPoints(flat, k, d[:4])
    else:
        raise wrong("camera-info", f"{distortion.model} is no lens that is known", "rectify the pictures, and add --rectified")
    off = np.linalg.norm(again.reshape(len(found.values), -1) - found.values, axis=1)
    found.values = np.where((off < 0.1)[:, None], straight.reshape(len(found.values), -1), np.nan)
    if (bad := int((off >= 0.1).sum())):
        found.dropped["outside of what the lens model describes"] += bad


def _offsets(args: argparse.Namespace, names: list[str]) -> dict[str, float]:
    given: dict[str, float] = {}
    for text in args.offset:
        name, equals, number = text.rpartition("=")
        try:
            seconds = float(number)
        except ValueError:
            seconds = math.nan
        if not math.isfinite(seconds) or (equals and name not in names):
            what = f"{text} is no offset of a sensor"
            raise wrong("offset", what, f"write seconds, or NAME=seconds with one of {', '.join(names)}")
        given.update({name: seconds} if equals else dict.fromkeys(names, seconds))
    return given


def _decided(
    name: str, found: Offset, given: dict[str, float], lasts_s: float, args: argparse.Namespace, say: Callable[[str], None]
) -> tuple[float, float]:
    """The offset that is used, with its deviation, s. What is given counts, and is compared with what was found."""
    if found.told:
        say(
            f"  clock: {found.seconds:+.4f} ± {found.deviation_s:.4f} s are added to its stamps; "
            f"joints explain {found.explained:.1%} of how it moves ({found.rows} differences)"
        )
    if found.quarters_s and found.told and lasts_s >= LEAST_OF_DRIFT_S:
        quarters = ", ".join(f"{it:+.3f}" for it in found.quarters_s)
        say(f"  warning: its clock drifts or jumps: the offset is {quarters} s in the quarters of the recording")
    if name not in given:
        if not found.told:
            mend = "give it with --offset S (0 where one clock stamps both), or record movements that do not repeat"
            raise wrong("offset", f"the clock of {name} cannot be told: {found.why}", mend)
        return found.seconds, found.deviation_s
    if not found.told:
        say(f"  clock: {given[name]:+.4f} s as given; it cannot be told from the recording: {found.why}")
    elif abs(found.seconds - given[name]) > max(5.0 * found.deviation_s, 0.02):
        say(f"  warning: {given[name]:+.4f} s were given, and count, but the recording says {found.seconds:+.4f} s")
    else:
        say(f"  {given[name]:+.4f} s as given count")
    return given[name], args.offset_deviation
