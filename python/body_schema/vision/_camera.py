"""Cameras: from pixels of a lens to those of a pinhole, and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import yaml  # type: ignore[import-untyped,unused-ignore]
from numpy.typing import ArrayLike, NDArray

from .._errors import wrong
from ._targets import name_of

Floats = NDArray[np.float64]

LENSES: dict[str, tuple[str, ...]] = {
    "plumb_bob": ("k1", "k2", "p1", "p2", "k3"),
    "rational_polynomial": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "equidistant": ("k1", "k2", "k3", "k4"),
}
"""Models of lenses by ROS's names, and the order of their coefficients."""

USUAL_FOV_DEG = 65.0
"""Horizontal field of view of a usual webcam, degrees."""
GUESSED_LENS = (0.2, 0.2, 0.005, 0.005)
"""How far k1, k2, p1 and p2 of a webcam's lens are from 0, about."""

_SAME = {"brown-conrady": "plumb_bob", "rational": "rational_polynomial", "fisheye": "equidistant", "kannala_brandt": "equidistant"}


@dataclass(frozen=True)
class Camera:
    """A camera's picture size, focal lengths, centre and lens.

    ``size_px`` is width and height; ``focal_px`` is fx, fy; ``centre_px`` is cx, cy. ``distortion`` has the coefficients of ``model`` in
    the order of OpenCV and ROS: k1, k2, p1, p2, k3 (``plumb_bob``), k1, k2, p1, p2, k3, k4, k5, k6 (``rational_polynomial``), k1, k2,
    k3, k4 (``equidistant``); those that are missing at the end are 0. With (x, y) a point of the plane z = 1 in the optical frame,
    its pixel is u = fx x' + cx, v = fy y' + cy, where (x', y') is what the lens makes of (x, y).
    """

    size_px: tuple[int, int]
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, ...] = ()
    model: str = "plumb_bob"
    name: str = "camera"
    remarks: tuple[str, ...] = field(default=(), compare=False)
    """What was not taken from the file that it was read from, in words."""
    known_to_px: float | None = None
    """Of a guess, how well focal lengths and centre are known: they are learned with the robot. None where they are calibrated."""
    distortion_known_to: tuple[float, ...] = ()
    """Of a guess, how well the coefficients are known, in their order; 0 for one that is held."""

    def __post_init__(self) -> None:
        name_of(self.name)
        model = _SAME.get(self.model, self.model)
        if model not in LENSES:
            what = f"{self.model!r} is no model of a lens that is known here"
            raise wrong("model", what, f"write one of {', '.join(LENSES)}, or calibrate with `body_schema intrinsics`")
        object.__setattr__(self, "model", model)
        pairs: list[tuple[str, Sequence[float]]] = [
            ("size_px", self.size_px),
            ("focal_px", self.focal_px),
            ("centre_px", self.centre_px),
        ]
        for key, pair in pairs:
            if len(pair) != 2 or not all(math.isfinite(x) for x in pair) or (key != "centre_px" and not min(pair) > 0):
                raise wrong(key, f"{tuple(pair)} are no two numbers of pixels", "write two numbers")
        width, height = self.size_px
        if not (-width < self.centre_px[0] < 2 * width and -height < self.centre_px[1] < 2 * height):
            raise wrong("centre_px", f"{self.centre_px} is far outside a picture of {width} x {height}", "write cx, cy in pixels")
        if not (0.05 * width < self.focal_px[0] < 100 * width and 0.2 < self.focal_px[0] / self.focal_px[1] < 5):
            raise wrong("focal_px", f"{self.focal_px} are no focal lengths of a picture of {width} x {height}", "write fx, fy in pixels")
        most = len(LENSES[model])
        kept = tuple(float(k) for k in self.distortion)
        if len(kept) > most and any(kept[most:]):
            names = ", ".join(LENSES[model])
            raise wrong("distortion", f"{len(kept)} coefficients are more than the {most} of {model}", f"write {names}")
        if not all(math.isfinite(k) for k in kept):
            raise wrong("distortion", "a coefficient is not finite", "write numbers")
        object.__setattr__(self, "distortion", kept[:most] + (0.0,) * (most - len(kept)))

    @classmethod
    def guess(cls, size_px: tuple[int, int], *, fov_deg: float | None = None, name: str = "camera") -> Camera:
        """A camera that nobody has calibrated, of a horizontal field of view of about ``fov_deg`` (that of a usual webcam, 65).

        Its pixels are square, its centre is the middle of the picture, and it has no lens; all of them are learned with the robot:
        focal lengths and centre to a fifth of the focal length, k1, k2, p1 and p2 to ``GUESSED_LENS``. Pixels are those of the picture.
        """
        if fov_deg is None:
            fov_deg = USUAL_FOV_DEG
        if not (math.isfinite(fov_deg) and 20 <= fov_deg <= 120):
            mend = "write the angle from the left border of the picture to the right one, 20 to 120; webcams have 55 to 80"
            raise wrong("fov_deg", f"{fov_deg:g} is out of range", mend)
        width, height = size_px
        focal = width / 2 / math.tan(math.radians(fov_deg) / 2)
        middle = ((width - 1) / 2, (height - 1) / 2)
        return cls(size_px, (focal, focal), middle, name=name, known_to_px=0.2 * focal, distortion_known_to=GUESSED_LENS)

    @property
    def is_guess(self) -> bool:
        """Whether its intrinsics are learned with the robot."""
        return self.known_to_px is not None

    @classmethod
    def of(cls, K: ArrayLike, D: ArrayLike | None = (), *, size_px: tuple[int, int], model: str = "plumb_bob", name: str = "camera") -> Camera:
        """A camera of a matrix K (3 × 3, or its nine numbers) and coefficients D (``None``: no distortion), as OpenCV gives them."""
        fx, fy, cx, cy = _matrix(K, "K")
        return cls(size_px, (fx, fy), (cx, cy), () if D is None else _row(D, "D"), model, name)

    @classmethod
    def read(cls, path: str | PathLike[str], *, rectified: bool = False) -> Camera:
        """The camera of a ``camera_info`` YAML of ROS, as ``camera_calibration`` writes it or as ``ros2 topic echo`` shows it.

        Pictures are taken to be raw (``image_raw``): K and D count, and P and R are ignored; ``remarks`` says so where they differ.
        With ``rectified`` they are those of ``image_rect``: P's left part counts, and there is no distortion.
        """
        try:
            documents = list(yaml.safe_load_all(Path(path).read_text(encoding="utf-8")))
        except OSError as error:
            raise wrong("camera", f"{path}: {error.strerror}", "name a file that can be read") from None
        except (yaml.YAMLError, ValueError) as error:
            raise wrong("camera", f"{path}: {' '.join(str(error).split())}", "write a camera_info of ROS in YAML") from None
        # `ros2 topic echo` ends a message with a line `---`.
        told: Any = documents[0] if documents else None
        if not isinstance(told, dict):
            raise wrong("camera", f"{path} is no camera_info", "write image_width, image_height, camera_matrix, …")

        def first(*keys: str) -> Any:
            return next((told[key] for key in keys if key in told), None)

        def needed(*keys: str) -> Any:
            value = first(*keys)
            if value is None:
                raise wrong(f"camera.{keys[0]}", f"missing in {path}", "write it as ROS's camera_calibration does")
            return value

        try:
            size = (int(needed("image_width", "width")), int(needed("image_height", "height")))
        except (TypeError, ValueError):
            raise wrong("camera.image_width", "the size is no two whole numbers", "write pixels") from None
        region = told.get("roi") or {}
        if isinstance(region, dict) and any(region.get(key) for key in ("x_offset", "y_offset", "width", "height")):
            raise wrong("camera.roi", "pictures of a part of the sensor are not supported", "write intrinsics of the pictures as they are")
        if any(told.get(key) not in (None, 0, 1) for key in ("binning_x", "binning_y")):
            raise wrong("camera.binning_x", "binned pictures are not supported", "write intrinsics of the pictures as they are")
        fx, fy, cx, cy = _matrix(needed("camera_matrix", "k", "K"), "camera.camera_matrix")
        name = str(told.get("camera_name") or "camera")
        name = "".join(it if (it.isascii() and it.isalnum()) or it in "_-" else "_" for it in name)
        projection = first("projection_matrix", "p", "P")
        other = None
        if projection is not None:
            values = _row(projection, "camera.projection_matrix")
            if len(values) == 12 and values[0] > 0:
                other = (values[0], values[5], values[2], values[6])
        if rectified:
            if other is None:
                raise wrong("camera.projection_matrix", "missing, and rectified pictures need it", "write P, or leave `rectified` out")
            return cls(size, other[:2], other[2:], (), "plumb_bob", name)
        model = str(needed("distortion_model"))
        remarks = []
        if other is not None and max(abs(a - b) for a, b in zip(other, (fx, fy, cx, cy))) > 1e-6 * fx:
            remarks.append(
                f"P of {path} differs from K and is ignored: pictures are taken to be raw (image_raw); for image_rect say `rectified`"
            )
        turned = first("rectification_matrix", "r", "R")
        if turned is not None:
            values = _row(turned, "camera.rectification_matrix")
            if len(values) == 9 and np.abs(np.array(values) - np.eye(3).ravel()).max() > 1e-9 and any(values):
                remarks.append(f"R of {path} is ignored: it turns rectified pictures alone")
        coefficients = _row(needed("distortion_coefficients", "d", "D"), "camera.distortion_coefficients")
        return cls(size, (fx, fy), (cx, cy), coefficients, model, name, tuple(remarks))

    def to_yaml(self, path: str | PathLike[str] | None = None, comment: str = "") -> str:
        """A ``camera_info`` of ROS as ``read`` takes it; written to ``path`` if there is one."""

        def matrix(rows: int, columns: int, values: Sequence[float]) -> str:
            return f"\n  rows: {rows}\n  cols: {columns}\n  data: [{', '.join(repr(float(it)) for it in values)}]\n"

        (fx, fy), (cx, cy) = self.focal_px, self.centre_px
        text = "".join(f"# {line}\n" for line in comment.splitlines())
        text += f"image_width: {self.size_px[0]}\nimage_height: {self.size_px[1]}\ncamera_name: {self.name}\n"
        text += "camera_matrix:" + matrix(3, 3, [fx, 0, cx, 0, fy, cy, 0, 0, 1])
        text += f"distortion_model: {self.model}\ndistortion_coefficients:" + matrix(1, len(self.distortion), self.distortion)
        text += "rectification_matrix:" + matrix(3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1])
        text += "projection_matrix:" + matrix(3, 4, [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0])
        if path is not None:
            Path(path).write_text(text, encoding="utf-8")
        return text

    @property
    def K(self) -> Floats:
        """The matrix of the pinhole, 3 × 3, px."""
        return np.array([[self.focal_px[0], 0, self.centre_px[0]], [0, self.focal_px[1], self.centre_px[1]], [0, 0, 1]], float)

    def pinhole(self) -> Camera:
        """The same camera without a lens: that of undistorted pixels."""
        return Camera(self.size_px, self.focal_px, self.centre_px, (), "plumb_bob", self.name)

    def section(self) -> dict[str, Any]:
        """Keys of ``[[camera]]`` of undistorted pixels: ``name``, ``size_px``, ``focal_px``, ``centre_px``; of a guess those of what is learned
        too, of pixels as they are."""
        section: dict[str, Any] = {
            "name": self.name,
            "size_px": [float(it) for it in self.size_px],
            "focal_px": [round(it, 3) for it in self.focal_px] if self.is_guess else list(self.focal_px),
            "centre_px": list(self.centre_px),
        }
        if self.known_to_px is not None:
            section |= {"known_to_px": round(self.known_to_px, 1), "learn_distortion_to": list(self.distortion_known_to)}
        return section

    def _bent(self, ideal: Floats) -> Floats:
        """What the lens makes of points of the plane z = 1, N × 2."""
        x, y = ideal[:, 0], ideal[:, 1]
        r2 = x * x + y * y
        if self.model == "equidistant":
            r = np.sqrt(r2)
            theta = np.arctan(r)
            k1, k2, k3, k4 = self.distortion
            t2 = theta * theta
            bent = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
            scale = np.where(r > 1e-12, bent / np.maximum(r, 1e-12), 1.0)
            return np.asarray(ideal * scale[:, None], np.float64)
        k1, k2, p1, p2, k3, k4, k5, k6 = (*self.distortion, 0.0, 0.0, 0.0)[:8]
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return np.column_stack([u, v])

    def _slope(self, ideal: Floats) -> Floats:
        """The derivative of ``_bent``, N × 2 × 2."""
        step = 1e-6
        columns = []
        for axis in range(2):
            ahead, behind = ideal.copy(), ideal.copy()
            ahead[:, axis] += step
            behind[:, axis] -= step
            columns.append((self._bent(ahead) - self._bent(behind)) / (2 * step))
        return np.stack(columns, axis=-1)

    def distort(self, points: ArrayLike) -> Floats:
        """Where the lens shows what a pinhole of the same K would show at ``points`` (N × 2, px); the inverse of ``undistort``."""
        pixels = _points(points)
        focal, centre = np.array(self.focal_px), np.array(self.centre_px)
        return np.asarray(self._bent((pixels - centre) / focal) * focal + centre, np.float64)

    def undistort(self, points: ArrayLike) -> Floats:
        """Where a pinhole of the same K would show what is seen at ``points`` (N × 2, px); NaN where the lens model has no inverse.

        By Newton's method, and tried by distorting again: an answer is right to 1e-6 px. The model is inverted where it
        grows from the centre on: beyond, where it would fold the picture, the answer is NaN, as for a ray of 90 degrees or more.
        """
        pixels = _points(points)
        focal, centre = np.array(self.focal_px), np.array(self.centre_px)
        if not any(self.distortion) and self.model != "equidistant":
            return pixels.copy()
        seen = (pixels - centre) / focal
        known = np.isfinite(seen).all(axis=1)
        ideal = np.where(known[:, None], seen, 0.0)
        goal = ideal.copy()
        with np.errstate(all="ignore"):
            for _ in range(60):
                error = self._bent(ideal) - goal
                if not (np.abs(error) > 1e-13).any():
                    break
                slope = self._slope(ideal)
                det = slope[:, 0, 0] * slope[:, 1, 1] - slope[:, 0, 1] * slope[:, 1, 0]
                x = (slope[:, 1, 1] * error[:, 0] - slope[:, 0, 1] * error[:, 1]) / det
                y = (slope[:, 0, 0] * error[:, 1] - slope[:, 1, 0] * error[:, 0]) / det
                step = np.column_stack([x, y])
                step[~np.isfinite(step)] = 0.0
                # Never so far that it jumps over the fold.
                most = 0.3 * (0.2 + np.linalg.norm(ideal, axis=1, keepdims=True))
                length = np.linalg.norm(step, axis=1, keepdims=True)
                ideal = ideal - step * np.minimum(1.0, most / np.maximum(length, 1e-300))
            off = np.abs((self._bent(ideal) - goal) * focal).max(axis=1)
            right = known & (off < 1e-6)
            along = np.linspace(0.0, 1.0, 33)[1:]
            for part in along:
                slope = self._slope(ideal * part)
                det = slope[:, 0, 0] * slope[:, 1, 1] - slope[:, 0, 1] * slope[:, 1, 0]
                trace = slope[:, 0, 0] + slope[:, 1, 1]
                right &= (det > 1e-9) & (trace > 0)
        answer = np.asarray(ideal * focal + centre, np.float64)
        answer[~right] = np.nan
        return answer

    def project(self, points_m: ArrayLike, rotation: ArrayLike | None = None, translation_m: ArrayLike | None = None) -> Floats:
        """Where points (N × 3, m) are seen, px; NaN behind the camera. R, t take them into the optical frame: p = R q + t."""
        points = np.array(points_m, float).reshape(-1, 3)
        if rotation is not None:
            points = points @ np.array(rotation, float).T
        if translation_m is not None:
            points = points + np.array(translation_m, float)
        ahead = points[:, 2] > 1e-9
        ideal = np.full((len(points), 2), np.nan)
        ideal[ahead] = points[ahead, :2] / points[ahead, 2:]
        return np.asarray(self._bent(ideal) * np.array(self.focal_px) + np.array(self.centre_px), np.float64)


