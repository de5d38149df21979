"""Execute trajectories: validate each and follow it, with control of the machine while one runs.

Theory of operation
-------------------
The network's thread processes incoming messages and never waits. A trajectory without points halts at once, through a client
without control, whichever client has control. All other trajectories go to a second thread, which may block: it joins the machine
with control if that is free. It releases control ``_CONTROL_TIME`` seconds after the last trajectory has ended, or as soon as a
halt has ended one, so that other clients can enable, home and jog meanwhile. A halt also cancels waiting trajectories. While it has
control, this program reports to the core several times in ``_HOLD_TIME`` s that it runs; if the reports stop, the core halts the
axes that this program has moved.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.client_support.dead_man import MessageLag
from axisbus.client_support.merged_stops import MergedStops
from axisbus.errors import AxisbusError, StateError, Stopped
from axisbus.gateway.ros.messages import Attachment, attachment_of, trajectory_of
from axisbus.gateway.ros.trajectory import RosTrajectory, judged, names_to_halt, to_halt
from axisbus.gateway.ros.units import JointUnit
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle, mark_end_as_read
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.wording import counted

log = logging.getLogger("axisbus")
# seconds without a report of this program after which the core halts the axes that it has moved
_HOLD_TIME = 0.5
_BEAT_PERIOD = 0.1
_CONTROL_TIME = 1.0  # seconds for which control is held after the end of a trajectory
_POLL_PERIOD = 0.1
_WAITED = 1.0  # seconds: a trajectory that has waited longer since its arrival is not started
_MAX_WAITING = 2  # the most waiting trajectories
_HALT_FIRST = "wait for its end, or send a trajectory without points, which halts"
Attach = Callable[[], Machine]
Report = Callable[[str, AxisbusError | None], None]


class _ReceivedTrajectory(NamedTuple):
    data: bytes
    at: float
    halts: int  # the number of halts before it


class Commander:
    """Hold the waiting trajectories, the machine with control, and the running one; the network's thread calls ``receive``."""

    def __init__(
        self, machine: Machine, attach: Attach, joints: Callable[[], Mapping[str, JointUnit]], report: Report
    ) -> None:
        """``machine`` is joined without control, ``attach`` joins it with control; ``report`` reports to people."""
        self._machine = machine
        self._stops = MergedStops(machine)
        self._attach = attach
        self._joints = joints
        self._report = report
        self._lock = threading.Lock()  # protects the halts
        self._freshness_lock = threading.Lock()  # protects the freshness
        self._freshness = Freshness(time.monotonic())
        self._waiting: queue.Queue[_ReceivedTrajectory] = queue.Queue(_MAX_WAITING)
        self._halts = self._halts_before = 0
        self._controlled: Machine | None = None
        self._handle: Handle | None = None
        self._busy_at = 0.0
        self._closing = threading.Event()
        self._threads = [
            threading.Thread(target=run, name=f"ROS {name}", daemon=True)
            for name, run in (("trajectories", self._run), ("beat", self._run_beats))
        ]

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    @property
    def commands(self) -> bool:
        """Whether it has control of the machine now."""
        return self._controlled is not None

    def close(self) -> None:
        """Halt the axes that it has moved, and end; blocks until they are at standstill, or known not to be."""
        with self._lock:
            self._halts += 1
            self._closing.set()
        for thread in self._threads:
            thread.join()
        self._release()

    # -- the network's thread ------------------------------------------------------------------------------------------

    def receive(self, data: bytes, attached: bytes | None) -> None:
        """Process a message; does not block."""
        now = time.monotonic()
        try:
            self._accept(data, attached, now)
        except AxisbusError as error:
            self._report("a trajectory was refused", error)

    def _accept(self, data: bytes, attached: bytes | None, now: float) -> None:
        named = names_to_halt(data)
        if named is not None:
            self._halt(named)
            return
        attachment = attachment_of(attached)
        with self._freshness_lock:
            self._freshness.require(attachment, now, time.time())
        with self._lock:
            halts = self._halts
        try:
            self._waiting.put_nowait(_ReceivedTrajectory(data, now, halts))
        except queue.Full:
            raise StateError(
                "a trajectory arrived while others wait",
                remedy="send the next one when the axes are at standstill",
            ) from None

    def _halt(self, named: tuple[str, ...]) -> None:
        with self._lock:
            self._halts += 1
        names = to_halt(named, self._machine.axes)
        for name in names:
            mark_end_as_read(self._stops.send(name, "halt"))
        self._report(f"a trajectory without points arrived: {', '.join(names)}: halt", None)

    # -- the threads ---------------------------------------------------------------------------------------------------

    def _run_beats(self) -> None:
        while not self._closing.wait(_BEAT_PERIOD):
            with self._freshness_lock:
                self._freshness.beat(time.monotonic())
            controlled = self._controlled
            if controlled is not None:
                with suppress(Exception):  # the machine ends, or control is being released: nothing to hold
                    controlled.hold_to_run(_HOLD_TIME)

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                received = self._waiting.get(timeout=_POLL_PERIOD)
            except queue.Empty:
                self._release_if_idle()
                continue
            try:
                self._follow(received)
            except AxisbusError as error:
                self._report("a trajectory was refused", error)
            except Exception as error:
                log.exception("a trajectory could not be executed")
                self._report(
                    "a trajectory was refused", AxisbusError("it could not be executed", observed=str(error))
                )

    def _follow(self, received: _ReceivedTrajectory) -> None:
        if self._handle is not None and self._handle.busy:
            raise StateError("a trajectory is being executed", remedy=_HALT_FIRST)
        trajectory = judged(trajectory_of(received.data), self._joints(), time.time_ns())
        for name in trajectory.axes:
            _require_standstill(self._machine[name])
        controlled = self._machine_with_control()
        group = controlled.group(*trajectory.axes)
        with self._lock:
            self._require_still_valid(received)
            self._halts_before = received.halts
        handle = self._handle = group.follow(trajectory.points)  # checking a long trajectory takes a while
        if received.halts != self._halts:
            mark_end_as_read(group.halt())
        self._busy_at = time.monotonic()
        self._report(_description(trajectory), None)
        handle.add_done_callback(lambda: self._end(handle))

    def _require_still_valid(self, received: _ReceivedTrajectory) -> None:
        if received.halts != self._halts:
            raise Stopped("the trajectory was not started", observed="a halt arrived after it")
        if time.monotonic() - received.at > _WAITED:
            raise StateError(
                "the trajectory was not started",
                observed=f"the machine was not ready for it within {_WAITED:g} s",
                remedy="send it again",
            )

    def _machine_with_control(self) -> Machine:
        """Return the machine with control; raise OwnershipError if another program has it."""
        if self._controlled is not None and not self._controlled.has_control:
            self._release()
        if self._controlled is None:
            controlled = self._attach()
            controlled.hold_to_run(_HOLD_TIME)
            self._controlled = controlled
            self._busy_at = time.monotonic()
        return self._controlled

    def _release_if_idle(self) -> None:
        """Release control if no trajectory has run for a while."""
        now = time.monotonic()
        if self._handle is not None and self._handle.busy:
            self._busy_at = now
        elif self._controlled is not None and (
            now - self._busy_at > _CONTROL_TIME or self._halts != self._halts_before
        ):
            self._release()

    def _release(self) -> None:
        controlled, self._controlled = self._controlled, None
        if controlled is None:
            return
        try:
            controlled.close()
        except BaseException as error:  # noqa: BLE001  # the machine may be gone: then there is nothing to release
            log.info("while control was released: %s", error)

    def _end(self, handle: Handle) -> None:
        error = handle.exception()
        if error is None:
            self._report("the trajectory is complete" if handle.done else "the trajectory was aborted", None)
        else:
            self._report("the trajectory has ended early", error)


