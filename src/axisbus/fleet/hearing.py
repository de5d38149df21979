"""What a fleet hears of its plant: each message to the cell that it is about, and what is missing asked for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import msgspec

from axisbus.fleet.asking import Asking
from axisbus.fleet.keys import CellKeys
from axisbus.fleet.messages import AxisState, CellInfo, Event
from axisbus.fleet.orders import Situation
from axisbus.fleet.watching import CellWatch
from axisbus.fleet.working import Worker

_ROUND = 0.25  # seconds between two looks for what is missing
_TIMEOUT = 1.0  # seconds for an answer
_CELL, _AXIS = 2, 3  # parts of a key
_Message = TypeVar("_Message")


class Hearing:
    """Holds what is known of each cell of a plant; any thread may ask it."""

    def __init__(self, plant: str, asking: Asking, worker: Worker) -> None:
        self.plant = plant
        self.junk = 0  # messages that are none
        self.on_gone: Callable[[str], None] = lambda _cell: None
        self._asking, self._worker = asking, worker
        self._lock = threading.RLock()
        self._cells: dict[str, CellWatch] = {}
        self._asked: dict[str, float] = {}  # for what is missing, by cell
        self._ended = False

    def begin(self) -> None:
        """Hear from now on; what is there already is told as well."""
        every = CellKeys.of_all(self.plant)
        self._asking.hear(every.events, self._event)
        self._asking.hear(every.state("*"), self._state)
        self._asking.follow(every.alive, self._token)
        self._worker.later(_ROUND, self._round)

    def end(self) -> None:
        """Ask for nothing any more."""
        self._ended = True

    # -- what is known -------------------------------------------------------------------------------------------------

    @property
    def names(self) -> list[str]:
        """The cells that were heard of, in the order of their names."""
        with self._lock:
            return sorted(self._cells)

    def has(self, cell: str) -> bool:
        """Whether a cell was heard of."""
        with self._lock:
            return cell in self._cells

    def look(self, cell: str, read: Callable[[CellWatch, float], _Message]) -> _Message:
        """Return what ``read`` makes of what is known of a cell now; nothing changes meanwhile."""
        with self._lock:
            now = time.monotonic()
            return read(self._cells.get(cell) or CellWatch(cell, now), now)

    def situation(self, cell: str, leased: bool) -> Situation:
        """Return what is known of a cell, to decide how a command goes on."""
        return self.look(cell, lambda watch, now: Situation(now, watch.alive, watch.run, leased))

    def settled(self, cells: list[str]) -> bool:
        """Whether it is known what each of these cells is."""
        with self._lock:
            return all(cell in self._cells and self._cells[cell].info is not None for cell in cells)

    # -- what comes ----------------------------------------------------------------------------------------------------

    def _token(self, key: str, there: bool) -> None:
        cell = key.split("/")[_CELL]
        with self._lock:
            self._watch(cell).token(there, time.monotonic())
        if there:
            self._worker.soon(partial(self._ask_for, cell))
        else:
            self._worker.soon(partial(self.on_gone, cell))

    def _state(self, key: str, payload: bytes) -> None:
        parts, state = key.split("/"), self._read(payload, AxisState)
        if state is None:
            return
        with self._lock:
            watch = self._watch(parts[_CELL])
            watch.take_state(parts[_AXIS], state, time.monotonic(), time.time())

    def _event(self, key: str, payload: bytes) -> None:
        event = self._read(payload, Event)
        if event is not None:
            with self._lock:
                self._watch(key.split("/")[_CELL]).take_event(event, time.monotonic())

    def _info(self, key: str, payload: bytes) -> None:
        info = self._read(payload, CellInfo)
        if info is not None:
            with self._lock:
                self._watch(key.split("/")[_CELL]).take_info(info, time.monotonic(), time.time())

    def _watch(self, cell: str) -> CellWatch:
        return self._cells.setdefault(cell, CellWatch(cell, time.monotonic()))

    def _read(self, payload: bytes, kind: type[_Message]) -> _Message | None:
        try:
            return msgspec.json.decode(payload, type=kind)
        except (msgspec.MsgspecError, ValueError, RecursionError):
            self.junk += 1
            return None

    # -- what is missing -----------------------------------------------------------------------------------------------

    def _round(self) -> None:
        if self._ended:
            return
        for cell in self.names:
            if self.look(cell, lambda watch, _: watch.alive):
                self._ask_for(cell)
        self._worker.later(_ROUND, self._round)

    def _ask_for(self, cell: str) -> None:
        """Ask for what a cell is, and for the events that are missing; not again while an answer may come."""
        now = time.monotonic()
        if now - self._asked.get(cell, -_TIMEOUT) < _TIMEOUT:
            return
        keys = CellKeys(self.plant, cell)
        info, missing, run = self.look(cell, lambda watch, _: (watch.info, watch.log.missing, watch.run))
        if info is None:
            self._asked[cell] = now
            self._asking.ask_all(keys.info, _TIMEOUT, self._info, partial(self._asked.pop, cell, None))
        elif missing is not None:
            self._asked[cell] = now
            self._ask_events(cell, run, *missing)

    def _ask_events(self, cell: str, run: str, first: int, last: int) -> None:
        answers: list[bytes] = []

        def heard(_key: str, payload: bytes) -> None:
            answers.append(payload)

        def ended() -> None:
            with self._lock:
                self._asked.pop(cell, None)
                watch = self._watch(cell)
                if not answers or watch.run != run:
                    return
                for event in self._events(answers):
                    watch.take_event(event, time.monotonic())
                watch.log.asked(first, last)

        selector = f"{CellKeys(self.plant, cell).events}?first={first};last={last}"
        self._asking.ask_all(selector, _TIMEOUT, heard, ended)

    def _events(self, answers: list[bytes]) -> list[Event]:
        """Return the events of answers, each of which holds one or a list of them."""
        found: list[Event] = []
        for payload in answers:
            told = self._read(payload, Event | list[Event])  # type: ignore[arg-type]  # a union is a form, no class
            found += told if isinstance(told, list) else [told] if told is not None else []
        return found
