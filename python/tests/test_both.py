"""What sessions promise wherever they are computed: the same suite for those here and those on a server."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

import body_schema
from robot import JOINTS, Robot, calibration, urdf


def opened(asking: Any, **more: object) -> Any:
    return asking.from_urdf(urdf(), "base", "tip", **{**calibration(), **more})


def follow(session: Any, robot: Robot, movements: int) -> dict[str, object]:
    answer: dict[str, object] = {}
    for _ in range(movements):
        target = session.suggest()["suggestions"][0]["configuration"]
        answer = session.observe(target, marker=robot.sees(target))
    return answer


def mean_error_mm(session: Any, robot: Robot) -> float:
    postures = [robot.anywhere() for _ in range(100)]
    pairs = zip(session.predict(postures), map(robot.at, postures))
    return sum(math.dist(*pair) for pair in pairs) / len(postures) * 1e3


def test_following_the_prompts_learns_the_robot(asking: Any, tmp_path: Path) -> None:
    session, robot = opened(asking), Robot(1)
    answer = follow(session, robot, 20)
    assert answer["observation"] == 20 and answer["seen"] and answer["body_seems_changed"] is False
    assert mean_error_mm(session, robot) < 1.0
    enough = session.suggest()["enough"]
    assert enough["expected_error_mm"] < enough["wanted_mm"] == 2.0
    assert session.status()["observations"] == 20
    text = session.to_urdf(tmp_path / "out.urdf")
    assert (tmp_path / "out.urdf").read_text() == text != urdf()
    assert session.to_yaml().startswith("kinematics:\n  pan:\n")
    quick = session.report()
    assert quick["rows"] == quick["training_rows"] == 20 and quick["held_out"] is None and quick["learning"] == []
    report = session.report(folds=5)
    assert report["joints"] == quick["joints"] and report["targets"] == quick["targets"] and report["noise"] == quick["noise"]
    assert report["rows"] == 20 and report["held_out"]["after"]["mean_mm"] < report["held_out"]["before"]["mean_mm"]
    assert session.to_csv().splitlines()[0] == "pan,lift,elbow,marker_x,marker_y,marker_z"
    assert "observations.csv" in session.to_toml()


def test_movements_that_somebody_wants_come_next(asking: Any, tmp_path: Path) -> None:
    session, robot = opened(asking), Robot(4)
    wanted = [robot.anywhere() for _ in range(3)]
    told = session.enqueue(wanted)["suggestions"]
    assert [it["configuration"] for it in told] == wanted
    assert all(it["state"] == "pending" and it["expected_error_mm_after"] > 0.0 for it in told)
    # Each is expected to teach after those before it.
    expected = [it["expected_error_mm_after"] for it in told]
    assert expected == sorted(expected, reverse=True)
    for posture in wanted:
        assert session.suggest()["suggestions"][0]["configuration"] == posture
        session.observe(posture, marker=robot.sees(posture))
    chosen = session.suggest()["suggestions"][0]
    assert chosen["configuration"] not in wanted and chosen["expected_gain"] is not None
    # A list needs the order of its joints.
    names = list(wanted[0])
    later = session.enqueue([[wanted[0][name] for name in names]], joints=names)["suggestions"]
    assert [it["id"] for it in later] == [4, 5] and later[1]["configuration"] == wanted[0]
    events = len(session.events())
    for bad, field in [
        ([wanted[1], {**wanted[0], "elbow": 9.0}], "wanted[1].elbow"),
        ([{**wanted[0], "elbw": 0.0}], "wanted[0].elbw"),
        ([{"pan": 0.0}], "wanted[0].lift"),
        ([], "configurations"),
    ]:
        with pytest.raises(body_schema.FieldError) as refused:
            session.enqueue(bad)
        assert refused.value.field == field
    with pytest.raises(body_schema.EngineError, match="of one client"):
        session.enqueue(wanted * 7)
    assert len(session.events()) == events
    session.save(tmp_path / "session.json")
    assert asking.load(tmp_path / "session.json").suggest(2) == session.suggest(2)


def test_a_saved_session_goes_on(asking: Any, tmp_path: Path) -> None:
    session, robot = opened(asking), Robot(2)
    follow(session, robot, 6)
    pending = session.suggest(2)
    session.save(tmp_path / "session.json")
    loaded = asking.load(tmp_path / "session.json")
    assert loaded.events() == session.events()
    assert loaded.estimate() == session.estimate()
    assert loaded.suggest(2) == pending
    before = loaded.estimate()
    loaded.exclude(3)
    assert loaded.estimate() != before and loaded.status()["excluded"] == [3]
    loaded.include(3)
    assert loaded.estimate() == before


def test_rejections(asking: Any) -> None:
    session = opened(asking)
    first = session.suggest()["suggestions"][0]
    assert session.reject(reason="the cable is too short")["state"] == "infeasible"
    second = session.suggest()["suggestions"][0]
    assert second["configuration"] != first["configuration"]
    assert session.reject(second["id"], state="abandoned")["state"] == "abandoned"
    with pytest.raises(body_schema.ConflictError, match="not pending"):
        session.reject(second["id"])
    with pytest.raises(body_schema.FieldError, match="nothing is pending") as refused:
        session.reject()
    assert refused.value.field == "suggestion_id"
    assert [it["state"] for it in session.suggestions()] == ["infeasible", "abandoned"]


def test_what_is_observed_carries_out_the_oldest_suggestion_unless_told_otherwise(asking: Any) -> None:
    session, robot = opened(asking), Robot(3)
    first, second = session.suggest(2)["suggestions"]
    session.observe(robot.anywhere(), suggestion_id=None, marker=None)
    assert len(session.pending()) == 2
    second_at = second["configuration"]
    session.observe(second_at, suggestion_id=second["id"], marker=robot.sees(second_at))
    session.observe(first["configuration"], measurements={"marker": None})
    assert [it["state"] for it in session.suggestions()] == ["not_seen", "observed"]
    other = session.suggest(client="other")["suggestions"][0]
    session.observe(robot.anywhere(), marker=None)
    assert session.pending("other") == [other]
    assert [(it["number"], it["excluded"]) for it in session.observations()] == [(n, False) for n in (1, 2, 3, 4)]
    assert set(session.observations()[0]) == {"number", "told", "answer", "excluded"}


def test_a_list_of_positions_needs_the_names_of_its_joints(asking: Any) -> None:
    session, robot = opened(asking), Robot(8)
    suggested = session.suggest()["suggestions"][0]
    # Base first in both, and not as in the alphabet.
    assert suggested["joints"] == list(suggested["configuration"]) == session.joints == JOINTS != sorted(JOINTS)
    at = suggested["configuration"]
    with pytest.raises(body_schema.FieldError, match="joints=") as refused:
        session.observe(list(at.values()), marker=robot.sees(at))
    assert refused.value.field == "configuration" and session.observations() == []
    with pytest.raises(body_schema.FieldError, match="joints="):
        session.predict([list(at.values())])
    for joints, field in [
        (["pan", "lift"], "joints"),
        (["pan", "lift", "elbw"], "joints"),
        (["pan", "lift", "lift"], "joints"),
        ("pan", "joints"),
        ([], "joints"),
    ]:
        with pytest.raises(body_schema.FieldError) as refused:
            session.observe(list(at.values()), joints=joints, marker=robot.sees(at))
        assert refused.value.field == field and "pan, lift, elbow" in refused.value.mend
    with pytest.raises(body_schema.FieldError, match="leave `joints` out"):
        session.observe(at, joints=JOINTS, marker=robot.sees(at))
    with pytest.raises(body_schema.FieldError) as refused:
        session.observe([0.0, 0.0], joints=JOINTS, marker=None)
    assert refused.value.field == "configuration"
    turned = JOINTS[::-1]
    session.observe([at[name] for name in turned], joints=turned, marker=robot.sees(at))
    assert session.observations()[0]["told"]["configuration"] == at
    assert session.predict([[at[name] for name in turned]], joints=turned) == session.predict([at])
    with pytest.raises(body_schema.FieldError) as refused:
        session.predict([{"pan": 0.0, "lift": 0.0}])
    assert refused.value.field == "configuration.elbow"


def test_a_dict_is_no_list_of_configurations(asking: Any) -> None:
    session = opened(asking)
    at = dict.fromkeys(("pan", "lift", "elbow"), 0.0)
    for ask in (session.predict, session.predict_readings, session.enqueue):
        with pytest.raises(body_schema.FieldError, match="a dict is one configuration"):
            ask(at)
    pandas = pytest.importorskip("pandas", reason="needs pandas")
    with pytest.raises(body_schema.FieldError, match="does not say what its columns are"):
        session.add_many(pandas.DataFrame([at]))


@pytest.mark.parametrize(
    ("configuration", "channels", "field"),
    [
        ({"pan": 0.0, "lift": 0.0}, {}, "configuration.elbow"),
        ({"pan": 0.0, "lift": 0.0, "elbow": 0.0, "wrist": 0.0}, {}, "configuration.wrist"),
        ({"pan": 0.0, "lift": 0.0, "elbow": 90.0}, {}, "configuration.elbow"),
        ({"pan": 0.0, "lift": 0.0, "elbow": "90"}, {}, "configuration.elbow"),
        ({"pan": 0.0, "lift": 0.0, "elbow": None}, {}, "configuration.elbow"),
        ({"pan": 0.0, "lift": 0.0, "elbow": 0.0}, {"marker": [1.0, 2.0]}, "measurements.marker"),
        ({"pan": 0.0, "lift": 0.0, "elbow": 0.0}, {"maker": [1.0, 2.0, 3.0]}, "measurements.maker"),
        ({"pan": 0.0, "lift": 0.0, "elbow": math.nan}, {}, "configuration.elbow"),
        ({"pan": 0.0, "lift": 0.0, "elbow": object()}, {}, "observation"),
        ([0.0, 0.0, 0.0], {}, "configuration"),
    ],
)
def test_exceptions_name_the_field(
    asking: Any, configuration: object, channels: dict[str, object], field: str
) -> None:
    session = opened(asking)
    with pytest.raises(body_schema.FieldError) as refused:
        session.observe(configuration, **channels)
    assert refused.value.field == field and refused.value.what and refused.value.mend == refused.value.hint != ""
    assert isinstance(refused.value, ValueError) and session.events() == []


def test_wrong_setups_name_the_key(asking: Any) -> None:
    for more, field in [
        ({"prior": {"point_m": -1}}, "prior.point_m"),
        ({"sensr": {}}, "sensr"),
        ({"robot": {"tip": "hand"}}, "robot.urdf"),
        ({"agent": "glbal"}, "agent"),
        ({"measurements": {"file": "a.csv"}}, "measurements"),
        ({"smoother": {"hypotheses": 5000}}, "smoother.hypotheses"),
        ({"selection": {"ahead": 500}}, "selection.ahead"),
        ({"sensor": {"channel": "position", "sigma_m": 0.001, "columns": ["pan", "y", "z"]}}, "sensor.columns"),
        ({"seed": -1}, "seed"),
        ({"prior": {"point_m": math.inf}}, "calibration"),
    ]:
        with pytest.raises(body_schema.FieldError) as refused:
            opened(asking, **more)
        assert refused.value.field == field and refused.value.what and refused.value.mend, field
    with pytest.raises(body_schema.FieldError, match="`urdf`"):
        asking.from_urdf("missing.urdf")


def test_what_there_is_not_is_not_found(asking: Any) -> None:
    session, robot = opened(asking), Robot(9)
    at = robot.anywhere()
    session.observe(at, marker=robot.sees(at))
    for call in [
        lambda: session.reject(99),
        lambda: session.reject(0),
        lambda: session.observe(at, suggestion_id=99, marker=None),
        lambda: session.observe(at, suggestion_id=0, marker=None),
        lambda: session.exclude(2),
        lambda: session.include(0),
    ]:
        with pytest.raises(body_schema.NotFoundError):
            call()
    for call in [
        lambda: session.reject(-1),
        lambda: session.reject("one"),
        lambda: session.observe(at, suggestion_id=1.5, marker=None),
        lambda: session.exclude(2**70),
        lambda: session.include(True),
        lambda: session.suggest(0),
        lambda: session.suggest(21),
        lambda: session.suggest(client=""),
        lambda: session.suggest(client=7),
        lambda: session.suggest(expires_s=-1.0),
    ]:
        with pytest.raises(body_schema.FieldError) as refused:
            call()
        assert refused.value.what and refused.value.mend
    suggested = session.suggest()["suggestions"][0]
    with pytest.raises(body_schema.FieldError) as refused:
        session.reject(suggested["id"], state="lost")
    assert refused.value.field == "state"
    with pytest.raises(body_schema.FieldError) as refused:
        session.reject(suggested["id"], reason="x" * 2000)
    assert refused.value.field == "reason"
    assert len(session.events()) == 2


@pytest.mark.parametrize("result", ["to_urdf", "to_yaml", "report"])
def test_before_anything_is_observed_there_is_no_result(asking: Any, result: str) -> None:
    session = opened(asking)
    with pytest.raises(body_schema.EngineError, match="nothing was observed"):
        getattr(session, result)()
    assert session.to_csv().splitlines() == ["pan,lift,elbow,marker_x,marker_y,marker_z"]


def test_where_nothing_can_be_suggested_it_is_said(asking: Any) -> None:
    only = {"allowed_deg": [[10, 20, 30]], "start_deg": [10, 20, 30]}
    session = opened(asking, constraints=only)
    session.suggest()
    session.reject()
    with pytest.raises(body_schema.EngineError, match="nothing can be suggested"):
        session.suggest()


def test_configurations_of_files(asking: Any, tmp_path: Path) -> None:
    (tmp_path / "three.urdf").write_text(urdf())
    (tmp_path / "three.toml").write_text(
        'name = "three"\n[robot]\nurdf = "three.urdf"\n[measurements]\nfile = "a.csv"\n'
        "[prior]\ndirection_rad = 0.02\npoint_m = 0.01\n"
    )
    session = asking.from_config(tmp_path / "three.toml", agent="smoother:random", seed=4)
    assert session.joints == JOINTS and session.description()["scenario"] == "three"
    assert session.channels() == [{"name": "marker", "channel": "position"}]
    keys = {"robot": {"urdf": urdf()}, "prior": {"direction_rad": 0.02, "point_m": 0.01}}
    same = asking.from_config(keys, agent="smoother:random", seed=4)
    assert same.suggest()["suggestions"] == session.suggest()["suggestions"]
    with pytest.raises(body_schema.FieldError, match="missing.toml"):
        asking.from_config(tmp_path / "missing.toml")
    (tmp_path / "torn.toml").write_text('name = "three"\n[robot\n')
    with pytest.raises(body_schema.FieldError, match=r"torn\.toml.*line 2"):
        asking.from_config(tmp_path / "torn.toml")


def test_what_is_no_session_is_not_loaded(asking: Any, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        asking.load(tmp_path / "missing.json")
    session, robot = opened(asking), Robot(4)
    follow(session, robot, 2)
    saved = json.loads(session.save())
    for text in [
        "{}",
        "[]",
        "nothing",
        json.dumps({"events": []}),
        json.dumps({**saved, "version": 99}),
        json.dumps({**saved, "events": saved["events"][1:]}),
    ]:
        (tmp_path / "other.json").write_text(text)
        with pytest.raises(body_schema.EngineError):
            asking.load(tmp_path / "other.json")
    (tmp_path / "other.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(body_schema.EngineError, match="no session of body-schema"):
        asking.load(tmp_path / "other.json")


def test_both_give_the_same(client: body_schema.Client, tmp_path: Path) -> None:
    here, there = opened(body_schema.Session, seed=5), opened(client, seed=5)
    robots = Robot(6), Robot(6)
    for _ in range(6):
        answers = []
        for session, robot in zip((here, there), robots):
            target = session.suggest()["suggestions"][0]["configuration"]
            answers.append(session.observe(target, marker=robot.sees(target)))
        assert answers[0] == answers[1]
    for session in (here, there):
        session.exclude(2)
        session.include(2)
        session.suggest()
        session.reject(state="abandoned")
    for call in ["joints", "status", "channels", "description", "model", "observations", "to_toml", "to_csv", "estimate"]:
        mine, its = (getattr(session, call) for session in (here, there))
        assert mine == its if call == "joints" else mine() == its(), call
    for call in ["to_urdf", "to_yaml", "report"]:
        assert getattr(here, call)() == getattr(there, call)(), call
    without = [{**suggestion, "expires_at_s": None} for suggestion in there.suggestions()]
    assert without == here.suggestions()
    postures = [Robot(7).anywhere() for _ in range(5)]
    assert here.predict(postures) == there.predict(postures)
    # From here to there, and back.
    here.save(tmp_path / "robot.json")
    moved = client.load(tmp_path / "robot.json")
    assert moved.save() == here.save() and moved.suggest() == here.suggest()
    moved.save(tmp_path / "back.json")
    assert body_schema.Session.load(tmp_path / "back.json").estimate() == here.estimate()


def test_both_have_the_same_methods() -> None:
    def methods(kind: type) -> set[str]:
        return {name for name in dir(kind) if not name.startswith("_")}

    opens = {"from_urdf", "from_config", "load"}
    assert methods(body_schema.Session) - opens == methods(body_schema.RemoteSession) - {"delete"}
    assert opens <= methods(body_schema.Client)


def test_many_observations_at_once(asking: Any) -> None:
    session, robot = opened(asking), Robot(21)
    follow(session, robot, 4)
    other = opened(asking)
    answers = other.add_many(it["told"] for it in session.observations())
    assert [it["observation"] for it in answers] == [1, 2, 3, 4] and other.suggestions() == []
    assert other.to_csv() == session.to_csv()
    at = robot.anywhere()
    good = {"configuration": at, "measurements": {"marker": robot.sees(at)}}
    with pytest.raises(body_schema.FieldError, match="1 before it are in") as refused:
        other.add_many([good, {"configuration": at, "measurements": {"marker": [1.0]}}, good])
    assert refused.value.field.startswith("observations[1].measurements") and len(other.observations()) == 5
    with pytest.raises(body_schema.FieldError, match="no configuration") as refused:
        other.add_many([{"marker": [0, 0, 0]}])
    assert refused.value.field == "observations[0]" and other.add_many([]) == []


def test_observations_as_a_data_frame(asking: Any) -> None:
    pytest.importorskip("pandas", reason="needs pandas: pip install pandas")
    session, robot = opened(asking), Robot(22)
    assert list(session.observations_dataframe().columns) == []
    follow(session, robot, 3)
    session.observe(robot.anywhere(), suggestion_id=None, marker=None)
    session.exclude(2)
    frame = session.observations_dataframe()
    assert list(frame["number"]) == [1, 2, 3, 4] and list(frame["excluded"]) == [False, True, False, False]
    assert list(frame["seen"]) == [True, True, True, False]
    # The same numbers as in the table, which leaves out what is excluded and what nothing was seen of.
    titles, *lines = session.to_csv().splitlines()
    rows = [[float(it) for it in line.split(",")] for line in lines if not line.endswith(",")]
    for row, index in zip(rows, (0, 2)):
        assert list(frame[titles.split(",")].iloc[index]) == pytest.approx(row)


def test_a_notebook_shows_how_it_stands(asking: Any) -> None:
    session, robot = opened(asking), Robot(23)
    assert "not yet" in session._repr_html_()
    follow(session, robot, 2)
    session.suggest()
    shown = session._repr_html_()
    assert "<td>pan, lift, elbow</td>" in shown and "<td>2</td>" in shown and "mm, wanted 2.00 mm" in shown and "pending" in shown


def test_what_every_channel_would_read_is_predicted(asking: Any) -> None:
    """A position as ``predict`` has it; a pose, pixels and a distance of the same body, which are told again without a surprise."""
    square = [[-0.03, -0.03, 0.0], [0.03, -0.03, 0.0], [0.03, 0.03, 0.0], [-0.03, 0.03, 0.0]]
    sensors = [
        {"channel": "position", "target": "tag", "sigma_m": 0.001},
        {"channel": "pose", "target": "tag", "sigma_m": 0.001, "sigma_deg": 0.1},
        {"channel": "distance", "target": "tag", "to_m": [0.0, 0.0, 1.0], "sigma_m": 0.001},
        {"channel": "pixels", "camera": "eye", "target": "tag", "sigma_px": 0.5},
    ]
    body = {"name": "tag", "at_m": [0.3, 0.0, 0.05], "rpy_deg": [0.0, 20.0, 0.0], "points_m": square}
    eye = {"name": "eye", "at_m": [1.6, 0.2, 1.2], "looks_at_m": [0.7, 0.0, 0.3], "size_px": [640, 480], "focal_px": 500.0}
    session = opened(asking, target=[{**body, "known": {"to_m": 0.01, "to_deg": 1.0}}], camera=[eye], sensor=sensors)
    home, away = dict.fromkeys(JOINTS, 0.1), {"pan": -1.5, "lift": -1.0, "elbow": 0.0}
    there, beside = session.predict_readings([home, [-1.5, -1.0, 0.0]], joints=JOINTS)
    names = [it["name"] for it in session.channels()]
    assert names == ["tag", "tag_2", "tag_distance", "eye_tag"] and there.keys() == set(names)
    assert there["tag"] == session.predict([home])[0] == pytest.approx(there["tag_2"]["position"])
    assert math.dist(there["tag"], [0.0, 0.0, 1.0]) == pytest.approx(there["tag_distance"])
    # All joints turn it: by 0.1 about z, then by 0.2 and the 20 degrees about y.
    pan, tilt = 0.05, 0.1 + math.radians(10.0)
    turn = [-math.sin(pan) * math.sin(tilt), math.cos(pan) * math.sin(tilt), math.sin(pan) * math.cos(tilt), math.cos(pan) * math.cos(tilt)]
    assert there["tag_2"]["quaternion"] == pytest.approx(turn)
    assert len(there["eye_tag"]) == 4 and beside["eye_tag"] is None and session.predict_readings([away])[0] == beside
    assert session.observe(home, measurements=there)["innovation_sigmas"] < 1e-3
    with pytest.raises(body_schema.FieldError, match="tell where every joint is"):
        session.predict_readings([{"pan": 0.0}])


def test_configurations_that_are_none_are_refused(asking: Any) -> None:
    session, at = opened(asking), {"pan": 0.1, "lift": 0.2, "elbow": 0.3}
    for of in (session.predict, session.predict_readings):
        for told, field in (
            ({**at, "nonsense": 1.0}, "nonsense"),
            ({**at, "lift": "abc"}, "lift"),
            ({**at, "lift": None}, "lift"),
            ({**at, "lift": math.nan}, "lift"),
        ):
            with pytest.raises(body_schema.FieldError) as caught:
                of([told])
            assert caught.value.field == f"configuration.{field}"


def test_pixels_come_as_opencv_gives_them(asking: Any) -> None:
    corners = [[-0.02, 0.02, 0.0], [0.02, 0.02, 0.0], [0.02, -0.02, 0.0], [-0.02, -0.02, 0.0]]
    seen = [[300.0, 200.0], [340.0, 200.0], [340.0, 240.0], [300.0, 240.0]]

    def fresh(**more: object) -> Any:
        tag = {"name": "tag", "link": "tip", "at_m": [0.0, 0.0, 0.0], "rpy_deg": [0.0, 0.0, 0.0], "points_m": corners, "known": "unknown", **more}
        camera = {"name": "cam", "size_px": [640, 480], "focal_px": 600, "known": "unknown"}
        sensor = {"channel": "pixels", "camera": "cam", "target": "tag", "sigma_px": 0.3}
        return asking.from_urdf(urdf(), "base", "tip", target=[tag], camera=[camera], sensor=sensor)

    def told(reading: object, **more: object) -> object:
        session = fresh(**more)
        session.observe(dict.fromkeys(JOINTS, 0.0), measurements={"cam_tag": reading})
        return session.observations()[0]["told"]["measurements"]["cam_tag"]

    assert told(seen) == told([seen]) == told([[it] for it in seen]) == told((tuple(seen),)) == seen
    gone = [seen[0], None, *seen[2:]]
    for reading in (gone, [seen[0], [math.nan, math.nan], *seen[2:]]):
        assert told(reading, partly_seen=True) == gone
        with pytest.raises(body_schema.FieldError, match="partly_seen"):
            told(reading)
    # Nothing tells where the whole stands.
    assert fresh().status()["up_to_motion"] is True


def test_a_plot_has_what_is_expected(asking: Any) -> None:
    pytest.importorskip("matplotlib").use("agg")
    session, robot = opened(asking), Robot(2)
    follow(session, robot, 6)
    lines = session.plot().get_lines()
    assert len(lines[0].get_xdata()) == 6 and lines[1].get_ydata()[0] == session.status()["wanted_mm"]
