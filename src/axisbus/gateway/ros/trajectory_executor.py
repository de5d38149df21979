"""Execute trajectories: validate each and follow it, with control of the machine while one runs.

Theory of operation
-------------------
The network's thread processes incoming messages and never waits. A trajectory without points halts at once, through a client
without control, whichever client has control. All other trajectories go to a second thread, which may block: it joins the machine
with control if that is free. It releases control ``_LINGER`` seconds after the last trajectory has ended, or as soon as a halt has
ended one, so that other clients can enable, home and jog meanwhile. A halt also cancels waiting trajectories. While it has control,
this program reports to the core several times in ``_HOLD`` seconds that it runs; if the reports stop, the core halts the axes that
this program has moved.
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
_HOLD = 0.5  # seconds without a report of this program after which the core halts the axes that it has moved
_BEAT = 0.1
_LINGER = 1.0  # seconds for which control is held after the end of a trajectory
_LOOK = 0.1
_WAITED = 1.0  # seconds: a trajectory that has waited longer since its arrival is not started
_MOST = 2  # the most waiting trajectories
_HALT_FIRST = "wait for its end, or send a trajectory without points, which halts"
Join = Callable[[], Machine]
Tell = Callable[[str, AxisbusError | None], None]


class _Heard(NamedTuple):
    data: bytes
    at: float
    halts: int  # the number of halts before it


class Commander:
    """Hold the waiting trajectories, the machine with control, and the running trajectory; ``hear`` is for the network's thread."""

    def __init__(
        self, machine: Machine, join: Join, joints: Callable[[], Mapping[str, JointUnit]], tell: Tell
    ) -> None:
        """``machine`` is joined without control, ``join`` joins it with control; ``tell`` reports to people."""
        self._machine = machine
        self._stops = MergedStops(machine)
        self._join = join
        self._joints = joints
        self._tell = tell
        self._lock = threading.Lock()  # protects the halts
        self._beating = threading.Lock()  # protects the freshness
        self._freshness = Freshness(time.monotonic())
        self._waiting: queue.Queue[_Heard] = queue.Queue(_MOST)
        self._halts = self._halts_seen = 0
        self._guest: Machine | None = None
        self._handle: Handle | None = None
        self._busy_at = 0.0
        self._over = threading.Event()
        self._threads = [
            threading.Thread(target=run, name=f"ROS {name}", daemon=True)
            for name, run in (("trajectories", self._run), ("beat", self._run_beat))
        ]

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    @property
    def commands(self) -> bool:
        """Whether it has control of the machine now."""
        return self._guest is not None

    def close(self) -> None:
        """Halt the axes that it has moved, and end; blocks until they are at standstill, or known not to be."""
        with self._lock:
            self._halts += 1
            self._over.set()
        for thread in self._threads:
            thread.join()
        self._let_go()

    # -- the network's thread ------------------------------------------------------------------------------------------

    def hear(self, data: bytes, attached: bytes | None) -> None:
        """Process a message; does not block."""
        now = time.monotonic()
        try:
            self._take(data, attached, now)
        except AxisbusError as error:
            self._tell("a trajectory was refused", error)

    def _take(self, data: bytes, attached: bytes | None, now: float) -> None:
        named = names_to_halt(data)
        if named is not None:
            self._halt(named)
            return
        attachment = attachment_of(attached)
        with self._beating:
            self._freshness.require(attachment, now, time.time())
        with self._lock:
            halts = self._halts
        try:
            self._waiting.put_nowait(_Heard(data, now, halts))
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
            mark_end_as_read(self._stops.give(name, "halt"))
        self._tell(f"a trajectory without points arrived: {', '.join(names)}: halt", None)

    # -- the threads ---------------------------------------------------------------------------------------------------

    def _run_beat(self) -> None:
        while not self._over.wait(_BEAT):
            with self._beating:
                self._freshness.beat(time.monotonic())
            guest = self._guest
            if guest is not None:
                with suppress(Exception):  # the machine ends, or control is being released: nothing to hold
                    guest.hold_to_run(_HOLD)

    def _run(self) -> None:
        while not self._over.is_set():
            try:
                heard = self._waiting.get(timeout=_LOOK)
            except queue.Empty:
                self._look()
                continue
            try:
                self._follow(heard)
            except AxisbusError as error:
                self._tell("a trajectory was refused", error)
            except Exception as error:
                log.exception("a trajectory could not be executed")
                self._tell(
                    "a trajectory was refused", AxisbusError("it could not be executed", observed=str(error))
                )

    def _follow(self, heard: _Heard) -> None:
        if self._handle is not None and self._handle.busy:
            raise StateError("a trajectory is being executed", remedy=_HALT_FIRST)
        wanted = judged(trajectory_of(heard.data), self._joints(), time.time_ns())
        for name in wanted.axes:
            _require_rest(self._machine[name])
        guest = self._commanding()
        group = guest.group(*wanted.axes)
        with self._lock:
            self._require_wanted(heard)
            self._halts_seen = heard.halts
        handle = self._handle = group.follow(wanted.points)  # checking a long trajectory takes a while
        if heard.halts != self._halts:
            mark_end_as_read(group.halt())
        self._busy_at = time.monotonic()
        self._tell(_told(wanted), None)
        handle.add_done_callback(lambda: self._end(handle))

    def _require_wanted(self, heard: _Heard) -> None:
        if heard.halts != self._halts:
            raise Stopped("the trajectory was not started", observed="a halt arrived after it")
        if time.monotonic() - heard.at > _WAITED:
            raise StateError(
                "the trajectory was not started",
                observed=f"the machine was not ready for it within {_WAITED:g} s",
                remedy="send it again",
            )

    def _commanding(self) -> Machine:
        """Return the machine with control; raise OwnershipError if another program has it."""
        if self._guest is not None and not self._guest.has_control:
            self._let_go()
        if self._guest is None:
            guest = self._join()
            guest.hold_to_run(_HOLD)
            self._guest = guest
            self._busy_at = time.monotonic()
        return self._guest

    def _look(self) -> None:
        """Release control if no trajectory has run for a while."""
        now = time.monotonic()
        if self._handle is not None and self._handle.busy:
            self._busy_at = now
        elif self._guest is not None and (now - self._busy_at > _LINGER or self._halts != self._halts_seen):
            self._let_go()

    def _let_go(self) -> None:
        guest, self._guest = self._guest, None
        if guest is None:
            return
        try:
            guest.close()
        except BaseException as error:  # noqa: BLE001  # the machine may be gone: then there is nothing to release
            log.info("while control was released: %s", error)

    def _end(self, handle: Handle) -> None:
        error = handle.exception()
        if error is None:
            self._tell("the trajectory is complete" if handle.done else "the trajectory was aborted", None)
        else:
            self._tell("the trajectory has ended early", error)


