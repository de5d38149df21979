"""Receive the messages of a plant, pass each to the state of its cell, and query missing state."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple, TypeVar

import msgspec

from axisbus.fleet.cell_state import CellWatch
from axisbus.fleet.command_retry import Situation
from axisbus.fleet.event_loop import EventLoopThread
from axisbus.fleet.keys import ZenohCellKeys, is_name
from axisbus.fleet.messages import AxisStateMessage, CellInfo, Event, EventsAnswer, EventsAsk, read
from axisbus.fleet.zenoh_client import ZenohClient

_ROUND = 0.25  # seconds between two checks for missing state
_CELLS = 1000  # the most cells that a plant may have
_TIMEOUT = 1.0  # seconds for an answer
_CELL, _AXIS, _BRIDGE = 2, 3, 4  # parts of a key
_Message = TypeVar("_Message")


class MissingEvents(NamedTuple):
    """State of a cell that is not known yet: its description, the states of axes, and events."""

    info: bool
    axes: tuple[str, ...]
    events: EventsAsk | None


NOTHING_MISSING = MissingEvents(False, (), None)


class FleetSubscriptions:
    """Hold the known state of each cell of a plant; any thread may call it."""

    def __init__(self, plant: str, zenoh_client: ZenohClient, worker: EventLoopThread) -> None:
        self.plant = plant
        self.invalid_count = 0  # invalid messages
        self.on_cell_lost: Callable[[str], None] = lambda _cell: None
        self._zenoh_client, self._worker = zenoh_client, worker
        self._lock = threading.RLock()
        self._cells: dict[str, CellWatch] = {}
        self._query_times: dict[str, float] = {}  # when missing state was last queried, by cell
        self._ended = False

    def begin(self) -> None:
        """Subscribe to all cells of the plant; cells that are already present are reported as well."""
        all_cells = ZenohCellKeys.of_all(self.plant)
        self._zenoh_client.subscribe(all_cells.events, self._event)
        self._zenoh_client.subscribe(all_cells.state("*"), self._state)
        self._zenoh_client.follow(all_cells.presence("*"), self._presence)
        self._zenoh_client.follow(all_cells.alive, self._token)
        self._worker.call_later(_ROUND, self._round)

    def end(self) -> None:
        """Send no more queries."""
        self._ended = True

    # -- known state ---------------------------------------------------------------------------------------------------

    @property
    def names(self) -> list[str]:
        """The names of the cells that have been heard, sorted."""
        with self._lock:
            return sorted(self._cells)

    def has(self, cell: str) -> bool:
        """Whether a cell has been heard."""
        with self._lock:
            return cell in self._cells

    def inspect(self, cell: str, read: Callable[[CellWatch, float], _Message]) -> _Message:
        """Return the result of ``read`` on the present state of a cell; the state does not change meanwhile."""
        with self._lock:
            now = time.monotonic()
            return read(self._cells.get(cell) or CellWatch(cell, now), now)

    def situation(self, cell: str, leased: bool) -> Situation:
        """Return the state of a cell that decides whether a command is sent again."""
        return self.inspect(cell, lambda watch, now: Situation(now, watch.alive, watch.run, leased))

    def settled(self, cells: list[str]) -> bool:
        """Whether each of these cells has reported its description, its axes and its events."""
        with self._lock:
            return all(cell in self._cells and self._cells[cell].settled for cell in cells)

    # -- messages ------------------------------------------------------------------------------------------------------

    def _token(self, key: str, present: bool) -> None:
        cell = key.split("/")[_CELL]
        with self._lock:
            self._watch(cell).token(present, time.monotonic())
        if present:
            self._worker.call_soon(partial(self._query_missing, cell))
        else:
            self._worker.call_soon(partial(self.on_cell_lost, cell))

    def _presence(self, key: str, present: bool) -> None:
        parts = key.split("/")
        with self._lock:
            self._watch(parts[_CELL]).presence(parts[_BRIDGE], present, time.monotonic())

    def _state(self, key: str, payload: bytes) -> None:
        parts, state = key.split("/"), self._read(payload, AxisStateMessage)
        if state is None:
            return
        with self._lock:
            watch = self._watch(parts[_CELL])
            watch.store_state(parts[_AXIS], state, time.monotonic(), time.time())

    def _event(self, key: str, payload: bytes) -> None:
        event = self._read(payload, Event)
        if event is not None:
            with self._lock:
                self._watch(key.split("/")[_CELL]).store_event(event)

    def _info(self, key: str, payload: bytes) -> None:
        info = self._read(payload, CellInfo)
        if info is not None:
            with self._lock:
                self._watch(key.split("/")[_CELL]).store_info(info, time.time())

    def _watch(self, cell: str) -> CellWatch:
        """Return the state of a cell; if the plant has too many cells or the name is invalid, the state is not stored."""
        watch = self._cells.get(cell)
        if watch is None:
            watch = CellWatch(cell, time.monotonic())
            if len(self._cells) < _CELLS and is_name(cell):
                self._cells[cell] = watch
        return watch

    def _read(self, payload: bytes, kind: type[_Message]) -> _Message | None:
        message = read(payload, kind)
        self.invalid_count += message is None
        return message

    # -- missing state -------------------------------------------------------------------------------------------------

    def _round(self) -> None:
        if self._ended:
            return
        for cell in self.names:
            if self.inspect(cell, lambda watch, _: watch.alive):
                self._query_missing(cell)
        self._worker.call_later(_ROUND, self._round)

    def _query_missing(self, cell: str) -> None:
        """Query the missing description, states and events of a cell; do nothing while an earlier query may still be answered."""
        now = time.monotonic()
        if now - self._query_times.get(cell, -_TIMEOUT) < _TIMEOUT:
            return
        missing_state = self._missing_state(cell)
        if missing_state == NOTHING_MISSING:
            return
        self._query_times[cell] = now
        keys, on_end = ZenohCellKeys(self.plant, cell), partial(self._query_ended, cell, missing_state)
        if missing_state.info:
            self._zenoh_client.query_all(keys.info, b"", _TIMEOUT, self._info, on_end)
        elif missing_state.axes:
            for axis in missing_state.axes:  # each by its name: a star would also match the keys of commands
                self._zenoh_client.query_all(keys.state(axis), b"", _TIMEOUT, self._state, on_end)
        elif missing_state.events is not None:
            on_answer = partial(self._events, cell, missing_state.events)
            self._zenoh_client.query_all(
                keys.events, msgspec.json.encode(missing_state.events), _TIMEOUT, on_answer, on_end
            )

    def _missing_state(self, cell: str) -> MissingEvents:
        return self.inspect(
            cell, lambda watch, _: MissingEvents(not watch.informed, watch.unreported, watch.log.missing)
        )

    def _query_ended(self, cell: str, missing_before: MissingEvents) -> None:
        """Handle the end of a query: if it reduced the missing state, query the rest at once, otherwise only after the time-out."""
        if self._missing_state(cell) != missing_before:
            self._query_times.pop(cell, None)
            self._worker.call_soon(partial(self._query_missing, cell))

    def _events(self, cell: str, request: EventsAsk, _key: str, payload: bytes) -> None:
        answer = self._read(payload, EventsAnswer)
        if answer is not None:
            with self._lock:
                self._watch(cell).log.answered(request, answer)
