"""Write the values of a file to a device, and read each object again.

Theory of operation
-------------------
A run reads each object that has a value in the file, determines the missing writes (``ordered``), writes them, and reads each
object again. It repeats this while it helps, at most ``PASSES`` times. The reasons: a drive may refuse a value until another one is
set (a velocity above the old maximum), and writing one object may change another. Only the device holds the state of a restore, so
an interrupted restore is simply run again. If a part of a PDO is refused, the whole PDO gets its previous values again, so that a
refusal leaves no PDO disabled.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from axisbus.bus.sdo.access import SdoUploads, require_answering, try_upload, why_unread
from axisbus.cia301 import abort
from axisbus.cia301.datatypes import DataType, size_in_bytes
from axisbus.configuration.dcf_values import Item, Key, Selection, SkippedValue
from axisbus.configuration.write_order import OrderedWrite, by_pdo, ordered, pdo_back
from axisbus.errors import SdoAbort, SdoError
from axisbus.wording import counted

PASSES = 4
_PADDED = frozenset((DataType.VISIBLE_STRING, DataType.UNICODE_STRING))
_MISSING = frozenset((abort.OBJECT_MISSING, abort.SUBINDEX_MISSING))

OnProgress = Callable[[str, int, int], None]


class RestoreTarget(SdoUploads, Protocol):
    """The objects of one node as bytes; calls block; raises ``SdoAbort`` if the node refuses, others if it does not answer."""

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""


class ValueEnd(Enum):
    """The result for one value of the file."""

    SAME = "had it already"
    RESTORED = "restored"
    FAILED = "failed"
    UNVERIFIED = "written, cannot be read back"
    DIFFERS = "differs, not yet written"


@dataclass(frozen=True, slots=True)
class Result:
    """One value of the file: ``before`` and ``after`` are the device's values (None: unreadable, or not read)."""

    item: Item
    outcome: ValueEnd
    before: bytes | None
    after: bytes | None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class RestoreReport:
    """The result for a file: the values for the device, the skipped values, and the number of writes."""

    results: tuple[Result, ...]
    skipped: tuple[SkippedValue, ...]
    writes: int

    def of(self, *outcomes: ValueEnd) -> list[Result]:
        """Return the results with one of these outcomes."""
        return [each for each in self.results if each.outcome in outcomes]

    @property
    def ok(self) -> bool:
        """Whether the device has each value that can be checked."""
        return not self.of(ValueEnd.FAILED, ValueEnd.DIFFERS)


