"""A device that takes writes only in the order that CiA 301 prints, typed from its clauses; made to be cut off."""

from __future__ import annotations

from axisbus.errors import SdoAbort

PDO_COMMUNICATION = (*range(0x1400, 0x1600), *range(0x1800, 0x1A00))
PDO_MAPPING = (*range(0x1600, 0x1800), *range(0x1A00, 0x1C00))
BIT_31 = 0x8000_0000
BIT_30 = 0x4000_0000
REFUSED = 0x0609_0030
UNSUPPORTED = 0x0601_0000
STATE = 0x0800_0022
NO_OBJECT = 0x0602_0000


class Cut(Exception):
    """The cable is pulled, or the program is killed."""


class StrictDevice:
    """Holds bytes by (index, sub-index); ``budget`` writes until the cut, which comes before or after the last one is done."""

    def __init__(self, values: dict[tuple[int, int], bytes]) -> None:
        self.values = dict(values)
        self.budget: int | None = None
        self.done_first = False
        self.log: list[tuple[int, int, bytes]] = []
        self.refuse: dict[tuple[int, int], int] = {}

    def upload(self, index: int, subindex: int = 0) -> bytes:
        if (index, subindex) not in self.values:
            raise self.abort(index, subindex, NO_OBJECT)
        return self.values[index, subindex]

    def download(self, index: int, subindex: int, data: bytes) -> None:
        cut = self.budget is not None and self.budget <= len(self.log)
        if cut and not self.done_first:
            raise Cut
        self._check(index, subindex, data)
        self.values[index, subindex] = data
        self.log.append((index, subindex, data))
        if cut:
            raise Cut

    def abort(self, index: int, subindex: int, code: int) -> SdoAbort:
        return SdoAbort("refused", node=5, index=index, subindex=subindex, code=code)

    def number(self, index: int, subindex: int = 0) -> int:
        return int.from_bytes(self.values.get((index, subindex), b""), "little")

    def _check(self, index: int, subindex: int, data: bytes) -> None:
        if (index, subindex) not in self.values:
            raise self.abort(index, subindex, NO_OBJECT)
        code = self.refuse.get((index, subindex)) or self._rule(
            index, subindex, int.from_bytes(data, "little")
        )
        if code:
            raise self.abort(index, subindex, code)

    def _rule(self, index: int, subindex: int, value: int) -> int:
        now = self.number(index, subindex)
        if index in PDO_COMMUNICATION:
            return self._communication(index, subindex, now, value)
        if index in PDO_MAPPING:
            return self._mapping(index, subindex, value)
        if index == 0x1005 and now & BIT_30 and value & BIT_30 and now != value:
            return REFUSED  # not while it produces
        if index == 0x1014 and not now & BIT_31 and now != value and value & ~BIT_31 != now:
            return REFUSED  # not while it is valid
        if index == 0x1019 and self.number(0x1006):
            return STATE  # not while the cycle period is not 0
        if index == 0x1016 and value & 0xFFFF and self._watched_elsewhere(subindex, value):
            return 0x0604_0043
        if index in range(0x1201, 0x1300):
            return self._sdo_channel(index, subindex, now, value)
        if index == 0x6081 and value > self.number(0x607F):
            return 0x0609_0031
        return 0

    def _communication(self, index: int, subindex: int, now: int, value: int) -> int:
        valid = not self.number(index, 1) & BIT_31
        if subindex != 1:
            return STATE if valid and subindex in (3, 6) else 0
        if valid and now != value and value != now | BIT_31:
            return REFUSED  # bits 0 to 29 not while it exists
        others = (
            self.number(other, 1)
            for other in PDO_COMMUNICATION
            if other != index and (other, 1) in self.values
        )
        if not value & BIT_31 and any(
            other & 0x7FF == value & 0x7FF and not other & BIT_31 for other in others
        ):
            return REFUSED
        return 0

    def _mapping(self, index: int, subindex: int, value: int) -> int:
        if not self.number(index - 0x200, 1) & BIT_31:
            return UNSUPPORTED
        if subindex:
            return UNSUPPORTED if self.number(index) else 0
        return REFUSED if any(not self.number(index, sub) for sub in range(1, value + 1)) else 0

    def _watched_elsewhere(self, subindex: int, value: int) -> bool:
        node = value >> 16 & 0x7F
        return any(
            self.number(0x1016, sub) >> 16 & 0x7F == node and self.number(0x1016, sub) & 0xFFFF
            for sub in range(1, 5)
            if sub != subindex
        )

    def _sdo_channel(self, index: int, subindex: int, now: int, value: int) -> int:
        if subindex == 3:
            return 0 if all(self.number(index, sub) & BIT_31 for sub in (1, 2)) else STATE
        return REFUSED if not now & BIT_31 and now != value and value != now | BIT_31 else 0
