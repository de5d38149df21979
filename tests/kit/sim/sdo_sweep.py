"""Losing each frame of a long transfer once without running the whole transfer each time.

Theory of operation
-------------------
Wire, session and server are deterministic: everything that follows depends on their state alone. So one undisturbed transfer is
run, and the state before each of its steps is stored. For a lost frame, the step that sends it is repeated on a copy, without
that frame. The copy runs until it is in a state from which a transfer has already ended well, with the right data (all received
data and all frames in transit are part of the state); otherwise it runs to its end, and its states are stored. From the end
backwards that is about two blocks for each lost frame. Nothing is assumed about the recovery of the protocol: if no known state
is reached, the whole rest of the transfer is run.
"""

from __future__ import annotations

import hashlib
import io
import marshal
import pickle
from bisect import bisect_left
from collections.abc import Callable, Iterable
from enum import Enum
from types import FunctionType, MethodType
from typing import Any

from axisbus.cia301.sdo import SdoTransferType
from axisbus.cia301.sdo_session import SdoTransferRequest
from axisbus.sim.dictionary import Dictionary
from axisbus.sim.fault_injection import NodeFaults
from kit.sim.sdo_wire import FILE, TIMEOUT, SdoWire

_OLD = b"old"
_MOVING = ("session", "server", "_to_server", "_to_client", "_late", "now", "heard", "content")
# No part of the state: diagnosis, constants, and times, which count from now (see ``_state``).
_NO_STATE = frozenset({"strays", "_dictionary", "_dials", "_last_request"})


class Sweep:
    """All losses of one transfer; holds the states that are known to end well."""

    def __init__(self, data: bytes, writing: bool, tries: int = 3) -> None:
        self._data = data
        self._request = SdoTransferRequest(
            *FILE, data if writing else None, TIMEOUT, tries, SdoTransferType.BLOCK
        )
        self._before = _OLD if writing else data
        self._good: set[bytes] = set()
        self._sent: list[int] = []  # frames that were sent before each step of the undisturbed transfer
        self._snapshots: list[bytes] = []
        self._wire = SdoWire(self._before)
        self._run_undisturbed()

    def lose(self, numbers: Iterable[int]) -> int:
        """Lose each of these frames (from 1) in a transfer of its own; backwards is fastest. Return how many steps that took.

        Raises:
            AssertionError: one of the transfers ends badly, or with wrong data.
        """
        return sum(self._lose(number) for number in numbers)

    def _run_undisturbed(self) -> None:
        """Run it twice: to see which steps send anything, and to keep the states before those."""
        telling = SdoWire(self._before)
        telling.begin(self._request)
        sends = []
        while not telling.session.done:
            before = len(telling.frames)
            telling.step()
            sends.append(len(telling.frames) > before)
        self.frames = len(telling.frames)
        self._sent.append(0)
        self._snapshots.append(_copied(self._wire))
        self._wire.begin(self._request)
        for step_sends in sends:
            before = len(self._wire.frames)
            if step_sends:
                self._sent.append(before)
                self._snapshots.append(_copied(self._wire))
            self._wire.step()
            if self._at_client(before):
                self._good.add(self._state())
        self._require_right("undisturbed")

    def _lose(self, number: int) -> int:
        wire = self._wire
        step = bisect_left(self._sent, number) - 1
        wire.fate = _losing(number - self._sent[step])
        _become(wire, self._snapshots[step])
        if step == 0:
            wire.begin(self._request)
        return self._follow(f"frame {number} of {self.frames} lost")

    def _follow(self, what: str) -> int:
        """Run on to a known state, or to the end; return the number of steps."""
        wire, steps, seen = self._wire, 0, []
        while not wire.session.done:
            before = len(wire.frames)
            wire.step()
            steps += 1
            if self._at_client(before):
                state = self._state()
                if state in self._good:
                    break
                seen.append(state)
        else:
            self._require_right(what)
        self._good.update(seen)
        return steps

    def _at_client(self, before: int) -> bool:
        """Whether the client has just sent (a block, or the confirmation of one): often enough to compare states."""
        return len(self._wire.frames) > before and not self._wire.pipes[1]

    def _require_right(self, what: str) -> None:
        session = self._wire.session
        assert session.failure is None, what
        self._wire.settle()
        assert self._wire.content == self._data, what
        assert self._request.data is not None or session.data == self._data, what

    def _state(self) -> bytes:
        """Return a digest of the complete state; no frame is lost any more by then."""
        wire = self._wire
        waits = [wire.now - wire.heard, wire.now - wire.server._last_request]
        pipes = [[(max(0.0, round(due - wire.now, 9)), frame) for due, frame in pipe] for pipe in wire.pipes]
        parts = _plain((wire.session, wire.server, waits, wire.content == self._data))
        return hashlib.blake2b(marshal.dumps((parts, pipes), 2), digest_size=16).digest()


def _losing(number: int) -> Callable[[int, bytes], float | None]:
    return lambda at, _: None if at == number else 0.0


def _plain(value: Any) -> Any:
    """Return a value as numbers, texts and tuples."""
    match value:
        case Enum():
            return value.name
        case MethodType() | FunctionType():
            return value.__name__
        case bytearray():
            return bytes(value)
        case list() | tuple():
            return tuple(value if value and isinstance(value[0], bytes) else map(_plain, value))
        case float():
            return round(value, 9)
        case None | bool() | int() | str() | bytes():
            return value
    kept = sorted((name, each) for name, each in vars(value).items() if name not in _NO_STATE)
    return type(value).__name__, tuple((name, _plain(each)) for name, each in kept)


# -- copies, in which dictionary and settings stay the wire's own ----------------------------------------------------------


class _Pickler(pickle.Pickler):
    def reducer_override(self, value: object) -> Any:
        return (
            (_own, (type(value).__name__,)) if isinstance(value, Dictionary | NodeFaults) else NotImplemented
        )


_OWNER: dict[str, object] = {}


def _own(name: str) -> object:
    return _OWNER[name]


def _copied(wire: SdoWire) -> bytes:
    stream = io.BytesIO()
    _Pickler(stream).dump([getattr(wire, name, None) for name in _MOVING])
    return stream.getvalue()


def _become(wire: SdoWire, copy: bytes) -> None:
    _OWNER.update(Dictionary=wire.dictionary, NodeFaults=wire.dials)
    wire.frames.clear()
    for name, value in zip(_MOVING, pickle.loads(copy), strict=True):
        setattr(wire, name, value)
