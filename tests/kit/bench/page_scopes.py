"""Four scopes of ten signals: ``python -m kit.bench.page_scopes CELL SECONDS`` prints the cost of the server as JSON."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
import time
from contextlib import ExitStack

from websockets.sync.client import ClientConnection

from axisbus.cell import reader
from axisbus.web.page_socket import HEAD
from kit.web_client import Client

SCOPES, SIGNALS = 4, 10
COLUMNS = ("position", "velocity", "target", "demand", "following_error")


class Scope:
    """One scope that receives everything; counts the received samples, and the lost ones."""

    def __init__(self, socket: ClientConnection, signals: list[str]) -> None:
        self.samples = self.lost = 0
        self._signals = signals
        self._socket = socket
        self._socket.send(json.dumps({"choice": 1, "signals": signals}))

    def take(self, until: float) -> None:
        """Take batches until a time; for a thread of its own."""
        while time.monotonic() < until:
            _, samples, signals, lost = HEAD.unpack_from(self._socket.recv(timeout=5.0))
            assert signals == len(self._signals)
            self.samples += samples
            self.lost += lost


def main(cell: str, seconds: str) -> None:
    """Print the CPU seconds of the server, and the counts of the scopes."""
    axes = list(reader.load(cell).axes)
    signals = [f"{axis}.{column}" for column in COLUMNS for axis in axes][:SIGNALS]
    command = [sys.executable, "-u", "-m", "axisbus", "web", cell, "--look", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as web, ExitStack() as opened:
        assert web.stdout is not None
        found = re.search(r"http\S+", web.stdout.readline())
        assert found
        client = Client(found[0])
        scopes = [Scope(opened.enter_context(client.page("/scope")), signals) for _ in range(SCOPES)]
        began, end = spent(web.pid), time.monotonic() + float(seconds)
        threads = [threading.Thread(target=each.take, args=(end,)) for each in scopes]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        cpu = spent(web.pid) - began
        web.terminate()
    samples, lost = sum(each.samples for each in scopes), sum(each.lost for each in scopes)
    print(json.dumps({"cpu": cpu, "samples": samples, "lost": lost}))


def spent(process: int) -> float:
    """CPU seconds of a process so far (Linux)."""
    with open(f"/proc/{process}/stat", encoding="ascii") as file:
        words = file.read().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main(*sys.argv[1:])
