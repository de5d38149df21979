"""The OPC UA server: the view of a client, access control, and its limits for misbehaving clients."""

from __future__ import annotations

import asyncio
import copy
import os
import shutil
import socket
import ssl
import struct
import threading
import time
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest

pytest.importorskip("asyncua", reason="OPC UA needs asyncua")

from asyncua import Client, ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import User
from asyncua.ua.ua_binary import nodeid_to_binary, struct_to_binary
from asyncua.ua.uaerrors import UaStatusCodeError
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding

from axisbus.errors import ConfigError, StateError
from axisbus.gateway.opcua import limits, trust
from axisbus.gateway.opcua import server as opcua_server
from axisbus.gateway.opcua.axis_readings import ImageFreshness
from axisbus.gateway.opcua.event_mapping import OpcuaEvent
from axisbus.gateway.opcua.limited_server import CHECKED, GuardedServer, OpcuaUserManager
from axisbus.gateway.opcua.methods import MethodResult, OpcuaMethod, given
from axisbus.gateway.opcua.monitoring import LimitedSubscription
from axisbus.gateway.opcua.server_options import Given, ServerOptions, decide
from axisbus.gateway.opcua.session import GuardedSession
from axisbus.gateway.opcua.trust import TrustingFactory
from axisbus.machine.machine import Machine
from kit import command_line
from kit.closed_connection import closed
from kit.opcua.client import ClientIdentity, Visit, connected_client, key_pair, visit
from kit.opcua.server import (
    ANNA,
    POSITION,
    X,
    Y,
    address,
    connections,
    good,
    halt,
    refused,
    running,
    served,
    until,
)


@pytest.fixture
def machine(file, server):
    with Machine.simulated(file) as opened:
        server.follow(opened)
        yield opened
        server.follow(None)


# -- the view of a client -------------------------------------------------------------------------------------------------


def test_without_a_machine_everything_is_bad_and_the_tree_is_there(server):
    async def look(seen: Visit):
        axes = [(await each.read_browse_name()).Name for each in await seen.node("/Axes").get_children()]
        running, _ = await seen.value("/Running")
        return axes, running, await seen.value(POSITION)

    axes, running, (value, status) = visit(server.url, look)
    assert (axes, running, value) == (["x", "y"], False, None)
    assert status in ("BadWaitingForInitialData", "BadNoCommunication")


def test_the_variables_of_an_axis_have_values_units_and_names_of_states(server, machine):
    good(server.url)

    async def look(seen: Visit):
        found = {}
        for node in await seen.node(X).get_variables():
            name = (await node.read_browse_name()).Name
            more = {
                (await each.read_browse_name()).Name: await each.read_value()
                for each in await node.get_properties()
            }
            found[name] = (await node.read_data_value(False), await node.read_type_definition(), more)
        return found

    found = visit(server.url, look)
    assert set(found) == {
        "AxisType",
        "ControlMode",
        "AxisState",
        "HomingState",
        "PositionActualValue",
        "PositionFollowingError",
        "VelocityActualValue",
        "TorqueForceActualValue",
        "MotorTemperature",
    }
    position, kind, more = found["PositionActualValue"]
    assert position.Value == ua.Variant(machine["x"].position, ua.VariantType.Double)
    assert kind == ua.NodeId(ua.ObjectIds.BaseAnalogType)
    assert (more["EngineeringUnits"].UnitId, more["EngineeringUnits"].DisplayName.Text) == (17476, "deg")
    assert abs(position.SourceTimestamp - datetime.now(UTC)) < timedelta(
        seconds=60
    )  # as the library, in real time
    state, kind, more = found["AxisState"]
    assert kind == ua.NodeId(ua.ObjectIds.MultiStateValueDiscreteType)
    names = {each.Value: each.DisplayName.Text for each in more["EnumValues"]}
    assert names[state.Value.Value] == more["ValueAsText"].Text == "Disabled"
    assert found["AxisType"][2]["ValueAsText"].Text == "ROTATORY"
    assert found["MotorTemperature"][0].Value.VariantType is not ua.VariantType.Double


def test_a_value_of_an_image_that_is_old_is_uncertain_and_after_the_machine_bad(server, machine, monkeypatch):
    good(server.url)
    before, _ = visit(server.url, lambda seen: seen.value(POSITION))
    monkeypatch.setattr(type(server._readings), "image", ImageFreshness.OLD)
    until(
        lambda: visit(server.url, lambda seen: seen.value(POSITION)) == (before, "UncertainLastUsableValue")
    )
    monkeypatch.undo()
    good(server.url)
    server.follow(None)
    until(lambda: visit(server.url, lambda seen: seen.value(POSITION)) == (None, "BadNoCommunication"))


def test_a_read_after_a_pause_looks_at_the_machine_first(server, machine, monkeypatch):
    good(server.url)

    async def paused(seen: Visit):
        looker = server._readings
        monkeypatch.setattr(type(looker), "image", ImageFreshness.NONE)
        monkeypatch.setattr(server._updater, "_last_update", time.monotonic() - 5.0)
        return await seen.value(POSITION)

    assert visit(server.url, paused) == (None, "BadNoCommunication")


def test_if_the_machine_cannot_be_read_no_value_stays_good(server, machine, monkeypatch, caplog):
    good(server.url)

    def fails():
        raise RuntimeError("in the midst of its end")

    monkeypatch.setattr(server._readings, "poll", fails)
    until(lambda: visit(server.url, lambda seen: seen.value(POSITION)) == (None, "BadNoCommunication"))
    time.sleep(0.5)
    assert len([each for each in caplog.records if each.name == "axisbus"]) == 1
    monkeypatch.undo()
    good(server.url)


