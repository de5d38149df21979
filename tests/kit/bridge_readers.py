"""The readers of network messages to a bridge, each with valid messages, for the fuzzer. Each needs an optional package."""

from __future__ import annotations

import asyncio
import itertools
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import msgspec

from axisbus.cell import reader as cells
from axisbus.errors import AxisbusError
from axisbus.fleet import messages as f
from axisbus.fleet.keys import ZenohCellKeys
from axisbus.machine.machine import Machine
from kit.cell import cell_file
from kit.frame_readers import Conversations, reader_of, unshown
from kit.reader_limits import MB, Limits, PassedOver, Reader

_LIMITS = Limits(seconds=1.0, memory=32 * MB)
_SECONDS = 20.0  # that a bridge may take for an input


@contextmanager
def _cell() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder:
        path = cell_file(Path(folder), "xy")
        yield path


# -- Zenoh ----------------------------------------------------------------------------------------------------------------

_KEYS = ZenohCellKeys("hall", "press")
_ANSWERED = (_KEYS.lease, _KEYS.info, _KEYS.events)


def _queries() -> Conversations:
    """Return pairs of a selector and its payload, which may be empty."""
    encode = msgspec.json.encode

    def command(number: int, *axes: str, **values: Any) -> bytes:
        return encode(f.CommandAsk("anna", number, "t1", axes, values))

    pairs = [
        (_KEYS.info, b""),
        (_KEYS.state("*"), b""),
        (_KEYS.lease, encode(f.LeaseAsk("take", "anna", "Anna"))),
        (_KEYS.lease, encode(f.LeaseAsk("renew", "anna", token="t1"))),
        (_KEYS.command("enable"), command(1, "x")),
        (_KEYS.command("move_absolute"), command(2, "x", position=1.0, velocity=5.0)),
        (_KEYS.command("jog"), command(3, "x", velocity=1.0, press=1, sent=1.0)),
        (_KEYS.command("halt"), command(4, "x")),
        (_KEYS.command("quick_stop_all"), b""),
        (_KEYS.command("halt_all"), command(5)),
        (_KEYS.object(1, 0x1000, 0), b""),
        (_KEYS.object(1, 0x6081, 0), encode(f.ObjectWrite("anna", "t1", 100))),
        (f"{_KEYS.events}?first=1;last=5", b""),
        (_KEYS.events, encode(f.EventsAsk(1, 3))),
    ]
    return [[part for key, data in pairs for part in (key.encode(), data)]]


class _Query:
    """A query as zenoh delivers it; counts its answers."""

    def __init__(self, selector: str, data: bytes) -> None:
        import zenoh

        key, _, parameters = selector.partition("?")
        self.key_expr = zenoh.KeyExpr(key)  # zenoh rejects an invalid key
        self.parameters = zenoh.Parameters(parameters)
        self.payload = zenoh.ZBytes(data) if data else None
        self.answers = 0

    def reply(self, _key: str, _data: bytes, **_: Any) -> None:
        self.answers += 1

    def drop(self) -> None:
        pass


class _Bridge:
    """The queryables of a bridge at a simulated machine; client anna holds the lease. This thread delivers the queries."""

    @contextmanager
    def there(self) -> Iterator[None]:
        from axisbus.gateway.zenoh import bridge, service
        from axisbus.gateway.zenoh.commands import Commands
        from axisbus.gateway.zenoh.execute import DeferredReplies
        from axisbus.gateway.zenoh.lease import CellLease
        from axisbus.gateway.zenoh.publishing import BridgeEvent, BridgeEventLog, States

        clock = itertools.count(1.0)
        holding = SimpleNamespace(
            lease=CellLease().taking("anna", "Anna").taken("t1", 1e12),
            take=lambda *given: given[-1](None),
            renew=lambda *_: None,
            release=lambda *_: None,
        )
        with ExitStack() as stack:
            machine = stack.enter_context(Machine.simulated(stack.enter_context(_cell())))
            holding.controlled = machine
            stack.enter_context(patch.object(service, "guarded", lambda take: take))
            answers = DeferredReplies()
            stack.callback(answers.close)
            transfers = SimpleNamespace(put=lambda work, reply: reply(_done(work)))
            self._takes: dict[str, Callable[[Any], None]] = {}
            session = SimpleNamespace(declare_queryable=self._declared)
            commands = Commands(machine, holding, answers, lambda: next(clock))  # type: ignore[arg-type]
            states = States(session, _KEYS, "a", machine, lambda: None, {})  # type: ignore[arg-type]
            info = f.CellInfo(f.PROTOCOL, "1", "a", "hall", "press", 1.0, True)
            service.ZenohService(
                session,
                _KEYS,
                machine,
                holding,
                commands,
                states,
                transfers,
                lambda: info,
                lambda: None,  # type: ignore[arg-type]
            )
            kept = BridgeEventLog("a")
            for number in range(5):
                kept.add(BridgeEvent("machine", f"text {number}"), 1.0)
            cell = SimpleNamespace(_cell=SimpleNamespace(keys=_KEYS), _events=SimpleNamespace(stored=kept))
            self._takes[_KEYS.events] = lambda asked: bridge.Bridge._missing(cell, asked)  # type: ignore[arg-type]
            self._machine = machine
            yield

    def _declared(self, key: str, take: Callable[[Any], None]) -> Any:
        self._takes[key] = take
        return SimpleNamespace(undeclare=lambda: None)

    def take(self, parts: Sequence[bytes]) -> None:
        import zenoh

        from axisbus.gateway.zenoh.service import ZenohQuery

        for selector, data in zip(parts[::2], parts[1::2], strict=False):
            try:
                query = _Query(selector.decode("utf-8"), data)
            except (zenoh.ZError, UnicodeDecodeError):
                continue
            takes = [take for key, take in self._takes.items() if query.key_expr.intersects(key)]
            for take in takes:
                take(ZenohQuery(query))  # type: ignore[arg-type]
            if takes and str(query.key_expr) in _ANSWERED:
                assert query.answers, f"nobody answers {selector!r}"
        self._machine.sleep(0.01)


