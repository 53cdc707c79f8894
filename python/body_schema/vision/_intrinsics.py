"""Intrinsics of a camera from pictures of a board."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._errors import wrong
from ._camera import LENSES, Camera
from ._detect import detect, grey
from ._targets import Target

Floats = NDArray[np.float64]

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm")
VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v")


def pictures_of(paths: Iterable[str | PathLike[str]], every: int = 1) -> Iterator[tuple[str, Any]]:
    """Pictures of files, of folders and of video files, as (name, bytes as OpenCV reads them), in the order of their names.

    Of a folder its pictures count, by name with numbers as numbers; of a video every ``every``-th frame, called ``FILE:FRAME``. A
    file that cannot be read is refused.
    """
    for given in paths:
        path = Path(given)
        if path.is_dir():
            files = sorted((it for it in path.iterdir() if it.suffix.lower() in PICTURES), key=_natural)
            if not files:
                raise wrong("images", f"{path} has no pictures", f"name files that end with {', '.join(PICTURES)}")
        else:
            files = [path]
        for file in files:
            if file.suffix.lower() in VIDEOS:
                yield from _frames(file, every)
                continue
            if not file.exists():
                raise wrong("images", f"{file} is not there", "name pictures, folders of them, or a video")
            # OpenCV turns pictures of telephones upright, which exchanges width and height: as the sensor had them they stay.
            image = cv2.imread(str(file), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
            if image is None:
                raise wrong("images", f"{file} cannot be read as a picture", "name a PNG, a JPEG or the like")
            yield file.name, image


def size_of(paths: Iterable[str | PathLike[str]]) -> tuple[int, int]:
    """Width and height of the first picture that ``pictures_of`` gives."""
    for _, image in pictures_of(paths):
        return (image.shape[1], image.shape[0])
    raise wrong("images", "there is no picture", "name pictures, folders of them, or a video")


def _natural(path: Path) -> list[tuple[int, int, str]]:
    parts = re.split(r"(\d+)", path.name)
    return [(1, int(it), "") if it.isdigit() else (0, 0, it) for it in parts]


def _frames(file: Path, every: int) -> Iterator[tuple[str, Any]]:
    video = cv2.VideoCapture(str(file))
    if not file.exists() or not video.isOpened():
        raise wrong("images", f"{file} cannot be read as a video", "name an MP4, an AVI or the like, or a folder of pictures")
    try:
        number = 0
        while True:
            good, frame = video.read()
            if not good:
                break
            if number % max(every, 1) == 0:
                yield f"{file.name}:{number}", frame
            number += 1
    finally:
        video.release()


@dataclass(frozen=True)
class Intrinsics:
    """A camera that was calibrated, and how well.

    ``rms_px`` is the root mean square of the reprojection error per point; ``deviations`` are standard deviations of fx, fy, cx, cy (px)
    and of the coefficients by name; ``coverage`` is the share of the picture's 8 × 6 fields in which corners were seen; ``tilt_deg``
    the largest angle between the board's normal and the optical axis; ``views`` gives the rms by picture; ``rejected`` says by
    picture why it does not count; ``doubts`` are sentences.
    """

    camera: Camera
    rms_px: float
    deviations: dict[str, float]
    coverage: float
    tilt_deg: float
    views: dict[str, float]
    rejected: dict[str, str]
    doubts: tuple[str, ...]

    @property
    def words(self) -> str:
        """All of it as lines of text."""
        camera = self.camera
        numbers = dict(zip(("fx", "fy", "cx", "cy"), (*camera.focal_px, *camera.centre_px)))
        numbers |= dict(zip(LENSES[camera.model], camera.distortion))
        lines = [f"{len(self.views)} pictures count, {len(self.rejected)} do not; rms {self.rms_px:.3f} px"]
        lines += [f"{name} = {value:.6g} ± {self.deviations.get(name, 0.0):.2g}" for name, value in numbers.items()]
        lines.append(
            f"corners cover {self.coverage * 100:.0f} % of the picture's fields; the board was tilted by up to {self.tilt_deg:.0f} deg"
        )
        lines += [f"doubt: {it}" for it in self.doubts]
        return "\n".join(lines)


def find_intrinsics(
    images: Iterable[tuple[str, Any]],
    board: Target,
    *,
    model: str = "plumb_bob",
    name: str = "camera",
    third_radial: bool = False,
    most: int = 60,
) -> Intrinsics:
    """A camera from pictures of a ChArUco board, given as (name, picture); OpenCV's ``calibrateCamera`` is behind it.

    ``model`` is ``plumb_bob`` (k1, k2, p1, p2, and k3 with ``third_radial``: it is ill determined in ordinary lenses), or
    ``rational_polynomial``. Of more than ``most`` views those are kept that are spread evenly. Raises ``FieldError`` where fewer than
    six pictures show ten corners or more, where pictures have different sizes, or where the views do not determine the camera.
    """
    if board.kind != "charuco":
        raise wrong("board", f"a {board.kind} is no board", "print one: python -m body_schema print-target charuco")
    if model not in ("plumb_bob", "rational_polynomial"):
        raise wrong("model", f"{model!r} cannot be calibrated here", "write plumb_bob or rational_polynomial")
    seen: list[tuple[str, Floats, Floats]] = []
    rejected: dict[str, str] = {}
    size: tuple[int, int] | None = None
    for label, image in images:
        picture = grey(image)
        its = (picture.shape[1], picture.shape[0])
        if size is not None and its != size:
            raise wrong(
                "images",
                f"{label} has {its[0]} x {its[1]} pixels, those before {size[0]} x {size[1]}",
                "give pictures of one camera in one mode",
            )
        size = its
        detection = detect(picture, board)
        if len(detection.names) < 10:
            why = "; ".join(it.words for it in detection.rejections if it.part == board.name)
            rejected[label] = why or f"{len(detection.names)} corners of the board are seen, 10 are needed"
            continue
        points = detection.points_m
        if np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0))[1][1] < 0.5 * board.square_m:
            rejected[label] = "the corners that are seen are on a line"
            continue
        seen.append((label, points, detection.pixels))
    if len(seen) > most:
        kept = np.unique(np.linspace(0, len(seen) - 1, most).round().astype(int))
        seen = [seen[index] for index in kept]
    if len(seen) < 6 or size is None:
        why = "; ".join(f"{label}: {text}" for label, text in list(rejected.items())[:3])
        raise wrong(
            "images",
            f"{len(seen)} pictures show the board, six are needed" + (f" ({why})" if why else ""),
            "take twenty, tilted to all sides, near the borders too",
        )
    flags = 0
    if model == "rational_polynomial":
        flags |= cv2.CALIB_RATIONAL_MODEL
    elif not third_radial:
        flags |= cv2.CALIB_FIX_K3
    objects = [np.ascontiguousarray(points, np.float32).reshape(-1, 1, 3) for _, points, _ in seen]
    pixels = [np.ascontiguousarray(it, np.float32).reshape(-1, 1, 2) for _, _, it in seen]
    start, nothing = np.eye(3), np.zeros(14 if flags & cv2.CALIB_RATIONAL_MODEL else 5)
    try:
        rms, matrix, lens, turns, _, spread, _, per_view = cv2.calibrateCameraExtended(objects, pixels, size, start, nothing, flags=flags)
    except cv2.error as error:
        raise wrong("images", f"they do not determine a camera ({error.err})", "tilt the board to all sides, by 20 to 50 degrees") from None
    names = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]
    sds = dict(zip(names, (float(it) for it in np.asarray(spread).ravel())))
    kept_lens = [float(it) for it in np.asarray(lens).ravel()[: len(LENSES[model])]]
    camera = Camera.of(matrix, kept_lens, size_px=size, model=model, name=name)
    every = np.concatenate([it.reshape(-1, 2) for it in pixels])
    fields = {(int(u * 8 / size[0]), int(v * 6 / size[1])) for u, v in every}
    coverage = len(fields) / 48
    tilts = [float(np.degrees(np.arccos(min(1.0, abs(float(cv2.Rodrigues(np.asarray(turn))[0][2, 2])))))) for turn in turns]
    views = {label: float(it) for (label, _, _), it in zip(seen, np.asarray(per_view).ravel())}
    doubts = []
    if coverage < 0.6:
        doubts.append(
            f"corners cover {coverage * 100:.0f} % of the picture: the lens is a guess elsewhere; show the board near the borders too"
        )
    if max(tilts) < 20:
        doubts.append(
            f"the board was tilted by {max(tilts):.0f} deg at most: the focal length is hardly determined; tilt it by 20 to 50 degrees"
        )
    if rms > 0.7:
        doubts.append(f"the rms is {rms:.2f} px: the board is not flat, the pictures are blurred, or it is not as described")
    if sds["fx"] > 0.01 * camera.focal_px[0]:
        doubts.append(f"fx is known to {sds['fx'] / camera.focal_px[0] * 100:.1f} % only: take more pictures, tilted to all sides")
    middle = float(np.median(list(views.values())))
    for label, value in views.items():
        if value > max(3 * middle, 0.5):
            doubts.append(f"{label} is off by {value:.2f} px, most by {middle:.2f}: leave it out if it is blurred")
    grid = np.stack(np.meshgrid(np.linspace(0, size[0] - 1, 9), np.linspace(0, size[1] - 1, 7)), -1).reshape(-1, 2)
    if not np.isfinite(camera.undistort(grid)).all():
        doubts.append(
            "the lens's model has no inverse in a part of the picture: points there are not taken; show the board near the borders too"
        )
    return Intrinsics(
        camera,
        float(rms),
        {k: v for k, v in sds.items() if k in (*LENSES[model], "fx", "fy", "cx", "cy")},
        coverage,
        max(tilts),
        views,
        rejected,
        tuple(doubts),
    )
