"""A module with CAN Simple as a ``cia402.port.Port``: CAN frames on one side, a CiA 402 drive on the other.

Theory of operation
-------------------
In each cycle ``receive`` takes the frames that have arrived. ``read`` updates the power stage and returns the state of the drive.
``write`` turns the outputs of the motion code into frames, and ``take_frames`` returns them. The module has no clock, thread or
bus: the time is the one given to ``read``.

- Until a controlword requests something, only requests for values are sent. Closed loop is requested in one place only,
  ``ModulePowerAction.START``. No position is sent before a heartbeat has reported closed loop.
- After each frame, the module holds or completes its last command if no further frame follows. This is the state in which a master
  that dies leaves it. A program that notices this sends ``stop_frames``.
- A message that the firmware does not answer, and missing heartbeats, are events in ``hearing.missing``.
"""

from __future__ import annotations

from collections.abc import Callable

from axisbus.cia301 import abort
from axisbus.cia301.emcy import Emcy
from axisbus.cia301.frame import CanFrame
from axisbus.cia402 import objects as o
from axisbus.cia402.port import Capabilities, Inputs, Outputs, Sample, SdoReply, SdoRequest, ValueTransport
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.port import error_words
from axisbus.drives.gim6010.can_simple.port.drive import ModuleDrive
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback
from axisbus.drives.gim6010.can_simple.port.objects import Address, ModuleObjects, Read, error_objects
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN

_HEARTBEATS = 3.5  # periods of the heartbeat for which a state is valid
_WHOLE_FAULT = 2.0  # s for which requests about a fault may wait for the module's error words


