"""Objects on the page, on a simulated cell in virtual time: reading, writing, refusals and their messages."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from axisbus.bus.pdo.plan import PdoChange, PdoPlan, PlannedPdo
from axisbus.cia301 import abort
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.pdo import MappedObject, PdoConfiguration
from axisbus.configuration import parse_values
from axisbus.eds import builtin, load
from axisbus.eds.dictionary import DictionaryEntry
from axisbus.errors import ArgumentError
from axisbus.machine.machine import Machine
from axisbus.sim.build import device_from_eds
from axisbus.web.access.tokens import PageSession, Role
from axisbus.web.commands.clients import PageClients
from axisbus.web.objects import dictionary, verifying
from axisbus.web.objects.dictionary import DictionaryCache, dictionary_values, layouts
from axisbus.web.objects.transfer_queue import ObjectJob, ObjectKey, TransferRequest, TransferResult, read
from axisbus.web.objects.verifying import Verifying
from axisbus.web.objects.worker import ObjectTransfers, ObjectWorker, node_of
from kit.cell import GENERIC, cell_file

ROOT = Path(__file__).parents[2]
STORE = "1:1010:01"
SAVE = str(int.from_bytes(b"save", "little"))


class Nodes:
    """A simulated cell of two axes, and transfers with its nodes."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.transfers = ObjectTransfers(machine)

    @property
    def dials(self) -> Any:
        return self.machine.simulated_node(1).device.dials

    def read(self, key: str) -> TransferResult:
        return self.transfers.carry_out(ObjectJob(named(key), 1))

    def write(self, key: str, text: str, *agreed: str) -> TransferResult:
        return self.transfers.carry_out(ObjectJob(named(key), 1, TransferRequest(text, frozenset(agreed))))

    def has(self, key: str) -> int:
        """The value of the simulated drive itself."""
        found = named(key)
        value: int = self.machine.simulated_node(found.node).device.read(found.index, found.subindex)
        return value


def named(key: str) -> ObjectKey:
    found = read(key)
    assert found is not None
    return found


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[Nodes]:
    path = cell_file(tmp_path, "xy")
    with Machine.simulated(path) as machine:
        yield Nodes(machine)


# -- reading ------------------------------------------------------------------------------------------------------------


def test_a_value_has_its_unit_and_its_meaning(nodes):
    assert "(switch on disabled" in str(nodes.read("1:6041:00").value)
    assert str(nodes.read("1:6083:00").value).endswith("deg/s²")
    assert nodes.read("1:1008:00").value == "'axisbus generic CiA 402 drive'"
    assert nodes.read("1:6064:00").error == {}


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("9:6064:00", "the cell has no node 9"),
        ("1:2345:00", "node 1 has no object 2345h:00 by its EDS"),
        ("1:6064:07", "has no object 6064h:07"),
    ],
)
def test_a_missing_object_is_reported_with_a_message(nodes, key, words):
    seen = nodes.read(key)
    assert words in seen.error["message"]
    assert (seen.value, seen.silent) == (None, False)


def test_an_abort_of_the_drive_is_reported_with_its_code(nodes):
    nodes.dials.sdo_aborts[0x6083, 0] = abort.OBJECT_MISSING
    seen = nodes.read("1:6083:00")
    assert "0602" in seen.error["message"] + seen.error["observed"]
    assert not seen.silent


def test_a_node_that_does_not_answer_is_reported_and_known_as_silent(nodes):
    nodes.dials.sdo_silent = True
    seen = nodes.read("1:6064:00")
    assert "no answer" in seen.error["message"]
    assert seen.silent


def test_a_node_without_a_dictionary_is_reported():
    with Machine.simulated(ROOT / "examples" / "can_simple.toml") as machine:
        seen = ObjectTransfers(machine).carry_out(ObjectJob(ObjectKey(16, 0x6064, 0), 1))
        assert (
            seen.error["message"]
            == "node 16 uses CAN Simple or Modbus, not CANopen: it has no object dictionary"
        )
        told = json.loads(asyncio.run(DictionaryCache(machine).page(16)))
        assert told["error"]["message"] == seen.error["message"]


