"""The OPC UA server in a thread of its own, with its event loop: it follows the given machine."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from concurrent.futures import Future
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from typing import Any

from asyncua import Node, Server, ua

from axisbus.cell.model import CellConfig
from axisbus.client_support.merged_stops import MergedStops
from axisbus.errors import AxisbusError, StateError, one_line
from axisbus.gateway.opcua import connection, limits
from axisbus.gateway.opcua.address_space import URI, AddressSpaceBuilder
from axisbus.gateway.opcua.axis_readings import TEMPERATURE_PERIOD, AxisReadings, measured
from axisbus.gateway.opcua.connection import GuardedListener
from axisbus.gateway.opcua.event_mapping import REFUSED, OpcuaEvent
from axisbus.gateway.opcua.limited_server import GuardedServer, OpcuaUserManager
from axisbus.gateway.opcua.methods import NO_MACHINE, MethodResult, OpcuaMethod, execute, status_of
from axisbus.gateway.opcua.server_options import ServerOptions
from axisbus.gateway.opcua.session import CALLER
from axisbus.gateway.opcua.trust import Rules, Trust, guarded, trusted, uri_of
from axisbus.gateway.opcua.value_writer import Updater
from axisbus.ipc.rate import Bucket
from axisbus.machine.machine import Machine
from axisbus.version import __version__

log = logging.getLogger("axisbus")
_START_TIMEOUT = 120.0  # seconds for its start: it creates some ten thousand nodes of the standard, slowly on a slow computer
_LAST = 5.0  # seconds for the end of the server
_POLICIES = {
    True: [ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt],
    False: [ua.SecurityPolicyType.NoSecurity],
}


class _Server(Server):
    """asyncua's server on a socket that is already bound, with guarded channels."""

    def __init__(
        self, inner: GuardedServer, listening: socket.socket, encrypted: bool, trust: Trust | None
    ) -> None:
        super().__init__(iserver=inner)
        self._listening, self._encrypted, self._trust = listening, encrypted, trust
        self.set_security_policy(_POLICIES[encrypted], Rules())
        self.application_type = ua.ApplicationType.Server
        self.name = self.manufacturer_name = "axisbus"
        self.product_uri = "urn:axisbus"

    async def start(self) -> None:
        """Start serving."""
        await self._setup_server_nodes()
        await self.iserver.start()
        self.bserver = GuardedListener(self.iserver, self._listening)
        self.bserver.set_policies(guarded(self._policies, self._encrypted, self._trust))
        await self.bserver.start()


