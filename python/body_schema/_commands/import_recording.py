"""A table and a calibration file for `body-schema calibrate` from a bag of ROS or a data set of LeRobot."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._errors import wrong
from ..recordings.need import need
from ..recordings.recording import Distortion, Recording, SensorSpec, Topic, summary

if TYPE_CHECKING:
    from ..recordings.chain import Description
    from ..recordings.clock import Offset
    from ..recordings.moments import Row
    from ..recordings.tracks import JointTrack, SensorTrack

EPILOG = """examples:
  python -m body_schema import run1 --list
  python -m body_schema import run1 --urdf robot.urdf --sensor marker=/mocap/pose --out run1-table
  python -m body_schema import run1.mcap --urdf robot.urdf --sensor tag=tf:camera,tag36h11:3 --moving
  body-schema calibrate run1-table/run1.toml
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the subcommand."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("recording", type=Path, help="a folder or file of rosbag2, a .bag file, or a folder of a LeRobot data set")
    add("--list", action="store_true", help="say what it holds, and write nothing")
    add("--dry-run", action="store_true", help="do everything but write")
    add("--urdf", type=Path, metavar="FILE", help="the robot's description")
    add("--base", metavar="LINK", help="the link that stands still [default: the one that hangs on nothing]")
    add("--tip", metavar="LINK", help="the link that carries the target [default: the end of the longest recorded chain]")
    add("--joints", metavar="TOPIC", help="where joint positions are [default: the topic that has those of the URDF]")
    add("--rename", metavar="RECORDED=URDF", action="append", default=[], help="what a joint is called in the URDF; may be repeated")
    add("--unit", choices=["rad", "deg"], help="of joints that turn [default: rad in bags; a LeRobot data set must say]")
    add(
        "--sensor",
        metavar="[NAME=]TOPIC[#PART]",
        action="append",
        default=[],
        help="what was measured; PART is a tag or marker of the topic, and tf:PARENT,CHILD a transform; may be repeated "
        "[default: the only one]",
    )
    add("--tag-size", type=float, metavar="M", help="the edge of a tag's black square, for corners in pixels")
    add("--camera-info", metavar="TOPIC", help="the camera of pictures, or of corners in pixels [default: the nearest one]")
    lens = parser.add_mutually_exclusive_group()
    lens.add_argument("--rectified", action="store_true", help="pictures, or corners, are rectified: P counts, and no distortion")
    lens.add_argument("--raw", action="store_true", help="pictures, or corners, are raw: they are undistorted")
    add("--mounted", choices=["hand", "beside"], help="where the sensor is [default: found from the recording]")
    add("--target", type=Path, metavar="FILE", help="what to look for in pictures, as print-target writes it")
    add("--camera", type=Path, metavar="FILE", help="the camera of pictures, a camera_info in YAML [default: that of the recording]")
    add("--learn", choices=["axes", "zeros"], default="axes", help="zeros: those of joints that were put together by eye [default: axes]")
    add("--stamps", choices=["header", "received"], default="header", help="what counts as a message's time [default: header]")
    add("--moving", action="store_true", help="take rows while the robot moves too")
    add("--every", type=float, default=0.5, metavar="S", help="with --moving: seconds between rows [default: 0.5]")
    add("--still", type=float, default=0.5, metavar="S", help="how long the robot stands at least, seconds [default: 0.5]")
    add("--still-speed", type=float, metavar="RAD/S", help="slower is standing, rad/s and m/s [default: by the joints' noise]")
    add(
        "--offset",
        metavar="[NAME=]S",
        action="append",
        default=[],
        help="what to add to a sensor's stamps, seconds [default: found from the recording]",
    )
    add("--offset-deviation", type=float, default=0.0, metavar="S", help="how well --offset is known, seconds [default: 0]")
    add("--max-offset", type=float, default=10.0, metavar="S", help="how far offsets are looked for [default: 10]")
    add("--name", help="of the table and the calibration file [default: that of the recording]")
    add("--out", type=Path, metavar="DIR", help="where files are written [default: NAME-table]")
    add("--overwrite", action="store_true", help="replace files that are there")
    add("--verbose", action="store_true", help="say of each row what became of it")


