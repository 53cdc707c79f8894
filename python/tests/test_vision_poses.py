"""What pixels tell of a pose, and what they do not."""

from __future__ import annotations

import pytest

from vision_extra import need

need()

import dataclasses  # noqa: E402

import numpy as np  # noqa: E402

from body_schema import FieldError  # noqa: E402
from body_schema.vision import Camera, Detection, Target, detect, optical_from_link, poses, scale_between  # noqa: E402
from body_schema.vision._place import optical_pose  # noqa: E402
from body_schema.vision._poses import angles_of, frame_doubt, matrix_of  # noqa: E402
from body_schema.vision._tables import cube_ratio  # noqa: E402
from rendered import Lens, facing_pose, render, rotation, tag_sheet  # noqa: E402
from test_vision_detect import CUBE, cube_sheets, cube_view  # noqa: E402

LENS = Lens(k=(-0.1, 0.0, 0.0, 0.0, 0.0))
CAMERA = Camera(LENS.size, LENS.focal, LENS.centre, LENS.k)


def seen(distance: float, tilt: float, size: float = 0.04) -> tuple[Detection, np.ndarray, np.ndarray]:
    turn, place = facing_pose(distance, tilt, 35, 15, (0.1, 0.05))
    return detect(render(LENS, [tag_sheet("DICT_APRILTAG_36h11", 3, size)], turn, place), Target.tag(3, size), CAMERA), turn, place


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1))))


def test_a_small_tag_has_two_poses_and_neither_is_sure() -> None:
    detection, turn, place = seen(0.7, 12)
    found = poses(detection, CAMERA)
    assert len(found) == 2 and not any(it.sure for it in found)
    assert found[0].chi2 <= found[1].chi2 and all(it.rms_px < 0.5 for it in found)
    assert sum(it.probability for it in found) == pytest.approx(1)
    # One of them is right; both are at the right place.
    assert min(angle(it.rotation, turn) for it in found) < 3 < angle(found[0].rotation, found[1].rotation)
    assert all(np.abs(it.translation_m - place).max() < 0.01 for it in found)


def test_a_large_tag_at_an_angle_has_one_pose_that_is_sure() -> None:
    detection, turn, place = seen(0.2, 45, 0.06)
    found = poses(detection, CAMERA)
    assert len(found) == 2 and found[0].sure and found[1].rms_px > 10 * found[0].rms_px
    assert angle(found[0].rotation, turn) < 0.1 and np.abs(found[0].translation_m - place).max() < 2e-4


def test_a_cube_has_one_pose() -> None:
    random = np.random.default_rng(2)
    target = Target.cube(CUBE, 0.05, 0.033)
    turn, place = cube_view(random)
    detection = detect(render(LENS, cube_sheets(0.05, 0.033), turn, place), target, CAMERA)
    assert len(detection.names) >= 8
    (pose,) = poses(detection, CAMERA)
    assert pose.sure and angle(pose.rotation, turn) < 0.1 and np.abs(pose.translation_m - place).max() < 3e-4
    nothing = detect(np.zeros((480, 640), np.uint8), target, CAMERA)
    assert poses(nothing, CAMERA) == []


def test_a_cubes_edge_tells_the_size_of_its_tags() -> None:
    random = np.random.default_rng(4)
    right, wrong = Target.cube(CUBE, 0.05, 0.033), Target.cube(CUBE, 0.05, 0.03)
    ratios: dict[str, list[float]] = {"right": [], "wrong": []}
    for index in range(4):
        turn, place = cube_view(random, 0.25)
        picture = render(LENS, cube_sheets(0.05, 0.033), turn, place, seed=index)
        for name, target in (("right", right), ("wrong", wrong)):
            ratio = cube_ratio(detect(picture, target, CAMERA), CAMERA)
            if ratio is not None:
                ratios[name].append(ratio)
    assert len(ratios["right"]) >= 3
    assert ratios["right"] == pytest.approx([1.0] * len(ratios["right"]), abs=0.01)
    assert ratios["wrong"] == pytest.approx([1.1] * len(ratios["wrong"]), abs=0.012)


def test_known_places_tell_a_wrong_size() -> None:
    random = np.random.default_rng(6)
    turn = matrix_of([10, 20, 30])
    known, described, right = [], [], []
    for index in range(6):
        its, place = facing_pose(random.uniform(0.25, 0.5), 20, 60 * index, 0, (random.uniform(-0.3, 0.3), random.uniform(-0.2, 0.2)))
        picture = render(LENS, [tag_sheet("DICT_APRILTAG_36h11", 3, 0.04)], its, place, seed=index)
        known.append(turn @ place + [0.1, 0.2, 0.3])
        for size, places in ((0.05, described), (0.04, right)):
            places.append(poses(detect(picture, Target.tag(3, size), CAMERA), CAMERA)[0].translation_m)
    scale = scale_between(described, known)
    assert scale.value == pytest.approx(1.25, abs=0.01) and "0.8" in scale.words and scale.rms_m < 2e-3
    scale = scale_between(right, known)
    assert scale.value == pytest.approx(1.0, abs=0.005) and scale.words == ""
    with pytest.raises(FieldError, match="mirrored"):
        scale_between(np.array(right) * [-1, 1, 1], known)
    with pytest.raises(FieldError, match="on a line"):
        scale_between(np.outer(np.arange(5), [1, 2, 3]), np.outer(np.arange(5), [1, 2, 3]))
    for wrong in (right[:2], [[1, 2]], np.full((6, 3), np.nan)):
        with pytest.raises(FieldError):
            scale_between(wrong, known)


def test_the_optical_frame_is_told_from_the_link_frame() -> None:
    # A camera that looks along x: as a link it is not turned.
    assert optical_from_link([0, 0, 0]) == pytest.approx([-90, 0, -90])
    for rpy in ([10, 20, 30], [0, 90, 0], [-130, 5, 170], [0, -90, 45]):
        assert np.allclose(matrix_of(angles_of(matrix_of(rpy))), matrix_of(rpy), atol=1e-7)
        assert np.allclose(matrix_of(optical_from_link(rpy))[:, 2], matrix_of(rpy)[:, 0], atol=1e-7), "ahead"
        assert np.allclose(matrix_of(optical_from_link(rpy))[:, 1], -matrix_of(rpy)[:, 2], atol=1e-7), "down"
    random = np.random.default_rng(1)
    base_to_camera, shift = optical_pose((0.5, -0.3, 0.5), (0.2, 0.0, 0.1))
    optical = angles_of(base_to_camera.T)
    link = angles_of(base_to_camera.T @ np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]))
    assert optical_from_link(link) == pytest.approx(optical, abs=1e-6)
    its, known = [], []
    for _ in range(8):
        turn, place = facing_pose(random.uniform(0.3, 0.6), 20, 0, 0, (random.uniform(-0.3, 0.3), random.uniform(-0.2, 0.2)))
        its.append(dataclasses.replace(PROTOTYPE, rotation=turn, translation_m=place))
        known.append(base_to_camera.T @ (place - shift))
    assert frame_doubt(its, known, optical) == ""
    by_eye = angles_of(base_to_camera.T @ rotation([0, 1, 0], 12))
    assert frame_doubt(its, known, by_eye) == ""
    said = frame_doubt(its, known, link)
    assert "link frame" in said and f"{optical[0]:.1f}" in said


PROTOTYPE = poses(seen(0.2, 45, 0.06)[0], CAMERA)[0]
