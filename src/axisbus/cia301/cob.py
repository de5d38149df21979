"""COB-IDs of the generic pre-defined connection set (CiA 301 7.3.5)."""

from __future__ import annotations

NMT = 0x000
SYNC = 0x080
EMCY = 0x080
TIME = 0x100
TPDO = (0x180, 0x280, 0x380, 0x480)
RPDO = (0x200, 0x300, 0x400, 0x500)
SDO_TX = 0x580  # server to client
SDO_RX = 0x600  # client to server
HEARTBEAT = 0x700
LSS_TX = 0x7E4
LSS_RX = 0x7E5

NODE_IDS = range(1, 128)

# Bits of the COB-ID entries in 14xxh:1 and 18xxh:1.
INVALID = 1 << 31
NO_RTR = 1 << 30
EXTENDED = 1 << 29
# Bit 30 of 1005h: the device sends SYNC. Bits 31 and 30 of 1012h: the device consumes TIME, the device sends TIME.
SYNC_PRODUCER = 1 << 30
TIME_CONSUMER = 1 << 31
TIME_PRODUCER = 1 << 30
ID_MASK_11 = 0x7FF
ID_MASK_29 = 0x1FFF_FFFF


def of_pdo(number: int, node_id: int, *, receive: bool) -> int | None:
    """Return the predefined COB-ID of a PDO with ``number`` (from 1) of a node; None after the fourth, which has none."""
    bases = RPDO if receive else TPDO
    return bases[number - 1] + node_id if number <= len(bases) else None


def all_of_pdos(node_id: int) -> frozenset[int]:
    """Return the predefined COB-IDs of all PDOs of a node."""
    return frozenset(base + node_id for base in (*RPDO, *TPDO))
