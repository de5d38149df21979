"""Detect unexpected events in each cycle: lost node, loss of power, stale statusword, following error, limits in danger."""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.cia301.nmt import NmtState
from axisbus.cia402.options import Ramp
from axisbus.cia402.port import Capabilities
from axisbus.cia402.state import PowerState
from axisbus.cpu_starvation import REMEDY
from axisbus.errors import (
    AxisbusError,
    BusError,
    BusOff,
    DriveError,
    DuplicateNodeError,
    NodeError,
    StaleError,
    TransmitQueueFull,
)
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.modes import TORQUE_MODES
from axisbus.motion.moves.activity import LATE_REMEDY, NEVER, Activity, comes_too_late, lateness_text
from axisbus.motion.moves.modewatch import ModeWatch
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.states import MOVING, AxisState
from axisbus.motion.stop.diagnosis import (
    REOPEN,
    SILENT,
    boot_and_reset,
    join_remedies,
    remedy_for_silence,
    silence_of,
    start_and_reset,
    when_back,
)
from axisbus.motion.stop.following_error import FollowingErrorMonitor
from axisbus.motion.stop.limits import LimitMonitor, stop_of
from axisbus.motion.stop.overspeed import SpeedWatch
from axisbus.motion.stop.standstill_monitor import StandstillMonitor
from axisbus.motion.stop.stop_sequence import StopLevel
from axisbus.motion.stop_deceleration import CommandedMotion

_ENABLED, _UNKNOWN = PowerState.OPERATION_ENABLED, PowerState.UNKNOWN
_ERRORSTOP, _STOPPING = AxisState.ERRORSTOP, AxisState.STOPPING
POWERED = MOVING | {AxisState.STANDSTILL, AxisState.STOPPING}
# Seconds for which a word of this master that has not taken effect yet may keep a drive enabled.
_FLICKER = 0.25
_LEAST_GAP = 0.25  # seconds: shorter gaps are normal on a busy computer
# After one of these states a node may have lost its position: it has restarted, or another master is about to configure it.
_RESTARTED = frozenset({NmtState.INITIALISING, NmtState.PRE_OPERATIONAL})


class StopDemand(NamedTuple):
    """Why the axis must be stopped, the first step of the stop sequence, and whether a halt may brake along the axis's trajectory.

    ``halts``: the command ends with the error in a halt, and the axis does not go to ErrorStop.
    """

    error: AxisbusError
    level: StopLevel = StopLevel.HALT
    along: bool = True
    halts: bool = False


