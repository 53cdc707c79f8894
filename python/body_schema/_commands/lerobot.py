"""True joint zeros of an SO-100 or SO-101 of LeRobot, from a webcam and a printed tag on its gripper.

  python -m body_schema lerobot --robot simulated --out try-it
  python -m body_schema lerobot --robot so101 --port /dev/ttyACM0 --id NAME --camera 0 --tag 40mm --out my-arm
  python -m body_schema lerobot --robot recorded --recording FOLDER --out again

It reads the arm's calibration file, asks for a posture, goes there, looks at the tag, and after twenty such movements tells by how much
every joint's zero is off, with standard deviations, how much play the joints have, and what links are as long as. With --out it writes the
calibration file with other homing offsets, a URDF, an MJCF and a report; without it nothing. Print the tag and measure it
(print-target tag), and fix it and the camera: docs/so-101.md says how. A camera that is calibrated (intrinsics, --intrinsics FILE) tells
more; without that its focal length, centre and lens are learned from the same movements.

`--robot simulated` is an SO-101 in MuJoCo (pip install mujoco) whose zeros, play and places are drawn by --seed: it is told at the end
how far off the result is. Its truth is written as `truth` into report.json and into the recording.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._errors import Error, wrong
from .._session import shapes_of_urdf
from . import write_all

if TYPE_CHECKING:
    from ..lerobot import Found, Run, Setup, Truth
    from ..vision import Target

FOLDERS = ("so_follower", "so101_follower", "so100_follower")
"""Where LeRobot has the calibration files of followers, by its versions."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``lerobot``."""
    three = ("X", "Y", "Z")
    parser.add_argument("--robot", required=True, choices=["so101", "so100", "simulated", "recorded"], help="which arm; so100 needs --urdf")
    parser.add_argument("--port", help="the arm's serial port (so101, so100), as lerobot-find-port tells it")
    parser.add_argument("--id", help="the arm's id, by which LeRobot keeps its calibration file")
    parser.add_argument("--calibration", type=Path, metavar="FILE", help="that file, where it is elsewhere")
    parser.add_argument("--camera", metavar="NUMBER", help="the webcam: its number as OpenCV counts, or its device")
    lens = parser.add_mutually_exclusive_group()
    lens.add_argument("--intrinsics", type=Path, metavar="FILE", help="camera_info of ROS, as `intrinsics` writes it (default: learned)")
    lens.add_argument("--fov-deg", type=float, metavar="DEG", help="they are learned; its horizontal field of view, about (default: 65)")
    tag = "edge of its black square, or what print-target wrote (default: 40mm)"
    parser.add_argument("--tag", default="40mm", metavar="SIZE|FILE", help=tag)
    parser.add_argument("--tag-id", type=int, metavar="N", help="which tag of the family (default: 0, as print-target)")
    parser.add_argument("--tag-family", metavar="NAME", help="(default: tag36h11)")
    parser.add_argument("--urdf", type=Path, metavar="FILE", help="the arm's description (default: that of an SO-101)")
    parser.add_argument("--base", metavar="LINK", help="its first link (default: base)")
    parser.add_argument("--tip", metavar="LINK", help="the link that carries the tag (default: gripper)")
    parser.add_argument("--mjcf", type=Path, metavar="FILE", help="your MJCF, to be calibrated (default: one is made of the URDF)")
    places = (
        ("--camera-at", three, "about where the camera stands, m, x ahead, y left, z up (default: 0.42 -0.32 0.45)"),
        ("--looks-at", three, "about the middle of its picture, m (default: 0.22 0 0.2)"),
        ("--camera-within", ("MM", "DEG"), "how well that is known (default: 100 15); 0 0: exactly"),
        ("--tag-at", three, "about where the tag's middle is on the tip, m (default: 0.03 0 -0.05)"),
        ("--tag-rpy-deg", ("R", "P", "Y"), "how it is turned there (default: -90 0 -90, its upper edge ahead)"),
        ("--tag-within", ("MM", "DEG"), "how well that is known (default: 30 15); 0 0: exactly"),
    )
    for option, names, about in places:
        parser.add_argument(option, nargs=len(names), type=float, metavar=names, help=about)
    parser.add_argument("--movements", type=int, metavar="N", help="(default: 20)")
    parser.add_argument("--minimum-height-mm", type=float, metavar="MM", help="no joint and no tag below (default: 50)")
    parser.add_argument("--speed-deg-s", type=float, default=20.0, metavar="DEG/S", help="of a real arm's joints (default: 20)")
    parser.add_argument("--seed", type=int, metavar="N", help="of the choices, and of the simulated arm (default: 0)")
    parser.add_argument("--yes", action="store_true", help="do not ask before a real arm moves")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="keep readings and pictures there")
    parser.add_argument("--recording", type=Path, metavar="FOLDER", help="what --record kept (recorded)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="gets the calibration file, calibrated.urdf, calibrated.xml, report.json")
    dry = "move and write nothing: say what would be done (a camera without --intrinsics is opened, for its size)"
    parser.add_argument("--dry-run", action="store_true", help=dry)
    parser.add_argument("--force", action="store_true", help="write over files that are there")


def _target(args: argparse.Namespace) -> Target:
    from ..vision import Target

    if args.tag.lower().endswith(".toml") or Path(args.tag).is_file():
        if args.tag_id is not None or args.tag_family is not None:
            raise wrong("--tag-id", "the tag's file says it", "leave --tag-id and --tag-family out")
        return Target.read(Path(args.tag))
    units = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
    for unit, metres in units.items():
        number = args.tag.lower().removesuffix(unit)
        if number == args.tag.lower():
            continue
        try:
            size = float(number) * metres
        except ValueError:
            break
        if 0.005 <= size <= 0.5:
            return Target.tag(args.tag_id or 0, size, family=args.tag_family or "tag36h11")
        break
    raise wrong("--tag", f"{args.tag!r} is no size of a tag", "write its edge as 40mm, or name the .toml that print-target wrote")


def _calibration_path(args: argparse.Namespace) -> Path:
    """LeRobot's file of the arm."""
    if args.calibration is not None:
        return Path(args.calibration)
    if args.id is None:
        raise wrong("--id", "it is missing", "write the arm's id, or name its calibration file with --calibration")
    home = Path(os.environ.get("HF_HOME", Path.home() / ".cache" / "huggingface"))
    root = Path(os.environ.get("HF_LEROBOT_HOME", home / "lerobot"))
    root = Path(os.environ.get("HF_LEROBOT_CALIBRATION", root / "calibration"))
    places = [root / "robots" / folder / f"{args.id}.json" for folder in FOLDERS]
    for place in places:
        if place.exists():
            return place
    raise wrong("--id", f"there is no {places[0]}", "run lerobot-calibrate, or name the file with --calibration")


def _own(args: argparse.Namespace) -> dict[str, Any]:
    """What the setup is told, as far as it was said."""
    own: dict[str, Any] = {}
    for key in ("camera_at", "looks_at", "tag_at", "tag_rpy_deg"):
        if getattr(args, key) is not None:
            own[key] = tuple(getattr(args, key))
    for key in ("camera_within", "tag_within"):
        if getattr(args, key) is not None:
            own[key] = (getattr(args, key)[0] / 1e3, getattr(args, key)[1])
    for key in ("movements", "seed"):
        if getattr(args, key) is not None:
            own[key] = getattr(args, key)
    if args.minimum_height_mm is not None:
        own["minimum_height"] = args.minimum_height_mm / 1e3
    return own


FROM_RECORDING = (
    "port id calibration camera intrinsics fov_deg tag_id tag_family urdf base tip camera_at looks_at camera_within tag_at tag_rpy_deg tag_within"
    " movements minimum_height_mm seed record"
).split()
"""What a recording says itself."""


def _refuse(args: argparse.Namespace, keys: list[str], why: str) -> None:
    for key in keys:
        if getattr(args, key) is not None:
            raise wrong("--" + key.replace("_", "-"), why, "leave it out")


def _setup(args: argparse.Namespace) -> tuple[Setup, Truth | None, Any]:
    """What is known before, the truth where there is one, and the recorded arm."""
    from .. import lerobot
    from ..vision import Camera

    if args.robot == "recorded":
        if args.recording is None:
            raise wrong("--recording", "it is missing", "name the folder that --record wrote")
        _refuse(args, FROM_RECORDING, "a recording says that itself")
        arm = lerobot.RecordedArm(args.recording)
        return arm.setup, lerobot.Truth.of_dict(arm.truth) if arm.truth else None, arm
    _refuse(args, ["recording"], "only --robot recorded has one")
    if args.robot == "simulated":
        _refuse(args, ["port", "id", "calibration", "camera", "intrinsics", "urdf", "base", "tip", "mjcf"], "the simulated arm has its own")
        calibration, camera = lerobot.simulated_calibration(), lerobot.webcam()
        if args.fov_deg is not None:
            camera = Camera.guess(camera.size_px, fov_deg=args.fov_deg, name=camera.name)
        urdf, base, tip, shapes = lerobot.so101_urdf(), "base", "gripper", None
    else:
        for key, mend in (("port", "write the arm's serial port"), ("camera", "write the webcam's number")):
            if getattr(args, key) is None:
                raise wrong(f"--{key}", "it is missing", mend)
        if args.robot == "so100" and args.urdf is None:
            mend = "name its description, with zeros in the middle of the ranges"
            raise wrong("--urdf", "an SO-100 has other lengths than an SO-101", mend)
        from ..exports._calibrated import read_text

        calibration = lerobot.read_calibration(_calibration_path(args))
        if args.intrinsics is not None:
            camera = Camera.read(args.intrinsics)
        else:
            camera = Camera.guess(lerobot.picture_size(args.camera), fov_deg=args.fov_deg, name="webcam")
        urdf = lerobot.so101_urdf() if args.urdf is None else read_text(args.urdf)
        base, tip, shapes = args.base or "base", args.tip or "gripper", args.urdf and shapes_of_urdf(args.urdf)
    setup = lerobot.Setup(urdf, base, tip, calibration, camera, _target(args), shapes=shapes, **_own(args))
    return setup, lerobot.truth_of(setup) if args.robot == "simulated" else None, None


def _names(args: argparse.Namespace, setup: Setup) -> dict[str, Path]:
    """The files that are written."""
    if args.out is None:
        return {}
    source = Path(setup.calibration.source)
    named = {"calibration": source.name if source.suffix == ".json" else "calibration.json", "urdf": "calibrated.urdf"}
    named |= {"mjcf": "calibrated.xml", "session": "session.json", "report": "report.json"}
    if setup.camera.is_guess:
        named["camera"] = "camera.yaml"
    return {key: args.out / name for key, name in named.items()}


def run(args: argparse.Namespace) -> int:
    """Measure an arm; 1 where something is left to be set by hand, or where an error ended it early."""
    from .. import lerobot

    setup, truth, arm = _setup(args)
    if not 1 <= args.speed_deg_s <= 90:
        raise wrong("--speed-deg-s", f"{args.speed_deg_s:g} is out of range", "write 1 to 90")
    names = _names(args, setup)
    mjcf = None
    if args.mjcf is not None:
        from ..exports._calibrated import read_text

        mjcf = read_text(args.mjcf)
    # What would be refused at the end is refused before anything moves.
    if not args.force:
        for path in names.values():
            if path.exists():
                raise wrong("--out", f"{path} is there", "name another folder, or say --force")
    limits = setup.limits_deg()
    print(f"arm: {args.robot}, calibration {setup.calibration.source}")
    print("movements stay within " + ", ".join(f"{name} {low:+.0f} to {high:+.0f}" for name, (low, high) in limits.items()) + " deg")
    print(f"and {setup.minimum_height * 1e3:.0f} mm above the table, joints and tag, as far as zeros that may be off by some degrees tell")
    at, looks = (" ".join(f"{it:g}" for it in its) for its in (setup.camera_at, setup.looks_at))
    metres, degrees = setup.camera_within
    print(f"the camera is taken to stand at {at} m and to look at {looks} m, to {metres * 1e3:g} mm and {degrees:g} deg")
    if setup.camera.is_guess:
        fov = math.degrees(2 * math.atan(setup.camera.size_px[0] / 2 / setup.camera.focal_px[0]))
        print(f"its intrinsics are learned: its field of view is taken for {fov:.0f} degrees, and a lens is looked for (see --intrinsics)")
    if args.dry_run:
        first = setup.session().suggest()["suggestions"][0]["configuration"]
        print("first posture: " + ", ".join(f"{name} {math.degrees(it):+.1f}" for name, it in first.items()) + " deg")
        print(f"# would make {setup.movements} movements, and write {', '.join(map(str, names.values())) or 'nothing (no --out)'}")
        return 0
    quick: dict[str, Any] = {"still_s": 0.002, "rate_hz": 2000.0}
    if args.robot == "simulated":
        assert truth is not None
        arm = lerobot.SimulatedArm(truth, lerobot.webcam(), setup.target, setup.seed)
    elif args.robot != "recorded":
        quick = {}
        if not args.yes:
            _ask(args.speed_deg_s)
        arm = lerobot.RealArm(setup, _calibration_path(args), args.port, args.camera, speed_deg_s=args.speed_deg_s)
    try:
        recorder = None
        if args.record is not None:
            recorder = lerobot.Recorder(args.record, setup, truth.to_dict() if truth else None)
        measured = lerobot.measure(setup, arm, recorder=recorder, **quick)
    finally:
        arm.close()
    try:
        found = lerobot.conclude(setup, measured)
    except (KeyboardInterrupt, Error):
        # Movements are dearer than a fit.
        if (kept := names.get("session")) is not None and len(measured.stops) >= lerobot.FEWEST:
            write_all({kept: measured.session.save()}, args.force)
            print(f"\nwhat was measured is kept in {kept}: body_schema.Session.load goes on from there", file=sys.stderr)
        raise
    return _tell(args, setup, measured, found, truth, names, mjcf)


def _ask(speed: float) -> None:
    print(
        f"the arm is going to move, at {speed:g} deg/s at most. Clear the table around it, keep the cables free, and a hand at the switch."
    )
    if not sys.stdin.isatty():
        raise wrong("--yes", "nobody can be asked here", "say --yes where the arm may move")
    if input("move it? [y/N] ").strip().lower() not in ("y", "yes"):
        raise Error("nothing was moved; answer y, or say --yes")


def _tell(
    args: argparse.Namespace, setup: Setup, measured: Run, found: Found, truth: Truth | None, names: dict[str, Path], mjcf: str | None
) -> int:
    """The result in words and in files."""
    from .. import lerobot
    from ..exports._lerobot import by_hand
    from ..lerobot._found import against

    calibration, moved, beyond = setup.calibration.shifted({name: it.value for name, it in found.zeros_deg.items()})
    print(f"\nof {len(measured.stops)} movements the tag was seen in {found.seen}")
    print("zeros: a joint that reads 0 is truly at")
    for name in lerobot.MOTORS:
        if name in found.zeros_deg:
            its = found.zeros_deg[name]
            print(
                f"  {name:<14}{its.value:+7.2f} ± {its.sd:.2f} deg" + (f"   homing offset {moved[name]:+d} steps" if name in moved else "")
            )
        else:
            by, option = ("the camera stands", "--camera-within") if name == lerobot.MOTORS[0] else ("the tag is turned", "--tag-within")
            print(f"  {name:<14} a convention, while nobody knows to half a degree how {by} ({option}); left as it is")
    if found.half_play_deg:
        print(f"play: half of what a joint differs by between both sides ({found.pairs} postures were approached from both)")
        for name, its in found.half_play_deg.items():
            print(f"  {name:<14}{its.value:7.2f} ± {its.sd:.2f} deg")
        print(f"  it moves the tag by {found.play_mm:.1f} mm (rms): no calibration comes below that, unless every posture is approached")
        print("  from the same side")
    else:
        print("play: not told, since less than two postures were seen from both sides")
    changed = {name: it for name, it in found.links.items() if max(map(abs, [*it["shift_mm"], *it["turn_deg"]])) > 0.05}
    print("links: as described, as far as these movements tell" if not changed else "links: origins of joints are elsewhere by")
    for name, link in changed.items():
        shift, turn = (" ".join(f"{it:+.2f}" for it in link[key]) for key in ("shift_mm", "turn_deg"))
        print(f"  {name:<14}{shift} mm, turned by {turn} deg")
    if found.expected_mm is not None:
        print(f"the tag is expected to be predicted to {found.expected_mm:.2f} mm, but for the play")
    if found.camera is not None:
        print(f"camera: {_camera_words(found)}")
    told: dict[str, Any] = {
        "movements": len(measured.stops),
        "seen": found.seen,
        "ended": measured.why,
        "zeros_deg": {name: it.to_dict() for name, it in found.zeros_deg.items()},
        "half_play_deg": {name: it.to_dict() for name, it in found.half_play_deg.items()},
        "play_mm": found.play_mm,
        "links": found.links,
        "expected_mm": found.expected_mm,
        "homing_steps": moved,
        "by_hand": {name: {"range_min": it.range_min, "range_max": it.range_max} for name, it in beyond.items()},
        "doubts": found.doubts,
    }
    if found.camera is not None:
        told["camera"] = {key: getattr(found.camera, key) for key in ("size_px", "focal_px", "centre_px", "model", "distortion")}
        told["camera"]["sd"] = found.camera_sd
    if truth is not None:
        off = against(setup, found, truth)
        told["truth"], told["against_truth"] = truth.to_dict(), off
        zeros = ", ".join(f"{name} {it:+.2f}" for name, it in off["zeros_deg"].items())
        print(
            f"truth of the simulated arm: zeros are wrong by {zeros} deg; the tag is predicted to {off['tag_mm']:.2f} mm, up to one motion"
        )
    for doubt in found.doubts:
        print(f"doubt: {doubt}")
    for name, shorter in beyond.items():
        print(f"by hand: {by_hand(name, shorter)}")
    if names:
        _write(args, setup, found, calibration.to_json(), told, names, mjcf)
    else:
        print("nothing was written: say --out DIR")
    return 1 if beyond or measured.why == "broken" else 0


def _camera_words(found: Found) -> str:
    """What was learned of the camera's intrinsics."""
    from ..vision import LENSES

    camera, sd = found.camera, found.camera_sd
    assert camera is not None
    pixels = zip(("fx", "fy", "cx", "cy"), (*camera.focal_px, *camera.centre_px))
    values = [(name, it, 1) for name, it in pixels] + [(name, it, 3) for name, it in zip(LENSES[camera.model], camera.distortion)]
    # What is rounded to 0 has no sign.
    return ", ".join(f"{name} {round(it, digits) + 0.0:.{digits}f} ± {sd[name]:.2g}" for name, it, digits in values if name in sd)


def _write(
    args: argparse.Namespace, setup: Setup, found: Found, calibration: str, told: dict[str, Any], names: dict[str, Path], mjcf: str | None
) -> None:
    """The files of ``--out``, and what is to be done with them. ``told`` is the report, ``mjcf`` the user's own model."""
    from .. import lerobot
    from ..exports import mjcf as calibrated_mjcf
    from ..exports import parse_urdf

    urdf = found.session.to_urdf()
    if mjcf is None:
        degrees = setup.limits_deg()
        ranges = {name: (math.radians(low), math.radians(high)) for name, (low, high) in degrees.items()}
        body = lerobot.mjcf_of(parse_urdf(urdf), ranges)
    else:
        body, said = calibrated_mjcf(parse_urdf(urdf), mjcf, before=setup.tree(), source=str(args.mjcf))
        for it in said:
            print(it)
    files: dict[Path, str | bytes] = {
        names["calibration"]: calibration,
        names["urdf"]: urdf,
        names["mjcf"]: body,
        names["session"]: found.session.save(),
        names["report"]: json.dumps(told, indent=2) + "\n",
    }
    if found.camera is not None:
        files[names["camera"]] = found.camera.to_yaml(comment=f"learned with the arm: {_camera_words(found)}")
    write_all(files, args.force)
    for path in files:
        print(f"wrote {path}")
    print(
        f"next: either copy {names['calibration'].name} over LeRobot's file (keep the old one), and press Enter where LeRobot asks to "
        "write it to the motors; or use calibrated.urdf and calibrated.xml with the old file. Not both: the zeros would be corrected twice."
    )
    print(
        "with the new file: the leader has to be shifted by the same steps, or homed again; ranges move along, so look at the ends of "
        "the joints once; what was recorded before, and policies that learned from it, do not fit any more."
    )
