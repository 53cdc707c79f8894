"""What a calibration found, in the files that robots' own drivers read.

  python -m body_schema export ur my-calibration --file default_kinematics.yaml --out my_kinematics.yaml
  python -m body_schema export xarm my-calibration --out xarm7_kinematics_mine.yaml
  python -m body_schema export mjcf my-calibration --file robot.xml --out calibrated.xml --body wrist_link=wrist
  python -m body_schema export xacro my-calibration --file arm.urdf.xacro --out calibrated.urdf.xacro
  python -m body_schema export pal my-calibration --original tiago.urdf --file constants.xacro --out calibrated-constants.xacro
  python -m body_schema export lerobot my-calibration --file my_arm.json --out calibrated.json
  python -m body_schema export tf my-calibration --camera-frame camera_optical_frame --out places.launch.yaml
  python -m body_schema export easy-handeye2 my-calibration --type eye_in_hand --camera-frame camera_optical_frame --out mine.calib

my-calibration is the folder that `body-schema calibrate` wrote; ur, xarm, mjcf, xacro and pal take a calibrated URDF as well. Of a
file that is changed all other bytes stay. The file goes to --out; `--out FILE` with the name of --file and --force changes it in place.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from .._errors import FieldError
from . import write_all

TAKES = {
    "ur": {"file", "prefix"},
    "xarm": {"file", "prefix"},
    "mjcf": {"file", "body", "original", "base"},
    "xacro": {"file"},
    "pal": {"file", "original"},
    "lerobot": {"file"},
    "tf": {"world_frame", "camera_frame", "frame"},
    "easy-handeye2": {"type", "camera_frame", "target", "effector_frame", "marker_frame", "name"},
}
"""By kind the options that it has, beside --out, --force and --dry-run."""

NEEDS = {
    "ur": ["file"],
    "xarm": [],
    "mjcf": ["file"],
    "xacro": ["file"],
    "pal": ["file", "original"],
    "lerobot": ["file"],
    "tf": [],
    "easy-handeye2": ["type", "camera_frame"],
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``export``."""
    parser.add_argument("kind", choices=TAKES, help="which driver's file")
    parser.add_argument("calibration", type=Path, metavar="FOLDER", help="what `body-schema calibrate` wrote, or a calibrated URDF")
    parser.add_argument("--out", type=Path, metavar="FILE", help="the file; tf writes tf2_msgs/TFMessage to .json, else a launch file")
    own = "your own file, with the values of before (ur, xarm, mjcf, xacro, pal, lerobot)"
    parser.add_argument("--file", type=Path, metavar="FILE", help=own)
    parser.add_argument("--original", type=Path, metavar="URDF", help="the URDF that was calibrated (pal; mjcf whose frames are others)")
    parser.add_argument("--prefix", help="what stands before joints, as left_ (ur, xarm; default: as the URDF has it)")
    parser.add_argument("--body", action="append", metavar="LINK=BODY", help="the body of a link whose name is another (mjcf)")
    parser.add_argument("--base", metavar="LINK", help="the link that stands in the world where no body is one (mjcf; default: the root)")
    parser.add_argument("--world-frame", metavar="NAME", help="the frame of the measurements, which carries the base link (tf)")
    parser.add_argument(
        "--camera-frame",
        metavar="NAME",
        help="a camera's optical frame: z ahead, x right, y down (easy-handeye2; tf: of a camera in whose frame the measurements are)",
    )
    parser.add_argument("--frame", action="append", metavar="TARGET=NAME", help="the frame of a target (tf; default: its name)")
    parser.add_argument("--type", choices=["eye_in_hand", "eye_on_base"], help="where the camera is (easy-handeye2)")
    parser.add_argument("--target", metavar="NAME", help="the camera on the hand, or what the hand carries (easy-handeye2)")
    parser.add_argument("--effector-frame", metavar="LINK", help="the hand's link (easy-handeye2; default: that of the target or camera)")
    parser.add_argument("--marker-frame", metavar="NAME", help="the frame of what is seen (easy-handeye2; default: tracking_marker_frame)")
    parser.add_argument("--name", help="the calibration's name (easy-handeye2; default: that of --out)")
    parser.add_argument("--dry-run", action="store_true", help="write nothing, show the file")
    parser.add_argument("--force", action="store_true", help="write over a file that is there")