class Supervision:
    """Monitors one axis.

    Holds whether its node was operational and is lost, the time until which silence is excused, and the monitors of its motion.
    """

    def __init__(self, parameters: AxisParameters, capabilities: Capabilities) -> None:
        self._parameters = parameters
        self.guard = LimitMonitor(parameters)
        self.following = FollowingErrorMonitor(parameters)
        self._speed = SpeedWatch(parameters)
        self._mode = ModeWatch(parameters.name)
        self._resting = StandstillMonitor(parameters)
        self._met_operational = False
        oldest = capabilities.max_age.get("statusword", math.inf)
        self.longest_gap = max(
            oldest if math.isfinite(oldest) else 1.0, 10 * parameters.scan_period, _LEAST_GAP
        )
        self._excused_until = -math.inf
        self._energised_since = math.inf  # although the axis is disabled, repeatedly until ``_energised_at``
        self._energised_at = -math.inf
        self._duplicate_reported = False
        self.lost = False

    def node(self, image: AxisImage) -> StopDemand | None:
        """Return the stop for a lost node, once until ``lost`` is reset. Must be called in every cycle."""
        self.guard.look(image)
        if image.gap > self.longest_gap:
            self._excused_until = image.now + 2 * self.longest_gap
        if image.operational:
            self._met_operational = True
        elif self._met_operational and not self.lost and not self._excused(image):
            self.lost = True
            return StopDemand(self._lost_error(image), StopLevel.QUICK_STOP)
        if image.duplicate and not self._duplicate_reported:
            self._duplicate_reported = True
            return StopDemand(
                duplicate_error(self._parameters.name, self._parameters.node, image.duplicate),
                StopLevel.QUICK_STOP,
            )
        return None

    def _excused(self, image: AxisImage) -> bool:
        """Whether a missing heartbeat may be this computer's fault: the master did not run, and has just begun to receive again."""
        return image.bus is None and image.nmt in SILENT and image.now < self._excused_until

    @staticmethod
    def has_restarted(image: AxisImage) -> bool:
        """Whether the origin of the position may have changed, because the node is not operational."""
        return image.nmt in _RESTARTED

    def power(
        self, image: AxisImage, state: AxisState, activity: Activity | None = None, *, bounded: bool = True
    ) -> StopDemand | None:
        """Return the danger to an axis that this master has enabled and that is not being stopped; None: no danger.

        ``activity`` is the command that moves the axis (None: the axis must rest); ``bounded``: see ``LimitMonitor.danger``.
        """
        if state is _ERRORSTOP:
            return self._unknown(image) if image.state is _UNKNOWN else self.unrest(image, activity)
        if state not in POWERED:
            return None
        if image.gap > self.longest_gap:
            return self._gap(image, None if activity is None else activity.commanded)
        if image.state is not _ENABLED and not self._holds_in_quick_stop(image, state):
            return self._unknown(image) if image.state is _UNKNOWN else self._dropped(image)
        return self.motion(image, state, activity, bounded)

    def motion(
        self, image: AxisImage, state: AxisState, activity: Activity | None, bounded: bool
    ) -> StopDemand | None:
        """As ``power``, for an axis that is enabled and has a fresh statusword. Call ``guard.look`` before."""
        moving = activity if state in MOVING else None
        uncontrolled = self._mode.error(image, moving) or self.following.error(image, moving)
        if uncontrolled is not None:  # not under control: a quick stop is more certain than a halt
            return StopDemand(uncontrolled, StopLevel.QUICK_STOP)
        fast = self._speed.error(image, moving, self.guard.tracks[0])
        if fast is not None:
            coasts = self._parameters.braking.quick_stop is Ramp.COAST
            return StopDemand(fast, StopLevel.HALT if coasts else StopLevel.QUICK_STOP, along=False)
        if activity is None:
            unrest = self.unrest(image, None)
            if unrest is not None:
                return unrest
            commanded = lag = None
        else:
            if self._resting.rest_position is not None:
                self._resting.forget()
            commanded, lag = activity.commanded, activity.lag
        danger = self.guard.danger(image, state, bounded=bounded, commanded=commanded, lag=lag)
        if danger is None:
            return None
        if activity is not None:
            self.guard.note_torque(activity.torque, image.torque)
        finding = self._endangered(danger, commanded)
        stays_inside = activity is not None and activity.stops_at_limit and danger is self.guard.leaving_error
        return finding._replace(halts=True) if stays_inside and finding.level is StopLevel.HALT else finding

    def only_follows(self, activity: Activity) -> bool:
        """Whether ``motion`` only has to check the following error (``following``) for ``activity``.

        This remains true while ``activity`` commands the axis along its path in a mode that the drive reports.
        """
        otherwise = self._resting.rest_position is not None or self.guard.is_free
        return not otherwise and self._mode.has_agreed(activity) and self.following.is_used_to(activity)

    def forget(self) -> None:
        """Reset the monitors: no command moves the axis any more.

        Its next motion, and its next rest, are monitored from their beginning.
        """
        self.following.forget()
        self._resting.forget()

    def at_work(self) -> None:
        """End the monitored rest: the axis is being stopped, or is not this master's to monitor. Its next rest starts again."""
        self._resting.forget()

    def unrest(self, image: AxisImage, activity: Activity | None) -> StopDemand | None:
        """Return that an axis without a command (``activity`` is None) moves, or is being pulled."""
        if activity is not None:
            self._resting.forget()
            return None
        error = self._resting.error(image)
        return None if error is None else StopDemand(error, StopLevel.QUICK_STOP)

    def coasting(self, image: AxisImage, level: StopLevel, *, bounded: bool) -> StopDemand | None:
        """Return the danger to an axis that a halt under torque lets coast, if a harder step than ``level`` would brake it."""
        commanded = CommandedMotion(by_torque=True)
        harder = stop_of(self._parameters, commanded)[0] > level
        if not harder or image.mode not in TORQUE_MODES or image.state is not _ENABLED:
            return None
        danger = self.guard.danger(image, AxisState.CONTINUOUS_MOTION, bounded=bounded, commanded=commanded)
        return None if danger is None else self._endangered(danger, commanded)

    def energised(self, image: AxisImage, *, at_work: bool) -> DriveError | None:
        """Return that the drive of a disabled axis has driven its motor for a while; ``at_work``: this master commands it."""
        if at_work or image.now - self._energised_at > _FLICKER:
            self._energised_since = math.inf
        if at_work or image.state is not _ENABLED:
            return None
        self._energised_at = image.now
        self._energised_since = min(self._energised_since, image.now)
        if image.now - self._energised_since < _FLICKER:
            return None
        name = self._parameters.name
        return DriveError(
            f"{name}: its drive was enabled, but not by this program",
            axis=name,
            observed=f"the axis is disabled, its drive was seen in state {image.state.value!r} again after {_FLICKER:g} s",
            remedy="TREAT THE AXIS AS MOVING; look for another master or tool that commands it; the drive is being disabled again",
        )

    @staticmethod
    def _holds_in_quick_stop(image: AxisImage, state: AxisState) -> bool:
        """Whether the drive holds the axis after a quick stop, as requested."""
        return image.state is PowerState.QUICK_STOP_ACTIVE and state is _STOPPING

    def _gap(self, image: AxisImage, commanded: CommandedMotion | None) -> StopDemand:
        """Return the stop of an axis after the master was suspended: its values look fresh, but the drive has continued meanwhile.

        A drive with set-points streamed by the master may have continued, or stopped automatically. Only its own quick stop is a
        ramp in both cases.
        """
        name = self._parameters.name
        by_master = commanded is not None and commanded.by_core
        return StopDemand(
            StaleError(
                f"{name}: this program did not run for {image.gap:.3g} s",
                axis=name,
                observed=f"the scan has a period of {self._parameters.scan_period * 1000:g} ms; after more than "
                f"{self.longest_gap:.3g} s the state of the drive is not certain",
                remedy=f"{REMEDY}; the axis was stopped",
            ),
            StopLevel.QUICK_STOP if by_master else StopLevel.HALT,
            along=False,
        )

    def _unknown(self, image: AxisImage) -> StopDemand:
        return StopDemand(silence(self._parameters, image), StopLevel.QUICK_STOP)

    def _dropped(self, image: AxisImage) -> StopDemand:
        name = self._parameters.name
        return StopDemand(
            DriveError(
                f"{name}: the drive left operation enabled without a command",
                axis=name,
                observed=f"state {image.state.value!r}, statusword 0x{image.statusword or 0:04X}",
                remedy="check for safe torque off, an enable input, a drop of the supply, or another master or tool that "
                "stopped it; then axis.reset() and axis.enable()",
            ),
            StopLevel.QUICK_STOP,
        )

    def _endangered(self, danger: AxisbusError, commanded: CommandedMotion | None) -> StopDemand:
        return StopDemand(danger, stop_of(self._parameters, commanded or CommandedMotion())[0])

    def _lost_error(self, image: AxisImage) -> BusError:
        name, node = self._parameters.name, self._parameters.node
        if image.bus is not None:
            return bus_lost(name, node, image.bus)
        state = NmtState(image.nmt).text
        silent, expected = silence_of(node, image)
        if image.restarted:
            return NodeError(
                f"{name}: node {node} is lost: it sent a boot-up message",
                node=node,
                observed=f"its NMT state is {state}; it has restarted and lost its configuration and position, or a second device "
                f"was switched on with node-ID {node}",
                remedy=f"check whether the supply of node {node} failed, and whether two devices have its node-ID (axisbus "
                f"scan); then {boot_and_reset(node)}",
            )
        starved = image.starvation.text(image.now)
        if image.nmt in SILENT and starved:
            return NodeError(
                f"{name}: {starved}, and no frames of node {node} were received",
                node=node,
                observed=f"{expected}; its last NMT state was {state}; whether the node is still present is not known",
                remedy=join_remedies(REMEDY, f"if it is lost: {remedy_for_silence(node)}"),
            )
        if image.nmt in SILENT:
            return NodeError(
                f"{name}: node {node} is lost: {silent}",
                node=node,
                observed=(f"{expected}; " if image.guarded else "") + f"its last NMT state was {state}",
                remedy=remedy_for_silence(node),
            )
        seen = "it has restarted" if image.nmt == NmtState.INITIALISING else "it still reports itself"
        return NodeError(
            f"{name}: node {node} is lost: its NMT state is {state}, not operational",
            node=node,
            observed=seen,
            remedy=join_remedies(
                REMEDY if starved else "",
                "it missed this program's heartbeat (EMCY 0x8130), or another master or tool commands it, or its supply failed; "
                f"{when_back(node)}",
            ),
        )