def run(args: argparse.Namespace) -> int:
    """Carry it out. Raises ``Error`` with a sentence where it cannot be done."""
    for field, value, least in (("every", args.every, 0.0), ("still", args.still, 0.0), ("max-offset", args.max_offset, 0.1)):
        if not (math.isfinite(value) and value > least):
            raise wrong(field, f"{value:g} is no time to wait", f"write seconds, more than {least:g}")
    need("ros", "numpy")
    recording = opened(args.recording, args.stamps)
    try:
        if args.list:
            print(listed(recording))
            return 0
        return _imported(recording, args)
    finally:
        recording.close()


def opened(path: Path, stamps: str = "header") -> Recording:
    """The recording at a path, whatever wrote it."""
    from ..recordings.lerobot import DataSet, is_data_set
    from ..recordings.ros import Bag, is_bag

    if not path.exists():
        raise wrong("recording", f"{path} is not there", "name a folder or a file")
    if is_data_set(path):
        return DataSet(path)
    if is_bag(path):
        return Bag(path, stamps)
    what = f"{path} is neither a bag of ROS nor a data set of LeRobot"
    raise wrong("recording", what, "name a folder with metadata.yaml or meta/info.json, or a file .mcap, .db3 or .bag")


def listed(recording: Recording) -> str:
    """What a recording holds, as text."""
    topics = recording.topics()
    if not topics or not any(topic.count for topic in topics):
        raise wrong("recording", f"{recording.path} holds no message", "record again, or name another recording")
    width = max(len(topic.name) for topic in topics)
    kinds = max(len(topic.type) for topic in topics)
    lines = [f"{'topic':{width}}  {'type':{kinds}}  {'count':>7}  {'rate':>9}  {'longest gap':>11}  read as"]
    for topic in topics:
        role = {"joints": "joints", "sensor": "sensor", "image": "pictures", "camera": "camera"}.get(topic.role, "")
        rate, gap = f"{topic.rate_hz:.1f} Hz", f"{topic.longest_gap_s:.2f} s"
        lines.append(f"{topic.name:{width}}  {topic.type:{kinds}}  {topic.count:>7}  {rate:>9}  {gap:>11}  {role}".rstrip())
        if topic.names:
            lines.append(f"{'':{width}}  {', '.join(topic.names)}")
    return "\n".join(lines)


