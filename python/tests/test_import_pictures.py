"""Pictures in a bag are looked at by ``body_schema.vision``, and become readings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

np = pytest.importorskip("numpy", reason="needs numpy: pip install 'body-schema[ros]'")
pytest.importorskip("rosbags", reason="needs rosbags: pip install 'body-schema[ros]'")
cv2 = pytest.importorskip("cv2", reason="needs OpenCV: pip install 'body-schema[vision]'")
vision: Any = pytest.importorskip("body_schema.vision", reason="needs body_schema.vision: pip install 'body-schema[vision]'")

from body_schema.__main__ import main  # noqa: E402
from recorded import BASE, TIP, URDF, Run, bag, rotation  # noqa: E402

SIZE_M, WIDTH, HEIGHT, FOCAL = 0.3, 640, 480, 500.0
CENTRE = np.array([WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5])
VIEW = rotation([0, 0, 1], 0.2) @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
PRINT = cv2.copyMakeBorder(
    cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), 3, 400),
    50, 50, 50, 50, cv2.BORDER_CONSTANT, value=255,
)  # fmt: skip


def seen(run: Run, time: float) -> Any:
    """The picture of a tag on the back of the hand, at four times the resolution first."""
    r, p = run.arm.hand(run.at(time))
    p = VIEW @ (p + r @ [0.05, 0.0, 0.08]) + [0.0, 0.1, 2.4]
    r = VIEW @ r @ np.diag([1.0, -1.0, -1.0])
    picture = np.full((HEIGHT, WIDTH), 120, np.uint8)
    if r[2, 2] < -0.35:
        half = SIZE_M / 2 * 500 / 400
        corners = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]]) @ r.T + p
        pixels = (corners[:, :2] / corners[:, 2:] * FOCAL + CENTRE).astype(np.float32)
        source = np.array([[-0.5, -0.5], [499.5, -0.5], [499.5, 499.5], [-0.5, 499.5]], np.float32)
        finer = np.array([[4.0, 0.0, 1.5], [0.0, 4.0, 1.5], [0.0, 0.0, 1.0]])
        warp = finer @ cv2.getPerspectiveTransform(source, pixels)
        large = cv2.warpPerspective(PRINT, warp, (WIDTH * 4, HEIGHT * 4), flags=cv2.INTER_AREA, borderValue=120)
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