def _require_rest(axis: Axis) -> None:
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


def _told(wanted: RosTrajectory) -> str:
    return f"{', '.join(wanted.axes)}: a trajectory of {counted(len(wanted.points), 'point')}, {wanted.points[-1].time:g} s"


# -- Check that a message is fresh: not repeated, not reordered, not delayed, and received while this program runs -----
#
# Theory of operation
# The clocks of two computers are not compared. The transmission time of a message is known except for the difference of both
# clocks. So the shortest time of a publisher's messages is stored, and a message that took ``HELD_UP`` longer is late. The stored
# time grows by the drift of the clocks: otherwise, if the publisher's clock is slow by 0.1 ms per second, all of its messages would
# be late after three hours. The first message of a publisher has no other one to be compared with: it is late if it is old by the
# clock of this computer, and so are those that arrive within ``AGAIN`` after it, because a stalled network delivers its messages
# together. A program that did not run for a while (suspended, starved) then receives all waiting messages at once:
# for ``AGAIN`` after that, no message is fresh.


HELD_UP = 1.0  # seconds
AGAIN = 1.0  # seconds
STOOD = 0.5  # seconds without a call of ``beat``
_MESSAGE_FRESHNESS_MOST = 256  # the most remembered publishers
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
        self._beat = now
        self._from = now

    def beat(self, now: float) -> None:
        """Note that this program runs; to be called several times within ``STOOD``."""
        if now - self._beat > STOOD:
            self._from = now + AGAIN
        self._beat = now

    def require(self, attachment: Attachment, now: float, wall: float) -> None:
        """Check that a message is fresh, and note it; ``wall``: the time in s since 1970 by the clock of this computer.

        Raises:
            StateError: the message is not fresh.
        """
        number, sent = attachment.number, attachment.sent / 1e9
        known = self._known.get(attachment.gid)
        lag = (MessageLag(most=HELD_UP) if known is None else known.lag).told(sent, now)
        newest = max(number, number if known is None else known.number)
        late_until = known.late_until if known is not None else now + AGAIN if wall - sent > HELD_UP else 0.0
        self._note(attachment.gid, _Known(newest, lag, late_until))
        if now - self._beat > STOOD or now < self._from:
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
        late = lag.lateness(sent, now)
        if late > HELD_UP:
            raise StateError(
                "a trajectory arrived too late",
                observed=f"it was {late:.3f} s slower than other messages of its sender",
                remedy=f"{_REMEDY}; if the clock of the sender was set back, restart the sender",
            )

    def _note(self, gid: bytes, known: _Known) -> None:
        self._known[gid] = known
        self._known.move_to_end(gid)
        while len(self._known) > _MESSAGE_FRESHNESS_MOST:
            self._known.popitem(last=False)
