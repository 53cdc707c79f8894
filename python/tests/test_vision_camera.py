"""Lenses, files of intrinsics, and intrinsics from pictures of a board."""

from __future__ import annotations

from pathlib import Path

import pytest

from vision_extra import need

need()

import cv2  # noqa: E402
import numpy as np  # noqa: E402

from body_schema import FieldError  # noqa: E402
from body_schema.vision import Camera, Target, find_intrinsics, pictures_of  # noqa: E402
from rendered import Lens, facing_pose, render  # noqa: E402
from test_vision_detect import board_sheet  # noqa: E402


def grid() -> np.ndarray:
    return np.stack(np.meshgrid(np.linspace(0, 639, 17), np.linspace(0, 479, 13)), -1).reshape(-1, 2)


def camera(model: str, *k: float) -> Camera:
    return Camera((640, 480), (600.0, 590.0), (322.0, 236.0), k, model)


@pytest.mark.parametrize(
    "its",
    [
        camera("plumb_bob", -0.3, 0.1, 0.002, -0.001, -0.02),
        camera("rational_polynomial", 0.5, 0.1, 0.001, -0.002, 0.01, 0.8, 0.2, 0.02),
        camera("equidistant", 0.05, -0.01, 0.003, -0.001),
    ],
)
def test_undistorting_is_the_inverse_and_is_opencvs(its: Camera) -> None:
    pixels = grid()
    back = its.undistort(pixels)
    assert np.isfinite(back).all() and np.abs(its.distort(back) - pixels).max() < 1e-6
    ideal = (back - its.centre_px) / its.focal_px
    if its.model == "equidistant":
        theirs = cv2.fisheye.distortPoints(ideal.reshape(-1, 1, 2), its.K, np.array(its.distortion)).reshape(-1, 2)
    else:
        rays = np.column_stack([ideal, np.ones(len(ideal))])
        theirs = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), its.K, np.array(its.distortion))[0].reshape(-1, 2)
    assert np.abs(theirs - pixels).max() < 1e-6


def test_where_a_lens_has_no_inverse_nothing_is_made_up() -> None:
    # With k1 = -0.5 radii beyond 0.544 are never seen: the model folds there.
    its = Camera((640, 480), (300.0, 300.0), (319.5, 239.5), (-0.5,))
    pixels = grid()
    back = its.undistort(pixels)
    radius = np.linalg.norm((pixels - its.centre_px) / its.focal_px, axis=1)
    assert np.isnan(back[radius > 0.5444]).all() and np.isfinite(back[radius < 0.54]).all()
    inside = np.linalg.norm((back[radius < 0.54] - its.centre_px) / its.focal_px, axis=1)
    assert (inside < np.sqrt(1 / 1.5) + 1e-9).all(), "none is beyond the fold"
    # OpenCV's own answers there are numbers like any other.
    theirs = cv2.undistortPoints(pixels.reshape(-1, 1, 2), its.K, np.array([-0.5, 0, 0, 0]), P=its.K)
    assert np.isfinite(theirs).all()
    wide = Camera((640, 480), (150.0, 150.0), (319.5, 239.5), (), "equidistant")
    assert np.isnan(wide.undistort([[0.0, 0.0]])).all() and np.isfinite(wide.undistort([[319.5, 239.5], [500.0, 239.5]])).all()
    assert np.isnan(wide.undistort([[np.nan, 3.0], [np.inf, 3.0]])).all()
    for wrong in ([1.0, 2.0], [[1.0, 2.0, 3.0]]):
        with pytest.raises(FieldError, match="N x 2"):
            its.undistort(wrong)


ROS = """image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [600.5, 0.0, 320.1, 0.0, 599.5, 240.2, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.2, 0.03, 0.001, -0.002, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [550.0, 0.0, 321.0, 0.0, 0.0, 560.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
ECHO = """header:
  frame_id: camera
