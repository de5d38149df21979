"""LSS slave of a simulated node (CiA 305): node-ID and bit rate set over the bus.

It is independent of the master's code, with its own transitions and numbers.

Theory of operation
-------------------
The slave is in state *waiting* or *configuration*. In *waiting* it accepts switching commands and, without a node-ID, fast scan; in
*configuration* it accepts configuration and inquiry commands. There are three node-IDs: the *active* one under which it answers,
the *pending* one that becomes active with a reset of communication, and the *stored* one that becomes pending with a restart. A
node without an active node-ID takes the pending one as soon as it is switched back to *waiting*.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable

from axisbus.sim.fault_injection import LssFaults

NO_NODE_ID = 255
# Bit/s by index in the table of CiA 305.
_RATES = {
    0: 1_000_000,
    1: 800_000,
    2: 500_000,
    3: 250_000,
    4: 125_000,
    6: 50_000,
    7: 20_000,
    8: 10_000,
}
_OUT_OF_RANGE = 1
_RESET_SCAN = 128

Address = tuple[int, int, int, int]


class LssSlave:
    """State of the LSS slave: node-IDs, bit rates, the requests of a sequence so far, pending answers."""

    def __init__(self, address: Callable[[], Address], node_id: int, dials: LssFaults, seed: int = 0) -> None:
        """Make a slave; ``address`` returns its identity (1018h:1 to 4); ``node_id`` 255: no node-ID."""
        self.active = self.pending = self.stored = node_id
        self.bit_rate = self.pending_bit_rate = 0  # bit/s; 0: the bit rate at power-up
        self.configuring = False
        self.dials = dials
        self._address = address
        self._random = random.Random(seed)
        self._answers: deque[tuple[float, bytes]] = deque()
        self._selected: list[int] = []
        self._identify_numbers: list[int] = []
        self._scan_part = 0
        self._now = 0.0
        self._silent_until = -1.0
        self._change: tuple[float, int] | None = None

    @property
    def ready(self) -> bool:
        """Whether a node without a node-ID has been assigned one and may boot."""
        return not self.configuring and self.active == NO_NODE_ID and self.pending != NO_NODE_ID

    def restart(self, *, whole: bool) -> int:
        """Reset communication (``whole``: the node) and return the new active node-ID."""
        if whole:
            self.pending = self.stored
        self.active = self.pending
        self.configuring = False
        self._selected, self._identify_numbers, self._scan_part = [], [], 0
        return self.active

    def on_frame(self, data: bytes, now: float) -> None:
        """Take a request; malformed or unknown ones, and those not for this state, are ignored."""
        self._now = now
        if self.dials.absent or len(data) != 8 or now < self._silent_until or self._lost("lost_requests"):
            return
        answer = self._handle(data)
        if answer is not None and not self._lost("lost_answers"):
            delay = self.dials.delay + self._random.uniform(0.0, self.dials.jitter)
            if data[0] == 0x17:
                delay += self.dials.store_time
            self._answers.append((now + delay, answer.ljust(8, b"\0")))

    @property
    def busy(self) -> bool:
        """Whether answers or a change of the bit rate are due later."""
        return bool(self._answers) or self._change is not None

    def take_answers(self, now: float) -> list[bytes]:
        """Return the answers that are due, and change the bit rate if that is due."""
        if self._change is not None and now >= self._change[0]:
            self.bit_rate, self._change = self._change[1], None
        due = []
        while self._answers and now >= self._answers[0][0]:
            due.append(self._answers.popleft()[1])
        return due

    def _lost(self, counter: str) -> bool:
        left = getattr(self.dials, counter)
        if left > 0:
            setattr(self.dials, counter, left - 1)
            return True
        return self.dials.loss > 0.0 and self._random.random() < self.dials.loss

    def _handle(self, data: bytes) -> bytes | None:
        command = data[0]
        if command == 0x04:
            self._switch(data[1])
            return None
        if 0x46 <= command <= 0x4B:
            return self._identify(command, _number(data))
        if command == 0x4C:
            return b"\x50" if self.active == NO_NODE_ID else None
        if not self.configuring or (command == 0x51 and self.dials.answers_on):
            return self._in_waiting(command, data)
        handler = _CONFIGURATION.get(command)
        return handler(self, data) if handler is not None else None

    # Both states.

    def _switch(self, mode: int) -> None:
        if mode in (0, 1):
            self.configuring = mode == 1
            self._selected.clear()

    def _identify(self, command: int, number: int) -> bytes | None:
        """Process 46h to 4Bh in sequence: vendor-ID, product code, lowest and highest revision, lowest and highest serial."""
        if command == 0x46:
            self._identify_numbers = []
        if len(self._identify_numbers) != command - 0x46:
            return None
        self._identify_numbers.append(number)
        if command != 0x4B:
            return None
        vendor, product, low_revision, high_revision, low_serial, high_serial = self._identify_numbers
        own = self._address()
        matches = own[:2] == (vendor, product)
        in_range = low_revision <= own[2] <= high_revision and low_serial <= own[3] <= high_serial
        return b"\x4f" if matches and in_range else None

    # Waiting.

    def _in_waiting(self, command: int, data: bytes) -> bytes | None:
        if 0x40 <= command <= 0x43:
            return self._select(command - 0x40, _number(data))
        if command == 0x51 and self.active == self.pending == NO_NODE_ID:
            return self._scan(_number(data), data[5], data[6], data[7])
        return None

    def _select(self, part: int, number: int) -> bytes | None:
        if part == 0:
            self._selected = []
        if len(self._selected) != part:
            return None
        self._selected.append(number)
        if tuple(self._selected) != self._address():
            return None
        self.configuring = True
        return b"\x44"

    def _scan(self, number: int, bit: int, part: int, following: int) -> bytes | None:
        if bit == _RESET_SCAN:
            self._scan_part = 0
            return b"\x4f"
        if bit > 31 or part > 3 or following > 3 or part != self._scan_part:
            return None
        if (number ^ self._address()[part]) >> bit:
            return None
        if bit == 0:
            self._scan_part = following
            self.configuring = following < part
        return b"\x4f"

    # Configuration.

    def _take_node_id(self, data: bytes) -> bytes:
        if self.dials.node_id_error:
            return bytes((0x11, self.dials.node_id_error, self.dials.specific_error))
        if not 1 <= data[1] <= 127 and data[1] != NO_NODE_ID:
            return bytes((0x11, _OUT_OF_RANGE))
        self.pending = data[1]
        return bytes((0x11, 0))

    def _take_bit_rate(self, data: bytes) -> bytes:
        if self.dials.bit_rate_error:
            return bytes((0x13, self.dials.bit_rate_error, self.dials.specific_error))
        rate = _RATES.get(data[2]) if data[1] == 0 else None
        if rate is None or rate in self.dials.refused_rates:
            return bytes((0x13, _OUT_OF_RANGE))
        self.pending_bit_rate = rate
        return bytes((0x13, 0))

    def _activate(self, data: bytes) -> None:
        delay = int.from_bytes(data[1:3], "little") / 1000.0
        self._change = (self._now + delay, self.pending_bit_rate)
        self._silent_until = self._now + 2.0 * delay

    def _store(self, _data: bytes) -> bytes:
        if self.dials.store_error:
            return bytes((0x17, self.dials.store_error, self.dials.specific_error))
        self.stored = self.pending
        return bytes((0x17, 0))

    def _answer_number(self, data: bytes) -> bytes:
        return data[:1] + self._address()[data[0] - 0x5A].to_bytes(4, "little")

    def _answer_node_id(self, data: bytes) -> bytes:
        return bytes((data[0], self.active))


_CONFIGURATION: dict[int, Callable[[LssSlave, bytes], bytes | None]] = {
    0x11: LssSlave._take_node_id,
    0x13: LssSlave._take_bit_rate,
    0x15: LssSlave._activate,
    0x17: LssSlave._store,
    0x5A: LssSlave._answer_number,
    0x5B: LssSlave._answer_number,
    0x5C: LssSlave._answer_number,
    0x5D: LssSlave._answer_number,
    0x5E: LssSlave._answer_node_id,
}


def _number(data: bytes) -> int:
    return int.from_bytes(data[1:5], "little")
