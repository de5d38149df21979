"""Parameter types of the command line: seconds, and bit rates of a CAN bus."""

from __future__ import annotations

import math
import re
from typing import Any

import click

_LONGEST = 1e8  # seconds, some years: accepted by the system's clock functions
_SLOWEST, _FASTEST = 5_000, 1_000_000  # bit/s of classic CAN


_UNITS = {"ms": 0.001, "s": 1.0, "min": 60.0, "h": 3600.0}
_TIME = re.compile(r"(?P<number>.*?\d\.?)\s*(?P<unit>ms|s|min|h)")


class Seconds(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A finite time of at least ``least``, in seconds or with its unit: 0.5, 500ms, 10s, 5min, 1h."""

    name = "seconds"

    def __init__(self, least: float = 0.001) -> None:
        self._least = least

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Turn text into seconds."""
        parts = _TIME.fullmatch(str(value).strip())
        number, unit = (value, "s") if parts is None else (parts["number"], parts["unit"])
        try:
            found = float(number) * _UNITS[unit]
        except ValueError:
            found = math.nan
        if not self._least <= found <= _LONGEST:
            self.fail(
                f"{value!r} is not a valid time: give seconds, {self._least:g} or more, or a time such as 500ms or 10s",
                param,
                ctx,
            )
        return found


class BitRate(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A bit rate in bit/s."""

    name = "bit/s"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Convert text to bit/s; suggest the right value if it looks like kbit/s."""
        try:
            rate = int(value)
        except ValueError:
            rate = 0
        if not _SLOWEST <= rate <= _FASTEST:
            meant = f", such as {rate * 1000}" if _SLOWEST <= rate * 1000 <= _FASTEST else ", such as 500000"
            self.fail(f"{value!r} is not a bit rate of a CAN bus: give bit/s{meant}", param, ctx)
        return rate