def duplicate_error(name: str, node: int, seen: str) -> DuplicateNodeError:
    """Return the error of an axis whose node shares its node-ID with a second device."""
    return DuplicateNodeError(
        f"{name}: two devices have node-ID {node}",
        node=node,
        observed=seen,
        remedy="switch off the device that was added or changed last, give it another node-ID (axisbus lss), and make sure "
        f"that no other device sends frames as node {node}; then {REOPEN}",
    )


def bus_lost(name: str, node: int, bus: BusError) -> BusError:
    """Return the error of an axis that no frame can reach: only the drive's own watchdog can stop it."""
    full = isinstance(bus, TransmitQueueFull)
    what, again = (
        ("cannot be reached", "frames can be sent again") if full else ("is lost", "the bus is back")
    )
    return (TransmitQueueFull if full else BusOff)(
        f"{name}: node {node} {what}: {bus.message}",
        observed=bus.observed,
        remedy=f"make sure that the axis is at standstill: only the drive's own watchdog can stop it now; {bus.remedy}. "
        f"Nothing moves without a command when {again}: axis.reset() if the node is still operational, else "
        f"{start_and_reset(node)}; if it has restarted, {boot_and_reset(node)}",
    )


def silence(parameters: AxisParameters, image: AxisImage) -> AxisbusError:
    """Return the error of an axis whose statusword is no longer received."""
    name, node = parameters.name, parameters.node
    age = image.now - image.statusword_stamp
    never = "it was never received (a TPDO that is shorter than its mapping is dropped: axisbus monitor counts those)"
    seen = never if age > NEVER else f"the last one is {age:.3g} s old"
    starved = image.starvation.text(image.now)
    if starved:
        return StaleError(
            f"{name}: {starved}, and the data from node {node} are too old",
            axis=name,
            observed=f"statusword (6041h): {seen}; whether the node is still present is not known",
            remedy=join_remedies(REMEDY, f"if it is silent: {remedy_for_silence(node)}"),
        )
    if comes_too_late(image, age):
        return StaleError(
            f"{name}: the process data of node {node} come too late",
            axis=name,
            observed=f"{lateness_text(image)}; statusword (6041h): {seen}",
            remedy=f"{LATE_REMEDY}; the axis was stopped",
        )
    if image.position is None and image.velocity is None:
        return NodeError(
            f"{name}: node {node} is lost: it no longer sends process data",
            node=node,
            observed=f"no value of the axis is fresh; statusword (6041h): {seen}",
            remedy=remedy_for_silence(node),
        )
    remedy = "check cable, bus load and that the drive still sends the TPDO (axisbus monitor); the axis was stopped"
    if image.statusword_by_sdo:
        seen += "; it is read by SDO, and the answers come too late or not at all"
        remedy = (
            "check cable and bus load, and look for a slow gateway or adapter; better, let a TPDO carry the statusword "
            "(axisbus boot reports why none does); the axis was stopped"
        )
    return StaleError(
        f"{name}: the statusword (6041h) of node {node} is unknown", axis=name, observed=seen, remedy=remedy
    )
