"""How the axis of a module stops, and what of it notices a dead master, in plain words."""

from __future__ import annotations

from axisbus.boot.stop_report import StopLadderReport, Watchdog, WatchdogReport
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.motion.parameters import HoldsLoad, StopTimes

# No message tells what is armed; owners and the maker say what each does (docs/gim6010-8.md).
WATCHDOG = WatchdogReport(
    Watchdog.NONE,
    "nothing on this module is known to notice a dead master: break_timeout and watchdog_timeout are not told by any message, and "
    "are off from the factory. Positions hold, a velocity or a torque goes on. A break_timeout that is armed was seen, on another "
    "joint of the maker, to take the power away and to latch CAN_BUS_FAILED; watchdog_timeout has no effect in newer firmware. "
    "Both are untested here",
)
_COASTS = "the motor coasts: a module has no ramp for it"


def ladder(axis: str, settings: ModuleSettings, times: StopTimes, holds_load: HoldsLoad) -> StopLadderReport:
    """Return the rungs of an axis and what each does; ``times`` are their deadlines."""
    at_rest = (
        "then stays in closed loop and holds its place" if settings.quick_stop_holds else "then power off"
    )
    ramp = f"{settings.velocity_ramp:g} turns/s² of the rotor, as the cell file has it"
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
        ("on a fault", "", "the module lets go by itself: the motor coasts"),
        ("on a lost link", "", "positions hold, a velocity or a torque goes on: see the watchdog"),
    ]
    if holds_load is not HoldsLoad.NO:
        rows.append(("holds a load", "", f"by its {holds_load.value}: never switched off before it stands"))
    return StopLadderReport(axis, tuple(rows), (f"{axis}: power off, and any fault: {_COASTS}",))


def _within(seconds: float) -> str:
    return f" (at most {seconds:g} s, then the next rung)"
