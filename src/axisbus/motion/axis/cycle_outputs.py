"""The requests of one axis to its drive in this cycle, collected by the running command and turned into ``Outputs``."""

from __future__ import annotations

from axisbus.cia402 import controlword as cw
from axisbus.cia402.port import Outputs, SdoRequest
from axisbus.cia402.state import PowerState, plan
from axisbus.units import INT32_HALF, INT32_LEAST, wrap

_tuple = tuple.__new__  # makes a named tuple of values known to fit, without the call of its own ``__new__``
_ENABLED, _UNKNOWN = PowerState.OPERATION_ENABLED, PowerState.UNKNOWN
# The word that keeps a drive in its present state. In fault nothing is requested, and bit 7 is low so that a reset is an edge.
_HOLD = {
    PowerState.SWITCH_ON_DISABLED: cw.PowerCommand.DISABLE_VOLTAGE.word,
    PowerState.READY_TO_SWITCH_ON: cw.PowerCommand.SHUTDOWN.word,
    PowerState.SWITCHED_ON: cw.PowerCommand.SWITCH_ON.word,
    PowerState.OPERATION_ENABLED: cw.PowerCommand.ENABLE_OPERATION.word,
    PowerState.QUICK_STOP_ACTIVE: cw.PowerCommand.QUICK_STOP.word,
    PowerState.FAULT: 0,
    PowerState.FAULT_REACTION_ACTIVE: 0,
    PowerState.NOT_READY_TO_SWITCH_ON: 0,
}
ENABLE_OPERATION_WORD = _HOLD[_ENABLED]


class CycleOutputs:
    """One cycle's requests; holds state across cycles only in ``goal``, ``asked_mode`` and the request counter.

    ``goal`` is the requested power-stage state (None: nothing is requested from the drive, no frame contains a controlword).
    ``word`` overrides the planner for one cycle. ``asked_mode`` is the last value that this master wrote to 6060h (None: none).
    Positions are unwrapped increments.
    """

    __slots__ = (
        "_next_id",
        "asked_mode",
        "bits",
        "cancel",
        "goal",
        "halt",
        "mode",
        "nmt_stop",
        "sdo",
        "target_position",
        "target_torque",
        "target_velocity",
        "torque_offset",
        "velocity_offset",
        "word",
    )

    def __init__(self) -> None:
        self._next_id = 0
        self.goal: PowerState | None = None
        self.asked_mode: int | None = None
        self.sdo: list[SdoRequest] = []
        self.cancel: list[int] = []
        # these two are set again in each cycle, unless they are always None
        self.velocity_offset: int | None = None
        self.torque_offset: int | None = None
        self.clear()

    def clear(self) -> None:
        """Discard the last cycle's requests, except the goal."""
        self.word: int | None = None
        self.bits = 0
        self.halt = False
        self.mode: int | None = None
        self.target_position: int | None = None
        self.target_velocity: int | None = None
        self.target_torque: int | None = None
        self.nmt_stop = False
        if self.sdo or self.cancel:
            self.sdo, self.cancel = [], []

    def is_clear(self) -> bool:
        """Whether nothing is requested but the goal."""
        return (
            self.mode is None
            and self.word is None
            and self.target_position is None
            and self.target_velocity is None
            and self.target_torque is None
            and not (self.bits or self.sdo or self.cancel or self.halt or self.nmt_stop)
        )

    def request(self, index: int, subindex: int, value: int | None) -> int:
        """Request an SDO transfer (``value`` None reads) and return its id."""
        self._next_id += 1
        self.sdo.append(SdoRequest(self._next_id, index, subindex, value))
        return self._next_id

    def stopping(self, command: cw.PowerCommand, state: PowerState) -> int:
        """Return a stop's word, with the halt bit if it was set: without it, a drive that stays enabled would move on."""
        stays = state in (_ENABLED, _UNKNOWN) and self.halt
        return command.word | (cw.HALT if stays else 0)

    def controlword(self, state: PowerState) -> int | None:
        """Return the controlword for a drive seen in ``state``; None if none must be sent."""
        if self.word is not None:
            return self.word
        if self.goal is None or state is _UNKNOWN:
            return None
        if state is self.goal:
            word = _HOLD[state]
        else:
            command = plan(state, self.goal)
            word = _HOLD[state] if command is None else command.word
        if state is _ENABLED:
            # Also when leaving the state: until the drive has left it, a halted motion would continue without the halt bit.
            if self.halt:
                word |= cw.HALT
            if self.goal is state:
                word |= self.bits
        return word

    def outputs(self, state: PowerState) -> Outputs:
        """Return the values for the port."""
        target, mode = self.target_position, self.mode
        if mode is not None:
            self.asked_mode = mode
        if target is not None and not INT32_LEAST <= target < INT32_HALF:
            target = wrap(target)
        if state is _ENABLED and self.goal is _ENABLED and self.word is None and not self.halt:
            word: int | None = ENABLE_OPERATION_WORD | self.bits  # as ``controlword``, in most cycles
        else:
            word = self.controlword(state)
        sdo, cancel = tuple(self.sdo), tuple(self.cancel)
        given = (
            *(word, mode, target, self.target_velocity, self.target_torque, sdo, cancel, self.nmt_stop),
            *(self.velocity_offset, self.torque_offset, None),
        )
        return _tuple(Outputs, given)
