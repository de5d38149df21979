"""Writing what cell.toml says into a node's objects, each read back and compared."""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.cia301 import abort
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import Value
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import BootError, SdoAbort, SdoError
from axisbus.machine.access import Objects, read_int
from axisbus.machine.cell import BusConfig, CellConfig
from axisbus.machine.services import set_services
from axisbus.machine.stopping import NO_WATCHDOG, Watchdog, WatchdogReport
from axisbus.machine.writes import Write, axis_writes, node_writes

HEARTBEATS = 3  # missed ones after which a drive may call the master dead, and the master a drive


def writes_of(cell: CellConfig, node_id: int, dictionary: Dictionary) -> list[Write]:
    """Return what the cell file has written into a node, in order: the node's own objects, then those of its axes.

    Raises:
        ArgumentError: a key names no object.
    """
    writes = list(node_writes(cell.nodes[node_id], dictionary))
    for axis in cell.axes_of(node_id):
        writes += axis_writes(axis, dictionary)
    return writes


def write_all(objects: Objects, writes: Iterable[Write], file: str) -> int:
    """Write and read back; return how many objects were written.

    Raises:
        BootError: the node refuses one, or reads back another value; it names object, expected and got.
    """
    count = 0
    for write in writes:
        _write_one(objects, write, file)
        count += 1
    return count


def _write_one(objects: Objects, write: Write, file: str) -> None:
    try:
        objects.write(write.index, write.subindex, write.value)
        got = _read_back(objects, write)
    except SdoAbort as error:
        hint = error.remedy or abort.explain(error.code).hint
        raise _failed(objects, write, file, "the drive refuses it", error.observed, hint) from error
    except SdoError as error:
        remedy = "" if isinstance(error, SdoAbort) else error.remedy
        raise _failed(objects, write, file, error.message, error.observed, remedy) from error
    if got is not None and got != write.value and not _close(got, write.value):
        raise _failed(
            objects,
            write,
            file,
            "reads back another value",
            f"expected {write.value!r}, got {got!r}",
            "the drive limits or rounds this value: write one that it takes (its manual lists the range)",
        )


def _read_back(objects: Objects, write: Write) -> Value | None:
    """Return what the node now has, None where the object may only be written."""
    try:
        return objects.read(write.index, write.subindex)
    except SdoAbort:
        return None


def _close(got: Value, wanted: Value) -> bool:
    """REAL32 comes back rounded."""
    if isinstance(got, float) and isinstance(wanted, (int, float)):
        return abs(got - wanted) <= 1e-6 * max(1.0, abs(wanted))
    return False


def _failed(objects: Objects, write: Write, file: str, what: str, observed: str, remedy: str) -> BootError:
    return BootError(
        f"node {objects.node_id}: {write.index:04X}h:{write.subindex:02X} cannot be set to {write.value!r} "
        f"({write.source}, {file}:{write.line}): {what}",
        node=objects.node_id,
        step="configuration",
        index=write.index,
        subindex=write.subindex,
        observed=observed,
        remedy=remedy or "give a value that the drive takes (its manual lists them), or leave the line out",
    )


class Watch:
    """The watchdogs on both sides: the drive's heartbeat for us, and the drive's watch over ours; holds what to restore."""

    def __init__(self, objects: Objects, bus: BusConfig) -> None:
        self._objects = objects
        self._bus = bus
        self._before: list[tuple[int, int, int]] = []  # index, sub-index, value to give back
        self.guarding: float | None = None

    def set_sync(self) -> None:
        """Make sure that the node hears the bus's SYNC and TIME: 1005h, 1019h, 1012h; raises as ``services.set_services``."""
        set_services(self._objects, self._bus)

    def produce(self) -> float | None:
        """Set 1017h so that the node sends a heartbeat; return the time in s after which it counts as lost, None: it sends none."""
        if self._bus.heartbeat is None:
            return None
        period = round(self._bus.heartbeat * 1000)
        try:
            self._objects.write(o.PRODUCER_HEARTBEAT, 0, period)
        except SdoAbort:
            return None
        got = read_int(self._objects, o.PRODUCER_HEARTBEAT)
        return None if not got else max(HEARTBEATS * got / 1000, 0.15)

    def arm(self, reaction: str | None) -> WatchdogReport:
        """Let the node notice our death: by 1016h, else by 100Ch and 100Dh (then ``guarding`` holds the period in s).

        ``reaction``: what 6007h says, None where the drive has none.
        """
        if self._bus.heartbeat is None:
            return NO_WATCHDOG
        how = self._consume(self._bus.heartbeat) or self._guard(self._bus.heartbeat)
        if how is None:
            return NO_WATCHDOG
        if reaction is None:
            return WatchdogReport(
                Watchdog.UNKNOWN, how + "; there is no 6007h, so what the drive then does is in its manual"
            )
        return WatchdogReport(Watchdog.ARMED, f"{how}; else it {reaction}")

    def restore(self) -> None:
        """Give 1016h, or 100Ch and 100Dh, back what they had, so that our silence after closing faults nobody.

        Raises:
            SdoError, BusError: the node does not answer.
        """
        while self._before:
            index, subindex, value = self._before.pop()
            self._objects.write_unchecked(index, subindex, value)

    def _consume(self, heartbeat: float) -> str | None:
        milliseconds = round(heartbeat * 1000 * HEARTBEATS)
        subindex = self._free_entry()
        if subindex is None:
            return None
        before = read_int(self._objects, o.CONSUMER_HEARTBEAT, subindex) or 0
        ours = before >> 16 & 0x7F == self._bus.master_id  # left behind by a program that was killed
        wanted = self._bus.master_id << 16 | milliseconds
        if not self._set(o.CONSUMER_HEARTBEAT, subindex, wanted, 0 if ours else before):
            return None
        return f"1016h:{subindex:02X} expects our heartbeat within {milliseconds} ms"

    def _guard(self, heartbeat: float) -> str | None:
        before = [read_int(self._objects, index) for index in (o.GUARD_TIME, o.LIFE_TIME_FACTOR)]
        if None in before:
            return None
        period = round(heartbeat * 1000)
        wanted = ((o.GUARD_TIME, period, before[0]), (o.LIFE_TIME_FACTOR, HEARTBEATS, before[1]))
        if not all(self._set(index, 0, value, old or 0) for index, value, old in wanted):
            return None
        self.guarding = heartbeat
        return f"100Ch and 100Dh expect our guarding within {period * HEARTBEATS} ms"

    def _set(self, index: int, subindex: int, value: int, back: int) -> bool:
        """Write and read back; keep what to restore. The limits of the EDS are not asked: for 1016h many are wrong."""
        try:
            self._objects.write_unchecked(index, subindex, value)
        except SdoAbort:
            return False
        self._before.append((index, subindex, back))
        return read_int(self._objects, index, subindex) == value

    def _free_entry(self) -> int | None:
        """Return the entry that watches us already, else the first free one."""
        count = read_int(self._objects, o.CONSUMER_HEARTBEAT)
        free = None
        for subindex in range(1, (count or 0) + 1):
            value = read_int(self._objects, o.CONSUMER_HEARTBEAT, subindex)
            if value is not None and value >> 16 & 0x7F == self._bus.master_id:
                return subindex
            if free is None and value is not None and (not value & 0xFFFF or not value >> 16 & 0x7F):
                free = subindex
        return free
