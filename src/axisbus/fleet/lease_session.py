"""Control of a cell, for a ``with`` block: take its lease, renew it in the fleet's thread, and release it."""

from __future__ import annotations

import math
import time
from functools import partial
from types import TracebackType
from typing import TYPE_CHECKING, Generic, TypeVar

import msgspec

from axisbus.errors import AxisbusError, OwnershipError, StateError
from axisbus.fleet.command_retry import error_of
from axisbus.fleet.event_loop import EventLoopThread
from axisbus.fleet.keys import ZenohCellKeys
from axisbus.fleet.messages import LeaseAnswer, LeaseAsk, read
from axisbus.fleet.zenoh_client import ZenohClient

if TYPE_CHECKING:
    from axisbus.fleet.command_sender import CommandSender
    from axisbus.fleet.subscriptions import FleetSubscriptions


_TIMEOUT = 2.0  # seconds for an answer
_HANDOVER_TIME = 5.0  # seconds within which a lease changes its holder: moving axes halt first
_OWN_END_MARGIN = 1.5  # seconds after the local end of a lease within which it has ended at the cell as well, with the transmission
_AGAIN = 0.1
_RELEASED = 1.0  # seconds for the answer to a release; without an answer the lease expires
_TICK = 0.02  # seconds, the shortest time between two checks for a due renewal
_Cell = TypeVar("_Cell")


class Leases:
    """Query the leases of cells, and renew those that this program holds."""

    def __init__(
        self,
        client_name: str,
        subscriptions: FleetSubscriptions,
        zenoh_client: ZenohClient,
        worker: EventLoopThread,
        sender: CommandSender,
    ) -> None:
        """``client_name``: the name of this program, for people."""
        self._client_name, self._subscriptions, self._sender = client_name, subscriptions, sender
        self._zenoh_client, self._worker = zenoh_client, worker
        self._held_leases: dict[str, HeldLease] = {}

    def holder(self, cell: str) -> str | None:
        """Return the name of the client that has control of a cell, None if no client has it; blocks for at most 2 s."""
        return self._query(cell, self._lease_request("look"), _TIMEOUT).holder

    def take(self, cell: str, over: bool) -> HeldLease:
        """Take a lease, and renew it from now on; usually blocks briefly, for at most 7 s."""
        previous = self._held_leases.get(cell)
        if previous is not None and not previous.lost(time.monotonic()):
            raise StateError(
                f"{cell}: this program already has control", remedy="use the lease that it already has"
            )
        own_until = -math.inf if previous is None else previous.until + _OWN_END_MARGIN
        lease = self._requested(cell, over, own_until)
        self._held_leases[cell] = lease
        self._sender.lease(cell, lease.token)
        self._worker.call_soon(partial(self._renew_if_due, cell, lease))
        return lease

    def _requested(self, cell: str, over: bool, own_until: float) -> HeldLease:
        """Request a lease until it is granted or finally refused: while it changes its holder, no client has it for a moment.

        ``own_until``: the time until which the cell may still list this program as the holder, although it has lost the lease here.
        """
        end = time.monotonic() + _HANDOVER_TIME
        while True:
            requested_at = time.monotonic()
            answer = self._query(cell, self._lease_request("take", over=over), _TIMEOUT)
            if answer.token:
                return HeldLease(answer.token, answer.seconds, requested_at)
            final = requested_at > end or (answer.holder is not None and requested_at > own_until)
            if answer.refused is not None and final:
                raise error_of(answer.refused, f"{cell}.command()")
            if requested_at > end:
                raise no_answer(f"{cell}: its lease")
            time.sleep(_AGAIN)

    def release(self, cell: str, lease: HeldLease) -> None:
        """Release a lease; blocks for at most 1 s. Harmless if it is lost."""
        if self._held_leases.get(cell) is lease:
            del self._held_leases[cell]
            self._sender.lease(cell, None)
        if lease.why is None:
            lease.refuse(OwnershipError(f"{cell}: this program has released control"))
            if self._subscriptions.situation(cell, False).alive:
                self._zenoh_client.query(
                    self._key(cell), self._lease_request("release", lease.token), _RELEASED
                )

    def end(self) -> None:
        """Release all leases; blocks for at most 1 s for each."""
        for cell, lease in list(self._held_leases.items()):
            self.release(cell, lease)

    def require(self, cell: str, name: str) -> None:
        """Check that this program has control of a cell.

        Raises:
            OwnershipError: the program has not taken control, or has lost it.
        """
        lease = self._held_leases.get(cell)
        if lease is None:
            raise OwnershipError(
                f"{name}: this program does not have control of {cell}; nothing was sent",
                remedy=f'take control: with fleet["{cell}"].command(): ...',
            )
        if lease.lost(time.monotonic()):
            raise OwnershipError(
                f"{name}: this program has lost control of {cell}; nothing was sent",
                observed="" if lease.why is None else lease.why.message,
                remedy="check the state of its axes, then take control again",
            )

    def _renew_if_due(self, cell: str, lease: HeldLease) -> None:
        """Renew a lease if it is due, and schedule the next check."""
        now = time.monotonic()
        if self._held_leases.get(cell) is not lease:
            return
        if lease.lost(now):
            lease.refuse(OwnershipError(f"{cell}: the lease was not renewed in time"))
            self._sender.lease(cell, None)
            return
        if lease.due(now):
            on_answer = partial(self._renewed, cell, lease, now)
            payload = self._lease_request("renew", lease.token)
            self._zenoh_client.begin(self._key(cell), payload, lease.remaining(now), on_answer)
        self._worker.call_later(
            max(_TICK, min(lease.next - now, lease.remaining(now))), partial(self._renew_if_due, cell, lease)
        )

    def _renewed(self, cell: str, lease: HeldLease, requested_at: float, payload: bytes | None) -> None:
        answer = read(payload, LeaseAnswer)
        if answer is None:
            return
        if answer.refused is None:
            lease.renewed(answer.seconds, requested_at)
        elif self._held_leases.get(cell) is lease:
            lease.refuse(error_of(answer.refused, cell))
            self._sender.lease(cell, None)

    def _query(self, cell: str, payload: bytes, timeout: float) -> LeaseAnswer:
        answer = read(self._zenoh_client.query(self._key(cell), payload, timeout), LeaseAnswer)
        if answer is None:
            raise no_answer(f"{cell}: its lease")
        return answer

    def _key(self, cell: str) -> str:
        return ZenohCellKeys(self._subscriptions.plant, cell).lease

    def _lease_request(self, verb: str, token: str = "", over: bool = False) -> bytes:
        request = LeaseAsk(verb, self._sender.client, self._client_name, token, over)  # type: ignore[arg-type]  # one of its words
        return msgspec.json.encode(request)