# -- writing --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("typed", "written"), [("123", 123), ("0x1F", 31), ("90 deg/s²", 9000)])
def test_a_value_is_written_and_read_back(nodes, typed, written):
    seen = nodes.write("1:6083:00", typed)
    assert nodes.has("1:6083:00") == written
    assert (seen.error, seen.question) == ({}, None)
    assert str(seen.value).startswith(f"{written} = ")
    assert "read back" in seen.note
    assert "axisbus save 1" in seen.note


@pytest.mark.parametrize(
    ("key", "typed", "words"),
    [
        ("1:6083:00", "", "not a whole number"),
        ("1:6083:00", "ten", "not a whole number"),
        ("1:6083:00", "-1", "-1"),
        ("1:6083:00", "4294967296", "4294967296"),
        ("1:6083:00", "1.5", "not a whole number"),
        ("1:6083:00", "90 kg", "unit that cannot be used"),
        ("1:6083:00", "1" * 1024, "1" * 1024),
        ("1:6064:00", "1", "cannot be written"),
        ("1:1008:00", "x", "cannot be written"),
        ("1:2345:00", "1", "has no object"),
        ("1:6040:00", "15", "is sent by PDO in every cycle of the running machine; nothing was sent"),
        ("1:607A:00", "1", "is sent by PDO in every cycle of the running machine; nothing was sent"),
        ("1:60B2:00", "1", "only the commands of the running machine"),
        ("1:60FE:01", "1", "only the commands of the running machine"),
    ],
)
def test_an_invalid_value_is_refused_before_it_is_sent(nodes, key, typed, words):
    nodes.dials.sdo_silent = True  # a request to the drive would show that
    seen = nodes.write(key, typed, "order", "energised")
    assert words in seen.error["message"]
    assert not seen.silent
    assert seen.value is None


def test_no_file_of_the_server_is_read_for_a_page(nodes, monkeypatch):
    monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail(f"{path} was read"))
    for key in ("1:1008:00", "1:6083:00", "1:60FE:01", "1:1010:01"):
        assert nodes.write(key, "@/etc/passwd", "order", "energised").error


def test_a_domain_is_neither_read_nor_written(tmp_path):
    text = (ROOT / "eds" / "generic-cia402.eds").read_text("utf-8")
    for before, after in (
        ("[6083]", "0x2"),
        ("[6084]", "0x7"),
    ):  # a DOMAIN by its object code, and by its data type
        head, _, rest = text.partition(before)
        body, gap, tail = rest.partition("\n\n")
        body = body.replace("ObjectType=0x7", f"ObjectType={after}").replace(
            "DataType=0x0007", "DataType=0x000F"
        )
        text = head + before + body.replace("DefaultValue=1000000", "") + gap + tail
    (tmp_path / "domain.eds").write_text(text, "utf-8")
    path = cell_file(tmp_path, "x", eds=str(tmp_path / "domain.eds"))
    with Machine.simulated(path) as machine:
        at = Nodes(machine)
        for key in ("1:6083:00", "1:6084:00"):
            assert "is not read automatically" in at.read(key).error["message"]
            assert "is not written automatically" in at.write(key, "00FF").error["message"]


def test_octets_are_digits_and_no_file():
    entry = DictionaryEntry(0x2000, 0, "bytes", DataType.OCTET_STRING)
    assert parse_values.value("01ff", entry, entry.data_type, files=False) == b"\x01\xff"
    with pytest.raises(ArgumentError, match="are not bytes") as caught:
        parse_values.value("@/etc/hostname", entry, entry.data_type, files=False)
    assert "@file" not in caught.value.remedy


