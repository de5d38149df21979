"""Errors as plain values: kind, fields, notes, and the cause as text; the receiver gets an error of the same kind.

A cause, which may be an exception of any library, arrives as ``RemoteTraceback`` with its printed traceback.
"""

from __future__ import annotations

import traceback
from typing import Any

import msgspec

from axisbus import errors

Plain = str | int | float | bool | tuple[Any, ...] | None


def register_message_types(*kinds: type[msgspec.Struct]) -> None:
    """Let msgspec analyse these types now, at import: in one thread, and once.

    Otherwise msgspec would analyse each type at its first message. If two threads decode a first message at the same time, the
    interpreter crashes: one thread uses data that the other has not completed (msgspec 0.22).
    """
    for kind in kinds:
        msgspec.json.Decoder(kind)


class ErrorFields(msgspec.Struct, array_like=True, frozen=True):
    """One error; ``kind`` is the name of its class in ``axisbus.errors``, ``fields`` are its attributes."""

    kind: str
    fields: dict[str, Any]
    notes: tuple[str, ...] = ()
    cause: str = ""


register_message_types(ErrorFields)


class RemoteTraceback(Exception):
    """An exception of another process; its text is the traceback there."""


def to_fields(error: errors.AxisbusError) -> ErrorFields:
    """Return an error as plain values; other values of its attributes become text."""
    fields = {key: _plain(value) for key, value in vars(error).items() if not key.startswith("__")}
    return ErrorFields(
        _known(type(error)).__name__,
        fields,
        tuple(errors.added_notes(error)),
        _trace(error.__cause__) if error.__cause__ is not None else "",
    )


def from_fields(given: ErrorFields) -> errors.AxisbusError:
    """Return the error; its cause is attached as ``RemoteTraceback``."""
    cls = _KINDS[given.kind]
    fields = {key: tuple(value) if isinstance(value, list) else value for key, value in given.fields.items()}
    error = cls.__new__(cls, fields["message"])
    error.__dict__.update(fields)
    for note in given.notes:
        error.add_note(note)
    if given.cause:
        error.__cause__ = RemoteTraceback("\n" + given.cause)
    return error


def _known(cls: type[BaseException]) -> type[errors.AxisbusError]:
    """Return the nearest class of the tree: a program may have derived its own."""
    return next(base for base in cls.__mro__ if _KINDS.get(base.__name__) is base)


def _plain(value: object) -> Plain:
    if isinstance(value, (tuple, list)):
        return tuple(_plain(item) for item in value)
    if value is None or isinstance(value, (str, bool, float)):
        return value
    return int(value) if isinstance(value, int) else str(value)


def _trace(error: BaseException) -> str:
    """Return the traceback of an error without source lines: no thread of axisbus waits for a disk."""
    locations = [
        f'  File "{frame.f_code.co_filename}", line {line}, in {frame.f_code.co_name}'
        for frame, line in traceback.walk_tb(error.__traceback__)
    ]
    return "\n".join([*locations, f"{type(error).__name__}: {error}"])


_KINDS: dict[str, type[errors.AxisbusError]] = {name: getattr(errors, name) for name in errors.__all__}
