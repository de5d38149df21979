"""The plan of a node's boot-up, and the setup of the node's monitoring of the master."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from axisbus.boot.objects import NodeObjects, read_int
from axisbus.boot.stop_report import NO_WATCHDOG, Watchdog, WatchdogReport
from axisbus.cell.axis_description import limit_writes
from axisbus.cell.model import BusConfig, CellConfig
from axisbus.cell.program_file import wanted_program
from axisbus.cell.writes import CellWrite, axis_writes, is_fixed, node_writes
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.nmt import watched_node
from axisbus.cia302.types import Address, BootPlan, Expected, Setting
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import BootError, SdoAbort

HEARTBEATS = 3  # missed ones after which a drive may treat the master as dead, and the master a drive
_MOST_WATCHED = 127  # entries of 1016h (CiA 301 7.5.2.19)


def writes_of(cell: CellConfig, node_id: int, dictionary: Dictionary) -> list[CellWrite]:
    """Return the writes that the cell file asks for in a node, in order: the node's own objects, then those of its axes.

    Raises:
        ArgumentError: a key names no object.
    """
    writes = list(node_writes(cell.nodes[node_id], dictionary))
    for axis in cell.axes_of(node_id):
        writes += axis_writes(axis, dictionary)
        writes += limit_writes(axis, dictionary, writes)
    return writes


def plan_of(
    cell: CellConfig,
    node_id: int,
    eds: Eds,
    identity: Mapping[Address, Expected],
    find_tries: int,
    late: bool = False,
) -> BootPlan:
    """Return the boot-up plan of a node from the cell file and the EDS.

    ``identity``: the expected one; ``late``: the node appears while the machine runs.

    Raises:
        ArgumentError: a key of an ``objects`` table names no object.
        ConfigError: the file of a program cannot be read.
    """
    node = cell.nodes[node_id]
    writes = writes_of(cell, node_id, Dictionary(eds, node_id))
    return BootPlan(
        node_id,
        identity=identity,
        find_tries=find_tries,
        program=wanted_program(cell, node, late),
        restore=node.restore_defaults,
        settings=tuple(
            Setting(
                write.index,
                write.subindex,
                write.value,
                f"{write.source}, {cell.file}:{write.line}",
                fixed=is_fixed(write, eds),
            )
            for write in writes
        ),
        version=node.version,
        heartbeat=cell.bus.heartbeat,
        missed=HEARTBEATS,
    )


class DriveMonitoringSetup:
    """Set up the drive's monitoring of the master; holds the original values to restore."""

    def __init__(self, objects: NodeObjects, bus: BusConfig) -> None:
        self._objects = objects
        self._bus = bus
        self._before: list[tuple[int, int, int]] = []  # index, sub-index, original value
        self._refusals: list[str] = []  # the writes that the drive has refused
        self.guarding: float | None = None

    def arm(self, reaction: str | None) -> WatchdogReport:
        """Make the node monitor the master: by 1016h, else by 100Ch and 100Dh (then ``guarding`` holds the period in s).

        ``reaction``: the meaning of the drive's 6007h, None if the drive has no 6007h.
        """
        if self._bus.heartbeat is None:
            return NO_WATCHDOG
        how = self._consume(self._bus.heartbeat) or self._guard(self._bus.heartbeat)
        return self._unarmed() if how is None else _report(how, reaction)

    def arm_deadlines(self, numbers: Iterable[int], reaction: str | None) -> WatchdogReport:
        """Make the node monitor the arrival of the RPDOs with these ``numbers`` (from 1): 14xxh:05, as the third choice.

        Use it for RPDOs that the master sends at least as often as its heartbeat. The node begins to monitor an RPDO
        when it receives the RPDO for the first time.
        """
        if self._bus.heartbeat is None:
            return NO_WATCHDOG
        milliseconds = max(1, round(self._bus.heartbeat * 1000 * HEARTBEATS))
        armed = [number for number in numbers if self._expect_rpdo(number, milliseconds)]
        if not armed:
            return self._unarmed()
        objects = ", ".join(f"{o.RPDO_COMMUNICATION + number - 1:04X}h:05" for number in armed)
        how = f"{objects} expects the master's RPDO within {milliseconds} ms, from the first command on"
        return _report(how, reaction)

    def _unarmed(self) -> WatchdogReport:
        refused = f"; refused: {', '.join(self._refusals)}" if self._refusals else ""
        return replace(NO_WATCHDOG, text=NO_WATCHDOG.text + refused)

    def _expect_rpdo(self, number: int, milliseconds: int) -> bool:
        index = o.RPDO_COMMUNICATION + number - 1
        before = read_int(self._objects, index, o.PDO_EVENT_TIMER)
        return before is not None and self._set(index, o.PDO_EVENT_TIMER, milliseconds, before)

    def restore(self) -> None:
        """Restore 1016h, 100Ch and 100Dh, or 14xxh:05, so that no drive goes to fault when the master is silent after closing.

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
        ours = watched_node(before) == self._bus.master_id  # an entry left by a program that was killed
        wanted = self._bus.master_id << 16 | milliseconds
        if not self._set(o.CONSUMER_HEARTBEAT, subindex, wanted, 0 if ours else before):
            return None
        return f"1016h:{subindex:02X} expects the master's heartbeat within {milliseconds} ms"

    def _guard(self, heartbeat: float) -> str | None:
        before = [read_int(self._objects, index) for index in (o.GUARD_TIME, o.LIFE_TIME_FACTOR)]
        if None in before:
            return None
        period = round(heartbeat * 1000)
        wanted = ((o.GUARD_TIME, period, before[0]), (o.LIFE_TIME_FACTOR, HEARTBEATS, before[1]))
        if not all(self._set(index, 0, value, old or 0) for index, value, old in wanted):
            return None
        self.guarding = heartbeat
        return f"100Ch and 100Dh expect the master's guarding within {period * HEARTBEATS} ms"

    def _set(self, index: int, subindex: int, value: int, back: int) -> bool:
        """Write and read back; remember the value to restore. The EDS limits are not checked: many are wrong for 1016h."""
        try:
            self._objects.write_unchecked(index, subindex, value)
        except SdoAbort as refusal:
            self._refusals.append(
                f"{index:04X}h:{subindex:02X} = 0x{value:X} (abort code 0x{refusal.code:08X})"
            )
            return False
        self._before.append((index, subindex, back))
        got = read_int(self._objects, index, subindex)
        if got != value:
            self._refusals.append(f"{index:04X}h:{subindex:02X} = 0x{value:X} (it reads back {got})")
        return got == value

    def _free_entry(self) -> int | None:
        """Return the entry that already monitors the master, else the first free one."""
        count = read_int(self._objects, o.CONSUMER_HEARTBEAT)
        free = None
        for subindex in range(1, min(count or 0, _MOST_WATCHED) + 1):
            value = read_int(self._objects, o.CONSUMER_HEARTBEAT, subindex)
            watched = None if value is None else watched_node(value)
            if watched == self._bus.master_id:
                return subindex
            if free is None and watched == 0:
                free = subindex
        return free


def _report(how: str, reaction: str | None) -> WatchdogReport:
    if reaction is None:
        return WatchdogReport(
            Watchdog.UNKNOWN, how + "; there is no 6007h: the drive's manual says how it reacts"
        )
    return WatchdogReport(Watchdog.ARMED, f"{how}; else it {reaction}")


# -- Set the bus's SYNC and TIME in a node at boot: 1005h, 1019h and 1012h, each read back -----------------------------


def set_services(objects: NodeObjects, bus: BusConfig) -> None:
    """Make a node use the bus's SYNC with its counter, and TIME if the master sends it; blocks for a few transfers.

    Missing objects are left out: a node without 1005h does not use SYNC, one without 1012h does not use TIME.

    Raises:
        BootError: the node uses another SYNC, SYNC counter or TIME and refuses to change it.
        SdoError, BusError: the node does not answer.
    """
    if bus.sync:
        _set_sync(objects, bus)
        _set_counter(objects, bus)
    if bus.time is not None:
        _set_time(objects, bus)


def _set_sync(objects: NodeObjects, bus: BusConfig) -> None:
    """Set 1005h (CiA 301 7.5.2.5); bit 30 makes the node a producer, which is allowed only to the bus's external producer."""
    now = read_int(objects, o.COB_ID_SYNC)
    if now is None:
        return
    produces = bool(now & cob.SYNC_PRODUCER)
    same = now & cob.ID_MASK_29 == bus.sync_cob_id
    if same and (bus.hears_sync or not produces):
        return
    try:
        if produces:  # its COB-ID must not change while it sends
            objects.write_unchecked(o.COB_ID_SYNC, 0, now & ~cob.SYNC_PRODUCER)
        if not same:
            objects.write_unchecked(o.COB_ID_SYNC, 0, bus.sync_cob_id)
        if produces and bus.hears_sync:
            objects.write_unchecked(o.COB_ID_SYNC, 0, bus.sync_cob_id | cob.SYNC_PRODUCER)
    except SdoAbort as error:
        what = "does not receive the bus's SYNC" if not same else "sends SYNC, as the master does"
        raise _failed(
            objects,
            o.COB_ID_SYNC,
            f"it {what}",
            f"1005h is 0x{now:X}, SYNC has COB-ID 0x{bus.sync_cob_id:X}; {error.observed}",
            f"set 1005h to 0x{bus.sync_cob_id:X} with the drive's own tool, or correct sync_cob_id or sync in [bus]",
        ) from error