class Restore:
    """One restore; holds state: the device's values before and now as far as they were read, and the refused values.

    ``report`` may be called at any time, also after an exception in ``run``.
    """

    def __init__(
        self, device: RestoreTarget, selection: Selection, on_progress: OnProgress | None = None
    ) -> None:
        """``on_progress(what, done, all)`` is called after each transfer."""
        self._device = device
        self._selection = selection
        self._on_progress = on_progress
        self._items = {item.key: item for item in selection.items}
        self._target = {key: item.data for key, item in self._items.items()}
        self._of_pdo = by_pdo(self._items)
        self._before: dict[Key, bytes | None] = {}
        self._now: dict[Key, bytes | None] = {}
        self._unreadable: dict[Key, SdoError] = {}
        self._refused: dict[Key, str] = {}
        self._written: set[Key] = set()
        self._unread: set[Key] = set()  # written since they were last read
        self._writes = 0

    def read_present(self) -> list[Item]:
        """Read each object that has a value in the file; return the values that differ. Writes nothing; blocks.

        Raises:
            SdoError, AdapterError: the node does not answer, or the channel failed.
        """
        for number, key in enumerate(self._items, start=1):
            self._now[key] = self._read(key)
            self._unread.discard(key)
            self._report_progress("reading", number, len(self._items))
        for key, data in self._now.items():
            self._before.setdefault(key, data)
        return [self._items[key] for key in self._differing()]

    def run(self) -> RestoreReport:
        """Write the values that differ and read each object again; blocks until this is done.

        Raises:
            SdoError, AdapterError: the node no longer answers; ``report`` has the results so far, and another run continues.
        """
        if len(self._now) < len(self._items):
            self.read_present()
        for _ in range(PASSES):
            before = self._differing()
            if not before:
                break
            self._refused.clear()
            self._write(ordered(self._open(), self._comparable()))
            self.read_present()
            if self._differing() == before:
                break
        return self.report()

    def report(self) -> RestoreReport:
        """Return the result of each value so far."""
        results = tuple(self._result(key, item) for key, item in self._items.items())
        return RestoreReport(results, self._selection.skipped, self._writes)

    # -- differences ----------------------------------------------------------------------------------------------------

    def _differing(self) -> list[Key]:
        return [key for key in self._open() if not self._is_equal(key)]

    def _open(self) -> dict[Key, bytes]:
        """Return the values worth writing: not of objects that are missing, of another size, or written but unreadable."""
        return {
            key: data
            for key, data in self._target.items()
            if not self._why_not_writable(key) and not self._is_write_only(key)
        }

    def _comparable(self) -> dict[Key, bytes | None]:
        """Return the device's values; a text that differs only in trailing zeros counts as equal."""
        return {key: self._target[key] if self._is_equal(key) else data for key, data in self._now.items()}

    def _is_equal(self, key: Key) -> bool:
        now, target = self._now.get(key), self._target[key]
        if now is not None and self._items[key].variable.data_type in _PADDED:
            return now.rstrip(b"\0") == target.rstrip(b"\0")
        return now == target

    def _why_not_writable(self, key: Key) -> str:
        unreadable = self._unreadable.get(key)
        if isinstance(unreadable, SdoAbort) and unreadable.code in _MISSING:
            return "the device does not have it"
        now = self._now.get(key)
        kind = self._items[key].variable.data_type
        if now is None or size_in_bytes(kind) is None or len(now) == len(self._target[key]):
            return ""
        return f"the device has {counted(len(now), 'octet')} there, the file's type {kind.name} has {len(self._target[key])}"

    def _is_write_only(self, key: Key) -> bool:
        return key in self._written and self._now.get(key) is None

    def _result(self, key: Key, item: Item) -> Result:
        before, now = self._before.get(key), self._now.get(key)
        if key in self._unread or key not in self._now:
            return Result(item, ValueEnd.DIFFERS, before, None, "the run ended before it was read again")
        why_not = self._why_not_writable(key)
        if key in self._now and self._is_equal(key):
            was_written = key in self._written and before != now
            return Result(item, ValueEnd.RESTORED if was_written else ValueEnd.SAME, before, now)
        if why_not or key in self._refused:
            return Result(item, ValueEnd.FAILED, before, now, why_not or self._refused[key])
        if self._is_write_only(key):
            return Result(item, ValueEnd.UNVERIFIED, before, now, why_unread(self._unreadable[key]))
        if key in self._written:
            return Result(item, ValueEnd.FAILED, before, now, "it was accepted, and reads back another value")
        return Result(item, ValueEnd.DIFFERS, before, now)

    # -- the device -------------------------------------------------------------------------------------------------------

    def _read(self, key: Key) -> bytes | None:
        found = try_upload(self._device, *key)
        if isinstance(found, bytes):
            self._unreadable.pop(key, None)
            return found
        self._unreadable[key] = found
        return None

    def _write(self, writes: list[OrderedWrite]) -> None:
        broken: set[int] = set()
        for number, write in enumerate(writes, start=1):
            if write.pdo is None or write.pdo not in broken:
                reason = self._write_one(write)
                if reason and write.pdo is not None:
                    broken.add(write.pdo)
                    self._fail_pdo(write, reason)
            self._report_progress("writing", number, len(writes))
        for pdo in sorted(broken):
            self._restore_pdo(pdo)

    def _write_one(self, write: OrderedWrite) -> str:
        """Write; return the reason why the device refuses it, empty if it does not."""
        if write.key in self._items:
            self._unread.add(write.key)
        try:
            self._device.download(write.index, write.subindex, write.data)
        except SdoError as error:
            require_answering(self._device, error)
            self._refused[write.key] = reason = _why_unwritten(error)
            return reason
        self._writes += 1
        if write.data == self._target.get(write.key):
            self._written.add(write.key)
            self._refused.pop(write.key, None)
        return ""

    def _fail_pdo(self, write: OrderedWrite, reason: str) -> None:
        where = f"{write.index:04X}h:{write.subindex:02X}"
        assert write.pdo is not None
        for key in self._of_pdo[write.pdo]:
            if not self._is_equal(key):
                self._refused.setdefault(
                    key, f"its PDO was left unchanged, because {where} is refused: {reason}"
                )

    def _restore_pdo(self, pdo: int) -> None:
        """Restore the values that a PDO had before this pass."""
        had = {key: self._now[key] for key in self._of_pdo[pdo] if key in self._now}
        now = {key: self._read(key) for key in had}
        self._written -= had.keys()
        for write in pdo_back(pdo, had, now):
            if write.key in had:
                with suppress(SdoError):  # as far as possible; reading it again shows the result
                    self._device.download(write.index, write.subindex, write.data)
                    self._writes += 1

    def _report_progress(self, what: str, done: int, total: int) -> None:
        if self._on_progress is not None:
            self._on_progress(what, done, total)


def _why_unwritten(error: SdoError) -> str:
    """Return in words why the device did not accept a value."""
    if not isinstance(error, SdoAbort):
        return error.observed or "no answer"
    hint = error.remedy or abort.explain(error.code).hint
    return abort.describe(error.code) + (f" ({hint})" if hint else "")
