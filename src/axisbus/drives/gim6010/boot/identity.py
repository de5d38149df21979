"""Listen to one module and ask it questions, and check, as far as possible, that it is the one of the cell file."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeVar, cast

from axisbus.bus.link.channel import Channel
from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.bus.run import send
from axisbus.drives.gim6010.can_simple.endpoints import Firmware
from axisbus.drives.gim6010.can_simple.heartbeat import HeartbeatLayout, HeartbeatMonitor
from axisbus.drives.gim6010.discovery.questions import ProbeFrame, SimpleFacts
from axisbus.drives.gim6010.factory_protocols import is_beat
from axisbus.errors import BootError

T = TypeVar("T")

_TICK = 0.002  # s between two checks for new frames
_ANSWER = 0.1  # s allowed for an answer
_KEPT = 1000  # frames stored until they are evaluated


@dataclass(slots=True)
class NodeListener:
    """The frames received from one node ID; holds state.

    ``canopen`` counts the heartbeats of a CANopen node of this ID, ``extended`` counts the heartbeats of the 29-bit protocol.
    """

    channel: Channel
    node: int
    answer: float = _ANSWER  # s allowed for one answer
    canopen: int = 0
    extended: int = 0
    pulse: HeartbeatMonitor = field(init=False)
    _heard: deque[CanFrame] = field(default_factory=lambda: deque(maxlen=_KEPT))

    def __post_init__(self) -> None:
        self.pulse = HeartbeatMonitor(self.node)

    def hear(self, frame: CanFrame) -> None:
        """Store a frame. Runs in the receive thread."""
        self._heard.append(frame)

    def wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Listen for ``seconds``, or until ``until`` returns true; return the last result of ``until``. Blocks.

        Raises AdapterError if the channel has failed.
        """
        end = self.channel.clock.now() + seconds
        while not until() and self.channel.clock.now() < end:
            self._take_all()
            self.channel.clock.sleep(_TICK)
        self.channel.check()
        return until()

    @property
    def quickest(self) -> float:
        """The shortest time (s) between two heartbeats, as a busy computer delays some; infinite before the second heartbeat."""
        times = [stamp for stamp, _ in self.pulse.stamps]
        return min((after - before for before, after in pairwise(times)), default=math.inf)

    def ask(self, asking: Generator[ProbeFrame, CanFrame | None, T]) -> T:
        """Ask all questions of ``asking``, one after the other, and return its result; blocks for at most 0.1 s per question."""
        try:
            question = next(asking)
            while True:
                question = asking.send(self._answer(question))
        except StopIteration as end:
            return cast("T", end.value)

    def _answer(self, question: ProbeFrame) -> CanFrame | None:
        self._take_all()
        send(self.channel, question.frame)
        end = self.channel.clock.now() + self.answer
        while self.channel.clock.now() < end:
            for frame in self._take_all():
                if question.answered_by(frame):
                    return frame
            self.channel.clock.sleep(_TICK)
        return None

    def _take_all(self) -> list[CanFrame]:
        frames = [self._heard.popleft() for _ in range(len(self._heard))]
        for frame in frames:
            self._take(frame)
        return frames

    def _take(self, frame: CanFrame) -> None:
        self.extended += is_beat(frame)
        if frame.extended or frame.remote or frame.error:
            return
        self.canopen += frame.can_id == cob.HEARTBEAT + self.node and len(frame.data) == 1
        self.pulse.take(frame)


HEARTBEAT, IDENTITY = "heartbeat", "identity"
_COUNTS, _NEWEST = Firmware(0, 5, 12), Firmware(0, 5, 13)  # the first with each layout (manual v2.2, 4.1.2)
_SLOW = 1.5  # longest accepted heartbeat period, as a multiple of the expected period
_FIND = "axisbus gim6010 find lists the modules and their protocols"


