"""Calibrate a camera from pictures of a printed ChArUco board: files, a folder of them, or a video.

  python -m body_schema print-target charuco board.pdf
  python -m body_schema intrinsics pictures/ --target board.toml --out camera.yaml
  python -m body_schema intrinsics board.mp4 --every 15 --target board.toml --out camera.yaml

Move the board, or the camera, so that corners come near all borders of the picture, and tilt it by 20 to 50 degrees to all sides; twenty
pictures do. The file is a camera_info of ROS. A camera that is calibrated already needs none of this.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from . import write_all


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``intrinsics``."""
    parser.add_argument("images", nargs="+", metavar="IMAGE", help="pictures, folders of them, or videos")
    parser.add_argument("--target", required=True, type=Path, metavar="FILE", help="the board's description, as print-target writes it")
    parser.add_argument("--out", type=Path, default=Path("camera.yaml"), metavar="FILE", help="(default: camera.yaml)")
    parser.add_argument("--name", default="webcam", help="the camera's name in tables (default: webcam)")
    parser.add_argument("--model", choices=["plumb_bob", "rational_polynomial"], default="plumb_bob", help="(default: plumb_bob)")
    parser.add_argument("--k3", action="store_true", help="fit k3 too: for lenses of wide angle")
    parser.add_argument("--every", type=int, default=10, metavar="N", help="of a video every N-th frame (default: 10)")
    parser.add_argument("--force", action="store_true", help="write over a file that is there")
    parser.add_argument("--dry-run", action="store_true", help="do everything but write")


def run(args: argparse.Namespace) -> int:
    """Calibrate a camera."""
    from ..vision import Target, find_intrinsics, pictures_of

    board = Target.read(args.target)
    found = find_intrinsics(pictures_of(args.images, args.every), board, model=args.model, name=args.name, third_radial=args.k3)
    for picture, why in found.rejected.items():
        print(f"{picture}: left out: {why}")
    print(found.words)
    if args.dry_run:
        print("nothing is written (--dry-run)")
        return 0
    write_all({args.out: found.camera.to_yaml(comment=found.words)}, args.force)
    print(f"wrote {args.out}")
    return 0
