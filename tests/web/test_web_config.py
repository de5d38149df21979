"""Configurations on the page, on a simulated cell in virtual time: backups, comparisons, restores that are only reported."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.requests import Request

from axisbus.boot import node
from axisbus.boot import objects as objects_of
from axisbus.boot.dcf import TRUSTED_OBJECTS
from axisbus.bus.sdo.access import try_upload
from axisbus.cia301 import abort
from axisbus.cia301.nmt import NmtState
from axisbus.configuration import dcf_backup
from axisbus.eds import builtin
from axisbus.eds.io import reader
from axisbus.errors import EdsError, LimitError, NodeError, StateError, UserError
from axisbus.machine.machine import Machine
from axisbus.web.access.middleware import SESSION
from axisbus.web.access.tokens import PageSession, Role
from axisbus.web.commands.clients import PageClients
from axisbus.web.config import file_process, files, jobs, report
from axisbus.web.config.files import BACKED_UP, MAX_SIZE, UPLOADED, Dcf, PageFiles, named, summary
from axisbus.web.config.jobs import Configuring, refusal
from axisbus.web.config.report import ConfigJob, ConfigJobKind, ConfigProgress
from axisbus.web.objects import verifying
from axisbus.web.objects.worker import ObjectWorker, node_of
from axisbus.web.server import ConfigRoutes
from kit.cell import GENERIC, cell_file

ACCELERATION, WINDOW, HEARTBEAT = (0x6083, 0), (0x6065, 0), (0x1017, 0)


@pytest.fixture(autouse=True)
def quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verifying, "PACE", 0.0)
    monkeypatch.setattr(file_process, "_NICE", 0)  # else it waits for every other program of a busy computer


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    path = cell_file(tmp_path, "xy")
    with Machine.simulated(path) as machine:
        yield machine


@pytest.fixture(params=["in the server", pytest.param("in a process of its own", marks=pytest.mark.sweep)])
def anywhere(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the file of a job is parsed."""
    if request.param == "in a process of its own":
        monkeypatch.setattr(files, "_SHORT", -1)
        monkeypatch.setattr(file_process, "SILENCE_TIMEOUT", 300.0)  # on a busy computer, too


def device(machine: Machine, node: int = 1) -> Any:
    return machine.simulated_node(node).device


def done(machine: Machine, kind: ConfigJobKind, node: int = 1, file: Dcf | None = None) -> Any:
    """Run a job, and return its report; raises the errors of the library."""
    ended = Configuring().carry_out(machine, node_of(machine, node), ConfigJob(kind, 1, node, file))
    assert ended.over
    return ended.report


def backup(machine: Machine, node: int = 1) -> Dcf:
    made = done(machine, ConfigJobKind.BACKUP, node).dcf
    assert isinstance(made, Dcf)
    return made


def edited(file: Dcf, section: str, *lines: str) -> Dcf:
    """Return a file in which a section has other lines."""
    head, _, tail = file.data.decode("latin-1").partition(section)
    own, mark, rest = tail.partition("\n[")
    names = {line.partition("=")[0].lower() for line in lines}
    kept = [line for line in own.splitlines() if line.partition("=")[0].lower() not in names]
    return Dcf(
        "edited.dcf",
        "\n".join((head + section, *kept, *lines, "")).encode("latin-1") + (mark + rest).encode("latin-1"),
    )


# -- backups ------------------------------------------------------------------------------------------------------------


def test_a_backup_is_a_dcf_with_the_values_of_the_node(machine):
    device(machine).write(*ACCELERATION, 4711)
    found = done(machine, ConfigJobKind.BACKUP)
    eds = found.dcf.reading().eds
    assert eds.get(*ACCELERATION).initial(1) == 4711
    assert (eds.node_id, found.dcf.name) == (1, "node-1.dcf")
    assert "objects read" in found.text
    assert "left out" in found.text
    assert found.lines[0].startswith("node 1: axisbus generic CiA 402 drive")
    assert all(reason for *_, reason in found.rows)
    assert json.loads(json.dumps(found.as_values()))["file"] == "node-1.dcf"


