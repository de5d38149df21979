"""A simulated drive in another process, used as if it were here: each attribute is requested when it is used.

Theory of operation
-------------------
A plain value is sent. Any other object, such as a drive or its fault settings, is identified by its path from the simulated node;
the path is evaluated again at each access. Names with an underscore are not requested: private members do not exist for the proxy.
"""

from __future__ import annotations

import socket
import weakref
from collections.abc import Callable, Iterable, Mapping
from enum import IntEnum
from functools import partial
from typing import TYPE_CHECKING, Any, cast

from axisbus.core.process.rpc_client import RpcClient
from axisbus.errors import AxisbusError, StateError, one_line
from axisbus.ipc.messages import CODEC, CoreQuery, CoreReply
from axisbus.ipc.stream import MessageStream
from axisbus.ipc.values import NotForCrossing

if TYPE_CHECKING:  # its proxy needs no simulation
    from axisbus.core.simulated_nodes import SimulatedNode

# An attribute, or with arguments (by position, and by name) the call of one.
Step = tuple[str, tuple[Any, ...] | None, dict[str, Any]]
Way = tuple[Step, ...]
_VALUE, _CALL, _THING = "value", "call", "thing"
_ITEM = "[]"
_NODES = "nodes"
_END = 2.0  # seconds for the drives to end when no program uses them any more


def look(root: object, what: str, way: Way, *arguments: Any) -> tuple[str, Any]:
    """Execute a request on the object at the end of ``way``; return its kind (a value, a method or an object), and the value."""
    thing = root
    for name, given, named in way:
        thing = _step(thing, name, given, named)
    if what == "set":
        setattr(thing, _public(arguments[0]), arguments[1])
        return _VALUE, None
    if what == "len":
        return _VALUE, len(thing)  # type: ignore[arg-type]  # raises if it has no length
    return _shown(thing)


def _step(thing: Any, name: str, given: tuple[Any, ...] | None, named: dict[str, Any]) -> Any:
    if name == _ITEM:
        assert given is not None
        return thing[given[0]]
    found = getattr(thing, _public(name))
    return found if given is None else found(*given, **named)


def _public(name: str) -> str:
    if name.startswith("_"):
        raise StateError(f"{name} of a simulated drive is private")
    return name


def _shown(thing: object) -> tuple[str, Any]:
    if isinstance(thing, IntEnum):  # an enum of the simulated node
        return _VALUE, int(thing)
    if callable(thing):
        return _CALL, None
    try:
        CODEC.pack(thing)
    except NotForCrossing:
        return _THING, None
    return _VALUE, thing


def answer_all(stream: MessageStream, stand_ins: Mapping[int, SimulatedNode]) -> None:
    """Answer requests about simulated nodes until the connection ends, or an invalid one comes; blocks."""
    for message in map(CODEC.unpack, stream.messages()):
        if not isinstance(message, CoreQuery):
            return
        stream.send(_answer(message, stand_ins))


def _answer(message: CoreQuery, stand_ins: Mapping[int, SimulatedNode]) -> CoreReply:
    try:
        return CoreReply(message.number, _found(stand_ins, message))
    except Exception as error:  # noqa: BLE001  # whatever it was, a caller waits for the answer
        return CoreReply(message.number, None, _told(error))


def _found(stand_ins: Mapping[int, SimulatedNode], message: CoreQuery) -> Any:
    if message.what == _NODES:
        return sorted(stand_ins)
    stand_in = stand_ins[message.node]
    with stand_in.lock:
        return look(stand_in, message.what, *message.arguments)


def _told(error: Exception) -> AxisbusError:
    """Return an error that can be sent."""
    if isinstance(error, AxisbusError):
        return error
    made = StateError("the simulated drive could not execute this", observed=one_line(error))
    made.__cause__ = error
    return made


class RemoteProxy:
    """An object in another process, at the end of a path."""

    __slots__ = ("_ask", "_way")

    def __init__(self, ask: Callable[..., Any], way: Way = ()) -> None:
        """``ask(what, way, ...)`` executes ``look`` there."""
        object.__setattr__(self, "_ask", ask)
        object.__setattr__(self, "_way", way)

    def __getattr__(self, name: str) -> Any:
        """Request an attribute; AttributeError if it is private."""
        if name.startswith("_"):
            raise AttributeError(name)
        return self._go(name, None)

    def __setattr__(self, name: str, value: object) -> None:
        self._ask("set", self._way, name, value)

    def __getitem__(self, key: object) -> Any:
        return self._go(_ITEM, (key,))

    def __len__(self) -> int:
        found: tuple[str, int] = self._ask("len", self._way)
        return found[1]

    def _go(self, name: str, given: tuple[Any, ...] | None, /, **named: Any) -> Any:
        way = (*self._way, (name, given, named))
        kind, value = self._ask("get", way)
        if kind == _CALL:
            return lambda *arguments, **named: self._go(name, arguments, **named)
        return value if kind == _VALUE else RemoteProxy(self._ask, way)


class SimulatedDrivesHandle:
    """A program's handle of its simulated drives: they live while the handle, or one of them, is referenced."""

    def __init__(self, line: socket.socket) -> None:
        """``line`` leads to their process."""
        self._calls = RpcClient(MessageStream(line, CODEC.pack, "axisbus asks drives"), {}, {}, _nothing)
        self._calls.start()
        self._end = weakref.finalize(self, self._calls.part, _END)

    def stand_ins(self, nodes: Iterable[int]) -> dict[int, SimulatedNode]:
        """Return the proxies of these nodes."""
        return {node_id: cast("SimulatedNode", RemoteProxy(partial(self._ask, node_id))) for node_id in nodes}

    def nodes(self) -> list[int]:
        """Return the existing nodes; blocks for a moment."""
        found: list[int] = self._calls.ask(_NODES)
        return found

    def end(self) -> None:
        """Request nothing more; blocks for at most 2 s. Harmless when repeated."""
        self._end()

    def disown(self) -> None:
        """Release a forked child's copy."""
        self._end.detach()
        self._calls.disown()

    def _ask(self, node_id: int, what: str, *arguments: Any) -> Any:
        return self._calls.ask(what, node_id, *arguments)


def _nothing() -> None:
    """Do nothing: the program requested the end."""
