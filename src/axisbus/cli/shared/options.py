"""Options and arguments of several subcommands."""

from __future__ import annotations

import functools
import inspect
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import click

from axisbus.cli.shared.axes import once
from axisbus.cli.shared.completion import complete_channel, complete_interface
from axisbus.wording import counted

Decorated = Callable[..., Any]
_OWN_OPTIONS = {"interface": "-i", "channel": "-c", "bitrate": "-b"}


def together(*decorators: Callable[[Decorated], Decorated]) -> Callable[[Decorated], Decorated]:
    """Return one decorator in place of several, which are given in the order in which they would be written."""

    def decorate(function: Decorated) -> Decorated:
        for each in reversed(decorators):
            function = each(function)
        return function

    return decorate


def packed(kind: Callable[..., object], name: str) -> Callable[[Decorated], Decorated]:
    """Return a decorator for a command that gets the values of several options as one: the parameters of ``kind`` as ``name``."""
    parameters = tuple(inspect.signature(kind).parameters)

    def decorate(function: Decorated) -> Decorated:
        @functools.wraps(function)
        def call(**given: Any) -> Any:
            return function(**{name: kind(**{each: given.pop(each) for each in parameters})}, **given)

        return call

    return decorate


def port_option(default: int) -> Callable[[Decorated], Decorated]:
    """Return a decorator that adds --port: the port of a server."""
    return click.option(
        "--port",
        type=click.IntRange(0, 65535),
        default=default,
        show_default=True,
        help="0: any free port.",
    )


def listen_option(words: str) -> Callable[[Decorated], Decorated]:
    """Return a decorator that adds --listen: an address of this computer; ``words`` explain addresses other than loopback."""
    return click.option("--listen", metavar="ADDRESS", default="127.0.0.1", show_default=True, help=words)


beside_option = click.option(
    "--beside",
    is_flag=True,
    help="Open the bus even if another master is heard; both then command the same drives.",
)


# -- Parameter types of the command line: seconds, and bit rates of a CAN bus ------------------------------------------


_LONGEST = 1e8  # seconds, some years: accepted by the system's clock functions
_SLOWEST, _FASTEST = 5_000, 1_000_000  # bit/s of classic CAN


_UNITS = {"ms": 0.001, "s": 1.0, "min": 60.0, "h": 3600.0}
_TIME = re.compile(r"(?P<number>.*?\d\.?)\s*(?P<unit>ms|s|min|h)")


class NumberType(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """An integer in any notation of Python, such as 0x1F or 31; with ``bits``, an unsigned one of that size."""

    name = "number"

    def __init__(self, bits: int | None = None) -> None:
        self._bits = bits

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Convert text to a number."""
        try:
            number = int(value, 0) if isinstance(value, str) else int(value)
        except ValueError:
            self.fail(f"{value!r} is not a number (write 31 or 0x1F)", param, ctx)
        if self._bits is not None and not 0 <= number < 1 << self._bits:
            self.fail(f"{value!r} is not a number of {counted(self._bits, 'bit')}", param, ctx)
        return number


class Seconds(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A finite time of at least ``minimum``, in seconds or with its unit: 0.5, 500ms, 10s, 5min, 1h."""

    name = "seconds"

    def __init__(self, minimum: float = 0.001) -> None:
        self._minimum = minimum

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Turn text into seconds."""
        parts = _TIME.fullmatch(str(value).strip())
        number, unit = (value, "s") if parts is None else (parts["number"], parts["unit"])
        try:
            found = float(number) * _UNITS[unit]
        except ValueError:
            found = math.nan
        if not self._minimum <= found <= _LONGEST:
            self.fail(
                f"{value!r} is not a valid time: give seconds, {self._minimum:g} or more, or a time such as 500ms or 10s",
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
            suggestion = (
                f", such as {rate * 1000}" if _SLOWEST <= rate * 1000 <= _FASTEST else ", such as 500000"
            )
            self.fail(f"{value!r} is not a bit rate of a CAN bus: give bit/s{suggestion}", param, ctx)
        return rate


# -- Options of several commands, and what is made of them -------------------------------------------------------------

# The bus to open: -i, -c, -b and -O. With a cell file, -c, -b and -O replace the values of its [bus].
bus_options = together(
    click.option(
        "-i",
        "--interface",
        shell_complete=complete_interface,
        help="python-can interface, such as socketcan, pcan, kvaser, slcan; sim: see -c.",
    ),
    click.option(
        "-c",
        "--channel",
        shell_complete=complete_channel,
        help="Channel, such as can0 or PCAN_USBBUS1; with -i sim a cell file.",
    ),
    click.option("-b", "--bitrate", type=BitRate(), help="Bit rate in bit/s, if the adapter sets it."),
    click.option(
        "-O", "--option", multiple=True, metavar="KEY=VALUE", help="Further option for the adapter."
    ),
)


class GivenBus(NamedTuple):
    """The bus of a command: a cell file, and the options -i, -c, -b and -O."""

    cell: Path | None
    interface: str | None
    channel: str | None
    bitrate: int | None
    option: tuple[str, ...]


def bus_words(
    cell: Path | None,
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    option: tuple[str, ...],
) -> str:
    """Return the bus options as typed, to be repeated in a hint."""
    words = [str(cell)] if cell is not None else []
    for flag, value in (
        ("-i", interface),
        ("-c", channel),
        *(("-O", each) for each in option),
        ("-b", bitrate),
    ):
        words += [flag, str(value)] if value is not None else []
    return " ".join(words)


def parse_options(pairs: tuple[str, ...]) -> dict[str, Any]:
    """Convert KEY=VALUE texts to adapter options; numbers and true/false are recognised."""
    options: dict[str, Any] = {}
    for pair in pairs:
        key, sign, text = pair.partition("=")
        if not sign or not key:
            raise click.UsageError(f"-O {pair}: write KEY=VALUE")
        if key in _OWN_OPTIONS:
            raise click.UsageError(f"-O {pair}: the {key} has a separate option, {_OWN_OPTIONS[key]}")
        options[key] = _value(text)
    return options


def _value(text: str) -> Any:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        return int(text, 0)
    except ValueError:
        return text


def parse_targets(pairs: tuple[str, ...], what: str = "POSITION") -> dict[str, float]:
    """Convert AXIS=POSITION texts to numbers; ``what`` names the numbers for people."""
    targets: dict[str, float] = {}
    for pair in pairs:
        name, sign, text = pair.partition("=")
        try:
            targets[name] = float(text)
        except ValueError:
            sign = ""
        if not sign:
            raise click.UsageError(f"{pair!r}: write AXIS={what}, such as x=90")
    once(pair.partition("=")[0] for pair in pairs)
    return targets


# -- The parameter type of paths: unchecked, so that the code that opens the file reports errors in a uniform text -----


PATH = click.Path(
    path_type=Path, readable=False
)  # click itself would refuse an unreadable file without a remedy
