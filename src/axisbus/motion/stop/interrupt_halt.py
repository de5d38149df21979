"""Halt every axis that this master has commanded, after its program was interrupted; the axes stay enabled.

The program continues.
"""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.motion.axis.accept import accept
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, unattended
from axisbus.motion.commands import HandOver, QuickStop
from axisbus.motion.states import MOVING, AxisState


class Halting:
    """Holds the number of the last interrupt, and the tickets of its halts."""

    def __init__(self) -> None:
        self._last = 0
        self._tickets: list[CommandStatus] = []

    def begin(self, cores: Mapping[str, AxisCore], reason: str, number: int) -> None:
        """Halt every axis that was set in motion; if halts of an earlier interrupt still run, do a quick stop of all.

        ``number`` identifies the interrupt, because one interrupt may be reported twice; 0 identifies none.
        """
        again = 0 not in (number, self._last) and number != self._last
        harder = again and any(ticket.busy for ticket in self._tickets)
        self._last = number or self._last
        self._tickets = [ticket for ticket in self._tickets if ticket.busy]
        for name, core in cores.items():
            ticket = unattended(f"{name}.quick_stop()" if harder else f"{name}.halt()")
            moves = core.touched and (core.state in MOVING or core.state is AxisState.STOPPING)
            why = f"{name} was halted: {reason}"
            accept(core, QuickStop() if harder and moves else HandOver(why), ticket)
            self._tickets.append(ticket)
