"""``axisbus web`` in a process of its own, beside a program that has opened the machine."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from axisbus.machine.machine import Machine
from kit.scenarios.core_process import own_cell


def until(seen: Callable[[], Any], within: float = 20.0) -> float:
    """Wait until something is seen, and return how long it took; fails after ``within`` seconds."""
    began = time.monotonic()
    while not seen():
        assert time.monotonic() - began < within, "it was not seen"
        time.sleep(0.01)
    return time.monotonic() - began


@dataclass(frozen=True)
class ServedDrives:
    """The machine, with its plants in this program; the page's process and first link, and its error output."""

    machine: Machine
    web: subprocess.Popen[str]
    link: str
    errors: Path


@contextmanager
def served(folder: Path, axis: str = "") -> Iterator[ServedDrives]:
    """Open a cell of two axes, x and y, and serve its page, which has control; the process is killed at the end.

    ``axis`` are lines for each of them.
    """
    file = own_cell(folder, axis=f"rated_torque = 10.0\n{axis}")
    command = [sys.executable, "-u", "-m", "axisbus", "web", str(file), "--port", "0"]
    errors = folder / "errors.txt"
    with (
        errors.open("w", encoding="utf-8") as written,
        Machine.open(file, shared=True) as machine,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=written, text=True) as web,
    ):
        assert web.stdout is not None
        try:
            found = re.search(r"http\S+", web.stdout.readline())
            assert found, errors.read_text("utf-8")
            yield ServedDrives(machine, web, found[0], errors)
        finally:
            web.kill()
