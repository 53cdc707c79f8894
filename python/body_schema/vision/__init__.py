"""Pictures of printed targets as readings: detectors, cameras, prints, and the way from pictures to a calibration.

Needs OpenCV with its ArUco module: ``pip install 'body-schema[vision]'``. Lengths are metres, angles radians unless a name ends with
a unit, and pixels count from the middle of the top left one: u to the right, v down. A camera's frame is the optical one: z ahead,
x to the right, y down.
"""

from ._need import need

need()

from ._camera import LENSES, Camera  # noqa: E402
from ._detect import Detection, Limits, Rejection, detect  # noqa: E402
from ._intrinsics import Intrinsics, find_intrinsics, pictures_of, size_of  # noqa: E402
from ._poses import Pose, Scale, optical_from_link, poses, scale_between  # noqa: E402
from ._print import page, write_page  # noqa: E402
from ._tables import detect_table  # noqa: E402
from ._targets import FAMILIES, Target  # noqa: E402
from ._watch import Look, Watcher  # noqa: E402

__all__ = [
    "FAMILIES",
    "LENSES",
    "Camera",
    "Detection",
    "Intrinsics",
    "Limits",
    "Look",
    "Pose",
    "Rejection",
    "Scale",
    "Target",
    "Watcher",
    "detect",
    "detect_table",
    "find_intrinsics",
    "optical_from_link",
    "page",
    "pictures_of",
    "poses",
    "scale_between",
    "size_of",
    "write_page",
]