def _require_standstill(axis: Axis) -> None:
    if not axis.enabled:
        raise StateError(
            f"{axis.name} is not enabled, and no trajectory enables it",
            observed=f"it is {axis.state.value}",
            remedy=f"enable it by another program: axisbus enable CELL {axis.name}",
        )
    if axis.state is not AxisState.STANDSTILL:
        raise StateError(
            f"{axis.name} is moving, and a trajectory begins from standstill",
            observed=f"it is {axis.state.value}",
            remedy=_HALT_FIRST,
        )


def _description(trajectory: RosTrajectory) -> str:
    points = trajectory.points
    return f"{', '.join(trajectory.axes)}: a trajectory of {counted(len(points), 'point')}, {points[-1].time:g} s"


# -- Check that a message is fresh: not repeated, not reordered, not delayed, and received while this program runs -----
#
# Theory of operation
# The clocks of two computers are not compared. The transmission time of a message is known except for the difference of both
# clocks. So the shortest time of a publisher's messages is stored, and a message that took ``MAX_DELAY`` longer is late. The stored
# time grows by the drift of the clocks: otherwise, if the publisher's clock is slow by 0.1 ms per second, all of its messages would
# be late after three hours. The first message of a publisher has no other one to be compared with: it is late if it is old by the
# clock of this computer, and so are those that arrive within ``RECOVERY_TIME`` after it, because a stalled network delivers its
# messages together. A program that did not run for a while (suspended, starved) then receives all waiting messages at once: for
# ``RECOVERY_TIME`` after that, no message is fresh.