def _done(work: Callable[[], f.ObjectAnswer]) -> f.ObjectAnswer:
    """Carry a transfer out as ``Transfers`` does, but in this thread; an error that is not the library's is a finding."""
    from axisbus.gateway.zenoh.objects import answer_of

    try:
        return work()
    except AxisbusError as error:
        return answer_of(error)


_BRIDGE = _Bridge()


# -- ROS 2 ----------------------------------------------------------------------------------------------------------------


def _trajectories() -> Conversations:
    """Return pairs of a message and its attachment."""
    from axisbus.gateway.ros.messages import Attachment
    from kit.cdr import joint_trajectory

    attached = [Attachment(number, 10**9 * number, b"g" * 16).packed() for number in (1, 2, 3)]
    points = [(0.5, [1.0, 2.0], [0.0, 0.0], [], []), (1.0, [2.0, 3.0], [0.0, 0.0], [], [])]
    sent = [joint_trajectory(["x", "y"], points), joint_trajectory(["x"], []), joint_trajectory([], [])]
    return [[part for pair in zip(sent, attached, strict=True) for part in pair]]


def _ros(parts: Sequence[bytes]) -> None:
    """Decode and judge each trajectory as a bridge does."""
    from axisbus.gateway.ros.messages import attachment_of, trajectory_of
    from axisbus.gateway.ros.trajectory import judged, names_to_halt, to_halt
    from axisbus.gateway.ros.trajectory_executor import Freshness
    from axisbus.gateway.ros.units import joints_of

    joints, freshness, taken = joints_of({"x": "deg", "y": "mm"}), Freshness(0.0), 0
    for number, (data, attached) in enumerate(zip(parts[::2], parts[1::2], strict=False)):
        names = names_to_halt(data)
        if names is not None:
            assert set(to_halt(names, ("x", "y"))) <= {"x", "y"}
        with suppress(AxisbusError):
            freshness.require(attachment_of(attached), float(number), float(number))
        with suppress(AxisbusError):
            judged(trajectory_of(data), joints, time.time_ns())
            taken += 1
    if not taken:
        raise PassedOver


# -- OPC UA ---------------------------------------------------------------------------------------------------------------


class _Transport(asyncio.Transport):
    """A connection whose far end reads everything at once."""

    def __init__(self) -> None:
        super().__init__({"peername": ("127.0.0.1", 40000), "sockname": ("127.0.0.1", 4840)})
        self.protocol: Any = None
        self.written = 0
        self._closing = False

    def write(self, data: Any) -> None:
        self.written += len(data)

    def get_write_buffer_size(self) -> int:
        return 0

    def is_closing(self) -> bool:
        return self._closing

    def close(self) -> None:
        if not self._closing:
            self._closing = True
            asyncio.get_running_loop().call_soon(self.protocol.connection_lost, None)

    abort = close

    def pause_reading(self) -> None:
        pass

    resume_reading = pause_reading


