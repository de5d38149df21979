"""Boot loader of a simulated node (CiA 302-3): stops, clears, accepts and starts the node's program, and reports the result.

A program of a simulated node begins with its date and time in the format of 1F52h, two 32-bit numbers; the rest is arbitrary,
except that its last four bytes may have to be a checksum (``ProgramFaults.checksum``). A node has a boot loader only if its EDS
contains 1F50h:01 and 1F51h:01. If the supply fails while the memory is being cleared or written, there is no valid program
afterwards.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

from axisbus.sim.dictionary import DEVICE_STATE, INVALID_VALUE, Dictionary, Refused
from axisbus.sim.fault_injection import ProgramFaults

STOPPED, RUNNING, CLEARED = 0, 1, 3  # values read from 1F51h
_STOP, _START, _RESET, _CLEAR = 0, 1, 2, 3  # values written to 1F51h
_BUSY = 1
_NOTHING_VALID, _FAULTY, _NOT_CLEARED, _OUTSIDE = 1, 3, 4, 6  # errors of 1F57h
_DATA, _CONTROL, _DATE, _TIME, _ID, _FLASH = 0x1F5001, 0x1F5101, 0x1F5201, 0x1F5202, 0x1F5601, 0x1F5701
_HEADER = 8
_CHECKSUM = 4
_OF_LOADER = frozenset({0x1000, 0x1001, 0x1017, 0x1018, 0x1F50, 0x1F51, 0x1F52, 0x1F56, 0x1F57})


def has_loader(dictionary: Dictionary) -> bool:
    """Whether a node has the objects for loading a program."""
    return _DATA in dictionary and _CONTROL in dictionary


class ProgramLoader:
    """Program of a node (its bytes; None: cleared), the loader's state, and the timers of its memory."""

    def __init__(self, dictionary: Dictionary, dials: ProgramFaults, restart: Callable[[], None]) -> None:
        """``restart``: function that restarts the node."""
        self._dials = dials
        self._restart = restart
        first = dictionary.get_int(0x1F52, 1), dictionary.get_int(0x1F52, 2)
        self.program: bytes | None = b"".join(number.to_bytes(4, "little") for number in first)
        self.state = RUNNING
        self.orders: list[int] = []  # accepted writes to 1F51h
        self._stay_stopped = False  # the next restart ends in the loader, not in the program
        self._error = 0
        self._busy = 0.0
        self._until_restart: float | None = None
        live = {
            _CONTROL: lambda: self.state,
            _DATE: lambda: self._number(0),
            _TIME: lambda: self._number(4),
            _ID: lambda: 0 if self.program is None else sum(self.program) & 0xFFFF_FFFF,
            _FLASH: lambda: _BUSY if self._busy > 0.0 else self._error << 1,
        }
        dictionary.live |= {key: read for key, read in live.items() if key in dictionary}
        dictionary.check_write(_CONTROL, self._order)
        dictionary.byte_receivers[_DATA] = self._accept_program
        dictionary.is_hidden = self._is_hidden

    @property
    def deaf(self) -> bool:
        """Whether the node does not answer, because the loader clears or writes the memory."""
        return self._dials.deaf and self._busy > 0.0

    def step(self, dt: float) -> None:
        """Advance by ``dt`` seconds."""
        self._busy = max(0.0, self._busy - dt)
        if self._until_restart is not None:
            self._until_restart -= dt
            if self._until_restart <= 0.0:
                self._until_restart = None
                self._restart()

    def restarted(self) -> None:
        """Note a restart of the node: the program in the memory runs, if it is valid."""
        if self._busy > 0.0 and self.program is not None:
            self._error = _NOTHING_VALID  # the supply failed while it was written
        self._busy, self._until_restart = 0.0, None
        stay_stopped, self._stay_stopped = self._stay_stopped, False
        runs = self.program is not None and not self._error
        self.state = CLEARED if self.program is None else RUNNING if runs and not stay_stopped else STOPPED

    def _is_hidden(self, index: int) -> bool:
        """Whether the node does not have an object now, because the loader runs instead of the program."""
        return self._dials.few_objects and self.state != RUNNING and index not in _OF_LOADER

    def _number(self, at: int) -> int:
        return 0 if self.program is None else int.from_bytes(self.program[at : at + 4], "little")

    def _order(self, order: int) -> None:
        code = self._dials.control_refused.get(order)
        if code is not None:
            raise Refused(code)
        actions = {_STOP: self._stop, _START: self._start, _RESET: self._start, _CLEAR: self._clear}
        if order not in actions:
            raise Refused(INVALID_VALUE)
        if self._busy > 0.0:
            raise Refused(DEVICE_STATE)
        actions[order]()
        self.orders.append(order)

    def _stop(self) -> None:
        if self.state == RUNNING:
            self.state = STOPPED
            if self._dials.stop_restarts:
                self._stay_stopped, self._until_restart = True, self._dials.restart_delay

    def _clear(self) -> None:
        if self.state == RUNNING:
            raise Refused(DEVICE_STATE)
        self.program, self.state = None, CLEARED
        self._error, self._busy = _NOTHING_VALID, self._dials.clear_time

    def _start(self) -> None:
        if self.program is None or self._error:
            raise Refused(DEVICE_STATE)
        if self.state != RUNNING:
            self.state = RUNNING
            self._until_restart = self._dials.restart_delay

    def _accept_program(self, data: bytes) -> None:
        """Accept a complete program; 1F57h reports its errors."""
        if self._dials.data_refused:
            raise Refused(self._dials.data_refused)
        if self.state == RUNNING or self._busy > 0.0:
            raise Refused(DEVICE_STATE)
        if self.program is not None:
            self._error = _NOT_CLEARED
            return
        self._busy = self._dials.flash_time
        self._error = self._dials.flash_error or self._fault(data)
        if not self._error:
            self.program, self.state = data, STOPPED

    def _fault(self, data: bytes) -> int:
        """Return the error of 1F57h for a program, 0 for a valid one."""
        if 0 < self._dials.capacity < len(data):
            return _OUTSIDE
        body, end = data[:-_CHECKSUM], data[-_CHECKSUM:]
        wrong = self._dials.checksum and zlib.crc32(body) != int.from_bytes(end, "little")
        return _FAULTY if wrong or len(data) < _HEADER else 0
