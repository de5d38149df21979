"""The decisions of a bridge, without a network and by a clock of the test: lease, ids, verbs, jogs, events, states, samples."""

from __future__ import annotations

import importlib.util
import itertools
import math
import os
import socket
import time
from types import SimpleNamespace

import msgspec
import pytest

pytest.importorskip("zenoh", reason="a Zenoh network needs eclipse-zenoh")

import zenoh

from axisbus.errors import ArgumentError, OwnershipError, StateError, Stopped, UserError
from axisbus.fleet import network
from axisbus.fleet.keys import ZenohCellKeys, named
from axisbus.fleet.messages import CommandAsk, EventsAsk, HistoryAsk
from axisbus.fleet.network import ZenohNetwork
from axisbus.gateway.machine_events import MachineEventSource
from axisbus.gateway.zenoh import execute, recordings_worker, service
from axisbus.gateway.zenoh.bridge import bridge_events
from axisbus.gateway.zenoh.command_table import STOPS, VERBS, action_of
from axisbus.gateway.zenoh.commands import CLIENTS, CommandDeduplicator, Commands, require_id
from axisbus.gateway.zenoh.execute import DeferredReplies
from axisbus.gateway.zenoh.lease import SECONDS, CellLease, LeasePhase
from axisbus.gateway.zenoh.publishing import MAX_ANSWER, MAX_EVENTS, BridgeEvent, BridgeEventLog, state_of
from axisbus.gateway.zenoh.service import ZenohQuery
from axisbus.machine.axis import Axis
from axisbus.motion.states import AxisState
from axisbus.record.recording_data import Recorded, RecordedSeries

HELD = CellLease().taking("anna", "Anna").taken("t1", 10.0)


# -- the lease -------------------------------------------------------------------------------------------------------


def test_a_lease_lasts_a_second_from_each_renewal_and_not_a_moment_longer():
    assert HELD.holds("anna", "t1", 10.0 + SECONDS - 1e-6)
    assert not HELD.holds("anna", "t1", 10.0 + SECONDS)
    assert HELD.expired(10.0 + SECONDS)
    renewed = HELD.renewed(10.9)
    assert renewed.holds("anna", "t1", 11.8)
    assert renewed.seconds(11.0) == pytest.approx(0.9)
    assert "not renewed" in renewed.why_not("anna", "t1", 12.0).observed


@pytest.mark.parametrize(
    ("client", "token", "words"),
    [
        ("ben", "t1", "Anna has the lease"),
        ("anna", "t0", "not belong to the present lease"),
        ("anna", "", "not belong to the present lease"),
    ],
)
def test_no_other_client_or_token_holds_the_lease(client, token, words):
    assert not HELD.holds(client, token, 10.1)
    assert words in HELD.why_not(client, token, 10.1).message


def test_a_lease_is_taken_if_it_is_free_or_taken_over_from_its_holder():
    assert CellLease().refusal("ben", force=False) is None
    assert "Anna" in HELD.refusal("ben", force=False).message
    assert "of this name" in HELD.refusal("anna", force=False).message
    assert HELD.refusal("ben", force=True) is None
    assert HELD.ending().refusal("ben", force=False) is None  # it is his once that has ended
    taking = CellLease().taking("anna", "")
    assert (taking.phase, taking.holder) == (LeasePhase.TAKING, "anna")
    assert "is changing its holder" in taking.refusal("ben", force=True).message
    assert not HELD.ending().holds("anna", "", 10.1)


# -- ids -------------------------------------------------------------------------------------------------------------


def test_a_repeated_id_gives_the_stored_answer_and_a_lower_one_is_refused():
    ledger = CommandDeduplicator(max_commands=3)
    for number in (1, 2, 5):
        assert ledger.repeated("anna", number, "what") is None
        ledger.enter("anna", number, "what", f"end {number}")
    assert ledger.repeated("anna", 5, "what") == "end 5"
    assert ledger.repeated("anna", 1, "what") == "end 1"
    with pytest.raises(StateError, match="a different command"):
        ledger.repeated("anna", 5, "else")
    with pytest.raises(StateError, match="too late"):
        ledger.repeated("anna", 4, "what")
    ledger.enter("anna", 6, "what", "end 6")
    with pytest.raises(StateError, match="too late"):
        ledger.repeated("anna", 1, "what")  # kept no more
    assert ledger.repeated("ben", 1, "what") is None


