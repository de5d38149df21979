"""A cell on a Zenoh network, with programs of its own: the holder of the lease ends, is cut off or faulty, and the axes stop."""

from __future__ import annotations

import itertools
import json
import os
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip("zenoh", reason="a Zenoh network needs eclipse-zenoh")

import zenoh

from axisbus.fleet import messages as m
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.connection_flood import Crowd
from kit.scenarios.core_process import OWN_PROCESS, own_cell, recover, turns
from kit.zenoh_cell import KEYS, BridgeProcess, Client, Wire, holder, until

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
STANDS = 3.0  # seconds from the end of a lease's holder until standstill of its axes: 1 of the lease, and their braking


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("zenoh")


@pytest.fixture(scope="module")
def file(folder):
    return own_cell(folder)


@pytest.fixture(scope="module")
def machine(file):
    with Machine.open(file, shared=True) as opened:
        yield opened


@pytest.fixture(scope="module")
def bridge(file, folder, machine):
    (folder / "recordings").mkdir()
    with BridgeProcess(file, "--recordings", str(folder / "recordings")) as process:
        process.await_line("joined")
        yield process


@pytest.fixture(autouse=True)
def sound(file, machine):
    """A loss of time in another test, by a busy computer, does not concern this one."""
    recover(file, machine)


@pytest.fixture
def client(bridge, machine):
    """A client on the network, while no client has the lease and nothing moves."""
    with Client(bridge.endpoint) as client:
        until(client.alive)
        yield client
        client.keep_silent()
        client.lease("release")
        client.do("halt_all")
        until(lambda: client.lease("look").holder is None)


def stands(machine, node=1):
    return abs(turns(machine, node)) < 0.1


def test_a_cell_publishes_its_description_and_the_state_of_its_axes(client, machine):
    info = client.ask(KEYS.info, None, m.CellInfo)
    assert (info.protocol, info.plant, info.cell, info.simulated) == (1, "works", "one", True)
    assert [(axis.name, axis.unit, axis.node) for axis in info.axes] == [("x", "deg", 1), ("y", "deg", 2)]
    assert info.axes[0].limits["max_velocity"] == 400.0
    heard = []
    subscriber = client.session.declare_subscriber(KEYS.state("*"), heard.append)
    time.sleep(1.2)
    subscriber.undeclare()
    states = [
        (str(one.key_expr), json.loads(one.payload.to_bytes())) for one in heard
    ]  # at 20 ms a cycle, fifty a second at most
    of_x = [state for key, state in states if key == KEYS.state("x")]
    assert 20 < len(of_x) < 75
    assert [state["n"] for state in of_x] == list(range(of_x[0]["n"], of_x[0]["n"] + len(of_x)))
    assert of_x[-1]["position"] == pytest.approx(machine["x"].position, abs=0.1)
    assert of_x[-1]["age"] < 1.0


def test_repeated_late_or_reordered_commands_cause_no_second_motion(client, machine):
    token = client.take().token
    client.must("enable", "x")
    before = machine["x"].position
    first = client.do("move_relative", "x", number=10, distance=5.0)
    again = [client.do("move_relative", "x", number=10, distance=5.0) for _ in range(5)]
    assert [answer.status for answer in (first, *again)] == ["done"] * 6
    late = client.do("move_relative", "x", number=7, distance=5.0)
    other = client.do("move_relative", "x", number=10, distance=-5.0)
    assert "too late" in late.error.fields["message"]
    assert "was a different command" in other.error.fields["message"]
    assert client.lease("release").refused is None
    client.keep_silent()
    until(lambda: client.lease("look").holder is None)
    assert (
        client.do("move_relative", "x", number=10, distance=5.0).status == "done"
    )  # how it ended, once more
    assert client.do("move_relative", "x", number=11, distance=5.0).error.kind == "OwnershipError"
    assert client.take().token != token
    old = client.do("move_relative", "x", number=12, token=token, distance=5.0)
    assert "earlier" in old.error.fields["observed"]
    time.sleep(0.2)
    assert machine["x"].position == pytest.approx(before + 5.0, abs=0.1)
    assert stands(machine)


