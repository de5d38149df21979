"""The writes that change a device's values to those of a file, in an order that devices accept; pure.

Theory of operation
-------------------
The plan contains only values that differ, and the writes that must precede them. It depends only on the present values of the
device, whatever an earlier, interrupted run did, and it is empty when nothing is left to do. No write repeats a value that the
device already holds: even if each run is interrupted after a single write, the runs finish in the end. The phases are:

1. Set 1020h (Verify configuration) to 0, because the configuration that it identifies is about to change.
2. Disable the PDOs that will change: bit 31 of their COB-ID (CiA 301 7.5.2.35, 7.5.2.37).
3. Disable the SYNC, TIME, EMCY and SDO channels that will change, each by its own bit.
4. Write all objects without an order of their own, by index.
5. Write the disabled PDOs: communication parameters; mapping count 0, mapping entries, mapping count (7.5.2.36, 7.5.2.38).
6. Write SYNC and the other channels, then the COB-IDs of the PDOs: all COB-IDs are free by now.
7. Write error control: guarding, heartbeat consumers (emptied first, because no two may monitor one node), producer.
8. Write date and time of 1020h: only a complete configuration has them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o

Key = tuple[int, int]
Values = Mapping[Key, bytes]
PresentValues = Mapping[Key, bytes | None]  # None: the value cannot be read

VERIFY = 0x1020
_SYNC_OVERFLOW = 0x1019
_COB_ID_TIME = 0x1012
_TO_MAPPING = o.RPDO_MAPPING - o.RPDO_COMMUNICATION

_ERROR_CONTROL = (o.GUARD_TIME, o.LIFE_TIME_FACTOR, o.CONSUMER_HEARTBEAT, o.PRODUCER_HEARTBEAT)
_SDO_CHANNELS = range(0x1201, 0x1300)
_SDO_COB_IDS = (1, 2)
_ACTIVE = 1 << 30  # bit 30 of 1005h and 1012h: the device produces


def _invalid(value: int) -> int:
    return value | cob.INVALID


def _producing_no_more(value: int) -> int:
    return value & ~_ACTIVE


def _no_producer_no_consumer(value: int) -> int:
    return value & ~(_ACTIVE | cob.INVALID)


# How to disable a COB-ID before its other bits may change (CiA 301 7.5.2.5, 7.5.2.15, 7.5.2.17).
_OFF: Mapping[int, Callable[[int], int]] = {
    o.COB_ID_SYNC: _producing_no_more,
    _COB_ID_TIME: _no_producer_no_consumer,
    o.COB_ID_EMCY: _invalid,
}


@dataclass(frozen=True, slots=True)
class OrderedWrite:
    """One write: ``data`` as SDO sends it; ``pdo`` is the communication parameter (14xxh, 18xxh) of its PDO."""

    index: int
    subindex: int
    data: bytes
    pdo: int | None = None

    @property
    def key(self) -> Key:
        """Index and sub-index."""
        return self.index, self.subindex


def ordered(target: Values, present: PresentValues) -> list[OrderedWrite]:
    """Return the writes that change a device from ``present`` to ``target``; none if it has all values already."""
    differing = {key for key, data in target.items() if present.get(key) != data}
    if not differing:
        return []
    plan = _Plan(target, present, differing)
    return [
        *plan.clear_stamp(),
        *plan.pdos_off(),
        *plan.channels_off(),
        *plan.plain(),
        *plan.pdos(),
        *plan.channels(),
        *plan.pdos_on(),
        *plan.error_control(),
        *plan.stamp(),
    ]


def by_pdo(keys: Iterable[Key]) -> dict[int, list[Key]]:
    """Return the keys of PDOs, in their order, by the communication parameter of their PDO."""
    found: dict[int, list[Key]] = {}
    for key in keys:
        if (pdo := o.pdo_of(key[0])) is not None:
            found.setdefault(pdo, []).append(key)
    return found


def _by_index(keys: Iterable[Key]) -> dict[int, list[Key]]:
    found: dict[int, list[Key]] = {}
    for key in keys:
        found.setdefault(key[0], []).append(key)
    return found


def pdo_back(pdo: int, before: PresentValues, now: PresentValues) -> list[OrderedWrite]:
    """Return the writes that restore one PDO's values ``before``, whatever has changed since."""
    previous = {key: data for key, data in before.items() if data is not None and o.pdo_of(key[0]) == pdo}
    state: dict[Key, bytes | None] = {**previous, **{key: now.get(key) for key in previous}}
    return ordered(previous, state)


