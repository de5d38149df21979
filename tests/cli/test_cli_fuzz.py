"""Random command lines over all commands: wrong paths, values, permissions and broken outputs end in words, not in a traceback."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import random
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from axisbus.bus.link import adapter
from axisbus.cli.bridge import opcua
from axisbus.cli.main import cli
from axisbus.cli.shared.common import run
from axisbus.core import sim_server
from axisbus.errors import AdapterError
from axisbus.fleet import network
from axisbus.gateway import metrics_server as metrics
from kit import command_line

CODES = {0, 1, 2, 3, 130}
ROUNDS = int(os.environ.get("AXISBUS_CLI_FUZZ", "12"))  # of LINES command lines each
LINES = 25

PATHS = (
    "drive.eds",
    "drive.eds",
    "drive.eds",
    "drive.eds",
    "x.dcf",
    "cell.toml",
    "cell.toml",
    "cell.toml",
    "hard.toml",
    "run.log",
    "x.bin",
    "broken.toml",
    "empty",
    "noise",
    "late.eds",
    "locked",
    "folder",
    "folder/new",
    "empty/below",
    "none/deep/new",
    "missing",
    "",
    "-",
    ".",
    "/",
    "/proc/x",
    "/proc/self/mem",
    "n" * 300,
    "~",
    "a b",
    "é.eds",
    "\udcff.eds",
    "*.eds",
    "[",
    "builtin:",
    "builtin:generic-cia402",
    "builtin:../x",
    "new.html",
    "new.md",
    "new.py",
    "new.csv",
    "new.dbc",
    "new.json",
    "1.blf",
    "1.asc",
)
VALUES = (
    "",
    "0",
    "1",
    "5",
    "127",
    "128",
    "255",
    "-1",
    "-0",
    "1.5",
    "nan",
    "inf",
    "-inf",
    "1e400",
    "9" * 40,
    "0x10",
    "0x",
    "1_0",
    "٣",
    "x",
    "y=1",
    "x=1",
    "x=",
    "=1",
    "x=nan",
    "w",
    "xyz",
    "all",
    "start",
    "reset-node",
    "500000",
    "socketcan",
    "virtual",
    "pcan",
    "can0",
    "key=1",
    "=",
    "5:6041",
    "x:Statusword",
    "x:6081",
    "5:",
    ":6041",
    "x:6041:0:0",
    "x:1018:99",
    "1018:1",
    "6041",
    "0x6081=1",
    "6081=z",
    "=6081",
    "5=drive.eds",
    "drive.eds",
    "999=drive.eds",
    "node=1",
    "kind=sdo",
    "object=",
    "u32",
    "u99",
    "V003",
    "V",
    "error",
    "@missing",
    "@drive.eds",
    "zz",
    "é",
    "\udcff",
    "x\n",
    "--",
    "--json",
    "-h",
    "--nonsense",
    "-o",
    "90 deg",
    "1e3 deg/s",
    "00 ff",
)


class Breaks(io.RawIOBase):
    """An output that takes so many bytes and then fails."""

    def __init__(self, room: int, number: int) -> None:
        super().__init__()
        self._room, self._number = room, number

    def writable(self) -> bool:
        return True

    def write(self, data) -> int:
        self._room -= len(data)
        if self._room < 0:
            raise OSError(self._number, os.strerror(self._number))
        return len(data)


def leaves(
    group: click.Group, words: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    for name in group.list_commands(click.Context(group)):
        command = group.get_command(click.Context(group), name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from leaves(command, (*words, name))
        else:
            yield (*words, name), command


COMMANDS = tuple(leaves(cli))


def arguments(chance: random.Random, command: click.Command) -> Iterator[str]:
    """A command line that is nearly right: most arguments are there, some options, and values of the wrong kind among them."""
    for each in command.params:
        if isinstance(each, click.Argument):
            many = chance.choice((1, 1, 2, 3)) if each.nargs == -1 else int(chance.random() < 0.95)
            for _ in range(many):
                yield value(chance, each)
            continue
        usual = each.name in ("interface", "channel", "cell") and chance.random() < 0.4
        if usual or chance.random() < 0.15:
            yield max(each.opts, key=len) if chance.random() < 0.7 else each.opts[0]
            if not getattr(each, "is_flag", False):
                yield from (value(chance, each) for _ in range(each.nargs))
    if chance.random() < 0.05:
        yield chance.choice(VALUES)


def value(chance: random.Random, each: click.Parameter) -> str:
    if isinstance(each.type, click.Choice) and chance.random() < 0.8:
        return chance.choice(list(each.type.choices))
    fits = {
        "cell": "cell.toml",
        "file": "drive.eds",
        "node": "5",
        "interface": "virtual",
        "bitrate": "500000",
        "a": "drive.eds",
        "b": "x.dcf",
    }
    if each.name in fits and chance.random() < 0.6:
        return fits[each.name]
    return chance.choice(PATHS if chance.random() < 0.5 else VALUES)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The files named on command lines: good and bad files; each round gets a fresh copy."""
    folder = tmp_path_factory.mktemp("fuzz")
    eds = (command_line.ROOT / "eds" / "generic-cia402.eds").read_bytes()
    (folder / "drive.eds").write_bytes(eds)
    (folder / "late.eds").write_bytes(eds[: len(eds) // 3])
    (folder / "noise").write_bytes(random.Random(1).randbytes(500))
    (folder / "x.bin").write_bytes(b"\x01\0\0\0\x81\x60\0\x04\0\0\0\x10\0\0\0")
    (folder / "empty").write_bytes(b"")
    (folder / "run.log").write_text(
        "(1.0) can0 181#0000\n(1.1) can0 701#05\nnonsense\n(1.2) can0 601#4041600000000000\n"
    )
    (folder / "locked").write_text("")
    (folder / "locked").chmod(0)
    (folder / "folder").mkdir()
    text = Path(command_line.CELL).read_text("utf-8")
    (folder / "cell.toml").write_text(text, "utf-8")
    (folder / "hard.toml").write_text(text.replace('"sim"', '"virtual"\nchannel = "c"'), "utf-8")
    (folder / "broken.toml").write_text(
        text.replace("builtin:gim6010-8", "late.eds").replace("[axes.x]", "[axes.x"), "utf-8"
    )
    return folder


@pytest.fixture
def place(files, tmp_path, monkeypatch):
    folder = tmp_path / "here"
    shutil.copytree(files, folder)
    monkeypatch.chdir(folder)

    def nobody(*_, **__):
        raise AdapterError("there is no adapter here")

    monkeypatch.setattr(adapter, "open_adapter", nobody)
    monkeypatch.setattr(sim_server, "Server", nobody)  # else ``axisbus sim`` would serve on, as it should
    monkeypatch.setattr(metrics, "MetricsServer", nobody)  # and ``axisbus bridge metrics``
    monkeypatch.setattr(opcua, "make_server", nobody)  # and ``axisbus bridge opcua``
    monkeypatch.setattr(network, "opened", nobody)  # and ``axisbus bridge zenoh``, ``axisbus fleet``
    return folder


def one(line: list[str], out: io.TextIOWrapper) -> tuple[int | None, str]:
    """Run one command line; return the exit code (None: it ended as by a broken pipe), and its error output."""
    err = io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace", write_through=True)
    kept = sys.argv, sys.stdin, sys.stdout, sys.stderr
    sys.argv = ["axisbus", *line]
    sys.stdin = io.TextIOWrapper(io.BytesIO(b"(1.0) can0 181#00\n"))
    sys.stdout, sys.stderr = out, err
    try:
        code: int | None = run(cli)
    except SystemExit:
        code = None
    finally:
        sys.argv, sys.stdin, sys.stdout, sys.stderr = kept
    return code, err.buffer.getvalue().decode("utf-8", "replace")


def outputs(chance: random.Random) -> tuple[io.TextIOWrapper, bool]:
    """An output, and whether it will break."""
    kind = chance.random()
    if kind < 0.15:
        number = chance.choice((errno.EPIPE, errno.ENOSPC))
        return io.TextIOWrapper(io.BufferedWriter(Breaks(chance.choice((0, 1, 200)), number)), "utf-8"), True
    return io.TextIOWrapper(io.BytesIO(), "cp866" if kind < 0.3 else "utf-8"), False


@pytest.mark.parametrize("number", range(ROUNDS))
def test_no_command_line_ends_in_a_traceback(place, number):
    chance = random.Random(number)
    for _ in range(LINES):
        words, command = chance.choice(COMMANDS)
        line = [*words, *arguments(chance, command)]
        out, breaks = outputs(chance)
        try:
            code, err = one(line, out)
        except BaseException as error:
            raise AssertionError(f"axisbus {line} ended in {error!r}") from error
        assert (code in CODES) or (breaks and code is None), (line, code)
        assert "Traceback" not in err, (line, err)
        if not breaks and code in (2, 3):
            assert err.strip() or out.buffer.getvalue(), line
        with contextlib.suppress(OSError):
            out.close()
    assert not list(place.rglob("*.new"))