def test_rejected_command_ids_count_as_well_and_the_number_of_clients_is_bounded():
    ledger = CommandDeduplicator()
    assert [ledger.note_id("anna", number) for number in (3, 3, 2, 4)] == [True, False, False, True]
    with pytest.raises(StateError, match="too late"):
        ledger.repeated("anna", 1, "what")
    for number in range(CLIENTS):
        ledger.note_id(f"client {number}", 1)
    assert ledger.repeated("anna", 1, "what") is None  # forgotten: her token is void long since


@pytest.mark.parametrize("number", [0, -1, 1 << 60])
def test_an_id_is_a_number_from_one(number):
    with pytest.raises(ArgumentError):
        require_id(number)


# -- verbs -----------------------------------------------------------------------------------------------------------


def ask(*axes, **values):
    return CommandAsk("anna", 1, "t", axes, values)


def test_each_verb_is_a_call_of_the_library_with_the_values_that_it_takes():
    for name, verb in VERBS.items():
        call = getattr(Axis, verb.call or name)
        taken = set(call.__code__.co_varnames[: call.__code__.co_argcount + call.__code__.co_kwonlyargcount])
        assert {*verb.needs, *verb.optional} - {"press", "sent"} <= taken, name


@pytest.mark.parametrize(
    ("verb", "asked", "words"),
    [
        ("fly", ask("x"), "no command"),
        ("enable", ask("q"), "no axis 'q'"),
        ("enable", ask("x", "x"), "twice"),
        ("enable", ask("x", speed=1.0), "no value 'speed'"),
        ("enable", ask("x", allow_moving=1), "not a valid allow_moving"),
        ("move_absolute", ask("x", "y", position=1.0), "no axis is given"),
        ("move_absolute", ask(position=1.0), "no axis is given"),
        ("move_absolute", ask("x"), "no position given"),
        ("move_absolute", ask("x", position="1"), "not a valid position"),
        ("move_absolute", ask("x", position=True), "not a valid position"),
        ("move_absolute", ask("x", position=1.0, direction=0.5), "not a valid direction"),
        ("move_absolute", ask("x", position=10**400), "not a valid position"),
        ("move_velocity", ask("x", velocity=10**5000), "not a valid velocity"),
        ("jog", ask("x", velocity=1.0, press=1, sent=-(10**400)), "not a valid sent"),
        ("jog", ask("x", velocity=1.0), "press"),
    ],
)
def test_an_invalid_command_is_refused_with_the_valid_ones(verb, asked, words):
    with pytest.raises(ArgumentError) as caught:
        action_of(verb, asked, ("x", "y"))
    assert words in caught.value.message
    assert caught.value.remedy or caught.value.observed or "twice" in words


def test_commands_without_axes_are_for_all_axes_and_a_stop_ignores_invalid_arguments():
    assert action_of("enable", ask(), ("x", "y")).axes == ("x", "y")
    assert action_of("move_absolute", ask("x", position=1), ("x",)).values == {"position": 1.0}
    assert action_of("home", ask("x", method=-1, timeout=4), ("x",)).values == {"method": -1, "timeout": 4.0}
    assert action_of("halt", ask("x", "x", "q", nonsense="z"), ("x", "y")).axes == ("x", "q")
    assert action_of("halt_all", ask("x"), ("x", "y")).axes == ("x", "y")
    assert {"halt", "quick_stop", "halt_all", "quick_stop_all"} == STOPS


DEEP = b'{"axes": [], "more": ' + b"[" * 5000  # nested too deeply for JSON