class _Plan:
    """The phases; holds the wanted values, the device's values, and their differences, and changes none of them."""

    def __init__(self, target: Values, present: PresentValues, differing: set[Key]) -> None:
        self._target = target
        self._present = present
        self._differing = differing
        self._sorted = sorted(differing)
        self._pdos = sorted(by_pdo(differing))
        self._differing_of = _by_index(self._sorted)
        self._target_by_index = _by_index(sorted(target))

    # -- 1020h ----------------------------------------------------------------------------------------------------------

    def clear_stamp(self) -> Iterator[OrderedWrite]:
        for key in self._stamps() if self._writes_more_than_stamp() else ():
            if any(self._present.get(key) or b""):
                yield OrderedWrite(*key, bytes(len(self._target[key])))

    def stamp(self) -> Iterator[OrderedWrite]:
        cleared = {write.key for write in self.clear_stamp()}
        for key in self._stamps():
            now = bytes(len(self._target[key])) if key in cleared else self._present.get(key)
            if now != self._target[key]:
                yield OrderedWrite(*key, self._target[key])

    def _stamps(self) -> list[Key]:
        return self._target_by_index.get(VERIFY, [])

    def _writes_more_than_stamp(self) -> bool:
        return any(index != VERIFY for index in self._differing_of)

    # -- PDOs -----------------------------------------------------------------------------------------------------------

    def pdos_off(self) -> Iterator[OrderedWrite]:
        for pdo in self._pdos:
            now = self._number((pdo, o.PDO_COB_ID))
            if now is not None and not now & cob.INVALID and (pdo, o.PDO_COB_ID) in self._target:
                yield OrderedWrite(pdo, o.PDO_COB_ID, _u32(now | cob.INVALID), pdo)

    def pdos(self) -> Iterator[OrderedWrite]:
        for pdo in self._pdos:
            for key in self._differing_of.get(pdo, ()):
                if key[1] != o.PDO_COB_ID:
                    yield OrderedWrite(*key, self._target[key], pdo)
            if pdo + _TO_MAPPING in self._differing_of:
                yield from self._mapping(pdo)

    def _mapping(self, pdo: int) -> Iterator[OrderedWrite]:
        mapping = pdo + _TO_MAPPING
        count = self._target.get((mapping, 0))
        if count is None:  # the number is fixed: entries are changed one by one
            for key in self._differing_of[mapping]:
                yield OrderedWrite(*key, self._target[key], pdo)
            return
        mapped = any(self._present.get((mapping, 0)) or b"\1")
        if mapped:
            yield OrderedWrite(mapping, 0, bytes(len(count)), pdo)
        used = range(1, int.from_bytes(count, "little") + 1)
        for key in (key for key in self._target_by_index[mapping] if key[1] in used):
            data = self._target[key]
            # Setting the count to 0 may clear the entries too, so all entries are written afterwards.
            if mapped or self._present.get(key) != data:
                yield OrderedWrite(*key, data, pdo)
        if any(count):
            yield OrderedWrite(mapping, 0, count, pdo)

    def pdos_on(self) -> Iterator[OrderedWrite]:
        for pdo in self._pdos:
            key = pdo, o.PDO_COB_ID
            data = self._target.get(key)
            now = self._number(key)
            if data is not None and (now is None or data != _u32(now | cob.INVALID)):
                yield OrderedWrite(*key, data, pdo)

    # -- SYNC, TIME, EMCY, SDO ------------------------------------------------------------------------------------------

    def channels_off(self) -> Iterator[OrderedWrite]:
        for index, off in _OFF.items():
            now = self._number((index, 0))
            if (index, 0) in self._differing and now is not None and off(now) != now:
                yield OrderedWrite(index, 0, _u32(off(now)))
        if self._stops_sync():
            yield OrderedWrite(
                o.CYCLE_PERIOD, 0, bytes(4)
            )  # 1019h may only change while 1006h is 0 (CiA 301 7.5.2.22)
        for index in self._sdo_channels():
            for subindex in _SDO_COB_IDS:
                if self._blocks(index, subindex):
                    yield OrderedWrite(
                        index, subindex, _u32((self._number((index, subindex)) or 0) | cob.INVALID)
                    )

    def _blocks(self, index: int, subindex: int) -> bool:
        """Whether a COB-ID of an SDO channel must be disabled before the channel's differing entries may change."""
        key = index, subindex
        now = self._number(key)
        if now is None or now & cob.INVALID or key not in self._target:
            return False
        others = any(sub not in _SDO_COB_IDS for _, sub in self._differing_of.get(index, ()))
        return others or key in self._differing

    def channels(self) -> Iterator[OrderedWrite]:
        for index in (_COB_ID_TIME, o.COB_ID_EMCY, _SYNC_OVERFLOW):
            yield from self._if_differing((index, 0))
        period = self._target.get((o.CYCLE_PERIOD, 0), b"")
        if self._stops_sync() and any(period):
            yield OrderedWrite(o.CYCLE_PERIOD, 0, period)
        elif not self._stops_sync():
            yield from self._if_differing((o.CYCLE_PERIOD, 0))
        yield from self._if_differing((o.COB_ID_SYNC, 0))
        for index in self._sdo_channels():
            for key in reversed(self._target_by_index[index]):  # the COB-IDs last
                if self._switched_off(key) != self._target[key]:
                    yield OrderedWrite(*key, self._target[key])

    def _stops_sync(self) -> bool:
        """Whether 1006h must be 0 temporarily."""
        key = o.CYCLE_PERIOD, 0
        return (
            (_SYNC_OVERFLOW, 0) in self._differing
            and key in self._target
            and any(self._present.get(key) or b"")
        )

    def _switched_off(self, key: Key) -> bytes | None:
        """Return the value of an SDO channel's entry after the channel is disabled."""
        now = self._number(key)
        return self._present.get(key) if now is None or not self._blocks(*key) else _u32(now | cob.INVALID)

    def _sdo_channels(self) -> list[int]:
        return sorted(index for index in self._differing_of if index in _SDO_CHANNELS)

    # -- the rest -------------------------------------------------------------------------------------------------------

    def plain(self) -> Iterator[OrderedWrite]:
        special = {*_OFF, *_ERROR_CONTROL, _SYNC_OVERFLOW, o.CYCLE_PERIOD, VERIFY, *_SDO_CHANNELS}
        for key in self._sorted:
            if key[0] not in special and o.pdo_of(key[0]) is None:
                yield OrderedWrite(*key, self._target[key])

    def error_control(self) -> Iterator[OrderedWrite]:
        consumers = self._differing_of.get(o.CONSUMER_HEARTBEAT, ())
        for key in consumers if len(consumers) > 1 else ():
            if any(self._present.get(key) or b"\1"):
                yield OrderedWrite(*key, bytes(len(self._target[key])))
        for index in _ERROR_CONTROL:
            for key in self._differing_of.get(index, ()):
                yield OrderedWrite(*key, self._target[key])

    def _if_differing(self, key: Key) -> Iterator[OrderedWrite]:
        if key in self._differing:
            yield OrderedWrite(*key, self._target[key])

    def _number(self, key: Key) -> int | None:
        data = self._present.get(key)
        return None if data is None else int.from_bytes(data, "little")


def _u32(value: int) -> bytes:
    return value.to_bytes(4, "little")
