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
    from axisbus.drives.gim6010.can_simple.endpoints import Firmware, parse, proposed_version

    if path is None:
        raise click.UsageError("give the firmware's list of endpoints with --list (available from the maker)")
    listed = parse(text_of(path), path.name)
    named = proposed_version(path.name)
    if made_for is None and named is None:
        raise click.UsageError(f"{path.name} does not name its firmware: give for example --made-for 0.5.13")
    version = Firmware.parse(made_for or str(named))
    if named is not None and named != version:
        raise click.UsageError(
            f"{path.name} is for firmware {named} by its name, and --made-for says {version}"
        )
    return listed, version


def text_of(path: Path) -> bytes:
    """Return the contents of a file.

    Raises:
        UserError: the file cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"{path} cannot be read", observed=str(error.strerror)) from error
