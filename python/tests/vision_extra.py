"""Tests of the extra ``vision`` are skipped, with a word, where it is not installed."""

from __future__ import annotations

import pytest


def need() -> None:
    """Skip a module that needs the extra."""
    for module in ("numpy", "cv2", "yaml"):
        pytest.importorskip(module, reason="the extra is not installed: pip install 'body-schema[vision]'")
