"""The command line in this process and in others, and simulated drives on a private virtual bus that it can be pointed at."""

from __future__ import annotations

import atexit
import io
import itertools
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from axisbus.cli.main import cli
from axisbus.cli.shared.common import run
from axisbus.clock import REAL, poll_until
from axisbus.eds import load
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork

ROOT = Path(__file__).parents[2]
_OWN = tempfile.mkdtemp(prefix="axisbus-cell-")  # a machine of another worker's copy is not this one's
atexit.register(shutil.rmtree, _OWN, ignore_errors=True)
CELL = shutil.copy(ROOT / "examples" / "cell.toml", _OWN)
GENERIC = "builtin:generic-cia402"
_channels = (f"cli-{os.getpid()}-{number}" for number in itertools.count())


class Result(NamedTuple):
    """The result of a command."""

    code: int
    out: str
    err: str


Run = Callable[..., Result]


def runner(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Return a function that runs the command line: ``axisbus("od", "read", ..., stdin="")``."""

    def call(*arguments: object, stdin: str = "") -> Result:
        monkeypatch.setattr(sys, "argv", ["axisbus", *map(str, arguments)])
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin.encode())))
        code = run(cli)
        seen = capsys.readouterr()
        return Result(code, seen.out, seen.err)

    return call


def started(*arguments: object, stderr: int | None = subprocess.PIPE) -> subprocess.Popen[str]:
    """Start the command line in a process of its own, with pipes for its output and, unless ``stderr`` is None, its errors."""
    command = [sys.executable, "-m", "axisbus", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True)


@contextmanager
def simulating(*arguments: object) -> Iterator[subprocess.Popen[str]]:
    """Run ``axisbus sim`` on a free port in a process of its own."""
    with started("sim", "--port", "0", *arguments, stderr=None) as sim:
        try:
            yield sim
        finally:
            sim.kill()


def lines_before(process: subprocess.Popen[str], words: str) -> list[str]:
    """Read the lines of a process up to one that contains ``words``, and return them with it."""
    assert process.stdout is not None
    lines = [process.stdout.readline()]
    while words not in lines[-1]:
        assert lines[-1], lines
        lines.append(process.stdout.readline())
    return lines


@contextmanager
def drives(*node_ids: int) -> Iterator[tuple[SimulatedNetwork, str]]:
    """Generic drives on a private channel, which have started; yields them and the channel's name."""
    eds = load(GENERIC)
    name = next(_channels)
    with SimulatedNetwork(
        name, [device_from_eds(eds, node_id, seed=node_id) for node_id in node_ids]
    ) as simulated_nodes:
        until(lambda: all(each.drives[0].statusword & 0x6F == 0x40 for each in simulated_nodes.devices))
        yield simulated_nodes, name


def until(happened: Callable[[], bool]) -> None:
    """Wait for simulated drives, for 20 seconds at the most."""
    assert poll_until(REAL, happened, REAL.now() + 20.0, 0.01)
