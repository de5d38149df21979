"""The set-point handshake with a drive whose bit 12 proves nothing: edges of bit 4 that last long enough to be heard.

Theory of operation
-------------------
Some drives never set bit 12, take it back while bit 4 still stands, or let it follow every write of 6060h. To them the target and
the edge of bit 4 are given as ever, but bit 4 stays high, and then low, for a time in which any drive has looked at it: a few
cycles, and two statuswords where those come. Whether the set-point was taken is not known then: that is for
``SetPointConfirmation`` to see.

Out of a halt there are two edges. The first comes under halt, so that the axis does not go on to its old target when the halt ends;
a drive that takes nothing under halt gets the second together with the end of the halt. The target is absolute, so that one that
takes both goes there once.
"""

from __future__ import annotations

import math

from axisbus.cia402 import controlword as cw
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.setpoint import HandshakePhase, SetPoint
from axisbus.motion.parameters import AxisParameters, Handshake

_CYCLES = 4  # one for the target, one on the wire, two for the drive
_SAMPLES = 2  # statuswords: the first may have been on its way before
_SHORTEST = 0.02  # seconds: the slow task of a drive
_LONGEST = 0.1  # seconds: a statusword that comes on change only may not come at all


def set_point(target: int, parameters: AxisParameters) -> SetPoint:
    """Return a set-point at ``target`` (unwrapped increments), to be given by the handshake of the axis."""
    kind = TimedSetPoint if parameters.handshake is Handshake.ON_CHANGE else SetPoint
    return kind(target, parameters.name, parameters.timing.acknowledge)


class TimedSetPoint(SetPoint):
    """One set-point on its way without bit 12; holds the phase, how long it has lasted, and when the last edge was given.

    ``edge_at`` is infinite before the first edge; ``from_halt``: it was given to a halted axis.
    """

    __slots__ = ("_cycles", "_edges", "_samples", "_stamp", "edge_at", "from_halt")

    def __init__(self, target: int, name: str, timeout: float) -> None:
        super().__init__(target, name, timeout)
        self.edge_at = math.inf
        self.from_halt = False
        self._edges = 1  # still to be given
        self._cycles = self._samples = 0
        self._stamp = 0.0

    def keeps_halt(self, _image: AxisImage) -> bool:
        """Whether a halted axis stays so: until the second edge."""
        return self._edges > 0

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the edges were given and bit 4 is low again; raises nothing."""
        begins = self.phase is HandshakePhase.CLEAR
        if begins:
            self.from_halt = order.halt
            self._edges = 1 + order.halt
        # The bit 4 of another set-point that a halt has cut short must have been low for its time before ours rises.
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
