"""Carry out the pages' SDO transfers one after the other, and one long job in parallel; in one event loop."""

from __future__ import annotations

import asyncio
import logging
import time

from axisbus.client_support.object_access import node_of
from axisbus.errors import AxisbusError, ScanError, one_line
from axisbus.machine.machine import Machine
from axisbus.web.commands.object_requests import ObjectRequests
from axisbus.web.config.report import ConfigJob, ConfigProgress
from axisbus.web.objects.jobs import ObjectJob, TransferResult
from axisbus.web.objects.transfers import ObjectTransfers
from axisbus.web.view.axes import explained

log = logging.getLogger("axisbus")
PACE = 0.04  # seconds between two transfers: 25 in a second for all pages
_LOOK = 0.02  # seconds between two checks for work


class ObjectWorker:
    """Take transfers from the pages' queue; a thread runs blocking calls, and its exceptions do not end the worker."""

    def __init__(self, machine: Machine, wanted: ObjectRequests) -> None:
        """Nothing happens before ``run``."""
        self._machine = machine
        self._turns = wanted.turns
        self._verifying = wanted.verifying
        self._configuring = wanted.configuring
        self._transfers = ObjectTransfers(machine)

    async def run(self) -> None:
        """Run until cancelled."""
        beside = asyncio.create_task(self._beside())
        try:
            while True:
                job = self._turns.next(time.monotonic())
                if job is None:
                    await asyncio.sleep(_LOOK)
                else:
                    seen = await asyncio.to_thread(self._carry_out, job)
                    self._turns.done(seen, time.monotonic())
                    await asyncio.sleep(PACE)
        finally:
            self._verifying.end()
            self._configuring.end()
            beside.cancel()

    async def _beside(self) -> None:
        while True:
            node, wanted = self._verifying.take(), self._configuring.take()
            if node is not None:
                await asyncio.to_thread(self._verify_one, node)
            if wanted is not None:
                self._configuring.done(await asyncio.to_thread(self._configure, wanted))
            await asyncio.sleep(_LOOK)

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
