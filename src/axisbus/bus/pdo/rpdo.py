"""Images of the RPDOs of one axis, and the order in which their frames are sent.

Theory of operation
-------------------
Drives with fixed mappings have the controlword in several RPDOs, each with one other value. If a frame with a new controlword comes
before the frame with its target, it starts a move to the old target. Therefore:

- a frame with other changed values goes before frames without;
- if several such frames hold the controlword, all but the last still carry the *previous* controlword, so that its edge comes with
  or after every new value.

The order in which a drive processes the RPDOs of one SYNC is up to the drive: see ``setpoint_edge_order``.

An image holds every entry of its mapping. Entries that are not outputs of motion (such as a profile velocity next to the target
position) keep the value of the drive, or the value last written by SDO: an RPDO must never set them to zero.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping, Sequence

from axisbus.bus.pdo.plan import PlannedPdo
from axisbus.bus.pdo.setpoint_edge_order import CONTROLWORD
from axisbus.cia301.pdo import MappedObject, PdoCodec
from axisbus.cia402.controlword import PowerCommand
from axisbus.cia402.port import ALL_OUTPUTS, OFFSET_OBJECTS, Outputs
from axisbus.errors import StateError

Frame = tuple[int, bytes]
_OUTPUTS = Outputs._fields
_VALUES = frozenset(ALL_OUTPUTS) - {CONTROLWORD}


class RpdoImage:
    """The values of one RPDO, by the position of their mapping entries; holds state (except the controlword)."""

    __slots__ = (
        "_codec",
        "_controlwords_at",
        "_given",
        "_named",
        "_offsets_at",
        "_pack",
        "_signed",
        "_values",
        "cob_id",
        "holds_controlword",
        "mapping",
        "name",
        "names",
        "outputs",
    )

    def __init__(self, pdo: PlannedPdo) -> None:
        self.name = pdo.name
        self.cob_id = pdo.target.cob_id
        self.mapping: tuple[MappedObject, ...] = pdo.target.mapping
        self.names = pdo.values
        self._named = [(at, name) for at, name in enumerate(self.names) if name is not None]
        self.outputs = frozenset(name for _, name in self._named)
        self._codec = PdoCodec(self.mapping, pdo.signed)
        self._pack = self._codec.pack_each
        # A vendor may have mapped it twice: a copy that is left at 0 would be *disable voltage*.
        self._controlwords_at = [at for at, name in self._named if name == CONTROLWORD]
        self.holds_controlword = bool(self._controlwords_at)
        self._offsets_at = [at for at, name in enumerate(self.names) if name in OFFSET_OBJECTS]
        # Positions in the mapping and in ``Outputs`` of each output, without the controlword.
        self._given = [(at, _OUTPUTS.index(name)) for at, name in enumerate(self.names) if name in _VALUES]
        self._signed = pdo.signed
        self._values: list[int | None] = [
            0 if mapped.is_dummy or name == CONTROLWORD else None
            for mapped, name in zip(self.mapping, self.names, strict=True)
        ]

    @property
    def cleared_bits(self) -> int:
        """The bits that are set to 0 in a stop: feed-forward offsets, and all bits of a second controlword but bit 1.

        With bit 1 alone that controlword is *quick stop*, without it *disable voltage*.
        """
        found, shift = 0, 0
        for at, mapped in enumerate(self.mapping):
            if at in self._offsets_at:
                found |= (1 << mapped.bits) - 1 << shift
            elif at in self._controlwords_at[1:]:
                found |= (1 << mapped.bits) - 1 - PowerCommand.QUICK_STOP.word << shift
            shift += mapped.bits
        return found

    @property
    def controlword_shift(self) -> int:
        """Number of bits of the RPDO before the controlword (the first, if it is mapped twice)."""
        return sum(mapped.bits for mapped in self.mapping[: self._controlwords_at[0]])

    @property
    def unknown(self) -> list[tuple[MappedObject, str | None]]:
        """The entries that have no value yet, each with its name (None: not used by motion)."""
        return [
            (mapped, name)
            for mapped, name, value in zip(self.mapping, self.names, self._values, strict=True)
            if value is None
        ]

    def take(self, given: Mapping[str, int]) -> bool:
        """Set values by name (not the controlword); return whether one changed."""
        changed, values = False, self._values
        for position, name in self._named:
            value = given.get(name)
            if value is not None and value != values[position]:
                values[position] = value
                changed = True
        return changed

    def put(self, index: int, subindex: int, value: int) -> bool:
        """Set the value of an object, cut to the mapped bits; return whether the object is mapped here."""
        found = False
        for position, mapped in enumerate(self.mapping):
            if (mapped.index, mapped.subindex) == (index, subindex):
                self._values[position] = _cut(value, mapped.bits, self._signed[position])
                found = True
        return found

    def value(self, index: int, subindex: int) -> int | None:
        """Return the value of an object, None if it is unknown or not mapped here."""
        for mapped, value in zip(self.mapping, self._values, strict=True):
            if (mapped.index, mapped.subindex) == (index, subindex):
                return value
        return None

    def frame(self, controlword: int | None) -> Frame:
        """Return COB-ID and data with this controlword.

        Raises:
            StateError: an entry has no value yet; sending would set it to zero in the drive.
        """
        values = self._values.copy()
        for at in self._controlwords_at:
            values[at] = controlword
        if None in values:
            missing = ", ".join(str(mapped) for mapped, _ in self.unknown)
            raise StateError(
                f"{self.name} cannot be sent: not all of its values are known",
                observed=f"without a value: {missing or '6040h (Controlword)'}",
                remedy="prime the port from the drive before the scan starts",
            )
        return self.cob_id, self._codec.pack(values)  # type: ignore[arg-type]  # None is excluded above

    def frame_of(self, outputs: Outputs) -> Frame:
        """Set the values of all outputs and return COB-ID and data; does the same as ``arrange`` for an axis with only this RPDO.

        Raises:
            StateError: as ``frame``.
        """
        values = self._values
        for at, field in self._given:
            value = outputs[field]
            if value is not None:
                values[at] = value  # type: ignore[assignment]  # these fields hold numbers
        whole = values.copy()
        for at in self._controlwords_at:
            whole[at] = outputs.controlword
        try:
            return self.cob_id, self._pack(*whole)
        except (TypeError, struct.error):  # a value is unknown, or does not fit
            return self.frame(outputs.controlword)

    def with_controlword(self, data: bytes, controlword: int) -> Frame:
        """Return COB-ID and ``data`` of a sent frame with another controlword, and without offsets."""
        values = list(self._codec.unpack(data))
        for at in self._offsets_at:
            values[at] = 0
        for at in self._controlwords_at:
            values[at] = controlword
        return self.cob_id, self._codec.pack(values)


def _cut(value: int, bits: int, signed: bool) -> int:
    value &= (1 << bits) - 1
    return value - (1 << bits) if signed and value >> (bits - 1) else value


def arrange(
    images: Sequence[RpdoImage], given: Mapping[str, int], controlword: int | None, previous: int | None
) -> list[Frame]:
    """Put the ``given`` values into the images and return this cycle's frames in the order in which they must be sent.

    Frames that hold a given value are sent. A ``controlword`` goes with them, or with the first RPDO that holds it. With None, no
    frame with 6040h is sent. ``previous`` is the controlword of the last cycle that had one.
    """
    changed = {image.cob_id for image in images if image.take(given)}
    used = _used(images, given, controlword)
    if len(images) == 1 or not changed:  # the order does not matter
        return [image.frame(controlword) for image in used]
    first = [image for image in used if image.cob_id in changed]
    rest = [image for image in used if image.cob_id not in changed]
    held_back = {image.cob_id for image in first if image.holds_controlword and previous is not None}
    if first:
        # Targets alone before those with the controlword.
        first.sort(key=lambda image: image.holds_controlword)
        held_back.discard(first[-1].cob_id)
    frames = [
        image.frame(previous if image.cob_id in held_back else controlword) for image in (*first, *rest)
    ]
    if controlword != previous and held_back:
        frames += [image.frame(controlword) for image in first if image.cob_id in held_back]
    return frames


def _used(images: Sequence[RpdoImage], given: Mapping[str, int], controlword: int | None) -> list[RpdoImage]:
    used = [
        image
        for image in images
        if not image.outputs.isdisjoint(given) and not (image.holds_controlword and controlword is None)
    ]
    if controlword is not None and not any(image.holds_controlword for image in used):
        used += [image for image in images if image.holds_controlword][:1]
    return used


# ----------------------------------------------------------------------------------------------------------------------
# Select the RPDO frames of a cycle: all synchronous ones, and event-driven ones if they are new to the drive or due again.
#
# Theory of operation
# An event-driven RPDO (types 254 and 255) takes effect when it arrives; if its values are in the drive already, it only loads the
# bus. The sent values are stored by object, not by RPDO: if several RPDOs hold the controlword, the newest of them counts.
#
# An event-driven RPDO is repeated in these cases:
#
# - after ``REPEAT``. The transmission of a frame only shows that *some* node has received it. A drive that was too busy to take the
#   frame, or not yet operational, would miss it until the next change, and a stop must not wait for that. A tenth of a second is
#   short compared with every time limit for a reaction of the drive, and ten short frames a second hardly load a bus;
# - after a third of 14xxh:05, if the drive monitors the RPDO: two frames may be lost. That applies to every RPDO that was sent
#   once, also if none of its values is used any more, and with SYNC: a drive begins to monitor with the first frame;
# - if the values in the drive are unknown (``forget``).


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
        self._sent_values: dict[_Key, int] = {}
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
        sent = [frame for frame in frames if self._must_be_sent(frame, now)]
        for rpdo in self._rpdos.values():
            if self._must_be_repeated(rpdo, controlword, now):
                frame = rpdo.image.frame(controlword)
                self._note(rpdo, rpdo.values(frame[1]), now)
                sent.append(frame)
        return sent

    def forget(self) -> None:
        """Send all RPDOs in use again: frames were dropped, or the drive was not operational meanwhile."""
        self._sent_values.clear()

    def _must_be_sent(self, frame: Frame, now: float) -> bool:
        rpdo = self._rpdos[frame[0]]
        values = rpdo.values(frame[1])
        must_be_sent = (
            rpdo.repeat is None
            or self._is_due(rpdo.sent_at, rpdo.repeat, now)
            or any(self._sent_values.get(key) != value for key, value in values.items())
        )
        if must_be_sent:
            self._note(rpdo, values, now)
        return must_be_sent

    def _must_be_repeated(self, rpdo: _Rpdo, controlword: int | None, now: float) -> bool:
        """Whether the drive monitors the RPDO and no frame has been sent in time; the frame then contains no new values."""
        if rpdo.sent_at == -math.inf or (rpdo.image.holds_controlword and controlword is None):
            return False
        return self._is_due(rpdo.sent_at, rpdo.watched, now)

    def _is_due(self, sent_at: float, after: float, now: float) -> bool:
        """Whether the next cycle would be too late."""
        return now - sent_at + self._period > after

    def _note(self, rpdo: _Rpdo, values: Mapping[_Key, int], now: float) -> None:
        rpdo.sent_at = now
        self._sent_values.update(values)
