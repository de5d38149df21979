"""Tests run in a process of their own, which says through a pipe how far it has come."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

import pytest

LEAST_TIME = 8.0  # seconds that each test may take, whatever it took when it was measured ...
TIMES_SLOWER = 4.0  # ... and how much longer than then: more is an endless loop


@dataclass(frozen=True)
class Ran:
    """How a run of tests ended: ``failed`` names the test that did not pass, ``how`` it did not."""

    failed: str | None
    how: str = ""
    count: int = 0


class _Watch:
    """A plugin that remembers whether a test has failed."""

    def __init__(self) -> None:
        self.failed = False

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a failure of any part."""
        self.failed = self.failed or report.failed


def run_items(items: Sequence[pytest.Item], write: int) -> None:
    """Run tests one after the other until one fails, and report each through the pipe ``write``."""
    watch = _Watch()
    items[0].config.pluginmanager.register(watch)
    for item, after in zip(items, [*items[1:], None], strict=True):
        _tell(write, "began", item.nodeid)
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
        if watch.failed:
            _tell(write, "failed", item.nodeid)
            return
    _tell(write, "passed", "")


def _tell(write: int, what: str, test: str) -> None:
    os.write(write, json.dumps([what, test]).encode() + b"\n")


def become_quiet() -> None:
    """Discard the output of this process and its children."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2):
        os.dup2(nowhere, descriptor)


def watch_over(pid: int, read: int, times: dict[str, float], first: float = 0.0) -> Ran:
    """Follow the process ``pid`` by its pipe until it has ended, and end it where a test takes too long.

    ``first``: seconds that may pass before the first test begins.
    """
    test, count, rest, ended = "", 0, b"", None
    until = time.monotonic() + LEAST_TIME + first
    while ended is None:
        if not select.select([read], [], [], max(0.0, until - time.monotonic()))[0]:
            ended = Ran(test, "takes too long", count)
            break
        data = os.read(read, 65536)
        if not data:
            ended = Ran(test, "ends the process", count)
        *lines, rest = (rest + data).split(b"\n")
        for what, test in map(json.loads, lines):
            if what == "began":
                count += 1
                until = time.monotonic() + LEAST_TIME + TIMES_SLOWER * times.get(test, 0.0)
            else:
                ended = Ran(test, "fails", count) if what == "failed" else Ran(None, "", count)
                break
    _end(pid)
    return ended


def _end(pid: int) -> None:
    """End a process and its group."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)
    with contextlib.suppress(ChildProcessError):
        os.waitpid(pid, 0)
    sys.stdout.flush()
