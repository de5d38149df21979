"""A kernel as a notebook has one: cells are run in it one after the other, interrupted, and it is killed."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from jupyter_client.blocking import BlockingKernelClient
from jupyter_client.manager import KernelManager

_PATIENCE = 60.0  # seconds


class Ran(NamedTuple):
    """The result of a cell: its output, and the name of the exception that ended it, if one did."""

    text: str
    error: str


class Kernel:
    """A running kernel."""

    def __init__(self, manager: KernelManager, client: BlockingKernelClient) -> None:
        self.manager = manager
        self._client = client

    @property
    def process(self) -> int:
        """Its process."""
        return self.manager.provisioner.process.pid

    def begin(self, code: str) -> str:
        """Begin a cell, and return the argument of ``end``; wait until it has printed something."""
        cell = self._client.execute(code)
        while True:
            message = self._client.get_iopub_msg(timeout=_PATIENCE)
            if message["parent_header"].get("msg_id") != cell:
                continue
            assert message["msg_type"] != "error", message["content"]
            if message["msg_type"] == "stream":
                return cell

    def end(self, cell: str) -> Ran:
        """Wait for the end of a cell."""
        text, error = "", ""
        while True:
            message = self._client.get_iopub_msg(timeout=_PATIENCE)
            if message["parent_header"].get("msg_id") != cell:
                continue
            content = message["content"]
            if message["msg_type"] == "stream":
                text += content["text"]
            elif message["msg_type"] == "error":
                error = content["ename"]
            elif message["msg_type"] == "status" and content["execution_state"] == "idle":
                return Ran(text.strip(), error)

    def run(self, code: str) -> str:
        """Run a cell that must end well, and return its output."""
        ran = self.end(self._client.execute(code))
        assert not ran.error, ran
        return ran.text

    def show_a_traceback(self) -> None:
        """Run a cell that fails."""
        assert self.end(self._client.execute("1 / 0")).error == "ZeroDivisionError"

    def interrupt(self) -> float:
        """Press the stop button; return when, by the monotonic clock."""
        at = time.monotonic()
        self.manager.interrupt_kernel()
        return at

    def shut_down(self) -> float:
        """End it as the notebook does; return when."""
        at = time.monotonic()
        self.manager.shutdown_kernel()
        return at

    def kill(self, number: int = signal.SIGKILL) -> float:
        """Kill it; return when."""
        at = time.monotonic()
        os.kill(self.process, number)
        return at

    def terminate(self) -> float:
        """Ask it to end by SIGTERM; return when."""
        return self.kill(signal.SIGTERM)


@contextmanager
def kernel(folder: Path, **environment: str) -> Iterator[Kernel]:
    """Run a kernel in a folder."""
    manager = KernelManager()
    manager.start_kernel(cwd=str(folder), env={**os.environ, **environment})
    client = manager.client()
    client.start_channels()
    try:
        client.wait_for_ready(timeout=_PATIENCE)
        yield Kernel(manager, client)
    finally:
        client.stop_channels()
        if manager.has_kernel:
            manager.shutdown_kernel(now=not manager.is_alive())
