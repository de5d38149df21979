"""The same SDO work on several nodes at once: one thread per node, because each thread waits for the answers of its node."""

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
    """Result of the work on one node: its ``value``, or the ``error`` that prevented it."""

    value: T | None = None
    error: BusError | None = None


def on_each(
    clients: Iterable[SdoClient], work: Callable[[SdoClient], T], threads: int = THREADS
) -> dict[int, Attempt[T]]:
    """Run ``work`` for every client, at most ``threads`` at once, and return the results by node-ID; blocks until all have ended.

    A failure of one node does not stop the others. An interruption (Ctrl-C) cancels all transfers.

    Raises:
        any exception of ``work`` except ``BusError``, of the first client that raised one, after all have ended.
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
