"""The base of every command: a step function that is called once per cycle until it reports its end."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Protocol

from axisbus.cia301 import abort
from axisbus.cia402 import dictionary, modes, objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import DriveError, MotionTimeout, StaleError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.velocity_following import VelocityRampTracker
from axisbus.motion.stop_deceleration import CommandedMotion

if TYPE_CHECKING:
    from axisbus.motion.moves.mode_switch import ModeSwitch
    from axisbus.motion.moves.setpoint import SetPoint


class SetPointSource(Protocol):
    """The active trajectory of an axis, as seen by a command or stop that takes over from it.

    ``moves.follow.Follow``, without the members that only its own command needs.
    """

    @property
    def mode(self) -> ModeOfOperation | None:
        """The mode of operation in which it commands the axis."""

    @property
    def at_rest(self) -> bool:
        """Whether its targets no longer change."""

    def begin_braking(self) -> bool:
        """Brake along the path from the next step on; return whether that is possible. A repeated call has no effect."""

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Write the next target; return True when the axis has arrived at the last one."""


# Abort codes of a drive that only lists an object, or has it read-only.
_DOES_WITHOUT = frozenset({abort.OBJECT_MISSING, abort.SUBINDEX_MISSING, abort.READ_ONLY})
NEVER = 1e6  # seconds; an older value has never been received
LATE_REMEDY = (
    "look for a queue that grows between this program and the drive: a gateway or adapter that is too slow for the bus load "
    "(axisbus load), a network or serial line behind it"
)


class Activity(ABC):
    """A running command. It is pure: process image in, requests out; a failure is raised as an ``AxisbusError``.

    ``mode`` is the mode of operation in which it works. If ``keeps_moving``, it is stepped further after a successful end, because
    the axis continues to move. Only an activity that ``clears_error`` can leave ErrorStop. An activity that ``ends_at_rest`` has
    ended successfully only when the axis is seen at standstill. One that ``stops_at_limit`` ends in a halt ahead of a position
    limit. ``commanded`` describes the commanded motion (None: unknown).

    ``behind``: increments by which the axis is behind its commanded position, if the command knows this better than 6062h.
    ``commanded_speed``: the commanded speed in increments per s. ``lag``: see ``VelocityRampTracker`` (None: not known).
    ``ramp_tracker``: the monitor of the velocity ramp that the drive is on (None: it is on none). ``rests_from``: the time (s) from
    which its end may be seen, because an axis at standstill may not have started yet. ``settling``: the seconds that the rest of
    its motion takes when its drive reports the end, because it is within a window of the target. ``resisted_since``: the time (s)
    since which an axis that must turn is at standstill, while no value shows its drive's set-point (infinite: it turns, or the
    set-point is seen). Until it is ``in_effect``, the axis may continue as the previous command requested.
    """

    mode: ClassVar[ModeOfOperation | None] = None
    keeps_moving: ClassVar[bool] = False
    clears_error: ClassVar[bool] = False
    ends_at_rest: ClassVar[bool] = False
    stops_at_limit: ClassVar[bool] = False
    refused: bool = False  # it has failed before it moved anything
    commanded: CommandedMotion | None = None
    behind: float | None = None
    commanded_speed: float = 0.0
    lag: float | None = None
    ramp_tracker: VelocityRampTracker | None = None
    rests_from: float = -math.inf
    settling: float = 0.0
    resisted_since: float = math.inf
    in_effect: bool = True

    @property
    def set_point_source(self) -> SetPointSource | None:
        """The trajectory of the axis: its own, or the previous one until the drive is in the mode of this command."""
        return None

    @property
    def pending_mode_switch(self) -> ModeSwitch | None:
        """The requested change of mode that will end that trajectory; the next command must complete this change."""
        return None

    @property
    def in_flight(self) -> SetPoint | None:
        """The set-point handshake that has begun and has not ended; it continues if the command is interrupted."""
        return None

    @property
    def torque(self) -> int:
        """The torque by which this command moves the axis, in 0.1 % of rated torque; 0: it moves the axis otherwise."""
        return 0

    @abstractmethod
    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Do one cycle's work; return True when the command has ended successfully."""

    def override(self, image: AxisImage) -> None:  # noqa: B027  # most activities do this in their step
        """Update ``commanded`` for a new override, because the supervision reads it before the next step."""

    def cancel(self, order: CycleOutputs) -> None:  # noqa: B027  # most activities have nothing to cancel
        """Cancel queued requests: the command has been interrupted."""


