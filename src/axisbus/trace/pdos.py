"""The COB-ID and mapping of each PDO: from the files, and learned from SDO transfers that write or read them.

So a recording that contains the boot-up of a node is decoded by the node's real configuration, with or without its EDS.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.pdo import MappedObject
from axisbus.trace.context import KnownNode

_NUMBER = 0x1FF
_IS_MAPPING, _IS_TPDO = 0x200, 0x800
_INVALID = 0x8000_0000


@dataclass(slots=True)
class PdoParameters:
    """The known parameters of one PDO; holds state: a transfer that writes or reads them changes it (COB-ID None: unknown)."""

    node: int
    receive: bool
    number: int
    cob_id: int | None = None
    transmission: int | None = None
    count: int | None = None
    entries: dict[int, int] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """``RPDO1`` and so on."""
        return f"{'RPDO' if self.receive else 'TPDO'}{self.number}"

    @property
    def identifier(self) -> int | None:
        """The CAN identifier while the PDO is on, with the flag for 29 bits."""
        if self.cob_id is None or self.cob_id & cob.INVALID:
            return None
        extended = self.cob_id & cob.EXTENDED
        return self.cob_id & (cob.EXTENDED | cob.ID_MASK_29 if extended else cob.ID_MASK_11)

    @property
    def mapping(self) -> tuple[MappedObject, ...] | None:
        """The mapped objects; None if unknown."""
        if self.count is None or any(sub not in self.entries for sub in range(1, self.count + 1)):
            return None
        return tuple(MappedObject.from_entry(self.entries[sub]) for sub in range(1, self.count + 1))


class PdoTable:
    """The PDOs of all nodes by CAN identifier; holds state: the known parameters of each."""

    def __init__(self, nodes: Iterator[KnownNode] | tuple[KnownNode, ...] = ()) -> None:
        self._all: dict[tuple[int, bool, int], PdoParameters] = {}
        self._by_identifier: dict[int, list[PdoParameters]] = {}
        for node in nodes:
            self._start(node)
        self._index()

    def find(self, identifier: int) -> list[PdoParameters]:
        """Return the PDOs with this identifier (with ``cob.EXTENDED`` if it has 29 bits), TPDOs first."""
        return self._by_identifier.get(identifier, [])

    def learn(self, node: int, index: int, subindex: int, value: int) -> None:
        """Learn the value of a PDO parameter; other objects are ignored."""
        if not o.is_pdo_parameter(index):
            return
        key = (node, not index & _IS_TPDO, (index & _NUMBER) + 1)
        pdo = self._all.setdefault(key, PdoParameters(*key))
        if index & _IS_MAPPING:
            _learn_mapping(pdo, subindex, value)
        elif subindex == o.PDO_TRANSMISSION_TYPE:
            pdo.transmission = value
        elif subindex == o.PDO_COB_ID:
            pdo.cob_id = value
            self._index()

    def _start(self, node: KnownNode) -> None:
        for directed in node.pdos:
            pdo = directed.pdo
            key = (node.node_id, directed.receive, pdo.number)
            entries = {number: entry.entry for number, entry in enumerate(pdo.mapping, start=1)}
            flags = cob.EXTENDED if pdo.cob_id > cob.ID_MASK_11 else 0
            cob_id = pdo.cob_id | flags | (0 if pdo.valid else _INVALID)
            self._all[key] = PdoParameters(*key, cob_id, pdo.transmission_type, len(entries), entries)

    def _index(self) -> None:
        found: dict[int, list[PdoParameters]] = {}
        for pdo in self._all.values():
            if pdo.identifier is not None:
                found.setdefault(pdo.identifier, []).append(pdo)
        self._by_identifier = {key: sorted(pdos, key=lambda pdo: pdo.receive) for key, pdos in found.items()}


def _learn_mapping(pdo: PdoParameters, subindex: int, value: int) -> None:
    if subindex == 0:
        # 0 only disables the mapping while it is written; its entries count again when their number is written.
        pdo.count = value
    else:
        pdo.entries[subindex] = value