MAX_DELAY = 1.0  # seconds
RECOVERY_TIME = 1.0  # seconds
MAX_PAUSE = 0.5  # seconds without a call of ``beat``
_MAX_PUBLISHERS = 256  # the most remembered publishers
_REMEDY = "send it again, with another number"


@dataclass(slots=True)
class _Known:
    number: int
    lag: MessageLag
    late_until: float = 0.0  # of a publisher whose first message was late


class Freshness:
    """Hold the last message of each publisher, and when this program was last seen to run; times in s, monotonic, local."""

    def __init__(self, now: float) -> None:
        self._known: OrderedDict[bytes, _Known] = OrderedDict()
        self._last_beat = now
        self._from = now

    def beat(self, now: float) -> None:
        """Note that this program runs; to be called several times within ``MAX_PAUSE``."""
        if now - self._last_beat > MAX_PAUSE:
            self._from = now + RECOVERY_TIME
        self._last_beat = now

    def require(self, attachment: Attachment, now: float, wall: float) -> None:
        """Check that a message is fresh, and note it; ``wall``: the time in s since 1970 by the clock of this computer.

        Raises:
            StateError: the message is not fresh.
        """
        number, sent = attachment.number, attachment.sent / 1e9
        known = self._known.get(attachment.gid)
        lag = (MessageLag(max_growth=MAX_DELAY) if known is None else known.lag).updated(sent, now)
        newest = max(number, number if known is None else known.number)
        late_until = 0.0
        if known is not None:
            late_until = known.late_until
        elif wall - sent > MAX_DELAY:
            late_until = now + RECOVERY_TIME
        self._note(attachment.gid, _Known(newest, lag, late_until))
        if now - self._last_beat > MAX_PAUSE or now < self._from:
            raise StateError(
                "a trajectory arrived while the bridge was suspended",
                remedy=f"{_REMEDY}, when the bridge runs again",
            )
        if known is not None and number <= known.number:
            raise StateError(
                "a trajectory arrived twice, or out of order",
                observed=f"its number is {number}, and {known.number} had arrived before",
                remedy=_REMEDY,
            )
        if now < late_until:
            raise StateError(
                "the first trajectory of a publisher arrived too late",
                observed=f"by the clock of its sender it was sent {wall - sent:.1f} s ago",
                remedy=f"{_REMEDY}; if the clocks of both computers differ, synchronise them",
            )
        delay = lag.lateness(sent, now)
        if delay > MAX_DELAY:
            raise StateError(
                "a trajectory arrived too late",
                observed=f"it was {delay:.3f} s slower than other messages of its sender",
                remedy=f"{_REMEDY}; if the clock of the sender was set back, restart the sender",
            )

    def _note(self, gid: bytes, known: _Known) -> None:
        self._known[gid] = known
        self._known.move_to_end(gid)
        while len(self._known) > _MAX_PUBLISHERS:
            self._known.popitem(last=False)
