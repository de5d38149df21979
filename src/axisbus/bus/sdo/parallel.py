"""The same SDO work on several nodes at once: one thread per node, because each node's answers are waited for one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Generic, TypeVar

from axisbus.bus.sdo.client import SdoClient
from axisbus.errors import BusError

T = TypeVar("T")
THREADS = 32


@dataclass(frozen=True, slots=True)
class Attempt(Generic[T]):
    """How the work on one node ended: its ``value``, or the ``error`` that kept it from one."""

    value: T | None = None
    error: BusError | None = None


def on_each(
    clients: Iterable[SdoClient], work: Callable[[SdoClient], T], threads: int = THREADS
) -> dict[int, Attempt[T]]:
    """Run ``work`` for every client, at most ``threads`` at once, and return the outcomes by node ID; blocks until all have ended.

    A node that fails stops no other one. An interruption (Ctrl-C) cancels all transfers.

    Raises:
        whatever ``work`` raises beside ``BusError``, of the first client that did, once all have ended.
    """
    clients = tuple(clients)
    if not clients:
        return {}

    def guarded(client: SdoClient) -> Attempt[T]:
        try:
            return Attempt(value=work(client))
        except BusError as error:
            return Attempt(error=error)

    with ThreadPoolExecutor(min(threads, len(clients)), thread_name_prefix="axisbus nodes") as pool:
        futures = {client.node_id: pool.submit(guarded, client) for client in clients}
        try:
            return {node_id: future.result() for node_id, future in futures.items()}
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for client in clients:
                client.cancel()
            raise
