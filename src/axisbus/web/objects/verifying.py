"""Compare a node with its EDS, object by object: started by a page, shown on all, slow enough not to disturb, and cancellable."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from axisbus.bus.node.verify import EdsMismatch, Verification, verify
from axisbus.bus.sdo.access import decoded
from axisbus.bus.sdo.transfer import Progress
from axisbus.cia301.datatypes import DataType, Value
from axisbus.configuration import preconditions
from axisbus.eds.model import Severity
from axisbus.errors import AxisbusError, StateError, Stopped
from axisbus.machine.machine_node import MachineNode
from axisbus.web.access.lease import Refusal
from axisbus.web.view import Values, explained
from axisbus.wording import counted

MAX_DIFFERENCES = 200  # the most differences that are shown


@dataclass(frozen=True, slots=True)
class VerifyProgress:
    """The progress: ``done`` of ``whole`` objects of a node; ``result`` or ``error`` (its three texts) once it is ``over``."""

    node: int
    done: int = 0
    whole: int = 0
    over: bool = False
    result: Verification | None = None
    error: Mapping[str, str] = field(default_factory=dict)

    def as_values(self) -> Values:
        """Return the progress as plain values."""
        found = () if self.result is None else self.result.differences
        worst_first = sorted(found, key=lambda each: each.severity.rank)
        return {
            "node": self.node,
            "done": self.done,
            "whole": self.whole,
            "over": self.over,
            "text": "" if self.result is None else _summary(self.result),
            "differences": [_plain(each) for each in worst_first[:MAX_DIFFERENCES]],
            "error": dict(self.error) or None,
        }


class Verifying:
    """Hold the running or last verification; one thread begins and ends it, another carries it out."""

    def __init__(self) -> None:
        self.now: VerifyProgress | None = None
        self._page = 0
        self._requested: int | None = None
        self._cancelled = threading.Event()

    @property
    def busy(self) -> Refusal | None:
        """Why no other job may begin now; None while no verification runs."""
        if self.now is None or self.now.over:
            return None
        return Refusal(f"node {self.now.node} is being verified", "wait until it is done, or cancel it")

    def begin(self, page: int, node: int) -> Refusal | None:
        """Request the verification of a node for a page; return why not, if another one runs."""
        if (busy := self.busy) is not None:
            return busy
        self._cancelled = threading.Event()
        self._page, self._requested, self.now = page, node, VerifyProgress(node)
        return None

    def end(self, page: int | None = None) -> None:
        """Cancel the verification; if ``page`` is given, only if that page has begun it."""
        if page in (None, self._page):
            self._cancelled.set()

    def take(self) -> int | None:
        """Return the node that has to be verified now, once; None if there is none."""
        found, self._requested = self._requested, None
        return found

    def carry_out(self, node: MachineNode) -> None:
        """Verify; blocks until it has finished, failed, or was cancelled."""
        cancelled = self._cancelled
        assert node.eds is not None

        def on_progress(done: int, whole: int) -> None:
            self.now = VerifyProgress(node.node_id, done, whole)

        try:
            result = verify(PacedSdo(node, cancelled, "the verification"), node.eds, on_progress)
        except AxisbusError as error:
            self.fail(node.node_id, error)
        else:
            self.now = VerifyProgress(node.node_id, result.read, result.read, True, result)

    def fail(self, node: int, error: AxisbusError) -> None:
        """End the verification with an error."""
        before = self.now if self.now is not None and self.now.node == node else VerifyProgress(node)
        self.now = replace(before, over=True, error=explained(error))


def _summary(result: Verification) -> str:
    counts = Counter(each.severity.value for each in result.differences)
    left_out = f", {result.left_out} could not be read" if result.left_out else ""
    found = ", ".join(counted(counts[grade.value], grade.value) for grade in Severity)
    return f"{counted(result.read, 'entry', 'entries')} read{left_out}: {found}"


def _plain(each: EdsMismatch) -> Values:
    return {
        "severity": each.severity.value,
        "kind": each.kind.value,
        "index": f"{each.index:04X}",
        "subindex": f"{each.subindex:02X}",
        "name": each.name,
        "message": each.message,
    }


# -- A node whose objects are read with a pause between two transfers, until cancelled; writing needs an extra class ----


PACE = 0.02  # seconds between two transfers


class PacedSdo:
    """The objects of a node, with the interface of ``bus.sdo.access.SdoObjectAccess``."""

    def __init__(self, node: MachineNode, cancelled: threading.Event, what: str) -> None:
        """``what`` names the activity in the error that is raised once ``cancelled`` is set."""
        self.node_id = node.node_id
        self._node = node
        self.dictionary = node.sdo.dictionary
        self._sdo = node.sdo
        self._cancelled = cancelled
        self._what = what

    def require_not_cancelled(self, seconds: float = 0.0) -> None:
        """Wait, but not longer than until the activity is cancelled; raises Stopped if it was."""
        if self._cancelled.wait(seconds):
            raise Stopped(f"{self._what} of node {self.node_id} was cancelled")

    def upload(self, index: int, subindex: int = 0, *, progress: Progress | None = None) -> bytes:
        """Read an object's bytes; raises Stopped if the activity was cancelled."""
        self.require_not_cancelled(PACE)
        return self._sdo.upload(index, subindex, progress=progress)

    def download(self, index: int, subindex: int, data: bytes) -> None:  # noqa: ARG002  # signature of the interface
        """Refuse to write: raises StateError."""
        raise StateError(
            f"node {self.node_id}: {self._what} only reads; {index:04X}h:{subindex:02X} was not written"
        )

    def read(self, key: int | str, subindex: int = 0, *, data_type: DataType | None = None) -> Value:
        """Read an object as the value of its data type."""
        entry = self.dictionary.resolve(key, subindex)
        return decoded(self.upload(entry.index, entry.subindex), data_type or entry.data_type)


class WritingSdo(PacedSdo):
    """Objects that may be written while no drive of the node is energised; this is checked before each write."""

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object's bytes; raises Stopped if the activity was cancelled, StateError if a drive is energised."""
        preconditions.require_not_energised(self._node)
        self.require_not_cancelled(PACE)
        self._sdo.download(index, subindex, data)


class PacedNode:
    """A node with paced transfers, with the interface of ``bus.sdo.access.ByObjects``."""

    def __init__(self, node: MachineNode, sdo: PacedSdo) -> None:
        self.node_id = node.node_id
        self.eds = node.eds
        self.sdo = sdo