@pytest.mark.parametrize("end", ["killed", "suspended", "cut off"])
def test_if_the_holder_of_the_lease_ends_the_axes_halt(client, bridge, machine, end):
    wire = Wire(int(bridge.endpoint.rpartition(":")[2]))
    with holder(wire.endpoint) as program:
        until(lambda: not stands(machine))
        assert client.lease("look").holder == "Holder"
        assert "Holder has the lease" in client.lease("take").refused.fields["message"]
        if end == "cut off":
            wire.cut.set()
        else:
            program.send_signal(signal.SIGKILL if end == "killed" else signal.SIGSTOP)
        took = until(lambda: stands(machine), STANDS)
        until(lambda: client.lease("look").holder is None)
        if end == "suspended":
            program.send_signal(signal.SIGCONT)
            time.sleep(0.5)
        if end == "cut off":
            wire.cut.clear()
            time.sleep(1.0)  # frames in transit arrive now
        assert stands(machine)
        until(lambda: machine["x"].state is AxisState.STANDSTILL)
    wire.close()
    assert took < STANDS


def test_taking_over_the_lease_halts_the_axes_first(client, bridge, machine):
    with holder(bridge.endpoint), Client(bridge.endpoint, "Ben") as ben:
        until(lambda: not stands(machine))
        answer = ben.take(over=True)
        assert (answer.holder, bool(answer.token)) == ("Ben", True)
        assert stands(machine)
        ben.must("move_relative", "x", distance=1.0)
        assert ben.lease("release").refused is None
    events = client.ask(KEYS.events, m.EventsAsk(), m.EventsAnswer)
    told = [event.text for event in events.events if event.kind == "lease"]
    assert any("Ben took over the lease" in text for text in told)
    numbers = [event.n for event in events.events]
    assert numbers == list(range(1, len(numbers) + 1))


def test_a_program_at_the_machine_has_control_until_it_is_taken_over(client, file, machine):
    with Machine.attach(file, command=True) as local:
        refused = client.take().refused
        assert (refused.kind, client.token) == ("OwnershipError", "")
        local["y"].enable().wait(10)
        local["y"].move_velocity(20.0).wait(10)
        until(lambda: client.lease("look").holder is not None)
        assert client.take(over=True).token
        assert stands(machine, 2)
        client.must("enable", "x")
        local.take_control()  # and back again: the lease is lost
        until(lambda: client.lease("renew").refused is not None)
        assert client.do("move_relative", "x", distance=1.0).status == "error"


def test_any_client_stops_without_a_lease_and_every_stop_is_executed(client, bridge, machine):
    with holder(bridge.endpoint):
        until(lambda: not stands(machine))
        client.must("halt", "x", number=1)
        assert stands(machine)
    with holder(bridge.endpoint):
        until(lambda: not stands(machine))
        client.must("halt", "x", number=1)
        assert stands(machine)
    with holder(bridge.endpoint):
        until(lambda: not stands(machine))
        assert client.ask("ax/*/*/cmd/quick_stop_all", b"\xff junk", m.CommandAnswer).status == "done"
        assert stands(machine)


def test_a_jog_continues_from_query_to_query_and_ends_by_silence(client, machine):
    client.take()
    client.do("enable", "x")

    def jog(press, sent=None):
        return client.do(
            "jog", "x", velocity=20.0, press=press, sent=time.monotonic() if sent is None else sent
        )

    for _ in range(10):
        assert jog(1).status == "running"
        time.sleep(0.05)
    assert turns(machine) == pytest.approx(20.0, abs=2.0)
    until(lambda: stands(machine), 2.0)
    assert "has ended" in jog(1).error.fields["message"]
    assert stands(machine)
    assert jog(2).status == "running"
    until(lambda: not stands(machine))
    client.do("halt", "x")
    assert jog(2).status == "error"
    assert jog(3, time.monotonic() - 1.0).status == "error"  # that it was late is seen by those before
    until(lambda: stands(machine), 2.0)


