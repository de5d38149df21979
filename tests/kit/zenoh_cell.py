"""A cell on a Zenoh network: its bridge as a program of its own, a client, and a wire between both that can be cut."""

from __future__ import annotations

import itertools
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import msgspec

from axisbus.fleet.keys import ZenohCellKeys
from axisbus.fleet.messages import CommandAnswer, CommandAsk, LeaseAnswer, LeaseAsk
from axisbus.fleet.network import ZenohNetwork, connected, opened

_numbers = itertools.count(1)
PLANT, CELL = "works", "one"
KEYS = ZenohCellKeys(PLANT, CELL)


def free_port() -> int:
    """A free port."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


def until(seen: Callable[[], Any], within: float = 10.0) -> float:
    """Wait until something is so; return how long that took."""
    begun = time.monotonic()
    while not seen():
        assert time.monotonic() - begun < within, f"not within {within} s"
        time.sleep(0.01)
    return time.monotonic() - begun


class BridgeProcess:
    """``axisbus bridge zenoh`` of a cell, listening on this computer."""

    def __init__(self, file: Path, *words: str, listen: str = "") -> None:
        self.endpoint = listen or f"tcp/127.0.0.1:{free_port()}"
        options = ["--plant", PLANT, "--cell", CELL, *words]
        if "--config" not in words:
            options += ["--listen", self.endpoint]
        command = [sys.executable, "-u", "-m", "axisbus", "bridge", "zenoh", str(file), *options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def __enter__(self) -> BridgeProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.end(signal.SIGKILL)

    def await_line(self, words: str) -> str:
        """Return the next line that has these words."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if words in line:
                return line
        raise AssertionError(f"it has ended, and never said {words!r}")

    def end(self, number: int = signal.SIGTERM) -> int:
        """Send it a signal, and return its exit code."""
        with suppress(ProcessLookupError):
            self.process.send_signal(number)
            self.process.send_signal(signal.SIGCONT)
        code = self.process.wait(15)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return code


class Client:
    """A client on the network, by the protocol alone; ``name`` is its display name, and a part of the client's."""

    def __init__(self, endpoint: str, name: str = "Anna", config: Path | None = None) -> None:
        self.who = name
        self.name = f"{name}-{os.getpid()}-{next(_numbers)}"
        self.token = ""
        self.session = opened(ZenohNetwork(() if config else (endpoint,), config=config))
        connected(self.session, 5.0)
        self._id = 0
        self._over = threading.Event()
        self._renewing: threading.Thread | None = None

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.keep_silent()
        self.session.close()

    def ask(self, key: str, message: object = None, kind: Any = None, timeout: float = 8.0) -> Any:
        """Ask, and return the first answer; None without one. ``message`` may be bytes."""
        data = message if message is None or isinstance(message, bytes) else msgspec.json.encode(message)
        for reply in self.session.get(key, payload=data, timeout=timeout):
            if reply.ok is not None:
                told = reply.ok.payload.to_bytes()
                return told if kind is None else msgspec.json.decode(told, type=kind)
        return None

    def lease(self, verb: Any, **more: Any) -> LeaseAnswer:
        """Ask about the lease."""
        ask = LeaseAsk(verb, self.name, self.who, self.token, **more)
        answer: LeaseAnswer = self.ask(KEYS.lease, ask, LeaseAnswer)
        return answer

    def take(self, **more: Any) -> LeaseAnswer:
        """Take the lease, and renew it until ``keep_silent``."""
        answer = self.lease("take", **more)
        if answer.token:
            self.token = answer.token
            self._over.clear()
            self._renewing = threading.Thread(target=self._renew, daemon=True)
            self._renewing.start()
        return answer

    def keep_silent(self) -> None:
        """Renew it no more."""
        self._over.set()
        if self._renewing is not None:
            self._renewing.join()

    def _renew(self) -> None:
        ask = msgspec.json.encode(LeaseAsk("renew", self.name, token=self.token))
        while not self._over.wait(0.3):
            for _ in self.session.get(KEYS.lease, payload=ask, timeout=0.5):
                pass

    def do(
        self, verb: str, *axes: str, number: int | None = None, token: str | None = None, **values: Any
    ) -> Any:
        """Command, and return the answer."""
        self._id = self._id + 1 if number is None else max(self._id, number)
        ask = CommandAsk(
            self.name,
            self._id if number is None else number,
            self.token if token is None else token,
            axes,
            values,
        )
        return self.ask(KEYS.command(verb), ask, CommandAnswer)

    def must(self, verb: str, *axes: str, **more: Any) -> None:
        """Command, and see that it ends well."""
        answer = self.do(verb, *axes, **more)
        assert answer.status == "done", answer

    def alive(self) -> bool:
        """Whether the cell is there now."""
        found = self.session.liveliness().get(KEYS.alive, timeout=1.0)
        return any(reply.ok is not None for reply in found)


class Wire:
    """A wire between two ends of TCP that passes data on, until it is cut."""

    def __init__(self, port: int) -> None:
        self._far = port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._listening.getsockname()[1]}"
        self.cut = threading.Event()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self._over.set()
        self._thread.join()
        self._listening.close()

    def _run(self) -> None:
        ends: dict[socket.socket, socket.socket] = {}
        while not self._over.is_set():
            watched = [] if self.cut.is_set() else [self._listening, *ends]
            if not watched:
                time.sleep(0.02)
                continue
            for one in select.select(watched, [], [], 0.02)[0]:
                if one is not self._listening and one not in ends:
                    continue  # it has just been closed with the other end
                if one is self._listening:
                    near, far = one.accept()[0], socket.create_connection(("127.0.0.1", self._far))
                    ends |= {near: far, far: near}
                elif not self.cut.is_set():
                    self._pass_on(one, ends)
        for each in ends:
            each.close()

    @staticmethod
    def _pass_on(one: socket.socket, ends: dict[socket.socket, socket.socket]) -> None:
        try:
            data = one.recv(65536)
            if data:
                ends[one].sendall(data)
                return
        except OSError:
            pass
        other = ends.pop(one, None)
        one.close()
        if other is not None:
            ends.pop(other, None)
            other.close()


@contextmanager
def holder(where: str) -> Iterator[subprocess.Popen[str]]:
    """A program of its own that has the lease, renews it, and has said ``moves`` once x turns."""
    command = [sys.executable, "-u", "-m", "kit.lease_holder", where]
    folder = Path(__file__).parents[1]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=folder) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().strip() == "moves"
            yield process
        finally:
            process.kill()