def test_an_object_that_the_drive_refuses_is_left_out_and_reported(machine):
    device(machine).dials.sdo_aborts[ACCELERATION] = abort.OBJECT_MISSING
    found = done(machine, ConfigJobKind.BACKUP)
    (row,) = [row for row in found.rows if row[0] == "6083h:00"]
    assert "the device refuses it" in row[2]
    assert found.dcf.reading().eds.get(*ACCELERATION).parameter_value is None


def test_a_node_that_restarts_meanwhile_gets_no_backup(machine, monkeypatch):
    supply, reads = machine.simulated_node(1), list[int]()

    def read(sdo, index, subindex):
        reads.append(index)
        if len(reads) == 50:
            supply.switch_off()
            machine.sleep(0.2)
            supply.switch_on()
            machine.sleep(1.0)
        return try_upload(sdo, index, subindex)

    monkeypatch.setattr(dcf_backup, "try_upload", read)
    with pytest.raises(
        NodeError, match="node 1 has restarted while its objects were read; there is no backup"
    ):
        done(machine, ConfigJobKind.BACKUP)


# -- comparisons --------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("anywhere")
def test_a_node_is_like_its_own_backup_and_then_is_not(machine):
    made = backup(machine)
    same = done(machine, ConfigJobKind.COMPARE, 1, made)
    assert same.rows == ()
    assert same.text.endswith("compared, 0 differ")
    before = device(machine).read(*ACCELERATION)
    device(machine).write(*ACCELERATION, 777)
    other = done(machine, ConfigJobKind.COMPARE, 1, made)
    (row,) = other.rows
    assert (row[0], row[2], row[3]) == ("6083h:00", str(before), "777")
    assert other.titles[2:] == ("node-1.dcf", "node 1")
    assert other.text.endswith("1 differ")


@pytest.mark.usefixtures("anywhere")
def test_an_object_that_cannot_be_read_is_a_difference_with_its_reason(machine):
    made = backup(machine)
    device(machine).dials.sdo_aborts[ACCELERATION] = abort.OBJECT_MISSING
    (row,) = done(machine, ConfigJobKind.COMPARE, 1, made).rows
    assert "the device refuses it" in row[3]


# -- the plan of a restore ----------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("anywhere")
def test_a_restore_is_reported_and_not_done(machine):
    made = backup(machine)
    device(machine).write(*ACCELERATION, 777)
    found = done(machine, ConfigJobKind.WOULD_RESTORE, 1, made)
    assert [row[0] for row in found.rows] == ["6083h:00"]
    assert found.rows[0][2] == "777"
    assert "nothing was written" in found.text
    assert device(machine).read(*ACCELERATION) == 777
    assert found.refusal == {}
    device(machine).write(*HEARTBEAT, 1234)
    found = done(machine, ConfigJobKind.WOULD_RESTORE, 1, made)
    assert any("commands, not settings" in line for line in found.lines)
    assert "configured in pre-operational only" in found.refusal["message"]
    assert found.command.startswith("axisbus config restore node-1.dcf 1 --cell cell.toml")


@pytest.mark.usefixtures("anywhere")
def test_an_energised_node_is_refused_by_that(machine):
    made = backup(machine)
    machine["x"].enable().wait(10)
    assert "is energised" in done(machine, ConfigJobKind.WOULD_RESTORE, 1, made).refusal["message"]


def test_a_node_that_meets_the_conditions_is_not_restored_either_since_it_is_one_of_a_machine(machine):
    access = SimpleNamespace(node_id=1, nmt=NmtState.PRE_OPERATIONAL)
    assert "belongs to a running machine" in refusal(access, node_of(machine, 1)).message


@pytest.mark.usefixtures("anywhere")
def test_the_file_of_another_node_is_refused(machine):
    made = backup(machine, 2)
    with pytest.raises(UserError, match="was not taken from node 1") as caught:
        done(machine, ConfigJobKind.WOULD_RESTORE, 1, made)
    assert "node-ID" in caught.value.observed


