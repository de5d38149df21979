"""A control loop of the user's program: it gets the values of each cycle, and its answer is the set-point of the next.

Theory of operation
-------------------
Nothing of it runs in the core. A thread of the program waits for the values of the next cycle, calls the function, and sends its
result as a command. The core checks the answers against its cycles (``motion.cyclic.user_controller``): if one is missing, it stops
the axis, whatever prevents the program from answering. In virtual time, where no other thread runs, the function is called after
each cycle.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import NamedTuple, Self

from axisbus.cia402.modes import ModeOfOperation
from axisbus.core.lateness import Lateness
from axisbus.errors import ArgumentError
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.handle import Handle, end_with, mark_end_as_read
from axisbus.machine.request import AxisCall
from axisbus.motion.commands import ControllerCommand, ControllerOutput, CyclicTorque
from axisbus.motion.numbers import short_repr
from axisbus.motion.parameters import AxisParameters, Units
from axisbus.motion.snapshot import Snapshot
from axisbus.session import LatenessReport

_CHECKS = 40  # checks for the next values in a scan period
_LEAST, _MOST = 0.00005, 0.0005  # seconds between two checks


@dataclass(frozen=True, slots=True)
class AxisFeedback:
    """The input of a control loop: ``time`` of the cycle (s, monotonic), ``dt`` since the previous one that it got (s).

    ``position``, ``velocity`` and ``torque`` as those of the axis, of one cycle; None if unknown.
    """

    time: float
    dt: float
    position: float | None
    velocity: float | None
    torque: float | None


Function = Callable[[AxisFeedback], float]


class Controller:
    """A running control loop; made by ``Axis.controller``, for a ``with`` block or until ``stop()``.

    ``handle`` is that of the loop: it ends when another command takes the axis over or stops it, and with an error if the function
    raised or answered too late. ``error`` is the exception of the function. ``saturated_count`` counts the answers that were
    limited.
    """

    handle: Handle
    saturated_count: int
    error: BaseException | None

    def __init__(
        self,
        name: str,
        units: Units,
        period: float,
        commanding: CommandDispatcher,
        function: Function,
        answering: Answering,
        halt: Callable[[], Handle],
    ) -> None:
        """``name`` of the axis, ``period`` of the scan in seconds; ``halt`` halts the axis."""
        self._name, self._units, self._period = name, units, period
        self._commanding, self._session = commanding, commanding.session
        self._function, self._answering, self._halt = function, answering, halt
        self._text = f"{name}.controller"
        self._took = Lateness()
        self._last = self._session.snapshots[name].now
        self.saturated_count = 0
        self.error = None
        self.handle = commanding.submit(name, answering.command, self._text)
        if self._session.waiter.realtime:
            threading.Thread(target=self._run, name=f"axisbus {self._text}", daemon=True).start()
        else:
            self._session.observe(self._observe)

    def __repr__(self) -> str:
        return f"<Controller of {self._name}: {self.handle.status.value}; {self.lateness}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Halt the axis, and wait until it is at standstill; raise the error if one has ended the loop before.

        After an exception in the block the method waits as well. If the halt then fails, the exception gets a note.
        """
        failure = self.handle.exception()
        end_with(self.stop(), failure if error is None else error)
        if error is None and failure is not None:
            raise failure

    @property
    def lateness(self) -> LatenessReport:
        """The number of answers, and their delay from the beginning of the cycle: an answer within a scan period is in time."""
        return self._took.report()

    def stop(self) -> Handle:
        """Halt the axis, which ends the loop; return the handle of the halt. Does not block; harmless when repeated."""
        return self._halt()

    # -- cycle by cycle --------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while self.handle.busy:
            snapshot = self._next()
            if snapshot is not None:
                self._answer(snapshot)

    def _next(self) -> Snapshot | None:
        """Wait for the values of the next cycle; None if they do not come in time."""
        pause = min(max(self._period / _CHECKS, _LEAST), _MOST)
        time.sleep(max(0.0, self._last + self._period - time.monotonic()))
        for _ in range(_CHECKS):
            snapshot = self._session.snapshots[self._name]
            if snapshot.now > self._last:
                return snapshot
            time.sleep(pause)
        return None

    def _observe(self, _now: float, snapshots: Mapping[str, Snapshot]) -> None:
        if self.handle.busy:
            self._answer(snapshots[self._name])
        else:
            self._session.forget(self._observe)

    def _answer(self, snapshot: Snapshot) -> None:
        """If the drive is in the mode, call the function and send its result."""
        dt, self._last = snapshot.now - self._last, snapshot.now
        if snapshot.mode != self._answering.mode or self.error is not None:
            return
        number = self._answering.command.number
        try:
            answer = ControllerOutput(
                number, snapshot.now, self._raw(self._function(self._measured(snapshot, dt)))
            )
        except BaseException as error:  # noqa: BLE001  # whatever it is, the axis must be stopped
            self.error = error
            answer = ControllerOutput(number, snapshot.now, 0, f"{type(error).__name__}: {error}")
        given = self._commanding.submit(self._name, answer, f"{self._text}, an answer")
        mark_end_as_read(given)  # an answer is refused only if the loop has already ended with an error
        if self._session.waiter.realtime:
            self._took.note(time.monotonic() - snapshot.now)

    def _measured(self, snapshot: Snapshot, dt: float) -> AxisFeedback:
        units = self._units
        position = velocity = torque = None
        if snapshot.position is not None:
            position = units.turned(units.position.to_units(snapshot.position - snapshot.origin))
        if snapshot.velocity is not None:
            velocity = units.velocity.to_units(snapshot.velocity)
        if snapshot.torque is not None:
            torque = units.torque(snapshot.torque)
        return AxisFeedback(snapshot.now, dt, position, velocity, torque)

    def _raw(self, value: float) -> int:
        limit = self._answering.limit
        if limit is not None and abs(value) > limit:
            self.saturated_count += 1
            value = min(max(value, -limit), limit)
        return self._answering.raw(value)