def test_objects_are_read_by_any_client_and_written_under_a_lease_with_checks(client, machine):
    read = client.ask(KEYS.object(1, 0x6041, 0), None, m.ObjectAnswer)
    assert isinstance(read.value, int)
    write = KEYS.object(2, 0x6081, 0)
    assert (
        client.ask(write, m.ObjectWrite(client.name, "", 77), m.ObjectAnswer).error.kind == "OwnershipError"
    )
    client.take()
    client.must("disable", "y")
    answer = client.ask(write, m.ObjectWrite(client.name, client.token, 77), m.ObjectAnswer)
    assert (answer.value, answer.error) == (77, None)
    assert machine.node(2).sdo[0x6081] == 77
    control = client.ask(
        KEYS.object(2, 0x6040, 0), m.ObjectWrite(client.name, client.token, 15), m.ObjectAnswer
    )
    assert control.error.kind == "StateError"
    client.do("enable", "x")
    energised = client.ask(
        KEYS.object(1, 0x6081, 0), m.ObjectWrite(client.name, client.token, 77), m.ObjectAnswer
    )
    assert "energised" in energised.error.fields["message"]
    assert client.ask("ax/works/one/od/1/6041/zz", None, m.ObjectAnswer).error.kind == "ArgumentError"


def test_recordings_are_listed_and_their_samples_read(client, folder, machine):
    pytest.importorskip("mcap")
    with machine.recording(folder / "recordings" / "run.mcap"):
        time.sleep(0.3)
    (folder / "secret.mcap").write_bytes(b"no")
    listed = client.ask(KEYS.history, None, m.HistoryAnswer)
    assert [each.name for each in listed.recordings] == ["run.mcap"]
    ask = m.HistoryAsk("run.mcap", ("x.position", "y.torque"), most=5)
    told = client.ask(KEYS.history, ask, m.HistoryAnswer)
    assert 1 <= len(told.times) <= 5
    assert {name: len(values) for name, values in told.values.items()} == dict.fromkeys(
        ask.signals, len(told.times)
    )
    for name in ("../secret.mcap", str(folder / "secret.mcap"), "none.mcap"):
        refused = client.ask(KEYS.history, m.HistoryAsk(name, ("x.position",)), m.HistoryAnswer)
        assert refused.error.kind == "ArgumentError"


JUNK = (
    b"",
    b"\0",
    b"{",
    b"null",
    b"[]",
    b'"x"',
    b"{}",
    b'{"verb": "take"}',
    b'{"verb": "steal", "client": "x"}',
    b'{"client": "", "id": -1, "axes": 7}',
    b'{"client": "junk", "id": 1e99, "token": {}, "values": {"position": NaN}}',
    b'{"verb": "take", "client": "' + b"x" * 5000 + b'"}',
    b"[" * 4000,
    b"\xff" * 70_000,
)


def test_junk_on_every_key_changes_nothing(client, bridge, machine):
    keys = [
        KEYS.info,
        KEYS.state("x"),
        KEYS.state("none"),
        KEYS.events,
        KEYS.lease,
        KEYS.command("move_absolute"),
        KEYS.command("no_such"),
        KEYS.command("*"),
        KEYS.object(1, 0x6040, 0),
        KEYS.object("x", 0xFFFFF, 999),
        KEYS.objects,
        KEYS.history,
        f"{KEYS.events}?first=x;last=-9",
    ]
    with holder(bridge.endpoint):
        until(lambda: not stands(machine))
        for key in keys:
            for junk in (
                JUNK if key == KEYS.lease else JUNK[:-1]
            ):  # the largest is not even taken in: no answer for 2 s
                client.ask(key, junk, timeout=2.0)
                if "*" not in key:
                    client.session.put(key.partition("?")[0], junk)
        assert turns(machine) == pytest.approx(30.0, abs=1.0)
        assert client.lease("look").holder == "Holder"
    client.must("halt", "x")


NEVER_READS = """
import sys, time, zenoh
from axisbus.fleet.network import ZenohNetwork, connected, opened
session = opened(ZenohNetwork((sys.argv[1],)))
connected(session, 5.0)
kept = [session.declare_subscriber("ax/**", zenoh.handlers.FifoChannel(1))]
print("deaf", flush=True)
time.sleep(60)
"""


# The bytes that each of a thousand hostile connections sends to the bridge, and whether it sends them repeatedly.
CROWDS = {
    "silent": (b"", False),
    "half a greeting": (b"\x20\x00\x01", False),
    "a flood of junk": (b"\x20\x00" + b"x" * 2000, True),
}