def test_a_deeply_nested_query_is_refused_and_does_not_prevent_a_stop():
    query = SimpleNamespace(key_expr="ax/hall/press/cmd/halt_all", payload=zenoh.ZBytes(DEEP))
    with pytest.raises(ArgumentError, match="not contain a CommandAsk"):
        ZenohQuery(query).message(CommandAsk)
    assert service._stop("halt_all", ZenohQuery(query)).axes == ()


# -- commands of a machine, in virtual time --------------------------------------------------------------------------


class Desk:
    """The commands of a simulated machine, whose lease is held by Anna as long as the test says."""

    def __init__(self, machine):
        self.machine = machine
        self.now = 10.0
        self.holding = SimpleNamespace(lease=HELD, controlled=machine)
        self.answers = DeferredReplies()
        self.commands = Commands(machine, self.holding, self.answers, lambda: self.now)

    def do(self, verb, number, *axes, token="t1", client="anna", **values):
        """Give a command, and return the answer, at once or after it has ended."""
        told = []
        self.commands.execute(verb, CommandAsk(client, number, token, axes, values), told.append)
        for _ in range(500):
            if told:
                return told[0]
            self.machine.sleep(0.02)
            time.sleep(0.001)
        raise AssertionError("no answer")


@pytest.fixture
def desk(machine):
    made = Desk(machine)
    yield made
    made.answers.close()


def test_a_command_received_several_times_or_late_is_executed_once(desk):
    assert desk.do("enable", 1).status == "done"
    for number in (2, 2, 3, 2, 3):
        assert desk.do("move_relative", number, "x", distance=5.0).status == "done"
    assert desk.machine["x"].position == pytest.approx(10.0, abs=0.05)
    assert desk.do("move_relative", 5, "x", distance=5.0).status == "done"
    assert "too late" in desk.do("move_relative", 4, "x", distance=5.0).error.fields["message"]
    assert desk.machine["x"].position == pytest.approx(15.0, abs=0.05)


def test_a_refusal_of_the_library_is_returned_and_stored(desk):
    desk.do("enable", 1, "x")
    refused = desk.do("move_absolute", 2, "x", position=1.0, velocity=9999.0)
    assert refused.error.kind == "LimitError"
    assert desk.do("move_absolute", 2, "x", position=1.0, velocity=9999.0) == refused
    assert desk.do("move_absolute", 3, "y", position=1.0).error.kind == "StateError"  # it is not enabled


def test_without_a_lease_only_a_stop_is_executed(desk):
    desk.do("enable", 1)
    desk.do("move_velocity", 2, "x", velocity=50.0)
    desk.now = 10.0 + SECONDS
    assert desk.do("move_relative", 3, "x", distance=5.0).error.kind == "OwnershipError"
    assert desk.do("move_velocity", 2, "x", velocity=50.0).status == "done"  # how that had ended
    assert desk.do("halt", 1, "x", client="", token="").status == "done"
    assert desk.machine["x"].velocity == pytest.approx(0.0, abs=0.1)
    told = desk.do("halt", 2, "x", "q", client="", token="")
    assert told.error.kind == "UnknownNameError"  # of q; x was halted


def test_a_command_sent_before_a_stop_and_received_after_it_is_too_late(desk):
    desk.do("enable", 1)
    desk.do("halt", 7, "x", token="")  # without the lease: it makes nothing late
    assert desk.do("move_relative", 2, "x", distance=1.0).status == "done"
    assert desk.do("halt", 5, "x").status == "done"
    assert "too late" in desk.do("move_relative", 4, "x", distance=1.0).error.fields["message"]
    assert desk.do("quick_stop_all", 8).status == "done"
    assert "too late" in desk.do("enable", 6).error.fields["message"]
    assert desk.do("enable", 9).status == "done"


def test_a_client_with_too_many_commands_is_refused_and_may_still_stop(desk):
    told = [desk.do("set_override", number, "x", factor=1.0).status for number in range(1, 140)]
    assert (told[0], told[-1]) == ("done", "error")
    assert desk.do("halt", 999).status == "done"


