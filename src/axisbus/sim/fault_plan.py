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
class Dial:
    """A fault setting and its value; ``of_axis``: of the axis, else of its node; ``part``: ``lss``, ``program`` or empty."""

    name: str
    value: Any
    of_axis: bool
    part: str = ""


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """A fault by its user-defined name; ``said`` is its description in reports.

    ``axis`` counts from 1. ``code``: the drive goes into fault with this code (603Fh) and the manufacturer's bits ``maker_bits``
    (0: no fault). ``restart``: the node restarts, as after a short loss of its supply. ``swap``: another drive of the same type
    takes the place of the drive, with these arguments of ``Device.swap``.
    """

    name: str
    said: str
    moment: Moment
    node: int
    axis: int = 1
    dials: tuple[Dial, ...] = ()
    code: int = 0
    maker_bits: int = 0
    restart: bool = False
    swap: Mapping[str, Any] | None = None


class Plan:
    """All planned faults, with their timing and the original value of each setting."""

    def __init__(self, faults: Sequence[PlannedFault], devices: Mapping[int, Device]) -> None:
        """``devices`` by their node-ID."""
        self._devices = devices
        self._cues = [(fault, Cue(fault.moment)) for fault in faults]
        self._before = {
            fault.name: [copy.copy(getattr(self._holder(fault, dial), dial.name)) for dial in fault.dials]
            for fault in faults
        }

    def step(self, now: float, values: Any) -> list[str]:
        """Begin and end the faults due at ``now`` (seconds since the drives started); return a report line for each.

        The caller must hold the lock of the devices. ``values`` are the values that the conditions test.
        """
        told = []
        for fault, cue in self._cues:
            turn = cue.step(now, values)
            if turn is Turn.BEGINS:
                self._begin(fault)
                told.append(f"{fault.name}: {fault.said}")
            elif turn is Turn.ENDS:
                self._turn(fault, self._before[fault.name])
                told.append(f"{fault.name} is over")
        return told

    def _begin(self, fault: PlannedFault) -> None:
        self._turn(fault, [dial.value for dial in fault.dials])
        device = self._devices[fault.node]
        if fault.code:
            device.drives[fault.axis - 1].fault(fault.code, maker_bits=fault.maker_bits)
        if fault.restart:
            device.nmt_command(NmtCommand.RESET_NODE)
        if fault.swap is not None:
            device.swap(**fault.swap)

    def _turn(self, fault: PlannedFault, values: Sequence[Any]) -> None:
        for dial, value in zip(fault.dials, values, strict=True):
            setattr(self._holder(fault, dial), dial.name, copy.copy(value))

    def _holder(self, fault: PlannedFault, dial: Dial) -> Any:
        device = self._devices[fault.node]
        dials = device.drives[fault.axis - 1].dials if dial.of_axis else device.dials
        return getattr(dials, dial.part) if dial.part else dials


# -- Begin and end of a planned fault, by time and by a condition; without access to the devices -----------------------


Condition = Callable[[Any], bool]


@dataclass(frozen=True, slots=True)
class Moment:
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
    lasts: float | None = None


class Turn(Enum):
    """Result of a step."""

    NOTHING = 0
    BEGINS = 1
    ENDS = 2


class Cue:
    """Timing of one fault: the time of its next begin and of its end."""

    def __init__(self, moment: Moment) -> None:
        self._moment = moment
        self._due = moment.begin
        self._over: float | None = None
        self._next = 0.0  # earliest time of the next begin
        self._held = True  # whether the condition was true in the previous step
        self._ended = False  # whether it will not begin again

    def step(self, now: float, values: Any) -> Turn:
        """Return the change due at ``now``; ``values`` are for the condition. At most one change per step."""
        self._watch(now, values)
        if self._over is not None and now >= self._over:
            self._over = None
            return Turn.ENDS
        if self._due is None or now < self._due or self._over is not None:
            return Turn.NOTHING
        self._begin(now)
        return Turn.BEGINS

    def _watch(self, now: float, values: Any) -> None:
        if self._moment.when is None:
            return
        holds = bool(self._moment.when(values))
        rises, self._held = holds and not self._held, holds
        if rises and self._due is None and not self._ended and now >= self._next:
            self._due = now + self._moment.after

    def _begin(self, now: float) -> None:
        moment, due = self._moment, self._due
        assert due is not None
        self._over = None if moment.lasts is None else now + moment.lasts
        self._due, self._ended = None, moment.every is None
        if moment.every is None:
            return
        self._next = now + moment.every
        if moment.when is None:
            self._due = max(due + moment.every, now)  # missed begins are skipped
