"""Reads a module's watchdogs for a dead master, before the master enables it: a dialogue without clock or bus.

Theory of operation. No message reports the watchdogs, and over CAN many modules answer no endpoint: then they are unknown. If a
module answers, the list must be made for the firmware version that the module reported. The list is verified first: the node ID
read by it must be the node that answers. Nothing is written.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple import endpoint_messages
from axisbus.drives.gim6010.can_simple.endpoints import EndpointList
from axisbus.drives.gim6010.can_simple.verified_endpoints import Firmware, FittedList
from axisbus.drives.gim6010.discovery.questions import ProbeFrame, SimpleFacts, endpoint
from axisbus.drives.gim6010.parameters import rules, values
from axisbus.drives.gim6010.settings.watchdog import AXIS, BREAK, ENABLED

_MS = 1000.0
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
