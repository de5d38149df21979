"""The errors that a node reports: error register 1001h, error field 1003h, and its last emergency message."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from axisbus.bus.sdo.access import SdoUploads
from axisbus.cia301 import emcy
from axisbus.cia301 import objects as o
from axisbus.cia301.emcy import Emcy, ErrorEntry
from axisbus.cia301.sdo import number_if_served
from axisbus.drives.emcy_text import emcy_words, history_words
from axisbus.drives.plugin import GENERIC, DrivePlugin
from axisbus.errors import BusError

_MOST = 3  # entries of 1003h in the text: the newest different ones


@dataclass(frozen=True, slots=True)
class ErrorState:
    """The errors found; None if the node has no such object or did not answer.

    ``last`` is its last emergency message since listening began (None: none has come); ``ago`` is the age of the message in s.
    """

    register: int | None
    history: tuple[ErrorEntry, ...] | None
    last: Emcy | None
    ago: float = 0.0

    @property
    def has_error(self) -> bool:
        """Whether it contains an error that is still present."""
        return bool(self.register) or (self.last is not None and not self.last.is_reset)

    def words(self, make: DrivePlugin = GENERIC) -> str:
        """Return the errors in one line."""
        return "; ".join((self._register(), self._history(make), self._last(make)))

    def _register(self) -> str:
        if self.register is None:
            return "its error register (1001h) cannot be read"
        words = ", ".join(emcy.register_words(self.register)) or "no error"
        return f"error register (1001h) 0x{self.register:02X}: {words}"

    def _history(self, make: DrivePlugin) -> str:
        if self.history is None:
            return "it has no list of errors (1003h)"
        seen: dict[tuple[int, int], ErrorEntry] = {}
        for entry in self.history:
            seen.setdefault((entry.code, entry.additional), entry)
        several = list(seen.values())
        listed = ", ".join(history_words(entry, make) for entry in several[:_MOST])
        more = f" and {len(several) - _MOST} older" if len(several) > _MOST else ""
        return f"its list of errors (1003h): {listed or 'empty'}{more}"

    def _last(self, make: DrivePlugin) -> str:
        if self.last is None:
            return "no EMCY has come since the bus was opened"
        return f"its last EMCY, {self.ago:.1f} s ago: {emcy_words(self.last, make)}"


def read(objects: SdoUploads, last: Emcy | None = None, ago: float = 0.0) -> ErrorState:
    """Read the error state; blocks for a few transfers, or for one if the node does not answer. Raises no node or bus errors."""
    try:
        register = number_if_served(objects.upload, o.ERROR_REGISTER)
        history = emcy.read(partial(number_if_served, objects.upload))
    except BusError:
        return ErrorState(None, None, last, ago)
    return ErrorState(register, history, last, ago)