# ----------------------------------------------------------------------------------------------------------------------
# The checked options of a controller: its output, its ramps, and the number of cycles that an answer may be missing.


_LATEST = 1000  # cycles
_OUTPUTS = ("velocity", "torque")


class Answering(NamedTuple):
    """How answers are applied in ``mode``; ``limit`` of their magnitude (None: none); ``raw`` converts and checks one."""

    command: ControllerCommand
    mode: ModeOfOperation
    limit: float | None
    raw: Callable[[float], int]


class ControllerRamps(NamedTuple):
    """The ramps of the call: unit/s² or N·m/s; None: the defaults of the axis."""

    acceleration: float | None
    deceleration: float | None
    slope: float | None


def answering_of(
    parameters: AxisParameters, output: object, ramps: ControllerRamps, max_missed_cycles: object
) -> Answering:
    """Return how a controller's answers are applied to an axis.

    Raises:
        ArgumentError, LimitError: a value that a controller cannot have, or a missing value.
    """
    request = AxisCall(parameters, "controller")
    if not isinstance(output, str) or output not in _OUTPUTS:
        raise ArgumentError(
            f"{request.text}: output {short_repr(output)} is not known",
            remedy='give "velocity" (unit/s, in csv) or "torque" (N·m, in cst)',
        )
    if (
        not isinstance(max_missed_cycles, int)
        or isinstance(max_missed_cycles, bool)
        or not 0 <= max_missed_cycles <= _LATEST
    ):
        raise ArgumentError(
            f"{request.text}: max_missed_cycles {short_repr(max_missed_cycles)} is not a number of cycles from 0 to {_LATEST}"
        )
    number = secrets.randbits(48)
    if output == "velocity":
        up, down = ramps.acceleration, ramps.deceleration
        begin = request.cyclic_velocity(0.0, up, down)
        return Answering(
            ControllerCommand(number, begin, max_missed_cycles),
            ModeOfOperation.CYCLIC_SYNC_VELOCITY,
            parameters.limits.velocity,
            lambda value: request.cyclic_velocity(value, up, down).velocity,
        )
    torque = CyclicTorque(request.torque(0.0), request.cyclic_slope(ramps.slope))
    return Answering(
        ControllerCommand(number, torque, max_missed_cycles),
        ModeOfOperation.CYCLIC_SYNC_TORQUE,
        parameters.limits.torque,
        request.torque,
    )
