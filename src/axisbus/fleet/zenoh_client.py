"""Queries and subscriptions of a fleet over a Zenoh session, as octets by key; only this module uses zenoh for them."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

log = logging.getLogger("axisbus")

OnMessage = Callable[[str, bytes], None]
_LONGER = 0.5  # seconds after its time-out at which a query counts as ended in any case


class ZenohClient:
    """Queries and subscriptions of one session. Callbacks run in threads of zenoh: they must be quick."""

    def __init__(self, session: Any) -> None:
        self._session = session

    def begin(
        self,
        key: str,
        payload: bytes,
        timeout: float,
        ended: Callable[[bytes | None], None],
        *,
        to_all_peers: bool = False,
    ) -> None:
        """Send a query and call ``ended`` once: with the first answer, or with None if there is none. Does not block.

        ``to_all_peers``: if several peers serve the key, each of them receives the query.
        """
        import zenoh

        target = zenoh.QueryTarget.ALL if to_all_peers else zenoh.QueryTarget.BEST_MATCHING
        pending = _Query(ended)
        try:
            self._session.get(
                key,
                _handler(pending.on_reply, pending.end),
                timeout=timeout,
                payload=payload,
                target=target,
                express=True,
            )
        except Exception as error:  # noqa: BLE001  # zenoh's errors have no common base, such as after closing
            log.debug("no query was sent to %s: %s", key, error)
            pending.end()

    def query(self, key: str, payload: bytes, timeout: float) -> bytes | None:
        """Send a query and return the first answer, or None if there is none; blocks for at most ``timeout`` + 0.5 s."""
        done, got = threading.Event(), list[bytes]()

        def ended(answer: bytes | None) -> None:
            if answer is not None:
                got.append(answer)
            done.set()

        self.begin(key, payload, timeout, ended)
        done.wait(timeout + _LONGER)
        return got[0] if got else None

    def query_all(
        self, key: str, payload: bytes, timeout: float, on_message: OnMessage, ended: Callable[[], None]
    ) -> None:
        """Query every peer that serves the key; call ``on_message`` with each answer, then ``ended`` once. Does not block."""
        import zenoh

        def each(reply: Any) -> None:
            if reply.ok is not None:
                on_message(str(reply.ok.key_expr), reply.ok.payload.to_bytes())

        try:
            self._session.get(
                key,
                _handler(each, ended),
                timeout=timeout,
                payload=payload or None,
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
            )
        except Exception as error:  # noqa: BLE001  # as above
            log.debug("no query was sent to %s: %s", key, error)
            ended()

    def subscribe(self, key: str, on_message: OnMessage) -> None:
        """Call ``on_message`` with the key and the octets of each message published there, until the session ends."""

        def each(sample: Any) -> None:
            on_message(str(sample.key_expr), sample.payload.to_bytes())

        self._session.declare_subscriber(key, _guarded(each))

    def follow(self, key: str, changed: Callable[[str, bool], None]) -> None:
        """Call ``changed`` with the key of each liveliness token: True if it is present or appears, False if it disappears."""
        import zenoh

        def each(sample: Any) -> None:
            changed(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._session.liveliness().declare_subscriber(key, _guarded(each), history=True)

    def tokens(self, key: str, timeout: float) -> list[str]:
        """Return the keys of the present liveliness tokens; blocks for at most ``timeout`` seconds."""
        replies = self._session.liveliness().get(key, timeout=timeout)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    @property
    def links(self) -> list[str]:
        """The far ends of the present connections, as Zenoh writes them."""
        return [str(link.dst) for link in self._session.info.links()]

    def close(self) -> None:
        """End the session; blocks briefly."""
        self._session.close()


class _Query:
    """Hold one query until it has ended; the end is reported once."""

    def __init__(self, ended: Callable[[bytes | None], None]) -> None:
        self._ended = ended
        self._lock = threading.Lock()
        self._finished = False

    def on_reply(self, reply: Any) -> None:
        """Handle an answer; an error reply is ignored."""
        if reply.ok is not None:
            self._end(reply.ok.payload.to_bytes())

    def end(self) -> None:
        """Note that no more answers will come."""
        self._end(None)

    def _end(self, answer: bytes | None) -> None:
        with self._lock:
            finished, self._finished = self._finished, True
        if not finished:
            self._ended(answer)


def _handler(on_message: Callable[[Any], None], ended: Callable[[], None]) -> Any:
    import zenoh

    return zenoh.handlers.Callback(_guarded(on_message), ended)


def _guarded(function: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return a callback that logs exceptions, so that an invalid message never ends the reception of the next ones."""

    def guarded(what: Any) -> None:
        try:
            function(what)
        except Exception:
            log.exception("a message of the network was ignored")

    return guarded
