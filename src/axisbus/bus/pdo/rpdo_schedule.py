"""Which RPDO frames of a cycle go out: synchronous ones all, event-driven ones where they are news to the drive or due again.

Theory of operation
-------------------
An event-driven RPDO (types 254 and 255) acts when it comes: one with what the drive has already does nothing but load the bus. What
the drive has is kept by object, not by RPDO: where several hold the controlword, the newest of any of them counts.

It is sent again all the same:

- after ``REPEAT``. That a frame went out says that *some* node has received it: a drive that was too busy to take it, or not yet
  operational, would be without it until the next change, and a stop must not wait for that. A tenth of a second is short beside
  every time that is waited for the drive to obey, and ten short frames a second are nothing to a bus;
- after a third of 14xxh:05, where the drive watches for it: two may be lost. That holds for every RPDO which the drive has had,
  also when nothing of it is in use any more, and with SYNC: a drive begins to watch with the first one;
- when it is not known what the drive has (``forget``).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from axisbus.bus.pdo.plan import PlannedPdo
from axisbus.bus.pdo.rpdo import Frame, RpdoImage, arrange

REPEAT = 0.1  # seconds
_SHARE = 3  # frames within the time that the drive allows

_Key = tuple[int, int]  # index and sub-index


class _Rpdo:
    """How one RPDO is sent; holds state: when it last was.

    ``repeat``: seconds after which it is sent again where it is in use, None for in every cycle; ``watched``: also where it is not.
    """

    __slots__ = ("_fields", "image", "repeat", "sent_at", "watched")

    def __init__(self, pdo: PlannedPdo, image: RpdoImage, repeat: float) -> None:
        self.image = image
        self.repeat = None if pdo.target.synchronous else repeat
        self.watched = (pdo.target.event_timer or 0) / 1000 / _SHARE or math.inf
        self.sent_at = -math.inf
        self._fields: list[tuple[_Key, int, int]] = []
        shift = 0
        for mapped in pdo.target.mapping:
            if not mapped.is_dummy:
                self._fields.append(((mapped.index, mapped.subindex), shift, (1 << mapped.bits) - 1))
            shift += mapped.bits

    def values(self, data: bytes) -> dict[_Key, int]:
        """Return the raw value of each object in a frame."""
        raw = int.from_bytes(data, "little")
        return {key: raw >> shift & mask for key, shift, mask in self._fields}


class RpdoPace:
    """The RPDOs of one axis on their way; holds state: what the drive has been sent, and when. All times in seconds."""

    def __init__(
        self,
        pdos: Iterable[PlannedPdo],
        images: Sequence[RpdoImage],
        scan_period: float,
        repeat: float = REPEAT,
    ) -> None:
        """``images`` are those of ``pdos``; ``repeat``: how often an event-driven RPDO is sent again at least."""
        self._images = images
        self._rpdos = {
            image.cob_id: _Rpdo(pdo, image, repeat) for pdo, image in zip(pdos, images, strict=True)
        }
        self._period = scan_period
        self._has: dict[_Key, int] = {}
        self.plain = all(
            rpdo.repeat is None and rpdo.watched == math.inf for rpdo in self._rpdos.values()
        )  # nothing to be kept in mind: every frame goes out

    def frames(
        self, given: Mapping[str, int], controlword: int | None, previous: int | None, now: float
    ) -> list[Frame]:
        """Return the frames of this cycle in the order in which they must go out; see ``arrange``."""
        frames = arrange(self._images, given, controlword, previous)
        if self.plain:
            return frames
        sent = [frame for frame in frames if self._goes(frame, now)]
        for rpdo in self._rpdos.values():
            if self._is_left_out(rpdo, controlword, now):
                frame = rpdo.image.frame(controlword)
                self._note(rpdo, rpdo.values(frame[1]), now)
                sent.append(frame)
        return sent

    def forget(self) -> None:
        """Send everything that is in use anew: frames were dropped, or the drive was not operational meanwhile."""
        self._has.clear()

    def _goes(self, frame: Frame, now: float) -> bool:
        rpdo = self._rpdos[frame[0]]
        values = rpdo.values(frame[1])
        goes = (
            rpdo.repeat is None
            or self._is_due(rpdo.sent_at, rpdo.repeat, now)
            or any(self._has.get(key) != value for key, value in values.items())
        )
        if goes:
            self._note(rpdo, values, now)
        return goes

    def _is_left_out(self, rpdo: _Rpdo, controlword: int | None, now: float) -> bool:
        """Whether the drive watches for it, and nothing that is in use has brought it in time; it then has no news."""
        if rpdo.sent_at == -math.inf or (rpdo.image.holds_controlword and controlword is None):
            return False
        return self._is_due(rpdo.sent_at, rpdo.watched, now)

    def _is_due(self, sent_at: float, after: float, now: float) -> bool:
        """Whether the next cycle would be too late."""
        return now - sent_at + self._period > after

    def _note(self, rpdo: _Rpdo, values: Mapping[_Key, int], now: float) -> None:
        rpdo.sent_at = now
        self._has.update(values)