def _points(points: ArrayLike) -> Floats:
    pixels = np.array(points, float)
    if pixels.ndim != 2 or pixels.shape[1] != 2:
        raise wrong("points", f"an array of shape {pixels.shape} is no list of pixels", "pass N x 2 numbers")
    return pixels


def _row(value: Any, field: str) -> tuple[float, ...]:
    data = value.get("data") if isinstance(value, dict) else value
    try:
        row = tuple(float(it) for it in np.array(data, float).ravel())
    except (TypeError, ValueError):
        raise wrong(field, "it is no list of numbers", "write numbers") from None
    if not all(math.isfinite(it) for it in row):
        raise wrong(field, "a number is not finite", "write finite numbers")
    return row


def _matrix(value: Any, field: str) -> tuple[float, float, float, float]:
    row = _row(value, field)
    if len(row) != 9:
        raise wrong(field, f"{len(row)} numbers are no 3 x 3 matrix", "write nine, row by row")
    fx, skew, cx, zero, fy, cy, a, b, one = row
    if abs(skew) > 1e-9 * abs(fx) or any(abs(it) > 1e-12 for it in (zero, a, b)) or abs(one - 1) > 1e-12:
        raise wrong(field, "it is not [fx 0 cx; 0 fy cy; 0 0 1]", "write K row by row, without skew")
    return fx, fy, cx, cy
