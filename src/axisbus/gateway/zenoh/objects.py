"""Objects of nodes for a fleet: any client may read them, the holder of the lease may write them; one transfer at a time."""

from __future__ import annotations

import logging
import math
import queue
import threading
from collections.abc import Callable

from axisbus.cia301.datatypes import DataType
from axisbus.cia301.datatypes import Value as Typed
from axisbus.client_support.object_access import node_of, require_readable, require_writable
from axisbus.configuration import guarded_write
from axisbus.eds.dictionary import DictionaryEntry
from axisbus.errors import ArgumentError, AxisbusError, StateError
from axisbus.fleet.messages import ObjectAnswer, Value
from axisbus.ipc.errors import to_fields
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode

log = logging.getLogger("axisbus")
_WAITING = 32  # transfers
_REAL = (DataType.REAL32, DataType.REAL64)
_TEXT = (DataType.VISIBLE_STRING, DataType.UNICODE_STRING)
Reply = Callable[[ObjectAnswer], None]
Work = Callable[[], ObjectAnswer]


class TransferWorker:
    """Carry out one transfer after the other in a thread of its own; ``put`` is for any thread."""

    def __init__(self) -> None:
        self._work: queue.Queue[tuple[Work, Reply] | None] = queue.Queue(_WAITING)
        self._thread = threading.Thread(target=self._run, name="objects", daemon=True)
        self._thread.start()

    def put(self, work: Work, reply: Reply) -> None:
        """Queue a transfer and answer it; refused if too many are waiting. Does not block."""
        try:
            self._work.put_nowait((work, reply))
        except queue.Full:
            reply(answer_of(StateError("too many transfers are waiting", remedy="try again in a moment")))

    def close(self) -> None:
        """End without carrying out the waiting transfers, and without waiting for the running one."""
        try:
            while True:
                self._work.get_nowait()
        except queue.Empty:
            self._work.put_nowait(None)

    def _run(self) -> None:
        while (each := self._work.get()) is not None:
            work, reply = each
            try:
                answer = work()
            except AxisbusError as error:
                answer = answer_of(error)
            except Exception as error:
                log.exception("an object could not be transferred")
                answer = answer_of(AxisbusError("the object could not be transferred", observed=str(error)))
            reply(answer)


def answer_of(error: AxisbusError) -> ObjectAnswer:
    """Return the answer that reports an error."""
    return ObjectAnswer(error=to_fields(error))


def read(machine: Machine, node_id: int, index: int, subindex: int) -> ObjectAnswer:
    """Read an object; blocks for one transfer.

    Raises:
        ArgumentError: the EDS does not have the object, or it must not be read.
        StateError, SdoError: as ``MachineSdo.read``.
    """
    node, entry = _entry(machine, node_id, index, subindex)
    require_readable(node, entry)
    return _shown(node.sdo.read(index, subindex))


def write(machine: Machine, node_id: int, index: int, subindex: int, value: Value) -> ObjectAnswer:
    """Write an object through a client that has control, and read it back; blocks for some transfers.

    Raises:
        ArgumentError, StateError: the object must not be written, now or ever, or not with this value; nothing was sent.
        SdoError: as ``MachineSdo.download``.
    """
    node, entry = _entry(machine, node_id, index, subindex)
    require_writable(node, entry)
    typed = _typed(entry, value)
    if not guarded_write.moves(node.eds, entry) and (energised := guarded_write.energised(node)):
        raise StateError(
            f"node {node_id} is energised, and any write may move it; nothing was sent",
            observed="; ".join(energised),
            remedy="disable its axes first",
        )
    written = guarded_write.write_in_machine(node, entry, typed, None, may_move=False)
    if not written.agrees(typed):
        raise StateError(
            f"node {node_id}: {entry} reads back another value",
            observed=f"{typed!r} was written, {written.after!r} was read back: the drive limits or rounds it",
        )
    return ObjectAnswer() if written.after is None else _shown(written.after)


def _entry(machine: Machine, node_id: int, index: int, subindex: int) -> tuple[MachineNode, DictionaryEntry]:
    node = node_of(machine, node_id)
    return node, node.sdo.dictionary.entry(index, subindex)


def _typed(entry: DictionaryEntry, value: Value) -> Typed:
    """Return a value in the type of the object; octets are given as hexadecimal digits."""
    kind, value_type = entry.data_type, type(value)
    if kind is None or value is None:
        raise ArgumentError(f"{entry}: its EDS gives no type, or the value is missing")
    if kind in _TEXT and isinstance(value, str):
        return value
    if kind in _REAL and value_type in (int, float) and math.isfinite(float(value)):
        return float(value)
    if kind.integer and (value_type is int or (kind is DataType.BOOLEAN and value_type is bool)):
        return int(value)
    if not kind.integer and kind not in (*_REAL, *_TEXT) and isinstance(value, str):
        return _octets(entry, value)
    raise ArgumentError(f"{entry}: {value!r} is not a value of its type, {kind.name}")


def _octets(entry: DictionaryEntry, digits: str) -> bytes:
    try:
        return bytes.fromhex(digits)
    except ValueError:
        raise ArgumentError(f"{entry}: {digits!r} are not hexadecimal digits", remedy="write 01FF") from None


def _shown(value: Typed) -> ObjectAnswer:
    if isinstance(value, bytes):
        return ObjectAnswer(hex=value.hex())
    if isinstance(value, float) and not math.isfinite(value):
        return ObjectAnswer(value=str(value))  # JSON has no NaN and no infinity
    return ObjectAnswer(value=value)
