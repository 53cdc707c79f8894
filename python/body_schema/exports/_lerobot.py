"""The calibration file of a LeRobot arm: what it says of every motor, and what true zeros make of it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from .._errors import wrong
from ._calibrated import Calibrated

MOTORS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
"""The motors of an arm, base first, as LeRobot calls them; ``gripper`` is the sixth and moves no part of the chain."""
STEPS_PER_DEG = 4095 / 360
"""Steps of a motor's encoder to a degree, as LeRobot counts them."""
GREATEST_OFFSET = 2047
"""The homing offset is eleven bits and a sign in the motor: LeRobot refuses to write more."""
NUMBERS = ("homing_offset", "range_min", "range_max")


@dataclass(frozen=True)
class Range:
    """A shorter range (steps) whose middle is the true zero, for a motor whose homing offset cannot be moved that far."""

    range_min: int
    range_max: int


@dataclass(frozen=True)
class Calibration:
    """The content of a calibration file, by motor."""

    source: str
    motors: Mapping[str, Mapping[str, Any]]

    def half_range_deg(self, motor: str) -> float:
        """How far the motor turns to either side of 0 degrees, the middle of its range."""
        its = self.motors[motor]
        return float(its["range_max"] - its["range_min"]) / 2 / STEPS_PER_DEG

    def to_json(self) -> str:
        """The file as LeRobot writes it."""
        return json.dumps(self.motors, indent=4) + "\n"

    def shifted(self, offsets_deg: Mapping[str, float]) -> tuple[Calibration, dict[str, int], dict[str, Range]]:
        """The calibration by which motors are where their readings say, given by how many degrees they are beyond.

        Feetech motors tell ``Present_Position = Actual_Position - Homing_Offset``: an offset of δ degrees comes off ``homing_offset``.
        ``range_min`` and ``range_max`` stay, since the middle between them is 0 degrees; motors that are not named stay whole. Gives the
        calibration, the change of each homing offset in steps, and the motors whose homing offset would be beyond ± 2047, which stay as
        they are, with a shorter range around their true zero.
        """
        motors = {name: dict(its) for name, its in self.motors.items()}
        moved: dict[str, int] = {}
        beyond: dict[str, Range] = {}
        for name, offset in offsets_deg.items():
            its = motors[name]
            steps = -round(offset * STEPS_PER_DEG)
            if abs(its["homing_offset"] + steps) > GREATEST_OFFSET:
                zero = (its["range_min"] + its["range_max"]) / 2 - offset * STEPS_PER_DEG
                half = min(zero - its["range_min"], its["range_max"] - zero)
                beyond[name] = Range(round(zero - half), round(zero + half))
            else:
                its["homing_offset"] += steps
                moved[name] = steps
        return Calibration(self.source, motors), moved, beyond


def read_calibration(path: str | PathLike[str]) -> Calibration:
    """The calibration file that LeRobot wrote of an SO-100 or SO-101. Raises ``FieldError`` where it is none."""
    return of_motors(read_json(Path(path), "--calibration", "name the file that lerobot-calibrate wrote"), str(path))


def read_json(path: Path, option: str, mend: str) -> Any:
    """The JSON of a file. Raises ``FieldError`` of the ``option`` that named it, with how to ``mend`` it, where it cannot be read."""
    try:
        return json.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        raise wrong(option, f"{path}: {error.strerror}", mend) from None
    except (ValueError, RecursionError) as error:
        raise wrong(option, f"{path} is no JSON ({error})", mend) from None


def of_motors(told: Any, source: str, option: str = "--calibration") -> Calibration:
    """A calibration of the content of its file, which ``option`` named."""
    if not isinstance(told, dict) or not all(isinstance(it, dict) for it in told.values()):
        raise wrong(option, f"{source} has no motors by name", "name the file that lerobot-calibrate wrote")
    if missing := [name for name in MOTORS if name not in told]:
        what = f"{source} has no {', '.join(missing)}, but {', '.join(map(str, told)) or 'nothing'}"
        raise wrong(option, what, "name the file of an SO-100 or SO-101 follower")
    for name, its in told.items():
        for key in NUMBERS:
            value = its.get(key)
            if isinstance(value, bool) or not isinstance(value, int) or abs(value) > 4095:
                raise wrong(f"{option}: {name}.{key}", f"{value!r} is no number of steps", "run lerobot-calibrate again")
        if its["range_max"] - its["range_min"] < 10 * STEPS_PER_DEG and name in MOTORS:
            mend = "run lerobot-calibrate again, and move it from end to end"
            raise wrong(f"{option}: {name}", "its range is below 10 degrees", mend)
    return Calibration(source, told)


def by_hand(name: str, shorter: Range) -> str:
    """What is left to be done of a motor whose homing offset cannot be moved that far."""
    return (
        f"{name} would need a homing offset beyond ± {GREATEST_OFFSET} steps, which LeRobot refuses: its offset is kept; write range_min "
        f"{shorter.range_min} and range_max {shorter.range_max}, a shorter range around its true zero"
    )


def lerobot(calibrated: Calibrated, text: str, *, source: str = "calibration") -> tuple[str, list[str], list[str]]:
    """A calibration file of LeRobot with the homing offsets that make zeros true, of what ``calibrate`` found in a recording.

    A motor's offset (``joints[].offset`` of the report, deg) comes off its ``homing_offset``, in steps of 360 / 4095 degrees; ranges stay.
    What the rows do not determine is a convention, and is left as it is. Gives the new text, what is left to be done by hand, and what is
    to be known. Raises ``FieldError`` where the file is none of an SO-100 or SO-101, or no zero of its motors was learned.
    """
    try:
        told = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise wrong("--file", f"{source} is no JSON ({error})", "name the file that lerobot-calibrate wrote") from None
    before = of_motors(told, source, "--file")
    report = calibrated.need_report()
    joints = {it.get("name"): it for it in report.get("joints", []) if isinstance(it, dict)}
    learned = {name: joints[name]["offset"] for name in MOTORS if isinstance(joints.get(name, {}).get("offset"), dict)}
    if not learned:
        what = f"no zero of {', '.join(MOTORS)} was learned"
        raise wrong(str(calibrated.source), what, 'calibrate with learn = "zeros" under [robot], as `import` writes it')
    undetermined = (report.get("parameters") or {}).get("undetermined") or []
    conventions = [name for name in learned if any(re.search(rf"\b{name}\b", it) for it in undetermined)]
    zeros = {name: float(its["value"]) for name, its in learned.items() if name not in conventions}
    after, moved, beyond = before.shifted(zeros)
    known = {name: f"{zeros[name]:+.2f} ± {float(learned[name]['sd']):.2f} deg" for name in zeros}
    said = [f"{name}: {known[name]}, homing offset {steps:+d} steps" for name, steps in moved.items()]
    said += [f"{name}: its zero is a convention, which these rows do not determine; left as it is" for name in conventions]
    said += [f"{name}: its zero was not learned; left as it is" for name in MOTORS if name not in learned]
    if turned := [name for name in MOTORS if joints.get(name, {}).get("learned")]:
        said.append(f"links were learned, too ({', '.join(turned)}): homing offsets hold zeros alone, and calibrated.urdf has both")
    said.append("use it with the URDF of before, not with calibrated.urdf: zeros would be corrected twice")
    return after.to_json(), [by_hand(name, its) for name, its in beyond.items()], said
