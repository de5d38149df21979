"""One axis as a pure step function: commands and inputs in, outputs out (PLCopen's axis over CiA 402).

Theory of operation
-------------------
In each cycle ``step`` does four things, in this order:

1. ``Image`` decodes the inputs; what is too old is unknown.
2. ``_supervise`` looks for what nobody asked for: node lost, fault, power stage dropped, statusword gone, limits in danger.
   Each ends in ``fail``: state ErrorStop, stop ladder, the command's handle ends with the reason.
3. One of three is stepped: the stop ladder if there is one, else the running activity, else nothing (the last targets hold).
4. ``Order`` turns the wishes into ``Outputs``.

Nothing is sent to a drive before a command asks for something (``Order.goal`` is None until then): a drive found enabled is left as
it is. Once enabled by us, a drive that leaves *operation enabled* is never enabled again by the planner: that takes a new command.
"""

from __future__ import annotations

import math
from enum import IntEnum

from axisbus.cia301.nmt import NmtState
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Capabilities, Inputs, Outputs
from axisbus.cia402.state import ENERGISED, State
from axisbus.errors import AxisbusError, DriveError, Interrupted, NodeError, Replaced, StaleError, Stopped
from axisbus.motion.activity import Activity
from axisbus.motion.diagnosis import FaultStory, History, enrich
from axisbus.motion.follow import Follow
from axisbus.motion.guard import Guard
from axisbus.motion.handle import Handle, Status, end_as
from axisbus.motion.image import Image
from axisbus.motion.ladder import Rung, StopLadder, Then
from axisbus.motion.moves import PositionMove, stale_statusword
from axisbus.motion.order import Order
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.setpoint import SetPoint
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import MOVING, AxisState


class StopKind(IntEnum):
    """Why the stop ladder runs; a higher one takes over a lower one."""

    HALT = 0
    POLICY = 1
    STOP = 2
    DISABLE = 3
    QUICK_STOP = 4
    ERROR = 5
    SHUTDOWN = 6


_FAULTS = frozenset({State.FAULT, State.FAULT_REACTION_ACTIVE})
_MAY_BE_ENERGISED = ENERGISED | {State.UNKNOWN}
_POWERED = MOVING | {AxisState.STANDSTILL, AxisState.STOPPING}