def test_a_flood_of_stops_is_given_to_the_core_as_a_few_in_their_order(desk, monkeypatch):
    """All clients stop through one connection to the core, which takes 500 messages a second."""
    desk.do("enable", 1)
    given, halt = [], Axis.halt
    monkeypatch.setattr(Axis, "halt", lambda axis: given.append(axis.name) or halt(axis))
    told, x = [], desk.machine["x"]

    def flood(client):
        for number in range(100):
            desk.commands.execute("halt", CommandAsk(client, number, "", ("x",)), told.append)

    flood("guest")
    x.move_velocity(50.0)  # of another program: it ends the first halt, and one more follows
    desk.machine.sleep(0.5)
    assert x.state is AxisState.STANDSTILL
    assert len(given) == 2
    flood("another")
    assert (
        desk.do("move_velocity", 2, "x", velocity=50.0).status == "done"
    )  # after the halts, as they were given
    desk.machine.sleep(0.5)
    assert x.velocity == pytest.approx(50.0, abs=1.0)
    assert len(given) == 3
    assert desk.do("halt", 1, "x", client="third").status == "done"
    assert x.velocity == pytest.approx(0.0, abs=0.1)


def test_a_client_jogs_several_axes_each_with_its_own_presses(desk):
    """``FleetAxis.jog`` numbers the presses of each axis from 1."""
    desk.do("enable", 1)
    numbers = itertools.count(2)

    def jog(axis, press, late=0.0):
        desk.now += 0.02
        desk.holding.lease = HELD.renewed(desk.now)
        desk.machine.sleep(0.02)
        return desk.do("jog", next(numbers), axis, velocity=20.0, press=press, sent=desk.now - late)

    for press in (1, 2, 3):
        assert jog("x", press).status == "running"
    for _ in range(10):  # both buttons are held
        assert [jog("y", 1).status, jog("x", 3).status] == ["running", "running"]
    assert desk.machine["x"].velocity == pytest.approx(20.0, abs=1.0)
    assert desk.machine["y"].velocity == pytest.approx(20.0, abs=1.0)
    desk.do("halt", next(numbers), "y")
    assert jog("y", 1).status == "error"
    assert (
        "has ended" in jog("y", 2, late=1.0).error.fields["message"]
    )  # that it is late is seen by those of x


def test_a_jog_is_renewed_by_its_queries_but_not_by_late_ones_or_after_a_halt(desk):
    desk.do("enable", 1)
    x = desk.machine["x"]

    def jog(number, press, passed=0.05, **more):
        desk.now += passed
        desk.holding.lease = HELD.renewed(desk.now)
        desk.machine.sleep(passed)
        values = {"velocity": 20.0, "press": press, "sent": desk.now, **more}
        return desk.do("jog", number, "x", **values)

    for number in range(2, 12):
        assert jog(number, 1).status == "running"
    assert x.velocity == pytest.approx(20.0, abs=1.0)
    repeated = jog(11, 1)  # again: it is not renewed by that
    assert repeated.status == "running"
    desk.machine.sleep(1.0)
    assert x.velocity == pytest.approx(0.0, abs=0.1)
    assert "has ended" in jog(12, 1, 1.0).error.fields["message"]
    assert jog(13, 2).status == "running"
    assert desk.do("halt", 1, client="ben").status == "done"
    assert jog(14, 2).status == "error"
    assert jog(15, 3).status == "running"
    assert "has ended" in jog(16, 4, sent=desk.now - 1.0).error.fields["message"]
    for number in range(20, 30):
        assert jog(number, 5).status == "running"
    x.halt()  # by a program at the machine: while it brakes it still shows that it moves
    ends = [jog(number, 5).status for number in range(30, 50)]
    assert ends[-1] == "error"
    assert x.velocity == pytest.approx(0.0, abs=0.1)
    assert jog(50, 6).status == "running"


# -- events, states, history -----------------------------------------------------------------------------------------