class CellControl(Generic[_Cell]):
    """Control of one cell, for a ``with`` block, whose target is the cell."""

    def __init__(self, cell: _Cell, name: str, leases: Leases, over: bool) -> None:
        self._cell, self._name, self._leases, self._over = cell, name, leases, over
        self._lease: HeldLease | None = None

    def __enter__(self) -> _Cell:
        self._lease = self._leases.take(self._name, self._over)
        return self._cell

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._lease is not None:
            self._leases.release(self._name, self._lease)

    @property
    def lost(self) -> AxisbusError | None:
        """Why control is lost; None while this program has it."""
        return None if self._lease is None else self._lease.why


def no_answer(what: str) -> StateError:
    """Return the error for a query that a cell has not answered."""
    return StateError(
        f"{what}: the cell did not answer",
        remedy="check that its bridge runs and that this program reaches it (axisbus fleet list)",
    )


# ----------------------------------------------------------------------------------------------------------------------
# The lease of a cell as its holder tracks it: how long it is valid, when to renew it, and why it was lost; reads no clock.


_RENEWED = 0.25  # fraction of the lease's time after which it is renewed


_LONGEST = 60.0  # s, the longest lease that is accepted; a larger number would overflow a wait


class HeldLease:
    """Track one lease. It counts from the request, not from the answer, so it ends here before it ends at the cell."""

    def __init__(self, token: str, seconds: float, requested_at: float) -> None:
        """``requested_at``: the time of the request."""
        self.token = token
        self.why: AxisbusError | None = None
        self._seconds = min(seconds, _LONGEST)
        self._until = requested_at + self._seconds
        self._next = requested_at + self._seconds * _RENEWED

    def due(self, now: float) -> bool:
        """Return whether the lease has to be renewed now; if so, set the time of the next attempt."""
        if self.why is not None or now < self._next:
            return False
        self._next = now + max(0.02, self._seconds * _AGAIN)
        return True

    @property
    def next(self) -> float:
        """The time of the next renewal."""
        return self._next

    @property
    def until(self) -> float:
        """The time until which the lease is or was valid, unless it was refused before."""
        return self._until

    def renewed(self, seconds: float, requested_at: float) -> None:
        """Note that a renewal requested at ``requested_at`` was granted; a late answer never shortens the lease."""
        seconds = min(seconds, _LONGEST)
        if self.why is None and requested_at + seconds > self._until:
            self._seconds = seconds
            self._until = requested_at + seconds
            self._next = requested_at + seconds * _RENEWED

    def refuse(self, why: AxisbusError) -> None:
        """Note that the lease is lost: another client has it, or the cell does not know it."""
        self.why = self.why or why

    def remaining(self, now: float) -> float:
        """Return the seconds for which the lease is still valid, 0 if it is lost."""
        return 0.0 if self.why is not None else max(0.0, self._until - now)

    def lost(self, now: float) -> bool:
        """Return whether the lease is lost: it was refused, or has expired."""
        return self.remaining(now) <= 0.0