class OpcUaServer:
    """Serve a cell until ``close``; holds the thread, the loop, and the objects of the loop."""

    def __init__(self, cell: CellConfig, name: str, listening: socket.socket, options: ServerOptions) -> None:
        """Serve on a bound socket; ``name`` is the name of the cell. Blocks for some seconds, until it serves.

        Raises:
            StateError, ConfigError: the certificate, its key or those of clients cannot be used, or the server does not start.
        """
        quiet()
        connection.install()
        self._cell, self._name, self._listening, self._options = cell, name, listening, options
        self._readings = AxisReadings(cell)
        self._events = OpcuaEventSender()
        self._trust = None if options.trust is None else trusted(options.trust)
        self._uri = _uri(name) if options.certificate is None else uri_of(options.certificate)
        self._loop = asyncio.new_event_loop()
        self._updater: Updater | None = None
        self._ending = asyncio.Event()
        self._fails = False
        self._started: Future[None] = Future()
        self._thread = threading.Thread(target=self._run, name="axisbus-opcua", daemon=True)
        self._thread.start()
        self._await_start()

    @property
    def url(self) -> str:
        """The URL of the server."""
        address, port = self._listening.getsockname()[:2]
        return f"opc.tcp://{f'[{address}]' if ':' in address else address}:{port}/axisbus"

    @property
    def alive(self) -> bool:
        """Whether the server runs."""
        return self._thread.is_alive()

    def follow(self, machine: Machine | None) -> None:
        """Follow another machine, or none; does not block."""
        self._readings.follow(machine)
        self._schedule(self._update)

    def now(self) -> float:
        """The time of the machine's clock, in seconds."""
        return self._readings.now()

    def report(self, events: Sequence[OpcuaEvent], devices: tuple[str, ...]) -> None:
        """Send events, and write the identity of each node; does not block."""
        clock, utc = self.now(), datetime.now(UTC)
        timed = [(each, utc - timedelta(seconds=max(0.0, clock - each.stamp))) for each in events]
        self._schedule(lambda: self._report(timed, devices))

    def close(self) -> None:
        """End the server; blocks briefly."""
        with suppress(RuntimeError):  # the loop has already ended
            self._loop.call_soon_threadsafe(self._ending.set)
        self._thread.join(_LAST)
        self._listening.close()

    # -- in its thread -----------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            asyncio.set_event_loop(self._loop)
            self._loop.run_until_complete(self._serve())
        except Exception as error:  # reported by the caller that supervises the server
            if not self._started.done():
                self._started.set_exception(error)
            else:
                log.exception("the OPC UA server has ended")
        finally:
            _end_all(self._loop)
            self._loop.close()

    def _await_start(self) -> None:
        try:
            self._started.result(_START_TIMEOUT)
        except Exception as error:
            self._listening.close()
            raise StateError(
                "the OPC UA server does not start", observed=str(error) or type(error).__name__
            ) from error

    async def _serve(self) -> None:
        server = await self._create()
        cyclic_tasks = [
            asyncio.create_task(each()) for each in (self._update_cyclically, self._measure_cyclically)
        ]
        try:
            await server.start()
            self._started.set_result(None)
            await self._ending.wait()
        finally:
            for task in cyclic_tasks:
                task.cancel()
            await server.stop()

    async def _create(self) -> Server:
        options = self._options
        user_manager = OpcuaUserManager(options.users, anonymous=options.access.anonymous)
        encrypted = options.access.encrypted
        inner = GuardedServer(user_manager, encrypted=encrypted, before=self._update_if_old)
        server = _Server(inner, self._listening, encrypted, self._trust)
        await server.init()
        await server.set_application_uri(self._uri)
        server.set_endpoint(self.url)
        await server.set_build_info("urn:axisbus", "axisbus", "axisbus", __version__, "", datetime.now(UTC))
        if options.certificate is not None and options.key is not None:
            await server.load_certificate(options.certificate, "pem")
            await server.load_private_key(options.key, format="pem")
        index = await server.register_namespace(URI)
        calls = OpcuaMethodCalls(self._readings, self._cell)
        nodes = await AddressSpaceBuilder(server, self._cell, self._name, index).build(
            options.verbs, calls.call
        )
        await self._events.build(server, index, nodes.incidents)
        calls.refused = self._refused
        self._updater = Updater(server, nodes, self._readings)
        return server

    async def _update_if_old(self) -> None:
        if self._updater is not None and self._updater.is_old:
            await self._update()

    async def _update_cyclically(self) -> None:
        while True:
            await self._update()
            await asyncio.sleep(1.0 / self._options.rate)

    async def _update(self) -> None:
        """Write the readings; if that fails, for example while a machine ends, all values are bad until the next update."""
        try:
            if self._updater is not None:
                await self._updater.update()
            self._fails = False
        except Exception:
            if not self._fails:  # once, not at each update
                log.exception("the values of the machine cannot be published by OPC UA")
            self._fails = True

    async def _measure_cyclically(self) -> None:
        while True:
            machine = self._readings.machine
            if machine is not None and self._readings.image.value != "none":
                with suppress(Exception):  # the machine may end meanwhile; the next update shows that
                    await asyncio.to_thread(self._measure, machine)
            await asyncio.sleep(TEMPERATURE_PERIOD if machine is not None else 1.0)

    def _measure(self, machine: Machine) -> None:
        for axis, reading in measured(machine, self._readings.now):
            if self._readings.machine is machine:
                self._readings.temperatures[axis] = reading

    async def _refused(self, event: OpcuaEvent) -> None:
        await self._events.send([(event, datetime.now(UTC))])

    async def _report(self, timed: Sequence[tuple[OpcuaEvent, datetime]], devices: tuple[str, ...]) -> None:
        await self._events.send(timed)
        if self._updater is not None:
            await self._updater.write_devices(devices)

    def _schedule(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Schedule work in the loop; if the loop has ended, do nothing."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(lambda: self._loop.create_task(work()))


def quiet() -> None:
    """Silence the logs of asyncua, and those of asyncio about lost clients: axisbus reports errors to users itself."""
    for name in ("asyncua", "asyncuagds"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    logging.getLogger("asyncio").setLevel(logging.ERROR)


def _uri(name: str) -> str:
    return f"urn:{socket.gethostname()}:axisbus:{name}"


def _end_all(loop: asyncio.AbstractEventLoop) -> None:
    """Cancel the running tasks, so that none is left when the loop is closed."""
    tasks = asyncio.all_tasks(loop)
    for task in tasks:
        task.cancel()
    if tasks:
        loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))


# -- Carry out a method called by a client as one command of each axis; report refusals as events ----------------------


async def _ignore_refusal(_: OpcuaEvent) -> None:
    return None


