"""Pictures of a target and a table of joint readings become a table and a calibration file for `body-schema calibrate`.

  python -m body_schema detect pictures/ --target tag.toml --camera camera.yaml --joints joints.csv \\
      --urdf robot.urdf --tip gripper --out measured

joints.csv has a line of titles, a column `image` with file names, and a column for each joint, in rad or m or with the unit at the end
of its title (elbow_deg). Every picture that gives no reading is named, with the reason. With --urdf the places of camera and target
are guessed, and a wrong size of the target is told. Then: body-schema calibrate measured/calibration.toml
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from .._errors import FieldError, wrong
from . import write_all


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``detect``."""
    parser.add_argument("images", nargs="+", metavar="IMAGE", help="pictures, folders of them, or videos (frames are called FILE:NUMBER)")
    parser.add_argument("--target", required=True, type=Path, metavar="FILE", help="what is printed, as print-target writes it")
    lens = parser.add_mutually_exclusive_group(required=True)
    lens.add_argument("--camera", type=Path, metavar="FILE", help="camera_info of ROS, as intrinsics writes it")
    learned = "there is none: focal length, centre and lens are learned with the robot; its horizontal field of view, about"
    lens.add_argument("--fov-deg", type=float, metavar="DEG", help=learned)
    parser.add_argument("--joints", required=True, type=Path, metavar="FILE", help="CSV of joint readings with a column `image`")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="gets observations.csv and calibration.toml")
    parser.add_argument("--camera-name", metavar="NAME", help="the camera's name in tables (default: that of its file, or webcam)")
    parser.add_argument("--rectified", action="store_true", help="pictures are those of image_rect: P counts, and there is no lens")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="of a video every N-th frame (default: 1)")
    parser.add_argument("--urdf", type=Path, metavar="FILE", help="the robot's description")
    parser.add_argument("--base", metavar="LINK", help="the first link of the chain (where the URDF leaves a choice)")
    parser.add_argument("--tip", metavar="LINK", help="the last link of the chain, which carries the target")
    parser.add_argument("--camera-at", nargs=3, type=float, metavar=("X", "Y", "Z"), help="where the camera stands in the base's frame, m")
    parser.add_argument("--looks-at", nargs=3, type=float, metavar=("X", "Y", "Z"), help="a point in the middle of its picture, m")
    parser.add_argument(
        "--camera-rpy-deg",
        nargs=3,
        type=float,
        metavar=("R", "P", "Y"),
        help="its optical frame (z ahead, x right, y down), in place of --looks-at",
    )
    parser.add_argument("--force", action="store_true", help="write over files that are there")
    parser.add_argument("--dry-run", action="store_true", help="do everything but write")


def run(args: argparse.Namespace) -> int:
    """Pictures as a table."""
    from dataclasses import replace

    from ..vision import Camera, Target, detect_table, pictures_of, size_of
    from ..vision._tables import calibration_toml, ends_of, guess_place, place_doubts, read_joints

    if (args.camera_at is None) != (args.looks_at is None and args.camera_rpy_deg is None):
        what, mend = "a camera's place is a point and a direction", "write --camera-at with --looks-at or --camera-rpy-deg"
        raise FieldError(f"`--camera-at`: {what}; {mend}", "--camera-at", what, mend)
    if args.looks_at is not None and args.camera_rpy_deg is not None:
        what, mend = "it is told twice where the camera looks", "write one of --looks-at and --camera-rpy-deg"
        raise FieldError(f"`--looks-at`: {what}; {mend}", "--looks-at", what, mend)
    target = Target.read(args.target)
    if args.camera is not None:
        camera = Camera.read(args.camera, rectified=args.rectified)
    else:
        if args.rectified:
            raise wrong("--rectified", "rectified pictures have a camera that is known", "name its file with --camera")
        camera = Camera.guess(size_of(args.images), fov_deg=args.fov_deg, name="webcam")
    if args.camera_name is not None:
        camera = replace(camera, name=args.camera_name)
    joints = read_joints(args.joints)
    base, tip = args.base, args.tip
    if args.urdf is not None:
        base, tip = ends_of(args.urdf, base, tip)
    table = detect_table(pictures_of(args.images, args.every), target, camera, joints)
    for picture, why in table.words.items():
        print(f"{picture}: left out: {why}")
    for picture, detection in zip(table.seen, table.detections):
        for rejection in detection.rejections:
            print(f"{picture}: {rejection.words}")
    doubts = list(table.doubts)
    place = None
    if args.urdf is not None and table.seen:
        place = guess_place(table, camera, args.urdf, base, tip)
        if place is not None:
            doubts += place_doubts(place, args.camera_rpy_deg, table, camera)
            print(f"camera and target are placed by the URDF; {place.rms_px:.1f} px are left, which calibration explains")
    for doubt in doubts:
        print(f"doubt: {doubt}")
    print(f"{len(table.seen)} pictures give a reading, {len(table.words)} do not")
    if not table.seen:
        what = "no picture gives a reading"
        raise FieldError(f"`images`: {what}; see above for each", "images", what, "see above for each")
    told: dict[str, Any] | None = None
    if args.camera_at is not None:
        told = {"at_m": args.camera_at}
        told |= {"looks_at_m": args.looks_at} if args.looks_at is not None else {"rpy_deg": args.camera_rpy_deg}
        told |= {"known": {"to_m": 0.1, "to_deg": 15.0}}
    urdf = None
    files: dict[Path, str | bytes] = {args.out / "observations.csv": table.csv}
    if args.urdf is not None:
        # A calibration file names a URDF beside it.
        urdf = args.urdf.name
        if not (args.out / urdf).exists() or not os.path.samefile(args.out / urdf, args.urdf):
            files[args.out / urdf] = args.urdf.read_bytes()
    files[args.out / "calibration.toml"] = calibration_toml(
        table, camera, target, file="observations.csv", urdf=urdf, base=base, tip=tip, camera_place=told, place=place
    )
    if args.dry_run:
        print("nothing is written (--dry-run)")
        return 0
    write_all(files, args.force)
    for path in files:
        print(f"wrote {path}")
    if urdf is not None and (told is not None or place is not None):
        print(f"next: body-schema calibrate {args.out / 'calibration.toml'}")
    else:
        print("next: write what the comments in calibration.toml ask for")
    return 0
