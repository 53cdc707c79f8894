"""The loop: ask for a posture, go there from a side, look, tell; some postures from both sides."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .._session import Session
from .._errors import Error
from ..live import Unreachable, standing
from ..vision import Detection
from ..exports._lerobot import MOTORS
from ._arm import Arm, Over, Recorder
from ._setup import APPROACH_DEG, Setup


MOST_REFUSED = 100
"""After so many postures in a row that cannot be reached the loop ends."""


FEWEST = 8
"""Movements with a view of the tag below which nothing is concluded."""


@dataclass(frozen=True)
class Stop:
    """A posture in which the arm stood: from which ``side`` all joints came (1 from above, -1 from below), what they read (rad), and what
    was seen.
    """

    posture: int
    side: int
    reading: dict[str, float]
    measurements: dict[str, Any]
    detection: Detection
    reason: str

    @property
    def seen(self) -> bool:
        """Whether the tag was seen whole."""
        return not self.reason


@dataclass
class Run:
    """What was measured, with the session that asked; ``why`` it ended: ``movements``, ``interrupted``, ``over`` (the end of a recording), ``broken``
    (by an error, which was told) or ``nothing`` (no posture is left)."""

    session: Session
    stops: list[Stop]
    why: str = "movements"


def measure(
    setup: Setup,
    arm: Arm,
    *,
    recorder: Recorder | None = None,
    still_s: float = 0.5,
    rate_hz: float = 50.0,
    say: Callable[[str], None] = print,
) -> Run:
    """Ask for postures until the arm has stood ``setup.movements`` times, and tell what was seen.

    Every posture is approached with all joints from one side, from below and from above in turn; every ``both_sides_every``-th from
    both, which are two movements. Ctrl-C ends it in order: what was measured stays.
    """
    session, watcher, tree = setup.session(), setup.watcher(), setup.tree()
    run = Run(session, [])
    posture = refused = 0
    try:
        while len(run.stops) < setup.movements:
            suggestions = session.suggest().get("suggestions")
            if not suggestions or refused > MOST_REFUSED:
                run.why = "nothing"
                break
            suggestion = suggestions[0]
            target: dict[str, float] = suggestion["configuration"]
            if why_not := setup.touches(tree, target):
                session.reject(suggestion["id"], state="infeasible", reason=why_not)
                refused += 1
                continue
            first = 1 if posture % 2 else -1
            both = posture % setup.both_sides_every == setup.both_sides_every - 1
            told = False
            for side in (first, -first) if both else (first,):
                if len(run.stops) >= setup.movements:
                    break
                words = " ".join(f"{name} {math.degrees(target[name]):+.1f}" for name in MOTORS)
                say(f"movement {len(run.stops) + 1} of {setup.movements}, from {'above' if side > 0 else 'below'}: {words} deg")
                try:
                    stop = _stop(setup, arm, watcher, target, side, posture, recorder, still_s, rate_hz, say)
                except Unreachable as why:
                    say(f"  not reachable: {why}")
                    refused += 1
                    if not told:
                        session.reject(suggestion["id"], state="infeasible", reason=str(why) or None)
                    told = True
                    break
                near = max(abs(stop.reading[name] - target[name]) for name in MOTORS) <= math.radians(3.0)
                answer = session.observe(
                    stop.reading, suggestion_id=suggestion["id"] if near and not told else None, measurements=stop.measurements
                )
                if not near and not told:
                    session.reject(suggestion["id"], state="abandoned", reason="it stood elsewhere")
                told, refused = True, 0
                run.stops.append(stop)
                expected = answer.get("expected_error_mm")
                if stop.seen:
                    say("  the tag is seen" + (f"; {expected:.2f} mm are expected" if expected is not None else ""))
                else:
                    say(f"  nothing is seen: {stop.reason}")
                    break
            posture += 1
    except KeyboardInterrupt:
        run.why = "interrupted"
        say("interrupted: what was measured is kept")
    except Over as over:
        run.why = "over"
        say(str(over))
    except (Error, OSError) as error:
        if len(run.stops) < FEWEST:
            raise
        run.why = "broken"
        say(f"ended by an error: {error}; what was measured is kept")
    return run


def _stop(
    setup: Setup,
    arm: Arm,
    watcher: Any,
    target: Mapping[str, float],
    side: int,
    posture: int,
    recorder: Recorder | None,
    still_s: float,
    rate_hz: float,
    say: Callable[[str], None],
) -> Stop:
    """Go to a posture from a side, wait until the arm stands, and look."""
    arm.move_to({name: target[name] + side * math.radians(APPROACH_DEG) for name in MOTORS})
    arm.move_to(target)
    for _ in range(5):
        at = standing(arm, list(MOTORS), still_s, 4e-3, rate_hz, 10.0, None)
        if at is None:
            raise Unreachable("it does not stand within 10 s")
        # The last digits of a mean depend on how often it was read; a recording is to repeat the run.
        at = {name: round(it, 9) for name, it in at.items()}
        picture = arm.grab()
        after = arm.read_joints()
        if max(abs(after[name] - at[name]) for name in MOTORS) <= 8e-3:
            break
        say("  it moved while it was looked at: once more")
    else:
        raise Unreachable("it moves while it is looked at")
    if recorder is not None:
        recorder.keep(at, picture)
    look = watcher.look(picture)
    return Stop(posture, side, at, look.measurements, look.detection, "" if look.seen else look.reason or "no tag")