def test_the_file_of_another_type_of_device_is_refused(machine):
    other = edited(backup(machine), "[1000]", "ParameterValue=0x00030191")
    with pytest.raises(UserError, match="not for a device of the type of node 1"):
        done(machine, ConfigJobKind.WOULD_RESTORE, 1, other)


def test_a_file_without_values_is_refused(machine):
    plain = Dcf("plain.eds", reader.file_bytes(builtin.resolve(GENERIC, Path())))
    with pytest.raises(EdsError, match="no parameter values"):
        done(machine, ConfigJobKind.WOULD_RESTORE, 1, plain)


@pytest.mark.usefixtures("anywhere")
def test_a_value_beyond_the_limits_of_the_file_is_refused(machine):
    beyond = edited(backup(machine), "[6098]", "LowLimit=-3", "HighLimit=3", "ParameterValue=34")
    with pytest.raises(LimitError, match="beyond its own limits; nothing was written"):
        done(machine, ConfigJobKind.WOULD_RESTORE, 1, beyond)


# -- restores of settings -----------------------------------------------------------------------------------------------


def changed(machine: Machine) -> None:
    """The drive has lost a setting, and an object that the machine uses."""
    device(machine).write(*ACCELERATION, 777)
    device(machine).write(*WINDOW, 4321)
    device(machine).write(*HEARTBEAT, 1234)


@pytest.mark.usefixtures("anywhere")
def test_the_settings_are_restored_and_objects_used_by_the_machine_are_kept(machine):
    made = backup(machine)
    before = device(machine).read(*ACCELERATION)
    changed(machine)
    found = done(machine, ConfigJobKind.RESTORE, 1, made)
    assert device(machine).read(*ACCELERATION) == before
    assert (device(machine).read(*WINDOW), device(machine).read(*HEARTBEAT)) == (4321, 1234)
    assert [(row[0], row[2], row[4]) for row in found.rows] == [("6083h:00", "777", "restored")]
    assert found.text.startswith("1 restored")
    assert "lost at the next power-off" in found.text
    assert any("6065h:00" in line and "or uses" in line for line in found.lines)
    assert found.command.startswith("axisbus config restore")
    assert done(machine, ConfigJobKind.RESTORE, 1, made).text.startswith("0 restored")


def test_the_dry_run_lists_objects_that_this_page_would_write_and_would_not(machine):
    made = backup(machine)
    changed(machine)
    here = {row[0]: row[4] for row in done(machine, ConfigJobKind.WOULD_RESTORE, 1, made).rows}
    assert here["6083h:00"] == "yes"
    assert here["6065h:00"] == here["1017h:00"] == "no: the machine has set it, or uses it"


@pytest.mark.usefixtures("anywhere")
def test_an_energised_node_gets_nothing(machine):
    made = backup(machine)
    device(machine).write(*ACCELERATION, 777)
    machine["x"].enable().wait(10)
    with pytest.raises(StateError, match="energised: it is not configured; nothing was written"):
        done(machine, ConfigJobKind.RESTORE, 1, made)
    assert device(machine).read(*ACCELERATION) == 777


@pytest.mark.usefixtures("anywhere")
def test_a_drive_that_is_energised_during_a_restore_ends_it_and_the_progress_is_reported(
    machine, monkeypatch
):
    made = backup(machine)
    velocity = (0x6081, 0)
    for key in (ACCELERATION, velocity):
        device(machine).write(*key, 777)
    own = verifying.WritingSdo.download

    def enabled_meanwhile(sdo: Any, index: int, subindex: int, data: bytes) -> None:
        own(sdo, index, subindex, data)
        machine["x"].enable().wait(10)

    monkeypatch.setattr(verifying.WritingSdo, "download", enabled_meanwhile)
    told = done(machine, ConfigJobKind.RESTORE, 1, made).as_values()
    assert "is energised" in told["broken"]["message"]
    assert [device(machine).read(*key) for key in (ACCELERATION, velocity)].count(777) == 1
    assert {row[0]: row[4].partition(":")[0] for row in told["rows"]} == {
        "6081h:00": "differs, not yet written",
        "6083h:00": "differs, not yet written",
    }


