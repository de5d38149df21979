"""A drive that has interpolated position mode (ip) and no csp, seen as one that has csp.

Theory of operation
-------------------
Both modes take a position at each SYNC and go evenly from one to the next. They differ in three things (CiA 402-2 11 and 14): the
mode's number, the object of the target (60C1h:01), and bit 4 of the controlword, which lets the drive interpolate; bit 12 of the
statusword tells that it does. So motion knows csp alone, and this port translates:

- Targets go to 60C1h:01 as well as to 607Ah, in every mode: a drive that falls into pp finds the newest place there.
- Bit 4 rises in a cycle that has a target, in a drive that is seen enabled in ip. The mode counts as csp once bit 12 is there.
- In pp and in homing bit 4 means something else. A drive that stands gets the word without it before the other mode is asked for.
  One that moves must be led on until it has left: then the bit falls, and the new mode is shown to motion two cycles later, so that
  no edge is swallowed.
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
_FALLS = 3  # cycles in which the word without bit 4 has arrived
_STANDS = 3  # cycles with the same target


def as_csp_capable(ports: Mapping[str, Port]) -> dict[str, Port]:
    """Return ports by name, those of drives that are led in ip as motion is to see them."""
    return {
        name: InterpolatedPort(port) if "interpolation_target" in port.capabilities.outputs else port
        for name, port in ports.items()
    }


class InterpolatedPort:
    """A port of such an axis (``cia402.port.Port``); holds what was sent last, and what the drive showed."""

    def __init__(self, port: Port) -> None:
        self.port = port
        outputs = dict(port.capabilities.outputs)
        own = outputs.pop("interpolation_target", ValueTransport.NONE)
        if outputs.get("target_position") is ValueTransport.SYNC_PDO:
            outputs["target_position"] = own
        self._capabilities = replace(port.capabilities, outputs=outputs)
        self._mode: int | None = None  # as the drive shows it
        self._active = self._enabled = False
        self._bit = False  # whether bit 4 is set
        self._asked: int | None = None  # the mode that motion has asked for last
        self._falling = 0  # cycles until the drive has had the word without bit 4
        self._target: int | None = None
        self._stood = 0  # cycles
        self._leads = False  # whether motion has given a target in the last cycle
        self._halts = False

    @property
    def capabilities(self) -> Capabilities:
        """How the axis's values travel; the target position as 60C1h:01 does."""
        return self._capabilities

    def read(self, now: float) -> Inputs:
        """Return the newest values, with ip called csp where it interpolates."""
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
        """Take the values for this cycle."""
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
        """Whether motion has asked for another mode."""
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
