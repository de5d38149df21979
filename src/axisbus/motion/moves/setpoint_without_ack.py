"""The set-point handshake with a drive whose bit 12 proves nothing: edges of bit 4 that last long enough for any drive.

Theory of operation
-------------------
Some drives never set bit 12, clear it while bit 4 is still set, or let it follow every write of 6060h. Target and edge of bit 4 are
sent as usual, but bit 4 stays high, and then low, long enough for any drive to see it: for a few cycles, and for two statuswords if
they arrive. Whether the set-point was taken is then unknown; ``SetPointConfirmation`` decides this.

Out of a halt there are two edges. The first one is sent under halt, so that the axis does not continue to its old target when the
halt ends. A drive that takes nothing under halt gets the second edge together with the end of the halt. The target is absolute, so
a drive that takes both edges moves there once.
"""

from __future__ import annotations

import math

from axisbus.cia402 import controlword as cw
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.setpoint import HandshakePhase, SetPoint
from axisbus.motion.parameters import AxisParameters, Handshake

_CYCLES = 4  # one for the target, one on the wire, two for the drive
_SAMPLES = 2  # statuswords: the first one may have been sent before
_SHORTEST = 0.02  # seconds: the slow task of a drive
_LONGEST = 0.1  # seconds: a statusword that is sent on change only may not arrive at all


def set_point(target: int, parameters: AxisParameters) -> SetPoint:
    """Return a set-point at ``target`` (unwrapped increments), for the axis's kind of handshake."""
    kind = TimedSetPoint if parameters.handshake is Handshake.ON_CHANGE else SetPoint
    return kind(target, parameters.name, parameters.timing.acknowledge)


class TimedSetPoint(SetPoint):
    """The handshake of one set-point without bit 12; holds the phase, its duration, and the time of the last edge.

    ``edge_at`` is infinite before the first edge; ``from_halt``: it was given to a halted axis.
    """

    __slots__ = ("_cycles", "_edges", "_samples", "_stamp", "edge_at", "from_halt")

    def __init__(self, target: int, name: str, timeout: float) -> None:
        super().__init__(target, name, timeout)
        self.edge_at = math.inf
        self.from_halt = False
        self._edges = 1  # edges still to be given
        self._cycles = self._samples = 0
        self._stamp = 0.0

    def keeps_halt(self, _image: AxisImage) -> bool:
        """Whether a halted axis must stay halted: until the second edge."""
        return self._edges > 0

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the edges were given and bit 4 is low again; raises nothing."""
        begins = self.phase is HandshakePhase.CLEAR
        if begins:
            self.from_halt = order.halt
            self._edges = 1 + order.halt
        # If a halt has interrupted another set-point, its bit 4 must have been low for its time before this set-point's bit rises.
        if (begins and order.halt) or order.bits & cw.NEW_SET_POINT:
            self._enter(HandshakePhase.RELEASE, image)
            return False
        return super().step(image, order)

    def _advance(self, image: AxisImage) -> None:
        self._cycles += 1
        if image.statusword_stamp > self._stamp:
            self._samples, self._stamp = self._samples + 1, image.statusword_stamp
        if self.phase is not HandshakePhase.CLEAR and not self._has_lasted(image.now - self.since):
            return
        if self.phase is HandshakePhase.OFFER:
            self._enter(HandshakePhase.RELEASE, image)
        elif self._edges and image.edge_delay and self.phase is not HandshakePhase.TARGET:
            self._enter(HandshakePhase.TARGET, image)
        elif self._edges:
            self._edges -= 1
            self.edge_at = image.now
            self._enter(HandshakePhase.OFFER, image)
        else:
            self._enter(HandshakePhase.TAKEN, image)

    def _has_lasted(self, time: float) -> bool:
        return (
            self._cycles >= _CYCLES
            and time >= _SHORTEST - 1e-9
            and (self._samples >= _SAMPLES or time >= _LONGEST)
        )

    def _enter(self, phase: HandshakePhase, image: AxisImage) -> None:
        super()._enter(phase, image)
        self._cycles = self._samples = 0
        self._stamp = image.now
