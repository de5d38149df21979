"""The readings of all axes of the followed machine, from one process image; nothing here blocks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from enum import Enum
from typing import NamedTuple

from axisbus.cell.model import CellConfig
from axisbus.cia402.port import ValueTransport
from axisbus.errors import AxisbusError, StateError
from axisbus.gateway.opcua.variables import MOTOR_TEMPERATURE, ROWS, Number, OpcuaVariable
from axisbus.machine.machine import Machine
from axisbus.motion.snapshot import Snapshot
from axisbus.session import AxisFacts

# -- Decide whether a value is good, uncertain or bad, by the age of the process image and the last good value; pure -------


class Quality(Enum):
    """The quality of a value; each has one status code of OPC UA (OPC 10000-4 7.38.2, OPC 10000-8 6.3.2)."""

    GOOD = "Good"
    LAST_USABLE = "UncertainLastUsableValue"
    WAITING = "BadWaitingForInitialData"
    NO_COMMUNICATION = "BadNoCommunication"
    NOT_SUPPORTED = "BadNotSupported"


class OpcuaValue(NamedTuple):
    """A value (None if it is bad), its quality, and its time: ``stamp`` in seconds of the core's clock, None: unknown."""

    value: Number | None
    quality: Quality
    stamp: float | None = None


class ImageFreshness(Enum):
    """Whether the process image is up to date, is old because the core runs no cycles, or is missing: no machine runs."""

    NOW = "now"
    OLD = "old"
    NONE = "none"


WAITING = OpcuaValue(None, Quality.WAITING)
GONE = OpcuaValue(None, Quality.NO_COMMUNICATION)
NOT_SUPPORTED = OpcuaValue(None, Quality.NOT_SUPPORTED)


def judged(fresh: Number | None, stamp: float, image: ImageFreshness, last: OpcuaValue | None) -> OpcuaValue:
    """Return the reading of a value that is received from the drive.

    ``fresh`` is None if the value was never received, or is older than its maximum age; ``last`` is the last good reading of the
    same machine. A value is good only while both it and the process image are fresh.
    """
    if image is ImageFreshness.NONE:
        return GONE
    if fresh is not None and image is ImageFreshness.NOW:
        return OpcuaValue(fresh, Quality.GOOD, stamp)
    if last is None:
        return WAITING
    return OpcuaValue(last.value, Quality.LAST_USABLE, last.stamp)


class Memory:
    """Store the last good reading of each value of one machine."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, str], OpcuaValue] = {}

    def judge(
        self, key: tuple[str, str], fresh: Number | None, stamp: float, image: ImageFreshness
    ) -> OpcuaValue:
        """Judge a value, and store it if it is good."""
        found = judged(fresh, stamp, image, self._last.get(key))
        if found.quality is Quality.GOOD:
            self._last[key] = found
        return found

    def forget(self) -> None:
        """Forget all readings: the next ones belong to another machine."""
        self._last.clear()


# -- The readings of all axes from one process image -----------------------------------------------------------------------

Key = tuple[str, str]  # names of an axis and a variable


class AxisReadings:
    """Hold the followed machine (None: none runs), its last known values, and the measured temperatures.

    ``machine`` and ``temperatures`` may be set in a thread other than the one that calls ``poll``.
    """

    def __init__(self, cell: CellConfig) -> None:
        self._cell = cell
        self._memory = Memory()
        self._machine: Machine | None = None
        self._without_machine = WAITING  # until the first machine runs
        self.temperatures: dict[str, OpcuaValue] = {}

    @property
    def machine(self) -> Machine | None:
        """The followed machine."""
        return self._machine

    def follow(self, machine: Machine | None) -> None:
        """Follow another machine, or none: the values of the previous one are no longer usable."""
        if machine is not None:
            self._without_machine = GONE  # the state after this machine has ended
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

    def poll(self) -> dict[Key, OpcuaValue]:
        """Return the reading of every variable of every axis of the cell."""
        machine, image = self._machine, self.image
        if machine is None or image is ImageFreshness.NONE:
            return {(axis, row.name): self._without_machine for axis in self._cell.axes for row in ROWS}
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
        old = found.stamp is not None and self.now() - found.stamp > 2 * TEMPERATURE_PERIOD
        return (
            OpcuaValue(found.value, Quality.LAST_USABLE, found.stamp)
            if old and found.value is not None
            else found
        )


TEMPERATURE_PERIOD = 10.0  # seconds between two readings of an axis


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
