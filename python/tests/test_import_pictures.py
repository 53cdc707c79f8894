"""Pictures in a bag are looked at by ``body_schema.vision``, and become readings."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

np = pytest.importorskip("numpy", reason="needs numpy: pip install 'body-schema[ros]'")
pytest.importorskip("rosbags", reason="needs rosbags: pip install 'body-schema[ros]'")
cv2 = pytest.importorskip("cv2", reason="needs OpenCV: pip install 'body-schema[vision]'")
vision: Any = pytest.importorskip("body_schema.vision", reason="needs body_schema.vision: pip install 'body-schema[vision]'")

import body_schema  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from body_schema.recordings.chain import Description  # noqa: E402
from body_schema.recordings.places import places_of  # noqa: E402
from body_schema.recordings.ros import BAYER, CHANNELS, _picture  # noqa: E402
from body_schema.recordings.tracks import Camera, tell_a_plane  # noqa: E402
from recorded import BASE, TIP, URDF, Run, bag, rotation  # noqa: E402

SIZE_M, WIDTH, HEIGHT, FOCAL = 0.3, 640, 480, 500.0
CENTRE = np.array([WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5])
VIEW = rotation([0, 0, 1], 0.2) @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
PRINT = cv2.copyMakeBorder(
    cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), 3, 400),
    50, 50, 50, 50, cv2.BORDER_CONSTANT, value=255,
)  # fmt: skip


BOARD = vision.Target.charuco(6, 6, 0.15, 0.11)


BOARD_M = 6 * 0.15 * 500 / 480


def board_print() -> Any:
    """A board of 6 × 6 squares as the sheet of 500 px that the tag's is."""
    board = cv2.aruco.CharucoBoard((6, 6), 0.15, 0.11, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100))
    return cv2.copyMakeBorder(board.generateImage((480, 480)), 10, 10, 10, 10, cv2.BORDER_CONSTANT, value=255)


