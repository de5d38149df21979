"""The web page of a running machine: ``axisbus web`` in a process of its own, which joins the machine."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import tempfile
import time
from types import TracebackType
from typing import IO

from axisbus.core.process.launch import require_joinable_system
from axisbus.errors import StateError
from axisbus.optional_dependencies import require

_START_TIMEOUT = 30.0  # seconds until a page must be served
_END_TIMEOUT = 5.0  # seconds that it may take to end, before it is killed
_LINK = "http"


class WebPage:
    """Holds the process that serves a page, until ``close``; usable as a context manager.

    ``link`` admits one browser, once; an operator's page makes links for viewers. If the page ends or is killed, the machine keeps
    running; axes that the page had set in motion halt.
    """

    def __init__(self, file: str, port: int, *, command: bool) -> None:
        """Use ``Machine.serve_web``."""
        self._errors = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace", newline="")  # noqa: SIM115
        words = [sys.executable, "-u", "-m", "axisbus", "web", file, "--port", str(port)]
        self._process = subprocess.Popen(
            [*words, "--take" if command else "--look"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self._errors,
        )
        try:
            self.link = self._read_link()
        except BaseException:
            self.close()
            raise

    @property
    def runs(self) -> bool:
        """Whether the page is served."""
        return self._process.poll() is None

    def close(self) -> None:
        """End the page; axes that it had set in motion halt. Blocks for at most 5 s; harmless when repeated."""
        if self.runs:
            self._process.terminate()
            try:
                self._process.wait(_END_TIMEOUT)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._stdout.close()
        self._errors.close()

    def __enter__(self) -> WebPage:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def _stdout(self) -> IO[bytes]:
        assert self._process.stdout is not None
        return self._process.stdout

    def _read_link(self) -> str:
        """Return the link that the process prints when it serves the page."""
        until, output = time.monotonic() + _START_TIMEOUT, b""
        while (left := until - time.monotonic()) > 0.0:
            if not select.select([self._stdout], [], [], left)[0]:
                break
            more = os.read(self._stdout.fileno(), 4096)
            output += more
            if not more or b"\n" in output:
                break
        words = [word for word in output.decode("utf-8", "replace").split() if word.startswith(_LINK)]
        if not words:
            raise self._not_served()
        return words[0]

    def _not_served(self) -> StateError:
        self._process.kill()
        self._process.wait()
        self._errors.seek(0)
        return StateError(
            "the page could not be served",
            observed=self._errors.read().strip()
            or f"its program reported no link within {_START_TIMEOUT:g} s",
            remedy="correct the cause that it prints; axisbus web CELL serves the page as well",
        )


def require_nicegui() -> None:
    """Check that the packages for the page are installed.

    Raises:
        StateError: they are not.
    """
    require("nicegui", "the page needs nicegui", "web")


def require_joinable(joinable: bool) -> None:
    """Check that a page can join a machine.

    Raises:
        StateError: it cannot. PlatformError: none can on this system.
    """
    if not joinable:
        require_joinable_system()
        raise StateError(
            "no page can be served for this machine",
            observed="its core does not run in its own process, so no other program can join it",
            remedy='give the core its own process (process = "own" in [bus]), or serve the page by axisbus web',
        )
