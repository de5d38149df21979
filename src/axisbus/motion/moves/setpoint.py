"""The set-point handshake of profile position mode (CiA 402-2 10.3): bits 4 and 5 of 6040h, bit 12 of 6041h.

Theory of operation
-------------------
The drive takes a set-point on the *rising edge* of bit 4. It answers with bit 12, and clears bit 12 when bit 4 falls. Five phases:

1. CLEAR: bit 4 is low, wait until bit 12 is low too.
2. TARGET, only if the drive may see a controlword before the target of the same cycle: for ``Capabilities.edge_delay`` cycles
   the target is sent with bit 4 low.
3. OFFER: target and bit 4 are sent together. Wait for bit 12.
4. RELEASE: bit 4 is low again. Wait for bit 12 to fall, in a word received after bit 4 went low.
5. TAKEN: bit 10 (target reached) now refers to *this* set-point. The word in which bit 12 fell counts already, because an
   event-driven drive sends no other word after a move of zero length.

A handshake that has begun is always finished: a replacing move lets the old one run to TAKEN (a few cycles) and then offers its own
target. If bit 4 fell before the acknowledge, it would be unknown whether the drive has seen the edge.

Bit 5 (change set immediately) is always set: the master has its own queue, and drives differ in how many set-points they buffer.
"""

from __future__ import annotations

from enum import Enum

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import statusword as sw
from axisbus.errors import SetPointError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage


class HandshakePhase(Enum):
    """The phase of the handshake."""

    CLEAR = "clear"
    TARGET = "target"
    OFFER = "offer"
    RELEASE = "release"
    TAKEN = "taken"


_CLEAR, _TARGET, _OFFER = HandshakePhase.CLEAR, HandshakePhase.TARGET, HandshakePhase.OFFER
_RELEASE, _TAKEN = HandshakePhase.RELEASE, HandshakePhase.TAKEN


class SetPoint:
    """The handshake of one set-point; holds the phase and the deadline of the wait for bit 12."""

    __slots__ = ("_deadline", "_name", "_released", "_shown", "_timeout", "phase", "since", "target")

    def __init__(self, target: int, name: str, timeout: float) -> None:
        """``target`` in unwrapped increments; ``timeout`` in seconds for each wait for bit 12."""
        self.target = target
        self.phase = HandshakePhase.CLEAR
        self.since = 0.0  # when the phase began
        self._name = name
        self._timeout = timeout
        self._released = 0.0
        self._shown = 0  # cycles in which the target was sent without the edge
        self._deadline: float | None = None

    @property
    def begun(self) -> bool:
        """Whether the drive may have seen the edge but the handshake is not finished."""
        return self.phase is _OFFER or self.phase is _RELEASE

    def keeps_halt(self, image: AxisImage) -> bool:
        """Whether a halted axis must stay halted: without the halt it would continue to the drive's previous target.

        For a drive that takes no set-point under halt, the halt is removed after half of the timeout.
        """
        offered = self.phase is _OFFER and image.now < self.since + 0.5 * self._timeout
        return self.phase is _CLEAR or self.phase is _TARGET or offered

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True as soon as a statusword completes the handshake.

        Raises:
            SetPointError: bit 12 does not follow bit 4 in time.
        """
        if self.phase is _TAKEN:
            return True
        self._advance(image)
        if self.phase is _TARGET or self.phase is _OFFER:
            order.target_position = self.target
        if self.phase is _OFFER:
            order.bits = cw.NEW_SET_POINT | cw.CHANGE_SET_IMMEDIATELY
        return self.phase is _TAKEN

    def _advance(self, image: AxisImage) -> None:
        if self._deadline is None:
            self._deadline = image.now + self._timeout
        word = image.statusword
        acknowledged = None if word is None else bool(word & sw.SET_POINT_ACKNOWLEDGE)
        if (self.phase is _CLEAR or self.phase is _TARGET) and acknowledged is False:
            self._present(image)
        elif self.phase is _OFFER and acknowledged:
            self._released = image.now
            self._enter(_RELEASE, image)
        elif self.phase is _RELEASE and acknowledged is False and image.statusword_stamp > self._released:
            self._enter(_TAKEN, image)
        elif image.now > self._deadline:
            raise self._stuck(image)

    def _present(self, image: AxisImage) -> None:
        if self._shown >= image.edge_delay:
            self._enter(_OFFER, image)
            return
        self._shown += 1
        if self.phase is _CLEAR:
            self._enter(_TARGET, image)

    def _enter(self, phase: HandshakePhase, image: AxisImage) -> None:
        self.phase = phase
        self.since = image.now
        self._deadline = image.now + self._timeout

    def _stuck(self, image: AxisImage) -> SetPointError:
        bit = int(self.phase is _OFFER)
        word = "no fresh statusword" if image.statusword is None else f"statusword 0x{image.statusword:04X}"
        return SetPointError(
            f"{self._name}: the drive does not {'accept the set-point' if bit else 'end the set-point handshake'}",
            axis=self._name,
            observed=f"controlword bit 4 (new set-point) was {bit} for {self._timeout:g} s, statusword bit 12 (set-point "
            f"acknowledge) stayed {1 - bit}; {word}",
            remedy="check that the target lies within the drive's own limits (607Dh) and that profile velocity and acceleration "
            f"(6081h, 6083h) are not 0; a slow drive needs a longer acknowledge_time in [axes.{self._name}]; {self._workaround}; "
            "if only the first move after enabling fails, the drive takes no set-point while its brake opens: let the program wait "
            "after enabling"
            if bit
            else "see in the drive's manual when it resets bit 12 (its buffer of set-points may be full); a slow drive "
            f"needs a longer acknowledge_time in [axes.{self._name}]; {self._workaround}",
        )

    @property
    def _workaround(self) -> str:
        return (
            "a drive that moves nevertheless (its bit 12 never comes, falls too early, or follows writes of 6060h) needs "
            f'handshake = "on-change" in [axes.{self._name}]'
        )
