"""A virtual axis as a ``cia402.port.Port``: the port of an ideal drive, without a bus."""

from __future__ import annotations

from axisbus.cell.virtual import OBJECTS, SETTINGS
from axisbus.cia301 import abort
from axisbus.cia301.nmt import NmtState
from axisbus.cia402.port import (
    INPUT_OBJECTS,
    OUTPUT_OBJECTS,
    Capabilities,
    Inputs,
    Outputs,
    Sample,
    SdoReply,
    SdoRequest,
    ValueTransport,
)
from axisbus.core.virtual.drive import VirtualDrive

_OPERATIONAL = int(NmtState.OPERATIONAL)
_AGE = 0.1  # seconds, as for values with SYNC; values are of the present cycle


class VirtualPort:
    """Holds the drive of a virtual axis, and the answers that the core has not read yet.

    As all motion, it advances one period per executed cycle: late cycles make it late, and it never jumps.
    """

    def __init__(self, drive: VirtualDrive, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self.drive = drive
        self._period = period
        self._replies: tuple[SdoReply, ...] = ()
        inputs = {name: _source(index) for name, index in INPUT_OBJECTS.items()}
        self.capabilities = Capabilities(
            inputs,
            {name: _source(index) for name, index in OUTPUT_OBJECTS.items()},
            remappable=False,
            max_age=dict.fromkeys(inputs, _AGE),
        )

    def read(self, now: float) -> Inputs:
        """Advance one period, and return the inputs."""
        drive = self.drive
        drive.advance(self._period)
        replies, self._replies = self._replies, ()
        position = Sample(drive.position, now)
        return Inputs(
            now,
            operational=True,
            statusword=Sample(drive.statusword, now),
            mode=Sample(drive.mode, now),
            position=position,
            velocity=Sample(drive.velocity, now),
            torque=None,
            demand=position,
            sdo=replies,
            nmt=_OPERATIONAL,
        )

    def write(self, outputs: Outputs) -> None:
        """Take the outputs of this cycle, and answer the requests that would be SDO transfers on a bus."""
        if outputs.sdo:
            self._replies = tuple(map(self._answer, outputs.sdo))
        self.drive.take(outputs)

    def _answer(self, request: SdoRequest) -> SdoReply:
        if request.subindex or self.drive.value(request.index) is None:
            return SdoReply(request.id, None, abort.OBJECT_MISSING)
        if request.value is None:
            return SdoReply(request.id, self.drive.value(request.index), None)
        if request.index not in SETTINGS:
            return SdoReply(request.id, None, abort.READ_ONLY)
        self.drive.settings[request.index] = max(1, request.value)
        return SdoReply(request.id, None, None)


def _source(index: int) -> ValueTransport:
    return ValueTransport.SYNC_PDO if index in OBJECTS else ValueTransport.NONE