def _set_counter(objects: NodeObjects, bus: BusConfig) -> None:
    """Set 1019h (CiA 301 7.5.2.22), which may change only while 1006h is 0."""
    now = read_int(objects, o.SYNC_COUNTER_OVERFLOW)
    if now is None or now == bus.sync_counter:
        return
    period = read_int(objects, o.CYCLE_PERIOD) or 0
    counts = str(now) if now else '"off"'
    try:
        if period:
            objects.write_unchecked(o.CYCLE_PERIOD, 0, 0)
        objects.write_unchecked(o.SYNC_COUNTER_OVERFLOW, 0, bus.sync_counter)
        if period:
            objects.write_unchecked(o.CYCLE_PERIOD, 0, period)
    except SdoAbort as error:
        raise _failed(
            objects,
            o.SYNC_COUNTER_OVERFLOW,
            "the SYNC counter that it expects differs from that of the bus",
            f"1019h is {now}, sync_counter is {bus.sync_counter or 'off'}; {error.observed}",
            f"write sync_counter = {counts} in [bus], or set 1019h with the drive's own tool",
        ) from error


def _set_time(objects: NodeObjects, bus: BusConfig) -> None:
    """Set 1012h: bit 31 makes the node a consumer of TIME, bit 30 a producer. A node without 1012h is left as it is."""
    now = read_int(objects, o.COB_ID_TIME)
    wanted = cob.TIME_CONSUMER | bus.time_cob_id
    if now is None or now & (cob.TIME_CONSUMER | cob.TIME_PRODUCER | cob.ID_MASK_29) == wanted:
        return
    try:
        if now & (cob.TIME_CONSUMER | cob.TIME_PRODUCER):  # its COB-ID must not change while it is in use
            off = now & ~(cob.TIME_CONSUMER | cob.TIME_PRODUCER)
            objects.write_unchecked(o.COB_ID_TIME, 0, off)
        objects.write_unchecked(o.COB_ID_TIME, 0, wanted)
    except SdoAbort as error:
        raise _failed(
            objects,
            o.COB_ID_TIME,
            "it does not receive TIME",
            f"1012h is 0x{now:X}, TIME has COB-ID 0x{bus.time_cob_id:X}; {error.observed}",
            "correct time_cob_id in [bus], or set 1012h with the drive's own tool",
        ) from error


def _failed(objects: NodeObjects, index: int, what: str, observed: str, remedy: str) -> BootError:
    return BootError(
        f"node {objects.node_id}: {what}",
        node=objects.node_id,
        step="configuration",
        index=index,
        observed=observed,
        remedy=remedy,
    )
