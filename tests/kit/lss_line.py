"""A line in virtual time for LSS dialogues, and a slave typed from CiA 305 for it, which shares nothing with the library.

The line does the same as ``axisbus.bus.lss`` in real time: it sends a request, collects the answers of its kind, reports late ones.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Generator
from typing import Any

TRAVEL = 0.0003  # s: a frame there and one back, at 1 Mbit/s


class HandSlave:
    """One LSS slave; ``delay`` in s; ``errors`` maps a command to (error code, specific code); ``deaf_for`` commands are not
    heard; ``silent`` is deaf altogether.
    """

    def __init__(self, vendor: int, product: int = 8, revision: int = 1, serial: int = 0, node_id: int = 255):
        self.id = (vendor, product, revision, serial)
        self.active = self.pending = node_id
        self.state = "waiting"
        self.position = 0
        self.delay = 0.0
        self.errors: dict[int, tuple[int, int]] = {}
        self.deaf_for: set[int] = set()
        self.silent = False
        self.stored: list[int] = []
        self.bit_timing: tuple[int, int] | None = None
        self.activated: int | None = None
        self.booted_as: list[int] = []
        self._matched = 0
        self._range_ok = True

    def hear(self, frame: bytes) -> bytes | None:
        """Take a request, return the answer or None."""
        assert len(frame) == 8, "LSS frames have 8 bytes"
        command, value = frame[0], frame[1] | frame[2] << 8 | frame[3] << 16 | frame[4] << 24
        if self.silent or command in self.deaf_for:
            return None
        if command == 0x04:
            self._global(frame[1])
        elif 0x46 <= command <= 0x4B:
            return self._identify(command, value)
        elif command == 0x4C:
            return _answer(0x50) if self.active == 255 else None
        elif self.state == "waiting":
            if 0x40 <= command <= 0x43:
                return self._selective(command - 0x40, value)
            if command == 0x51 and self.active == 255 and self.pending == 255:
                return self._fastscan(value, frame[5], frame[6], frame[7])
        else:
            return self._configuration(command, frame)
        return None

    def _global(self, mode: int) -> None:
        self.state = "configuration" if mode else "waiting"
        if not mode and self.active == 255 and self.pending != 255:
            self.active = self.pending
            self.booted_as.append(self.active)

    def _selective(self, part: int, value: int) -> bytes | None:
        self._matched = self._matched + 1 if self.id[part] == value and part == self._matched else 0
        if part == 0 and self.id[0] == value:
            self._matched = 1
        if self._matched < 4:
            return None
        self._matched, self.state = 0, "configuration"
        return _answer(0x44)

    def _identify(self, command: int, value: int) -> bytes | None:
        vendor, product, revision, serial = self.id
        self._range_ok = {
            0x46: lambda: vendor == value,
            0x47: lambda: product == value,
            0x48: lambda: revision >= value,
            0x49: lambda: revision <= value,
            0x4A: lambda: serial >= value,
            0x4B: lambda: serial <= value,
        }[command]() and (self._range_ok or command == 0x46)
        return _answer(0x4F) if command == 0x4B and self._range_ok else None

    def _fastscan(self, value: int, bit: int, sub: int, following: int) -> bytes | None:
        if bit == 0x80:
            self.position = 0
            return _answer(0x4F)
        if sub != self.position:
            return None
        mask = 0xFFFFFFFF << bit & 0xFFFFFFFF
        if value & mask != self.id[sub] & mask:
            return None
        if bit == 0 and following != sub:
            self.position = following
            if sub == 3:
                self.state = "configuration"
        return _answer(0x4F)

    def _configuration(self, command: int, frame: bytes) -> bytes | None:
        if command in self.errors:
            return _answer(command, *self.errors[command])
        if command == 0x11:
            self.pending = frame[1]
        elif command == 0x13:
            self.bit_timing = (frame[1], frame[2])
        elif command == 0x15:
            self.activated = frame[1] | frame[2] << 8
            return None
        elif command == 0x17:
            self.stored.append(self.pending)
        elif 0x5A <= command <= 0x5D:
            return _answer(command, *self.id[command - 0x5A].to_bytes(4, "little"))
        elif command == 0x5E:
            return _answer(command, self.active)
        else:
            return None
        return _answer(command, 0)


class AnswersOn(HandSlave):
    """A stack that answers fast scan in configuration, too, as it does in waiting, and with a node-ID if it has one."""

    def hear(self, frame: bytes) -> bytes | None:
        if frame[0] == 0x51 and self.state == "configuration" and not self.silent:
            return self._fastscan(_number(frame), frame[5], frame[6], frame[7])
        return super().hear(frame)


class AnswersOnSelected(AnswersOn):
    """A stack that keeps answering, and gives its numbers only if selected by its own address, not if fast scan found it."""

    selected = False

    def hear(self, frame: bytes) -> bytes | None:
        if frame[0] == 0x04:
            self.selected = False
        answer = super().hear(frame)
        if answer is not None and answer[0] == 0x44:
            self.selected = True
        return None if 0x5A <= frame[0] <= 0x5D and not self.selected else answer


class AnswersAnything(HandSlave):
    """A stack that answers every fast scan request in configuration, whatever it is asked for."""

    def hear(self, frame: bytes) -> bytes | None:
        if frame[0] == 0x51 and self.state == "configuration":
            return _answer(0x4F)
        return super().hear(frame)


class AnswersResets(HandSlave):
    """A stack that answers the first request of a fast scan in configuration, and none after it."""

    def hear(self, frame: bytes) -> bytes | None:
        if frame[0] == 0x51 and self.state == "configuration" and frame[5] == 0x80:
            return _answer(0x4F)
        return super().hear(frame)


class Sticky(HandSlave):
    """Stays in waiting although fast scan has found it, as some firmware does."""

    def _fastscan(self, value: int, bit: int, sub: int, following: int) -> bytes | None:
        answer = super()._fastscan(value, bit, sub, following)
        self.state = "waiting"
        return answer


def _number(frame: bytes) -> int:
    return frame[1] | frame[2] << 8 | frame[3] << 16 | frame[4] << 24


def _answer(*data: int) -> bytes:
    return bytes(data).ljust(8, b"\0")


class Line:
    """Runs dialogues against slaves; ``lost(number)`` says whether the frame with this running number (from 0) gets lost."""

    def __init__(self, *slaves: HandSlave, lost: Callable[[int], bool] = lambda _: False):
        self.slaves = list(slaves)
        self.lost = lost
        self.now = 0.0
        self.sent: list[bytes] = []
        self.frames = 0
        self.progress: list[tuple[int, int]] = []
        self._coming: list[tuple[float, int, bytes]] = []
        self._asked = (0, 0.0)

    def run(self, dialogue: Generator[Any, Any, Any]) -> Any:
        """Run a dialogue to its end and return its result."""
        try:
            ask = next(dialogue)
            while True:
                self.progress.append((ask.found, ask.bits))
                ask = dialogue.send(self._exchange(ask))
        except StopIteration as end:
            return end.value

    def _exchange(self, ask: Any) -> Any:
        from axisbus.cia305.dialogue import LssReplies, LssReply

        late = [
            moment - self._asked[1] for moment, data in self._until(self.now) if data[0] == self._asked[0]
        ]
        sent = self.now
        self._send(ask.frame)
        answers: list[LssReply] = []
        until = self.now + ask.wait
        while self._coming and self._coming[0][0] <= until:
            moment, _, data = heapq.heappop(self._coming)
            if ask.expects is None and data[0] == self._asked[0]:
                late.append(moment - self._asked[1])
            elif ask.expects is not None and data[0] == ask.expects:
                if not answers:
                    until = moment + ask.settle
                answers.append(LssReply(data, moment - sent))
        self.now = until
        if ask.expects is not None:
            self._asked = (int(ask.expects), sent)
        return LssReplies(tuple(answers), tuple(late))

    def _until(self, moment: float) -> list[tuple[float, bytes]]:
        found = []
        while self._coming and self._coming[0][0] <= moment:
            stamp, _, data = heapq.heappop(self._coming)
            found.append((stamp, data))
        return found

    def _send(self, frame: bytes) -> None:
        self.sent.append(frame)
        if self._is_lost():
            return
        for slave in self.slaves:
            answer = slave.hear(frame)
            if answer is not None and not self._is_lost():
                heapq.heappush(self._coming, (self.now + TRAVEL + slave.delay, self.frames, answer))

    def _is_lost(self) -> bool:
        self.frames += 1
        return self.lost(self.frames - 1)
