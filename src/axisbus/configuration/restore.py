"""Bringing a device to what a file says, with every object read again.

Theory of operation
-------------------
A run is: read everything the file has a value for, work out the writes that are missing (``order``), write them, and read
everything again. That is repeated while it helps, at most ``PASSES`` times, because a drive may refuse a value until another one
is there (a velocity above the old maximum), and writing one object may change another. Nothing but the device holds the state of a
restore, so one that was cut off, anywhere, is just run again. A PDO of which a part is refused gets back what it had, so that a
refusal leaves none switched off.
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
from axisbus.configuration.write_order import OrderedWrite, ordered, pdo_back, pdo_of
from axisbus.errors import SdoAbort, SdoError
from axisbus.wording import counted

PASSES = 4
_PADDED = frozenset((DataType.VISIBLE_STRING, DataType.UNICODE_STRING))
_MISSING = frozenset((abort.OBJECT_MISSING, abort.SUBINDEX_MISSING))

Tell = Callable[[str, int, int], None]


class RestoreTarget(SdoUploads, Protocol):
    """The objects of one node as bytes; calls block and raise ``SdoAbort`` where the node refuses, others where it is gone."""

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""


class ValueEnd(Enum):
    """What came of one value of the file."""

    SAME = "had it already"
    RESTORED = "restored"
    FAILED = "failed"
    UNVERIFIED = "written, cannot be read back"
    DIFFERS = "differs, not yet written"


@dataclass(frozen=True, slots=True)
class Result:
    """One value of the file: ``before`` and ``after`` are what the device held (None: it cannot be read, or was not)."""

    item: Item
    outcome: ValueEnd
    before: bytes | None
    after: bytes | None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class RestoreReport:
    """What came of a file: each value for the device, each value that stays in the file, and how many writes that took."""

    results: tuple[Result, ...]
    skipped: tuple[SkippedValue, ...]
    writes: int

    def of(self, *outcomes: ValueEnd) -> list[Result]:
        """The results with one of these outcomes."""
        return [each for each in self.results if each.outcome in outcomes]

    @property
    def ok(self) -> bool:
        """Whether the device has every value that it can be asked for."""
        return not self.of(ValueEnd.FAILED, ValueEnd.DIFFERS)


class Restore:
    """One restore; holds state: what the device held before and holds now as far as it was read, and what it refused.

    ``report`` may be asked at any time, also after ``run`` was cut off by an exception.
    """

    def __init__(self, device: RestoreTarget, selection: Selection, tell: Tell | None = None) -> None:
        """``tell(what, done, all)`` is called after each transfer."""
        self._device = device
        self._selection = selection
        self._tell = tell
        self._items = {item.key: item for item in selection.items}
        self._wanted = {key: item.data for key, item in self._items.items()}
        self._before: dict[Key, bytes | None] = {}
        self._now: dict[Key, bytes | None] = {}
        self._unreadable: dict[Key, SdoError] = {}
        self._refused: dict[Key, str] = {}
        self._written: set[Key] = set()
        self._unread: set[Key] = set()  # touched since they were read
        self._writes = 0

    def look(self) -> list[Item]:
        """Read every object that the file has a value for; return those that differ. Writes nothing; blocks.

        Raises:
            SdoError, AdapterError: the node does not answer, or the channel failed.
        """
        for number, key in enumerate(self._items, start=1):
            self._now[key] = self._read(key)
            self._unread.discard(key)
            self._say("reading", number, len(self._items))
        for key, data in self._now.items():
            self._before.setdefault(key, data)
        return [self._items[key] for key in self._differing()]

    def run(self) -> RestoreReport:
        """Write what differs and read everything again; blocks for as long as that takes.

        Raises:
            SdoError, AdapterError: the node no longer answers; ``report`` tells how far it came, and another run goes on.
        """
        if len(self._now) < len(self._items):
            self.look()
        for _ in range(PASSES):
            before = self._differing()
            if not before:
                break
            self._refused.clear()
            self._write(ordered(self._open(), self._comparable()))
            self.look()
            if self._differing() == before:
                break
        return self.report()

    def report(self) -> RestoreReport:
        """Return what came of each value so far."""
        results = tuple(self._result(key, item) for key, item in self._items.items())
        return RestoreReport(results, self._selection.skipped, self._writes)

    # -- what differs -----------------------------------------------------------------------------------------------------

    def _differing(self) -> list[Key]:
        return [key for key in self._open() if not self._same(key)]

    def _open(self) -> dict[Key, bytes]:
        """What is worth writing: not what the device does not have, nor has in another size, nor took and cannot show."""
        return {
            key: data
            for key, data in self._wanted.items()
            if not self._hopeless(key) and not self._blind(key)
        }

    def _comparable(self) -> dict[Key, bytes | None]:
        """What is held, with a text that is the same but for its zeros at the end as the very same."""
        return {key: self._wanted[key] if self._same(key) else data for key, data in self._now.items()}

    def _same(self, key: Key) -> bool:
        now, wanted = self._now.get(key), self._wanted[key]
        if now is not None and self._items[key].variable.data_type in _PADDED:
            return now.rstrip(b"\0") == wanted.rstrip(b"\0")
        return now == wanted

    def _hopeless(self, key: Key) -> str:
        unreadable = self._unreadable.get(key)
        if isinstance(unreadable, SdoAbort) and unreadable.code in _MISSING:
            return "the device does not have it"
        now = self._now.get(key)
        kind = self._items[key].variable.data_type
        if now is None or size_in_bytes(kind) is None or len(now) == len(self._wanted[key]):
            return ""
        return f"the device has {counted(len(now), 'octet')} there, the file's type {kind.name} has {len(self._wanted[key])}"

    def _blind(self, key: Key) -> bool:
        return key in self._written and self._now.get(key) is None

    def _result(self, key: Key, item: Item) -> Result:
        before, now = self._before.get(key), self._now.get(key)
        if key in self._unread or key not in self._now:
            return Result(item, ValueEnd.DIFFERS, before, None, "the run ended before it was read again")
        hopeless = self._hopeless(key)
        if key in self._now and self._same(key):
            done = key in self._written and before != now
            return Result(item, ValueEnd.RESTORED if done else ValueEnd.SAME, before, now)
        if hopeless or key in self._refused:
            return Result(item, ValueEnd.FAILED, before, now, hopeless or self._refused[key])
        if self._blind(key):
            return Result(item, ValueEnd.UNVERIFIED, before, now, why_unread(self._unreadable[key]))
        if key in self._written:
            return Result(item, ValueEnd.FAILED, before, now, "it was taken, and reads back another value")
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
            self._say("writing", number, len(writes))
        for pdo in sorted(broken):
            self._give_back(pdo)

    def _write_one(self, write: OrderedWrite) -> str:
        """Write; return why the device refuses it, empty where it does not."""
        if write.key in self._items:
            self._unread.add(write.key)
        try:
            self._device.download(write.index, write.subindex, write.data)
        except SdoError as error:
            require_answering(self._device, error)
            self._refused[write.key] = reason = _why_unwritten(error)
            return reason
        self._writes += 1
        if write.data == self._wanted.get(write.key):
            self._written.add(write.key)
            self._refused.pop(write.key, None)
        return ""

    def _fail_pdo(self, write: OrderedWrite, reason: str) -> None:
        where = f"{write.index:04X}h:{write.subindex:02X}"
        for key in self._wanted:
            if pdo_of(key[0]) == write.pdo and not self._same(key):
                self._refused.setdefault(
                    key, f"its PDO was left as it was, because {where} is refused: {reason}"
                )

    def _give_back(self, pdo: int) -> None:
        """Give a PDO back what it had before this pass."""
        had = {key: data for key, data in self._now.items() if pdo_of(key[0]) == pdo}
        now = {key: self._read(key) for key in had}
        self._written -= had.keys()
        for write in pdo_back(pdo, had, now):
            if write.key in had:
                with suppress(SdoError):  # as far as the device lets us; reading it again shows what it has
                    self._device.download(write.index, write.subindex, write.data)
                    self._writes += 1

    def _say(self, what: str, done: int, total: int) -> None:
        if self._tell is not None:
            self._tell(what, done, total)


def _why_unwritten(error: SdoError) -> str:
    """Return in words why the device did not take a value."""
    if not isinstance(error, SdoAbort):
        return error.observed or "no answer"
    hint = error.remedy or abort.explain(error.code).hint
    return abort.describe(error.code) + (f" ({hint})" if hint else "")