class Heard:
    """The notifications of a subscription."""

    def __init__(self):
        self.values, self.events = [], []

    def datachange_notification(self, node, value, data):
        self.values.append(value)

    def event_notification(self, event):
        self.events.append(event)

    async def event(self):
        """Wait until an event has come, at most 5 s, and another moment in which a second one would."""
        for _ in range(100):
            if self.events:
                break
            await asyncio.sleep(0.05)
        await asyncio.sleep(0.3)


def test_each_event_is_sent_once_to_each_subscriber_at_the_server_or_the_incidents(server, machine):
    told = OpcuaEvent(server.now(), 900, "x: a fault", "seen", "do this", "x")

    async def listen(seen: Visit):
        heard = Heard(), Heard()
        kind = seen.client.get_node(ua.NodeId("AxisbusIncidentType", seen.index))
        for each, source in zip(heard, (seen.client.nodes.server, seen.node("/Incidents")), strict=True):
            subscription = await seen.client.create_subscription(50, each)
            await subscription.subscribe_events(source, kind)
        await asyncio.to_thread(server.report, [told], ("1: a drive",))
        for _ in range(100):
            await asyncio.sleep(0.05)
            if all(each.events for each in heard):
                break
        await asyncio.sleep(0.2)
        return [each.events for each in heard], await seen.value("/Devices")

    heard, (devices, _) = visit(server.url, listen)
    assert devices == ["1: a drive"]
    for events in heard:
        (event,) = events
        assert (event.Message.Text, event.Severity) == ("x: a fault", 900)
        assert (event.Cause, event.Remedy, event.Axis) == ("seen", "do this", "x")
        assert event.SourceName == "Incidents"


# -- access control -------------------------------------------------------------------------------------------------------


async def write(seen: Visit):
    await seen.node(POSITION).write_value(ua.Variant(7.0, ua.VariantType.Double))


def test_no_client_can_write(server, machine):
    good(server.url)
    with refused("BadUserAccessDenied"):
        visit(server.url, write)
    with refused("BadNotWritable"):
        visit(server.url, write, ANNA)
    assert visit(server.url, lambda seen: seen.value(POSITION)) == (machine["x"].position, "Good")


def test_anonymous_clients_call_no_method_and_users_halt_and_stop(server, machine):
    with refused("BadUserAccessDenied"):
        visit(server.url, halt)
    assert visit(server.url, halt, ANNA).startswith("x: Disabled at 0 deg")
    text = visit(server.url, lambda seen: seen.call("", "Stop"), ANNA)
    assert [line.partition(":")[0] for line in text.splitlines()] == ["x", "y"]


@pytest.fixture
def held(machine, monkeypatch):
    """Halts last until ``over``, at most 10 s, as if an axis braked for long; ``given`` has the methods, ``stops`` their stops."""
    held = SimpleNamespace(over=False, given=[], stops=[])

    async def carried_out(_, verb, axes, stops, limit):
        held.given.append((*axes, verb.value))
        held.stops.append(stops)
        until = time.monotonic() + 10.0
        while verb is OpcuaMethod.HALT and limit and not held.over and time.monotonic() < until:
            await asyncio.sleep(0.01)
        return MethodResult("Good" if limit else "BadTimeout", "as in the test")

    monkeypatch.setattr(opcua_server, "execute", carried_out)
    yield held
    held.over = True


def test_a_stop_and_a_read_do_not_wait_for_an_earlier_call_of_their_connection(server, held):
    async def stop_during_a_halt(seen: Visit):
        halting = asyncio.create_task(seen.call(X, "Halt"))
        while not held.given:
            await asyncio.sleep(0.01)
        stopped = await asyncio.wait_for(seen.call(X, "Stop"), 5.0)
        _, status = await asyncio.wait_for(seen.value("/Running"), 5.0)
        waits = not halting.done()
        held.over = True
        return stopped, status, waits, await halting

    stopped, status, waits, halted = visit(server.url, stop_during_a_halt, ANNA)
    assert (stopped, status, waits, halted) == ("as in the test", "Good", True, "as in the test")
    assert held.given == [("x", "Halt"), ("x", "Stop")]
    assert held.stops[0] is held.stops[1]  # equal stops are merged


def test_halt_and_stop_are_given_by_the_merged_stops_of_the_machine(machine):
    seen = []
    stops = SimpleNamespace(send=lambda *asked: seen.append(asked))
    for verb in (OpcuaMethod.HALT, OpcuaMethod.STOP):
        given(machine["x"], verb, stops)
    assert seen == [("x", "halt"), ("x", "quick_stop")]


def test_all_methods_of_one_request_are_called_at_once(server, held):
    async def both(seen: Visit):
        asked = []
        for path, name in ((X, "Halt"), (Y, "Stop")):
            node = seen.node(path)
            method = await node.get_child(f"{seen.index}:{name}")
            asked.append(ua.CallMethodRequest(node.nodeid, method.nodeid, []))
        calling = asyncio.create_task(seen.client.uaclient.call(asked))
        for _ in range(100):
            await asyncio.sleep(0.01)
        both = list(held.given)
        held.over = True
        return both, [each.StatusCode.name for each in await calling]

    assert visit(server.url, both, ANNA) == ([("x", "Halt"), ("y", "Stop")], ["Good", "Good"])


def test_if_too_many_calls_of_a_user_wait_further_stops_are_given_and_answered_at_once(
    server, held, monkeypatch
):
    monkeypatch.setattr(limits, "WAITING_CALLS", 2)

    async def many(seen: Visit):
        calls = [asyncio.create_task(seen.call(X, "Halt")) for _ in range(2)]
        while len(held.given) < 2:
            await asyncio.sleep(0.01)
        with refused("BadTimeout"):
            await seen.call(Y, "Halt")
        held.over = True
        return await asyncio.gather(*calls)

    assert len(visit(server.url, many, ANNA)) == 2
    assert held.given[-1] == ("y", "Halt")


