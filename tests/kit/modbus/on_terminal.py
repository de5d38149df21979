"""A simulated module on RS485 behind a pseudo-terminal, for the command line: its list of endpoints lies in the present folder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from axisbus.drives.gim6010.sim.modbus.station import Station
from axisbus.drives.gim6010.sim.modbus.terminal import Terminal, served

LISTED = "endpoints_0.5.13.json"


@contextmanager
def module_on_terminal(folder: Path) -> Iterator[Terminal]:
    """Serve one module of node ID 1, whose restart takes 1 s; write its list into ``folder``."""
    station = Station()
    (folder / LISTED).write_text(json.dumps(station.module.json()), "utf-8")
    station.module.usb_write("axis0.controller.config.vel_ramp_rate", 100.0)
    station.module.dials.restart_time = 1.0
    with served(station) as terminal:
        yield terminal