def test_a_drive_that_refuses_or_rounds_is_reported(nodes):
    nodes.dials.sdo_write_aborts[0x6083, 0] = 0x0609_0031
    seen = nodes.write("1:6083:00", "123")
    assert "0609" in seen.error["message"] + seen.error["observed"]
    assert nodes.has("1:6083:00") != 123


def test_storing_parameters_needs_a_confirmation(nodes):
    first = nodes.write(STORE, SAVE)
    assert first.question is not None
    assert "stores parameters" in first.question.text
    assert first.question.reasons == {"order"}
    again = nodes.write(STORE, SAVE, *first.question.reasons)
    assert (again.question, again.error) == (None, {})


def test_a_write_to_an_energised_node_needs_confirmation_by_the_answer_to_its_own_question(nodes):
    nodes.machine["x"].enable().wait(10)
    before = nodes.has("1:6083:00")
    for agreed in ((), ("order",), ("yes",)):
        first = nodes.write("1:6083:00", "777", *agreed)
        assert first.question is not None
        assert "energised" in first.question.text
        assert first.question.reasons == {"energised"}
        assert nodes.has("1:6083:00") == before
    assert "read back" in nodes.write("1:6083:00", "777", "energised").note
    assert nodes.has("1:6083:00") == 777


# -- known without the drive -----------------------------------------------------------------------------------------------


def test_the_tree_has_every_entry_of_the_file_with_its_access(nodes):
    told = dictionary_values(nodes.machine, 1)
    eds = load(builtin.resolve(GENERIC, Path()))
    assert [each["index"] for each in told["objects"]] == [f"{each.index:04X}" for each in eds]
    entries = {entry["key"]: entry for each in told["objects"] for entry in each["entries"]}
    assert len(entries) == sum(len(each.subs) for each in eds)
    acceleration, position = entries["1:6083:00"], entries["1:6064:00"]
    assert (acceleration["type"], acceleration["access"], acceleration["unit"]) == (
        "UNSIGNED32",
        "rw",
        "deg/s²",
    )
    assert (acceleration["reads"], acceleration["writes"], position["writes"]) == (True, True, False)
    assert any("commands of its axis" in note for note in entries["1:60B2:00"]["notes"])
    assert json.loads(json.dumps(told)) == told


def test_pdos_are_those_of_the_drive_and_the_other_ones_of_the_file():
    eds = load(builtin.resolve(GENERIC, Path()))
    mapped = (MappedObject(0x6041, 0, 16), MappedObject(0x6061, 0, 8), MappedObject(0x6064, 0, 32))
    drive = PdoConfiguration(1, 0x191, True, 1, mapped, inhibit_time=50)
    off = replace(drive, number=2, valid=False)
    pdos = (
        PlannedPdo(
            False, drive, drive, PdoChange.KEEP, ("statusword", "mode", "position"), (False, True, True)
        ),
        PlannedPdo(False, drive, off, PdoChange.DISABLE, (), ()),
    )
    found = {each["name"]: each for each in layouts(eds, 5, [PdoPlan(5, 1, pdos, {}, {})])}
    assert list(found) == [f"{kind}PDO{number}" for kind in "RT" for number in range(1, 5)]
    used, unused, by_eds = found["TPDO1"], found["TPDO2"], found["TPDO3"]
    assert (used["used"], used["size"]) == (True, 7)
    assert used["heading"] == "191h, with every SYNC (type 1), at most every 5 ms"
    assert [(slot["first"], slot["bits"], slot["address"], slot["where"]) for slot in used["slots"]] == [
        (0, 16, "6041", "bytes 0-1"),
        (16, 8, "6061", "byte 2"),
        (24, 32, "6064", "bytes 3-6"),
    ]
    assert (used["slots"][2]["name"], used["slots"][2]["type"]) == ("Position actual value", "INTEGER32")
    assert (unused["used"], "switched off" in unused["heading"]) == (False, True)
    assert "by the EDS" in by_eds["source"]
    assert by_eds["heading"].startswith("385h ($NODEID+0x380)")


