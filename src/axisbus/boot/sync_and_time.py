"""Set the bus's SYNC and TIME in a node at boot: 1005h, 1019h and 1012h, each read back."""

from __future__ import annotations

from axisbus.boot.objects import NodeObjects, read_int
from axisbus.cell.model import BusConfig
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.errors import BootError, SdoAbort


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
            "it expects another counter in SYNC than the bus has",
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
