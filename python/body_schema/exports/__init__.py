"""What a calibration found, in the files that robots' own drivers read.

Every function takes what ``body-schema calibrate`` wrote (``read_calibrated``) and gives the new text of a file; none writes it. Lengths
are metres and angles radians but where a file has another unit; quaternions are x y z w but in MJCF, whose order is w x y z. None needs
an extra. What is refused raises ``FieldError``.
"""

from .._urdf import Tree, parse_urdf
from ._calibrated import Calibrated, read_calibrated
from ._frames import Transform, easy_handeye2, tf_json, tf_launch, transforms
from ._kinematics import ur_kinematics, xarm_kinematics
from ._lerobot import lerobot
from ._mjcf import mjcf
from ._pal import joint_offsets, pal
from ._xacro import xacro

__all__ = [
    "Calibrated",
    "Transform",
    "Tree",
    "easy_handeye2",
    "joint_offsets",
    "lerobot",
    "mjcf",
    "pal",
    "parse_urdf",
    "read_calibrated",
    "tf_json",
    "tf_launch",
    "transforms",
    "ur_kinematics",
    "xacro",
    "xarm_kinematics",
]
