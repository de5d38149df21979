"""The values of a drive at each SYNC: targets and offsets as the master sent them, whatever its reports."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.sim.drive import Drive

# The objects by the standard's numbers; those of the product's tables are not asked.
CSP, CSV = 8, 9


class Held(NamedTuple):
    """The values of a drive after a SYNC: seconds of its clock, stage, mode, controlword, targets and offsets, raw."""

    time: float
    stage: int
    mode: int
    word: int
    position: int
    speed: int
    velocity_offset: int
    torque_offset: int


class Witness:
    """Notes the values of one drive at each SYNC."""

    def __init__(self, drive: Drive) -> None:
        self.held: list[Held] = []
        self._drive, self._sync = drive, drive.sync
        drive.sync = self._noted  # type: ignore[method-assign]

    def _noted(self) -> None:
        drive = self._drive
        values = (drive.target_position, drive.target_velocity, drive.velocity_offset, drive.torque_offset)
        self.held.append(
            Held(drive.time, int(drive.power.stage), drive.mode_display, drive.controlword, *values)
        )
        self._sync()

    def since(self, moment: float) -> list[Held]:
        """Those from a moment on, by the drive's clock."""
        return [held for held in self.held if held.time >= moment]