def test_no_restore_writes_an_object_that_boot_up_has_read_of_an_axis(machine, tmp_path, monkeypatch):
    """Whatever the master learns of a drive as it begins, it goes by: the table names all of it."""
    asked: set[tuple[int, int]] = set()
    monkeypatch.setattr(
        node, "read_int", lambda objects, *key: asked.add(key) or objects_of.read_int(objects, *key)
    )
    with Machine.simulated(machine.cell.file):
        pass
    eds = device(machine).eds
    settings_read = {index for index, *_ in asked if index >= 0x6000 and may_write(eds, index)}
    assert len(settings_read) > 10
    assert settings_read <= TRUSTED_OBJECTS


def may_write(eds: Any, index: int) -> bool:
    return any(each.writable for each in eds.objects[index].subs.values()) if index in eds else False


# -- files ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "data", [b"", b"\0" * 100, b"<script>alert(1)</script>", b"PK\x03\x04" + bytes(range(256)) * 40]
)
def test_an_invalid_dcf_is_reported_with_a_message(data):
    with pytest.raises(EdsError, match=r"^x\.dcf") as caught:
        summary(Dcf("x.dcf", data))
    assert caught.value.message
    assert caught.value.remedy


def test_a_file_that_describes_millions_of_entries_is_refused_before_they_are_made():
    each = "[{:04X}]\nObjectType=8\nDataType=7\nAccessType=rw\nCompactSubObj=254\n"
    data = "".join(each.format(index) for index in range(0x1000, 0x6000)).encode()
    began = time.process_time()
    with pytest.raises(EdsError, match="more entries than any device"):
        summary(Dcf("x.dcf", data))
    assert time.process_time() - began < 3.0


@given(st.binary(max_size=2000))
def test_no_bytes_are_a_mistake_of_the_page(data):
    with suppress(EdsError):
        assert summary(Dcf("x.dcf", data)).startswith("of ")


@given(st.text(max_size=200))
def test_a_name_is_one_in_this_folder_without_markup(text):
    name = named(text)
    assert name == named(name)
    assert 0 < len(name) <= 80
    assert not set(name) & set("/\\<>\"'&\0\r\n:")
    assert name not in (".", "..")


def test_plain_characters_of_file_names_are_kept():
    assert named("C:\\drives\\axis x (2).dcf") == "axis x (2).dcf"
    assert named("../../etc/passwd") == "passwd"
    assert named("<img src=x onerror=alert(1)>.dcf") == "_img src_x onerror_alert(1)_.dcf"


def test_a_page_has_two_files_at_most_and_none_after_it_is_closed():
    files = PageFiles()
    for number in range(5):
        files.store(1, UPLOADED, Dcf(str(number), b"1"))
        files.store(1, BACKED_UP, Dcf(str(number), b"2"))
    assert files.of(1, UPLOADED) == Dcf("4", b"1")
    files.store(1, UPLOADED, Dcf("large", bytes(MAX_SIZE + 1)))
    assert files.of(1, UPLOADED) is None
    files.remove_page(1)
    assert files.of(1, BACKED_UP) is None


# -- the client handler ---------------------------------------------------------------------------------------------------


@pytest.fixture
def desk(machine: Machine) -> SimpleNamespace:
    """A client handler with an operator, who has the controls, and an observer.

    ``run`` lets the worker run until there is no job, and does something in the middle of it.
    """
    at = PageClients(machine, str)
    worker = ObjectWorker(machine, at.objects)
    operator, looker = (
        at.admit(PageSession(number, role), "here")
        for number, role in ((1, Role.OPERATOR), (2, Role.OBSERVER))
    )
    job = at.objects.configuring

    def ask(place: Any, do: str, **more: Any) -> None:
        at.receive(place, json.dumps({"do": do, **more}), 100.0)

    async def until(seen: Any) -> None:
        for _ in range(1000):
            await asyncio.sleep(0.01)
            if seen():
                break

    def run(during: Any = lambda: None) -> None:
        async def limited() -> None:
            task = asyncio.create_task(worker.run())
            await until(lambda: job.busy is None or job.now.done)
            during()
            await until(lambda: job.busy is None)
            task.cancel()

        asyncio.run(limited())

    ask(operator, "take")
    return SimpleNamespace(
        desk=at, job=job, operator=operator, looker=looker, ask=ask, run=run, machine=machine, worker=worker
    )


