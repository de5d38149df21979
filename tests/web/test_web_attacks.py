"""Attacks on the server of the page: unknown clients, junk, floods, crowds; their cost, and a stop always gets through."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from subprocess import PIPE, Popen
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("nicegui", reason="the page needs nicegui")

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection

from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.web.access.limits import FILE
from kit.scenarios.core_process import OWN_PROCESS, own_cell, turns
from kit.served_page import served, until
from kit.web_client import Client

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]


def send(page: ClientConnection, do: str, axis: str = "x", **more: Any) -> None:
    """Ask for something."""
    page.send(json.dumps({"do": do, "axis": axis, "sent": time.monotonic(), **more}))


@pytest.fixture(scope="module")
def at(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """The server, an operator, and two lookers."""
    with served(tmp_path_factory.mktemp("attacked")) as here:
        operator = Client(here.link)
        with operator.page() as page:
            lookers = [Client(link_of(page)) for _ in range(2)]
        people = {"operator": operator, "looker": lookers[0], "other": lookers[1]}
        yield SimpleNamespace(machine=here.machine, link=here.link, served=here, **people)


def link_of(page: ClientConnection) -> str:
    """A link for one more page that looks on."""
    send(page, "link")
    links: list[str] = []
    until(lambda: links.extend(re.findall(r"http[^\"]+", str(page.recv()))) or links)
    return links[0]


@pytest.fixture
def moving(at: SimpleNamespace) -> Iterator[SimpleNamespace]:
    """Axis x turns for the page with the controls; at the end it is at standstill."""
    with at.operator.page() as page:
        for do in ("take", "enable"):
            send(page, do, sure=True)
        until(lambda: at.machine["x"].state is AxisState.STANDSTILL)
        send(page, "move_velocity", values={"velocity": "50"})
        until(lambda: abs(turns(at.machine)) > 49.0)
        yield SimpleNamespace(page=page, speed=lambda: abs(turns(at.machine)), **vars(at))
        with suppress(ConnectionClosed):
            send(page, "halt_all")
    at.operator.ask("/stop", "POST")
    until(lambda: at.machine["x"].state is AxisState.DISABLED)


def test_strangers_are_refused_on_every_path(at):
    stranger = {"Cookie": "axisbus=1"}
    for path in (
        "/",
        "/own/page.js",
        "/_nicegui_ws/socket.io/?EIO=4&transport=polling",
        "/stop",
        "/objects/1",
        "/nothing",
    ):
        for method in ("GET", "POST"):
            assert at.operator.ask(path, method, **stranger).status == 403
            assert at.operator.ask(path, method, Origin="http://evil.example").status == 403
            assert at.operator.ask(path, method, Host="evil.example").status == 421
    assert at.operator.ask("/").status == 200
    assert at.operator.ask("/enter" + at.operator.path).status == 403
    for path in ("/live", "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"):
        for headers in (stranger, {"Origin": "http://evil.example"}, {"Origin": ""}):
            with pytest.raises(InvalidStatus, match="403"):
                at.operator.page(path, **headers)


def test_an_observer_moves_nothing_and_stops_by_socket_and_by_request(moving):
    with moving.looker.page() as page:
        for do in ("take", "take_over", "disable", "jog", "move_velocity", "move_relative"):
            send(page, do, values={"velocity": "-20", "distance": "5", "direction": "1"})
        time.sleep(0.3)
        assert moving.speed() == pytest.approx(50.0, abs=1.0)
        send(page, "halt")
        until(lambda: moving.speed() < 0.1)
    send(moving.page, "move_velocity", values={"velocity": "50"})
    until(lambda: moving.speed() > 49.0)
    assert moving.looker.ask("/stop", "POST", body="x" * 200_000).status == 204
    until(lambda: moving.speed() < 0.1)


def test_an_observer_reads_objects_and_writes_none(at):
    acceleration = at.machine.simulated_node(1).device.read(0x6083)
    with at.looker.page() as page:
        send(page, "write_object", objects=["1:6083:00"], text="77", values={"agreed": "order energised"})
        send(page, "verify", node=1)
        send(page, "read_objects", objects=["1:6083:00"])
        found: list[Any] = []
        until(lambda: found.extend(json.loads(page.recv(2.0))["own"]["objects"]) or found)
        assert found[0]["value"].startswith(f"{acceleration} = ")
    assert at.machine.simulated_node(1).device.read(0x6083) == acceleration
    assert at.looker.ask("/objects/1").status == 200
    for wrong in ("0", "999", "-1", "x", "9" * 400):
        assert at.looker.ask(f"/objects/{wrong}").status in (200, 422)


def test_large_invalid_or_foreign_files_cost_nothing_and_an_observer_restores_nothing(
    moving,
):
    with moving.looker.page() as page:
        number = json.loads(page.recv(2.0))["own"]["page"]
        for path in (f"/config/file?page={number}", "/scope/mcap"):
            with suppress(ConnectionError):  # it is not waited for
                assert moving.looker.ask(path, "POST", "x" * 10_000_000).status == 413
            for stranger in ({"Origin": "http://evil.example"}, {"Cookie": ""}, {"Origin": ""}):
                assert moving.looker.ask(path, "POST", "junk", **stranger).status == 403
            assert moving.looker.ask(path, "POST", "junk").status == 200
        assert moving.operator.ask(f"/config/file?page={number}", "POST", "junk").status == 404
        assert moving.operator.ask(f"/config/backup?page={number}").status == 404
        for do in ("restore", "compare", "would_restore"):
            send(page, do, node=1)
        told: list[Any] = []
        until(lambda: told.extend(json.loads(page.recv(2.0))["own"]["told"]) or len(told) >= 2)
        assert {each["kind"] for each in told} == {"refused"}
    assert moving.speed() == pytest.approx(50.0, abs=1.0)


def large_dcf() -> str:
    """Return a DCF of almost 2 MB with 59,000 values."""
    head = "[FileInfo]\nFileName=x.dcf\n[DeviceInfo]\nVendorNumber=0\n[DeviceComissioning]\nNodeID=1\n"
    each = "[{:04X}]\nParameterValue=1\nDataType=7\n"
    text = head + "".join(each.format(0x1001 + number) for number in range(59_000))
    assert 0.95 * FILE < len(text) < FILE
    return text


def processor_time(process: int) -> float:
    """Return the processor time (s) of a process without its children."""
    fields = Path(f"/proc/{process}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def file_processes(process: int) -> list[int]:
    """Return the process IDs of the file processes of a server."""
    found = []
    for thread in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):  # it has ended meanwhile
            children = map(Path("/proc").joinpath, thread.read_text("ascii").split())
            found += [int(one.name) for one in children if b"file_process" in (one / "cmdline").read_bytes()]
    return found


def job_of(page: ClientConnection) -> dict[str, Any]:
    """Return the next news of the configuration job."""
    found: list[dict[str, Any]] = []
    until(lambda: found.append(json.loads(page.recv(2.0))["own"]["configured"]) or found[-1], 60.0)
    return found[-1]


@pytest.mark.parametrize("do", ["compare", "would_restore"])
def test_a_large_file_of_an_observer_costs_the_server_little_processor_time(at, do):
    """The server does not parse it: that would take seconds of its processor, and delay the stops and jogs of other pages."""
    server = at.served.web.pid
    with at.looker.page() as page:
        number = json.loads(page.recv(2.0))["own"]["page"]
        began, before = time.monotonic(), processor_time(server)
        time.sleep(1.0)
        idle = (processor_time(server) - before) / (time.monotonic() - began)
        began, before = time.monotonic(), processor_time(server)
        assert at.looker.ask(f"/config/file?page={number}", "POST", large_dcf(), seconds=60.0).status == 200
        send(page, do, node=1)
        until(lambda: job_of(page)["done"], 60.0)
        cost = processor_time(server) - before - idle * (time.monotonic() - began)
        send(page, "job_end")
        until(lambda: job_of(page)["over"])
    assert cost < 0.3


def test_a_file_process_that_hangs_delays_no_stop_and_no_job_of_the_operator(moving):
    with moving.looker.page() as page:
        number = json.loads(page.recv(2.0))["own"]["page"]
        assert (
            moving.looker.ask(f"/config/file?page={number}", "POST", large_dcf(), seconds=60.0).status == 200
        )
        send(page, "compare", node=1)
        until(lambda: file_processes(moving.served.web.pid))
        (file,) = file_processes(moving.served.web.pid)
        os.kill(file, signal.SIGSTOP)
        send(moving.page, "backup", node=1)
        until(lambda: job_of(page)["page"] != number, 5.0)
        until(lambda: file not in file_processes(moving.served.web.pid), 5.0)
        send(moving.page, "job_end")
    assert moving.speed() == pytest.approx(50.0, abs=1.0)
    send(moving.page, "halt")
    until(lambda: moving.speed() < 0.1)


def test_after_ten_thousand_junk_messages_a_stop_still_gets_through(moving):
    for _ in range(10_000):
        moving.page.send("junk")
    send(moving.page, "quick_stop")
    until(lambda: moving.speed() < 0.1, 10.0)


@pytest.mark.parametrize("path", ["/live", "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"])
def test_a_message_that_is_too_large_closes_its_socket_alone(moving, path):
    with moving.operator.page(path) as page:
        page.send("x" * 100_000)
        until(lambda: closed(page))
    assert moving.speed() == pytest.approx(50.0, abs=1.0)


def test_attacks_on_the_page_s_server_cost_no_cycles(moving):
    """Fifty pages, half of which never read, junk from some, objects for all: at most three more cycles are lost than without."""
    machine, crowd = moving.machine, ExitStack()
    quiet = lost(machine)
    with crowd:
        queues = [None] * 25 + [4] * 25
        crowds = [moving.looker, moving.other] * 25
        pages = [
            crowd.enter_context(each.page(queue=queue)) for each, queue in zip(crowds, queues, strict=True)
        ]
        for number, page in enumerate(pages):
            send(page, "keep_reading", objects=[f"{1 + number % 2}:{0x6064 + k:04X}:00" for k in range(8)])
        until_told = time.monotonic() + 2.0
        before = lost(machine, 0.0)
        while time.monotonic() < until_told:
            for page in pages[::5]:
                page.send("junk")
            for page in pages[:25]:
                page.recv(2.0)
        crowded = lost(machine, 0.0) - before
        assert len(moving_values(moving.page)) == 2
        send(pages[0], "quick_stop")
        until(lambda: moving.speed() < 0.1)
    assert crowded <= 2 * quiet + 3


def test_a_page_is_sent_at_most_a_second_more_than_it_has_shown(moving):
    """Data queued for a network that is too slow would be old when they are shown."""
    with moving.looker.page() as page:
        now = json.loads(page.recv(2.0))["own"]["now"]
        send(page, "beat", seen=now)
        more: list[float] = []
        with suppress(TimeoutError):
            while len(more) < 20:
                more.append(json.loads(page.recv(2.0))["own"]["now"])
        assert 0.9 < more[-1] - now < 1.7
        send(page, "beat", seen=more[-1])
        assert json.loads(page.recv(5.0))["own"]["now"] > more[-1] + 0.4


def test_one_page_too_many_is_refused_but_can_still_stop_and_other_browsers_get_their_pages(moving):
    with ExitStack() as crowd:
        opened = 0
        for each in (moving.looker, moving.other):
            with suppress(InvalidStatus):
                for _ in range(100):
                    crowd.enter_context(each.page())
                    opened += 1
        assert 50 < opened < 65
        with moving.operator.page() as again:
            assert json.loads(again.recv(5.0))["own"]["role"] == "operator"
        assert moving.looker.ask("/stop", "POST").status == 204
        until(lambda: moving.speed() < 0.1)


def test_ctrl_c_ends_a_server_with_its_own_machine_and_a_page_that_jogs(tmp_path):
    """Where it has opened the machine: that is stopped and gone, promptly, whatever the page holds and does not hear."""
    file = own_cell(tmp_path, "x")
    with Popen(
        [sys.executable, "-u", "-m", "axisbus", "web", str(file), "--port", "0"],
        stdout=PIPE,
        stderr=PIPE,
        text=True,
    ) as web:
        client = Client(str(re.search(r"http\S+", web.stdout.readline())[0]))
        with client.page() as page, Machine.attach(file) as looking:
            for do in ("take", "enable"):
                send(page, do, sure=True)
            until(lambda: looking["x"].state is AxisState.STANDSTILL)
            for _ in range(10):
                send(page, "jog", press=1, values={"direction": "1"})
                time.sleep(0.05)
            assert looking["x"].state is AxisState.CONTINUOUS_MOTION
            web.send_signal(signal.SIGINT)
            assert until(lambda: web.poll() is not None, 10.0) < 5.0
        assert (web.returncode, web.stderr.read().strip()) == (130, "axisbus: stopped")
    assert Machine.try_attach(file) is None


def lost(machine: Any, seconds: float = 2.0) -> int:
    """How many cycles are skipped in a time; with none, how many were so far."""
    before = machine.cycle_jitter.skipped if seconds else 0
    time.sleep(seconds)
    return int(machine.cycle_jitter.skipped) - before


def closed(page: ClientConnection) -> bool:
    """Whether a socket has been closed at the other end."""
    try:
        page.recv(0.5)
    except ConnectionClosed:
        return True
    return False


def moving_values(page: ClientConnection) -> dict[str, Any]:
    """The axes in the latest state that a page has received."""
    axes: dict[str, Any] = json.loads(page.recv(5.0))["axes"]
    return axes


def test_the_server_has_printed_only_that_it_joined(at):
    assert at.served.errors.read_text("utf-8") == "joined the running machine; this command has control\n"


def test_axes_are_halted_for_a_suspended_server_and_its_late_requests_are_ignored(moving):
    """Suspended (SIGSTOP) while an axis turns for a page; its requests meanwhile wait in its socket, and are not executed."""
    moving.served.web.send_signal(signal.SIGSTOP)
    try:
        took = until(lambda: moving.speed() < 0.1)
        send(moving.page, "move_velocity", values={"velocity": "50"})
        time.sleep(1.3)
    finally:
        moving.served.web.send_signal(signal.SIGCONT)
    assert took < 3.0  # 0.3 s and its ramp, and the time that a busy computer takes
    told: list[str] = []
    until(lambda: told.extend(texts_of(moving.page)) or any("late" in text for text in told))
    assert moving.speed() < 0.1
    assert moving.machine["x"].state is AxisState.STANDSTILL


def texts_of(page: ClientConnection) -> list[str]:
    return [each["text"] for each in json.loads(page.recv(2.0))["own"]["told"]]
