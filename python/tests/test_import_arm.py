"""An SO-101 whose zeros are off, filmed while it moves: from its bag, and from its data set, to zeros and a description.

``filmed.py`` takes more seeds, with 20 movements.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from vision_extra import need

need()
pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install mujoco")
pytest.importorskip("rosbags", reason="needs rosbags: pip install 'body-schema[ros]'")
pytest.importorskip("pyarrow", reason="needs pyarrow: pip install 'body-schema[lerobot]'")
pytest.importorskip("av", reason="needs av: pip install 'body-schema[lerobot]'")

import body_schema  # noqa: E402
import filmed  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from body_schema.exports._lerobot import STEPS_PER_DEG  # noqa: E402


@pytest.fixture(scope="module")
def run() -> tuple[Any, Any]:
    """Ten movements, at twice the speed. Of a stand of 1 s ten pictures a second leave half a second at most: it stands for longer."""
    setup = filmed.setup_of(1016, 10)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(filmed, "SPEED_DEG_S", 90.0)
        patched.setattr(filmed, "STANDS_S", 1.5)
        try:
            return setup, filmed.filmed(setup)
        except body_schema.Error as error:
            if "cannot render" not in str(error):
                raise
            pytest.skip(str(error))


@pytest.fixture(scope="module")
def recordings(run: tuple[Any, Any], tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    return filmed.files_of(tmp_path_factory.mktemp("filmed"), *run)


@pytest.mark.parametrize("kind", ["mcap", "lerobot"])
def test_zeros_from_a_recording(
    kind: str, run: tuple[Any, Any], recordings: dict[str, list[str]], binary: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = filmed.calibrated(binary, recordings[kind], tmp_path, "--folds", "0")
    said = capsys.readouterr().out
    found = filmed.off(*run, out)
    print(said, found)
    assert set(found["zeros_deg"]) == filmed.CLEAR and found["rows"] >= 8
    assert max(map(abs, found["zeros_deg"].values())) < 0.5 and found["tag_mm"] < 2.0
    # What is a convention is said: where the camera stands, and how the tag is turned, is not known.
    conventions = " ".join(found["undetermined"])
    assert "shoulder_pan" in conventions and "wrist_roll" in conventions
    # Pictures come late, and so does what the gears move.
    offset = json.loads((tmp_path / "arm.json").read_text(encoding="utf-8"))["sensors"][0]["offset_s"]
    assert -0.15 < offset < -0.05
    assert 'learn = "zeros"' in (tmp_path / "arm.toml").read_text(encoding="utf-8")

    # The arm's own file gets what is known, and what is a convention stays.
    setup, arm = run
    before, after = tmp_path / "motors.json", tmp_path / "true.json"
    before.write_text(setup.calibration.to_json(), encoding="utf-8")
    assert main(["export", "lerobot", str(out), "--file", str(before), "--out", str(after)]) == 0
    said = capsys.readouterr().out
    old, new = (json.loads(it.read_text(encoding="utf-8")) for it in (before, after))
    for name, its in old.items():
        steps = new[name]["homing_offset"] - its["homing_offset"]
        wanted = -arm.truth.zeros_deg[name] * STEPS_PER_DEG if name in filmed.CLEAR else 0
        assert abs(steps - wanted) < (0.5 * STEPS_PER_DEG + 1 if name in filmed.CLEAR else 1e-9), name
        assert {**new[name], "homing_offset": 0} == {**its, "homing_offset": 0}
    assert "shoulder_pan: its zero is a convention" in said and "not with calibrated.urdf" in said
    assert main(["export", "lerobot", str(out), "--file", str(out / "report.json"), "--dry-run"]) == 2
    assert "name the file that lerobot-calibrate wrote" in capsys.readouterr().err


def test_the_camera_of_pictures_is_that_of_the_bag(recordings: dict[str, list[str]], capsys: pytest.CaptureFixture[str]) -> None:
    words = [it for it in recordings["mcap"] if it != "--raw"]
    assert main(["import", *words]) == 2
    told = capsys.readouterr().err
    assert "distorts (plumb_bob)" in told and "--raw or --rectified" in told
    without = recordings["lerobot"][: recordings["lerobot"].index("--camera")]
    assert main(["import", *without, "--unit", "deg"]) == 2
    assert "name a camera file with --camera FILE" in capsys.readouterr().err


def test_pictures_whose_numbers_differ_have_one_reason() -> None:
    from body_schema.recordings.images import _kind

    angle, size = "tag 0 is seen at 76 degrees from its normal: turn it", "tag 3 is 11.5 px large, and 12.0 are needed: come nearer"
    assert _kind(angle) == "tag 0 is seen at … degrees from its normal: turn it"
    assert _kind(size) == "tag 3 is … px large, and … are needed: come nearer"
    assert _kind("tag 12 is blurred by 2.1 px, cells have 4.0: focus") == "tag 12 is blurred by … px, cells have …: focus"
    assert _kind("tag: a square has a contrast of 16 of 255: more light") == "tag: a square has a contrast of … of 255: more light"
    assert _kind("no tag36h11") == "no tag36h11"
