"""The readings of all axes of the followed machine, from one process image; nothing here blocks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from axisbus.cell.model import CellConfig
from axisbus.cia402.port import ValueTransport
from axisbus.errors import AxisbusError, StateError
from axisbus.gateway.opcua.status_code import (
    GONE,
    NOT_SUPPORTED,
    WAITING,
    ImageFreshness,
    Memory,
    Number,
    OpcuaValue,
    Quality,
)
from axisbus.gateway.opcua.variables import MOTOR_TEMPERATURE, ROWS, OpcuaVariable
from axisbus.machine.machine import Machine
from axisbus.motion.snapshot import Snapshot
from axisbus.session import AxisFacts

Key = tuple[str, str]  # names of an axis and a variable


class AxisReadings:
    """Hold the followed machine (None: none runs), its last known values, and the measured temperatures.

    ``machine`` and ``temperatures`` may be set in another thread than the one that calls ``look``.
    """

    def __init__(self, cell: CellConfig) -> None:
        self._cell = cell
        self._memory = Memory()
        self._machine: Machine | None = None
        self._nothing = WAITING  # until the first machine runs
        self.temperatures: dict[str, OpcuaValue] = {}

    @property
    def machine(self) -> Machine | None:
        """The followed machine."""
        return self._machine

    def follow(self, machine: Machine | None) -> None:
        """Follow another machine, or none: the values of the previous one are no longer usable."""
        if machine is not None:
            self._nothing = GONE  # the state after this machine has ended
        self.temperatures = {}
        self._memory.forget()
        self._machine = machine

    @property
    def image(self) -> ImageFreshness:
        """The freshness of the machine's process image."""
        machine = self._machine
        if machine is None or machine.session.ended or machine.session.dead is not None:
            return ImageFreshness.NONE
        return ImageFreshness.NOW if machine.session.silent is None else ImageFreshness.OLD

    def now(self) -> float:
        """The time of the machine's clock, in seconds: monotonic, or the newest time of a machine in virtual time."""
        machine = self._machine
        if machine is None or machine.session.waiter.realtime:
            return time.monotonic()
        return max((snapshot.now for snapshot in machine.session.snapshots.values()), default=0.0)

    def look(self) -> dict[Key, OpcuaValue]:
        """Return the reading of every variable of every axis of the cell."""
        machine, image = self._machine, self.image
        if machine is None or image is ImageFreshness.NONE:
            return {(axis, row.name): self._nothing for axis in self._cell.axes for row in ROWS}
        snapshots, facts = dict(machine.session.snapshots), dict(machine.session.axes)
        found: dict[Key, OpcuaValue] = {}
        for axis in self._cell.axes:
            if axis in snapshots and axis in facts:
                found |= self._of_axis(axis, snapshots[axis], facts[axis], image)
            else:  # its node is optional and has not booted
                found |= {(axis, row.name): GONE for row in ROWS}
        return found

    def _of_axis(
        self, axis: str, snapshot: Snapshot, facts: AxisFacts, image: ImageFreshness
    ) -> dict[Key, OpcuaValue]:
        return {
            (axis, row.name): self._temperature(axis)
            if row.name == MOTOR_TEMPERATURE
            else self._reading((axis, row.name), row, snapshot, facts, image)
            for row in ROWS
        }

    def _reading(
        self, key: Key, row: OpcuaVariable, snapshot: Snapshot, facts: AxisFacts, image: ImageFreshness
    ) -> OpcuaValue:
        if row.source and not _travels(row, facts):
            return NOT_SUPPORTED
        if row.source and not snapshot.operational:
            return GONE
        assert row.value is not None
        fresh: Number | None = row.value(snapshot, facts.parameters.units)
        return self._memory.judge(key, fresh, row.stamp(snapshot), image)

    def _temperature(self, axis: str) -> OpcuaValue:
        found = self.temperatures.get(axis, WAITING)
        old = found.stamp is not None and self.now() - found.stamp > 2 * TEMPERATURES_EVERY
        return (
            OpcuaValue(found.value, Quality.LAST_USABLE, found.stamp)
            if old and found.value is not None
            else found
        )


TEMPERATURES_EVERY = 10.0  # seconds between two readings of an axis


def _travels(row: OpcuaVariable, facts: AxisFacts) -> bool:
    return facts.capabilities.inputs.get(row.source, ValueTransport.NONE) is not ValueTransport.NONE


def measured(machine: Machine, now: Callable[[], float]) -> Iterator[tuple[str, OpcuaValue]]:
    """Read the temperature of each axis by SDO, one after the other; blocks for each. An axis without one gets a bad value."""
    for axis in machine:
        try:
            yield axis.name, OpcuaValue(axis.temperature, Quality.GOOD, now())
        except StateError:
            yield axis.name, NOT_SUPPORTED
        except AxisbusError:
            yield axis.name, GONE
