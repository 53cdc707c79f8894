"""A session with a robot that stands here: suggest, move, wait until it stands, look, observe.

Nothing of ROS is needed: a robot is any object that tells where its joints are and what its sensors see.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Protocol

from ._errors import Error, FieldError, wrong
from ._play import HalfPlay, Stop, half_play, numpy, play_mm
from ._words import Asking


class Unreachable(Exception):
    """Raised by a robot that cannot go where it is asked to; its text says why."""


class Robot(Protocol):
    """A robot. It may have ``move_to(configuration)`` too, which starts a movement to joint positions by name (rad, m) and may raise
    ``Unreachable``; without it somebody else moves the robot, by hand or by another program."""

    def read_joints(self) -> Mapping[str, float]:
        """Where the joints are now, by name, rad or m."""

    def grab(self) -> Any:
        """What the sensors see now, as ``session.observe(measurements=…)`` takes it; a text says why nothing is seen.

        Where a detector looks, it is the picture.
        """


class Detector(Protocol):
    """What finds a target in a picture."""

    def look(self, image: Any) -> Any:
        """The reading that ``session.observe`` takes, or the reason why there is none, as text.

        What has ``measurements`` by channel and a ``reason``, as a ``body_schema.vision.Look`` has, is taken too.
        """


@dataclass
class Ended:
    """How a run ended. ``why`` is ``enough``, ``movements`` (as many as were asked for), ``interrupted`` (Ctrl-C) or ``nothing`` (the
    session has nothing to suggest)."""

    why: str
    observed: int
    rejected: int
    not_seen: int
    half_play: dict[str, HalfPlay] = field(default_factory=dict)
    """By joint, how far it stands to either side of what it reads, rad or m; empty where fewer than two postures were seen from both sides."""
    pairs: int = 0
    """How many postures were seen from both sides."""
    play_mm: float | None = None
    """By how much the play moves the hand, root mean square over the postures, mm: no calibration predicts it better, unless it is known from where
    the joints come. ``None`` where no play is told."""


def run(
    session: Asking,
    robot: Robot,
    *,
    movements: int | None = None,
    save: str | PathLike[str] | None = None,
    detector: Detector | None = None,
    channel: str | None = None,
    still_s: float = 0.5,
    tolerance: float = 2e-3,
    near: float = 0.1,
    rate_hz: float = 50.0,
    timeout_s: float = 60.0,
    both_sides_every: int | None = None,
    approach: float = 0.07,
    say: Callable[[str], None] = print,
) -> Ended:
    """Follow the session's suggestions until it has enough, or ``movements`` were observed.

    Each suggestion is handed to ``robot.move_to``, where there is one, and told by ``say``. The robot stands where no joint has moved by
    more than ``tolerance`` (rad, m) for ``still_s`` seconds; joints are read ``rate_hz`` times a second, and their mean while it stood
    is what is observed. Where the robot stands further than ``near`` (rad, m) from what was suggested, it was no suggestion that was
    carried out: without ``move_to`` the suggestion stays pending, and a new posture is waited for; with it the movement is observed by
    itself and the suggestion abandoned. What raises ``Unreachable`` is rejected as ``infeasible``; a robot with ``move_to`` that does
    not stand within ``timeout_s`` is told, and its suggestion abandoned.

    With ``both_sides_every`` every posture is approached from one side: the robot goes to where all joints are ``approach`` (rad, m)
    beside it first, above and below in turn, where limits and constraints allow it; every so many-th posture is approached from the
    other side as well, which is an observation more. What a joint differs by between the two is its play, of which ``half_play`` is told
    at the end; ``tolerance`` has to be small beside it. That needs a robot with ``move_to``, and numpy.

    With ``detector`` what ``robot.grab`` gives is a picture, and what the detector finds is the reading of ``channel``, the session's
    first unless told otherwise. ``save`` is a file to which the session is saved after every observation and at the end, however that
    comes; after Ctrl-C the run ends in order.

    Raises ``FieldError`` where what the robot tells is no observation of this session.
    """
    names = session.joints
    if detector is not None and channel is None:
        channel = str(session.channels()[0]["name"])
    moves: Callable[[dict[str, float]], object] | None = getattr(robot, "move_to", None)
    waits = (names, still_s, tolerance, rate_hz, timeout_s if moves is not None else None)
    if both_sides_every is not None:
        if moves is None or both_sides_every < 1:
            what = "the robot has no move_to" if moves is None else f"{both_sides_every} is no number of postures"
            raise wrong("both_sides_every", what, "write a whole number from 1 for a robot that moves by itself, or leave it out")
        if not 0 < approach <= 1:
            raise wrong("approach", f"{approach!r} is no way to a posture", "write how far beside it the last movement begins, rad or m, at most 1")
        numpy()
    limits = _limits(session) if both_sides_every is not None else {}
    ended = Ended("movements", 0, 0, 0)
    stops: list[Stop] = []
    again: tuple[dict[str, float], int] | None = None
    posture = 0
    stood: dict[str, float] | None = None
    try:
        while movements is None or ended.observed < movements:
            suggestion: Any = None
            if again is None:
                asked = session.suggest()
                if "enough" in asked:
                    ended.why = "enough"
                    break
                if not asked.get("suggestions"):
                    ended.why = "nothing"
                    break
                suggestion = asked["suggestions"][0]
                posture += 1
            target: dict[str, float] = dict(suggestion["configuration"]) if again is None else again[0]
            side = 0 if both_sides_every is None else again[1] if again is not None else 1 - 2 * (posture % 2)
            from_side = f", from {'above' if side > 0 else 'below'}" if side else ""
            say("go to " + ", ".join(f"{name} {target[name]:+.3f}" for name in names) + from_side)
            again = None
            sides: dict[str, int] = {}
            try:
                if moves is not None and side:
                    sides = _approached(session, robot, moves, target, side, approach, limits, waits, say)
                if moves is not None:
                    moves(target)
                at = standing(robot, *waits, stood if moves is None else None)
                while at is not None:
                    seen = robot.grab()
                    after = _positions(robot, names)
                    if max(abs(after[name] - at[name]) for name in names) <= 2.0 * tolerance:
                        break
                    say("it moved while it was looked at: once more")
                    at = standing(robot, *waits, None)
            except Unreachable as why:
                if suggestion is not None:
                    session.reject(suggestion["id"], state="infeasible", reason=str(why) or None)
                    ended.rejected += 1
                say(f"not reachable: {why}")
                continue
            if at is None:
                if suggestion is not None:
                    session.reject(suggestion["id"], state="abandoned", reason=f"it did not stand within {timeout_s:g} s")
                    ended.rejected += 1
                say(f"it did not stand within {timeout_s:g} s; another one")
                continue
            stood = at
            measurements, reason = _reading(seen, detector, channel)
            away = max(abs(at[name] - target[name]) for name in names)
            carried_out = suggestion is not None and away <= near
            answer = session.observe(at, suggestion_id=suggestion["id"] if carried_out else None, measurements=measurements)
            if suggestion is not None and not carried_out and moves is not None:
                session.reject(suggestion["id"], state="abandoned", reason=f"it stood {away:.2f} rad or m away")
            ended.observed += 1
            ended.not_seen += not answer["seen"]
            if answer["seen"] and sides:
                stops.append(Stop(posture, sides, at, measurements))
                if both_sides_every is not None and suggestion is not None and posture % both_sides_every == 0:
                    again = (target, -side)
            if save is not None:
                _save(session, save)
            told = f"{answer['expected_error_mm']:.2f} mm are expected" if answer.get("expected_error_mm") is not None else "observed"
            say(f"movement {answer['observation']}: " + (told if answer["seen"] else f"nothing was seen{': ' + reason if reason else ''}"))
    except KeyboardInterrupt:
        ended.why = "interrupted"
        say("interrupted")
    finally:
        if save is not None:
            _save(session, save)
    if both_sides_every is None:
        return ended
    try:
        ended.half_play, ended.pairs = half_play(session, stops)
        ended.play_mm = play_mm(session, stops, ended.half_play)
    except Error as error:
        say(f"play: not told: {error}")
        return ended
    if ended.half_play:
        its = ", ".join(f"{name} {it.value:.4f} ± {it.sd:.4f}" for name, it in ended.half_play.items())
        say(f"play: joints stand to either side of what they read by (rad, m; {ended.pairs} postures from both sides) {its}")
        if ended.play_mm is not None:
            say(
                f"play: it moves the hand by {ended.play_mm:.2f} mm (rms): no calibration comes below that, unless joints come to every posture from one side"
            )
    else:
        say(f"play: not told by {ended.pairs} postures that were seen from both sides")
    return ended


def _approached(
    session: Asking,
    robot: Robot,
    moves: Callable[[dict[str, float]], object],
    target: dict[str, float],
    side: int,
    approach: float,
    limits: Mapping[str, tuple[float, float]],
    waits: tuple[list[str], float, float, float, float | None],
    say: Callable[[str], None],
) -> dict[str, int]:
    """Go beside a posture, so that all joints come to it from a side; gives the side of each. A joint whose range ends before comes from the other one.
    Empty where the robot may not or does not stand there: the posture is approached from anywhere then.
    """
    sides = {name: side if limits[name][0] <= at + side * approach <= limits[name][1] else -side for name, at in target.items()}
    beside = {name: at + sides[name] * approach for name, at in target.items()}
    try:
        # It is held against limits, constraints and the robot itself as any posture that somebody wants.
        for it in session.enqueue([beside], client="approach")["suggestions"]:
            session.reject(it["id"], state="abandoned", reason="beside a posture, to approach it from a side")
        moves(beside)
        if standing(robot, *waits, None) is not None:
            return sides
        say("  it did not stand beside it")
    except FieldError as error:
        say(f"  it may not be approached from there: {error.what}")
    except Unreachable as why:
        say(f"  not reachable from there: {why}")
    return {}


def _limits(session: Asking) -> dict[str, tuple[float, float]]:
    """The limits of every joint, rad or m."""
    return {it["name"]: (float(it["limits"][0]), float(it["limits"][1])) for it in session.description()["joints"]}


def _positions(robot: Robot, names: list[str]) -> dict[str, float]:
    read = robot.read_joints()
    if missing := [name for name in names if name not in read]:
        what = f"the robot does not tell {', '.join(missing)}, but {', '.join(map(str, read)) or 'nothing'}"
        raise FieldError(f"`configuration`: {what}; tell every joint by its name", "configuration", what, "tell every joint by its name")
    return {name: float(read[name]) for name in names}


def standing(
    robot: Robot,
    names: list[str],
    still_s: float,
    tolerance: float,
    rate_hz: float,
    timeout_s: float | None,
    left: dict[str, float] | None,
) -> dict[str, float] | None:
    """The mean position once the robot has stood for ``still_s``, elsewhere than at ``left``; none after ``timeout_s``."""
    began = time.monotonic()
    window: deque[tuple[float, dict[str, float]]] = deque()
    while True:
        now = time.monotonic()
        if timeout_s is not None and now - began > timeout_s:
            return None
        window.append((now, _positions(robot, names)))
        while len(window) > 2 and now - window[1][0] >= still_s:
            window.popleft()
        # What is no number compares with nothing, and never stands.
        whole = len(window) > 2 and now - window[0][0] >= still_s
        if whole and all(max(it[name] for _, it in window) - min(it[name] for _, it in window) <= tolerance for name in names):
            mean = {name: sum(it[name] for _, it in window) / len(window) for name in names}
            if left is None or max(abs(mean[name] - left[name]) for name in names) > 5.0 * tolerance:
                return mean
        time.sleep(1.0 / rate_hz)


def _reading(seen: Any, detector: Detector | None, channel: str | None) -> tuple[dict[str, Any], str]:
    """What ``observe`` takes, and why there is none."""
    if detector is not None and seen is not None and not isinstance(seen, str):
        looked = detector.look(seen)
        if hasattr(looked, "measurements"):
            return {name: it for name, it in looked.measurements.items() if it is not None}, str(looked.reason)
        seen = looked if looked is None or isinstance(looked, str) else {str(channel): looked}
    if seen is None or isinstance(seen, str):
        return {}, seen or ""
    if not isinstance(seen, Mapping):
        what = f"`grab` gave {type(seen).__name__}"
        mend = "give readings by channel, a text that says why there are none, or hand over a detector"
        raise FieldError(f"`measurements`: {what}; {mend}", "measurements", what, mend)
    return dict(seen), ""


def _save(session: Asking, path: str | PathLike[str]) -> None:
    """Save it whole or not at all: what was saved before is there until the new one is."""
    part = f"{fspath(path)}.part"
    try:
        Path(part).write_bytes(session.save().encode("utf-8"))
        os.replace(part, path)
    except OSError as error:
        raise Error(f"the session cannot be saved to {fspath(path)}: {error.strerror}; name another file with save=") from None