def _imported(recording: Recording, args: argparse.Namespace) -> int:
    from ..recordings import clock, moments, write
    from ..recordings.chain import Description

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
    links = {joint.child: joint.parent for joint in description.joints.values() if joint.moves}
    sensors = [_sensor(recording, spec, links, topics, args) for spec in specs]
    given = _offsets(args, [sensor.name for sensor in sensors])

    print(f"{recording.path}: {len(joints.times)} readings of {len(names)} joints from {', '.join(from_topics)}")
    if joints.dropped:
        print(f"  left out: {summary(joints.dropped)}")
    found: dict[str, Offset] = {}
    used: dict[str, tuple[float, float]] = {}
    for sensor in sensors:
        rate = f"{1.0 / interval:.1f} Hz" if (interval := _interval(sensor)) else "no rate"
        print(f"{sensor.name}: {len(sensor.times)} readings of {sensor.source} ({sensor.kind}, {rate})")
        if sensor.dropped:
            print(f"  left out: {summary(sensor.dropped)}")
        found[sensor.name] = clock.estimate(joints, sensor, description, chain, args.max_offset)
        used[sensor.name] = _decided(sensor.name, found[sensor.name], given, args)
        if args.mounted is not None:
            found[sensor.name].on_hand = args.mounted == "hand"
        if found[sensor.name].on_hand:
            print("  it moves with the hand, and what it sees stands still")

    if args.moving:
        from ..recordings.tracks import jitter

        used = {sensor.name: (used[sensor.name][0], math.hypot(used[sensor.name][1], jitter(sensor.times))) for sensor in sensors}
        rows = moments.moving_rows(joints, sensors, used, args.every)
        standing = None
    else:
        standing = moments.standing(joints, args.still, args.still_speed)
        rows = moments.still_rows(joints, sensors, used, standing)
        speeds = ", ".join(f"{speed:.3g}" for speed in standing.speeds)
        print(f"the robot stands {len(standing.intervals)} times for {args.still:g} s or longer (slower than {speeds} rad/s or m/s)")
        if standing.too_short:
            print(f"  {standing.too_short} times it stands for less")
    kept = [row for row in rows if not row.dropped]
    if args.verbose:
        _tell(rows, kept)
    for why, count in moments.tally(rows).most_common():
        print(f"  {count} rows left out: {why}")
    if not kept:
        what = f"no row is left of {len(rows)}" if rows else f"the robot never stands for {args.still:g} s"
        mend = "add --moving, or let it stand longer when recording" if not args.moving else "see what was left out with --verbose"
        raise wrong("recording", what, mend)

    name = args.name or args.recording.resolve().name.removesuffix(args.recording.suffix if args.recording.is_file() else "") or "recording"
    if name != Path(name).name or name.startswith("."):
        raise wrong("name", f"{name} is no name of a file", "write a name without slashes, and say where with --out")
    folder = args.out or Path(f"{name}-table")
    on_hand = {sensor.name: found[sensor.name].on_hand for sensor in sensors}
    files = {
        "robot.urdf": description.text,
        f"{name}.csv": write.table(names, sensors, kept, on_hand),
        f"{name}.toml": write.calibration(name, description, (base, tip), chain, names, sensors, kept, found, args.moving, args.learn),
        f"{name}.json": write.as_json(_record(recording, joints, sensors, found, used, standing, rows, kept, args)),
    }
    if args.dry_run:
        print(f"{len(kept)} rows; nothing is written (--dry-run)")
        return 0
    write.written(folder, files, args.overwrite)
    print(f"{len(kept)} rows in {folder / (name + '.csv')}; next: body-schema calibrate {folder / (name + '.toml')}")
    return 0


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
    from collections import Counter

    import numpy as np

    from ..recordings.lerobot import DataSet
    from ..recordings.tracks import joint_track

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
        raise wrong("joints", f"{len(track.times)} joint readings are left; {summary(track.dropped)}", "look at the recording with --list")
    furthest = float(np.abs(track.positions).max())
    turning = [index for index, name in enumerate(names) if kinds[name] == "revolute"]
    if unit != "deg" and turning and float(np.abs(track.positions[:, turning]).max()) > 4 * math.pi:
        raise wrong("unit", f"a joint with limits stands at {furthest:.0f} rad", "add --unit deg if these are degrees")
    return track


def _specs(topics: list[Topic], args: argparse.Namespace) -> list[SensorSpec]:
    import re

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
    from ..recordings.images import detector, track
    from ..recordings.tracks import Camera, in_order

    kinds = {topic.name: topic.role for topic in topics}
    if kinds.get(spec.topic) == "image":
        watcher = detector(args.target, lambda: _camera(recording, spec, args))
        seen = watcher.camera
        camera = Camera(seen.name, tuple(seen.size_px), tuple(seen.focal_px), tuple(seen.centre_px))
        found = track(spec.name, spec.written, recording.images(spec), watcher, camera, watcher.target.points_m, watcher.target.facing)
    else:
        found = recording.sensor(spec, links)
        if found.kind == "pixels":
            _corners(recording, spec, found, args)
    found.times, found.values = in_order(found.times, found.values, found.dropped)
    if not len(found.times):
        raise wrong("sensor", f"no reading of {spec.written} is left; {summary(found.dropped)}", "name another, or look with --list")
    return found


def _camera(recording: Recording, spec: SensorSpec, args: argparse.Namespace) -> Any:
    """The camera of pictures, for ``body_schema.vision``: of a file, or as the recording tells it."""
    from ..recordings.images import vision

    its = vision().Camera
    if args.camera is not None:
        return its.read(args.camera, rectified=args.rectified)
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
    import numpy as np

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


