"""How a core is found and which programs it admits: by information of the kernel about both sides, not by their environment."""

from __future__ import annotations

import json
import os
import socket
import sys
import threading
from contextlib import contextmanager, suppress

import pytest

from axisbus.bus.link.claims import CellFileId, claim
from axisbus.core.process import listener
from axisbus.core.process.listener import ClientListener, StopAnswer, StopRequest
from axisbus.errors import ScanError
from axisbus.link import StopResult
from kit.other_user import STRANGER, as_user, needs_root

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="claims are of Linux"),
    pytest.mark.timeout(60),
]
STANDS = StopAnswer((StopResult("x", True, "stands"),), "a text")


@pytest.fixture
def cell(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text("", encoding="utf-8")
    return str(path)


class Core:
    """The acceptor of a core, without a machine: it answers each request to stop, and notes the callers."""

    def __init__(self, cell, answer=STANDS):
        self.held = claim(None, CellFileId.of(cell), exclusive=False, accepts_clients=True)
        self.listening = socket.socket(fileno=os.dup(self.held.fileno()))
        self.door = ClientListener(self.listening)
        self.answer = answer
        self.callers = []
        self.thread = threading.Thread(target=self._run, daemon=True)

    def _run(self):
        for caller in self.door.callers():
            self.callers.append(caller)
            if caller.stop is not None:
                with caller.line, suppress(OSError):
                    listener.answer_stop(caller.line, 1.0)
                    listener.answer_stop(caller.line, self.answer)


@contextmanager
def served(cell, answer=STANDS):
    core = Core(cell, answer)
    core.thread.start()
    try:
        yield core
    finally:
        core.door.close()
        core.thread.join(10)
        core.listening.close()
        core.held.close()
        for caller in core.callers:
            caller.line.close()


def said(claim, words):
    """A connection to a core by which something has been said."""
    line = socket.socket(socket.AF_UNIX)
    line.connect(claim.name)  # waits where the queue is full
    line.settimeout(5.0)
    line.sendall(words)
    return line


def test_a_machine_is_found_by_its_file_under_every_name_and_after_the_file_was_saved_again(
    cell, tmp_path, monkeypatch
):
    with served(cell):
        (found,) = listener.machines_of(cell)
        (tmp_path / "link.toml").symlink_to(cell)
        os.link(cell, tmp_path / "second.toml")
        for name in ("link.toml", "second.toml"):
            assert listener.machines_of(str(tmp_path / name)) == [found]
        monkeypatch.chdir(tmp_path)
        assert listener.machines_of("cell.toml") == [found]
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
        monkeypatch.delenv("HOME", raising=False)
        assert listener.machines_of("cell.toml") == [found]
        (tmp_path / "new.toml").write_text("# other", encoding="utf-8")
        (tmp_path / "new.toml").rename(cell)  # as editors do
        assert listener.machines_of(cell) == [found]
        os.rename(cell, tmp_path / "elsewhere.toml")
        assert listener.machines_of(str(tmp_path / "second.toml")) == [found]
    assert listener.machines_of(cell) == []


def test_another_cell_file_of_the_same_text_is_another_machine(cell, tmp_path):
    other = tmp_path / "other.toml"
    other.write_text("", encoding="utf-8")
    with served(cell):
        assert listener.machines_of(str(other)) == []
        assert listener.connect(str(other)) is None


def test_the_oldest_machine_is_the_first_one(cell):
    with served(cell) as first, served(cell) as second:
        assert [each.name for each in listener.machines_of(cell)] == [first.held.name, second.held.name]


def test_a_request_to_stop_is_answered_with_the_observed_states(cell):
    with served(cell) as core:
        (found,) = listener.machines_of(cell)
        assert listener.ask_to_stop(found, StopRequest(("x", "y"), quick=False), 5.0) == STANDS
    assert [each.stop for each in core.callers] == [StopRequest(("x", "y"), quick=False)]
    assert core.callers[0].process == os.getpid()


def test_a_request_received_byte_by_byte_is_one(cell):
    with served(cell) as core:
        (found,) = listener.machines_of(cell)
        with said(found, b"") as line:
            for byte in StopRequest(("x",)).pack():
                line.sendall(bytes([byte]))
            assert json.loads(line.makefile().readline()) == 1.0
    assert [each.stop for each in core.callers] == [StopRequest(("x",))]


@pytest.mark.parametrize(
    "words",
    [
        b"x",
        b"s\x02\x00{}",
        b"s\x02\x00\xff\xff",
        b"s\x04\x00[1]]",
        b"s\x01\x00[",
        b"s\x00\x40" + b"[" * 0x4000,  # nested too deeply; the acceptor must continue
    ],
    ids=range(6),
)
def test_an_invalid_request_closes_the_connection_without_effect(cell, words):
    with served(cell) as core:
        (found,) = listener.machines_of(cell)
        with said(found, words) as line, suppress(ConnectionResetError):
            assert line.recv(1) == b""
        assert listener.ask_to_stop(found, StopRequest(), 5.0) == STANDS
    assert [each.stop for each in core.callers] == [StopRequest()]


def test_any_number_of_silent_connections_do_not_block_a_request_to_stop(cell):
    with served(cell) as core:
        (found,) = listener.machines_of(cell)
        silent = [said(found, b"s" if number % 2 else b"") for number in range(3 * listener._MAX_PENDING)]
        assert listener.ask_to_stop(found, StopRequest(), 5.0) == STANDS
        assert (
            0 < len(core.door._pending) <= listener._MAX_PENDING
        )  # else they would take every descriptor of the core
        for line in silent:
            line.close()


def test_a_request_to_stop_is_taken_while_others_connect_repeatedly(cell):
    over = threading.Event()

    def flood(found):
        lines = []
        while not over.is_set():
            line = socket.socket(socket.AF_UNIX)
            line.setblocking(False)
            with suppress(OSError):
                line.connect(found.name)
            lines.append(line)
            if len(lines) > 20:
                lines.pop(0).close()
        for line in lines:
            line.close()

    with served(cell):
        (found,) = listener.machines_of(cell)
        threads = [threading.Thread(target=flood, args=(found,), daemon=True) for _ in range(2)]
        for thread in threads:
            thread.start()
        try:
            for _ in range(5):
                assert listener.ask_to_stop(found, StopRequest(), 10.0) == STANDS
        finally:
            over.set()
            for thread in threads:
                thread.join(10)


def test_a_core_that_does_not_answer_or_ends_is_not_reported_as_no_core(cell):
    with claim(None, CellFileId.of(cell), exclusive=False, accepts_clients=True):
        (found,) = listener.machines_of(cell)
        with pytest.raises(ScanError) as caught:
            listener.ask_to_stop(found, StopRequest(), 0.2)
        assert "does not answer" in caught.value.observed
    with pytest.raises(ScanError) as caught:
        listener.ask_to_stop(found, StopRequest(), 0.2)
    assert "is ending" in caught.value.observed


def test_a_core_whose_queue_is_full_is_not_reported_as_no_core(cell):
    with claim(None, CellFileId.of(cell), exclusive=False, accepts_clients=True):
        (found,) = listener.machines_of(cell)
        waiting = []
        with suppress(BlockingIOError):
            while True:
                waiting.append(socket.socket(socket.AF_UNIX))
                waiting[-1].setblocking(False)
                waiting[-1].connect(found.name)
        assert [each.name for each in listener.machines_of(cell)] == [found.name]
        with pytest.raises(ScanError) as caught:
            listener.ask_to_stop(found, StopRequest(), 0.2)
        assert "does not answer" in caught.value.observed
        for line in waiting:
            line.close()


@pytest.mark.parametrize(
    "words",
    [
        b"",
        b"null\n",
        b"1.0\n",
        b"1.0\n[]\n",
        b"1.0\n{}\n",
        b'1.0\n[[["x", 1, "stands"]], ""]\n',
        b"1.0\n" + b"[" * 20_000 + b"\n",
    ],
    ids=range(7),
)
def test_an_answer_without_the_state_of_axes_is_no_success(cell, words):
    with claim(None, CellFileId.of(cell), exclusive=False, accepts_clients=True) as held:
        (found,) = listener.machines_of(cell)
        listening = socket.socket(fileno=os.dup(held.fileno()))

        def answer():
            while True:  # a program that only looks who listens sends nothing
                line, _ = listening.accept()
                with line:
                    if line.recv(100):
                        line.sendall(words)
                        return

        thread = threading.Thread(target=answer)
        thread.start()
        try:
            answered = listener.ask_to_stop(found, StopRequest(), 5.0)
        except ScanError:
            answered = StopAnswer(())
        thread.join(10)
        listening.close()
    assert not any(each.ok for each in answered.axes)


# -- other users -----------------------------------------------------------------------------------------------------------------


def impostor(cell):
    """Another program that claims to run a machine of this cell file, and answers that all axes are at standstill."""
    core = Core(cell)
    core.thread.start()
    return core


@needs_root
def test_a_machine_of_another_user_is_found_and_neither_joined_nor_trusted(cell):
    os.chmod(os.path.dirname(cell), 0o755)
    with as_user(lambda: impostor(cell)):
        (found,) = listener.machines_of(cell)
        assert found.user == STRANGER
        assert not listener.is_trusted(found, cell)
        assert f"of user {STRANGER}" in listener.why_not_joinable(found, cell)
        assert listener.connect(cell) is None


@needs_root
def test_root_may_stop_a_machine_of_the_owner_of_the_cell_file(cell):
    os.chmod(os.path.dirname(cell), 0o755)
    os.chown(cell, STRANGER, STRANGER)
    with as_user(lambda: impostor(cell)):
        (found,) = listener.machines_of(cell)
        assert listener.why_not_joinable(found, cell) == ""
        assert listener.ask_to_stop(found, StopRequest(), 5.0) == STANDS


def insist(claim):
    """Another user's connections to a core, as far as they were not closed before anything could be said."""
    lines = []
    for _ in range(20):
        with suppress(OSError):
            lines.append(said(claim, StopRequest().pack()))
    return lines


@needs_root
def test_a_request_of_another_user_is_refused_whatever_it_contains(cell):
    with served(cell) as core:
        (found,) = listener.machines_of(cell)
        with as_user(lambda: insist(found)):
            assert listener.ask_to_stop(found, StopRequest(("mine",)), 5.0) == STANDS
    assert [each.stop for each in core.callers] == [StopRequest(("mine",))]
