"""The parameters of a module, read and written as endpoints over CAN Simple; implements ``ModuleParameters``.

Theory of operation
-------------------
The connection is opened in steps, and each step may fail. The client listens to the heartbeats. It reads the version through
endpoints that are the same in all known lists. The list must be made for this version. The client then *proves* the list on the
module: the node ID that it reads through the list must be the node ID that answers. It reads nothing else before that. Functions
are never called: the client saves with a message of CAN Simple, whose number is the same in all versions.

An answer contains the number of its endpoint. An unexpected answer belongs to another master or comes from a second module with
this node ID; the client then writes nothing. Before and after each write the client checks the heartbeats for a restart of the
module.
"""

from __future__ import annotations

from collections import Counter, deque

from axisbus.bus.link.channel import Receiver
from axisbus.drives.gim6010.bus.can_simple_client import PACE, SimpleLine, several
from axisbus.drives.gim6010.bus.settings_by_message import ModuleByMessage
from axisbus.drives.gim6010.can_simple import endpoint_messages
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.endpoint_messages import EndpointAnswer
from axisbus.drives.gim6010.can_simple.endpoints import Endpoint, EndpointList, Firmware
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.make import RESTART_TIME
from axisbus.drives.gim6010.parameters.interface import ParametersByNumber
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.errors import BusError, NodeError, NodeTimeout

TIMEOUT = 0.1  # s for an answer
_TRIES = 2
_SECOND = 0.03  # s in which a second module of this node ID would answer, too
_USB = "odrivetool over USB reads and writes them; many modules answer no endpoint over CAN"
_STATE = "axis0.current_state"
_LISTEN = 0.3  # s for the first heartbeats after a restart