def _refuse(option: str, what: str, mend: str) -> FieldError:
    return FieldError(f"`{option}`: {what}; {mend}", option, what, mend)


def _pairs(given: list[str] | None, option: str) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for it in given or []:
        key, _, value = it.partition("=")
        if not key or not value or key in pairs:
            raise _refuse(option, f"{it!r} is no pair, or the second of its name", "write NAME=NAME")
        pairs[key] = value
    return pairs


def run(args: argparse.Namespace) -> int:
    """Write a driver's file; 1 where something is left to be set by hand."""
    from .. import exports
    from ..exports._calibrated import read_text

    for key in sorted(set().union(*TAKES.values()) - TAKES[args.kind]):
        if getattr(args, key) is not None:
            raise _refuse("--" + key.replace("_", "-"), f"{args.kind} has none", "leave it out")
    for key in NEEDS[args.kind]:
        if getattr(args, key) is None:
            raise _refuse("--" + key.replace("_", "-"), f"{args.kind} needs it", "write it; --help says what it is")
    if args.out is None and not args.dry_run:
        raise _refuse("--out", "it is missing", "name a file, or say --dry-run")
    calibrated = exports.read_calibrated(args.calibration)
    before = exports.parse_urdf(read_text(args.original), str(args.original)) if args.original is not None else None
    text = read_text(args.file) if args.file is not None else None
    by_hand: list[str] = []
    said: list[str] = []
    verdict = (calibrated.report or {}).get("verdict")
    if args.kind == "tf":
        found, left = exports.transforms(
            calibrated, world=args.world_frame, camera=args.camera_frame, frames=_pairs(args.frame, "--frame")
        )
        said += [f"left out: {it}" for it in left]
        is_json = args.out is not None and args.out.suffix.lower() == ".json"
        written = exports.tf_json(found) if is_json else exports.tf_launch(found)
    elif args.kind == "easy-handeye2":
        written = exports.easy_handeye2(
            calibrated,
            args.type,
            args.camera_frame,
            name=args.name or (args.out.stem if args.out is not None else "calibration"),
            target=args.target,
            effector=args.effector_frame,
            marker=args.marker_frame or "tracking_marker_frame",
        )
    elif args.kind == "lerobot":
        assert text is not None
        written, by_hand, said = exports.lerobot(calibrated, text, source=str(args.file))
    else:
        tree, source = calibrated.tree(), str(args.file)
        if args.kind == "xarm":
            written, said = exports.xarm_kinematics(tree, text, prefix=args.prefix, source=source)
        else:
            assert text is not None
            if args.kind == "ur":
                written, said = exports.ur_kinematics(tree, text, prefix=args.prefix, source=source)
            elif args.kind == "mjcf":
                bodies = _pairs(args.body, "--body")
                written, said = exports.mjcf(tree, text, bodies=bodies, before=before, base=args.base, source=source)
            elif args.kind == "pal":
                assert before is not None
                written, said = exports.pal(before, tree, text, source=source, joints=calibrated.learned(tree))
            else:
                written, by_hand, said = exports.xacro(tree, text, joints=calibrated.learned(tree), source=source)
    if isinstance(verdict, dict) and verdict.get("use") == "no":
        said.append(f"the report says, do not use it: {verdict.get('because')}")
    if args.dry_run:
        print(written, end="")
        said = [f"# {it}" for it in said]
        by_hand = [f"# {it}" for it in by_hand]
    for it in said:
        print(it)
    for it in by_hand:
        print(f"by hand: {it}" if not args.dry_run else it.replace("# ", "# by hand: ", 1))
    if args.dry_run:
        print(f"# would write {args.out or 'it'}")
    else:
        write_all({args.out: written}, args.force)
        print(f"wrote {args.out}")
    return 1 if by_hand else 0
