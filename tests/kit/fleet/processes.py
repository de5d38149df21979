"""Simulated cells as a plant has them: a machine that runs, and its bridge, each a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from kit.fleet.zenoh_network import free_endpoint
from kit.scenarios.core_process import own_cell


def tree(pid):
    """Return the identifiers of a process and of all that descend from it."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
    found = {pid}
    while more := {child for child, parent in parents.items() if parent in found} - found:
        found |= more
    return found


class ProcessCell:
    """The processes of one cell; ``end`` ends them as Ctrl-C does, ``kill`` as a power cut."""

    def __init__(
        self, folder: Path, name: str, plant: str = "hall", axes: str = "xy", text: str = ""
    ) -> None:
        """``text``: of its cell file, if it is not the usual one."""
        folder = folder / name
        folder.mkdir()
        self.name, self.plant = name, plant
        self._logs = 0
        self.endpoint = free_endpoint()
        # Slow cycles: values are valid for 0.25 s, so that a computer that pauses all processes for 0.1 s stops no axis.
        self.file = own_cell(folder, axes, period="50ms")
        if text:
            self.file.write_text(text, "utf-8")
        self._begun = []
        try:
            self.machine = self._begin("run", str(self.file), until="the machine runs")
            self.bridge = self.begin_bridge()
        except BaseException:
            self.kill()
            raise

    def begin_bridge(self):
        words = ("--plant", self.plant, "--cell", self.name, "--listen", self.endpoint)
        self.bridge = self._begin("bridge", "zenoh", str(self.file), *words, until="joined")
        return self.bridge

    def _begin(self, *words, until):
        self._logs += 1
        log = self.file.with_name(f"{self._logs}.log")  # a pipe that is not read would block it
        with log.open("w") as out:
            program = subprocess.Popen(
                [sys.executable, "-u", "-m", "axisbus", *words],
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C is for the test alone
            )
        self._begun.append(program)
        while until not in log.read_text():
            assert program.poll() is None, f"{words} ended: {log.read_text()}"
            time.sleep(0.02)
        return program

    def kill(self):
        for program in self._begun:
            self.signal(program, signal.SIGKILL)

    def signal(self, program, number):
        """Send a signal to a program and to the processes that it has begun."""
        for pid in tree(program.pid) if program.poll() is None else ():
            with suppress(ProcessLookupError):
                os.kill(pid, number)

    def end(self):
        for program in (self.bridge, self.machine):
            if program.poll() is None:
                program.send_signal(signal.SIGINT)
        for program in (self.bridge, self.machine):
            try:
                program.wait(20)
            except subprocess.TimeoutExpired:
                self.signal(program, signal.SIGKILL)
                program.wait()
                raise
