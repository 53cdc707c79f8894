"""Sessions here: asked, told, refused, kept."""

from __future__ import annotations

import inspect
import math
import threading
import time
from pathlib import Path

import pytest

import body_schema
from body_schema import Session
from robot import JOINTS, Robot, calibration, urdf


def open_session(**more: object) -> Session:
    return Session.from_urdf(urdf(), "base", "tip", **{**calibration(), **more})


def follow(session: Session, robot: Robot, movements: int) -> dict[str, object]:
    answer: dict[str, object] = {}
    for _ in range(movements):
        target = session.suggest()["suggestions"][0]["configuration"]
        answer = session.observe(target, marker=robot.sees(target))
    return answer


def mean_error_mm(session: Session, robot: Robot) -> float:
    postures = [robot.anywhere() for _ in range(100)]
    pairs = zip(session.predict(postures), map(robot.at, postures))
    return sum(math.dist(*pair) for pair in pairs) / len(postures) * 1e3


def test_following_the_prompts_learns_the_robot(tmp_path: Path) -> None:
    session, robot = open_session(), Robot(1)
    answer = follow(session, robot, 20)
    assert answer["observation"] == 20 and answer["seen"] and answer["body_seems_changed"] is False
    assert mean_error_mm(session, robot) < 1.0
    enough = session.suggest()["enough"]
    assert enough["expected_error_mm"] < enough["wanted_mm"] == 2.0
    assert session.status()["observations"] == 20
    text = session.to_urdf(tmp_path / "out.urdf")
    assert (tmp_path / "out.urdf").read_text() == text != urdf()
    assert session.to_yaml().startswith("kinematics:\n  pan:\n")
    report = session.report()
    assert report["rows"] == 20 and report["held_out"]["after"]["mean_mm"] < report["held_out"]["before"]["mean_mm"]
    assert session.to_csv().splitlines()[0] == "pan,lift,elbow,marker_x,marker_y,marker_z"
    assert "observations.csv" in session.to_toml()


def test_a_saved_session_goes_on(tmp_path: Path) -> None:
    session, robot = open_session(), Robot(2)
    follow(session, robot, 6)
    pending = session.suggest(2)
    session.save(tmp_path / "session.json")
    loaded = Session.load(tmp_path / "session.json")
    assert loaded.events() == session.events()
    assert loaded.estimate() == session.estimate()
    assert loaded.suggest(2) == pending
    before = loaded.estimate()
    loaded.exclude(3)
    assert loaded.estimate() != before and loaded.status()["excluded"] == [3]
    loaded.include(3)
    assert loaded.estimate() == before


def test_rejections() -> None:
    session = open_session()
    first = session.suggest()["suggestions"][0]
    assert session.reject(reason="the cable is too short")["state"] == "infeasible"
    second = session.suggest()["suggestions"][0]
    assert second["configuration"] != first["configuration"]
    assert session.reject(second["id"], state="abandoned")["state"] == "abandoned"
    with pytest.raises(body_schema.ConflictError, match="not pending"):
        session.reject(second["id"])
    with pytest.raises(body_schema.NotFoundError):
        session.reject(99)
    with pytest.raises(body_schema.FieldError, match="nothing is pending"):
        session.reject()
    assert [it["state"] for it in session.suggestions()] == ["infeasible", "abandoned"]


def test_what_is_observed_carries_out_the_oldest_suggestion_unless_told_otherwise() -> None:
    session, robot = open_session(), Robot(3)
    first, second = session.suggest(2)["suggestions"]
    session.observe(robot.anywhere(), suggestion_id=None, marker=None)
    assert len(session.pending()) == 2
    session.observe(list(second["configuration"][name] for name in JOINTS), suggestion_id=second["id"], marker=robot.sees(second["configuration"]))
    session.observe(first["configuration"], measurements={"marker": None})
    assert [it["state"] for it in session.suggestions()] == ["not_seen", "observed"]
    other = session.suggest(client="other")["suggestions"][0]
    session.observe(robot.anywhere(), marker=None)
    assert session.pending("other") == [other]


