"""Corners in rendered pictures against the truth, and why others are not taken."""

from __future__ import annotations

import dataclasses

import pytest

from vision_extra import need

need()

import numpy as np  # noqa: E402

from body_schema import FieldError  # noqa: E402
from body_schema.vision import Camera, Detection, Target, Watcher, detect  # noqa: E402
from body_schema.vision._detect import FLOOR_PX  # noqa: E402
from rendered import Lens, Sheet, dictionary, facing_pose, render, rotation, square, tag_sheet  # noqa: E402

import cv2  # noqa: E402, I001

BENT = (-0.2, 0.03, 0.001, -0.001, 0.0)


def camera_of(lens: Lens) -> Camera:
    return Camera(lens.size, lens.focal, lens.centre, lens.k, name="webcam")


def ideal(lens: Lens, points: np.ndarray) -> np.ndarray:
    return points[:, :2] / points[:, 2:] * np.array(lens.focal) + np.array(lens.centre)


@pytest.mark.parametrize(
    ("family", "its", "id"),
    [
        ("tag36h11", "DICT_APRILTAG_36h11", 3),
        ("tag25h9", "DICT_APRILTAG_25h9", 11),
        ("aruco_4x4_50", "DICT_4X4_50", 7),
        ("aruco_6x6_250", "DICT_6X6_250", 200),
    ],
)
@pytest.mark.parametrize("k", [(0.0,) * 5, BENT])
def test_corners_are_where_they_are(family: str, its: str, id: int, k: tuple[float, ...]) -> None:
    random = np.random.default_rng(7)
    target, lens = Target.tag(id, 0.04, family=family), Lens(k=k)
    errors, chi2, told = [], [], 0
    for index in range(6):
        turn, place = facing_pose(
            random.uniform(0.2, 0.7),
            random.uniform(0, 55),
            random.uniform(0, 360),
            random.uniform(0, 360),
            (random.uniform(-0.3, 0.3), random.uniform(-0.2, 0.2)),
        )
        picture = render(lens, [tag_sheet(its, id, 0.04)], turn, place, blur_px=random.uniform(0.5, 1.1), noise=3.0, seed=index)
        detection = detect(picture, target, camera_of(lens))
        if not detection.whole:
            assert detection.rejections
            continue
        told += 1
        assert list(detection.names) == target.point_names == [f"tag{id}/{corner}" for corner in range(4)]
        truth = square(0.04) @ turn.T + place
        errors.append(detection.pixels - lens.projected(truth))
        off = detection.undistorted - ideal(lens, truth)
        noise = detection.covariances - FLOOR_PX**2 * np.eye(2)
        chi2 += list(np.einsum("ij,ijk,ik->i", off, np.linalg.inv(noise), off))
    assert told >= 5
    rms, most = float(np.sqrt(np.mean(np.square(errors)))), float(np.abs(errors).max())
    print(f"{family}: rms {rms:.4f} px, at most {most:.3f} px, chi2 / 2 = {np.mean(chi2) / 2:.2f}")
    assert rms < 0.02 and most < 0.08
    # Covariances say what errors are; the floor that comes on top is for what is not rendered.
    assert 0.4 < np.mean(chi2) / 2 < 2.0


WEBCAMS = {
    "as rendered": (lambda it: it, 0.015),
    "tone curve 1/2.2": (lambda it: (255 * (it / 255.0) ** (1 / 2.2)).astype(np.uint8), 0.015),
    "JPEG of quality 50": (lambda it: cv2.imdecode(cv2.imencode(".jpg", it, [cv2.IMWRITE_JPEG_QUALITY, 50])[1], 0), 0.03),
    "sharpened": (lambda it: cv2.addWeighted(it, 2.0, cv2.GaussianBlur(it, (0, 0), 1.5), -1.0, 0), 0.08),
    "moved by 5 px": (lambda it: cv2.filter2D(it, -1, np.ones((1, 5)) / 5), 0.12),
}


