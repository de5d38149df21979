"""Queries of Zenoh for this protocol: decoded with limited size, and answered once."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TypeVar

import msgspec
import zenoh

from axisbus.errors import ArgumentError
from axisbus.wording import counted

log = logging.getLogger("axisbus")
LARGEST = 8192  # bytes of a query
Message = TypeVar("Message", bound=msgspec.Struct)
_JSON = zenoh.Encoding.APPLICATION_JSON


class ZenohQuery:
    """One query; to be answered or dropped, by any thread."""

    def __init__(self, query: zenoh.Query) -> None:
        self._query = query
        self.key = str(query.key_expr)

    @property
    def concrete(self) -> bool:
        """Whether it names exactly one key."""
        return "*" not in self.key and "$" not in self.key

    def intersects(self, key: str) -> bool:
        """Whether it matches a key."""
        return self._query.key_expr.intersects(key)

    def parameter(self, name: str) -> str | None:
        """Return a parameter of its selector."""
        return self._query.parameters.get(name)

    @property
    def data(self) -> bytes:
        """The payload; empty if there is none.

        Raises:
            ArgumentError: the payload is too large.
        """
        payload = self._query.payload
        if payload is None:
            return b""
        if len(payload) > LARGEST:
            raise ArgumentError(
                "the query is too large",
                observed=f"it has {counted(len(payload), 'byte')}, and at most {LARGEST} are allowed",
            )
        return payload.to_bytes()

    def message(self, kind: type[Message]) -> Message:
        """Return the payload as a message.

        Raises:
            ArgumentError: the payload is not a message of this kind.
        """
        try:
            return msgspec.json.decode(self.data, type=kind)
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            raise ArgumentError(
                f"the query does not contain a {kind.__name__} of this protocol", observed=str(error)
            ) from error

    def answer(self, key: str, message: msgspec.Struct, *, last: bool = True) -> None:
        """Answer on a key; ``last``: there is no further answer. Errors are ignored, because the client may be gone."""
        try:
            self._query.reply(key, msgspec.json.encode(message), encoding=_JSON)
        except Exception as error:  # noqa: BLE001  # the client or the session is gone
            log.debug("an answer on %s could not be executed: %s", key, error)
        if last:
            self.drop()

    def drop(self) -> None:
        """Drop the query; harmless when repeated."""
        try:
            self._query.drop()  # type: ignore[no-untyped-call]
        except Exception as error:  # noqa: BLE001
            log.debug("a query could not be closed: %s", error)


def heard(take: Callable[[ZenohQuery], None]) -> Callable[[zenoh.Query], None]:
    """Return a callback of a queryable that survives any error in a query."""

    def hear(query: zenoh.Query) -> None:
        asked = ZenohQuery(query)
        try:
            take(asked)
        except Exception as error:  # noqa: BLE001
            log.warning("a query on %s could not be processed: %s", asked.key, error)
            asked.drop()

    return hear