def seen(run: Run, time: float, sheet: Any = PRINT, size_m: float = SIZE_M * 500 / 400, cover: float = 0.0) -> Any:
    """The picture of a sheet of so many metres on the back of the hand, at four times the resolution first, so much of its right side covered."""
    r, p = run.arm.hand(run.at(time))
    p = VIEW @ (p + r @ [0.05, 0.0, 0.08]) + [0.0, 0.1, 2.4]
    r = VIEW @ r @ np.diag([1.0, -1.0, -1.0])
    picture = np.full((HEIGHT, WIDTH), 120, np.uint8)
    if r[2, 2] < -0.35:
        half = size_m / 2
        corners = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]]) @ r.T + p
        pixels = (corners[:, :2] / corners[:, 2:] * FOCAL + CENTRE).astype(np.float32)
        source = np.array([[-0.5, -0.5], [499.5, -0.5], [499.5, 499.5], [-0.5, 499.5]], np.float32)
        finer = np.array([[4.0, 0.0, 1.5], [0.0, 4.0, 1.5], [0.0, 0.0, 1.0]])
        warp = finer @ cv2.getPerspectiveTransform(source, pixels)
        shown = sheet.copy()
        shown[:, round(500 * (1 - cover)) :] = 120
        large = cv2.warpPerspective(shown, warp, (WIDTH * 4, HEIGHT * 4), flags=cv2.INTER_AREA, borderValue=120)
        picture = cv2.resize(large, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.clip(picture + run.random.normal(0.0, 2.0, picture.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("compressed", [False, True])
def test_pictures_become_readings(compressed: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = Run(1051, movements=12)
    kind = "sensor_msgs/msg/CompressedImage" if compressed else "sensor_msgs/msg/Image"

    def pictures(store: Any, header: Any) -> Any:
        found = []
        for index in range(int(run.end_s * 12)):
            time = index / 12
            picture = seen(run, time)
            if compressed:
                data = np.frombuffer(cv2.imencode(".png", picture)[1].tobytes(), np.uint8)
                message = store.types[kind](header=header(time - 0.25, "camera"), format="png", data=data)
            else:
                message = store.types[kind](
                    header=header(time - 0.25, "camera"), height=HEIGHT, width=WIDTH, encoding="mono8", is_bigendian=0, step=WIDTH,
                    data=picture.ravel(),
                )  # fmt: skip
            found.append((time + 0.03, "/camera/image", kind, message))
        return found

    vision.Target.tag(3, SIZE_M, name="tag").to_toml(tmp_path / "tag.toml")
    camera = vision.Camera((WIDTH, HEIGHT), (FOCAL, FOCAL), (float(CENTRE[0]), float(CENTRE[1])), name="webcam")
    camera.to_yaml(tmp_path / "camera.yaml")
    recorded = bag(tmp_path / "pictures", "mcap", run, extra=pictures)
    words = [str(recorded), "--urdf", str(URDF), "--base", BASE, "--tip", TIP, "--sensor", "tag=/camera/image", "--max-offset", "2"]
    assert main(["import", *words]) == 2
    assert "--target FILE" in capsys.readouterr().err
    words += ["--target", str(tmp_path / "tag.toml"), "--camera", str(tmp_path / "camera.yaml"), "--out", str(tmp_path / "table")]
    assert main(["import", *words]) == 0, capsys.readouterr().err
    record = json.loads((tmp_path / "table" / "pictures.json").read_text())["sensors"][0]
    # The tag is in about half of the pictures, twelve a second: that tells less than a tracker does.
    assert abs(record["offset_s"] - 0.25) < 4.0 * record["offset_deviation_s"] < 0.05
    assert any("no tag is seen" in why for why in record["left_out"])
    title, *rows = (tmp_path / "table" / "pictures.csv").read_text().splitlines()
    assert title.endswith(",webcam_tag_u4,webcam_tag_v4") and len(rows) >= 4


def test_which_points_tell_where_a_plane_lies() -> None:
    grid = np.array([[x, y, 0.0] for y in range(3) for x in range(4)]) * 0.05
    for chosen in ([0, 1, 4, 5], [0, 3, 8, 11, 5], [0, 1, 2, 4, 5]):
        assert tell_a_plane(grid[chosen]), chosen
    for chosen in ([0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 5]):
        assert not tell_a_plane(grid[chosen]), chosen


def test_a_size_that_nothing_tells_is_not_doubted() -> None:
    """The two axes of a positioner meet: how far the target is from where they do is one with how large it is. A UR10 tells it."""
    random = np.random.default_rng(1054)
    points = BOARD.points_m
    camera = Camera("camera", (WIDTH, HEIGHT), (FOCAL, FOCAL), (float(CENTRE[0]), float(CENTRE[1])))
    eye, mount = np.eye(4), np.eye(4)
    eye[:3, :3], eye[:3, 3] = rotation([1, 0, 0], math.pi) @ rotation([0, 1, 0], 0.2), [0.1, 0.2, 4.0]
    mount[:3, 3] = [0.1, 0.05, 0.1]
    for urdf, base, tip, is_told in ((URDF.parent / "positioner.urdf", "base", "table", False), (URDF, BASE, TIP, True)):
        description = Description(urdf)
        chain = description.chain(base, tip)
        positions = random.uniform(-0.5, 0.5, (20, sum(joint.moves for joint in chain)))
        turned, place = description.hand(chain, positions)
        hand = np.tile(np.eye(4), (20, 1, 1))
        hand[:, :3, :3], hand[:, :3, 3] = turned, place
        seen = np.einsum("nij,kj->nki", np.linalg.inv(eye) @ hand @ mount, np.hstack([points, np.ones((len(points), 1))]))[..., :3]
        pixels = (seen[..., :2] / seen[..., 2:] * FOCAL + CENTRE).reshape(20, -1) + random.normal(0, 0.1, (20, 2 * len(points)))
        found = places_of(camera, points / 1.06, pixels, description, chain, positions, False)
        assert found is not None
        if is_told:
            assert abs(found.scale - 1.06) < 4 * found.scale_sd < 0.1, found
        else:
            assert found.scale == 1.0 and math.isinf(found.scale_sd)
        guessed = replace(camera, focal_px=(FOCAL, FOCAL), learned={"known_to_px": 100.0})
        found = places_of(guessed, points, pixels, description, chain, positions, False)
        assert found is not None and 0.85 < found.focal < 1.15, found


def pictured(run: Run, path: Path, pictures: Any) -> Path:
    """A bag with a picture by time, eight a second, its clock a quarter of a second late."""

    def extra(store: Any, header: Any) -> Any:
        for index in range(int(run.end_s * 8)):
            time = index / 8
            data = pictures(time).ravel()
            kind = "sensor_msgs/msg/Image"
            message = store.types[kind](
                header=header(time - 0.25, "camera"), height=HEIGHT, width=WIDTH, encoding="mono8", is_bigendian=0, step=WIDTH, data=data
            )  # fmt: skip
            yield (time + 0.03, "/camera/image", kind, message)

    return bag(path, "mcap", run, extra=lambda store, header: list(extra(store, header)))


def test_a_board_that_a_hand_covers_in_part_is_a_reading(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run, sheet = Run(1052, movements=12), board_print()
    recorded = pictured(run, tmp_path / "covered", lambda time: seen(run, time, sheet, BOARD_M, 0.4 if int(time / 3) % 2 else 0.0))
    BOARD.to_toml(tmp_path / "board.toml")
    vision.Camera((WIDTH, HEIGHT), (FOCAL, FOCAL), (float(CENTRE[0]), float(CENTRE[1])), name="webcam").to_yaml(tmp_path / "camera.yaml")
    words = [str(recorded), "--urdf", str(URDF), "--base", BASE, "--tip", TIP, "--sensor", "board=/camera/image", "--max-offset", "2"]
    words += ["--target", str(tmp_path / "board.toml"), "--camera", str(tmp_path / "camera.yaml"), "--out", str(tmp_path / "table")]
    assert main(["import", *words]) == 0, capsys.readouterr().err
    record = json.loads((tmp_path / "table" / "covered.json").read_text())["sensors"][0]
    assert abs(record["offset_s"] - 0.25) < 4.0 * record["offset_deviation_s"] < 0.05
    with open(tmp_path / "table" / "covered.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    shown = [sum(bool(row[f"webcam_board_u{point}"]) for point in range(1, 26)) for row in rows]
    # Whole ones and covered ones, of which the left part is there.
    assert max(shown) == 25 and 4 <= min(shown) < 20 and len(rows) >= 4, shown
    written = (tmp_path / "table" / "covered.toml").read_text()
    assert "partly_seen = true\nleast_points = 4" in written
    report = body_schema.calibrate(tmp_path / "table" / "covered.toml", folds=3).report
    assert report["held_out"]["after"]["mean_px"] < 1.0, report["held_out"]


def test_a_camera_that_nobody_calibrated_is_learned_with_the_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run, sheet = Run(1053, movements=16), board_print()
    recorded = pictured(run, tmp_path / "guessed", lambda time: seen(run, time, sheet, BOARD_M))
    BOARD.to_toml(tmp_path / "board.toml")
    words = [str(recorded), "--urdf", str(URDF), "--base", BASE, "--tip", TIP, "--sensor", "board=/camera/image", "--max-offset", "2"]
    words += ["--target", str(tmp_path / "board.toml"), "--out", str(tmp_path / "table")]
    (tmp_path / "camera.yaml").write_text("image_width: 640")
    assert main(["import", *words, "--fov-deg", "50", "--camera", str(tmp_path / "camera.yaml")]) == 2
    assert "write one of" in capsys.readouterr().err
    # The truth is 65.2 degrees.
    assert main(["import", *words, "--fov-deg", "50"]) == 0, capsys.readouterr().err
    written = (tmp_path / "table" / "guessed.toml").read_text()
    assert "known_to_px" in written and "learn_distortion_to" in written
    report = body_schema.calibrate(tmp_path / "table" / "guessed.toml", folds=3).report
    print(report["intrinsics"], report["distortion"], report["held_out"])
    assert report["held_out"]["after"]["mean_px"] < 1.0, report["held_out"]
    values = {it["name"]: it for it in report["intrinsics"]}
    for name, truth in (("fx", FOCAL), ("fy", FOCAL), ("cx", CENTRE[0]), ("cy", CENTRE[1])):
        assert abs(values[name]["value"] - truth) < 4 * values[name]["sd"] < 60, (name, values[name])
    # A board that is larger than printed is told, though nobody knows the focal length.
    BOARD.scaled(1.06).to_toml(tmp_path / "board.toml")
    capsys.readouterr()
    assert main(["import", *words, "--fov-deg", "50", "--dry-run", "--plot", str(tmp_path / "taken.png")]) == 0
    said = capsys.readouterr().out
    assert abs(float(said.split("doubt: board seems ")[1].split()[0]) - 1 / 1.06) < 0.02, said
    assert (tmp_path / "taken.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("encoding", [*CHANNELS, "BAYER_RGGB8", "8UC1"])
def test_every_encoding_of_a_picture_is_the_same_picture(encoding: str) -> None:
    """A smooth picture, more blue to the right, more red below, in rows that are padded."""
    v, u = np.mgrid[0:48, 0:64]
    picture = np.stack([60 + 2 * u, 100 + u + v, 40 + 3 * v], axis=2).astype(np.uint8)
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    kind = encoding.lower()
    if kind in BAYER:
        colours = {"b": 0, "g": 1, "r": 2}
        data = np.empty_like(grey)
        for cell, colour in enumerate(kind.split("_")[1][:4]):
            at = (slice(cell // 2, None, 2), slice(cell % 2, None, 2))
            data[at] = picture[..., colours[colour]][at]
    elif kind in ("mono16", "y16"):
        data = (grey.astype(np.uint16) * 16).astype(">u2").view(np.uint8).reshape(48, 128)
    elif CHANNELS[kind] == 2:
        data = np.full((48, 128), 128, np.uint8)
        data[:, 0 if "yuy" in kind else 1 :: 2] = grey
    else:
        full = {"rgb": picture[..., ::-1], "bgr": picture, "8uc": picture}.get(kind[:3], grey)
        full = grey if CHANNELS[kind] == 1 else full
        alpha = np.full((48, 64, 1), 9, np.uint8)
        data = (np.concatenate([full, alpha], axis=2) if CHANNELS[kind] == 4 else full).reshape(48, -1)
    padded = np.pad(data, ((0, 0), (0, 5 + data.shape[1] % 2)))
    read = SimpleNamespace(encoding=encoding, is_bigendian=1, height=48, width=64, step=padded.shape[1], data=padded.ravel())
    found = _picture(read)
    assert found.shape == (48, 64, 3) and found.dtype == np.uint8
    inside = np.s_[2:-2, 2:-2]
    if kind in BAYER or CHANNELS[kind] >= 3:
        assert np.abs(found[inside].astype(int) - picture[inside]).max() <= 3
    else:
        # Of sixteen bits the brightest is white.
        scale = 255 / grey.max() if "16" in kind else 1.0
        assert np.abs(found[inside].astype(float) - scale * grey[inside][..., None]).max() <= 1.5