@pytest.mark.parametrize(
    ("configuration", "channels", "field"),
    [
        ({"pan": 0.0, "lift": 0.0}, {}, "configuration.elbow"),
        ([0.0, 0.0], {}, "configuration"),
        ([0.0, 0.0, 90.0], {}, "configuration.elbow"),
        ([0.0, 0.0, 0.0], {"marker": [1.0, 2.0]}, "measurements.marker"),
        ([0.0, 0.0, 0.0], {"maker": [1.0, 2.0, 3.0]}, "measurements.maker"),
        ([0.0, 0.0, math.nan], {}, "observation"),
        ([0.0, 0.0, object()], {}, "observation"),
    ],
)
def test_exceptions_name_the_field(configuration: object, channels: dict[str, object], field: str) -> None:
    session = open_session()
    with pytest.raises(body_schema.FieldError) as refused:
        session.observe(configuration, **channels)
    assert refused.value.field == field and refused.value.mend
    assert isinstance(refused.value, ValueError) and session.events() == []


def test_wrong_setups_name_the_key() -> None:
    for more, field in [
        ({"prior": {"point_m": -1}}, "prior.point_m"),
        ({"sensr": {}}, "sensr"),
        ({"robot": {"tip": "hand"}}, "robot.urdf"),
        ({"agent": "glbal"}, "agent"),
        ({"measurements": {"file": "a.csv"}}, "measurements"),
    ]:
        with pytest.raises(body_schema.FieldError) as refused:
            open_session(**more)
        assert refused.value.field == field
    with pytest.raises(body_schema.FieldError, match="`urdf`"):
        Session.from_urdf("missing.urdf")


def test_configurations_of_files(tmp_path: Path) -> None:
    (tmp_path / "three.urdf").write_text(urdf())
    (tmp_path / "three.toml").write_text(
        'name = "three"\n[robot]\nurdf = "three.urdf"\n[measurements]\nfile = "a.csv"\n[prior]\ndirection_rad = 0.02\npoint_m = 0.01\n'
    )
    session = Session.from_config(tmp_path / "three.toml", agent="smoother:random", seed=4)
    assert session.joints == JOINTS and session.description()["scenario"] == "three"
    assert session.channels() == [{"name": "marker", "channel": "position"}]
    same = Session.from_config({"robot": {"urdf": urdf()}, "prior": {"direction_rad": 0.02, "point_m": 0.01}}, agent="smoother:random", seed=4)
    assert same.suggest()["suggestions"] == session.suggest()["suggestions"]
    with pytest.raises(body_schema.FieldError, match="missing.toml"):
        Session.from_config(tmp_path / "missing.toml")
    with pytest.raises(FileNotFoundError):
        Session.load(tmp_path / "missing.json")
    with pytest.raises(body_schema.EngineError, match="no session"):
        (tmp_path / "empty.json").write_text("{}")
        Session.load(tmp_path / "empty.json")
    with pytest.raises(body_schema.EngineError, match="nothing was observed"):
        session.to_urdf()


def test_other_threads_run_while_it_plans() -> None:
    session = open_session(selection={"evaluations": 4000, "ahead": 12})
    ticks, done = [], threading.Event()

    def tick() -> None:
        while not done.wait(0.001):
            ticks.append(time.perf_counter())

    ticking = threading.Thread(target=tick)
    ticking.start()
    # How long a plan takes and how often a busy machine wakes a thread are not promised. Whoever holds the interpreter
    # throughout a call lets at most one tick in as it begins and one as it ends.
    most = 0
    for _ in range(200):
        start = time.perf_counter()
        session.suggest(3)
        end = time.perf_counter()
        most = max(most, sum(start < at < end for at in ticks))
        if most > 2:
            break
    done.set()
    ticking.join()
    assert most > 2


def test_everything_that_is_public_is_documented() -> None:
    for name in body_schema.__all__:
        public = getattr(body_schema, name)
        assert name == "__version__" or inspect.getdoc(public), name
        if inspect.isclass(public):
            for member, value in inspect.getmembers(public, inspect.isfunction):
                assert member.startswith("_") or inspect.getdoc(value), f"{name}.{member}"
    assert (Path(body_schema.__file__).parent / "py.typed").exists()