def test_waiting_requests_of_clients_without_a_name_delay_no_stop(server, machine, monkeypatch):
    reads, at_stop, read = [], [], GuardedSession.read

    async def counted(self, params):
        reads.append(self)
        return await read(self, params)

    async def carried_out(*_):
        at_stop.append(len(reads))
        return MethodResult("Good", "")

    monkeypatch.setattr(GuardedSession, "read", counted)
    monkeypatch.setattr(opcua_server, "execute", carried_out)
    item = ua.ReadValueId(NodeId=ua.NodeId(f"Machines/cell{POSITION}", 2), AttributeId=ua.AttributeIds.Value)

    async def stop_beside_reads():
        guests = [await connected_client(server.url, ClientIdentity()) for _ in range(3)]
        user = await connected_client(server.url, ANNA)
        node = user.get_node(ua.NodeId(f"Machines/cell{X}", 2))
        method = await node.get_child("2:Stop")
        reads.clear()
        for guest in guests:
            line = guest.uaclient.protocol
            line.data_received = lambda _: None
            request = ua.ReadRequest()
            request.RequestHeader.AuthenticationToken = line.authentication_token
            request.Parameters.NodesToRead = [item] * 20
            body = struct_to_binary(request)
            waiting = [line._connection.message_to_binary(body, request_id=1000 + each) for each in range(50)]
            line.transport.write(b"".join(waiting))
        await user.uaclient.call([ua.CallMethodRequest(node.nodeid, method.nodeid, [])])
        for guest in guests:
            guest.uaclient.protocol.transport.abort()
        for client in (user, *guests):
            with suppress(Exception):
                await client.disconnect()

    asyncio.run(stop_beside_reads())
    assert at_stop[0] < 20


def test_of_clients_without_a_name_only_one_request_waits_before_those_of_users():
    order = []

    async def take(server, named):
        await server.await_lock(named=named)
        order.append(named)

    async def crowd():
        server = GuardedServer(OpcuaUserManager(None, anonymous=True), encrypted=False, before=None)
        guests = [asyncio.create_task(take(server, False)) for _ in range(20)]
        await asyncio.sleep(0)
        await asyncio.gather(take(server, True), *guests)

    asyncio.run(crowd())
    assert order.index(True) <= 1
    assert len(order) == 21


def test_thousands_of_waiting_values_are_sent_in_messages_between_which_other_tasks_run():
    """asyncua packed all of them at once, and no method was called meanwhile."""
    sent, others = [], []

    async def send(result, _request):
        values = result.NotificationMessage.NotificationData[0].MonitoredItems
        sent.append((len(values), result.MoreNotifications, len(others)))

    async def publish():
        made = ua.CreateSubscriptionResult(RevisedPublishingInterval=100.0)
        subscription = LimitedSubscription(
            made, None, send, ua.NodeId(1), request_callback=lambda _: "a request"
        )
        subscription.turn = asyncio.Lock()
        for item in range(1, 1101):
            for _ in range(10):
                await subscription.enqueue_datachange_event(item, ua.MonitoredItemNotification(), 100)
        publishing = asyncio.create_task(subscription.publish_results())
        while not publishing.done():
            others.append(len(sent))
            await asyncio.sleep(0)

    asyncio.run(publish())
    assert [count for count, *_ in sent] == [limits.NOTIFICATIONS] * 11
    assert [more for _, more, _ in sent] == [True] * 10 + [False]
    assert len({seen for *_, seen in sent}) == 11


def test_of_a_client_without_a_name_few_values_wait_in_all_and_the_newest_stay(monkeypatch):
    monkeypatch.setattr(limits, "NAMELESS_WAITING", 10)

    async def fill(named):
        made = ua.CreateSubscriptionResult(RevisedPublishingInterval=100.0)
        subscription = LimitedSubscription(made, None, None, ua.NodeId(1))
        subscription.is_named = named
        for value in range(20):
            for item in range(1, 1 + (5 if value else 1)):
                given = ua.MonitoredItemNotification(ClientHandle=value)
                await subscription.enqueue_datachange_event(item, given, 15)
        return [
            [each.ClientHandle for each in values] for values in subscription._triggered_datachanges.values()
        ]

    assert asyncio.run(fill(False)) == [[18, 19]] * 5
    assert asyncio.run(fill(True)) == [list(range(5, 20))] * 5


def test_clients_without_a_name_get_a_limited_number_of_items_for_events(server, monkeypatch):
    monkeypatch.setattr(limits, "NAMELESS_EVENTS", 3)

    async def monitor(seen: Visit):
        subscription = await seen.client.create_subscription(1000, Heard())
        params = ua.CreateMonitoredItemsParameters(SubscriptionId=subscription.subscription_id)
        params.ItemsToCreate = [event_item(ua.EventFilter()) for _ in range(2)]
        made = [await seen.client.uaclient.create_monitored_items(params) for _ in range(2)]
        return [each.StatusCode.name for every in made for each in every]

    assert visit(server.url, monitor) == ["Good"] * 3 + ["BadTooManyMonitoredItems"]
    assert visit(server.url, monitor, ANNA) == ["Good"] * 4


def test_clients_without_a_name_get_a_limited_number_of_items_of_one_variable(server, machine, monkeypatch):
    """Each new value is written to all of them at once."""
    monkeypatch.setattr(limits, "NAMELESS_OF_VARIABLE", 3)

    async def monitor(seen: Visit):
        subscription = await seen.client.create_subscription(1000, SimpleNamespace())
        made = await subscription.subscribe_data_change([seen.node(POSITION)] * 5)
        other = await subscription.subscribe_data_change([seen.node(f"{Y}/PositionActualValue")])
        return [code for code in (*made, other) if isinstance(code, ua.StatusCode)], len(made)

    codes, made = visit(server.url, monitor)
    assert ([code.name for code in codes], made) == (["BadTooManyMonitoredItems"] * 2, 5)
    assert visit(server.url, monitor, ANNA)[0] == []


