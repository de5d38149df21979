"""Homing (CiA 402-2 11): the drive searches for its home position with one of the methods of 6098h."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import homing, objects
from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import HomingError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import Activity, SdoTransfers
from axisbus.motion.moves.mode_switch import ModeSwitch
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop_deceleration import CommandedMotion


@dataclass(frozen=True, slots=True)
class HomingJob:
    """One homing: method of 6098h, speeds and acceleration in the drive's increments (None: not written), time-out in s."""

    method: int
    speed_switch: int | None
    speed_zero: int | None
    acceleration: int | None
    timeout: float

    def writes(self, parameters: AxisParameters) -> list[tuple[int, int, int | None]]:
        """Return the SDO writes that set it up, for the objects that the drive has."""
        wanted = (
            (objects.HOMING_METHOD, 0, self.method),
            (objects.HOMING_SPEEDS, 1, self.speed_switch),
            (objects.HOMING_SPEEDS, 2, self.speed_zero),
            (objects.HOMING_ACCELERATION, 0, self.acceleration),
        )
        return [
            (index, subindex, value)
            for index, subindex, value in wanted
            if value is not None and parameters.has(index)
        ]


class _Step(Enum):
    PREPARE = 1
    LOW = 2
    SEARCH = 3


class HomingRun(Activity):
    """A running homing: mode and objects, a real rising edge of bit 4, then *attained and reached*; holds the step."""

    mode = ModeOfOperation.HOMING
    ends_at_rest = True

    def __init__(self, job: HomingJob, parameters: AxisParameters) -> None:
        self._job = job
        self._parameters = parameters
        self._mode = ModeSwitch(ModeOfOperation.HOMING, parameters)
        self._transfers = SdoTransfers(job.writes(parameters), parameters)
        self._step = _Step.PREPARE
        self._since = 0.0
        self._stale = 0  # bits of the statusword that were high before the edge, as after a former homing
        self._seen_low = 0  # bits of the statusword that were low since the edge
        self._found = False  # some drives clear bit 12 again before standstill is seen
        self._word_count = 0  # number of statuswords received since the edge
        self._newest = -math.inf
        self.commanded = _commanded_motion(job, parameters)

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the drive reports home attained and target reached.

        With ``homing_reached = false``, bit 10 is not expected: the axis must be at standstill instead.

        Raises:
            HomingError: the drive reports a homing error, or the time-out has passed.
        """
        if self._step is _Step.PREPARE:
            self._prepare(image, order)
        elif self._step is _Step.LOW:
            self._edge(image)
        if self._step is _Step.SEARCH:
            order.bits = cw.HOMING_START
            order.halt = False
            return self._search(image)
        return False

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return self._mode.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued requests."""
        self._transfers.cancel(order)
        self._mode.cancel(order)

    def _prepare(self, image: AxisImage, order: CycleOutputs) -> None:
        written = self._transfers.step(image, order)
        if self._mode.step(image, order) and written:
            self._step, self._since = _Step.LOW, image.now

    def _edge(self, image: AxisImage) -> None:
        """Let bit 4 rise after it has been low for two cycles in homing mode."""
        if image.now >= self._since + 1.5 * self._parameters.scan_period:
            self._step, self._since = _Step.SEARCH, image.now
            self._stale = image.statusword or 0

    def _search(self, image: AxisImage) -> bool:
        word = image.statusword
        if word is not None and image.statusword_stamp > self._since:
            self._note(word, image.statusword_stamp)
            if word & sw.HOMING_ERROR and self._settled(image, sw.HOMING_ERROR):
                raise self._error(image, "the drive reports a homing error (statusword bit 13)")
            reached = word & sw.TARGET_REACHED or (not self._parameters.homing_reached and image.standstill)
            if word & sw.HOMING_ATTAINED and reached and self._settled(image, sw.HOMING_ATTAINED):
                self._found = True
        if self._found:
            return True
        if image.now > self._since + self._job.timeout:
            raise self._error(image, f"home was not found within {self._job.timeout:g} s")
        return False

    def _note(self, word: int, stamp: float) -> None:
        self._seen_low |= ~word
        if stamp > self._newest:
            self._word_count, self._newest = self._word_count + 1, stamp

    def _settled(self, image: AxisImage, bit: int) -> bool:
        """Whether the bit belongs to this run: it was seen low, or a word received well after the edge has it.

        The first word since the edge does not count: it may have been sent before the drive saw the edge. If words are sent on
        change, no second word is needed, because the drive would have sent it. A bit of a former homing counts only after the time
        in which a drive accepts a set-point, unless this homing defines the present position as home, which takes no time.
        """
        timing = self._parameters.timing
        may_begin_late = self._stale & bit and self._job.method not in homing.IN_PLACE
        settled = self._since + (max(timing.settle, timing.acknowledge) if may_begin_late else timing.settle)
        late = image.now > settled if image.statusword_by_event else image.statusword_stamp > settled
        return bool(self._seen_low & bit) or (late and (self._word_count > 1 or image.statusword_by_event))

    def _error(self, image: AxisImage, why: str) -> HomingError:
        name, method = self._parameters.name, self._job.method
        word = "no fresh statusword" if image.statusword is None else f"statusword 0x{image.statusword:04X}"
        return HomingError(
            f"{name}: homing by method {method} ({homing.describe(method)}) failed",
            axis=name,
            observed=f"{why}; {word}, attained (bit 12) {_bit(image, 12)}, reached (bit 10) {_bit(image, 10)}",
            remedy=f"{_remedy(image, name)}; the axis was halted",
        )


def _commanded_motion(job: HomingJob, parameters: AxisParameters) -> CommandedMotion | None:
    """Return the motion with the highest search speed of the drive; None if it is not known."""
    speeds = [speed for speed in (job.speed_switch, job.speed_zero) if speed is not None]
    units = parameters.units
    if not speeds or not units.ratio_known or not parameters.has(objects.HOMING_SPEEDS):
        return None
    return CommandedMotion(speed=max(speeds) * abs(units.per_velocity))


def _remedy(image: AxisImage, name: str) -> str:
    """Return the first remedy, by the bits of the statusword: if the home position was found, no switch is to blame."""
    if _bit(image, 12) and not _bit(image, 10) and not _bit(image, 13):
        return (
            "the drive has found its home, and does not report it as reached: see its manual for the condition of bit 10 in "
            "homing, such as a move to 607Ch, a position window (6067h, 6068h) that it does not keep, or a vendor-specific "
            f"option; a drive that never sets bit 10 in homing needs homing_reached = false in [axes.{name}]"
        )
    return "check the switch or index pulse that this method looks for, the homing speeds (6099h, not 0), and the direction"


def _bit(image: AxisImage, bit: int) -> int:
    return 0 if image.statusword is None else image.statusword >> bit & 1
