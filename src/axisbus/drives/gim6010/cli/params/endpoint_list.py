"""The given list of the firmware's endpoints, and the firmware that it belongs to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.errors import UserError

if TYPE_CHECKING:
    from axisbus.drives.gim6010.can_simple.endpoints import EndpointList, Firmware


def read_list(path: Path | None, made_for: str | None) -> tuple[EndpointList, Firmware]:
    """Return the list of endpoints in a file, and its firmware, by the file's name or by ``made_for``.

    Raises:
        UsageError: the list or its firmware is not given.
        UserError, ArgumentError: the file cannot be read, or is not a list.
    """
    from axisbus.drives.gim6010.can_simple.endpoints import with_version

    if path is None:
        raise click.UsageError("give the firmware's list of endpoints with --list (available from the maker)")
    return with_version(text_of(path), path.name, made_for)


def text_of(path: Path) -> bytes:
    """Return the contents of a file.

    Raises:
        UserError: the file cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"{path} cannot be read", observed=str(error.strerror)) from error