class AxisCore:
    """State and behaviour of one axis; every public attribute is read-only to others.

    ``state`` is PLCopen's; ``error`` says why it is ErrorStop. ``touched``: this program has commanded the drive, so the way out
    stops it. ``powered``: an enable of ours has succeeded and power has not been taken away since.
    """

    def __init__(self, parameters: AxisParameters, capabilities: Capabilities) -> None:
        self.parameters = parameters
        self.capabilities = capabilities
        window = parameters.timing.standstill_window
        tolerance = max(2.0, (parameters.standstill_speed or 0.0) * window)
        self.image = Image(capabilities, parameters.scan_period, tolerance, window)
        oldest = capabilities.max_age.get("statusword", math.inf)
        self._longest_gap = max(oldest if math.isfinite(oldest) else 1.0, 10 * parameters.scan_period, 0.25)
        self.order = Order()
        self.history = History()
        self.guard = Guard(parameters)
        self.state = AxisState.DISABLED
        self.error: AxisbusError | None = None
        self.homed = False
        self.powered = False
        self.touched = False
        self.tripped: AxisbusError | None = None  # set for one cycle: the fault policy reads it
        self.activity: Activity | None = None
        self.handle: Handle | None = None
        self.ladder: StopLadder | None = None
        self.stop_kind = StopKind.HALT
        self.stop_handles: list[Handle] = []
        self.last_target: int | None = None
        self.halted = False
        self.set_point: SetPoint | None = None
        self._story: FaultStory | None = None
        self._story_handles: list[Handle] = []
        self._story_doing = ""
        self._met_operational = False
        self._lost = False
        self.has_ended = False  # a handle has ended since the scan last looked

    # -- one cycle ---------------------------------------------------------------------------------------------------

    def step(self, inputs: Inputs) -> Outputs:
        """Do one cycle's work and return what the drive is to get."""
        image, order = self.image, self.order
        image.update(inputs)
        self.tripped = None
        order.clear()
        self.history.note(image)
        self._supervise(image)
        if self._story is not None:
            self._step_story(image, order)
        order.halt = self.halted
        if self.ladder is not None:
            self._step_ladder(self.ladder, image, order)
        elif self.activity is not None:
            self._step_activity(self.activity, image, order)
        self.halted = order.halt
        if self.state is AxisState.SYNCHRONIZED_MOTION and order.target_position is not None:
            self.last_target = order.target_position
        return order.outputs(image.state)

    def snapshot(self) -> Snapshot:
        """Return what other threads may see of this axis."""
        image = self.image
        return Snapshot(
            image.now,
            self.state,
            image.state,
            image.statusword,
            image.mode,
            image.position,
            image.position_stamp,
            image.velocity,
            image.torque,
            self.last_target,
            image.origin,
            self.homed,
            image.operational,
            self.error,
        )

    def abandon(self, error: AxisbusError) -> None:
        """End every handle with ``error``: the scan has ended."""
        handles = [*self.stop_handles, *self._story_handles]
        if self.handle is not None:
            handles.append(self.handle)
        for handle in handles:
            self.finish(handle, error)

    # -- supervision -------------------------------------------------------------------------------------------------

    def _supervise(self, image: Image) -> None:
        """Look for what nobody asked for."""
        if image.operational:
            self._met_operational = True
        elif self._met_operational and not self._lost:
            self._lost = True
            self.fail(self._lost_error(image), Rung.QUICK_STOP)
            return
        if image.state in _FAULTS:
            if self._story is None and self.state is not AxisState.ERRORSTOP:
                self._fault(image)
            return
        if self.ladder is not None:
            return
        if self.powered and self.state in _POWERED:
            self._watch_time(image)
            self._watch_power(image)
        elif not self.touched and self.error is None:
            self._show_found(image)

    def _show_found(self, image: Image) -> None:
        """A drive that nobody has commanded yet: its axis is in the state that the drive shows."""
        if image.state not in ENERGISED:
            self.state = AxisState.DISABLED
        else:
            self.state = AxisState.STANDSTILL if image.standstill else AxisState.CONTINUOUS_MOTION

    def _watch_time(self, image: Image) -> None:
        """A program that was suspended comes back with values that look fresh and a world that has moved on."""
        if image.gap <= self._longest_gap:
            return
        self.fail(
            StaleError(
                f"{self.parameters.name}: this program did not run for {image.gap:.3g} s",
                axis=self.parameters.name,
                observed=f"the scan has a period of {self.parameters.scan_period * 1000:g} ms; longer than "
                f"{self._longest_gap:.3g} s the state of the drive cannot be trusted",
                remedy="do not suspend the program (SIGSTOP, a debugger, a laptop's sleep) and do not starve it of time; the axis "
                "was stopped",
            )
        )

    def _watch_power(self, image: Image) -> None:
        if self.ladder is not None:
            return
        if image.state is State.OPERATION_ENABLED:
            danger = self.guard.danger(image, self.state)
            if danger is not None:
                self.fail(danger)
            return
        if image.state is State.QUICK_STOP_ACTIVE and self.state is AxisState.STOPPING:
            return
        if image.state is State.UNKNOWN:
            self.fail(stale_statusword(self.parameters.name, image), Rung.QUICK_STOP)
            return
        name = self.parameters.name
        self.fail(
            DriveError(
                f"{name}: the drive left operation enabled by itself",
                axis=name,
                observed=f"state {image.state.value!r}, statusword 0x{image.statusword or 0:04X}",
                remedy="look for safe torque off, an enable input, a supply that dropped, or another master or tool that stopped "
                "it; then axis.reset() and axis.enable()",
            ),
            Rung.QUICK_STOP,
        )

    def _lost_error(self, image: Image) -> NodeError:
        name, node = self.parameters.name, self.parameters.node
        silent = image.nmt in (NmtState.OPERATIONAL, NmtState.UNKNOWN)
        seen = (
            "its heartbeat stopped"
            if silent
            else f"its NMT state is {NmtState(image.nmt).text}, not operational"
        )
        return NodeError(
            f"{name}: node {node} is lost",
            node=node,
            observed=seen + (" (0: it has restarted)" if image.nmt == 0 else ""),
            remedy="check its supply and cable; a drive that restarted has lost its configuration and position: close the machine "
            "and open it again (another master or tool may also have stopped it)",
        )

    # -- failure -----------------------------------------------------------------------------------------------------

    def fail(self, error: AxisbusError, rung: Rung = Rung.HALT) -> None:
        """Go to ErrorStop because of ``error``, and stop the axis from ``rung`` on."""
        enrich(error, self.image, self.history)
        self._trip(error)
        self.end_command(error)
        if self.touched and self.image.state in _MAY_BE_ENERGISED:
            self.start_ladder(StopKind.ERROR, Then.HOLD, rung)
        elif self.order.goal is not None:
            self.order.goal = State.SWITCH_ON_DISABLED

    def _trip(self, error: AxisbusError) -> None:
        self.state = AxisState.ERRORSTOP
        self.error = error
        self.tripped = error

    def _fault(self, image: Image) -> None:
        """The drive reports a fault: stop asking for anything, find out why, then tell."""
        doing = f" during {self.handle.name}" if self.handle is not None and self.handle.busy else ""
        self._story = FaultStory(self.parameters, image.now)
        self._story_doing = doing
        self._trip(self._story.tell(doing, image, self.history))
        if self.handle is not None:
            self._story_handles.append(self.handle)
        self._story_handles += self.stop_handles
        self._drop_command()
        self.ladder, self.stop_handles = None, []
        self.powered = False
        if self.touched:
            self.order.goal = State.SWITCH_ON_DISABLED

    def _step_story(self, image: Image, order: Order) -> None:
        story = self._story
        if story is None or not story.step(image, order):
            return
        error = story.tell(self._story_doing, image, self.history)
        self._story = None
        if self.state is AxisState.ERRORSTOP:
            self.error = error
        handles, self._story_handles = self._story_handles, []
        for handle in handles:
            self.finish(handle, error)

    # -- commands and their ends -------------------------------------------------------------------------------------

    def begin(self, activity: Activity, handle: Handle, state: AxisState | None = None) -> None:
        """Let ``activity`` take over; the running command ends as replaced."""
        self.end_command(Replaced(f"{self._doing()} was replaced by {handle.name}"))
        if self.ladder is not None:
            self._end_stop(Replaced(f"{self._stopping()} was replaced by {handle.name}"))
            self.ladder = None
        self.touched = True
        self.activity, self.handle = activity, handle
        handle.status = Status.ACTIVE
        if state is not None:
            self.state = state

    def end_command(self, error: AxisbusError | None) -> None:
        """End the running command, keeping a set-point handshake that is under way."""
        handle = self.handle
        self._drop_command()
        if handle is not None:
            self.finish(handle, error)

    def _drop_command(self) -> None:
        if isinstance(self.activity, PositionMove):
            self.set_point = self.activity.in_flight
        cancel = getattr(self.activity, "cancel", None)
        if cancel is not None:
            cancel(self.order)
        self.activity, self.handle = None, None

    def finish(self, handle: Handle, error: AxisbusError | None = None) -> None:
        """End a handle, well (no error) or with the reason."""
        if handle.busy:
            handle.finish(Status.DONE if error is None else end_as(error), error)
            self.has_ended = True

    def _doing(self) -> str:
        return self.handle.name if self.handle is not None else f"{self.parameters.name}'s motion"

    def _stopping(self) -> str:
        return self.stop_handles[0].name if self.stop_handles else f"{self.parameters.name}'s stop"

    def _step_activity(self, activity: Activity, image: Image, order: Order) -> None:
        if self.set_point is not None and not isinstance(activity, PositionMove):
            self._finish_handshake(image, order)
        try:
            done = activity.step(image, order)
        except AxisbusError as error:
            self._activity_failed(error)
            return
        if done and self.handle is not None and self.handle.busy:
            self.completed(activity)

    def completed(self, activity: Activity) -> None:
        """The activity has ended well: set the state that follows it."""
        handle, self.handle = self.handle, None
        if handle is not None:
            self.finish(handle)
        after = getattr(activity, "mode", None)
        if self.state is AxisState.CONTINUOUS_MOTION:
            return  # it goes on until something else is wanted
        self.activity = None
        if after is ModeOfOperation.HOMING:
            self._homed()
        self._settle()

    def _settle(self) -> None:
        """Take the state that the power stage shows, after a command that has ended well."""
        image = self.image
        self.error = None
        held = image.state is State.QUICK_STOP_ACTIVE
        self.powered = (image.state is State.OPERATION_ENABLED and self.order.goal is image.state) or held
        if held:
            self.state = AxisState.STOPPING
        else:
            self.state = AxisState.STANDSTILL if self.powered else AxisState.DISABLED

    def clear_error(self) -> None:
        """Leave ErrorStop, where the drive itself is in no fault; nothing moves by this."""
        if self.state is AxisState.ERRORSTOP and self.image.operational:
            self._lost = False
            self._settle()
        # a node that is still lost stays in ErrorStop, and says why

    def _homed(self) -> None:
        self.homed = True
        self.image.origin = 0
        self.image.rebase()
        self.last_target = self.image.position

    def _activity_failed(self, error: AxisbusError) -> None:
        if isinstance(error, Interrupted):  # it ended by its own rule, as a jog does: the axis halts
            self.end_command(error)
            self.start_ladder(StopKind.HALT, Then.HOLD)
            return
        self.powered = self.powered and self.image.state in ENERGISED
        self.fail(error)

    # -- stopping ----------------------------------------------------------------------------------------------------

    def start_ladder(
        self,
        kind: StopKind,
        then: Then,
        rung: Rung = Rung.HALT,
        handle: Handle | None = None,
        follow: Follow | None = None,
    ) -> None:
        """Start the stop ladder, or let a stronger stop take over the one that runs; ``follow`` is braked along its path."""
        if handle is not None:
            self.stop_handles.append(handle)
            handle.status = Status.ACTIVE
        if self.ladder is not None:
            if kind < self.stop_kind:
                return
            follow = self.ladder.follow
            rung = max(rung, self.ladder.rung)
        self.ladder = StopLadder(self.parameters, then, start=rung, follow=follow)
        self.stop_kind = kind
        self.touched = True

    def _step_ladder(self, ladder: StopLadder, image: Image, order: Order) -> None:
        if self.set_point is not None and ladder.rung is Rung.HALT:
            self._finish_handshake(image, order)
        if ladder.step(image, order):
            self.ladder = None
            self._stopped(ladder, image)

    def _finish_handshake(self, image: Image, order: Order) -> None:
        """Let a set-point handshake that was under way come to its end, under halt."""
        assert self.set_point is not None
        try:
            if self.set_point.step(image, order):
                self.set_point = None
        except DriveError:
            self.set_point = None  # the next move will find bit 12 as it is, and say so

    def _stopped(self, ladder: StopLadder, image: Image) -> None:
        self.powered = ladder.confirmed and image.state in ENERGISED
        self.last_target = image.reference
        error = self._stop_error(ladder, image)
        if error is None and self.error is None:
            self.state = self._state_after_stop(image)
        elif error is not None and self.error is None:
            self._trip(enrich(error, image, self.history))
        elif error is not None and self.error is not None:
            self.error.observed += f"; {error.message} ({error.observed})"
            self.error.remedy = f"{error.remedy}; {self.error.remedy}"
        self._end_stop(error)

    def _state_after_stop(self, image: Image) -> AxisState:
        if image.state not in ENERGISED:
            return AxisState.DISABLED
        locked = self.stop_kind is StopKind.STOP or image.state is State.QUICK_STOP_ACTIVE
        return AxisState.STOPPING if locked else AxisState.STANDSTILL

    def _stop_error(self, ladder: StopLadder, image: Image) -> AxisbusError | None:
        if ladder.confirmed and not ladder.descended:
            return None
        name = self.parameters.name
        path = " > ".join(rung.text for rung in ladder.path)
        if ladder.confirmed:
            return DriveError(
                f"{name}: stopped only by a harder stop than was asked for",
                axis=name,
                observed=f"stop ladder: {path}",
                remedy="raise the time of the rung that was too short in [axes."
                + name
                + ".stop], or look why the drive does "
                "not brake in time",
            )
        return DriveError(
            f"{name}: could not be confirmed as stopped",
            axis=name,
            observed=f"stop ladder: {path}; state {image.state.value!r}, standstill not seen",
            remedy="TREAT THE AXIS AS MOVING: use the emergency stop; then check cable and drive",
        )

    def _end_stop(self, error: AxisbusError | None) -> None:
        handles, self.stop_handles = self.stop_handles, []
        for handle in handles:
            self.finish(handle, error)

    def stop_because(
        self, kind: StopKind, then: Then, rung: Rung, reason: str, handle: Handle | None
    ) -> None:
        """Stop the axis: the running command ends with ``reason``."""
        follow = self.activity if isinstance(self.activity, Follow) else None
        self.end_command(Stopped(reason))
        self.start_ladder(kind, then, rung, handle, follow)
