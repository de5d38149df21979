"""Jogs of a fleet: each lasts 0.2 s from its last query; a press is over after silence, a halt or a late query."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Collection

from axisbus.client_support.dead_man import SILENCE, DeadMan
from axisbus.errors import AxisbusError, Replaced, StateError
from axisbus.gateway.zenoh.command_table import BridgeAction
from axisbus.machine.handle import Handle, look_at_end
from axisbus.machine.machine import Machine

_CLIENTS = 64
_AGAIN = "release the button, and press it again"


class Jogs:
    """Hold the pressed button of each client, and the handle of its last jog; for one thread at a time."""

    def __init__(self) -> None:
        self._held: OrderedDict[str, tuple[DeadMan, Handle | None]] = OrderedDict()

    def jog(self, machine: Machine, client: str, act: BridgeAction, now: float) -> None:
        """Start or continue a jog by one query of a client; ``now`` in s, monotonic. Does not block.

        Raises:
            StateError: the press is over, or the query comes too late.
            AxisbusError: the error that ended the jog of this press; or as ``Axis.jog``.
        """
        before, last = self._held.get(client, (DeadMan(), None))
        values, axis = act.values, act.axes[0]
        direction = math.copysign(1.0, values["velocity"])
        broken = self._broken(last)
        same = before.is_held_by(values["press"])
        deadman = before.ended() if same and broken is not None else before
        after = deadman.beaten(values["press"], axis, direction, values["sent"], now)
        over = same and broken is not None
        if over or not after.held:
            self._keep(client, after.ended(), None)
            if before.held and not over:
                machine[before.axis].halt()
            raise broken if over and broken is not None else _late()
        handle = machine[axis].jog(
            values["velocity"], acceleration=values.get("acceleration"), continue_only=same
        )
        look_at_end(handle)
        self._keep(client, after, handle)

    def stopped(self, axes: Collection[str]) -> None:
        """Note that axes were halted or stopped: clients that jog one of them must press again."""
        for client, (deadman, handle) in self._held.items():
            if deadman.axis in axes:
                self._held[client] = deadman.ended(), handle

    def _keep(self, client: str, deadman: DeadMan, handle: Handle | None) -> None:
        self._held[client] = deadman, handle
        self._held.move_to_end(client)
        while len(self._held) > _CLIENTS:
            self._held.popitem(last=False)

    @staticmethod
    def _broken(handle: Handle | None) -> AxisbusError | None:
        """Return the error that ended the last jog, unless the next jog of the same press replaced it, or its time ended."""
        error = None if handle is None or handle.busy else handle.exception()
        return None if isinstance(error, Replaced) else error


def _late() -> StateError:
    return StateError(
        "the jog of this press is over",
        observed=f"a query came more than {SILENCE:g} s late, or the axis was halted meanwhile",
        remedy=_AGAIN,
    )
