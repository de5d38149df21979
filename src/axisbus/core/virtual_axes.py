"""The axes of a cell without a drive, each with its core and its port: they need no link."""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.cell.model import CellConfig
from axisbus.cell.virtual import OBJECTS, SETTINGS, all_virtual
from axisbus.cia301 import abort
from axisbus.cia301.nmt import NmtState
from axisbus.cia401.port import SignalValidity
from axisbus.cia402.port import (
    INPUT_OBJECTS,
    OUTPUT_OBJECTS,
    Capabilities,
    Inputs,
    Outputs,
    Port,
    Sample,
    SdoReply,
    SdoRequest,
    ValueTransport,
)
from axisbus.cia402.state import PowerState
from axisbus.core.io import IoScan
from axisbus.core.virtual_drive import STATUSWORDS, VirtualDrive
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.parameters import AxisParameters
from axisbus.units import wrap


class VirtualAxis(NamedTuple):
    """An axis that only the core moves, or whose position is read from an input."""

    core: AxisCore
    port: Port


def virtual_axes(cell: CellConfig, io_scan: IoScan) -> dict[str, VirtualAxis]:
    """Make the axes of a cell without a drive: virtual ones at 0 and without power, encoders at the position of their input."""
    return {name: _axis(parameters, io_scan) for name, parameters in all_virtual(cell).items()}


def _axis(parameters: AxisParameters, io_scan: IoScan) -> VirtualAxis:
    port = EncoderPort(io_scan, parameters.encoder) if parameters.encoder else _virtual_port(parameters)
    core = AxisCore(parameters, port.capabilities)
    # The start at 0 is no guess: no physical position could differ from it.
    core.confirm_position(origin=0)
    return VirtualAxis(core, port)


def _virtual_port(parameters: AxisParameters) -> VirtualPort:
    quick = parameters.braking.quick
    assert quick is not None  # required by the reader
    return VirtualPort(VirtualDrive(parameters.slow_ramp or quick, quick), parameters.scan_period)


# -- An axis whose position is read from an input, as a ``cia402.port.Port``: an encoder, which others can follow ------


_OPERATIONAL = int(NmtState.OPERATIONAL)
_OFF = STATUSWORDS[PowerState.SWITCH_ON_DISABLED]
_AGE = 0.1  # seconds, of the statusword, which is of the present cycle


class EncoderPort:
    """Holds the unwrapped count: the input wraps at the end of its width, and the count does not.

    The input decides whether a count is fresh. If its value is unknown, the axis has no position.
    """

    def __init__(self, io_scan: IoScan, name: str) -> None:
        """``name`` of the input, which is on this board when its node has come up."""
        self._io_scan = io_scan
        self._name = name
        self._replies: tuple[SdoReply, ...] = ()
        self._count: int | None = None
        inputs = dict.fromkeys(INPUT_OBJECTS, ValueTransport.NONE) | {
            "statusword": ValueTransport.SYNC_PDO,
            "position": io_scan.source_of(name),
        }
        outputs = dict.fromkeys(OUTPUT_OBJECTS, ValueTransport.NONE)
        ages = dict.fromkeys(inputs, _AGE) | {"position": math.inf}
        self.capabilities = Capabilities(inputs, outputs, remappable=False, max_age=ages)

    def read(self, now: float) -> Inputs:
        """Return the position of the newest count."""
        replies, self._replies = self._replies, ()
        return Inputs(
            now,
            operational=True,
            statusword=Sample(_OFF, now),
            mode=None,
            position=self._position(),
            velocity=None,
            torque=None,
            demand=None,
            sdo=replies,
            nmt=_OPERATIONAL,
        )

    def write(self, outputs: Outputs) -> None:
        """Answer that there are no objects to write or read."""
        self._replies = tuple(SdoReply(each.id, None, abort.OBJECT_MISSING) for each in outputs.sdo or ())

    def _position(self) -> Sample | None:
        reading = self._io_scan.readings.get(self._name)
        if reading is None or reading.known is not SignalValidity.YES or reading.value is None:
            return None
        if self._count is None:
            self._count = reading.value
        half = 1 << self._io_scan.width_of(self._name) - 1
        self._count += (reading.value - self._count + half) % (2 * half) - half
        return Sample(wrap(self._count), reading.stamp)


# -- A virtual axis as a ``cia402.port.Port``: the port of an ideal drive, without a bus -------------------------------


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