def test_a_method_of_another_object_and_extra_arguments_are_refused(server, machine):
    async def ask(seen: Visit):
        method = seen.node(f"{X}/Halt").nodeid
        with refused("BadMethodInvalid"):
            await seen.node(Y).call_method(method)
        with refused("BadTooManyArguments"):
            await seen.node(X).call_method(method, 1)
        return await seen.node(X).call_method(method)

    assert visit(server.url, ask, ANNA).startswith("x: Disabled")


def test_a_reset_is_not_there_unless_it_is_allowed(server, machine):
    async def methods(seen: Visit):
        return [(await each.read_browse_name()).Name for each in await seen.node(X).get_methods()]

    assert visit(server.url, methods, ANNA) == ["Halt", "Stop"]


def test_without_a_machine_a_method_is_refused_and_an_event_reports_it(server):
    async def ask(seen: Visit):
        heard = Heard()
        subscription = await seen.client.create_subscription(50, heard)
        await subscription.subscribe_events(
            seen.client.nodes.server, ua.NodeId("AxisbusIncidentType", seen.index)
        )
        with refused("BadNoCommunication"):
            await seen.call(X, "Halt")
        await heard.event()
        return [event.Cause for event in heard.events], heard.events[0].Message.Text

    server.follow(None)
    causes, message = visit(server.url, ask, ANNA)
    assert len(causes) == 1
    assert "no machine is running" in causes[0]
    assert "anna" in message


def test_a_wrong_password_is_refused_each_time(server):
    for who in (
        *(ClientIdentity("anna", each) for each in ("wrong", "x", "right ")),
        ClientIdentity("nobody", "right"),
    ):
        with refused("BadUserAccessDenied"):
            visit(server.url, halt, who)
    assert visit(server.url, running, ANNA)[1] == "Good"


def test_many_clients_with_wrong_passwords_do_not_prevent_users_from_connecting(server, machine):
    """Neither a user that connects for the first time, nor one that returns."""
    server._updater._server.iserver.gate._right.clear()
    over = threading.Event()

    async def wrong():
        while not over.is_set():
            with suppress(UaStatusCodeError, ServiceError, ConnectionError, TimeoutError):
                await connected_client(server.url, ClientIdentity("anna", "wrong"))

    async def beside():
        crowd = [asyncio.create_task(wrong()) for _ in range(12)]
        await asyncio.sleep(0.5)
        for _ in range(3):
            client = await connected_client(server.url, ANNA)
            await client.disconnect()
        over.set()
        await asyncio.wait(crowd)

    asyncio.run(asyncio.wait_for(beside(), 20.0))
    assert visit(server.url, halt, ANNA) is not None


def test_a_client_s_session_and_subscriptions_are_its_own(server):
    async def steal(seen: Visit):
        heard = Heard()
        subscription = await seen.client.create_subscription(50, heard)
        other = await connected_client(server.url, ClientIdentity())
        try:
            (status,) = await other.uaclient.delete_subscriptions([subscription.subscription_id])
            assert status.name == "BadSubscriptionIdInvalid"
            stolen = ua.TransferSubscriptionsParameters(SubscriptionIds=[subscription.subscription_id])
            with refused("BadSubscriptionIdInvalid"):
                await other.uaclient.transfer_subscriptions(stolen)
            token = other.uaclient.protocol.authentication_token
            assert token.NodeIdType is ua.NodeIdType.ByteString
        finally:
            await other.disconnect()

    visit(server.url, steal)


def test_one_address_cannot_hold_all_subscriptions(server):
    async def ask(seen: Visit):
        made = 0
        with refused("BadTooManySubscriptions"):
            for _ in range(limits.SUBSCRIPTIONS):
                await seen.client.create_subscription(60_000, Heard())
                made += 1
        return made

    assert limits.OF_ADDRESS.subscriptions - 2 <= visit(server.url, ask) <= limits.OF_ADDRESS.subscriptions


def test_registering_another_server_is_refused(server):
    async def register(seen: Visit):
        with refused("BadServiceUnsupported"):
            await seen.client.uaclient.register_server(
                ua.RegisteredServer(ServerNames=[ua.LocalizedText("x")])
            )

    visit(server.url, register)


# -- misbehaving clients ----------------------------------------------------------------------------------------------------


def hello(receives, sends):
    body = struct.pack("<IIIII", 0, receives, sends, 0, 0) + struct.pack("<i", 0)
    return b"HELF" + struct.pack("<I", len(body) + 8) + body


def without_a_channel():
    body = struct.pack("<IIII", 0, 0, 1, 1) + struct_to_binary(ua.GetEndpointsRequest())
    return b"MSGF" + struct.pack("<I", len(body) + 8) + body


@pytest.mark.parametrize(
    "junk",
    [
        b"GET / HTTP/1.1\r\nHost: x\r\n\r\n",
        b"\0" * 4096,
        os.urandom(4096).replace(b"HEL", b"xxx"),
        b"HELF" + struct.pack("<I", 0xFFFFFFF0) + b"x" * 100,
        b"HELF" + struct.pack("<I", 0),
        b"MSGF" + struct.pack("<I", 1 << 24) + b"x" * 70_000,
        hello(16, 65_535),
        hello(65_535, 0),
        hello(65_535, 65_535) * 2,
        b"HELF" + struct.pack("<I", 12) + b"x" * 4,
        hello(65_535, 65_535) + without_a_channel(),
    ],
    ids=[
        "http",
        "zeros",
        "noise",
        "huge",
        "empty",
        "long",
        "small",
        "nothing",
        "twice",
        "short",
        "no channel",
    ],
)
def test_a_connection_with_another_protocol_is_closed(server, junk):
    with socket.create_connection(address(server), timeout=3.0) as line:
        with suppress(OSError):
            line.sendall(junk)
        assert closed(line, 3.0)
    assert visit(server.url, lambda seen: seen.value("/Running"))[1] == "Good"


