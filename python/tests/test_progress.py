"""Long computations say how far they are, and end when they are told to."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import body_schema
from body_schema import Calibration, Session
from robot import Robot, calibration, urdf


def filled() -> Session:
    session, robot = Session.from_urdf(urdf(), "base", "tip", **calibration()), Robot(3)
    session.add_many([{"configuration": it, "measurements": {"marker": robot.sees(it)}} for it in (robot.anywhere() for _ in range(25))])
    return session


@pytest.fixture(scope="module")
def session() -> Session:
    return filled()


def calibrated(session: Session, folder: Path, **more: object) -> Calibration:
    (folder / "observations.csv").write_text(session.to_csv())
    (folder / "robot.urdf").write_text(urdf())
    (folder / "calibration.toml").write_text(session.to_toml())
    return body_schema.calibrate(folder / "calibration.toml", **more)


def test_progress_is_heard(session: Session, tmp_path: Path) -> None:
    for compute in (lambda hear: session.report(folds=5, progress=hear), lambda hear: calibrated(session, tmp_path, progress=hear)):
        heard: list[tuple[str, int, int]] = []
        compute(lambda *it: heard.append(it))
        assert len(heard) >= 2 and all(what and 0 <= done <= steps for what, done, steps in heard)
        # Within a stage it only grows.
        assert all(a[0] != b[0] or a[1] < b[1] for a, b in zip(heard, heard[1:]))


def test_whoever_listens_may_end_it(session: Session) -> None:
    class Enough(Exception):
        pass

    def hear(*_: object) -> None:
        raise Enough

    with pytest.raises(Enough):
        session.report(folds=5, progress=hear)
    # Nothing is lost.
    assert session.report(progress=False)["rows"] == 25


@pytest.fixture
def interruptible() -> Iterator[None]:
    """As at a terminal: what is begun in the background begins deaf to Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_it_at_once(session: Session, tmp_path: Path) -> None:
    # A hundred fits of random rows take long enough.
    for compute in (lambda: session.report(folds=20), lambda: calibrated(session, tmp_path, active=8)):
        sent: list[float] = []

        def interrupt() -> None:
            sent.append(time.monotonic())
            os.kill(os.getpid(), signal.SIGINT)

        timer = threading.Timer(0.1, interrupt)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            compute()
        assert time.monotonic() - sent[0] < 1.0
    assert session.status()["observations"] == 25


def test_a_bar_is_drawn_and_wiped(session: Session, capsys: pytest.CaptureFixture[str]) -> None:
    session.report(folds=5, progress=True)
    shown = capsys.readouterr()
    assert shown.out == "" and "[" in shown.err and "/" in shown.err
    assert shown.err.endswith("\r") and shown.err.rsplit("\r", 2)[-2].strip() == ""
    session.report()
    assert capsys.readouterr().err == ""