class ModulePort:
    """One module: everything received from it and requested of it."""

    def __init__(self, settings: ModuleSettings) -> None:
        self.settings = settings
        self.hearing = ModuleFeedback(settings)
        self._drive = ModuleDrive(settings, self.hearing)
        self._asked: list[Outgoing] = []
        self._waiting: list[tuple[SdoRequest, float]] = []
        self._emcy: list[Emcy] = []
        self._told_code = 0
        self._now = 0.0
        drive = self._drive
        self.objects = ModuleObjects(
            settings,
            drive.profile,
            self._live(),
            {(o.CONTROLWORD, 0): drive.obey, (o.MODES_OF_OPERATION, 0): drive.choose},
        )
        self.capabilities = _capabilities(settings)

    # -- CAN frames ----------------------------------------------------------------------------------------------------------------

    def receive(self, frame: CanFrame, time: float) -> None:
        """Take a frame of any node on the bus, received at ``time`` (s, the clock of ``read``)."""
        self.hearing.take(frame, time)

    def take_frames(self) -> list[Outgoing]:
        """Return the frames to be sent now, in this order, and clear them: commands first, then requests for values."""
        frames = [*self._drive.frames, *self._asked]
        self._drive.frames.clear()
        self._asked.clear()
        return frames

    def forget(self) -> None:
        """Note that the frames taken last did not reach the module: all commands must be sent again."""
        self._drive.forget()

    def feed_within(self, timeout: float) -> None:
        """Keep a watchdog of the module from expiring, from the first controlword on and as long as controlwords are written.

        ``timeout`` (s) is the shortest armed time-out that was read from the module; 0: none is armed, or it was not read. No
        set-point is sent to a module that is in closed loop without a request by this program.
        """
        self._drive.feed_within(timeout)

    def stop_frames(self) -> list[Outgoing]:
        """Return the frames that stop the module when the scan has died: velocity 0 on the module's own ramp.

        The list is empty if this program does not control the module: an idle module needs no frame, and another master's module
        must not be stopped.
        """
        return self._drive.stop_frames()

    # -- the drive -----------------------------------------------------------------------------------------------------------------

    def read(self, now: float) -> Inputs:
        """Return the state of the drive as known at ``now`` (s), and queue the requests for values that are due."""
        self._now, hearing, drive = now, self.hearing, self._drive
        drive.look(now)
        self._note_fault(now)
        self._asked += hearing.ask(now)
        silent = hearing.overdue(now)
        emcy, self._emcy = tuple(self._emcy), []
        known = hearing.beat is not None
        return Inputs(
            now,
            known and not silent and not hearing.is_new,
            Sample(drive.statusword, hearing.beat_at) if known else None,
            Sample(drive.shown_mode, hearing.beat_at) if known else None,
            self._position,
            self._velocity,
            self._torque,
            None,
            emcy,
            self._answers(now),
            hearing.state,
            overdue=silent,
        )

    def write(self, outputs: Outputs) -> None:
        """Take the outputs of the motion code for this cycle; ``take_frames`` then returns the frames."""
        drive = self._drive
        drive.targets.take(outputs)
        self._waiting = [each for each in self._waiting if each[0].id not in outputs.cancel]
        self._waiting += [(each, self._now) for each in outputs.sdo]
        if outputs.mode is not None:
            drive.choose(outputs.mode)
        if outputs.nmt_stop:
            drive.estop()
        elif outputs.controlword is not None:
            drive.obey(outputs.controlword)

    # -- reported values -----------------------------------------------------------------------------------------------------------

    @property
    def _position(self) -> Sample | None:
        place = self.hearing.place
        return None if place.shown is None else Sample(place.shown, place.stamp)

    @property
    def _velocity(self) -> Sample | None:
        place = self.hearing.place
        stamp = place.velocity_stamp
        return None if stamp is None else Sample(round(place.velocity * TURN), stamp)

    @property
    def _torque(self) -> Sample | None:
        if self.settings.torque is None or self.hearing.current is None:
            return None
        current, at = self.hearing.current
        return Sample(self._drive.profile.permille(current), at)

    def _note_fault(self, now: float) -> None:
        """Report a changed error code as an emergency message does (CiA 301 7.2.7)."""
        words = self.hearing.trouble
        if words.code == self._told_code:
            return
        self._told_code = words.code
        data = (words.words.get(error_words.AXIS) or 0).to_bytes(4, "little") + b"\0"
        self._emcy.append(Emcy(words.code, words.register, data, now))

    # -- objects -------------------------------------------------------------------------------------------------------------------

    def _answers(self, now: float) -> tuple[SdoReply, ...]:
        """Answer the pending SDO requests; requests about a fault wait until the module has reported all its error words."""
        ready = [each for each in self._waiting if self._can_tell(*each, now)]
        self._waiting = [each for each in self._waiting if each not in ready]
        return tuple(self._answer(request) for request, _ in ready)

    def _can_tell(self, request: SdoRequest, asked: float, now: float) -> bool:
        of_fault = (request.index, request.subindex) in error_words.ADDRESSES or request.index == o.ERROR_CODE
        return not of_fault or self.hearing.trouble.told or now - asked >= _WHOLE_FAULT

    def _answer(self, request: SdoRequest) -> SdoReply:
        """Read or write an object; if the module is silent, the reply is a time-out, but commands are sent nevertheless."""
        value, code = None, None
        if request.value is None:
            value, code = self.objects.read(request.index, request.subindex)
        else:
            code = self.objects.write(request.index, request.subindex, request.value)
        if self.hearing.overdue(self._now):
            return SdoReply(request.id, None, abort.TIMED_OUT)
        return SdoReply(request.id, value, code)

    def _live(self) -> dict[Address, Read]:
        drive = self._drive
        found: dict[int, Read] = {
            o.STATUSWORD: lambda: drive.statusword,
            o.MODES_OF_OPERATION: lambda: drive.mode,
            o.MODES_OF_OPERATION_DISPLAY: lambda: drive.shown_mode,
            o.POSITION_ACTUAL: _value(lambda: self._position),
            o.VELOCITY_ACTUAL: _value(lambda: self._velocity),
            o.TARGET_POSITION: lambda: drive.targets.position,
            o.TARGET_VELOCITY: lambda: drive.targets.velocity,
        }
        if self.settings.torque is not None:
            found[o.TORQUE_ACTUAL] = _value(lambda: self._torque)
        # over a serial line, the mode decides whether torque is commanded: the object always exists
        if self.settings.torque is not None or self.settings.relayed:
            found[o.TARGET_TORQUE] = lambda: drive.targets.torque
        return {(index, 0): read for index, read in found.items()} | error_objects(self.hearing.trouble)


def _value(sample: Callable[[], Sample | None]) -> Read:
    return lambda: None if (seen := sample()) is None else seen.value


def _capabilities(settings: ModuleSettings) -> Capabilities:
    """Return how values are transferred: all as if by a synchronous PDO in each cycle; the state is updated by each heartbeat."""
    torque = ValueTransport.NONE if settings.torque is None else ValueTransport.SYNC_PDO
    inputs = dict.fromkeys(("statusword", "mode", "position", "velocity"), ValueTransport.SYNC_PDO)
    outputs = dict.fromkeys(
        ("controlword", "mode", "target_position", "target_velocity"), ValueTransport.SYNC_PDO
    )
    age = max(settings.fresh, 5.0 * settings.period)
    state = max(age, _HEARTBEATS * settings.heartbeat)
    return Capabilities(
        inputs | {"torque": torque, "demand": ValueTransport.NONE},
        outputs | {"target_torque": torque},
        remappable=False,
        max_age=dict.fromkeys(("statusword", "mode"), state)
        | dict.fromkeys(("position", "velocity", "torque"), age)
        | {"demand": 0.0},
    )