def _decided(name: str, found: Offset, given: dict[str, float], args: argparse.Namespace) -> tuple[float, float]:
    """The offset that is used, with its deviation, s. What is given counts, and is compared with what was found."""
    if found.told:
        print(
            f"  clock: {found.seconds:+.4f} ± {found.deviation_s:.4f} s are added to its stamps; "
            f"joints explain {found.explained:.1%} of how it moves ({found.rows} differences)"
        )
    if found.quarters_s:
        quarters = ", ".join(f"{it:+.3f}" for it in found.quarters_s)
        print(f"  warning: its clock drifts or jumps: the offset is {quarters} s in the quarters of the recording")
    if name not in given:
        if not found.told:
            mend = "give it with --offset S (0 where one clock stamps both), or record movements that do not repeat"
            raise wrong("offset", f"the clock of {name} cannot be told: {found.why}", mend)
        return found.seconds, found.deviation_s
    if not found.told:
        print(f"  clock: {given[name]:+.4f} s as given; it cannot be told from the recording: {found.why}")
    elif abs(found.seconds - given[name]) > max(5.0 * found.deviation_s, 0.02):
        print(f"  warning: {given[name]:+.4f} s were given, and count, but the recording says {found.seconds:+.4f} s")
    else:
        print(f"  {given[name]:+.4f} s as given count")
    return given[name], args.offset_deviation


def _interval(sensor: SensorTrack) -> float:
    from ..recordings.tracks import usual_interval

    return usual_interval(sensor.times)


def _tell(rows: list[Row], kept: list[Row]) -> None:
    number = 0
    for row in rows:
        when = f"{row.start:8.2f} to {row.end:.2f} s" if row.end > row.start else f"{row.start:8.3f} s"
        if row.dropped:
            print(f"  {when}: left out: {row.dropped}")
            continue
        number += 1
        seen = ", ".join(f"{name} {reading.samples} readings" for name, reading in row.readings.items())
        print(f"  {when}: row {number}, {row.samples} of joints, {seen}" + "".join(f"; {note}" for note in row.notes))


def _record(
    recording: Recording,
    joints: JointTrack,
    sensors: list[SensorTrack],
    found: dict[str, Offset],
    used: dict[str, tuple[float, float]],
    standing: Any,
    rows: list[Row],
    kept: list[Row],
    args: argparse.Namespace,
) -> dict[str, Any]:
    """What became of the recording, for programs."""
    numbers = {id(row): number for number, row in enumerate(kept, start=1)}
    return {
        "recording": recording.path.name,
        "joints": {
            "names": joints.names,
            "readings": len(joints.times),
            "usual_interval_s": joints.interval_s,
            "left_out": dict(joints.dropped),
        },
        "sensors": [
            {
                "name": sensor.name,
                "source": sensor.source,
                "kind": sensor.kind,
                "frame": sensor.frame,
                "readings": len(sensor.times),
                "left_out": dict(sensor.dropped),
                "on_hand": found[sensor.name].on_hand,
                "offset_s": used[sensor.name][0],
                "offset_deviation_s": used[sensor.name][1],
                "offset_found": {
                    "seconds": found[sensor.name].seconds,
                    "deviation_s": found[sensor.name].deviation_s,
                    "quarters_s": found[sensor.name].quarters_s,
                    "explained": found[sensor.name].explained,
                    "rivals_s": found[sensor.name].rivals,
                    "why_not": found[sensor.name].why,
                },
            }
            for sensor in sensors
        ],
        "moving": args.moving,
        "standing_below": None if standing is None else dict(zip(joints.names, standing.speeds)),
        "rows": [
            {
                "row": numbers.get(id(row)),
                "start_s": row.start,
                "end_s": row.end,
                "left_out": row.dropped or None,
                "notes": row.notes,
                "joint_samples": row.samples,
                "joint_deviations": row.deviations,
                "readings": {
                    name: {"samples": reading.samples, "deviation": reading.deviation, "rotation_deviation_rad": reading.turn}
                    for name, reading in row.readings.items()
                },
            }
            for row in rows
        ],
    }


__all__ = ["add_arguments", "listed", "opened", "run"]
