"""True joint zeros of an SO-100 or SO-101 of LeRobot from a webcam and a printed tag: ``python -m body_schema lerobot``.

Needs the extra ``vision``; the simulated arm MuJoCo, the real one the package ``lerobot``. Lengths are metres and angles radians unless a
name ends with a unit.
"""

from ..vision._need import need

need()

from ..exports._lerobot import MOTORS, Calibration, Range, read_calibration  # noqa: E402
from ._arm import Arm, RealArm, RecordedArm, Recorder, picture_size  # noqa: E402
from ._description import mjcf_of, so101_urdf  # noqa: E402
from ._found import Found, Value, conclude  # noqa: E402
from ._loop import FEWEST, Run, Stop, measure  # noqa: E402
from ._setup import Setup  # noqa: E402
from ._simulated import SimulatedArm, Truth, simulated_calibration, truth_of, webcam  # noqa: E402

__all__ = [
    "FEWEST",
    "MOTORS",
    "Arm",
    "Calibration",
    "Found",
    "Range",
    "RealArm",
    "RecordedArm",
    "Recorder",
    "Run",
    "Setup",
    "SimulatedArm",
    "Stop",
    "Truth",
    "Value",
    "conclude",
    "measure",
    "mjcf_of",
    "picture_size",
    "read_calibration",
    "simulated_calibration",
    "so101_urdf",
    "truth_of",
    "webcam",
]