def test_corners_in_pictures_as_webcams_give_them() -> None:
    random = np.random.default_rng(2)
    name, target, lens = "DICT_APRILTAG_36h11", Target.tag(3, 0.04), Lens(k=BENT)
    errors: dict[str, list[np.ndarray]] = {which: [] for which in [*WEBCAMS, "OpenCV's corners, as rendered"]}
    chi2: dict[str, list[float]] = {which: [] for which in WEBCAMS}
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    theirs = cv2.aruco.ArucoDetector(dictionary(name), parameters)
    for index in range(8):
        at = (random.uniform(-0.3, 0.3), random.uniform(-0.2, 0.2))
        turn, place = facing_pose(random.uniform(0.25, 0.6), random.uniform(0, 55), random.uniform(0, 360), random.uniform(0, 360), at)
        picture = render(lens, [tag_sheet(name, 3, 0.04)], turn, place, blur_px=0.8, seed=index)
        points = square(0.04) @ turn.T + place
        for which, (made, _) in WEBCAMS.items():
            detection = detect(made(picture), target, camera_of(lens))
            assert detection.whole, (index, which, detection.rejections)
            errors[which].append(detection.pixels - lens.projected(points))
            off = detection.undistorted - ideal(lens, points)
            chi2[which] += list(np.einsum("ij,ijk,ik->i", off, np.linalg.inv(detection.covariances), off))
        found, ids, _ = theirs.detectMarkers(picture)
        errors["OpenCV's corners, as rendered"] += [it.reshape(4, 2) - lens.projected(points) for it in found]
    for which, its in errors.items():
        rms, most = float(np.sqrt(np.mean(np.square(its)))), float(np.abs(its).max())
        spread = f", chi2 / 2 = {np.mean(chi2[which]) / 2:.2f}" if which in chi2 else ""
        print(f"{which}: rms {rms:.3f} px, at most {most:.2f} px{spread}")
        if which in WEBCAMS:
            assert rms < WEBCAMS[which][1] and np.mean(chi2[which]) / 2 < 2.0, which


def test_corners_keep_their_names_upside_down() -> None:
    target, lens = Target.tag(3, 0.04), Lens()
    for roll in (0, 90, 180, 270):
        turn, place = facing_pose(0.3, 10, 40, roll)
        detection = detect(render(lens, [tag_sheet("DICT_APRILTAG_36h11", 3, 0.04)], turn, place), target)
        truth = lens.projected(square(0.04) @ turn.T + place)
        assert np.abs(detection.pixels - truth).max() < 0.1
    first = detect(render(lens, [tag_sheet("DICT_APRILTAG_36h11", 3, 0.04)], *facing_pose(0.3, 0, 0, 180)), target).pixels[0]
    assert (first > np.array(lens.centre)).all(), "its top left corner is at the lower right"


def test_uneven_light_and_a_finger_do_not_move_corners() -> None:
    target, lens = Target.tag(3, 0.04), Lens()
    turn, place = facing_pose(0.3, 25, 60, 20)
    picture = render(lens, [tag_sheet("DICT_APRILTAG_36h11", 3, 0.04)], turn, place)
    truth = lens.projected(square(0.04) @ turn.T + place)
    shaded = np.clip(picture * np.linspace(0.5, 1.1, 640)[None, :], 0, 255).astype(np.uint8)
    assert np.abs(detect(shaded, target).pixels - truth).max() < 0.1
    for across, down in ((0.06, 0.2), (0.45, 0.4), (0.8, 0.6)):
        covered = picture.copy()
        x, y = truth[0] + across * (truth[1] - truth[0]) + down * (truth[3] - truth[0])
        cv2.circle(covered, (int(x), int(y)), 4, 140, -1)
        assert np.abs(detect(covered, target).pixels - truth).max() < 0.1


