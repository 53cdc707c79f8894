"""A table and a calibration file for `body-schema calibrate` from a bag of ROS or a data set of LeRobot."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._errors import wrong
from ..recordings.need import need
from ..recordings.recording import Recording

if TYPE_CHECKING:
    from ..recordings.moments import Row
    from ..recordings.taken import Taken

EPILOG = """examples:
  python -m body_schema import run1 --list
  python -m body_schema import run1 --urdf robot.urdf --sensor marker=/mocap/pose --out run1-table
  python -m body_schema import run1.mcap --urdf robot.urdf --sensor tag=tf:camera,tag36h11:3 --moving
  body-schema calibrate run1-table/run1.toml
  python -m body_schema import mornings/ --follow --urdf robot.urdf --sensor marker=/mocap/pose --mounted beside --out mornings.csv
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the subcommand."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("recording", type=Path, help="a folder or file of rosbag2, a .bag file, or a folder of a LeRobot data set")
    add("--follow", action="store_true", help="it is a folder: add rows to the table --out CSV as recordings are put into it, until Ctrl-C")
    add("--once", action="store_true", help="with --follow: take what is there, and end")
    add("--settle", type=float, default=10.0, metavar="S", help="with --follow: nobody has written a recording for so long [default: 10]")
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
    add("--fov-deg", type=float, metavar="DEG", help="there is none: it is learned; the horizontal field of view of raw pictures, about")
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
    add("--out", type=Path, metavar="DIR", help="where files are written [default: NAME-table]; with --follow the table")
    add("--overwrite", action="store_true", help="replace files that are there")
    add("--plot", type=Path, metavar="FILE", help="draw joints, sensors and rows over time there, as .png, .svg or .pdf (needs matplotlib)")
    add("--verbose", action="store_true", help="say of each row what became of it")


def run(args: argparse.Namespace) -> int:
    """Carry it out. Raises ``Error`` with a sentence where it cannot be done."""
    for field, value, least in (("every", args.every, 0.0), ("still", args.still, 0.0), ("max-offset", args.max_offset, 0.1)):
        if not (math.isfinite(value) and value > least):
            raise wrong(field, f"{value:g} is no time to wait", f"write seconds, more than {least:g}")
    for field in ("camera", "camera_info", "rectified"):
        if args.fov_deg is not None and getattr(args, field):
            option = field.replace("_", "-")
            raise wrong(option, "--fov-deg is for a camera that nobody has calibrated", f"write one of --{option} and --fov-deg")
    if args.plot is not None and args.plot.exists() and not args.overwrite:
        raise wrong("plot", f"{args.plot} is there already", "name another file, or add --overwrite")
    need("ros", "numpy")
    if args.follow:
        from .import_follow import follow

        return follow(args)
    if args.once:
        raise wrong("once", "it has no meaning without --follow", "leave it out")
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
    from ..recordings import moments, write
    from ..recordings.plot import plot
    from ..recordings.taken import taken

    found = taken(recording, args, print)
    if args.verbose:
        _tell(found.rows, found.kept)
    for why, count in moments.tally(found.rows).most_common():
        print(f"  {count} rows left out: {why}")
    # A picture says most where no row is left.
    if args.plot is not None:
        try:
            plot(found, args.plot)
        except (OSError, ValueError) as error:
            raise wrong("plot", f"{args.plot} cannot be written ({error})", "name a file that ends with .png, .svg or .pdf") from None
        print(f"drew {args.plot}")
    found.check()

    name = args.name or args.recording.resolve().name.removesuffix(args.recording.suffix if args.recording.is_file() else "") or "recording"
    if name != Path(name).name or name.startswith("."):
        raise wrong("name", f"{name} is no name of a file", "write a name without slashes, and say where with --out")
    folder = args.out or Path(f"{name}-table")
    calibration, doubts = write.calibration(name, found, args.moving, args.learn)
    for doubt in doubts:
        print(f"doubt: {doubt}")
    files = {
        "robot.urdf": found.description.text,
        f"{name}.csv": write.table(found.joints.names, found.sensors, found.kept, found.on_hand),
        f"{name}.toml": calibration,
        f"{name}.json": write.as_json(_record(found, args)),
    }
    if args.dry_run:
        print(f"{len(found.kept)} rows; nothing is written (--dry-run)")
        return 0
    write.written(folder, files, args.overwrite)
    print(f"{len(found.kept)} rows in {folder / (name + '.csv')}; next: body-schema calibrate {folder / (name + '.toml')}")
    return 0


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


def _record(taken: Taken, args: argparse.Namespace) -> dict[str, Any]:
    """What became of the recording, for programs."""
    joints, found, used = taken.joints, taken.found, taken.used
    numbers = {id(row): number for number, row in enumerate(taken.kept, start=1)}
    return {
        "recording": taken.recording.path.name,
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
            for sensor in taken.sensors
        ],
        "moving": args.moving,
        "standing_below": None if taken.standing is None else dict(zip(joints.names, taken.standing.speeds)),
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
            for row in taken.rows
        ],
    }


__all__ = ["add_arguments", "listed", "opened", "run"]
