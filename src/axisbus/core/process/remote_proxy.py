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
from axisbus.ipc.values import NotSendable

if TYPE_CHECKING:  # its proxy needs no simulation
    from axisbus.core.simulated_nodes import SimulatedNode

# An attribute, or with arguments (by position, and by name) the call of one.
Step = tuple[str, tuple[Any, ...] | None, dict[str, Any]]
AccessPath = tuple[Step, ...]
_VALUE, _CALL, _OBJECT = "value", "call", "thing"
_ITEM = "[]"
_NODES = "nodes"
_CLOSE_TIME = 2.0  # seconds for the drives to end when no program uses them any more


def execute(root: object, what: str, path: AccessPath, *more: Any) -> tuple[str, Any]:
    """Execute a request on the object at the end of ``path``; return its kind (a value, a method or an object), and the value."""
    target = root
    for name, arguments, keywords in path:
        target = _step(target, name, arguments, keywords)
    if what == "set":
        setattr(target, _public(more[0]), more[1])
        return _VALUE, None
    if what == "len":
        return _VALUE, len(target)  # type: ignore[arg-type]  # raises if it has no length
    return _kind_and_value(target)


def _step(target: Any, name: str, arguments: tuple[Any, ...] | None, keywords: dict[str, Any]) -> Any:
    if name == _ITEM:
        assert arguments is not None
        return target[arguments[0]]
    found = getattr(target, _public(name))
    return found if arguments is None else found(*arguments, **keywords)


def _public(name: str) -> str:
    if name.startswith("_"):
        raise StateError(f"{name} of a simulated drive is private")
    return name


def _kind_and_value(target: object) -> tuple[str, Any]:
    if isinstance(target, IntEnum):  # an enum of the simulated node
        return _VALUE, int(target)
    if callable(target):
        return _CALL, None
    try:
        CODEC.pack(target)
    except NotSendable:
        return _OBJECT, None
    return _VALUE, target


def answer_all(stream: MessageStream, simulated_nodes: Mapping[int, SimulatedNode]) -> None:
    """Answer requests about simulated nodes until the connection ends, or an invalid one comes; blocks."""
    for message in map(CODEC.unpack, stream.messages()):
        if not isinstance(message, CoreQuery):
            return
        stream.send(_answer(message, simulated_nodes))


def _answer(message: CoreQuery, simulated_nodes: Mapping[int, SimulatedNode]) -> CoreReply:
    try:
        return CoreReply(message.number, _found(simulated_nodes, message))
    except Exception as error:  # noqa: BLE001  # whatever it was, a caller waits for the answer
        return CoreReply(message.number, None, _sendable(error))


def _found(simulated_nodes: Mapping[int, SimulatedNode], message: CoreQuery) -> Any:
    if message.what == _NODES:
        return sorted(simulated_nodes)
    simulated_node = simulated_nodes[message.node]
    with simulated_node.lock:
        return execute(simulated_node, message.what, *message.arguments)


def _sendable(error: Exception) -> AxisbusError:
    """Return an error that can be sent."""
    if isinstance(error, AxisbusError):
        return error
    made = StateError("the simulated drive could not execute this", observed=one_line(error))
    made.__cause__ = error
    return made


class RemoteProxy:
    """An object in another process, at the end of a path."""

    __slots__ = ("_ask", "_path")

    def __init__(self, ask: Callable[..., Any], path: AccessPath = ()) -> None:
        """``ask(what, path, ...)`` executes ``execute`` there."""
        object.__setattr__(self, "_ask", ask)
        object.__setattr__(self, "_path", path)

    def __getattr__(self, name: str) -> Any:
        """Request an attribute; AttributeError if it is private."""
        if name.startswith("_"):
            raise AttributeError(name)
        return self._access(name, None)

    def __setattr__(self, name: str, value: object) -> None:
        self._ask("set", self._path, name, value)

    def __getitem__(self, key: object) -> Any:
        return self._access(_ITEM, (key,))

    def __len__(self) -> int:
        found: tuple[str, int] = self._ask("len", self._path)
        return found[1]

    def _access(self, name: str, arguments: tuple[Any, ...] | None, /, **keywords: Any) -> Any:
        path = (*self._path, (name, arguments, keywords))
        kind, value = self._ask("get", path)
        if kind == _CALL:
            return lambda *more, **keywords: self._access(name, more, **keywords)
        return value if kind == _VALUE else RemoteProxy(self._ask, path)


class SimulatedDrivesHandle:
    """A program's handle of its simulated drives: they live while the handle, or one of them, is referenced."""

    def __init__(self, line: socket.socket) -> None:
        """``line`` leads to their process."""
        self._rpc = RpcClient(MessageStream(line, CODEC.pack, "axisbus asks drives"), {}, {}, _nothing)
        self._rpc.start()
        self._end = weakref.finalize(self, self._rpc.close_gracefully, _CLOSE_TIME)

    def simulated_nodes(self, nodes: Iterable[int]) -> dict[int, SimulatedNode]:
        """Return the proxies of these nodes."""
        return {node_id: cast("SimulatedNode", RemoteProxy(partial(self._ask, node_id))) for node_id in nodes}

    def nodes(self) -> list[int]:
        """Return the existing nodes; blocks for a moment."""
        found: list[int] = self._rpc.ask(_NODES)
        return found

    def end(self) -> None:
        """Request nothing more; blocks for at most 2 s. Harmless when repeated."""
        self._end()

    def disown(self) -> None:
        """Release a forked child's copy."""
        self._end.detach()
        self._rpc.disown()

    def _ask(self, node_id: int, what: str, *more: Any) -> Any:
        return self._rpc.ask(what, node_id, *more)


def _nothing() -> None:
    """Do nothing: the program requested the end."""