class OpcuaMethodCalls:
    """Carry out methods on the followed machine; ``refused`` is awaited with each failure.

    It holds the running stops of the machine, and of each user the number of calls that wait and the rate of events.
    """

    def __init__(self, readings: AxisReadings, cell: CellConfig) -> None:
        self._readings, self._cell = readings, cell
        self._stops: tuple[Machine, MergedStops] | None = None
        self._waiting: Counter[str] = Counter()
        self._events: defaultdict[str, Bucket] = defaultdict(lambda: Bucket(*limits.REFUSALS))
        self.refused: Callable[[OpcuaEvent], Awaitable[None]] = _ignore_refusal

    async def call(self, verb: OpcuaMethod, axis: str) -> ua.CallMethodResult:
        """Carry out a method on an axis, or on all ("").

        By the standard, a call with a bad status has no result, so its text is sent as an event, within a rate for each user.
        """
        ended = await self._execute(verb, axis)
        log.info("OPC UA: %s of %s for %s: %s", verb.value, axis or "all axes", CALLER.get(), ended.status)
        result = ua.CallMethodResult(StatusCode=ua.StatusCode(getattr(ua.StatusCodes, ended.status)))
        if ended.status == "Good":
            result.OutputArguments = [ua.Variant(ended.text, ua.VariantType.String)]
        elif self._events[CALLER.get()].take(time.monotonic()):
            words = f"{verb.value} of {axis or 'all axes'}, called by {CALLER.get()}, failed"
            await self.refused(OpcuaEvent(self._readings.now(), REFUSED, words, ended.text, axis=axis))
        return result

    async def _execute(self, verb: OpcuaMethod, axis: str) -> MethodResult:
        machine = self._readings.machine
        if machine is None or machine.session.ended:
            return NO_MACHINE
        axes = [axis] if axis else list(self._cell.axes)
        try:
            if verb is OpcuaMethod.RESET:
                return await asyncio.to_thread(self._reset, axes)
            return await self._stopped(machine, verb, axes)
        except AxisbusError as error:
            return MethodResult(status_of(error), one_line(error))

    async def _stopped(self, machine: Machine, verb: OpcuaMethod, axes: list[str]) -> MethodResult:
        """Give stops, and wait for their ends, unless too many calls of the user already wait: no stop waits for another."""
        if self._stops is None or self._stops[0] is not machine:
            self._stops = machine, MergedStops(machine)
        user = CALLER.get()
        limit = limits.HALTING if self._waiting[user] < limits.WAITING_CALLS else 0.0
        self._waiting[user] += 1
        try:
            return await execute(machine, verb, axes, self._stops[1], limit)
        finally:
            self._waiting[user] -= 1

    def _reset(self, axes: list[str]) -> MethodResult:
        """Take control of the machine for the reset, and release it; blocks.

        Raises:
            OwnershipError: another program has control. Also the errors of ``Machine.attach``.
        """
        with Machine.attach(self._cell.file, command=True) as machine:
            stops = MergedStops(machine)
            return asyncio.run(execute(machine, OpcuaMethod.RESET, axes, stops, limits.HALTING))


# -- Errors and warnings as events of OPC UA, emitted by the server and by the cell's node Incidents -------------------


TYPE = "AxisbusIncidentType"
_FIELDS = ("Cause", "Remedy", "Axis")


class OpcuaEventSender:
    """Send events; holds a generator for each emitting node."""

    def __init__(self) -> None:
        self._generators: list[Any] = []

    async def build(self, server: Server, index: int, source: Node) -> None:
        """Create the type of the events, a subtype of BaseEventType with one text each for cause, remedy and axis."""
        base = server.get_node(ua.NodeId(ua.ObjectIds.BaseEventType))
        kind = await base.add_object_type(ua.NodeId(TYPE, index), ua.QualifiedName(TYPE, index))
        for name in _FIELDS:
            node_id = ua.NodeId(f"{TYPE}/{name}", index)
            await kind.add_property(node_id, ua.QualifiedName(name, index), "", ua.VariantType.String)
        for emitting in (server.get_node(ua.NodeId(ua.ObjectIds.Server)), source):
            generator = await server.get_event_generator(kind, emitting.nodeid)
            generator.event.SourceNode = source.nodeid
            generator.event.SourceName = (await source.read_browse_name()).Name
            self._generators.append(generator)

    async def send(self, timed: Sequence[tuple[OpcuaEvent, datetime]]) -> None:
        """Send each event with the time at which it happened."""
        for opcua_event, when in timed:
            for generator in self._generators:
                await _trigger(generator, opcua_event, when)


async def _trigger(generator: Any, opcua_event: OpcuaEvent, when: datetime) -> None:
    event = generator.event
    event.Severity = opcua_event.severity
    event.Cause, event.Remedy, event.Axis = opcua_event.cause, opcua_event.remedy, opcua_event.axis
    await generator.trigger(when, opcua_event.message)
