"""The keys that bytes of a terminal mean."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from types import SimpleNamespace

import pytest

from axisbus.cli import jog
from axisbus.cli.jog import Keyboard, TerminalKey, TerminalKeyReader, keyboard
from axisbus.errors import StateError


@pytest.mark.parametrize(
    ("data", "key"),
    [
        (b"\x1b[C", TerminalKey.FORWARD),
        (b"\x1bOA", TerminalKey.FORWARD),
        (b"\x1b[D", TerminalKey.BACK),
        (b"\x1b[B", TerminalKey.BACK),
        (b" ", TerminalKey.HALT),
        (b"q", TerminalKey.QUIT),
        (b"\x04", TerminalKey.QUIT),
        (b"x", None),
        (b"\x1b[5~", None),
        (b"", None),
    ],
)
def test_bytes_are_decoded_to_keys(data, key):
    assert TerminalKeyReader().feed(data) is key


def test_of_many_at_once_the_last_one_counts():
    assert TerminalKeyReader().feed(b"\x1b[C\x1b[C\x1b[D") is TerminalKey.BACK


@pytest.mark.parametrize(
    ("data", "key"), [(b" \x1b[C", TerminalKey.HALT), (b"\x1b[C q\x1b[C", TerminalKey.QUIT)]
)
def test_halt_takes_precedence_over_all_keys_but_quit(data, key):
    assert TerminalKeyReader().feed(data) is key


def test_a_key_received_in_parts_is_one_key():
    keys = TerminalKeyReader()
    assert [keys.feed(bytes([each])) for each in b"\x1b[C"] == [None, None, TerminalKey.FORWARD]


def test_an_incomplete_key_is_dropped_and_the_next_byte_counts():
    keys = TerminalKeyReader()
    assert keys.feed(b"\x1b") is None
    assert keys.feed(b"q") is TerminalKey.QUIT


@pytest.fixture
def ends():
    ours, theirs = os.pipe()
    yield ours, theirs
    for end in (ours, theirs):
        with contextlib.suppress(OSError):  # a test may have closed it
            os.close(end)


def test_a_keyboard_waits_no_longer_than_its_timeout_and_returns_none(ends):
    assert Keyboard(ends[0]).read(0.01) is None
    os.write(ends[1], b"\x1b[D")
    assert Keyboard(ends[0]).read(5.0) is TerminalKey.BACK


def test_keys_that_have_waited_while_the_command_was_suspended_move_nothing(ends, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(jog, "time", SimpleNamespace(monotonic=lambda: now[0]))
    keys = Keyboard(ends[0])
    for waited, pressed, key in (
        (10.0, b"\x1b[C", None),
        (0.2, b"\x1b[C", TerminalKey.FORWARD),
        (10.0, b"\x1b[C ", TerminalKey.HALT),
        (10.0, b"q", TerminalKey.QUIT),
    ):
        os.write(ends[1], pressed)
        now[0] += waited
        assert keys.read(0.05) is key


def test_a_closed_terminal_counts_as_the_quit_key(ends):
    os.close(ends[1])
    assert Keyboard(ends[0]).read(5.0) is TerminalKey.QUIT


def test_without_a_terminal_there_are_no_keys(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO("q"))
    with pytest.raises(StateError, match="standard input is not a terminal"), keyboard():
        pass
