"""Tables are calibrated from Python as by the command, and the robots that come of it can be asked."""

from __future__ import annotations

import copy
import json
import math
import pickle
import subprocess
from collections.abc import Sequence
from pathlib import Path

import body_schema
import pytest
from body_schema._urdf import parse_urdf

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
URDF, TABLE = SCENARIOS / "positioner.urdf", SCENARIOS / "positioner.csv"


@pytest.fixture(scope="module")
def calibrated() -> body_schema.Calibration:
    return body_schema.calibrate(SCENARIOS / "positioner.toml")


def posture(calibrated: body_schema.Calibration, at: float) -> dict[str, float]:
    return {name: at * (1.0 - 0.3 * index) for index, name in enumerate(calibrated.joints)}


def test_it_is_what_the_command_writes(calibrated: body_schema.Calibration, binary: Path, tmp_path: Path) -> None:
    command = [str(binary), "calibrate", str(SCENARIOS / "positioner.toml"), "--out", str(tmp_path / "out")]
    subprocess.run(command, check=True, capture_output=True)
    assert calibrated.report == json.loads((tmp_path / "out" / "report.json").read_text())
    written = calibrated.write(tmp_path / "files")
    assert {path.name for path in written} >= {"calibrated.urdf", "report.json"}
    for path in written:
        assert path.read_bytes() == (tmp_path / "out" / path.relative_to(tmp_path / "files")).read_bytes()
    with pytest.raises(body_schema.FieldError, match="not empty"):
        calibrated.write(tmp_path / "files")
    assert calibrated.to_urdf(tmp_path / "robot.urdf") == (tmp_path / "robot.urdf").read_text()
    assert "nominal" in repr(calibrated) and "<table>" in calibrated._repr_html_()


def test_a_description_and_a_table_are_enough() -> None:
    found = body_schema.calibrate(URDF, TABLE)
    assert found.guesses and found.report["held_out"]["after"]["mean_mm"] < found.report["held_out"]["before"]["mean_mm"]


def test_a_table_may_be_a_data_frame() -> None:
    pandas = pytest.importorskip("pandas", reason="needs pandas")
    of_file, of_frame = (body_schema.calibrate(URDF, it, folds=2).report for it in (TABLE, pandas.read_csv(TABLE)))
    assert of_frame["held_out"] == of_file["held_out"] and of_frame["joints"] == of_file["joints"]


def test_a_calibration_is_copied_and_not_pickled(calibrated: body_schema.Calibration) -> None:
    assert copy.deepcopy(calibrated).report == copy.copy(calibrated).report == calibrated.report
    with pytest.raises(TypeError, match="keep its `files`"):
        pickle.dumps(calibrated)


def test_the_links_of_targets_can_be_said() -> None:
    target, link = "target", "turntable"
    found = body_schema.calibrate(URDF, TABLE, on={target: link}, folds=2)
    assert [target["link"] for target in found.report["targets"]] == [link]
    with pytest.raises(body_schema.EngineError, match="no target or camera `nose`"):
        body_schema.calibrate(URDF, TABLE, on={"nose": link})
    for wrong in ({"on": {target: link}}, {"tag_side_m": 0.04}):
        with pytest.raises(body_schema.FieldError, match="a calibration file says it"):
            body_schema.calibrate(SCENARIOS / "positioner.toml", **wrong)  # type: ignore[arg-type]


def test_the_jacobian_is_the_derivative_of_the_pose(calibrated: body_schema.Calibration) -> None:
    step = 1e-6
    for nominal in (False, True):
        here = posture(calibrated, 0.3)
        jacobian = calibrated.jacobian(here, nominal=nominal)
        for column, name in enumerate(calibrated.joints):
            ahead, behind = (calibrated.fk({**here, name: here[name] + side * step}, nominal=nominal) for side in (1, -1))
            for row in range(3):
                assert math.isclose((ahead[row][3] - behind[row][3]) / (2 * step), jacobian[row][column], abs_tol=1e-7)


def test_turns_are_those_of_the_written_description(calibrated: body_schema.Calibration) -> None:
    """Between two postures the hand turns by as much as the tip of the description that is written."""
    for nominal, text in ((True, URDF.read_text()), (False, calibrated.to_urdf())):
        tree = parse_urdf(text)
        postures = [posture(calibrated, at) for at in (0.1, 0.5)]
        found = angle(*(calibrated.fk(here, nominal=nominal) for here in postures))
        assert math.isclose(found, angle(*(tree.pose("table", "base", here).rotation for here in postures)), abs_tol=1e-7)


def angle(one: Sequence[Sequence[float]], other: Sequence[Sequence[float]]) -> float:
    """Between the rotations of two poses."""
    trace = sum(one[row][column] * other[row][column] for row in range(3) for column in range(3))
    return math.acos(max(-1.0, min(1.0, (trace - 1.0) / 2.0)))


def test_the_covariance_is_symmetric_and_positive(calibrated: body_schema.Calibration) -> None:
    covariance = calibrated.covariance(posture(calibrated, 0.2))
    assert covariance == calibrated.covariance(posture(calibrated, 0.2), of=calibrated.report["targets"][0]["name"])
    with pytest.raises(body_schema.FieldError, match="there is no target or camera"):
        calibrated.covariance(posture(calibrated, 0.2), of="nose")
    for row in range(3):
        assert 0.0 < covariance[row][row] < 1e-4
        assert all(math.isclose(covariance[row][column], covariance[column][row], rel_tol=1e-9, abs_tol=1e-15) for column in range(3))


