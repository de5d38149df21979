"""What a fleet asks and hears over a Zenoh session: octets by their keys; nothing of zenoh is seen beyond this module."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

log = logging.getLogger("axisbus")

Heard = Callable[[str, bytes], None]
_LONGER = 0.5  # seconds beyond its time-out after which a query has ended, whatever the network says


class ZenohClient:
    """Queries and subscriptions of one session. What it is given to call runs in threads of zenoh: it must be quick."""

    def __init__(self, session: Any) -> None:
        self._session = session

    def begin(
        self,
        key: str,
        payload: bytes,
        timeout: float,
        ended: Callable[[bytes | None], None],
        *,
        everybody: bool = False,
    ) -> None:
        """Ask, and call ``ended`` once: with the first answer, or with None where there is none. Does not block.

        ``everybody``: where several have the same key, each of them hears it.
        """
        import zenoh

        target = zenoh.QueryTarget.ALL if everybody else zenoh.QueryTarget.BEST_MATCHING
        query = _Query(ended)
        try:
            self._session.get(
                key,
                _handler(query.hear, query.end),
                timeout=timeout,
                payload=payload,
                target=target,
                express=True,
            )
        except Exception as error:  # noqa: BLE001  # zenoh raises its own of no common base, such as after closing
            log.debug("%s was not asked: %s", key, error)
            query.end()

    def ask(self, key: str, payload: bytes, timeout: float) -> bytes | None:
        """Ask, and return the first answer, or None where there is none; blocks for at most ``timeout`` seconds and a little."""
        done, got = threading.Event(), list[bytes]()

        def ended(answer: bytes | None) -> None:
            if answer is not None:
                got.append(answer)
            done.set()

        self.begin(key, payload, timeout, ended)
        done.wait(timeout + _LONGER)
        return got[0] if got else None

    def ask_all(
        self, key: str, payload: bytes, timeout: float, heard: Heard, ended: Callable[[], None]
    ) -> None:
        """Ask everybody whom a key means, and call ``heard`` with each answer, then ``ended`` once. Does not block."""
        import zenoh

        def each(reply: Any) -> None:
            if reply.ok is not None:
                heard(str(reply.ok.key_expr), reply.ok.payload.to_bytes())

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
            log.debug("%s was not asked: %s", key, error)
            ended()

    def hear(self, key: str, heard: Heard) -> None:
        """Call ``heard`` with the key and the octets of whatever is published there, until the session ends."""

        def each(sample: Any) -> None:
            heard(str(sample.key_expr), sample.payload.to_bytes())

        self._session.declare_subscriber(key, _guarded(each))

    def follow(self, key: str, changed: Callable[[str, bool], None]) -> None:
        """Call ``changed`` with the key of each liveliness token that is there, comes (True) or goes (False)."""
        import zenoh

        def each(sample: Any) -> None:
            changed(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._session.liveliness().declare_subscriber(key, _guarded(each), history=True)

    def tokens(self, key: str, timeout: float) -> list[str]:
        """Return the keys of the liveliness tokens that are there; blocks for at most ``timeout`` seconds."""
        replies = self._session.liveliness().get(key, timeout=timeout)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    @property
    def links(self) -> list[str]:
        """The far ends of the connections that there are, as Zenoh writes them."""
        return [str(link.dst) for link in self._session.info.links()]

    def close(self) -> None:
        """End the session; blocks for a moment."""
        self._session.close()


class _Query:
    """Holds one query until it has ended, which is told once."""

    def __init__(self, ended: Callable[[bytes | None], None]) -> None:
        self._ended = ended
        self._lock = threading.Lock()
        self._over = False

    def hear(self, reply: Any) -> None:
        """An answer has come; one that only says that there is none is passed over."""
        if reply.ok is not None:
            self._end(reply.ok.payload.to_bytes())

    def end(self) -> None:
        """No more answers come."""
        self._end(None)

    def _end(self, answer: bytes | None) -> None:
        with self._lock:
            over, self._over = self._over, True
        if not over:
            self._ended(answer)


def _handler(heard: Callable[[Any], None], ended: Callable[[], None]) -> Any:
    import zenoh

    return zenoh.handlers.Callback(_guarded(heard), ended)


def _guarded(function: Callable[[Any], None]) -> Callable[[Any], None]:
    """Let what one message brings about, junk included, never end the hearing of the next."""

    def guarded(what: Any) -> None:
        try:
            function(what)
        except Exception:
            log.exception("a message of the network was passed over")

    return guarded
