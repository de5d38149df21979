"""Packages that only an extra of axisbus installs."""

from __future__ import annotations

import importlib.util

from axisbus.errors import UserError


def require(module: str, need: str, extra: str) -> None:
    """Check that a package is installed; ``need`` is the beginning of the message, such as "the page needs nicegui".

    Raises:
        UserError: the package is not installed.
    """
    if importlib.util.find_spec(module) is None:
        raise UserError(
            f"{need}, which is not installed", remedy=f'install it: pip install "axisbus[{extra}]"'
        )