@pytest.mark.parametrize("crowd", list(CROWDS))
def test_a_thousand_hostile_connections_end_no_lease_and_prevent_no_halt(client, bridge, machine, crowd):
    said, flood = CROWDS[crowd]
    with holder(bridge.endpoint):
        until(lambda: not stands(machine))
        with Crowd(("127.0.0.1", int(bridge.endpoint.rpartition(":")[2])), said, flood=flood):
            time.sleep(1.5)  # longer than a lease that is not renewed
            assert turns(machine) == pytest.approx(30.0, abs=1.0)
            began = time.monotonic()
            assert client.lease("look").holder == "Holder"
            assert time.monotonic() - began < 1.0
            with Client(bridge.endpoint, "Ben") as newcomer:
                until(newcomer.alive, 12.0)
                newcomer.must("halt", "x")
            assert stands(machine)
            client.must("halt", "x")


@pytest.mark.parametrize("how", ["never reads", "suspended"])
def test_a_subscriber_that_does_not_read_delays_no_other(client, bridge, machine, how):
    with subprocess.Popen(
        [sys.executable, "-c", NEVER_READS, bridge.endpoint], stdout=subprocess.PIPE, text=True
    ) as deaf:
        try:
            assert deaf.stdout.readline().strip() == "deaf"
            if how == "suspended":
                deaf.send_signal(signal.SIGSTOP)
            heard = []
            subscriber = client.session.declare_subscriber(
                KEYS.state("x"), lambda _: heard.append(time.monotonic())
            )
            with holder(bridge.endpoint):
                time.sleep(1.5)
                client.must("halt", "x")
            subscriber.undeclare()
        finally:
            deaf.kill()
    gaps = [after - before for before, after in itertools.pairwise(heard)]
    assert len(heard) > 40
    assert max(gaps) < 1.0


def test_a_second_bridge_of_the_same_name_is_refused(bridge, file, machine):
    with BridgeProcess(file, "--connect", bridge.endpoint) as second:
        assert "another bridge of ax/works/one" in second.await_line("another bridge")
        assert second.process.wait(10) == 1


@pytest.mark.parametrize("end", ["killed", "suspended", "Ctrl-C", "SIGTERM"])
def test_a_bridge_that_ends_is_noticed_and_its_motions_halt(file, machine, end):
    number = {
        "killed": signal.SIGKILL,
        "suspended": signal.SIGSTOP,
        "Ctrl-C": signal.SIGINT,
        "SIGTERM": signal.SIGTERM,
    }
    with BridgeProcess(file) as own:
        own.await_line("joined")
        with Client(own.endpoint) as client:
            gone = []
            client.session.liveliness().declare_subscriber(
                KEYS.alive, lambda sample: gone.append((sample.kind, time.monotonic())), history=True
            )
            client.take()
            client.must("enable", "x")
            client.must("move_velocity", "x", velocity=30.0)
            begun = time.monotonic()
            os.kill(own.process.pid, number[end])
            until(lambda: stands(machine), STANDS)
            until(lambda: gone[-1][0] == zenoh.SampleKind.DELETE)
            assert gone[-1][1] - begun < 1.0
        if end == "suspended":
            os.kill(own.process.pid, signal.SIGCONT)
            time.sleep(0.3)
            assert stands(machine)
            os.kill(own.process.pid, signal.SIGTERM)
        assert own.process.wait(10) == {"killed": -9, "Ctrl-C": 130}.get(end, 143)
        until(lambda: machine["x"].state is AxisState.STANDSTILL)
        assert "Traceback" not in own.process.stdout.read()


def test_a_machine_that_ends_and_the_next_one_are_seen_in_time(tmp_path):
    file = own_cell(tmp_path)
    with BridgeProcess(file) as own, Client(own.endpoint) as client:
        own.await_line("waits for a machine")
        assert not client.alive()
        for _ in range(2):
            with Machine.open(file) as opened:
                until(client.alive)
                assert opened.has_control
                assert client.take().refused.kind == "OwnershipError"
            until(lambda: not client.alive(), 1.0)
        told = client.ask(KEYS.events, m.EventsAsk(), m.EventsAnswer).events
        assert sum("the machine has ended" in event.text for event in told) == 2
