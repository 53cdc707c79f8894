"""What only a session here can do; what it has in common with one on a server is in ``test_both.py``."""

from __future__ import annotations

import copy
import inspect
import pickle
import subprocess
import threading
import time
from pathlib import Path

import body_schema
import pytest
from body_schema import Session
from robot import Robot, calibration, urdf


def open_session(**more: object) -> Session:
    return Session.from_urdf(urdf(), "base", "tip", **{**calibration(), **more})


CUBE = "".join(f"v {x} {y} {z}\n" for z in (-0.5, 0.5) for x, y in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)))
CUBE += "f 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"


def test_meshes_beside_a_urdf_say_how_thick_its_links_are(tmp_path: Path) -> None:
    text = urdf()
    for link, scale in (("base", "0.6 0.6 0.2"), ("tip", "0.1 0.1 0.1")):
        mesh = f'<mesh filename="package://three/meshes/cube.obj" scale="{scale}"/>'
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}"><collision><geometry>{mesh}</geometry></collision></link>')
    (tmp_path / "three.urdf").write_text(text)
    onto_the_base = {"pan": 0.0, "lift": 1.4, "elbow": -0.3}
    # As text it has no place beside which meshes could be, and without them the base is a frame.
    for bare in (text, tmp_path / "three.urdf"):
        Session.from_urdf(bare, "base", "tip", **calibration()).enqueue([onto_the_base])
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "cube.obj").write_text(CUBE)
    session = Session.from_urdf(tmp_path / "three.urdf", "base", "tip", **calibration())
    with pytest.raises(body_schema.FieldError, match="`base` would be 0.000 m apart, nearer than the clearance"):
        session.enqueue([onto_the_base])
    session.enqueue([{**onto_the_base, "lift": 0.3}])
    # It stays so in a file, and on another machine.
    session.save(tmp_path / "kept.json")
    with pytest.raises(body_schema.FieldError, match="`base` would be 0.000 m apart"):
        Session.load(tmp_path / "kept.json").enqueue([onto_the_base])
    # The calibration file for its observations is about rows that have been measured.
    assert "shapes" not in session.to_toml()


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


def test_sessions_are_copied_and_pickled() -> None:
    session = open_session()
    session.observe({joint: 0.2 for joint in session.joints}, marker=[0.5, 0.1, 0.4])
    for again in (copy.copy(session), copy.deepcopy(session), pickle.loads(pickle.dumps(session))):
        assert again.events() == session.events() and again.status() == session.status()
        # It is another one.
        again.observe({joint: 0.3 for joint in again.joints}, marker=None)
        assert len(again.observations()) == len(session.observations()) + 1


def test_the_command_calibrates_and_watches_what_was_saved(binary: Path, tmp_path: Path) -> None:
    session, robot = open_session(), Robot(3)
    for posture in [robot.anywhere() for _ in range(24)]:
        session.observe(posture, marker=robot.sees(posture))
    session.save(tmp_path / "session.json")
    later = open_session()
    for posture in [robot.anywhere() for _ in range(8)]:
        later.observe(posture, marker=robot.sees(posture))
    later.to_csv(tmp_path / "later.csv")

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run([binary, *map(str, words)], capture_output=True, text=True, cwd=tmp_path)

    assert "24 rows" in run("calibrate", tmp_path / "session.json", "--json", tmp_path / "report.json").stdout
    ran = run("watch", tmp_path / "session.json", "--table", tmp_path / "later.csv")
    assert ran.returncode == 0 and "after 8 sightings" in ran.stdout, ran
    (tmp_path / "other.json").write_text('{"a": 1}')
    ran = run("watch", tmp_path / "other.json", "--table", tmp_path / "later.csv")
    assert ran.returncode == 2 and "the session" in ran.stderr, ran