class SdoTransfers:
    """SDO transfers of one command, requested together and awaited together; holds the outstanding request ids.

    If an entry is read-only in the EDS, it is read instead, and must have the value.
    """

    __slots__ = (
        "_deadline",
        "_items",
        "_optional",
        "_parameters",
        "_pending",
        "_read_only",
        "_started",
        "values",
    )

    def __init__(
        self,
        items: Sequence[tuple[int, int, int | None]],
        parameters: AxisParameters,
        optional: frozenset[int] = frozenset(),
    ) -> None:
        """``items`` are (index, sub-index, value to write or None to read).

        For the objects ``optional`` the drive may reply that they are missing or read-only.
        """
        self._items = items
        self._optional = optional
        self._parameters = parameters
        self._read_only: dict[tuple[int, int], int] = {}  # the values that they must have
        self._deadline = parameters.timing.sdo
        self._pending: dict[int, tuple[int, int]] = {}
        self._started = False
        self.values: dict[tuple[int, int], int] = {}

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when all transfers have succeeded.

        Raises:
            DriveError: the drive refused a transfer, or did not answer in time.
        """
        if not self._started:
            self._start(image, order)
        for request in [number for number in self._pending if number in image.replies]:
            self._take(image, request)
        if self._pending and image.now > self._deadline:
            index, subindex = next(iter(self._pending.values()))
            self.cancel(order)
            name = self._parameters.name
            raise DriveError(
                f"{name}: {object_text(index, subindex)}: the drive did not answer the SDO request",
                axis=name,
                remedy="check cable and bus load; a drive that is busy storing parameters answers late",
            )
        return not self._pending

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the transfers that are still queued."""
        order.cancel.extend(self._pending)
        self._pending.clear()

    def _start(self, image: AxisImage, order: CycleOutputs) -> None:
        self._started = True
        self._deadline += image.now
        for index, subindex, value in self._items:
            asked = value
            if value is not None and (index, subindex) in self._parameters.read_only:
                self._read_only[index, subindex] = value
                asked = None
            self._pending[order.request(index, subindex, asked)] = (index, subindex)

    def _take(self, image: AxisImage, request: int) -> None:
        index, subindex = self._pending.pop(request)
        reply = image.replies[request]
        if reply.abort in _DOES_WITHOUT and index in self._optional:
            return
        if reply.abort is not None:
            failed = (
                "the SDO transfer broke off"
                if reply.abort == abort.TIMED_OUT
                else "the drive refused the SDO transfer"
            )
            name = self._parameters.name
            raise DriveError(
                f"{name}: {object_text(index, subindex)}: {failed}",
                axis=name,
                observed=f"abort code {abort.describe(reply.abort)}",
                remedy=abort.explain(reply.abort).hint or "see the drive's manual about this object",
            )
        if reply.value is not None:
            self.values[index, subindex] = reply.value
            wanted = self._read_only.get((index, subindex), reply.value)
            if wanted != reply.value:
                self._differs((index, subindex), reply.value, wanted)

    def _differs(self, at: tuple[int, int], found: int, wanted: int) -> None:
        name = self._parameters.name
        raise DriveError(
            f"{name}: {object_text(*at)} must be {wanted}, and the drive does not allow it to be written",
            axis=name,
            observed=f"it is {found}; its access in {self._parameters.eds or 'the EDS'} is read-only",
            remedy=(
                f"command the behaviour that {found} means, set the object with the manufacturer's tool, or correct its "
                "access in the EDS"
            ),
        )


def shown_modes(parameters: AxisParameters) -> str:
    """Return the modes in which an axis is used, and their source."""
    shown = ", ".join(modes.short(each) for each in sorted(parameters.modes)) or "none"
    if len(parameters.modes) == 1 and not parameters.has(objects.MODES_OF_OPERATION_DISPLAY):
        return f"{shown} (its EDS lacks 6061h, so only the mode in which it is enabled can be used)"
    return f"{shown} (by modes in cell.toml, else by 6502h, else by its objects)"