def words(place: Any) -> str:
    return " ".join(f"{one.text} {one.remedy}" for one in place.messages)


def test_an_observer_backs_up_and_compares_and_restores_nothing(desk):
    desk.ask(desk.looker, "backup", node=1)
    desk.run()
    made = desk.job.files.of(desk.looker.identity.number, BACKED_UP)
    assert made.name == "node-1.dcf"
    desk.ask(desk.looker, "compare", node=1)
    assert "has sent no file" in words(desk.looker)
    desk.job.files.store(desk.looker.identity.number, UPLOADED, made)
    desk.ask(desk.looker, "compare", node=1)
    desk.run()
    assert desk.job.now.as_values()["report"]["text"].endswith("0 differ")
    desk.ask(desk.looker, "restore", node=1, sure=True)
    assert "this is an observer page" in words(desk.looker)


def test_the_page_with_the_controls_restores_after_a_yes_until_it_gives_them_back(desk, monkeypatch):
    desk.ask(desk.operator, "backup", node=1)
    desk.run()
    number = desk.operator.identity.number
    desk.job.files.store(number, UPLOADED, desk.job.files.of(number, BACKED_UP))
    device(desk.machine).write(*ACCELERATION, 777)
    desk.ask(desk.operator, "restore", node=1)
    assert "it has not been confirmed" in words(desk.operator)
    monkeypatch.setattr(verifying, "PACE", 0.01)
    desk.ask(desk.operator, "restore", node=1, sure=True)
    desk.run(lambda: desk.ask(desk.operator, "give_back"))
    assert "was cancelled" in desk.job.now.error["message"]
    assert device(desk.machine).read(*ACCELERATION) == 777
    desk.ask(desk.operator, "take")
    desk.ask(desk.operator, "restore", node=1, sure=True)
    desk.run()
    assert desk.job.now.report.text.startswith("1 restored")
    assert device(desk.machine).read(*ACCELERATION) != 777


def test_there_is_one_job_for_all_pages_a_verification_is_one_too(desk):
    desk.ask(desk.operator, "backup", node=1)
    desk.ask(desk.looker, "backup", node=2)
    assert "is already running, for page 1" in words(desk.looker)
    desk.ask(desk.operator, "verify", node=2)
    assert "is already running, for page 1" in words(desk.operator)
    assert desk.desk.objects.verified is None
    desk.run()
    desk.ask(desk.operator, "verify", node=2)
    desk.looker.messages.clear()
    desk.ask(desk.looker, "backup", node=1)
    assert "node 2 is being verified" in words(desk.looker)


@pytest.mark.parametrize("begun", [False, True])
def test_a_job_of_a_page_without_controls_is_cancelled_for_the_page_with_them(desk, monkeypatch, begun):
    """However often it is begun again."""
    monkeypatch.setattr(verifying, "PACE", 0.01)
    seen: list[Any] = []

    def over() -> None:
        desk.ask(desk.operator, "backup", node=2)
        seen.append(desk.job.now)
        desk.ask(desk.looker, "backup", node=1)
        assert "is already running, for page 1" in words(desk.looker)

    desk.ask(desk.looker, "backup", node=1)
    desk.run(over) if begun else over()
    desk.run()
    assert not words(desk.operator)
    assert (desk.job.now.config_job.page, desk.job.now.config_job.node) == (1, 2)
    assert desk.job.now.report is not None
    assert desk.job.files.of(desk.looker.identity.number, BACKED_UP) is None
    if begun:
        assert seen[0].config_job.page == 2


def test_a_verification_of_the_page_with_the_controls_cancels_jobs_of_others(desk, monkeypatch):
    monkeypatch.setattr(verifying, "PACE", 0.01)
    desk.ask(desk.looker, "backup", node=1)
    desk.run(lambda: desk.ask(desk.operator, "verify", node=2))
    assert not words(desk.operator)
    assert desk.desk.objects.verified is not None
    assert "was cancelled" in desk.job.now.error["message"]