def test_events_are_numbered_without_gaps_and_the_last_are_kept():
    numbered = BridgeEventLog("run")
    assert numbered.answer(EventsAsk()).newest == 0
    events = [numbered.add(BridgeEvent("machine", str(number)), 1.0) for number in range(MAX_EVENTS + 10)]
    assert [event.n for event in events] == list(range(1, MAX_EVENTS + 11))
    answer = numbered.answer(EventsAsk())
    assert (answer.oldest, answer.newest, len(answer.events)) == (11, MAX_EVENTS + 10, MAX_ANSWER)
    assert [event.n for event in numbered.answer(EventsAsk(20, 22)).events] == [20, 21, 22]
    assert numbered.answer(EventsAsk(5, 2)).events == ()


def test_events_of_a_machine_are_reported_once_with_cause_and_remedy(machine):
    happenings = MachineEventSource(machine["x"].snapshot.now, commands=True)

    def look():
        return bridge_events(happenings.poll(machine, machine["x"].snapshot.now))

    machine["x"].enable().wait(5)
    assert [(one.kind, one.text) for one in look()] == [
        ("command", "x.enable(): given"),
        ("command", "x.enable(): done"),
    ]
    machine.simulated_node(1).fault(0x8611)
    machine.sleep(1.0)
    found = look()
    assert {one.kind for one in found} == {"emcy", "incident"}
    failed = next(one for one in found if one.about == "x")
    assert (failed.severity, bool(failed.cause), bool(failed.remedy)) == ("error", True, True)
    assert any(one.about == "node 1" and "0x8611" in one.cause for one in found)
    assert look() == []
    machine["x"].reset().wait(5)
    assert any("no longer has an error" in one.text for one in look())


def test_a_state_is_current_or_contains_only_its_age(machine):
    machine["x"].enable().wait(5)
    machine["x"].move_absolute(5.0).wait(20)
    snapshot, parameters = machine["x"].snapshot, machine.session.axes["x"].parameters
    state = state_of(snapshot, parameters, snapshot.now + 0.1, 5.0, 7, "run", False)
    assert state.position == pytest.approx(machine["x"].position)
    assert (state.n, state.unit, state.state, state.error) == (7, "deg", "Standstill", None)
    assert state.age == pytest.approx(0.1)
    for old in (
        state_of(snapshot, parameters, snapshot.now + 2.0, 5.0, 7, "run", False),
        state_of(snapshot, parameters, snapshot.now, 5.0, 7, "run", True),
    ):
        assert (old.state, old.position, old.velocity, old.drive, old.homed) == (
            "unknown",
            None,
            None,
            None,
            None,
        )
    unknown = snapshot._replace(position=None)
    assert state_of(unknown, parameters, snapshot.now, 5.0, 7, "run", False).position is None
    assert msgspec.json.decode(msgspec.json.encode(state))["position"] == state.position


def test_samples_are_left_out_evenly_and_none_is_made_up():
    times = [number / 100 for number in range(1000)]
    x = RecordedSeries("x", times, {"position": times, "state": ["Standstill"] * 1000}, {"position": "deg"})
    slow = RecordedSeries("x:6074", [1.0, 5.0], {"value": [7.0, math.nan]}, {})
    recorded = Recorded({"x": x}, {"x:6074": slow})
    answer = recordings_worker.samples(recorded, HistoryAsk("run", ("x.position", "x:6074"), 0.5, 8.5, 9))
    assert len(answer.times) <= 9
    assert answer.times[0] == 0.5
    assert answer.times == answer.values["x.position"]
    assert answer.values["x:6074"][0] is None  # before its first sample
    assert 7.0 in answer.values["x:6074"]
    assert answer.values["x:6074"][-1] is None  # no number
    for wrong in ((), ("x.nothing",), ("q.position",)):
        with pytest.raises(ArgumentError, match="signal"):
            recordings_worker.samples(recorded, HistoryAsk("run", wrong))


# -- the network ------------------------------------------------------------------------------------------------------