def reasons(picture: np.ndarray, target: Target, camera: Camera | None = None) -> list[str]:
    detection = detect(picture, target, camera)
    assert not detection.names and all(it.words for it in detection.rejections)
    return [it.reason for it in detection.rejections]


def test_why_a_tag_is_not_taken() -> None:
    target, lens = Target.tag(3, 0.04), Lens()
    name = "DICT_APRILTAG_36h11"
    sheet = tag_sheet(name, 3, 0.04)
    here = facing_pose(0.3, 20, 30, 10)
    assert reasons(render(lens, [tag_sheet(name, 3, 0.04, mirrored=True)], *here), target) == ["mirrored"]
    assert reasons(render(lens, [sheet], *here)[:, ::-1].copy(), target) == ["mirrored"]
    assert reasons(render(lens, [tag_sheet(name, 4, 0.04)], *here), target) == ["other"]
    assert reasons(render(lens, [], *here), target)[0] in ("unseen", "unreadable", "small")
    assert reasons(render(lens, [sheet], *facing_pose(1.3)), target) == ["small"]
    assert reasons(render(lens, [sheet], *facing_pose(0.3), black=110, white=132, noise=1.0), target) == ["contrast"]
    assert set(reasons(render(lens, [sheet], *facing_pose(0.25), blur_px=8.0), target)) <= {"blur", "unreadable"}
    assert reasons(render(lens, [sheet], *facing_pose(0.12, 77, 0)), target, camera_of(lens)) == ["grazing"]
    turn, place = facing_pose(0.3)
    width = 640 / 600 * 0.3
    assert reasons(render(lens, [sheet], turn, place + [width / 2 - 0.012, 0, 0]), target)[0] in ("border", "unseen")
    # The margin is in the picture, and two corners nearly at its border.
    near = render(lens, [sheet], turn, place + [width / 2 - 0.0206, 0, 0])
    assert reasons(near, target) == ["border"]
    twice = render(lens, [sheet], turn, place)
    other = render(lens, [sheet], turn, place - [0.1, 0, 0])
    both = np.where(np.arange(640)[None, :] < 220, other, twice)
    assert reasons(both, target) == ["twice"]
    # A square whose cells are no tag, or of another family.
    other = render(lens, [tag_sheet("DICT_6X6_250", 17, 0.04)], *here, background=200)
    assert reasons(other, target)[0] in ("unreadable", "unseen")


def test_glare_is_told_where_a_tag_can_still_be_read() -> None:
    target, lens = Target.tag(3, 0.04, family="aruco_4x4_50"), Lens()
    turn, place = facing_pose(0.25)
    picture = render(lens, [tag_sheet("DICT_4X4_50", 3, 0.04)], turn, place)
    truth = lens.projected(square(0.04) @ turn.T + place)
    # A bright stripe beside the middle of every cell of a row, so that the cells can be read.
    glare = picture.copy()
    x0, y0 = truth[0].round().astype(int)
    x1, y1 = truth[2].round().astype(int)
    cell = (x1 - x0) / 6
    for row in range(6):
        a = int(y0 + row * cell)
        glare[a : a + int(0.3 * cell), x0 + 3 : x1 - 3] = 255
    detection = detect(glare, target)
    assert [it.reason for it in detection.rejections] == ["glare"] and not detection.names


def test_noise_and_other_pictures_are_no_tags() -> None:
    random = np.random.default_rng(0)
    for family in ("tag36h11", "aruco_5x5_100"):
        target = Target.tag(3, 0.04, family=family)
        for _ in range(3):
            assert not detect(random.integers(0, 256, (240, 320), np.uint8), target).names
        assert not detect(np.zeros((240, 320), np.uint8), target).names
        assert not detect(np.full((9, 9), 255, np.uint8), target).names


