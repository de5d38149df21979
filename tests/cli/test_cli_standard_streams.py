"""Outputs as a shell connects them: pipes without a reader, full disks, closed streams, few characters; devices as files."""

from __future__ import annotations

import os
import subprocess
import sys

import click
import pytest

from axisbus.cli.shared.common import run
from axisbus.cli.shared.output import require_writable, write_whole
from axisbus.errors import ArgumentError, BusError, StateError
from kit import command_line

SHOW = ("eds", "show", "builtin:gim6010-8")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a shell of Unix connects them")


def shell(command: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run ``command`` with ``axisbus`` in it, and return its outputs."""
    program = f'{sys.executable} -m axisbus "$@"'
    return subprocess.run(
        ["bash", "-c", command.replace("axisbus", program), "bash", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env={**os.environ, **environment},
    )


def test_a_pipe_without_a_reader_ends_without_an_error():
    ran = shell("set -o pipefail; axisbus | head -0", *SHOW)
    assert (ran.returncode in (0, 1, 3), ran.stdout, ran.stderr) == (True, "", "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no full device")
def test_a_disk_that_is_full():
    ran = shell("axisbus >/dev/full", *SHOW)
    assert (ran.returncode, ran.stderr) == (
        3,
        "axisbus: the output cannot be used: No space left on device\n",
    )
    assert shell("axisbus >/dev/full 2>/dev/full", *SHOW).returncode == 3


def test_streams_that_are_closed():
    assert shell("axisbus >&-", "check", command_line.CELL).returncode == 0
    assert shell("axisbus 2>&-", "check", "nothing.toml").returncode == 1


def test_a_terminal_without_the_characters():
    ran = shell(
        "axisbus",
        "move",
        command_line.CELL,
        "x=1",
        "--home",
        "--velocity",
        "nan",
        "-h",
        PYTHONIOENCODING="cp866",
    )
    assert ran.returncode == 0
    assert "\\xb2" in ran.stdout


def test_a_device_is_written_to_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    require_writable(pipe)
    reader = subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE)
    write_whole(pipe, b"all of it")
    assert reader.communicate(timeout=10)[0] == b"all of it"
    assert pipe.is_fifo()


def test_a_link_stays_and_so_do_permissions(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    write_whole(link, b"new")
    assert (link.is_symlink(), target.read_text(), target.stat().st_mode & 0o777) == (True, "new", 0o640)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["link", "target"]


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (ArgumentError("a"), 2, ["axisbus: a"]),
        (
            ExceptionGroup("g", [StateError("a"), ExceptionGroup("h", [BusError("b")])]),
            3,
            ["axisbus: a", "axisbus: b"],
        ),
        (FileNotFoundError(2, "No such file", "x.eds"), 3, ["axisbus: x.eds cannot be used: No such file"]),
        (TimeoutError("x: not ended after 5 s"), 3, ["axisbus: x: not ended after 5 s"]),
        (KeyboardInterrupt(), 130, ["axisbus: stopped"]),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_how_a_command_ends(monkeypatch, capsys, error, code, words):
    @click.command()
    def command():
        raise error

    monkeypatch.setattr(sys, "argv", ["axisbus"])
    assert run(command) == code
    said = capsys.readouterr().err
    assert [word for word in words if word not in said] == []


def test_a_mistake_of_the_program_is_not_hidden(monkeypatch):
    @click.command()
    def command():
        raise ZeroDivisionError

    monkeypatch.setattr(sys, "argv", ["axisbus"])
    with pytest.raises(ZeroDivisionError):
        run(command)
