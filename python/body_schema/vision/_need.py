"""What the extra ``vision`` brings."""

from __future__ import annotations

from .._errors import MissingExtraError


def need() -> None:
    """Refuse with a sentence where OpenCV, its ArUco module, NumPy or PyYAML is missing."""
    mend = "install it: pip install 'body-schema[vision]'"
    for module, name in (("numpy", "NumPy"), ("cv2", "OpenCV"), ("yaml", "PyYAML")):
        try:
            __import__(module)
        except ImportError as error:
            raise MissingExtraError(f"body_schema.vision needs {name}, which cannot be imported ({error}); {mend}") from None
    import cv2

    if not hasattr(getattr(cv2, "aruco", None), "ArucoDetector"):
        what = f"this OpenCV ({cv2.__version__}) has no detector of tags"
        raise MissingExtraError(f"body_schema.vision: {what}; {mend}, and remove other packages of OpenCV (pip list)")