@pytest.mark.parametrize(
    "image",
    [
        None,
        "tag.png",
        np.zeros((0, 0), np.uint8),
        np.zeros((4, 4), np.float32),
        np.zeros((4, 4, 2), np.uint8),
        np.zeros(5, np.uint8),
        [[1, 2]],
    ],
)
def test_what_is_no_picture_is_refused(image: object) -> None:
    with pytest.raises(FieldError) as refused:
        detect(image, Target.tag(3, 0.04))
    assert refused.value.field == "image" and refused.value.mend


def test_pictures_of_another_size_than_the_cameras_are_refused() -> None:
    with pytest.raises(FieldError, match="320 x 240 pixels, its camera 640 x 480"):
        detect(np.zeros((240, 320), np.uint8), Target.tag(3, 0.04), camera_of(Lens()))


CUBE = {"top": 0, "front": 1, "right": 2, "back": 3, "left": 4}
PLACES = {
    "top": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "front": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "right": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "back": ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
    "left": ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
}


def cube_sheets(edge: float, size: float, ids: dict[str, int] = CUBE) -> list[Sheet]:
    sheets = []
    for face, id in ids.items():
        normal, right, up = (np.array(it, float) for it in PLACES[face])
        sheet = tag_sheet("DICT_APRILTAG_36h11", id, size, middle=normal * edge / 2, right=right, up=up)
        sheets.append(sheet)
    return sheets


def cube_view(random: np.random.Generator, distance: float = 0.35) -> tuple[np.ndarray, np.ndarray]:
    """A camera that sees some faces of a cube."""
    turn, place = facing_pose(distance, random.uniform(30, 60), random.uniform(0, 360), random.uniform(0, 360))
    return turn, place


def test_a_cube_is_seen_in_part_and_by_name() -> None:
    random = np.random.default_rng(3)
    target, lens = Target.cube(CUBE, 0.05, 0.033), Lens(k=BENT)
    camera, faces = camera_of(lens), set()
    for index in range(8):
        turn, place = cube_view(random)
        picture = render(lens, cube_sheets(0.05, 0.033), turn, place, seed=index)
        detection = detect(picture, target, camera)
        assert 4 <= len(detection.names) < 20 and not detection.whole
        truth = dict(zip(target.point_names, lens.projected(target.points_m @ turn.T + place)))
        # The truth of the sheets, without the target's own points.
        for face, id in CUBE.items():
            normal, right, up = (np.array(it, float) for it in PLACES[face])
            corners = normal * 0.025 + 0.0165 * np.array([up - right, up + right, right - up, -right - up])
            for corner, pixel in enumerate(lens.projected(corners @ turn.T + place)):
                assert np.abs(truth[f"tag{id}/{corner}"] - pixel).max() < 1e-9
        for name, pixel in zip(detection.names, detection.pixels):
            assert np.abs(pixel - truth[name]).max() < 0.2, name
        reading = detection.reading()
        assert len(reading) == 20 and sum(it is None for it in reading) == 20 - len(detection.names)
        look = Watcher(camera, target).look(picture)
        assert set(look.measurements) == {f"webcam_cube_{face}" for face in CUBE}
        faces |= {channel for channel, seen in look.measurements.items() if seen}
        for channel, seen in look.measurements.items():
            assert (seen is None) == (f"tag{CUBE[channel.removeprefix('webcam_cube_')]}/0" not in detection.names)
    assert len(faces) >= 4


def board_sheet(columns: int, rows: int, square_m: float, tag_m: float) -> Sheet:
    board = cv2.aruco.CharucoBoard((columns, rows), square_m, tag_m, dictionary("DICT_5X5_100"))
    image = board.generateImage((columns * 60, rows * 60), marginSize=0)
    return Sheet(np.pad(image, 30, constant_values=255), ((columns + 1) * square_m, (rows + 1) * square_m))


