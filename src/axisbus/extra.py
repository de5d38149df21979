"""Packages that only an extra of axisbus brings."""

from __future__ import annotations

import importlib.util

from axisbus.errors import StateError


def require(module: str, need: str, extra: str) -> None:
    """Check that a package is installed; ``need`` is what needs which, such as "the page needs nicegui".

    Raises:
        StateError: it is not.
    """
    if importlib.util.find_spec(module) is None:
        raise StateError(
            f"{need}, which is not installed", remedy=f"install it: pip install axisbus[{extra}]"
        )