def preload(order: CycleOutputs, reference: int | None) -> None:
    """Set targets that move nothing: the reference position, velocity 0, torque 0."""
    order.target_position = reference
    order.target_velocity = 0
    order.target_torque = 0


def present_speed(image: AxisImage, parameters: AxisParameters) -> float:
    """Return the speed in position increments per second; 0 if it is not known."""
    units = parameters.units
    speed = image.speed(units.per_velocity) if units.ratio_known else None
    return 0.0 if speed is None else abs(speed)


def object_text(index: int, subindex: int = 0) -> str:
    """Return an object's number and name, such as ``6081h profile velocity``."""
    name = dictionary.name(index)
    number = f"{index:04X}h:{subindex:02X}" if subindex else f"{index:04X}h"
    return f"{number} {name.lower()}".rstrip()


def age_text(age: float) -> str:
    """Return the age of an outdated value as text; ``age`` in seconds (infinite: it was never received)."""
    return f"the last one is {age:.3g} s old" if math.isfinite(age) else "it was never received"


def comes_too_late(image: AxisImage, age: float) -> bool:
    """Return whether a value is unknown because the frames are delayed, not missing; ``age`` in seconds (infinite: never known)."""
    return image.lag > 0 and (image.lag > age / 2 or age > NEVER)


def lateness_text(image: AxisImage) -> str:
    """Return the delay of the process data as text."""
    return f"{image.lag:.3g} s late, although none is missing"


def where_text(image: AxisImage, parameters: AxisParameters) -> str:
    """Return the position of the axis as text for the user, such as ``12.5 deg``."""
    units = parameters.units.position
    if image.position is None:
        return "unknown"
    return f"{units.to_units(image.position - image.origin):g} {units.unit}"


def timed_out(target: int, timeout: float, image: AxisImage, parameters: AxisParameters) -> MotionTimeout:
    """Return the error of a move commanded in csp whose ``timeout`` (s) has passed; ``target`` in unwrapped increments."""
    units = parameters.units.position
    return MotionTimeout(
        f"{parameters.name}: the axis has not arrived at {units.to_units(target - image.origin):g} {units.unit}",
        axis=parameters.name,
        observed=f"position {where_text(image, parameters)}; the timeout of {timeout:g} s has passed",
        remedy="give more time, or check whether the axis is blocked",
    )


def unknown_value(
    image: AxisImage, age: float, text: str, observed: str, name: str, remedy: str
) -> StaleError:
    """Return the error ``text`` of axis ``name`` that a value of this ``age`` is unknown; ``remedy`` is that for missing frames."""
    if not comes_too_late(image, age):
        return StaleError(text, axis=name, observed=observed, remedy=remedy)
    return StaleError(
        f"{text}: the process data come too late",
        axis=name,
        observed=f"{lateness_text(image)}; {observed}",
        remedy=LATE_REMEDY,
    )


def unknown_position(image: AxisImage, name: str, text: str, remedy: str) -> StaleError:
    """Return the error ``text`` of axis ``name``, whose position is unknown; ``remedy`` is that for missing frames."""
    age = image.now - image.position_stamp
    return unknown_value(image, age, text, age_text(age), name, remedy)


def unknown_statusword(image: AxisImage, name: str, text: str, observed: str, remedy: str) -> StaleError:
    """Return the error ``text`` of axis ``name``, whose statusword is unknown; ``remedy`` is that for missing frames."""
    return unknown_value(image, image.now - image.statusword_stamp, text, observed, name, remedy)


def require_position(image: AxisImage, name: str, why: str) -> int:
    """Return the unwrapped actual position.

    Raises:
        StaleError: the position is unknown.
    """
    if image.position is None:
        remedy = (
            "map 6064h into a TPDO, and check that the drive sends it (axisbus boot shows its TPDO); a TPDO that is "
            "shorter than its mapping is dropped (axisbus monitor counts those)"
            if image.position_stamp == -math.inf
            else "check cable and bus load, and that the drive still sends the TPDO that contains it (axisbus monitor)"
        )
        text = f"{name}: the actual position (6064h) is unknown, and {why} needs it"
        raise unknown_position(image, name, text, remedy)
    return image.position
