"""Exceptions that are nobody's answer: what breaks off in a program's own code, or by a mistake of ours, ends one command."""

from __future__ import annotations

from axisbus.errors import AxisbusError, CommandError, one_line

_REMEDY = (
    "its traceback hangs on this error (__cause__): mend the trajectory or the number that it names; where it names neither, "
    "it is a mistake in axisbus: report it. The axis was stopped"
)


def broken(error: Exception, what: str) -> AxisbusError:
    """Return what ends a command (``what`` names it) in which ``error`` was raised."""
    if isinstance(error, AxisbusError):
        return error
    failure = CommandError(f"{what}: broke off", observed=one_line(error), remedy=_REMEDY)
    failure.__cause__ = error
    return failure
