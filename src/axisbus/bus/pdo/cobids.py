"""Assign a COB-ID to each PDO of a plan."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from itertools import chain

from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.cia301 import cob
from axisbus.cia301.pdo import PdoConfiguration

_PDO_COB_IDS = range(0x181, 0x580)
_NODE_BITS = 0x7F


class CobIds:
    """Assigns COB-IDs while one plan is made; holds state: the COB-IDs that the plan has used."""

    def __init__(
        self, node_id: int, device: DevicePdos, taken: Collection[int], spare: Iterable[int]
    ) -> None:
        """``taken`` are COB-IDs of other nodes, ``spare`` those available to PDOs after the fourth."""
        self._node_id = node_id
        self._used = set(taken)
        self._spare: Iterator[int] = iter(spare)
        self._owners = {pdo.cob_id: pdo for pdo in (*device.rpdos, *device.tpdos) if pdo.valid}

    def choose(self, pdo: PdoConfiguration, receive: bool) -> int | None:
        """Return the predefined COB-ID of PDOs 1 to 4, else the PDO's own, else a spare one; None if none is free.

        The predefined one comes first because files and drives often contain the COB-ID of another node.
        """
        bases = cob.RPDO if receive else cob.TPDO
        predefined = (bases[pdo.number - 1] + self._node_id,) if pdo.number <= len(bases) else ()
        for candidate in chain(predefined, (pdo.cob_id,), self._spare):
            if _is_pdo_cob_id(candidate) and self._is_free(candidate, pdo):
                self._used.add(candidate)
                return candidate
        return None

    def _is_free(self, cob_id: int, pdo: PdoConfiguration) -> bool:
        return cob_id not in self._used and self._owners.get(cob_id, pdo) is pdo


def _is_pdo_cob_id(cob_id: int) -> bool:
    """Whether a PDO may have this COB-ID (CiA 301 7.3.5).

    Without a node-ID it was written without ``$NODEID`` and is the same in all nodes.
    """
    if cob_id > cob.ID_MASK_11:
        return True  # 29 bits: no range is reserved there
    return cob_id in _PDO_COB_IDS and cob_id & _NODE_BITS != 0