def test_a_client_that_sends_requests_and_never_reads_is_disconnected(server, monkeypatch):
    monkeypatch.setattr(limits, "PATIENCE", 0.5)
    large = ua.NodeId("Machines/cell/Axes/x/ControlMode/EnumValues", 2)
    asked = ua.ReadValueId(NodeId=large, AttributeId=ua.AttributeIds.Value)

    async def flood():
        client = await connected_client(server.url, ClientIdentity())
        line = client.uaclient.protocol
        transport = line.transport
        transport.pause_reading()
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        request = ua.ReadRequest()
        request.RequestHeader.AuthenticationToken = line.authentication_token
        request.Parameters.NodesToRead = [asked] * 400
        body = struct_to_binary(request)
        for number in range(100):
            if transport.is_closing():
                break
            transport.write(line._connection.message_to_binary(body, request_id=1000 + number))
            await asyncio.sleep(0.005)
        for _ in range(300):
            if not connections(server):
                break
            await asyncio.sleep(0.05)
        transport.abort()
        with suppress(Exception):
            await client.disconnect()
        return list(connections(server))

    assert asyncio.run(flood()) == []
    assert visit(server.url, running)[1] == "Good"


def test_many_anonymous_clients_leave_room_for_other_addresses_and_for_users(server):
    most = limits.OF_ADDRESS.sessions

    async def crowd():
        asked = (connected_client(server.url, ClientIdentity()) for _ in range(most + 5))
        found = await asyncio.gather(*asked, return_exceptions=True)
        entered = [each for each in found if not isinstance(each, BaseException)]
        values = await asyncio.gather(*(each.nodes.server_state.read_value() for each in entered))
        inner = server._updater._server.iserver
        other = inner.create_session(("127.0.0.9", 1))
        assert inner.admits(other, named=False)
        inner.unregister_external_session(other)
        users = [await connected_client(server.url, ANNA) for _ in range(10)]
        for each in users:
            subscription = await each.create_subscription(1000, Heard())
            await subscription.subscribe_data_change(each.nodes.server_state)
        await asyncio.gather(*(each.disconnect() for each in (*entered, *users)))
        return (
            len(entered),
            set(map(int, values)),
            [each for each in found if isinstance(each, BaseException)],
        )

    entered, values, others = asyncio.run(crowd())
    assert most - 3 <= entered <= most  # one of a test before may not have ended yet
    assert values == {0}
    assert {ua.StatusCode(each.code).name for each in others} == {"BadTooManySessions"}


def test_disconnected_clients_leave_room_for_new_ones(server):
    """Each has a session and a subscription, and is cut off: those wait for a client that returns, but not for ever."""

    async def lose():
        client = await connected_client(server.url, ClientIdentity())
        await client.create_subscription(1000, Heard())
        client.uaclient.protocol.transport.abort()
        with suppress(Exception):
            await client.disconnect()

    async def crowd():
        for _ in range(limits.OF_ADDRESS.sessions + 5):
            await asyncio.wait_for(lose(), 5)
        client = await connected_client(server.url, ClientIdentity())
        for _ in range(15):
            await client.create_subscription(1000, Heard())
        await client.disconnect()

    asyncio.run(crowd())


def test_a_connection_whose_client_uses_another_one_is_closed(server, monkeypatch):
    monkeypatch.setattr(limits, "PATIENCE", 0.5)

    async def stay():
        client = await connected_client(server.url, ClientIdentity())
        (line,) = [each for each in connections(server) if each.is_in]
        line.processor.session_last_activity -= 3600.0  # and its session is as it was
        for _ in range(100):
            if line not in connections(server):
                break
            await asyncio.sleep(0.05)
        gone = line not in connections(server)
        with suppress(Exception):
            await client.disconnect()
        return gone

    assert asyncio.run(stay())


def test_a_connection_without_a_session_is_closed(server, monkeypatch):
    monkeypatch.setattr(limits, "PATIENCE", 0.5)

    async def leave():
        client = await connected_client(server.url, ClientIdentity())
        await asyncio.sleep(1.5)
        stays = len(connections(server))
        await client.close_session()
        for _ in range(100):
            if not connections(server):
                break
            await asyncio.sleep(0.05)
        left = len(connections(server))
        client.disconnect_socket()
        return stays, left

    assert asyncio.run(leave()) == (1, 0)


def literal(octets):
    """A header of a request that contains a Variant, before any authentication."""
    kind = nodeid_to_binary(ua.typeid_by_extension_objects[ua.LiteralOperand])
    more = kind + b"\x01" + struct.pack("<i", len(octets)) + octets
    asked = struct_to_binary(ua.GetEndpointsRequest())
    without = struct_to_binary(ua.RequestHeader())
    start, _, rest = asked.partition(without)
    return start + without[:-3] + more + rest


@pytest.mark.parametrize(
    "octets",
    [
        b"\x80" + struct.pack("<i", 2**31 - 1),
        b"\x8f" + struct.pack("<i", 2**31 - 1) + struct.pack("<i", -4) * 4,
        b"\x98" + struct.pack("<i", 60_000) + b"\0" * 60_000,
        b"\x97" + struct.pack("<i", limits.PIECES * 2) + b"\0" * limits.PIECES * 2,
        b"\x18" * 50_000,
    ],
    ids=["of nothing", "backwards", "longer than its chunk", "of many chunks", "deep"],
)
def test_a_length_claimed_by_a_message_costs_neither_memory_nor_time(server, octets):
    async def ask():
        client = Client(server.url, timeout=5)
        await client.connect_socket()
        try:
            await client.send_hello()
            await client.open_secure_channel()
            line = client.uaclient.protocol
            line.transport.write(line._connection.message_to_binary(literal(octets), request_id=7))
            for _ in range(100):
                if not connections(server):
                    return True
                await asyncio.sleep(0.05)
        finally:
            client.disconnect_socket()
        return False

    resource = pytest.importorskip("resource")  # not on Windows
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert asyncio.run(ask())
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB
    assert visit(server.url, running)[1] == "Good"


