"""``MitControl``: one GIM6010-8 under MIT control, commanded by the user's own loop over CAN Simple.

Theory of operation. A thread of axisbus executes the decisions of the controller (``drives.gim6010.mit_control``): it sends a frame
in each period and takes the received frames. The program gives commands and gets answers. When the program leaves the ``with``
block, for any reason, or gives no command in time, the same stop sequence runs: damping, idle, ESTOP. A process that is killed, or
that does not let Python run, sends nothing any more: only ``break_timeout`` in the module detects that, if it is armed.
"""

from __future__ import annotations

import atexit
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import NoReturn, Self

from axisbus.bus.link import ownership
from axisbus.bus.link.channel import Channel
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine
from axisbus.drives.gim6010.bus.endpoints import CanSimpleParameters
from axisbus.drives.gim6010.bus.run import frames_of, interrupts, send, send_parting
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.endpoints import Firmware, parse
from axisbus.drives.gim6010.can_simple.mit import MitCommand, MitFeedback, MitRanges
from axisbus.drives.gim6010.mit_control import MitCycle, MitLeader, MitSettings, ranges_of
from axisbus.errors import ArgumentError, AxisbusError, NodeError, StateError, UserError

_TICKS = 4  # steps of the thread in a period
_SHORTEST = 0.0005  # s between two of them
_LONGEST = 15.0  # s for enabling or for the stop sequence
_ANSWER = 2.0  # s for an answer; the controller gives up long before
_KEPT = 1000  # queued frames: more means that the thread does not run


class MitControl:
    """A module under MIT control; use it in a ``with`` block, whose end stops it. Only one thread at a time may use its methods."""

    def __init__(self, channel: Channel, settings: MitSettings) -> None:
        """Use a channel that is already open; nothing is sent before ``enable``. ``open`` opens a channel of its own."""
        self.settings = settings
        self._channel = channel
        self._heard: deque[CanFrame] = deque(maxlen=_KEPT)
        self._came = threading.Condition()
        self._leader: MitLeader | None = None
        self._thread: threading.Thread | None = None
        self._stack = ExitStack()
        self._entered = False

    @classmethod
    def open(
        cls,
        interface: str,
        channel: str,
        settings: MitSettings,
        *,
        bitrate: int | None = None,
        **options: object,
    ) -> MitControl:
        """Open a CAN channel by python-can for one module; ``bitrate`` in bit/s if the adapter sets it. Sends nothing.

        Raises:
            SecondMasterError: another program of axisbus has the channel. AdapterError: it cannot be opened.
        """
        with ExitStack() as stack:
            made = cls(_alone(stack, interface, channel, bitrate, options), settings)
            made._stack.push(stack.pop_all().__exit__)
        return made

    def __enter__(self) -> Self:
        self._stack.enter_context(frames_of(self._channel, self.settings.node, self._heard))
        self._stack.callback(atexit.unregister, self._at_exit)
        atexit.register(self._at_exit)
        self._stack.enter_context(interrupts(self._hear_signal))  # ends first
        self._entered = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._entered = False
        try:
            self._part(error)
        finally:
            self._stack.close()

    # Public commands.

    def enable(self) -> MitFeedback:
        """Bring the module into closed loop under MIT control and return its position; nothing jumps. Blocks about 2 s.

        Until the first command, kp is 0, torque is 0 and damping is that of the settings: a load sinks if gravity pulls it.

        Raises:
            StateError: outside the ``with`` block, or it is already enabled.
            NodeError: it is not heard, not idle, has errors, does not answer, or does not enter closed loop; it is left idle.
        """
        if not self._entered:
            raise StateError("MIT control must be used in a with block, whose end stops the module")
        if self._leader is not None and self._leader.done and self._thread is not None:
            self._thread.join(_ANSWER)  # it has practically ended
        if self._thread is not None and self._thread.is_alive():
            raise StateError(f"module {self.settings.node} is under MIT control already")
        self._heard.clear()  # frames received before say nothing about the present
        leader = self._leader = MitLeader(self.settings)
        self._thread = threading.Thread(
            target=self._run, args=(leader,), name="axisbus MIT control", daemon=True
        )
        self._thread.start()
        self._wait(lambda: leader.is_running or leader.done, _LONGEST)
        return self._running(leader).feedback or self._fail(leader)

    def command(self, command: MitCommand) -> MitCycle:
        """Send a command in each period from now on, and return it with the module's next answer. Blocks about one period.

        Values beyond their range are limited and reported (``clipped``). The program must call this again within ``patience``.

        Raises:
            ArgumentError: not a command. StateError: it is not enabled. NodeError: it is being stopped, with the reason.
        """
        if not isinstance(command, MitCommand):
            raise ArgumentError(f"{command!r} is not a command of MIT control", remedy="give a MitCommand")
        leader = self._running(self._leader)
        with self._came:
            number = leader.command(command, time.monotonic())
        self._wait(lambda: leader.answered_number >= number or not leader.is_running, _ANSWER)
        leader = self._running(leader)
        if leader.answered is None or leader.answered_number < number:
            leader.interrupt("a command was not answered")
            self._fail(leader)
        return leader.answered

    def stop(self) -> str:
        """End MIT control: damping until standstill, then idle. Return a text about the final state; blocks, at most 9 s.

        Harmless if the module is not enabled.

        Raises:
            NodeError: the module was not seen to be idle.
        """
        leader = self._leader
        if leader is None:
            return "it was not under MIT control"
        leader.interrupt("the program has ended it")
        self._wait(lambda: leader.done, _LONGEST)
        if not leader.confirmed or not leader.done:
            raise NodeError(
                f"it is not known whether module {self.settings.node} is without power",
                node=self.settings.node,
                observed=leader.left or "its shutdown has not ended",
                remedy="switch its supply off",
            )
        return leader.left

    @property
    def is_active(self) -> bool:
        return self._leader is not None and self._leader.is_running

    @property
    def feedback(self) -> tuple[MitFeedback, float]:
        """The newest answer and its age in s.

        Raises:
            StateError: none was received.
        """
        leader = self._leader
        if leader is None or leader.feedback is None:
            raise StateError(
                f"module {self.settings.node} has not answered MIT control yet", remedy="enable it first"
            )
        return leader.feedback, time.monotonic() - leader.feedback_at

    # The thread.

    def _run(self, leader: MitLeader) -> None:
        tick = max(_SHORTEST, self.settings.period / _TICKS)
        try:
            while not leader.done:
                with self._came:
                    while self._heard:
                        leader.note(self._heard.popleft())
                    frame = leader.step(time.monotonic())
                    self._came.notify_all()
                if frame is not None:
                    self._send(leader, frame)
                time.sleep(tick)
        finally:
            if not leader.done:
                self._give_up(leader)
            with self._came:
                self._came.notify_all()

    def _send(self, leader: MitLeader, frame: Outgoing) -> None:
        try:
            send(self._channel, frame)
        except AxisbusError as error:
            leader.interrupt(f"the bus: {error.message}")

    def _give_up(self, leader: MitLeader) -> None:
        """Send damping and idle, because the controller itself has failed."""
        send_parting(self._channel, leader)
        leader.give_up(
            "the thread of this program has failed: damping and idle were sent, and their effect was not checked"
        )

    # Stopping.

    def _part(self, error: BaseException | None) -> None:
        """Stop the module; if an error ends the block, add the final state to it as a note."""
        try:
            left = self.stop()
        except NodeError as lost:
            if error is None:
                raise
            error.add_note(str(lost))
        else:
            if error is not None and self._leader is not None:
                error.add_note(left)

    def _at_exit(self) -> None:
        with suppress(AxisbusError):
            self.stop()

    def _hear_signal(self, what: str) -> bool:
        """Handle a signal; return whether to raise it in the program: only while the program is in its ``with`` block."""
        leader = self._leader
        if leader is None:
            return self._entered
        leader.interrupt(what)
        if not self._entered:
            leader.escalate()
        return self._entered

    # Helpers.

    def _wait(self, there: Callable[[], bool], seconds: float) -> None:
        """Wait for the thread, in slices in which signal handlers run."""
        end = time.monotonic() + seconds
        thread = self._thread
        while not there() and time.monotonic() < end and thread is not None and thread.is_alive():
            with self._came:
                self._came.wait_for(there, 0.05)

    def _running(self, leader: MitLeader | None) -> MitLeader:
        if leader is None:
            raise StateError(
                f"module {self.settings.node} is not under MIT control", remedy="enable it first"
            )
        if not leader.is_running:
            self._fail(leader)
        return leader

    def _fail(self, leader: MitLeader) -> NoReturn:
        raise NodeError(
            f"module {self.settings.node} is no longer under MIT control: {leader.why or leader.words}",
            node=self.settings.node,
            observed=leader.left or f"it is {leader.words}",
            remedy="clear that cause, then enable it again",
        )


