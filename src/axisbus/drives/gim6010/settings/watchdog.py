"""A module's watchdogs against the loss of the master: ``break_timeout``, and the axis's watchdog.

Theory of operation. Both count the time since the last set-point; requests, reads and heartbeats do not reset them.
``break_timeout`` (ms, 0: off) was observed on another product of the maker: a changed value arms it at once, in any state of the
axis, and its trip latches as CAN_BUS_FAILED. The maker says that ``watchdog_timeout`` (s) has no effect in new firmware. Therefore
the settings are written, read back and reported together with the open questions; test on the machine that they work.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple import endpoint_messages
from axisbus.drives.gim6010.can_simple.endpoints import EndpointList, Firmware, FittedList
from axisbus.drives.gim6010.discovery.questions import ProbeFrame, SimpleFacts, endpoint
from axisbus.drives.gim6010.parameters import rules, values
from axisbus.drives.gim6010.settings.parameter_settings import ParameterBatch
from axisbus.errors import ArgumentError

BREAK = "can.config.break_timeout"
ENABLED, AXIS = "axis0.config.enable_watchdog", "axis0.config.watchdog_timeout"
PATHS = (BREAK, ENABLED, AXIS)
LATCHED = 0x0010_0000 | 0x0000_0800  # CAN_BUS_FAILED, WATCHDOG_TIMER_EXPIRED
_LONGEST = 0xFFFF  # ms: maximum of the parameter
_MS = 1000.0
_ARMED = (
    "it counts from now on, in every state of the axis, and only set-points feed it: a module without set-points trips, "
    "with CAN_BUS_FAILED, which latches; reset the axis before it is enabled",
    "over CAN Simple a machine feeds it if boot can read it (endpoints in the cell file) and if it is at least four scan "
    "periods; over CANopen and Modbus no machine feeds it",
    "the effect of a trip on a turning motor was observed on another joint of the manufacturer: it loses its power. Test it "
    "before you rely on it",
)
_NEW = (
    "according to the manufacturer this watchdog has no effect in new firmware: test it before you rely on it, or arm "
    "break_timeout"
)
_OFF = "this module no longer detects the loss of the master; in older firmware 0 reportedly means 100 ms in break_timeout"


def wanted(broken: float | None, axis: float | None) -> ParameterBatch:
    """Return the parameters that arm them: ``broken`` for ``break_timeout``, ``axis`` for the axis's watchdog (s; None: unchanged).

    Raises:
        ArgumentError: neither is given, one is not above 0, or ``broken`` is not a whole number of ms up to 65535.
    """
    if broken is None and axis is None:
        raise ArgumentError(
            "no time is given", remedy="give --break-timeout, --axis-timeout, or both; or --off"
        )
    if axis is not None and not 0.0 < axis < math.inf:
        raise ArgumentError(f"axis-timeout: {axis!r} s is not above 0", remedy="give a time, or --off")
    first = () if broken is None else ((BREAK, _milliseconds(broken)),)
    second = () if axis is None else ((AXIS, float(axis)), (ENABLED, True))
    return ParameterBatch((*first, *second), (*(_ARMED if first else ()), *((_NEW,) if second else ())))


def off() -> ParameterBatch:
    return ParameterBatch(((BREAK, 0), (ENABLED, False)), (_OFF,))


def _milliseconds(seconds: float) -> int:
    found = round(seconds * _MS) if math.isfinite(seconds) else 0
    if not 1 <= found <= _LONGEST or not math.isclose(found, seconds * _MS, abs_tol=1e-6):
        raise ArgumentError(
            f"break-timeout: {seconds!r} s is outside the range of the parameter",
            remedy=f"give whole ms from 1 to {_LONGEST}, such as 500ms; or --off",
        )
    return found


# -- Reads a module's watchdogs for the loss of the master, before the master enables it: a dialogue without clock or bus -------
#
# Theory of operation. No message reports the watchdogs, and over CAN many modules answer no endpoint: then they are unknown. If a
# module answers, the list must be made for the firmware version that the module reported. The list is verified first: the node ID
# read by it must be the node that answers. Nothing is written.


_AXIS_UNTIL = Firmware(0, 6, 0)  # from here on the axis's watchdog has no effect, says the maker
_Value = float | int | bool


@dataclass(frozen=True, slots=True)
class Armed:
    """Result: ``break_timeout`` and the axis's ``watchdog`` in s, each 0 if it is off, None if unknown."""

    break_timeout: float | None = None
    watchdog: float | None = None


def axis_watchdog_works(firmware: Firmware | None) -> bool:
    """Whether the axis's watchdog is known to have an effect in this firmware (None: unknown)."""
    return firmware is not None and firmware < _AXIS_UNTIL


def in_effect(found: Armed, firmware: Firmware | None) -> dict[str, float]:
    """Return the time-outs (s) that are known to be armed and to have an effect, by the name of their parameter."""
    works = axis_watchdog_works(firmware)
    time_outs = {"break_timeout": found.break_timeout, "watchdog_timeout": found.watchdog if works else None}
    return {name: seconds for name, seconds in time_outs.items() if seconds}


def armed(
    node: int, listed: EndpointList, made_for: Firmware, facts: SimpleFacts
) -> Generator[ProbeFrame, CanFrame | None, Armed]:
    """Read the watchdogs of a module with known ``facts``; ``listed`` is its firmware's list, ``made_for`` that version.

    Raises:
        ArgumentError: the list does not fit the reported firmware version, or its verification failed.
    """
    if facts.version is None:
        return Armed()
    fitted = FittedList(listed, made_for, facts.version)
    found = yield from _read(node, fitted, rules.NODE_ID, facts)
    if found is None:
        return Armed()
    if found != node:
        raise rules.unfitting(node, values.show(found))
    broken = yield from _read(node, fitted, BREAK, facts)
    enabled = yield from _read(node, fitted, ENABLED, facts)
    timeout = yield from _read(node, fitted, AXIS, facts)
    known = None if enabled is None or timeout is None else float(timeout) if enabled else 0.0
    return Armed(None if broken is None else float(broken) / _MS, known)


def _read(
    node: int, fitted: FittedList, path: str, facts: SimpleFacts
) -> Generator[ProbeFrame, CanFrame | None, _Value | None]:
    """Return a parameter; None if this firmware does not have it, or does not answer."""
    if path not in fitted.listed.endpoints:
        return None
    data = yield from endpoint(node, endpoint_messages.read(node, fitted, path), facts)
    return None if data is None else endpoint_messages.value(fitted.endpoint(path), data)
