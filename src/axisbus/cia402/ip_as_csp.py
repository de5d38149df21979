"""Port of a drive that has interpolated position mode (ip) and no csp, presented to motion as a drive with csp.

Theory of operation
-------------------
In both modes the drive takes a position at each SYNC and interpolates between them. The modes differ in three points (CiA 402-2 11
and 14): the mode's number, the object of the target (60C1h:01), and bit 4 of the controlword, which enables interpolation. Bit 12
of the statusword shows that interpolation is active. Motion uses only csp, and this port translates:

- Targets are written to 60C1h:01 as well as to 607Ah, in every mode. A drive that changes to pp finds the newest position there.
- Bit 4 is set in a cycle that has a target, if the drive is seen enabled in ip. While bit 12 is then still 0, motion sees
  ip; otherwise it sees csp.
- In pp and in homing bit 4 has another meaning. A drive at standstill gets the controlword without bit 4 before the other mode is
  requested. A moving drive must get targets until it has left ip. Then the bit is cleared, and motion still sees csp for ``_FALLS``
  cycles, so that no edge is lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from axisbus.cia402 import controlword as cw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Capabilities, Inputs, Outputs, Port, Sample, ValueTransport
from axisbus.cia402.state import PowerState, decode
from axisbus.cia402.statusword import BIT_12

_CSP, _IP = int(ModeOfOperation.CYCLIC_SYNC_POSITION), int(ModeOfOperation.INTERPOLATED_POSITION)
ENABLE_INTERPOLATION = 0x10  # bit 4 of 6040h
_ENABLED = cw.PowerCommand.ENABLE_OPERATION.word
_FALLS = 3  # cycles after which the word without bit 4 has arrived
_STANDS = 3  # cycles with the same target


def as_csp_capable(ports: Mapping[str, Port]) -> dict[str, Port]:
    """Return ports by name; those of drives commanded in ip are replaced by ports with csp."""
    return {
        name: InterpolatedPort(port) if "interpolation_target" in port.capabilities.outputs else port
        for name, port in ports.items()
    }


class InterpolatedPort:
    """A port of such an axis (``axisbus.cia402.port.Port``); holds the last outputs, and the drive's state."""

    def __init__(self, port: Port) -> None:
        self.port = port
        outputs = dict(port.capabilities.outputs)
        own = outputs.pop("interpolation_target", ValueTransport.NONE)
        if outputs.get("target_position") is ValueTransport.SYNC_PDO:
            outputs["target_position"] = own
        self._capabilities = replace(port.capabilities, outputs=outputs)
        self._mode: int | None = None  # as the drive reports it
        self._active = self._enabled = False
        self._bit = False  # whether bit 4 is set
        self._asked: int | None = None  # the mode that motion requested last
        self._falling = 0  # cycles until the drive has received the word without bit 4
        self._target: int | None = None
        self._stood = 0  # cycles
        self._leads = False  # whether motion has given a target in the last cycle
        self._halts = False

    @property
    def capabilities(self) -> Capabilities:
        """The transport of the axis's values; that of the target position is the one of 60C1h:01."""
        return self._capabilities

    def read(self, now: float) -> Inputs:
        """Return the newest values; mode ip is shown as csp, unless an enabled drive with a target does not yet interpolate."""
        inputs = self.port.read(now)
        word, mode = inputs.statusword, inputs.mode
        self._enabled = word is not None and decode(word.value) is PowerState.OPERATION_ENABLED
        self._active = word is not None and bool(word.value & BIT_12)
        self._mode = None if mode is None else mode.value
        if mode is None:
            return inputs
        shown = self._shown(mode.value)
        return inputs if shown == mode.value else inputs._replace(mode=Sample(shown, mode.stamp))

    def write(self, outputs: Outputs) -> None:
        """Set the values for this cycle."""
        if outputs.mode is not None:
            self._asked = outputs.mode
        target = outputs.target_position
        self._leads = target is not None
        if target is not None:
            self._stood = self._stood + 1 if target == self._target else 0
            self._target = target
        else:
            self._stood += 1
        word = outputs.controlword
        had, self._bit = self._bit, self._interpolates(word, target)
        if had and not self._bit:
            self._falling = _FALLS
        elif self._falling:
            self._falling -= 1
        if self._bit and word is not None:
            word |= ENABLE_INTERPOLATION
        self.port.write(
            outputs._replace(controlword=word, mode=self._mode_of(outputs.mode), interpolation_target=target)
        )

    @property
    def _leaves(self) -> bool:
        """Whether motion has requested another mode."""
        return self._asked is not None and self._asked != _CSP

    def _shown(self, mode: int) -> int:
        if mode == _IP:
            waits = self._enabled and not self._active and self._leads
            return _IP if waits and not self._leaves and not self._halts else _CSP
        return _CSP if self._leaves and (self._bit or self._falling) else mode

    def _interpolates(self, word: int | None, target: int | None) -> bool:
        if word is None:
            return self._bit
        self._halts = bool(word & cw.HALT)
        if self._mode != _IP or not self._enabled or word & _ENABLED != _ENABLED:
            return False
        if self._leaves and self._stood >= _STANDS:
            return False
        return self._bit or (target is not None and not self._leaves)

    def _mode_of(self, mode: int | None) -> int | None:
        if mode == _CSP:
            return _IP
        kept = (
            mode is not None and self._mode == _IP and self._stood >= _STANDS and (self._bit or self._falling)
        )
        return _IP if kept else mode
