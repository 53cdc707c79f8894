"""Learn a robot's kinematics from a few well-chosen movements.

``Session`` asks where to move and is told what was seen; ``Client`` does the same on a server; ``calibrate`` takes a table that is there
already; ``simulate`` and ``compare`` run scenarios. ``answers`` has the types of what sessions answer. Lengths are metres and angles radians, but where a name ends with a unit.
"""

from . import answers
from ._calibration import Calibration, calibrate, observability
from ._client import Client, RemoteSession
from ._engine import __version__
from ._errors import ConflictError, EngineError, Error, FieldError, MissingExtraError, NotFoundError, ServerError
from ._runs import compare, simulate
from ._session import Session
from ._tables import dataframe

__all__ = [
    "Calibration",
    "Client",
    "ConflictError",
    "EngineError",
    "Error",
    "FieldError",
    "MissingExtraError",
    "NotFoundError",
    "RemoteSession",
    "ServerError",
    "Session",
    "__version__",
    "answers",
    "calibrate",
    "compare",
    "dataframe",
    "observability",
    "simulate",
]
