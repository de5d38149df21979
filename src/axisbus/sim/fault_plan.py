"""Planned faults of simulated devices: their settings are changed when a fault begins, and restored when it ends."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from axisbus.cia301.nmt import NmtCommand
from axisbus.sim.device import Device


@dataclass(frozen=True, slots=True)
class FaultSetting:
    """A fault setting and its value; ``of_axis``: of the axis, else of its node; ``part``: ``lss``, ``program`` or empty."""

    name: str
    value: Any
    of_axis: bool
    part: str = ""


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """A fault by its user-defined name; ``description`` is its description in reports.

    ``axis`` counts from 1. ``code``: the drive goes into fault with this code (603Fh) and the manufacturer's bits ``maker_bits``
    (0: no fault). ``restart``: the node restarts, as after a short loss of its supply. ``swap``: another drive of the same type
    takes the place of the drive, with these arguments of ``Device.swap``.
    """

    name: str
    description: str
    timing: FaultTiming
    node: int
    axis: int = 1
    settings: tuple[FaultSetting, ...] = ()
    code: int = 0
    maker_bits: int = 0
    restart: bool = False
    swap: Mapping[str, Any] | None = None


class Plan:
    """All planned faults, with their timing and the original value of each setting."""

    def __init__(self, faults: Sequence[PlannedFault], devices: Mapping[int, Device]) -> None:
        """``devices`` by their node-ID."""
        self._devices = devices
        self._timers = [(fault, FaultTimer(fault.timing)) for fault in faults]
        self._before = {
            fault.name: [
                copy.copy(getattr(self._settings_object(fault, setting), setting.name))
                for setting in fault.settings
            ]
            for fault in faults
        }

    def step(self, now: float, values: Any) -> list[str]:
        """Begin and end the faults due at ``now`` (seconds since the drives started); return a report line for each.

        The caller must hold the lock of the devices. ``values`` are the values that the conditions test.
        """
        reports = []
        for fault, timer in self._timers:
            change = timer.step(now, values)
            if change is FaultChange.BEGINS:
                self._begin(fault)
                reports.append(f"{fault.name}: {fault.description}")
            elif change is FaultChange.ENDS:
                self._set_all(fault, self._before[fault.name])
                reports.append(f"{fault.name} is over")
        return reports

    def _begin(self, fault: PlannedFault) -> None:
        self._set_all(fault, [setting.value for setting in fault.settings])
        device = self._devices[fault.node]
        if fault.code:
            device.drives[fault.axis - 1].fault(fault.code, maker_bits=fault.maker_bits)
        if fault.restart:
            device.nmt_command(NmtCommand.RESET_NODE)
        if fault.swap is not None:
            device.swap(**fault.swap)

    def _set_all(self, fault: PlannedFault, values: Sequence[Any]) -> None:
        for setting, value in zip(fault.settings, values, strict=True):
            setattr(self._settings_object(fault, setting), setting.name, copy.copy(value))

    def _settings_object(self, fault: PlannedFault, setting: FaultSetting) -> Any:
        device = self._devices[fault.node]
        settings = device.drives[fault.axis - 1].dials if setting.of_axis else device.dials
        return getattr(settings, setting.part) if setting.part else settings


# -- Begin and end of a planned fault, by time and by a condition; without access to the devices -----------------------


Condition = Callable[[Any], bool]


@dataclass(frozen=True, slots=True)
class FaultTiming:
    """Begin and duration of a fault; times in seconds.

    begin: time since the drives started; or ``when``: the fault begins ``after`` s after this condition becomes true. A condition
    that
        is true from the start must first become false.
    every: time from one begin of the fault to the next; with ``when``, the shortest time between two (None: only once)
    lasts: duration (None: permanent)
    """

    begin: float | None = None
    when: Condition | None = None
    after: float = 0.0
    every: float | None = None
    duration: float | None = None


class FaultChange(Enum):
    """Result of a step."""

    NOTHING = 0
    BEGINS = 1
    ENDS = 2


class FaultTimer:
    """Timing of one fault: the time of its next begin and of its end."""

    def __init__(self, timing: FaultTiming) -> None:
        self._timing = timing
        self._due = timing.begin
        self._end: float | None = None
        self._next = 0.0  # earliest time of the next begin
        self._held = True  # whether the condition was true in the previous step
        self._ended = False  # whether it will not begin again

    def step(self, now: float, values: Any) -> FaultChange:
        """Return the change due at ``now``; ``values`` are for the condition. At most one change per step."""
        self._watch(now, values)
        if self._end is not None and now >= self._end:
            self._end = None
            return FaultChange.ENDS
        if self._due is None or now < self._due or self._end is not None:
            return FaultChange.NOTHING
        self._begin(now)
        return FaultChange.BEGINS

    def _watch(self, now: float, values: Any) -> None:
        if self._timing.when is None:
            return
        holds = bool(self._timing.when(values))
        rises, self._held = holds and not self._held, holds
        if rises and self._due is None and not self._ended and now >= self._next:
            self._due = now + self._timing.after

    def _begin(self, now: float) -> None:
        timing, due = self._timing, self._due
        assert due is not None
        self._end = None if timing.duration is None else now + timing.duration
        self._due, self._ended = None, timing.every is None
        if timing.every is None:
            return
        self._next = now + timing.every
        if timing.when is None:
            self._due = max(due + timing.every, now)  # missed begins are skipped
