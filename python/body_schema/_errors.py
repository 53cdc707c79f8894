"""What is refused. Nothing was changed by it."""

from __future__ import annotations


class Error(Exception):
    """Anything that this package raises by itself."""


class FieldError(Error, ValueError):
    """A field of what was given is wrong.

    ``field`` is its path, as ``measurements.marker``; ``what`` is wrong with it; ``mend`` says what to write.
    """

    def __init__(self, message: str, field: str = "", what: str = "", mend: str = "") -> None:
        super().__init__(message)
        self.field = field
        self.what = what
        self.mend = mend

    @property
    def hint(self) -> str:
        """What to write; another name of ``mend``."""
        return self.mend


def wrong(field: str, what: str, mend: str) -> FieldError:
    """The error of a field: what is wrong with it, and how to mend it."""
    return FieldError(f"`{field}`: {what}; {mend}", field, what, mend)


class NotFoundError(Error, LookupError):
    """There is no such suggestion, observation or session."""


class ConflictError(Error):
    """The suggestion is not pending any more, or what was asked does not fit what happened before."""


class EngineError(Error, RuntimeError):
    """Nothing can be chosen, calibrated or learned here."""


class ServerError(Error):
    """A server answered with something else than what was asked for. ``status`` is HTTP's, 0 where no answer came."""

    def __init__(self, message: str, status: int = 0) -> None:
        super().__init__(message)
        self.status = status


class MissingExtraError(Error, ImportError):
    """A library of an extra is not installed; the message says how to install it."""
