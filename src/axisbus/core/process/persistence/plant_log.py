"""The history of simulated motors and modules, as lines of a file that remains after the end of all processes."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from axisbus.cell.model import CellConfig
from axisbus.core.simulated_nodes import SimulatedNode
from axisbus.errors import ConfigError, one_line
from axisbus.sim.drive import Drive
from axisbus.sim.io import IoModule

COLUMNS = ("time", "node", "axis", "position", "velocity", "stage", "outputs")
_HEADER_BEGIN = ",".join(COLUMNS[:5]).encode()

_KEY = "history"


def history_path(cell: CellConfig) -> Path | None:
    """Return the file of ``history`` in ``[bus.options]``, in the cell's folder; None if there is none.

    Raises:
        ConfigError: another file is there, which a foreign cell file must not replace.
    """
    name = cell.bus.options.get(_KEY)
    if not isinstance(name, str):
        return None
    path = cell.folder / name
    try:
        with path.open("rb") as file:
            head = file.read(len(_HEADER_BEGIN)) if path.is_file() else b""
    except FileNotFoundError:
        return path
    except OSError as error:
        raise _not_written(cell, path, one_line(error)) from error
    if head not in (b"", _HEADER_BEGIN):
        raise _not_written(cell, path, "it exists already, and is not a history of simulated drives")
    return path


def _not_written(cell: CellConfig, path: Path, why: str) -> ConfigError:
    return ConfigError(
        f"{_KEY} in [bus.options] names {path}, which cannot be written",
        file=cell.file,
        observed=why,
        remedy="name a file that does not exist yet; or move that one away",
    )


class PlantLog:
    """An open CSV file: seconds of the monotonic clock, position and velocity in increments, the power stage by its number.

    A module of inputs and outputs has a line too, in which only ``outputs`` is set: ``6200h:01=8 6200h:02=0``. For a CAN Simple
    module the stage is the state of its axis: 1 is idle, 8 closed loop.
    """

    def __init__(self, path: Path, simulated_nodes: Mapping[int, SimulatedNode]) -> None:
        """``path`` is replaced (see ``history_path``)."""
        self._simulated_nodes = simulated_nodes
        self._file = path.open("w", encoding="utf-8", newline="\n", buffering=1)
        self._file.write(",".join(COLUMNS) + "\n")

    def __enter__(self) -> PlantLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def note(self) -> None:
        """Write a line for each motor and each module."""
        for node_id, simulated_node in self._simulated_nodes.items():
            with simulated_node.lock:
                line_start = f"{time.monotonic():.4f},{node_id}"
                history_values = simulated_node.history()
                if history_values is not None:
                    position, velocity, stage = history_values
                    self._file.write(f"{line_start},1,{position:.1f},{velocity:.1f},{stage},\n")
                    continue
                device = simulated_node.device
                lines = [
                    _of_motor(line_start, number, drive)
                    for number, drive in enumerate(device.drives, start=1)
                ]
                if not lines:
                    lines = [_of_module(line_start, device.io)]
            self._file.writelines(lines)


def _of_motor(line_start: str, number: int, drive: Drive) -> str:
    motor = drive.axis.motor
    return f"{line_start},{number},{motor.position:.1f},{motor.velocity:.1f},{int(drive.power.stage)},\n"


def _of_module(line_start: str, io: IoModule) -> str:
    outputs = " ".join(f"{index:04X}h:{sub:02X}={value}" for (index, sub), value in io.outputs.items())
    return f"{line_start},,,,,{outputs}\n"
