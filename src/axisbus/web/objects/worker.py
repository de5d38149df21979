"""Carry out the pages' SDO transfers one after the other, and one long job in parallel; in one event loop."""

from __future__ import annotations

import asyncio
import logging
import time

from axisbus.bus.sdo.value import checked_bytes
from axisbus.cell.quantities import Quantities
from axisbus.cia301 import objects as c301
from axisbus.cia301.datatypes import Value
from axisbus.cia402.objects import order
from axisbus.client_support.object_access import node_of, require_readable, require_writable
from axisbus.configuration import guarded_write, parse_values
from axisbus.eds.dictionary import DictionaryEntry
from axisbus.errors import AxisbusError, ScanError, SdoTimeout, one_line
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode
from axisbus.trace import frame_formats, value_text
from axisbus.web.commands.object_requests import ObjectRequests
from axisbus.web.config.report import ConfigJob, ConfigProgress
from axisbus.web.objects.transfer_queue import ObjectJob, TransferRequest, TransferResult, WriteConfirmation
from axisbus.web.view import explained

log = logging.getLogger("axisbus")
PACE = 0.04  # seconds between two transfers: 25 in a second for all pages
_POLL_PERIOD = 0.02  # seconds between two checks for work


class ObjectWorker:
    """Take transfers from the pages' queue; a thread runs blocking calls, and its exceptions do not end the worker."""

    def __init__(self, machine: Machine, wanted: ObjectRequests) -> None:
        """Nothing happens before ``run``."""
        self._machine = machine
        self._queue = wanted.queue
        self._verifying = wanted.verifying
        self._configuring = wanted.configuring
        self._transfers = ObjectTransfers(machine)

    async def run(self) -> None:
        """Run until cancelled."""
        background = asyncio.create_task(self._run_background())
        try:
            while True:
                job = self._queue.next(time.monotonic())
                if job is None:
                    await asyncio.sleep(_POLL_PERIOD)
                else:
                    result = await asyncio.to_thread(self._carry_out, job)
                    self._queue.store_result(result, time.monotonic())
                    await asyncio.sleep(PACE)
        finally:
            self._verifying.end()
            self._configuring.end()
            background.cancel()

    async def _run_background(self) -> None:
        while True:
            node, wanted = self._verifying.take(), self._configuring.take()
            if node is not None:
                await asyncio.to_thread(self._verify_one, node)
            if wanted is not None:
                self._configuring.done(await asyncio.to_thread(self._configure, wanted))
            await asyncio.sleep(_POLL_PERIOD)

    def _configure(self, wanted: ConfigJob) -> ConfigProgress:
        try:
            return self._configuring.carry_out(self._machine, node_of(self._machine, wanted.node), wanted)
        except Exception as error:  # noqa: BLE001  # the page must get any error
            return self._configuring.failed(wanted, _of_the_library(error))

    def _verify_one(self, node_id: int) -> None:
        try:
            self._verifying.carry_out(node_of(self._machine, node_id))
        except Exception as error:  # noqa: BLE001  # the page must get any error
            self._verifying.fail(node_id, _of_the_library(error))

    def _carry_out(self, job: ObjectJob) -> TransferResult:
        try:
            return self._transfers.carry_out(job)
        except Exception as error:  # noqa: BLE001  # the other pages' transfers continue
            return TransferResult(job, time.monotonic(), error=explained(_of_the_library(error)))


def _of_the_library(error: Exception) -> AxisbusError:
    """Return an exception as an error of the library; any other exception is a bug and is logged."""
    if isinstance(error, AxisbusError):
        return error
    log.error("a request of a page was aborted", exc_info=error)
    return ScanError(
        "it was aborted by a fault in the program of the page",
        observed=one_line(error),
        remedy="please report it",
    )


# -- Carry out one transfer: read an object, or check, write and read back an object; with error texts for the page ----
#
# A page may read and write the same objects as any client (``client_support.object_access``). If ``axisbus od write`` would require
# ``--may-move``, the page asks a question.


ORDER, ENERGISED = "order", "energised"  # reasons for a question


class ObjectTransfers:
    """Carry out transfers; each blocks for at most as long as the master waits for the node."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._quantities = Quantities(machine.cell)

    def carry_out(self, job: ObjectJob) -> TransferResult:
        """Return the result of a transfer; an error of the library is a possible result."""
        try:
            node = node_of(self._machine, job.key.node)
            entry = node.sdo.dictionary.entry(job.key.index, job.key.subindex)
            if job.write_request is None:
                return self._read(job, node, entry)
            return self._write(job, job.write_request, node, entry)
        except AxisbusError as error:
            return TransferResult(
                job, time.monotonic(), error=explained(error), silent=isinstance(error, SdoTimeout)
            )

    def _read(self, job: ObjectJob, node: MachineNode, entry: DictionaryEntry) -> TransferResult:
        require_readable(node, entry)
        value = node.sdo.read(entry.index, entry.subindex)
        return TransferResult(job, time.monotonic(), self._shown(node, entry, value))

    def _write(
        self, job: ObjectJob, write_request: TransferRequest, node: MachineNode, entry: DictionaryEntry
    ) -> TransferResult:
        value = self._checked(write_request.text, node, entry)
        reasons = {} if guarded_write.moves(node.eds, entry) else _reasons(node, entry)
        if not write_request.agreed.issuperset(reasons):
            what = f"Write {self._shown(node, entry, value)} to {entry} of node {node.node_id}?"
            question = WriteConfirmation(" ".join((what, *reasons.values())), frozenset(reasons))
            return TransferResult(job, time.monotonic(), question=question)
        written = guarded_write.write_in_machine(
            node, entry, value, None, may_move=ENERGISED in write_request.agreed
        )
        result_text = written.result_text(value, lambda one: self._shown(node, entry, one))
        after = None if written.after is None else self._shown(node, entry, written.after)
        if not written.agrees(value):
            error = {"message": f"{entry} {result_text}", "observed": "", "remedy": ""}
            return TransferResult(job, time.monotonic(), after, error)
        return TransferResult(job, time.monotonic(), after, note=result_text + _storing_note(node, entry))

    def _checked(self, typed: str, node: MachineNode, entry: DictionaryEntry) -> Value:
        """Return a typed text as a value, if the EDS and the cell file permit writing it; sends nothing."""
        require_writable(node, entry)
        quantity = self._quantities.of(node.node_id, entry.index, entry.subindex)
        value = parse_values.value(typed, entry, entry.data_type, quantity, files=False)
        checked_bytes(entry, value)
        return value

    def _shown(self, node: MachineNode, entry: DictionaryEntry, value: Value | None) -> str:
        if value is None:
            return "unknown"
        return frame_formats.shown(
            value_text.value_of(self._quantities, node.node_id, node.sdo.dictionary, entry, value)
        )


def _reasons(node: MachineNode, entry: DictionaryEntry) -> dict[str, str]:
    """Return the reasons to ask a question before writing; blocks for one transfer per axis of the node."""
    found = {}
    if what := order(entry.index):
        found[ORDER] = f"{what[0].upper()}{what[1:]}."
    if energised := guarded_write.energised(node):
        found[ENERGISED] = f"The node is energised ({'; '.join(energised)}), and any write may move it."
    return found


def _storing_note(node: MachineNode, entry: DictionaryEntry) -> str:
    stores = node.sdo.dictionary.has(c301.STORE_PARAMETERS, 1) and not guarded_write.is_command(entry.index)
    return f"; it is in RAM only; to store it: axisbus save {node.node_id} ..." if stores else ""
