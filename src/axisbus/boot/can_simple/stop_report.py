"""Describe how the axis of a module stops, and which of its watchdogs notice a dead master, in plain words."""

from __future__ import annotations

import math

from axisbus.boot.stop_report import StopLadderReport, Watchdog, WatchdogReport
from axisbus.drives.gim6010.can_simple.port.settings import FEEDS, ModuleSettings
from axisbus.drives.gim6010.can_simple.verified_endpoints import Firmware
from axisbus.drives.gim6010.settings.watchdog_status import Armed, axis_watchdog_works, in_effect
from axisbus.errors import BootError
from axisbus.motion.parameters import HoldsLoad, StopTimes

# Used if nothing could be read: no message reports the armed watchdogs. Users and the maker describe each (docs/gim6010-8.md).
WATCHDOG = WatchdogReport(
    Watchdog.NONE,
    "no function of this module is known to detect a dead master: break_timeout and watchdog_timeout were not read, and are "
    "off by factory setting. Positions hold, a velocity or a torque continues. The master does not feed a time-out that it "
    "has not read: if break_timeout is armed, the module trips whenever no set-point is sent for that time. Then switch it "
    "off (axisbus gim6010 watchdog --off), or name the firmware's list in the cell file (endpoints). On another joint of "
    "the manufacturer a trip switched the power off and latched CAN_BUS_FAILED; watchdog_timeout has no effect in newer "
    "firmware. Both are untested here",
)
_LATCHES = (
    "only set-points feed it, it counts in every state of the axis, and on another joint of the manufacturer it switched "
    "the power off and latched CAN_BUS_FAILED"
)
_GOES_ON = "positions hold, a velocity or a torque continues"
_TINY = 1e-6  # s
_FED_BY_LINE = (
    "over RS485 no register is known to feed it, and the master does not feed it: the module trips. Switch it off "
    "(axisbus gim6010 watchdog --off)"
)
_COASTS = "the motor coasts: a module has no ramp for it"


def watchdog_of(found: Armed, firmware: Firmware | None, *, relayed: bool = False) -> WatchdogReport:
    """Return which watchdogs of a module notice a dead master, from the watchdogs ``found`` armed in it, and who feeds them.

    ``relayed``: the module is on a serial line.
    """
    if found == Armed():
        return WATCHDOG
    counts = in_effect(found, firmware)
    texts = [_break(found.break_timeout), _axis(found.watchdog, works=axis_watchdog_works(firmware))]
    if counts:
        texts += [_FED_BY_LINE if relayed else _fed(min(counts.values())), "Untested here"]
    else:
        texts.append(f"no function is known to detect a dead master: {_GOES_ON}")
    return WatchdogReport(Watchdog.UNKNOWN if counts else Watchdog.NONE, "; ".join(texts))


def feed_time(found: Armed, firmware: Firmware | None, settings: ModuleSettings) -> float:
    """Return the shortest armed time-out (s) that the master must feed; 0: it feeds none.

    On a serial line the master feeds none, because no register is known to feed it.

    Raises:
        BootError: a quarter of the time-out is shorter than the scan period, so that one late cycle could trip the module.
    """
    counts = {} if settings.relayed else in_effect(found, firmware)
    if not counts:
        return 0.0
    name = min(counts, key=lambda each: counts[each])
    shortest, least = counts[name], FEEDS * settings.period
    if shortest >= least - _TINY:
        return shortest
    option = {"break_timeout": "--break-timeout", "watchdog_timeout": "--axis-timeout"}[name]
    raise BootError(
        f"node {settings.node}: its {name} is too short for this scan period: the module would trip in motion, and coast",
        node=settings.node,
        step="watchdog",
        observed=f"{name} is {shortest * 1000:g} ms and the scan period {settings.period * 1000:g} ms; "
        f"at least {FEEDS} scan periods are needed",
        remedy=f"arm at least {math.ceil(least * 1000 - _TINY)} ms (axisbus gim6010 watchdog {option}), switch it off "
        f"(axisbus gim6010 watchdog --off), or give [bus] a scan_period of at most {shortest * 1000 / FEEDS:g} ms",
    )


def _fed(seconds: float) -> str:
    return (
        f"the master feeds it at least every {seconds * 1000 / FEEDS:g} ms, from the first command to its axis until the program "
        "ends; without a program the module trips, and the next program must reset the axis"
    )


def _break(seconds: float | None) -> str:
    if seconds is None:
        return "break_timeout is not answered, and the master does not feed it"
    return f"break_timeout is {seconds * 1000:g} ms: {_LATCHES}" if seconds else "break_timeout is off"


def _axis(seconds: float | None, *, works: bool) -> str:
    if seconds is None:
        return "the axis's watchdog is not answered"
    if not seconds:
        return "the axis's watchdog is off"
    how = (
        "WATCHDOG_TIMER_EXPIRED latches"
        if works
        else "without effect in this firmware, according to the manufacturer"
    )
    return f"the axis's watchdog is armed with {seconds:g} s ({how})"


def ladder(axis: str, settings: ModuleSettings, times: StopTimes, holds_load: HoldsLoad) -> StopLadderReport:
    """Return the stop sequence of an axis with the effect of each step; ``times`` are the deadlines of the steps."""
    at_rest = (
        "then stays in closed loop and holds its position" if settings.quick_stop_holds else "then power off"
    )
    ramp = f"{settings.velocity_ramp:g} turns/s² of the rotor, by the cell file"
    rows = [
        (
            "1 halt",
            "trapezoid",
            "brakes with the deceleration of the command, then stays in closed loop and holds"
            + _within(times.halt),
        ),
        (
            "2 quick stop",
            "velocity 0",
            f"brakes on its own vel_ramp_rate ({ramp}), {at_rest}" + _within(times.quick_stop),
        ),
        ("3 power off", "idle", _COASTS + _within(times.disable)),
        ("4 NMT stop", "Estop", "the motor coasts, and its error latches until the axis is reset"),
        ("on a fault", "", "the module switches its power off: the motor coasts"),
        ("on a lost link", "", f"{_GOES_ON}: see the watchdog"),
    ]
    if holds_load is not HoldsLoad.NO:
        rows.append(
            ("holds a load", "", f"by its {holds_load.value}: never switched off before it is at standstill")
        )
    return StopLadderReport(axis, tuple(rows), (f"{axis}: power off, and any fault: {_COASTS}",))


def _within(seconds: float) -> str:
    return f" (at most {seconds:g} s, then the next step)"