def no_answer_error(listening: NodeListener, seconds: float, health: str) -> BootError:
    """Return the error of a module that sent no heartbeat within ``seconds``; ``health`` is the state of the channel."""
    node = listening.node
    if listening.canopen:
        return _told(
            f"node {node} uses CANopen, not CAN Simple",
            node,
            f"heartbeats of a CANopen node came: {0x700 + node:03X}h",
            f'write eds = "builtin:gim6010-8" in [nodes.{node}] instead of protocol = "can_simple"',
        )
    if listening.extended:
        return _told(
            f"module {node} sends no CAN Simple heartbeat, and a device uses the 29-bit protocol of firmware 0.6.8 and later",
            node,
            f"{listening.extended} heartbeats with identifiers of 29 bits came in {seconds:g} s",
            f"axisbus does not support that protocol: switch the module to CANopen over USB (docs/gim6010-8.md); {_FIND}",
        )
    return _told(
        f"module {node} does not answer",
        node,
        f"it sent no heartbeat in {seconds:g} s; {health}",
        "check its supply, cable and termination, its node ID and bit rate, and that its heartbeat_rate_ms is 100; "
        + _FIND,
    )


def require_one(listening: NodeListener, expected: float) -> None:
    """Check that only one module has the node ID and that it sends a heartbeat at least every 1.5 times ``expected`` (s).

    Raises:
        BootError: several modules have the node ID, or the heartbeats come too seldom.
    """
    node = listening.node
    if not listening.pulse.alone:
        raise _told(
            f"several modules have the node ID {node}",
            node,
            "the heartbeats contain two counters",
            "connect one of them alone and give it another node ID: axisbus gim6010 set-id",
        )
    period = listening.quickest
    if period > _SLOW * expected:
        often = "only one heartbeat" if math.isinf(period) else f"a heartbeat each {period * 1000:.0f} ms"
        raise _told(
            f"module {node} sends its heartbeat too seldom: it would be considered lost, and its states would be received "
            "too late",
            node,
            f"{often}; the factory setting is one each {expected * 1000:.0f} ms",
            f"set axis0.config.can.heartbeat_rate_ms to {expected * 1000:.0f}: axisbus gim6010 params set, or over USB",
        )


def require_firmware(listening: NodeListener, facts: SimpleFacts, text: str | None) -> None:
    """Compare the firmware of the cell file (None: not given) with the module's answer, or else with its heartbeat layout.

    Raises:
        BootError: the module has another firmware.
    """
    if text is None:
        return
    node, wanted = listening.node, Firmware.parse(text)
    observed = ""
    if facts.version is not None and facts.version != wanted:
        observed = f"it reports {facts.version}"
    elif (
        facts.version is None
        and listening.pulse.beats.layouts
        and _layout(wanted) not in listening.pulse.beats.layouts
    ):
        shown = " or ".join(sorted(each.value for each in listening.pulse.beats.layouts))
        observed = f"its heartbeats show {shown}"
    if observed:
        raise BootError(
            f"module {node} has a firmware other than {wanted}, which cell.toml specifies",
            node=node,
            step=IDENTITY,
            observed=observed,
            remedy=f"correct firmware in [nodes.{node}], or connect the intended module; {_FIND}",
        )


def words(listening: NodeListener, facts: SimpleFacts, text: str | None) -> str:
    """Return firmware and serial number of the module in words, as far as they are known."""
    if facts.version is not None:
        serial = "" if facts.serial is None else f", serial number ends in {facts.serial:08X}h"
        return f"firmware {facts.version}, by its endpoints{serial}"
    layouts = " or ".join(sorted(each.value for each in listening.pulse.beats.layouts)) or "no known layout"
    asked = "" if text is None else f"; firmware {text} by the cell file, which it does not confirm"
    return f"it answers no endpoint, so only its heartbeats are known: {layouts}{asked}"


def _layout(firmware: Firmware) -> HeartbeatLayout:
    if firmware < _COUNTS:
        return HeartbeatLayout.FIRST
    return HeartbeatLayout.COUNTED if firmware < _NEWEST else HeartbeatLayout.NEWEST


def _told(message: str, node: int, observed: str, remedy: str) -> BootError:
    return BootError(message, node=node, step=HEARTBEAT, observed=observed, remedy=remedy)
