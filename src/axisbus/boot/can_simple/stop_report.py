"""Describe how the axis of a module stops, and which of its watchdogs notice a dead master, in plain words."""

from __future__ import annotations

from axisbus.boot.stop_report import StopLadderReport, Watchdog, WatchdogReport
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.can_simple.verified_endpoints import Firmware
from axisbus.drives.gim6010.settings.watchdog_status import Armed
from axisbus.motion.parameters import HoldsLoad, StopTimes

# Used if nothing could be read: no message reports the armed watchdogs. Users and the maker describe each (docs/gim6010-8.md).
WATCHDOG = WatchdogReport(
    Watchdog.NONE,
    "no function of this module is known to detect a dead master: break_timeout and watchdog_timeout are not in any "
    "message, and are off by factory setting. Positions hold, a velocity or a torque continues. On another joint of the "
    "manufacturer an armed break_timeout switched the power off and latched CAN_BUS_FAILED; watchdog_timeout has no effect "
    "in newer firmware. Both are untested here",
)
_LATCHES = (
    "only set-points reset it, it counts in every state of the axis, and on another joint of the manufacturer it switched "
    "the power off and latched CAN_BUS_FAILED"
)
_GOES_ON = "positions hold, a velocity or a torque continues"
_WATCHDOG_UNTIL = Firmware(0, 6, 0)  # from here on the axis's watchdog has no effect, says the maker
_COASTS = "the motor coasts: a module has no ramp for it"


def watchdog_of(found: Armed, firmware: Firmware | None) -> WatchdogReport:
    """Return which watchdogs of a module notice a dead master, from the watchdogs ``found`` armed in it."""
    if found == Armed():
        return WATCHDOG
    works = firmware is not None and firmware < _WATCHDOG_UNTIL
    counts = bool(found.break_timeout) or (works and bool(found.watchdog))
    texts = [_break(found.break_timeout), _axis(found.watchdog, works=works)]
    texts.append("Untested here" if counts else f"no function is known to detect a dead master: {_GOES_ON}")
    return WatchdogReport(Watchdog.UNKNOWN if counts else Watchdog.NONE, "; ".join(texts))


def _break(seconds: float | None) -> str:
    if seconds is None:
        return "break_timeout is not answered"
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
