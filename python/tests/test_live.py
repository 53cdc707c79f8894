"""A robot that stands here follows a session; it can refuse, see nothing, and be interrupted."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import pytest

import body_schema
from body_schema import live
from body_schema._play import _flat
from robot import JOINTS, Robot, calibration, urdf

QUICK: dict[str, Any] = {"still_s": 0.02, "rate_hz": 400.0, "say": lambda text: None}


class Moved:
    """The true arm behind motors that take some readings to arrive."""

    def __init__(self, seed: int) -> None:
        self.true = Robot(seed)
        self.at = dict.fromkeys(JOINTS, 0.0)
        self.target = dict(self.at)
        self.asked = 0

    def move_to(self, configuration: dict[str, float]) -> None:
        self.asked += 1
        if self.asked == 2:
            raise live.Unreachable("a cable is in the way")
        self.target = {name: it + 0.01 for name, it in configuration.items()}

    def read_joints(self) -> dict[str, float]:
        self.at = {name: it + 0.4 * (self.target[name] - it) for name, it in self.at.items()}
        return dict(self.at)

    def grab(self) -> Any:
        # Only where it was asked to go: what is seen before it has arrived would be seen elsewhere.
        assert max(abs(self.at[name] - self.target[name]) for name in JOINTS) < 0.01
        return "it is dark" if self.asked == 3 else {"marker": self.true.sees(self.at)}


def opened() -> body_schema.Session:
    return body_schema.Session.from_urdf(urdf(), "base", "tip", **calibration())


def test_suggestions_are_followed_until_it_is_enough(tmp_path: Path) -> None:
    session, robot = opened(), Moved(11)
    ended = live.run(session, robot, save=tmp_path / "session.json", movements=40, **QUICK)
    assert ended.why == "enough" and ended.rejected == 1 and ended.not_seen == 1
    assert ended.observed == session.status()["observations"] == robot.asked - 1
    states = [it["state"] for it in session.suggestions()]
    assert states[:4] == ["observed", "infeasible", "not_seen", "observed"]
    assert body_schema.Session.load(tmp_path / "session.json").events() == session.events()
    # What was executed counts, not what was asked.
    told = session.observations()[0]["told"]["configuration"]
    asked = session.suggestions()[0]["configuration"]
    assert all(abs(told[name] - asked[name] - 0.01) < 2e-3 for name in JOINTS)
    postures = [robot.true.anywhere() for _ in range(50)]
    errors = [math.dist(*pair) for pair in zip(session.predict(postures), map(robot.true.at, postures))]
    assert sum(errors) / 50 < 2e-3


def test_ctrl_c_leaves_a_saved_session(tmp_path: Path) -> None:
    class Interrupted(Moved):
        def grab(self) -> Any:
            if self.asked == 5:
                raise KeyboardInterrupt
            return super().grab()

    session = opened()
    ended = live.run(session, Interrupted(12), save=tmp_path / "session.json", **QUICK)
    assert ended.why == "interrupted" and ended.observed == 3
    loaded = body_schema.Session.load(tmp_path / "session.json")
    assert loaded.events() == session.events() and len(loaded.pending()) == 1
    # It goes on where it was.
    robot = Moved(12)
    robot.asked = 5
    assert live.run(loaded, robot, movements=2, **QUICK).observed == 2
    assert loaded.status()["observations"] == 5


def test_a_robot_that_never_stands_is_given_up_and_one_that_breaks_is_saved(tmp_path: Path) -> None:
    class Shaking(Moved):
        def read_joints(self) -> dict[str, float]:
            shake = 0.02 if self.asked == 1 else 0.0
            shaken = {name: it + shake * self.true._random.random() for name, it in self.at.items()}
            super().read_joints()
            return shaken

    session = opened()
    ended = live.run(session, Shaking(13), movements=1, timeout_s=0.2, **QUICK)
    assert ended.rejected == 2 and [it["state"] for it in session.suggestions()][0] == "abandoned"

    class Broken(Moved):
        def grab(self) -> Any:
            if self.asked == 3:
                raise OSError("the camera is gone")
            return super().grab()

    session = opened()
    with pytest.raises(OSError, match="gone"):
        live.run(session, Broken(14), save=tmp_path / "session.json", **QUICK)
    assert body_schema.Session.load(tmp_path / "session.json").status()["observations"] == 1


def test_a_robot_that_others_move() -> None:
    class ByHand:
        """It stands, is moved somewhere else than suggested, and then to what is suggested."""

        def __init__(self) -> None:
            self.true, self.reads, self.session = Robot(15), 0, opened()

        def read_joints(self) -> dict[str, float]:
            self.reads += 1
            pending = self.session.pending()
            if self.reads < 60 or not pending:
                return {"pan": 0.3, "lift": 0.2, "elbow": -0.4, "gripper": 1.0}
            return dict(pending[0]["configuration"])

        def grab(self) -> Any:
            at = self.read_joints()
            return {"marker": self.true.sees({name: at[name] for name in JOINTS})}

    robot = ByHand()
    ended = live.run(robot.session, robot, movements=2, still_s=0.02, rate_hz=400.0, say=lambda text: None)
    assert ended.observed == 2 and ended.rejected == 0
    told = [it["told"] for it in robot.session.observations()]
    assert told[0].get("suggestion_id") is None and told[1]["suggestion_id"] == 1
    assert [it["state"] for it in robot.session.suggestions()] == ["observed"]


def test_a_detector_looks_and_what_is_no_observation_is_refused() -> None:
    class Looks:
        def look(self, image: Any) -> Any:
            return image["found"] if image["found"] else "blurred"

    class Camera(Moved):
        def grab(self) -> Any:
            return {"found": None if self.asked == 1 else self.true.sees(self.at)}

    said: list[str] = []
    session = opened()
    ended = live.run(session, Camera(16), movements=3, detector=Looks(), still_s=0.02, rate_hz=400.0, say=said.append)
    assert ended.not_seen == 1 and any("nothing was seen: blurred" in text for text in said)

    class Nameless(Moved):
        def read_joints(self) -> dict[str, float]:
            return {"pan": 0.0}

    with pytest.raises(body_schema.FieldError, match="lift, elbow"):
        live.run(opened(), Nameless(17), **QUICK)

    class Picture(Moved):
        def grab(self) -> Any:
            return [1, 2, 3]

    with pytest.raises(body_schema.FieldError, match="hand over a detector"):
        live.run(opened(), Picture(18), **QUICK)


class Loose(Moved):
    """Gears with play: joints stand to that side of what they read from which they came. It refuses nothing, and sees in every light."""

    play = {"pan": 0.012, "lift": 0.008, "elbow": 0.0}

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.came = dict.fromkeys(JOINTS, 0.0)

    def move_to(self, configuration: dict[str, float]) -> None:
        came = {name: math.copysign(1.0, self.target[name] - it) for name, it in configuration.items() if it != self.target[name]}
        self.came, self.target, self.asked = {**self.came, **came}, dict(configuration), self.asked + 1

    def grab(self) -> Any:
        return {"marker": self.true.sees({name: it + self.came[name] * self.play[name] for name, it in self.at.items()})}


@pytest.mark.parametrize("seed", [1021, 1022])
def test_play_is_told_of_postures_that_are_approached_from_both_sides(seed: int) -> None:
    pytest.importorskip("numpy")
    said: list[str] = []
    session = opened()
    ended = live.run(session, Loose(seed), movements=24, both_sides_every=2, tolerance=1e-4, still_s=0.02, rate_hz=400.0, say=said.append)
    assert 6 <= ended.pairs and ended.observed == session.status()["observations"]
    print(ended.half_play)
    for name, it in ended.half_play.items():
        assert abs(it.value - Loose.play[name]) < max(4 * it.sd, 2e-4) and it.sd < 5e-3, (name, it)
    assert set(ended.half_play) == set(JOINTS)
    # What it does to the hand is what it does in truth, at postures of its own.
    true, rng = Loose(seed).true, random.Random(seed)
    moved = []
    for _ in range(200):
        at = {name: rng.uniform(-1.5, 1.5) for name in JOINTS}
        ends = [[true.at({**at, name: at[name] + by}) for by in (1e-4, -1e-4)] for name in JOINTS]
        moved.append(sum((math.dist(*pair) / 2e-4 * Loose.play[name]) ** 2 for pair, name in zip(ends, JOINTS)))
    assert ended.play_mm is not None and 0.6 < ended.play_mm / (1e3 * math.sqrt(sum(moved) / len(moved))) < 1.5, ended.play_mm
    assert any("it moves the hand by" in line for line in said)
    assert any(line.endswith("from below") for line in said) and any(line.startswith("play: joints stand") for line in said)
    # Without it nothing is approached from a side, and nothing told.
    assert not live.run(opened(), Loose(seed), movements=3, **QUICK).half_play


def test_play_needs_a_robot_that_moves() -> None:
    class Still:
        def read_joints(self) -> dict[str, float]:
            return dict.fromkeys(JOINTS, 0.0)

        def grab(self) -> Any:
            return {}

    with pytest.raises(body_schema.FieldError, match="no move_to"):
        live.run(opened(), Still(), both_sides_every=3, **QUICK)
    with pytest.raises(body_schema.FieldError, match="from 1"):
        live.run(opened(), Moved(1), both_sides_every=0, **QUICK)
    with pytest.raises(body_schema.FieldError, match="approach"):
        live.run(opened(), Moved(1), both_sides_every=2, approach=-0.07, **QUICK)


def test_readings_of_every_kind_are_numbers() -> None:
    np = pytest.importorskip("numpy")
    assert _flat(np.array([[1.0, 2.0], [3.0, 4.0]], np.float32)) == [1, 2, 3, 4] and _flat(np.array(0.5)) == [0.5]
    assert _flat("place/one") == [] and _flat({"position": [1, 2, 3], "quaternion": [0, 0, 0, 1]}) == [1, 2, 3]
    assert [math.isnan(it) for it in _flat([[1.0, 2.0], None])] == [False, False, True, True]


def test_a_robot_is_sent_nowhere_beside_a_posture_where_it_may_not_stand() -> None:
    """No posture 0.3 m above the table has one beside it that is lower, and none is told of play then."""
    pytest.importorskip("numpy")

    class Watched(Loose):
        lowest = math.inf

        def move_to(self, configuration: dict[str, float]) -> None:
            super().move_to(configuration)
            self.lowest = min(self.lowest, self.true.at(configuration)[2])

    session = body_schema.Session.from_urdf(urdf(), "base", "tip", **{**calibration(), "constraints": {"minimum_height_m": 0.3}})
    robot, said = Watched(1023), []
    live.run(session, robot, movements=10, both_sides_every=1, approach=0.2, still_s=0.02, rate_hz=400.0, say=said.append)
    assert any("may not be approached" in text for text in said), said
    assert robot.lowest > 0.28