def test_the_covariance_of_a_reading_counts_its_noise_and_how_well_that_is_known(calibrated: body_schema.Calibration) -> None:
    q = posture(calibrated, 0.2)
    (noise,) = [it for it in calibrated.report["noise"] if it["unit"] == "m"]
    hand, reading = calibrated.covariance(q), calibrated.covariance(q, of=noise["sensor"], reading=True)
    assert noise["explaining_sigma"] is not None
    freedom = noise["degrees"] + 3
    for row in range(3):
        assert math.isclose(reading[row][row], (hand[row][row] + noise["explaining_sigma"] ** 2) * freedom / (freedom - 2), rel_tol=1e-12)
    assert reading == calibrated.covariance(q, reading=True), "one target is meant where there is one"
    with pytest.raises(body_schema.FieldError, match="there is no target or camera"):
        calibrated.covariance(q, of="nose", reading=True)


def test_data_frames(calibrated: body_schema.Calibration) -> None:
    pytest.importorskip("pandas")
    assert len(calibrated.joints_dataframe()) == len(calibrated.report["joints"])
    assert len(calibrated.dataframe()) == len(calibrated.report["residuals"])
    assert list(calibrated.dataframe("targets")["name"]) == [it["name"] for it in calibrated.report["targets"]]
    with pytest.raises(body_schema.FieldError, match="name one of .*residuals"):
        calibrated.dataframe("rows")
    ahead = body_schema.observability(SCENARIOS / "positioner.toml", postures=2)
    assert list(body_schema.dataframe(ahead, "errors")["best_mm"]) == [it["best_mm"] for it in ahead["errors"]]
    with pytest.raises(body_schema.FieldError, match="name one of .*deviations"):
        body_schema.dataframe(ahead, "parameters")


def test_keys_stand_in_place_of_those_of_the_file_that_is_made(calibrated: body_schema.Calibration) -> None:
    tight = body_schema.calibrate(URDF, TABLE, prior={"direction_rad": 1e-6, "point_m": 1e-6}, held_out={"folds": 3})
    assert tight.report["held_out_by"] != calibrated.report["held_out_by"]
    # Axes that are known so well stay where they are.
    assert max(abs(it) for joint in tight.report["joints"] for it in joint["shift_mm"]) < 0.01
    some = body_schema.calibrate(URDF, TABLE, held_out={"rows": [3, 8, 40]})
    assert len({it["row"] for it in some.report["residuals"] if it["held_out"]}) == 3
    with pytest.raises(body_schema.Error, match="nowhere.toml"):
        body_schema.calibrate(URDF, TABLE, robot={"shapes": "nowhere.toml"})
    with pytest.raises(body_schema.FieldError, match="are arguments"):
        body_schema.calibrate(URDF, TABLE, measurements={"file": "nowhere.csv"})
    with pytest.raises(body_schema.Error, match="colour"):
        body_schema.calibrate(URDF, TABLE, colour="red")
    with pytest.raises(body_schema.FieldError, match="leave out what is None"):
        body_schema.calibrate(URDF, TABLE, prior={"direction_rad": None})
    with pytest.raises(body_schema.FieldError, match="a calibration file says it"):
        body_schema.calibrate(SCENARIOS / "positioner.toml", prior={})


def test_what_is_wrong_is_said(calibrated: body_schema.Calibration, tmp_path: Path) -> None:
    name = calibrated.joints[0]
    with pytest.raises(body_schema.FieldError, match="there is no such joint"):
        calibrated.fk({**posture(calibrated, 0.0), "nose": 1.0})
    with pytest.raises(body_schema.FieldError, match=rf"configuration.{name}.*missing"):
        calibrated.fk({})
    with pytest.raises(body_schema.FieldError, match="positions are none of"):
        calibrated.fk([0.0])
    with pytest.raises(body_schema.FieldError, match="there is no target or camera"):
        calibrated.fk(posture(calibrated, 0.0), of="nose")
    with pytest.raises(body_schema.FieldError, match="a calibration file says it"):
        body_schema.calibrate(SCENARIOS / "positioner.toml", tip="nose")
    with pytest.raises(body_schema.EngineError, match="cannot read"):
        body_schema.calibrate(URDF, tmp_path / "none.csv")
    with pytest.raises(body_schema.EngineError):
        body_schema.calibrate(URDF, TABLE, tip="nose")
    with pytest.raises(body_schema.Error):
        body_schema.calibrate("arm-6dof")


def test_observability_is_what_the_command_writes(binary: Path) -> None:
    command = [str(binary), "observability", str(SCENARIOS / "positioner.toml"), "--postures", "6", "--json", "-"]
    wanted = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert body_schema.observability(SCENARIOS / "positioner.toml", postures=6) == wanted
    with pytest.raises(body_schema.FieldError, match="postures"):
        body_schema.observability(SCENARIOS / "positioner.toml", postures=0)
    with pytest.raises(body_schema.FieldError, match="accuracy_m"):
        body_schema.observability(SCENARIOS / "positioner.toml", accuracy_m=-1.0)
