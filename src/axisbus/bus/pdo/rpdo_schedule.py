"""Select the RPDO frames of a cycle: all synchronous ones, and event-driven ones if they are new to the drive or due again.

Theory of operation
-------------------
An event-driven RPDO (types 254 and 255) takes effect when it arrives; if its values are in the drive already, it only loads the
bus. The sent values are stored by object, not by RPDO: if several RPDOs hold the controlword, the newest of them counts.

An event-driven RPDO is repeated in these cases:

- after ``REPEAT``. The transmission of a frame only shows that *some* node has received it. A drive that was too busy to take the
  frame, or not yet operational, would miss it until the next change, and a stop must not wait for that. A tenth of a second is
  short compared with every time limit for a reaction of the drive, and ten short frames a second hardly load a bus;
- after a third of 14xxh:05, if the drive monitors the RPDO: two frames may be lost. That applies to every RPDO that was sent once,
  also if none of its values is used any more, and with SYNC: a drive begins to monitor with the first frame;
- if the values in the drive are unknown (``forget``).
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
    """Sending of one RPDO; holds state: the time of the last transmission.

    ``repeat``: seconds after which an RPDO in use is sent again, None for every cycle; ``watched``: the same for one not in use.
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
    """Sending of the RPDOs of one axis; holds state: the sent values, and the times. All times in seconds."""

    def __init__(
        self,
        pdos: Iterable[PlannedPdo],
        images: Sequence[RpdoImage],
        scan_period: float,
        repeat: float = REPEAT,
    ) -> None:
        """``images`` are those of ``pdos``; ``repeat``: maximum time between two transmissions of an event-driven RPDO in use."""
        self._images = images
        self._rpdos = {
            image.cob_id: _Rpdo(pdo, image, repeat) for pdo, image in zip(pdos, images, strict=True)
        }
        self._period = scan_period
        self._has: dict[_Key, int] = {}
        self.plain = all(
            rpdo.repeat is None and rpdo.watched == math.inf for rpdo in self._rpdos.values()
        )  # no state is needed: every frame is sent

    def frames(
        self, given: Mapping[str, int], controlword: int | None, previous: int | None, now: float
    ) -> list[Frame]:
        """Return the frames of this cycle in the order in which they must be sent; see ``arrange``."""
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
        """Send all RPDOs in use again: frames were dropped, or the drive was not operational meanwhile."""
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
        """Whether the drive monitors the RPDO and no frame has been sent in time; the frame then contains no new values."""
        if rpdo.sent_at == -math.inf or (rpdo.image.holds_controlword and controlword is None):
            return False
        return self._is_due(rpdo.sent_at, rpdo.watched, now)

    def _is_due(self, sent_at: float, after: float, now: float) -> bool:
        """Whether the next cycle would be too late."""
        return now - sent_at + self._period > after

    def _note(self, rpdo: _Rpdo, values: Mapping[_Key, int], now: float) -> None:
        rpdo.sent_at = now
        self._has.update(values)