# -- The ranges of MIT control, read from a module over CAN Simple -----------------------------------------------------


def read_mit_ranges(
    interface: str,
    channel: str,
    node: int,
    endpoints: str | Path,
    *,
    made_for: str,
    bitrate: int | None = None,
    **options: object,
) -> MitRanges:
    """Return the ranges of the module with this node-ID (0 to 63). Blocks about 2 s; commands nothing.

    ``endpoints`` is the vendor's list for exactly its firmware, ``made_for`` the firmware version of the list, as "0.6.0".

    Raises:
        UserError: the list cannot be read. ArgumentError: it is not such a list, or does not fit the module.
        SecondMasterError: another program of axisbus has the channel. AdapterError: it cannot be opened.
        NodeError: the module answers no endpoint, or several have this node-ID.
    """
    try:
        text = Path(endpoints).read_bytes()
    except OSError as error:
        raise UserError(f"{endpoints} cannot be read", observed=str(error.strerror)) from error
    listed, version = parse(text, str(endpoints)), Firmware.parse(made_for)
    with ExitStack() as stack:
        line = SimpleLine(_alone(stack, interface, channel, bitrate, options), node)
        module = CanSimpleParameters(line)
        stack.enter_context(line)
        module.open(listed, version)
        return ranges_of(module)


def _alone(
    stack: ExitStack, interface: str, channel: str, bitrate: int | None, options: Mapping[str, object]
) -> Channel:
    """Open a channel that no other program of axisbus has, until ``stack`` closes it."""
    lock = ownership.take(interface, channel)
    if lock is not None:
        stack.enter_context(lock)
    return stack.enter_context(Channel.open(interface, channel, bitrate, **options))
