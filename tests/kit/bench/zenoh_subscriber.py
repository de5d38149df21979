"""A bridge to Zenoh beside a machine, and a subscriber: ``python -m kit.bench.zenoh_subscriber CELL SECONDS [junk]``, as JSON.

It prints the CPU seconds of the bridge, the number of received states, and the longest gap of an axis. ``junk``: random queries
are sent as fast as they are answered, too.
"""

from __future__ import annotations

import itertools
import json
import sys
import threading
import time
from pathlib import Path
from typing import Any

from kit.bench.page_scopes import spent
from kit.zenoh_cell import KEYS, BridgeProcess, Client


def send_nonsense(client: Client, until: float) -> int:
    """Ask it without end, and return how often."""
    asked = 0
    while time.monotonic() < until:
        for key in (KEYS.lease, KEYS.command("move_absolute"), KEYS.object(1, 0x6041, 0), KEYS.events):
            client.ask(key, b'{"nonsense": 1}', timeout=1.0)
            asked += 1
    return asked


def main(cell: str, seconds: str, *junk: str) -> None:
    """Listen, and print the counts."""
    states: dict[str, list[float]] = {}

    def hear(sample: Any) -> None:
        states.setdefault(str(sample.key_expr), []).append(time.monotonic())

    with BridgeProcess(Path(cell)) as bridge:
        bridge.await_line("joined")
        with Client(bridge.endpoint) as client:
            client.session.declare_subscriber(KEYS.state("*"), hear)
            client.session.declare_subscriber(KEYS.events, lambda _: None)
            began, end = spent(bridge.process.pid), time.monotonic() + float(seconds)
            asked: list[int] = []
            thread = threading.Thread(target=lambda: asked.append(send_nonsense(client, end)))
            if junk:
                thread.start()
            time.sleep(max(0.0, end - time.monotonic()))
            if junk:
                thread.join()
            cpu = spent(bridge.process.pid) - began
    gaps = [after - before for one in states.values() for before, after in itertools.pairwise(one)]
    told = {
        "cpu": cpu,
        "states": sum(map(len, states.values())),
        "gap": max(gaps, default=0.0),
        "asked": sum(asked),
    }
    print(json.dumps(told))


if __name__ == "__main__":
    main(*sys.argv[1:])
