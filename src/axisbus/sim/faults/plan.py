"""Planned faults of simulated devices: their settings are changed when a fault begins, and restored when it ends."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from axisbus.cia301.nmt import NmtCommand
from axisbus.sim.device import Device
from axisbus.sim.faults.fault_timing import Cue, Moment, Turn


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
    (0: no fault). ``restart``: the node restarts, as after a short loss of its supply.
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

    def _turn(self, fault: PlannedFault, values: Sequence[Any]) -> None:
        for dial, value in zip(fault.dials, values, strict=True):
            setattr(self._holder(fault, dial), dial.name, copy.copy(value))

    def _holder(self, fault: PlannedFault, dial: Dial) -> Any:
        device = self._devices[fault.node]
        dials = device.drives[fault.axis - 1].dials if dial.of_axis else device.dials
        return getattr(dials, dial.part) if dial.part else dials