def test_a_board_is_seen_in_part_and_by_name() -> None:
    random = np.random.default_rng(5)
    target, lens = Target.charuco(6, 5, 0.03, 0.022), Lens(k=BENT)
    errors, chi2, counts = [], [], []
    for index in range(8):
        at = (random.uniform(-0.35, 0.35), random.uniform(-0.25, 0.25))
        turn, place = facing_pose(random.uniform(0.25, 0.45), random.uniform(0, 45), random.uniform(0, 360), random.uniform(0, 360), at)
        picture = render(lens, [board_sheet(6, 5, 0.03, 0.022)], turn, place, seed=index)
        detection = detect(picture, target, camera_of(lens))
        counts.append(len(detection.names))
        if not detection.names:
            continue
        points = detection.points_m @ turn.T + place
        errors.append((detection.pixels - lens.projected(points)).ravel())
        off = detection.undistorted - ideal(lens, points)
        chi2 += list(np.einsum("ij,ijk,ik->i", off, np.linalg.inv(detection.covariances), off))
    everything = np.concatenate(errors)
    print(
        f"board: rms {np.sqrt(np.mean(everything**2)):.3f} px, at most {np.abs(everything).max():.2f} px, "
        f"chi2 / 2 = {np.mean(chi2) / 2:.2f}, {counts}"
    )
    assert max(counts) == 20 and min(counts) < 20, "some are whole, some are cut"
    assert np.sqrt(np.mean(everything**2)) < 0.12 and np.abs(everything).max() < 0.6
    assert 0.3 < np.mean(chi2) / 2 < 2.5


def test_a_board_that_is_seen_in_part_is_a_reading() -> None:
    target, lens = Target.charuco(6, 5, 0.03, 0.022), Lens()
    (section,) = target.sections()
    assert section["partly_seen"] is True and section["least_points"] == 4
    watcher, count = Watcher(camera_of(lens), target), len(target.point_names)
    picture = render(lens, [board_sheet(6, 5, 0.03, 0.022)], *facing_pose(0.35))
    whole = watcher.look(picture)
    assert whole.seen and sum(it is not None for it in whole.reading) == count
    picture[:, : picture.shape[1] // 2] = 128
    half = watcher.look(picture)
    seen = [index for index, it in enumerate(half.reading) if it is not None]
    assert half.seen and half.reason == "" and 4 <= len(seen) < count
    assert np.abs(np.array([half.reading[k] for k in seen]) - [whole.reading[k] for k in seen]).max() < 0.3
    picture[:] = 128
    assert not watcher.look(picture).seen


def test_a_board_that_is_mirrored_or_another_is_told() -> None:
    target, lens = Target.charuco(6, 5, 0.03, 0.022), Lens()
    sheet = board_sheet(6, 5, 0.03, 0.022)
    mirrored = dataclasses.replace(sheet, texture=np.ascontiguousarray(sheet.texture[:, ::-1]))
    picture = render(lens, [mirrored], *facing_pose(0.35))
    assert reasons(picture, target) == ["mirrored"]
    assert reasons(render(lens, [], *facing_pose(0.35)), target)[0] in ("unseen", "unreadable", "small")


def test_a_look_is_what_a_session_takes_or_a_reason() -> None:
    lens = Lens(k=BENT)
    watcher = Watcher(camera_of(lens), Target.tag(3, 0.04))
    assert watcher.channels == ["webcam_tag"]
    turn, place = facing_pose(0.3, 20, 0, 0)
    look = watcher.look(cv2.cvtColor(render(lens, [tag_sheet("DICT_APRILTAG_36h11", 3, 0.04)], turn, place), cv2.COLOR_GRAY2BGR))
    assert look.seen and look.reason == "" and isinstance(look.detection, Detection)
    assert look.measurements == {"webcam_tag": look.reading}
    assert np.abs(np.array(look.reading) - ideal(lens, square(0.04) @ turn.T + place)).max() < 0.1
    look = watcher.look(render(lens, [], *facing_pose(0.3)))
    assert not look.seen and look.reading is None and look.reason and look.measurements == {"webcam_tag": None}
    assert rotation([0, 0, 1], 90) @ [1, 0, 0] == pytest.approx([0, 1, 0])
