"""The checked options of a stream: its axes, times, and the reaction to an underrun."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypedDict

from axisbus.errors import ArgumentError
from axisbus.machine.axis import Axis
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.point_stream.commands import OnUnderrun
from axisbus.toml.value_readers import InvalidValue, duration

_LEAST, _MOST = 0.0001, 60.0  # seconds
_IN_A_CYCLE = 8  # points in one cycle: each takes some of its time
_READ = duration("100us", "60s")


class StreamKeywords(TypedDict, total=False):
    """The options of ``Group.stream``."""

    period: float | str | None
    on_underrun: str
    buffer: float | str


class StreamOptions(NamedTuple):
    """Seconds between two points (None: each has its time), the reaction to an underrun, seconds that are buffered."""

    period: float | None
    on_underrun: OnUnderrun
    buffer: float


def options_of(
    axes: Mapping[str, Axis],
    text: str,
    period: object,
    on_underrun: object,
    buffer: object,
    *,
    in_workspace: bool = False,
) -> StreamOptions:
    """Return the options of a stream; ``text`` names the call in messages. ``in_workspace``: its points are of a workspace.

    Raises:
        ArgumentError: a value that a stream cannot have, or an axis that cannot be in a stream.
    """
    for name, axis in axes.items():
        _require_able(name, axis, text, in_workspace=in_workspace)
    scan = next(iter(axes.values())).scan_period
    step = None if period is None else _seconds(text, "period", period)
    if step is not None:
        require_apart(step, scan, text, "period")
    try:
        reaction = OnUnderrun(on_underrun)
    except ValueError:
        raise ArgumentError(
            f"{text}: on_underrun {short_repr(on_underrun)} is not known",
            remedy='give "hold" (the axes wait for more points) or "error" (the stream ends)',
        ) from None
    return StreamOptions(step, reaction, _seconds(text, "buffer", buffer))


def require_apart(seconds: float, scan: float, text: str, what: str, longest: float | None = _MOST) -> None:
    """Raise ArgumentError if two points are closer in time than a cycle can process, or further apart than a stream allows."""
    least = scan / _IN_A_CYCLE
    if seconds < least or (longest is not None and seconds > longest):
        allowed = f"{least:.6g} s or more" if longest is None else f"from {least:.6g} to {longest:g} s"
        raise ArgumentError(
            f"{text}: {what} {seconds:.6g} s is not {allowed}",
            observed=f"the scan period is {scan:g} s, and a cycle uses {_IN_A_CYCLE} points at most",
            remedy="leave out points that are closer together, or set scan_period in [bus] of cell.toml",
        )


def _require_able(name: str, axis: Axis, text: str, *, in_workspace: bool) -> None:
    if in_workspace and axis.modulo is not None:
        raise ArgumentError(
            f"{text}: {name} is endless, so its positions have no poses in a workspace",
            observed=f"its modulo is {axis.modulo:g} {axis.unit}",
            remedy="leave it out of the group, or stream its own positions",
        )
    axis._require_stream_limits("stream")


def _seconds(text: str, what: str, value: object) -> float:
    found = number(value)
    if isinstance(value, str):
        try:
            found = _READ(value)
        except InvalidValue:
            found = None
    if found is None or not _LEAST <= found <= _MOST:
        raise ArgumentError(
            f"{text}: {what} {short_repr(value)} is not a time from {_LEAST:g} to {_MOST:g} s",
            remedy='give seconds, such as 0.01, or a time with its unit, such as "10ms"',
        )
    return found
