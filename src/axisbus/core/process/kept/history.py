"""What simulated motors did, as lines of a file: it is there when everybody who might have looked is dead."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from axisbus.core.stand_in import StandIn

COLUMNS = ("time", "node", "axis", "position", "velocity", "stage")


class History:
    """A CSV file under way: seconds of the monotonic clock, position and velocity in increments, the power stage by its number."""

    def __init__(self, path: Path, stand_ins: Mapping[int, StandIn]) -> None:
        """``path`` is replaced."""
        self._stand_ins = stand_ins
        self._file = path.open("w", encoding="utf-8", buffering=1)
        self._file.write(",".join(COLUMNS) + "\n")

    def __enter__(self) -> History:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def note(self) -> None:
        """Write a line for each motor."""
        for node_id, stand_in in self._stand_ins.items():
            with stand_in.lock:
                rows = [(drive.axis.motor, drive.power.stage) for drive in stand_in.device.drives]
                lines = [
                    f"{time.monotonic():.4f},{node_id},{number},{motor.position:.1f},{motor.velocity:.1f},{int(stage)}\n"
                    for number, (motor, stage) in enumerate(rows, start=1)
                ]
            self._file.writelines(lines)