class _Opcua:
    """The OPC UA server of a cell without a machine; each input is a connection in the server's thread."""

    @contextmanager
    def there(self) -> Iterator[None]:
        from axisbus.gateway.opcua import connection, server, session, users
        from axisbus.gateway.opcua.server_options import Given, ServerOptions, decide
        from axisbus.web import address
        from kit.opcua.client import ClientIdentity, visit

        made: list[Any] = []
        recorded: list[list[bytes]] = []
        same = SimpleNamespace(
            token_bytes=lambda count: b"t" * count
        )  # a replayed session gets the recorded token

        class Listener(connection.GuardedListener):
            def __init__(self, *given: Any) -> None:
                super().__init__(*given)
                made.append(self)

            def _make_protocol(self) -> Any:
                protocol = super()._make_protocol()
                came: list[bytes] = []
                recorded.append(came)
                received = protocol.data_received

                def receive(data: bytes) -> None:
                    came.append(data)
                    received(data)

                protocol.data_received = receive
                return protocol

        with ExitStack() as stack:
            cell = stack.enter_context(_cell())
            stack.enter_context(patch.object(server, "GuardedListener", Listener))
            stack.enter_context(patch.object(session, "secrets", same))
            listening, _ = address.opened("127.0.0.1", 0, tls=False)
            users_of = cell.parent / "users"
            users_of.write_text(users.line_of("anna", "right"), "utf-8")
            keeping = ServerOptions(decide(Given(True, users=True)), users=users.read(users_of))
            self._server = server.OpcUaServer(cells.load(cell), "cell", listening, keeping)
            stack.callback(self._server.close)
            (self._listener,) = made
            self._channels = self._listener.iserver._channel_id_counter
            visit(self._server.url, _look, ClientIdentity("anna", "right"))
            self.recorded = [list(one) for one in recorded if one]
            self._failed: list[str] = []
            self._server._loop.call_soon_threadsafe(
                self._server._loop.set_exception_handler, lambda _, context: self._failed.append(str(context))
            )
            yield

    def valid(self) -> Conversations:
        return self.recorded

    def take(self, parts: Sequence[bytes]) -> None:
        asyncio.run_coroutine_threadsafe(self._feed(parts), self._server._loop).result(_SECONDS)
        failed, self._failed = self._failed, []
        assert not failed, failed
        assert self._server.alive

    async def _feed(self, parts: Sequence[bytes]) -> None:
        """Replay an input on a new connection, whose channel gets the recorded number."""
        self._listener.iserver._channel_id_counter = self._channels
        transport = _Transport()
        protocol = transport.protocol = type(self._listener).__mro__[1]._make_protocol(self._listener)
        self.last = transport
        protocol.connection_made(transport)
        try:
            for part in parts:
                if transport.is_closing():
                    raise PassedOver
                protocol.data_received(part)
                await self._idle(protocol)
        finally:
            transport.close()
            await asyncio.sleep(0)
            await asyncio.sleep(0)

    async def _idle(self, protocol: Any) -> None:
        """Wait until the server has processed the message, at most 0.2 s."""
        until, messages = time.monotonic() + 0.2, protocol.messages
        while (
            not (messages.empty() and messages._getters)
            and not protocol._task.done()
            and time.monotonic() < until
        ):
            await asyncio.sleep(0)


async def _look(seen: Any) -> None:
    """Browse, read, call and subscribe, as clients do."""
    with suppress(Exception):
        await seen.node("/Axes").get_children()
    for path in ("/Axes/x/PositionActualValue", "/Axes/y/PositionActualValue"):
        await seen.value(path)
    with suppress(Exception):
        await seen.call("/Axes/x", "Halt")
    subscription = await seen.client.create_subscription(100, SimpleNamespace())
    await subscription.subscribe_data_change(seen.node("/Axes/x/PositionActualValue"))
    await subscription.delete()


_OPCUA = _Opcua()


def _certificates(folder: Path) -> list[bytes]:
    """Return the same certificate as text and as octets."""
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import Encoding

    from kit.opcua.client import key_pair

    (folder / "papers").mkdir()
    text = key_pair(folder / "papers", "fuzz", server=True).certificate.read_bytes()
    return [text, x509.load_pem_x509_certificate(text).public_bytes(Encoding.DER)]


def _certificate(path: Path) -> None:
    from axisbus.gateway.opcua import trust

    trust.is_in_time(path.read_bytes())
    trust.uri_of(path)
    trust.trusted(path.parent)


_ALL: dict[str, tuple[str, Callable[[], Reader]]] = {
    "bridge's queries": (
        "zenoh",
        lambda: reader_of(_queries, _BRIDGE.take, holds=_BRIDGE.there, limits=_LIMITS),
    ),
    "ROS 2": ("rosbags", lambda: reader_of(_trajectories, _ros, errors=(PassedOver,), names=unshown)),
    "certificate": (
        "asyncua",
        lambda: Reader(
            ".der", _certificates, _certificate, names=lambda text, path: str(path.parent) in text
        ),
    ),
    "OPC UA": (
        "asyncua",
        lambda: reader_of(
            _OPCUA.valid,
            _OPCUA.take,
            errors=(PassedOver,),
            names=unshown,
            holds=_OPCUA.there,
            limits=_LIMITS,
        ),
    ),
}
OF_BRIDGES: dict[str, Reader] = {name: make() for name, (package, make) in _ALL.items() if find_spec(package)}