class CanSimpleParameters(ParametersByNumber):
    """``ModuleParameters`` of one module on a channel; holds state: the answers, and the values written since the last save."""

    def __init__(self, line: SimpleLine) -> None:
        """``line`` must not be open yet. Nothing is sent before ``open``."""
        super().__init__()
        self.line = line
        self.node = line.node
        self._answers: deque[EndpointAnswer] = deque(maxlen=64)
        self._odd: list[str] = []
        self._asked: Counter[int] = Counter()  # by endpoint: number of answers that may still come
        self._strangers = 0
        for command in endpoint_messages.COMMANDS:
            line.hear(command, self._receiver(command))

    def open(self, listed: EndpointList, made_for: Firmware) -> None:
        """Listen, and prove that the list fits; blocks for about 1.5 s.

        Raises:
            NodeTimeout: the module answers no endpoint.
            NodeError: several modules have this node ID.
            ArgumentError: the list does not fit the reported firmware, or is not proven on the module.
        """
        self.line.listen()
        self.firmware = self._version()
        self._fit(listed, made_for)
        (self.serial,) = self._numbers((endpoint_messages.request_serial(self.node),))

    def _fetch(self, endpoint: Endpoint) -> Value:
        """Read a value; blocks for at most about 0.3 s."""
        self.line.require_there()
        frame = endpoint_messages.read(self.node, self._list, endpoint.path)
        return endpoint_messages.value(endpoint, self._ask(frame, endpoint.id, endpoint.path).data)

    def _store(self, endpoint: Endpoint, value: Value) -> Value:
        self._require_alone()
        # ``write`` has checked whether a protected parameter was named
        self.line.send(endpoint_messages.write(self.node, self._list, endpoint.path, value, by_name=True))
        self.line.clock.sleep(PACE)
        held = self._fetch(endpoint)
        self.line.require_there()
        return held

    def _save(self) -> None:
        """Save with the message Save_Configuration."""
        self._come_back(self._save_and_restart())

    def save_and_leave(self) -> None:
        """Save as ``save`` does, but return when the restart begins, because the module will not be reachable after it."""
        self._save_and_restart()

    def _save_and_restart(self) -> float:
        """Save and wait until the module begins to restart; return when the save was requested (s, monotonic)."""
        self.require_idle()
        self._require_alone()
        return self.line.save(
            "it is not known whether the values were saved: save over USB, or read them again after a power cycle",
            self._is_silent,
        )

    @property
    def axis_error(self) -> int:
        """The axis's error word in its last heartbeat, 0 if there was none."""
        last = self.line.pulse.last
        return 0 if last is None else last.axis_error

    def _clear(self) -> None:
        ModuleByMessage(self.line).clear()

    def _state(self) -> int:
        """Return the state of the last heartbeat; the parameter of the axis state if the module sends no heartbeat."""
        self.line.require_there()
        state = self.line.state
        return int(self.read(_STATE)) if state is None else state

    def _version(self) -> Firmware:
        major, minor, revision = self._numbers(endpoint_messages.request_version(self.node), again=True)
        return Firmware(major & 0xFF, minor & 0xFF, revision & 0xFF)

    def _numbers(self, frames: tuple[Outgoing, ...], *, again: bool = False) -> list[int]:
        """Return the values of endpoints that every list has; with ``again``, wait for the answers of a second module."""
        found = []
        for frame in frames:
            number = int.from_bytes(frame.data[1:3], "little")
            found.append(int.from_bytes(self._ask(frame, number, "its version").data, "little"))
            if again:
                self.line.clock.sleep(_SECOND)
                self._require_alone()
        return found

    def _require_alone(self) -> None:
        if self._strangers:
            raise several(self.node)

    # -- one question, one answer ---------------------------------------------------------------------------------------------

    def _ask(self, frame: Outgoing, number: int, what: str) -> EndpointAnswer:
        if self._asked[number]:  # a late answer must not be taken for the answer to this request
            self.line.clock.sleep(TIMEOUT)
            self._asked[number] = 0
        self._answers.clear()
        for _ in range(_TRIES):
            self._asked[number] += 1
            self.line.send(frame)
            if self.line.wait(lambda: self._answered(number), TIMEOUT):
                self.line.clock.sleep(PACE)
                return self._answers.popleft()
        self.line.require_there()
        raise NodeTimeout(
            f"module {self.node} does not answer for {what}",
            node=self.node,
            observed=self._seen(),
            remedy=f"check its protocol: axisbus gim6010 find; {_USB}",
        )

    def _answered(self, number: int) -> bool:
        """Return whether the answer has come; discard late answers to other requests."""
        while self._answers and self._answers[0].endpoint != number:
            self._answers.popleft()
        return bool(self._answers)

    def _seen(self) -> str:
        odd = (
            f"; frames that are not answers: {'; '.join(dict.fromkeys(self._odd[-3:]))}" if self._odd else ""
        )
        beats = "its heartbeats come" if self.line.state is not None else "it sent no heartbeat"
        return f"{_TRIES} requests, {TIMEOUT:g} s each; {beats}{odd}"

    def _receiver(self, command: int) -> Receiver:
        identifier = can_id(self.node, command)

        def take(data: bytes, _: float) -> None:
            found = endpoint_messages.answer(identifier, data)
            if not isinstance(found, EndpointAnswer):
                self._odd.append(found.words)
            elif not self._asked[found.endpoint]:
                self._strangers += 1
            else:
                self._asked[found.endpoint] -= 1
                self._answers.append(found)
                self.line.notify()

        return take

    # -- restarts -------------------------------------------------------------------------------------------------------------

    def _is_silent(self) -> bool:
        """Whether the heartbeats have stopped; if the module sends none, whether it no longer answers."""
        if self.line.pulse.stamps:
            return self.line.state is None
        try:
            self._version()
        except BusError:
            return True
        return False

    def _come_back(self, began: float) -> None:
        """Wait until the module answers as before, and prove the list again."""
        seen = ""
        while self.line.clock.now() < began + RESTART_TIME:
            try:
                self.line.listen(_LISTEN)
                if self._version() == self.firmware:
                    self.line.listen(_LISTEN)
                    self._prove()
                    return
            except NodeError as error:  # the module is restarting, so silence is expected
                seen = error.message
        raise NodeTimeout(
            f"module {self.node} does not come back after saving",
            node=self.node,
            observed=f"it did not answer within {RESTART_TIME:g} s; {seen}",
            remedy="search for it: axisbus gim6010 find; a new bit rate or protocol is active from now on",
        )