def test_a_filter_that_cannot_be_evaluated_keeps_no_event_from_others(server):
    bad = [ua.SimpleAttributeOperand(BrowsePath=[ua.QualifiedName("data_types", 0)], AttributeId=13)]

    async def listen(seen: Visit):
        heard = Heard()
        kind = seen.client.get_node(ua.NodeId("AxisbusIncidentType", seen.index))
        params = ua.CreateMonitoredItemsParameters()
        params.SubscriptionId = (await seen.client.create_subscription(50, Heard())).subscription_id
        params.ItemsToCreate = [event_item(ua.EventFilter(SelectClauses=bad))]
        (made,) = await seen.client.uaclient.create_monitored_items(params)
        assert made.StatusCode.is_good()
        subscription = await seen.client.create_subscription(50, heard)
        await subscription.subscribe_events(seen.client.nodes.server, kind)
        await asyncio.to_thread(
            server.report, [OpcuaEvent(server.now(), 900, "first"), OpcuaEvent(0, 900, "second")], ()
        )
        for _ in range(100):
            await asyncio.sleep(0.05)
            if len(heard.events) == 2:
                break
        return [event.Message.Text for event in heard.events]

    assert visit(server.url, listen) == ["first", "second"]


def where(operator, *operands):
    element = ua.ContentFilterElement(FilterOperator=operator, FilterOperands=list(operands))
    return ua.ContentFilter(Elements=[element])


@pytest.mark.parametrize(
    ("kind", "comes"), [(ua.ObjectIds.BaseEventType, True), (ua.ObjectIds.SystemEventType, False)]
)
def test_events_pass_a_filter_of_their_type_and_of_the_base_type_also_after_a_change_of_the_filter(
    server, kind, comes
):
    message = [ua.SimpleAttributeOperand(BrowsePath=[ua.QualifiedName("Message", 0)], AttributeId=13)]

    def of(number):
        operand = ua.LiteralOperand(Value=ua.Variant(ua.NodeId(number), ua.VariantType.NodeId))
        return ua.EventFilter(SelectClauses=message, WhereClause=where(ua.FilterOperator.OfType, operand))

    async def listen(seen: Visit):
        heard = Heard()
        subscription = await seen.client.create_subscription(50, heard)
        handle = await subscription.subscribe_events(
            seen.client.nodes.server, evfilter=of(ua.ObjectIds.AuditEventType)
        )
        await asyncio.to_thread(server.report, [OpcuaEvent(server.now(), 900, "before")], ())
        await asyncio.sleep(0.3)
        changes = ua.ModifyMonitoredItemsParameters(SubscriptionId=subscription.subscription_id)
        parameters = ua.MonitoringParameters(ClientHandle=handle, QueueSize=10, Filter=of(kind))
        item = next(iter(subscription._monitored_items.values())).server_handle
        changes.ItemsToModify = [
            ua.MonitoredItemModifyRequest(MonitoredItemId=item, RequestedParameters=parameters)
        ]
        (changed,) = await seen.client.uaclient.modify_monitored_items(changes)
        assert changed.StatusCode.is_good()
        await asyncio.to_thread(server.report, [OpcuaEvent(server.now(), 900, "after")], ())
        await heard.event()
        return [event.Message.Text for event in heard.events]

    assert visit(server.url, listen) == (["after"] if comes else [])


def event_item(given):
    item = ua.MonitoredItemCreateRequest()
    item.ItemToMonitor = ua.ReadValueId(NodeId=ua.NodeId(2253), AttributeId=ua.AttributeIds.EventNotifier)
    item.RequestedParameters.Filter = given
    return item


def test_an_item_with_an_invalid_filter_is_refused_alone_and_many_are_changed_at_once(server):
    async def ask(seen: Visit):
        params = ua.CreateMonitoredItemsParameters()
        params.SubscriptionId = (await seen.client.create_subscription(500, Heard())).subscription_id
        value = ua.MonitoredItemCreateRequest()
        value.ItemToMonitor = ua.ReadValueId(
            NodeId=ua.NodeId("Machines/cell/Running", seen.index), AttributeId=ua.AttributeIds.Value
        )
        aggregate = copy.deepcopy(value)
        aggregate.RequestedParameters.Filter = ua.AggregateFilter()
        like = ua.EventFilter(WhereClause=where(ua.FilterOperator.Like))
        params.ItemsToCreate = [event_item(ua.DataChangeFilter()), aggregate, event_item(like), value]
        made = await seen.client.uaclient.create_monitored_items(params)
        changes = ua.ModifyMonitoredItemsParameters(SubscriptionId=params.SubscriptionId)
        known, unknown = made[-1].MonitoredItemId, 1
        changes.ItemsToModify = [
            ua.MonitoredItemModifyRequest(
                MonitoredItemId=number, RequestedParameters=ua.MonitoringParameters(QueueSize=10**9)
            )
            for number in [known, *[unknown] * 1999]
        ]
        changed = await seen.client.uaclient.modify_monitored_items(changes)
        changes.ItemsToModify = changes.ItemsToModify[:1]
        changes.ItemsToModify[0].RequestedParameters.Filter = ua.EventFilter()
        (wrong,) = await seen.client.uaclient.modify_monitored_items(changes)
        return made, changed, wrong

    made, changed, wrong = visit(server.url, ask)
    names = [each.StatusCode.name for each in made]
    assert names == [
        "BadEventFilterInvalid",
        "BadMonitoredItemFilterUnsupported",
        "BadFilterOperatorUnsupported",
        "Good",
    ]
    assert [each.StatusCode.name for each in changed] == ["Good", *["BadMonitoredItemIdInvalid"] * 1999]
    assert changed[0].RevisedQueueSize == limits.QUEUE
    assert wrong.StatusCode.name == "BadFilterNotAllowed"


