"""The shape of a drive's own profile: its jerk (60A4h) and its type (6086h), written before a move and read back.

Theory of operation
-------------------
6086h defines how a drive changes its velocity (CiA 402-2 10.3): 0 on linear ramps, 3 with a limited jerk (2, "jerk-free", on some).
For a move with a jerk, the master writes 60A4h:01, then 6086h, and reads both back: if the drive has another value, the jerk is not
limited. The value of 6086h from before the first of these moves is written again before the next move without a jerk.
"""

from __future__ import annotations

from axisbus.cia301 import abort
from axisbus.cia402 import objects
from axisbus.errors import DriveError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import SdoTransfers, object_text
from axisbus.motion.parameters import AxisParameters

NEEDED = (objects.PROFILE_JERK, objects.MOTION_PROFILE_TYPE)
_LIMITED = (3, 2)  # values of 6086h, in the order in which they are tried
_TYPE, _JERK = (objects.MOTION_PROFILE_TYPE, 0), (objects.PROFILE_JERK, 1)


class ProfileType:
    """Holds the value of 6086h from before this master wrote it (None: it has not), and whether the drive has another one now."""

    __slots__ = ("before", "is_changed")

    def __init__(self) -> None:
        self.before: int | None = None
        self.is_changed = False


def has_jerk_objects(parameters: AxisParameters) -> bool:
    """Whether a drive has the objects that limit the jerk of its own profiles."""
    return all(parameters.has(index) for index in NEEDED)


class _OptionalTransfer(SdoTransfers):
    """One transfer, whose refusal is a valid answer."""

    __slots__ = ("refused",)

    def __init__(self, item: tuple[int, int, int | None], parameters: AxisParameters) -> None:
        super().__init__([item], parameters)
        self.refused: int | None = None

    def _differs(self, at: tuple[int, int], found: int, wanted: int) -> None:  # noqa: ARG002  # signature of the base
        self.refused = abort.READ_ONLY

    def _take(self, image: AxisImage, request: int) -> None:
        code = image.replies[request].abort
        if code is None or code == abort.TIMED_OUT:
            super()._take(image, request)
            return
        self._pending.pop(request)
        self.refused = code


class JerkProfileWritten(SdoTransfers):
    """The transfers of a profile, then those of its shape, one after the other; ``jerk`` None: linear ramps."""

    __slots__ = ("_jerk", "_parameters", "_profile_transfers", "_remaining", "_running", "_type")

    def __init__(
        self,
        profile_transfers: SdoTransfers,
        jerk: int | None,
        profile_type: ProfileType,
        parameters: AxisParameters,
    ) -> None:
        """``jerk`` in the representation of 60A4h:01; ``profile_type``: the profile type of the axis."""
        super().__init__([], parameters)
        self._profile_transfers = profile_transfers
        self._jerk = jerk
        self._type = profile_type
        self._parameters = parameters
        self._running: tuple[str, tuple[int, int, int | None], _OptionalTransfer] | None = None
        self._remaining = self._steps()

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when all transfers have succeeded.

        Raises:
            DriveError: the drive refused a transfer, did not answer in time, or has a value other than the written one.
        """
        if not self._profile_transfers.step(image, order):
            return False
        while self._remaining or self._running is not None:
            if self._running is None:
                what, item = self._remaining.pop(0)
                self._running = what, item, _OptionalTransfer(item, self._parameters)
            if not self._running[2].step(image, order):
                return False
            answered, self._running = self._running, None
            self._take_answer(*answered)
        return True

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the transfers that are still queued."""
        self._profile_transfers.cancel(order)
        if self._running is not None:
            self._running[2].cancel(order)

    def _steps(self) -> list[tuple[str, tuple[int, int, int | None]]]:
        if self._jerk is None:
            back = self._type.before if self._type.is_changed else None
            return [] if back is None else [("back", (*_TYPE, back))]
        first = [("before", (*_TYPE, None))] if self._type.before is None else []
        return [
            *first,
            ("jerk", (*_JERK, self._jerk)),
            ("type", (*_TYPE, _LIMITED[0])),
            ("read", (*_JERK, None)),
        ]

    def _take_answer(self, what: str, item: tuple[int, int, int | None], transfer: _OptionalTransfer) -> None:
        index, subindex, value = item
        if what == "type" and transfer.refused is not None and value == _LIMITED[0]:
            self._remaining.insert(0, ("type", (*_TYPE, _LIMITED[1])))
            return
        if transfer.refused is not None:
            raise self._not_taken(item, f"abort code {abort.describe(transfer.refused)}")
        found = transfer.values.get((index, subindex))
        if what == "before":
            self._type.before = found
        elif what == "type":
            self._type.is_changed = True
            self._remaining.append((f"read {value}", (*_TYPE, None)))
        elif what == "back":
            self._type.is_changed = False
        elif what == "read" and found != self._jerk:
            raise self._not_taken((*_JERK, self._jerk), f"it is {found} after {self._jerk} was written")
        elif what.startswith("read ") and what != f"read {found}":
            raise self._not_taken(item, f"it is {found} after {what.split()[1]} was written")

    def _not_taken(self, item: tuple[int, int, int | None], seen: str) -> DriveError:
        name = self._parameters.name
        return DriveError(
            f"{name}: {object_text(item[0], item[1])}: the drive does not limit the jerk as requested",
            axis=name,
            observed=seen,
            remedy="move without jerk, or on a line of a group, which the master streams; see the drive's manual about this "
            "object",
        )
