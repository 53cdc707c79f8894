"""Extras: what is not there is said in one sentence."""

from __future__ import annotations

import importlib
from typing import Any

from .._errors import MissingExtraError


def need(extra: str, *modules: str) -> list[Any]:
    """The modules of an extra, or the sentence that says how to install it."""
    found = []
    for module in modules:
        try:
            found.append(importlib.import_module(module))
        except ImportError as error:
            package = error.name or module
            raise MissingExtraError(f"the extra `{extra}` is missing (no {package}); pip install 'body-schema[{extra}]'") from None
    return found