def test_a_job_is_cancelled_only_by_its_page_and_by_the_page_with_the_controls(desk, monkeypatch):
    monkeypatch.setattr(verifying, "PACE", 0.01)
    desk.ask(desk.operator, "backup", node=1)
    desk.ask(desk.looker, "job_end")
    desk.run(lambda: desk.ask(desk.operator, "job_end"))
    assert "the backup of node 1 was cancelled" in desk.job.now.error["message"]
    assert 0 < desk.job.now.done < desk.job.now.whole
    desk.ask(desk.looker, "backup", node=1)
    desk.run(lambda: desk.ask(desk.operator, "job_end"))
    assert "was cancelled" in desk.job.now.error["message"]


def test_a_job_ends_with_its_page_and_leaves_no_file(desk, monkeypatch):
    monkeypatch.setattr(verifying, "PACE", 0.01)
    desk.ask(desk.looker, "backup", node=1)
    desk.run(lambda: desk.desk.remove(desk.looker))
    assert "was cancelled" in desk.job.now.error["message"]
    assert desk.job.files.of(desk.looker.identity.number, BACKED_UP) is None


def test_a_node_lost_during_a_job_ends_it_with_the_error(desk, monkeypatch):
    monkeypatch.setattr(verifying, "PACE", 0.01)
    desk.ask(desk.operator, "backup", node=1)
    desk.run(lambda: setattr(device(desk.machine).dials, "sdo_silent", True))
    told = desk.job.now.as_values()
    assert "no answer" in told["error"]["message"]
    assert 0 < told["done"] < told["whole"]
    assert told["report"] is None


def test_a_node_that_is_not_there_and_one_without_objects_are_reported(desk):
    desk.ask(desk.operator, "backup", node=9)
    desk.run()
    assert "the cell has no node 9" in desk.job.now.error["message"]