def test_findings_are_those_of_eds_check(tmp_path):
    text = (ROOT / "eds" / "generic-cia402.eds").read_text("utf-8")
    bad = tmp_path / "bad.eds"
    bad.write_text(text.replace("PDOMapping=1", "PDOMapping=<b>7</b>", 1), "utf-8")
    path = cell_file(tmp_path, "x", eds=str(bad))
    with Machine.simulated(path) as machine:
        found = dictionary_values(machine, 1)["findings"]
    assert found["all"] >= 1
    assert any("<b>7</b>" in each["message"] for each in found["shown"])
    assert all(each["remedy"] for each in found["shown"])


def test_a_book_is_made_once_for_concurrent_requests(nodes, monkeypatch):
    made = []
    monkeypatch.setattr(
        dictionary,
        "dictionary_values",
        lambda machine, node: made.append(node) or dictionary_values(machine, node),
    )

    async def ask():
        kept = DictionaryCache(nodes.machine)
        pages = await asyncio.gather(*(kept.page(1) for _ in range(50)), kept.page(2), kept.page(9))
        return set(pages)

    assert len(asyncio.run(ask())) == 3
    assert sorted(made) == [1, 2]


# -- verifying --------------------------------------------------------------------------------------------------------------


@pytest.fixture
def quickly(monkeypatch):
    monkeypatch.setattr(verifying, "PACE", 0.0)


def test_a_drive_that_bears_its_file_out_and_one_that_does_not(nodes, quickly):
    run = Verifying()
    assert run.begin(1, 1) is None
    assert run.take() == 1
    assert run.take() is None
    nodes.dials.sdo_aborts[0x6083, 0] = abort.OBJECT_MISSING
    run.carry_out(node_of(nodes.machine, 1))
    told = run.now.as_values()
    assert told["over"]
    assert told["done"] == told["whole"] > 200
    assert told["error"] is None
    (bad,) = [each for each in told["differences"] if each["severity"] == "error"]
    assert (bad["index"], bad["message"]) == ("6083", "is not in the device")
    assert "1 error" in told["text"]
    assert json.loads(json.dumps(told)) == told


def test_there_is_one_at_a_time_and_it_ends_with_its_page(nodes):
    run = Verifying()
    assert run.begin(1, 1) is None
    assert "being verified" in run.begin(2, 2).text
    thread = threading.Thread(target=run.carry_out, args=(node_of(nodes.machine, 1),))
    thread.start()
    run.end(2)
    thread.join(0.2)
    assert thread.is_alive()
    run.end(1)
    thread.join(5.0)
    assert not thread.is_alive()
    assert "cancelled" in run.now.as_values()["error"]["message"]
    assert run.begin(2, 2) is None


def test_a_node_that_is_lost_meanwhile_ends_it_with_an_error(nodes, quickly):
    run = Verifying()
    run.begin(1, 1)
    nodes.dials.sdo_silent = True
    run.carry_out(node_of(nodes.machine, 1))
    assert run.now.over
    assert "no answer" in run.now.as_values()["error"]["message"]


# -- the client handler -----------------------------------------------------------------------------------------------------


@pytest.fixture
def desk(nodes) -> SimpleNamespace:
    """A client handler with an operator, who has the controls, and an observer; ``run`` lets the worker work for a time."""
    at = PageClients(nodes.machine, str)
    worker = ObjectWorker(nodes.machine, at.objects)
    operator, looker = (at.admit(PageSession(1, role), "here") for role in (Role.OPERATOR, Role.OBSERVER))

    def ask(place: Any, do: str, *keys: str, **more: Any) -> None:
        at.receive(place, json.dumps({"do": do, "objects": list(keys), **more}), 100.0)

    def run(seconds: float = 0.3) -> None:
        async def limited() -> None:
            task = asyncio.create_task(worker.run())
            await asyncio.sleep(seconds)
            task.cancel()

        asyncio.run(limited())

    def told(place: Any) -> list[dict[str, Any]]:
        return [dict(each) for each in at.objects.unread(place.identity.number, 100.0)]

    ask(operator, "take")
    return SimpleNamespace(
        desk=at, operator=operator, looker=looker, ask=ask, run=run, told=told, nodes=nodes
    )