def test_a_client_can_read_the_operation_limits(server):
    async def ask(seen: Visit):
        told = seen.client.get_node(ua.ObjectIds.Server_ServerCapabilities_OperationLimits)
        return {
            (await each.read_browse_name()).Name: await each.read_value()
            for each in await told.get_children()
        }

    told = visit(server.url, ask)
    assert told["MaxNodesPerRead"] == limits.READS
    assert told["MaxNodesPerBrowse"] == limits.BROWSES
    assert told["MaxNodesPerMethodCall"] == limits.CALLS
    assert told["MaxMonitoredItemsPerCall"] == limits.ITEMS


def test_a_subscription_is_neither_too_fast_nor_too_large(server):
    async def ask(seen: Visit):
        fast = ua.CreateSubscriptionParameters(1e-9, 1000, 10, 0, True, 0)
        subscription = await seen.client.create_subscription(fast, Heard())
        params = ua.CreateMonitoredItemsParameters(SubscriptionId=subscription.subscription_id)
        params.ItemsToCreate = [ua.MonitoredItemCreateRequest() for _ in range(limits.MONITORED + 1)]
        with refused("BadTooManyMonitoredItems"):
            await seen.client.uaclient.create_monitored_items(params)
        itself = ua.ContentFilterElement(
            FilterOperator=ua.FilterOperator.Not, FilterOperands=[ua.ElementOperand(Index=0)]
        )
        params.ItemsToCreate = [event_item(ua.EventFilter(WhereClause=ua.ContentFilter(Elements=[itself])))]
        (made,) = await seen.client.uaclient.create_monitored_items(params)
        assert made.StatusCode.name == "BadFilterNotAllowed"
        with refused("BadTooManyOperations"):
            await seen.client.uaclient.read_attributes(
                [ua.NodeId(2253)] * (limits.READS + 1), ua.AttributeIds.NodeId
            )
        objects = ua.BrowseDescription(
            NodeId=ua.NodeId(ua.ObjectIds.BaseObjectType), ReferenceTypeId=ua.NodeId(31), ResultMask=63
        )
        objects.BrowseDirection = ua.BrowseDirection.Both
        with refused("BadResponseTooLarge"):
            await seen.client.uaclient.browse(ua.BrowseParameters(NodesToBrowse=[objects] * limits.BROWSES))
        (alone,) = await seen.client.uaclient.browse(ua.BrowseParameters(NodesToBrowse=[objects]))
        assert alone.References
        dictionary = ua.NodeId(ua.ObjectIds.OpcUa_BinarySchema)
        (alone,) = await seen.client.uaclient.read_attributes([dictionary], ua.AttributeIds.Value)
        assert len(alone.Value.Value) > limits.LARGE
        with refused("BadResponseTooLarge"):
            await seen.client.uaclient.read_attributes([dictionary] * 20, ua.AttributeIds.Value)
        item = ua.MonitoredItemCreateRequest()
        item.ItemToMonitor = ua.ReadValueId(NodeId=dictionary, AttributeId=ua.AttributeIds.Value)
        params.ItemsToCreate = [item]
        (made,) = await seen.client.uaclient.create_monitored_items(params)
        assert made.StatusCode.name == "BadNotSupported"
        inner = server._updater._server.iserver.subscription_service.subscriptions
        return inner[subscription.subscription_id].data.RevisedPublishingInterval

    assert visit(server.url, ask) == limits.FASTEST_MS


# -- certificates ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def own(folder):
    return key_pair(folder, "server", server=True)


@pytest.fixture(scope="module")
def friend(folder):
    (folder / "trust").mkdir()
    found = key_pair(folder, "friend")
    shutil.copy(found.certificate, folder / "trust")
    return found


@pytest.fixture(scope="module")
def secured(file, folder, known, own, friend):
    access = decide(Given(False, certificate=True, trust=True, users=True))
    keeping = ServerOptions(access, own.certificate, own.key, folder / "trust", known)
    with served(file, keeping) as found:
        yield found


def test_a_trusted_client_reads_and_a_trusted_user_halts(secured, own, friend):
    assert visit(secured.url, running, ClientIdentity(key_pair=friend, server=own.certificate)) == (
        False,
        "Good",
    )
    anna = ClientIdentity("anna", "right", friend, own.certificate)
    with refused("BadNoCommunication"):  # it was let through: no machine is there
        visit(secured.url, halt, anna)
    with refused("BadUserAccessDenied"):
        visit(secured.url, halt, ClientIdentity(key_pair=friend, server=own.certificate))
    with refused("BadUserAccessDenied"):
        visit(secured.url, halt, ClientIdentity("anna", "wrong", friend, own.certificate))


def test_a_certificate_that_is_not_known_opens_no_channel(secured, own, folder):
    stranger = key_pair(folder, "stranger")
    with pytest.raises(Exception, match=r"Untrusted|ConnectionClosed|closed|Connection"):
        visit(secured.url, running, ClientIdentity("anna", "right", stranger, own.certificate))