def test_a_mistake_is_reported_and_the_next_job_continues(desk, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(jobs, "carry_out", lambda *_: 1 / 0)
        desk.ask(desk.operator, "backup", node=1)
        desk.run()
    assert "ZeroDivisionError" in desk.job.now.error["observed"]
    desk.ask(desk.operator, "backup", node=1)
    desk.run()
    assert desk.job.now.report is not None


def test_a_long_report_is_cut_and_has_its_full_length():
    rows = tuple((str(n), "") for n in range(report.MAX_ROWS + 5))
    told = ConfigProgress(
        ConfigJob(ConfigJobKind.COMPARE, 1, 1), report=report.ConfigReport("", rows=rows)
    ).as_values()
    assert (len(told["report"]["rows"]), told["report"]["all"]) == (report.MAX_ROWS, report.MAX_ROWS + 5)


def test_a_report_with_many_and_long_texts_is_shortened_before_it_is_sent_to_the_pages():
    """A file may have a name of 2 MB, and 100,000 of them."""
    long = "x" * 100_000
    given = report.ConfigReport(
        long, (long,) * 1000, (), ((long,) * 5,) * 1000, {"message": long}, broken={"observed": long}
    )
    found = given.bounded()
    job = ConfigJob(ConfigJobKind.COMPARE, 1, 1)
    told = ConfigProgress(job, report=found).as_values()["report"]
    assert len(json.dumps(told)) < 600_000
    assert told["all"] == 1000
    assert told["lines"][-1] == "... and 901 more lines"
    assert told["rows"][0][0].endswith("x ...")
    assert found.left_out == 700
    assert found.bounded() == found
    error = Configuring().failed(job, StateError(long, observed=long, remedy="r")).as_values()["error"]
    assert len(error["message"]) + len(error["observed"]) < 10_000
    assert error["remedy"] == "r"


def test_a_short_report_is_not_changed():
    given = report.ConfigReport("a", ("b",), ("c", "d"), (("e", "f"),), {"message": "g"}, "h")
    assert given.bounded() == given


# -- requests -------------------------------------------------------------------------------------------------------------


def request(session: PageSession, query: str, *chunks: bytes, cut: bool = False) -> Request:
    """A request as it comes through the gate; ``cut``: its body was longer than it may be."""
    coming = [{"type": "http.request", "body": chunk, "more_body": True} for chunk in chunks]
    coming.append({"type": "http.disconnect"} if cut else {"type": "http.request", "body": b""})

    async def receive() -> dict[str, Any]:
        return coming.pop(0)

    scope = {
        "type": "http",
        "method": "POST",
        "query_string": query.encode(),
        "headers": [],
        SESSION: session,
    }
    return Request(scope, receive)


def never_ended(session: PageSession, query: str) -> Request:
    """A request whose body does not come."""
    waiting = request(session, query)

    async def receive() -> dict[str, Any]:
        await asyncio.Event().wait()
        raise AssertionError

    return Request(waiting.scope, receive)


@pytest.fixture
def bring(desk: SimpleNamespace) -> Any:
    routes = ConfigRoutes(desk.desk)

    def bring(query: str, *chunks: bytes, number: int = 1, cut: bool = False) -> Any:
        return asyncio.run(
            routes.upload(request(PageSession(number, Role.OPERATOR), query, *chunks, cut=cut))
        )

    bring.made = lambda query, number=1: asyncio.run(
        routes.made(request(PageSession(number, Role.OPERATOR), query))
    )
    return bring


def test_a_file_is_uploaded_in_pieces_and_reported(desk, bring):
    data = backup(desk.machine).data
    answer = bring("page=1&name=my%20x.dcf", data[:1000], data[1000:])
    told = json.loads(answer.body)
    assert told["name"] == "my x.dcf"
    assert told["text"].startswith("of node 1")
    assert desk.job.files.of(1, UPLOADED) == Dcf("my x.dcf", data)


def test_an_endless_file_of_one_browser_delays_no_other_one(desk):
    routes, data = ConfigRoutes(desk.desk), backup(desk.machine).data

    async def brought() -> list[int]:
        crowd = [asyncio.create_task(routes.upload(never_ended(PageSession(2, Role.OBSERVER), "page=2")))]
        await asyncio.sleep(0)
        again = await routes.upload(request(PageSession(2, Role.OBSERVER), "page=2", b"more"))
        own = await routes.upload(request(PageSession(1, Role.OPERATOR), "page=1", data))
        crowd[0].cancel()
        return [again.status_code, own.status_code]

    assert asyncio.run(brought()) == [503, 200]
    assert desk.job.files.of(1, UPLOADED) is not None


@pytest.mark.parametrize(
    ("query", "number", "status"),
    [
        ("page=1", 2, 404),  # another browser's page
        ("page=77", 1, 404),
        ("page=", 1, 404),
        ("page=-1", 1, 404),
        ("page=" + "9" * 500, 1, 404),
        ("", 1, 404),
    ],
)
def test_a_file_without_a_page_is_refused(desk, bring, query, number, status):
    assert bring(query, b"[1000]", number=number).status_code == status
    assert bring.made(query, number).status_code == 404
    assert desk.job.files.of(1, UPLOADED) is None


def test_a_file_that_is_too_long_or_invalid_is_not_kept(desk, bring):
    assert bring("page=1", b"x" * 1000, cut=True).status_code == 413
    assert json.loads(bring("page=1", b"junk").body)["error"]["message"].endswith("this is not an EDS or DCF")
    assert desk.job.files.of(1, UPLOADED) is None


def test_a_backup_is_fetched_by_its_own_browser(desk, bring):
    desk.ask(desk.operator, "backup", node=1)
    desk.run()
    answer = bring.made("page=1")
    assert answer.body == desk.job.files.of(1, BACKED_UP).data
    assert answer.headers["content-disposition"] == 'attachment; filename="node-1.dcf"'
    assert bring.made("page=1", 2).status_code == 404


def test_no_job_leaves_a_thread_behind(desk):
    before = threading.active_count()
    desk.ask(desk.operator, "backup", node=1)
    desk.run()
    assert threading.active_count() <= before + 1