def test_an_observer_reads_and_neither_writes_nor_verifies(desk):
    desk.ask(desk.looker, "read_objects", "1:6064:00", "2:6064:00")
    desk.ask(desk.looker, "write_object", "1:6083:00", text="5")
    desk.ask(desk.looker, "verify", node=1)
    before = desk.nodes.has("1:6083:00")
    desk.run()
    assert [each["key"] for each in desk.told(desk.looker)] == ["1:6064:00", "2:6064:00"]
    assert desk.nodes.has("1:6083:00") == before
    assert desk.desk.objects.verified is None
    assert any("observer page" in one.text for one in desk.looker.messages)


def test_a_write_needs_the_controls_when_it_is_done_not_only_when_it_is_requested(desk):
    other = desk.desk.admit(PageSession(2, Role.OPERATOR), "there")
    before = desk.nodes.has("1:6083:00")
    desk.ask(desk.operator, "write_object", "1:6083:00", text="5")
    desk.ask(other, "take_over")
    desk.run()
    assert desk.nodes.has("1:6083:00") == before
    (told,) = desk.told(desk.operator)
    assert told["wrote"]
    assert "no longer has the controls" in told["error"]["message"]
    desk.ask(other, "write_object", "1:6083:00", text="5")
    desk.run()
    assert desk.nodes.has("1:6083:00") == 5
    assert desk.told(other)[0]["note"].startswith("100000")


def test_a_question_is_sent_to_the_requesting_page_and_its_yes_writes(desk):
    desk.ask(desk.operator, "write_object", STORE, text=SAVE)
    desk.run()
    (asked,) = desk.told(desk.operator)
    desk.ask(desk.operator, "write_object", STORE, text=SAVE, values={"agreed": asked["question"]["reasons"]})
    desk.run()
    (written,) = desk.told(desk.operator)
    assert (written["question"], written["error"]) == (None, None)


def test_too_many_requests_are_refused(desk):
    for _ in range(4):
        desk.ask(desk.looker, "read_objects", *["1:6064:00"] * 32)
    assert any("waiting for 64 objects" in one.text for one in desk.looker.messages)


def test_a_mistake_in_one_transfer_is_reported_and_ends_nothing(desk, monkeypatch):
    def broken(self: ObjectTransfers, job: ObjectJob) -> TransferResult:
        raise ZeroDivisionError("<script>")

    desk.ask(desk.operator, "read_objects", "1:6064:00")
    with monkeypatch.context() as patched:
        patched.setattr(ObjectTransfers, "carry_out", broken)
        desk.run()
    (told,) = desk.told(desk.operator)
    assert "ZeroDivisionError" in told["error"]["observed"]
    desk.ask(desk.operator, "read_objects", "1:6064:00")
    desk.run()
    assert desk.told(desk.operator)[0]["error"] is None


def test_a_verification_is_reported_to_its_end_and_ends_with_the_controls(desk, quickly):
    desk.ask(desk.operator, "verify", node=1)
    desk.run(2.0)
    assert desk.desk.objects.verified.over
    desk.ask(desk.operator, "verify", node=9)
    desk.run()
    assert "the cell has no node 9" in desk.desk.objects.verified.as_values()["error"]["message"]


def test_a_device_of_another_kind_has_its_own_book(tmp_path):
    path = cell_file(tmp_path, "x", eds="builtin:gim6010-8")
    eds = load(builtin.resolve("builtin:gim6010-8", Path()))
    with Machine.simulated(path, {1: device_from_eds(eds, 1)}) as machine:
        told = dictionary_values(machine, 1)
    assert len(told["objects"]) == len(list(eds))