height: 480
width: 640
distortion_model: rational_polynomial
d: [0.1, 0.2, 0.001, 0.002, 0.01, 0.3, 0.1, 0.02]
k: [600.5, 0.0, 320.1, 0.0, 599.5, 240.2, 0.0, 0.0, 1.0]
r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
p: [600.5, 0.0, 320.1, 0.0, 0.0, 599.5, 240.2, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
---
"""


def test_camera_info_of_ros(tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(ROS)
    raw = Camera.read(file)
    assert raw.focal_px == (600.5, 599.5) and raw.centre_px == (320.1, 240.2) and raw.distortion == (-0.2, 0.03, 0.001, -0.002, 0.0)
    assert raw.name == "narrow_stereo" and len(raw.remarks) == 1 and "P" in raw.remarks[0] and "ignored" in raw.remarks[0]
    flat = Camera.read(file, rectified=True)
    assert flat.focal_px == (550.0, 560.0) and flat.centre_px == (321.0, 241.0) and not any(flat.distortion)
    file.write_text(ECHO)
    echo = Camera.read(file)
    assert echo.model == "rational_polynomial" and echo.distortion[5] == 0.3 and echo.remarks == ()
    echo.to_yaml(tmp_path / "again.yaml", comment="two\nlines")
    assert Camera.read(tmp_path / "again.yaml") == echo
    same = Camera.of(echo.K, echo.distortion, size_px=(640, 480), model="rational_polynomial")
    assert same == echo
    assert echo.section() == {"name": "camera", "size_px": [640.0, 480.0], "focal_px": [600.5, 599.5], "centre_px": [320.1, 240.2]}


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("plumb_bob", "thin_prism", "model"),
        ("600.5, 0.0, 320.1", "600.5, 0.0, nan", "camera.camera_matrix"),
        ("600.5, 0.0, 320.1", "600.5, 5.0, 320.1", "camera.camera_matrix"),
        ("600.5, 0.0, 320.1, ", "", "camera.camera_matrix"),
        ("600.5, 0.0, 320.1", "-600.5, 0.0, 320.1", "focal_px"),
        ("600.5, 0.0, 320.1", "600.5, 0.0, 32010", "centre_px"),
        ("image_width: 640", "image_width: wide", "camera.image_width"),
        ("image_width: 640\n", "", "camera.image_width"),
        ("distortion_model: plumb_bob\n", "", "camera.distortion_model"),
        ("-0.2, 0.03", "-0.2, [0.03]", "camera.distortion_coefficients"),
        ("0.001, -0.002, 0.0]", "0.001, -0.002, 0.0, 0.5]", "distortion"),
        ("camera_name: narrow_stereo", "roi: {width: 320}", "camera.roi"),
        ("camera_name: narrow_stereo", "binning_x: 2", "camera.binning_x"),
        ("rows: 3\n", "rows: [3\n", "camera"),
        (ROS, "[]", "camera"),
        (ROS, "", "camera"),
    ],
)
def test_wrong_camera_files_are_refused(tmp_path: Path, old: str, new: str, field: str) -> None:
    file = tmp_path / "camera.yaml"
    assert old in ROS
    file.write_text(ROS.replace(old, new))
    with pytest.raises(FieldError) as refused:
        Camera.read(file)
    assert refused.value.field == field and refused.value.what and refused.value.mend
    with pytest.raises(FieldError, match="No such file"):
        Camera.read(tmp_path / "missing.yaml")


BOARD = Target.charuco(7, 5, 0.03, 0.022)


def views(lens: Lens, count: int, tilt: float = 40.0, seed: int = 1, near: float = 0.3) -> list[tuple[str, np.ndarray]]:
    random = np.random.default_rng(seed)
    out = []
    for index in range(count):
        at = (random.uniform(-0.3, 0.3), random.uniform(-0.22, 0.22))
        turn, place = facing_pose(
            random.uniform(near, near + 0.1), random.uniform(0.3, 1) * tilt, random.uniform(0, 360), random.uniform(-30, 30), at
        )
        out.append((f"{index}.png", render(lens, [board_sheet(7, 5, 0.03, 0.022)], turn, place, seed=index)))
    return out


def test_a_camera_is_found_from_pictures_of_a_board(tmp_path: Path) -> None:
    lens = Lens(focal=(620.0, 615.0), centre=(325.0, 236.0), k=(-0.2, 0.04, 0.0, 0.0, 0.0))
    pictures = views(lens, 14)
    folder = tmp_path / "board"
    folder.mkdir()
    for name, picture in pictures:
        cv2.imwrite(str(folder / name), picture)
    cv2.imwrite(str(folder / "14.png"), np.full((480, 640), 128, np.uint8))
    found = find_intrinsics(pictures_of([folder]), BOARD, name="webcam")
    print(found.words)
    its = found.camera
    assert list(found.rejected) == ["14.png"] and len(found.views) == 14 and list(found.views)[:3] == ["0.png", "1.png", "2.png"]
    assert 0.01 < found.rms_px < 0.2 and found.coverage > 0.7 and found.tilt_deg > 25 and its.name == "webcam"
    for name, value, truth in [
        ("fx", its.focal_px[0], 620.0),
        ("fy", its.focal_px[1], 615.0),
        ("cx", its.centre_px[0], 325.0),
        ("cy", its.centre_px[1], 236.0),
        ("k1", its.distortion[0], -0.2),
    ]:
        assert abs(value - truth) < 4 * found.deviations[name] + 1e-3 * abs(truth), name
    # What counts: where undistorted points are.
    truth = lens.rays(grid()) * np.array(its.focal_px) + np.array(its.centre_px)
    assert np.abs(its.undistort(grid()) - truth).max() < 1.5


def test_pictures_that_do_not_determine_a_camera_are_told() -> None:
    lens = Lens(k=(-0.2, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(FieldError, match="3 pictures show the board, six are needed"):
        find_intrinsics(views(lens, 3), BOARD)
    flat = find_intrinsics(views(lens, 7, tilt=4.0, near=0.6), BOARD)
    assert any("tilted by" in it for it in flat.doubts) and any("cover" in it for it in flat.doubts), flat.doubts
    with pytest.raises(FieldError, match="is no board"):
        find_intrinsics([], Target.tag(1, 0.03))
    with pytest.raises(FieldError, match="one camera"):
        find_intrinsics([("a", np.zeros((480, 640), np.uint8)), ("b", np.zeros((240, 320), np.uint8))], BOARD)


def test_pictures_of_folders_and_of_videos(tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="is not there"):
        list(pictures_of([tmp_path / "a.png"]))
    with pytest.raises(FieldError, match="has no pictures"):
        list(pictures_of([tmp_path]))
    (tmp_path / "a.png").write_bytes(b"no picture")
    with pytest.raises(FieldError, match="cannot be read as a picture"):
        list(pictures_of([tmp_path / "a.png"]))
    (tmp_path / "a.mp4").write_bytes(b"no video")
    with pytest.raises(FieldError, match="cannot be read as a video"):
        list(pictures_of([tmp_path / "a.mp4"]))
    video = cv2.VideoWriter(str(tmp_path / "b.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    for index in range(7):
        video.write(np.full((48, 64, 3), 30 * index, np.uint8))
    video.release()
    frames = list(pictures_of([tmp_path / "b.avi"], every=3))
    assert [name for name, _ in frames] == ["b.avi:0", "b.avi:3", "b.avi:6"] and frames[2][1].shape == (48, 64, 3)
