"""Errors for unexpected exceptions: an exception in the user's code, or a bug in axisbus, ends one command."""

from __future__ import annotations

from axisbus.errors import AxisbusError, CommandError, one_line

_REMEDY = (
    "its traceback is the __cause__ of this error: correct the trajectory or the number that it names; if it names neither, "
    "it is a mistake in axisbus: report it. The axis was stopped"
)


def broken(error: Exception, what: str) -> AxisbusError:
    """Return the error that ends command ``what``, in which ``error`` was raised."""
    if isinstance(error, AxisbusError):
        return error
    failure = CommandError(
        f"{what}: ended by an unexpected exception", observed=one_line(error), remedy=_REMEDY
    )
    failure.__cause__ = error
    return failure
