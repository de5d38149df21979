"""Carry out a method called by a client as one command of each axis; report refusals as events."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable

from asyncua import ua

from axisbus.cell.model import CellConfig
from axisbus.errors import AxisbusError, one_line
from axisbus.gateway.opcua import limits
from axisbus.gateway.opcua.axis_readings import AxisReadings
from axisbus.gateway.opcua.event_mapping import REFUSED, OpcuaEvent
from axisbus.gateway.opcua.methods import NO_MACHINE, MethodResult, OpcuaMethod, carry_out, status_of
from axisbus.gateway.opcua.session import CALLER
from axisbus.machine.machine import Machine

log = logging.getLogger("axisbus")


async def _nobody_is_told(_: OpcuaEvent) -> None:
    return None


class OpcuaMethodCalls:
    """Carry out methods on the followed machine; ``refused`` is awaited with each failure."""

    def __init__(self, looker: AxisReadings, cell: CellConfig) -> None:
        self._looker, self._cell = looker, cell
        self.refused: Callable[[OpcuaEvent], Awaitable[None]] = _nobody_is_told

    async def call(self, verb: OpcuaMethod, axis: str) -> ua.CallMethodResult:
        """Carry out a method on an axis, or on all ("").

        By the standard, a call with a bad status has no result, so its text is sent as an event.
        """
        ended = await self._carried_out(verb, axis)
        log.info("OPC UA: %s of %s for %s: %s", verb.value, axis or "all axes", CALLER.get(), ended.status)
        result = ua.CallMethodResult(StatusCode=ua.StatusCode(getattr(ua.StatusCodes, ended.status)))
        if ended.status == "Good":
            result.OutputArguments = [ua.Variant(ended.text, ua.VariantType.String)]
        else:
            words = f"{verb.value} of {axis or 'all axes'}, called by {CALLER.get()}, failed"
            await self.refused(OpcuaEvent(self._looker.now(), REFUSED, words, ended.text, axis=axis))
        return result

    async def _carried_out(self, verb: OpcuaMethod, axis: str) -> MethodResult:
        machine = self._looker.machine
        if machine is None or machine.session.ended:
            return NO_MACHINE
        axes = [axis] if axis else list(self._cell.axes)
        try:
            if verb is OpcuaMethod.RESET:
                return await asyncio.to_thread(self._reset, axes)
            return await carry_out(machine, verb, axes, limits.HALTING)
        except AxisbusError as error:
            return MethodResult(status_of(error), one_line(error))

    def _reset(self, axes: list[str]) -> MethodResult:
        """Take control of the machine for the reset, and release it; blocks.

        Raises:
            OwnershipError: another program has control. Also the errors of ``Machine.attach``.
        """
        with Machine.attach(self._cell.file, command=True) as machine:
            return asyncio.run(carry_out(machine, OpcuaMethod.RESET, axes, limits.HALTING))