def test_an_expired_certificate_opens_no_channel_and_untrusted_ones_need_a_user(folder, known, own):
    opened = []
    factory = SimpleNamespace(matches=lambda *_: True, create=opened.append)
    old, fresh = (trusted_of(key_pair(folder, name, days=days)) for name, days in (("old", -1), ("fresh", 5)))
    for_all = TrustingFactory(factory, None)
    with pytest.raises(ua.uaerrors.BadRequestTooLarge) as caught:
        for_all.create(old)
    assert caught.value.code == ua.StatusCodes.BadCertificateTimeInvalid
    assert ua.UaStatusCodeError(ua.StatusCodes.BadRequestTooLarge).code == ua.StatusCodes.BadRequestTooLarge
    for nothing in (None, b"", b"junk"):
        with pytest.raises(ua.uaerrors.BadRequestTooLarge):
            for_all.create(nothing)
    for_all.create(fresh)
    assert opened == [fresh]
    gate = OpcuaUserManager(known, anonymous=False)
    assert gate.get_user(None) is None
    assert gate.get_user(None, "anna", "right") is None  # it was not checked
    assert asyncio.run(gate.check("anna", "right"))
    token = CHECKED.set(("anna", "right", True))
    assert gate.get_user(None, "anna", "right").name == "anna"
    assert gate.get_user(None, "anna") is None
    CHECKED.reset(token)
    gate.close()


def trusted_of(made):
    """The octets of a certificate."""
    return ssl.PEM_cert_to_DER_cert(made.certificate.read_text("ascii"))


def test_without_encryption_only_the_endpoints_are_served(secured):
    async def endpoints():
        return await Client(secured.url).connect_and_get_server_endpoints()

    (endpoint,) = asyncio.run(endpoints())
    assert endpoint.SecurityMode is ua.MessageSecurityMode.SignAndEncrypt
    assert endpoint.SecurityPolicyUri.endswith("#Basic256Sha256")
    for who in (ClientIdentity(), ANNA):
        with pytest.raises(Exception, match=r"BadSecurityModeInsufficient|No matching|not found"):
            visit(secured.url, running, who)
    assert secured._updater._server.iserver._external_sessions == {}


def test_a_session_without_encryption_is_refused_by_the_server_itself(secured):
    async def enter():
        client = Client(secured.url, timeout=5)
        await client.connect_socket()
        try:
            await client.send_hello()
            await client.open_secure_channel()
            asked = ua.CreateSessionParameters(RequestedSessionTimeout=60_000.0, EndpointUrl=secured.url)
            with refused("BadSecurityModeInsufficient"):
                await client.uaclient.create_session(asked)
            name = connections(secured)[-1].peer_name
            made = GuardedSession(secured._updater._server.iserver, name, User())
            made.required = True  # as if one had been made all the same
            with pytest.raises(ServiceError) as caught:
                made.activate_session(ua.ActivateSessionParameters(), b"")
            assert caught.value.code == ua.StatusCodes.BadSecurityModeInsufficient
            made.iserver.unregister_external_session(made)
        finally:
            client.disconnect_socket()

    asyncio.run(enter())


def test_a_trusted_certificate_of_another_client_in_the_request_is_refused(secured, own, friend, folder):
    """The certificate of the channel counts, not the one in a request."""
    thief = key_pair(folder, "thief")
    who = ClientIdentity(
        key_pair=type(thief)(thief.certificate, thief.key, friend.uri), server=own.certificate
    )

    async def enter():
        client = await connected_client(secured.url, who)
        await client.disconnect()

    with pytest.raises(Exception, match=r"Untrusted|ConnectionClosed|closed|Connection"):
        asyncio.run(enter())


# -- the command line -------------------------------------------------------------------------------------------------------


@pytest.fixture
def run(monkeypatch, capsys):
    return command_line.runner(monkeypatch, capsys)


def test_a_port_in_use_is_reported_with_the_option(run, server, file):
    code, _, err = run("bridge", "opcua", file, "--port", address(server)[1])
    assert code == 1
    assert "in use" in err
    assert "--port" in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--listen", "0.0.0.0"), "every address"),
        (("--trust", "nowhere"), "--certificate"),
        (("--users", "nowhere"), "nowhere"),
        (("--certificate", "nowhere"), "--key"),
        (("--certificate", "nowhere", "--key", "nowhere"), "nowhere"),
        (("--rate", "0"), "rate"),
    ],
)
def test_incompatible_options_are_refused_before_anything_is_served(run, file, words, said):
    code, _, err = run("bridge", "opcua", file, "--port", "0", *words)
    assert code in (1, 2)
    assert said in err


def test_a_certificate_without_a_uri_is_refused(run, file, folder, known):
    bare = key_pair(folder, "bare", server=True, names=False)
    words = ("--certificate", bare.certificate, "--key", bare.key, "--users", folder / "users")
    code, _, err = run("bridge", "opcua", file, "--port", "0", *words)
    assert code == 1
    assert "application URI" in err


def test_a_user_s_line_is_printed_without_his_password(run):
    code, out, _ = run("bridge", "opcua-user", "anna", stdin="right\n")
    assert code == 0
    assert out.startswith("anna:scrypt:")
    assert "right" not in out
    assert run("bridge", "opcua-user", "an na").code == 2


@pytest.mark.parametrize(("there", "instead"), [("a003020102", "a003020107"), ("0603551d0f", "0603551d11")])
def test_an_invalid_certificate_is_refused_by_the_name_of_its_file(tmp_path, there, instead):
    """The version is unknown, or an extension occurs twice."""
    made = x509.load_pem_x509_certificate(key_pair(tmp_path, "x", server=True).certificate.read_bytes())
    octets = made.public_bytes(Encoding.DER)
    assert trust.is_in_time(octets)
    wrong = tmp_path / "trusted" / "wrong.der"
    wrong.parent.mkdir()
    wrong.write_bytes(octets.replace(bytes.fromhex(there), bytes.fromhex(instead), 1))
    with pytest.raises(StateError, match=r"wrong\.der"):
        trust.uri_of(wrong)
    if "07" in instead:
        assert not trust.is_in_time(wrong.read_bytes())
        with pytest.raises(ConfigError, match=r"wrong\.der"):
            trust.trusted(wrong.parent)