def test_names_and_keys():
    keys = ZenohCellKeys(named("the plant", "works"), named("the cell", "one"))
    assert keys.object(3, 0x6041, 1) == "ax/works/one/od/3/6041/01"
    assert keys.presence("*") == "ax/works/one/@bridge/*"
    for wrong in ("", "a/b", "*", "@a", "a?", "x" * 65, "a#b", "$*"):
        with pytest.raises(ArgumentError):
            named("the cell", wrong)


@pytest.mark.parametrize("endpoint", ["", "10.0.0.1:7447", "tcp:10.0.0.1", "nonsense/x", "tcp/a b"])
def test_an_invalid_endpoint_is_refused_before_anything_is_opened(endpoint):
    with pytest.raises(ArgumentError, match="not an endpoint"):
        network.require_reachable(ZenohNetwork((endpoint,)))


def test_an_endpoint_is_required_and_an_invalid_file_is_reported(tmp_path):
    with pytest.raises(ArgumentError, match="no cell can be reached"):
        network.require_reachable(ZenohNetwork())
    file = tmp_path / "wrong.json5"
    for text in ("{", "{ nonsense: 1 }", "{ mode: 'dictator' }"):
        file.write_text(text, "utf-8")
        with pytest.raises(StateError, match=r"wrong\.json5 cannot be used"):
            network.opened(ZenohNetwork(config=file))
    with pytest.raises(StateError, match="cannot be used"):
        network.opened(ZenohNetwork(config=tmp_path / "none.json5"))


def test_the_network_has_the_given_endpoints_and_no_scouting(tmp_path):
    file = tmp_path / "own.json5"
    file.write_text("{ mode: 'client', scouting: { gossip: { enabled: true } } }", "utf-8")
    plain = network._config(ZenohNetwork(("tcp/127.0.0.1:1",)))
    own = network._config(ZenohNetwork(("tcp/127.0.0.1:1",), config=file))
    for config, mode, gossip in ((plain, "peer", "false"), (own, "client", "true")):
        assert config.get_json("mode") == f'"{mode}"'
        assert config.get_json("scouting/multicast/enabled") == "false"
        assert config.get_json("scouting/gossip/enabled") == gossip
        assert config.get_json("transport/link/tx/lease") == "800"
        assert config.get_json("connect/endpoints") == '["tcp/127.0.0.1:1"]'
    assert plain.get_json("listen/endpoints") == "[]"


def test_without_the_package_the_error_names_it(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(UserError, match="eclipse-zenoh") as caught:
        network.opened(ZenohNetwork(("tcp/127.0.0.1:1",)))
    assert "axisbus[zenoh]" in caught.value.remedy


def test_an_endpoint_in_use_is_reported():
    with socket.create_server(("127.0.0.1", 0)) as there:
        endpoint = f"tcp/127.0.0.1:{there.getsockname()[1]}"
        with pytest.raises(StateError, match="cannot be joined") as caught:
            network.opened(ZenohNetwork(listen=(endpoint,)))
        assert "in use" in caught.value.observed


def test_the_process_of_the_bridge_is_removed_from_texts():
    long = f"process {os.getpid()} (python -m axisbus bridge (zenoh) x.toml), which began at 04:37:16"
    assert execute.without_process(f"x.enable() by {long}: not taken") == "x.enable(): not taken"
    assert execute.without_process(f"{long}: the lease ran out") == "the lease ran out"
    other = f"x.halt() by process {os.getpid() + 1} (axisbus halt), which began at 04:37:16"
    assert execute.without_process(other) == other
    error = Stopped(f"x.home() by {long} was stopped", observed=f"{long}: it was told to")
    assert execute.fields_of(error).fields["message"] == "x.home() was stopped"
    assert execute.fields_of(error).fields["observed"] == "it was told to"


def test_an_ownership_error_has_the_remedy():
    assert isinstance(HELD.why_not("ben", "", 10.1), OwnershipError)
    assert "renew" in HELD.why_not("ben", "", 10.1).remedy
