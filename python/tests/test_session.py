"""What only a session here can do; what it has in common with one on a server is in ``test_both.py``."""

from __future__ import annotations

import copy
import inspect
import pickle
import threading
import time
from pathlib import Path

import body_schema
from body_schema import Session
from robot import calibration, urdf


def open_session(**more: object) -> Session:
    return Session.from_urdf(urdf(), "base", "tip", **{**calibration(), **more})


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
