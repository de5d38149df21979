"""PDO configurations of drives as text, for the tests of the planner and of its plans."""

from __future__ import annotations

from axisbus.bus.pdo.mapping import DevicePdos, MapEntry
from axisbus.bus.pdo.plan import PdoRequirements
from axisbus.cia301.pdo import MappedObject, PdoConfiguration

NODE = 5

# object: bits, signed, RPDO, TPDO (CiA 402-3)
CIA402 = {
    0x6040: (16, False, True, False),
    0x6060: (8, True, True, False),
    0x607A: (32, True, True, False),
    0x60FF: (32, True, True, False),
    0x6071: (16, True, True, False),
    0x60B1: (32, True, True, False),
    0x60B2: (16, True, True, False),
    0x6041: (16, False, False, True),
    0x6061: (8, True, False, True),
    0x6062: (32, True, False, True),
    0x6064: (32, True, False, True),
    0x606C: (32, True, False, True),
    0x6077: (16, True, False, True),
}


def objects(*without: int, axis: int = 1, unmappable: tuple[int, ...] = ()) -> dict[int, MapEntry]:
    """The objects of an axis, less some, and with some that may not be mapped."""
    offset = 0x800 * (axis - 1)
    return {
        index + offset: MapEntry(
            index + offset,
            0,
            bits,
            signed,
            receive and index not in unmappable,
            transmit and index not in unmappable,
        )
        for index, (bits, signed, receive, transmit) in CIA402.items()
        if index not in without
    }


def mapped(text: str) -> tuple[MappedObject, ...]:
    """``"6040/16 607A/32"`` as a mapping."""
    entries = []
    for word in text.split():
        index, bits = word.split("/")
        entries.append(MappedObject(int(index, 16), 0, int(bits)))
    return tuple(entries)


def rpdo(
    number: int, text: str, transmission: int = 255, valid: bool = True, cob_id: int | None = None
) -> PdoConfiguration:
    default = 0x100 + 0x100 * number + NODE if number <= 4 else 0
    return PdoConfiguration(number, default if cob_id is None else cob_id, valid, transmission, mapped(text))


def tpdo(
    number: int,
    text: str,
    transmission: int = 255,
    valid: bool = True,
    cob_id: int | None = None,
    event: int | None = None,
    inhibit: int | None = None,
) -> PdoConfiguration:
    default = 0x80 + 0x100 * number + NODE if number <= 4 else 0
    return PdoConfiguration(
        number, default if cob_id is None else cob_id, valid, transmission, mapped(text), inhibit, event
    )


# The default mapping proposed by CiA 402-3: the controlword in every RPDO.
GENERIC = DevicePdos(
    (
        rpdo(1, "6040/16"),
        rpdo(2, "6040/16 6060/8"),
        rpdo(3, "6040/16 607A/32"),
        rpdo(4, "6040/16 60FF/32"),
    ),
    (
        tpdo(1, "6041/16", event=0, inhibit=0),
        tpdo(2, "6041/16 6061/8", event=0, inhibit=0),
        tpdo(3, "6041/16 6064/32", event=0, inhibit=0),
        tpdo(4, "6041/16 606C/32", event=0, inhibit=0),
    ),
)
EMPTY = DevicePdos(
    tuple(rpdo(number, "", valid=False) for number in (1, 2, 3, 4)),
    tuple(tpdo(number, "", valid=False) for number in (1, 2, 3, 4)),
)
NO_TORQUE = PdoRequirements(
    inputs=("statusword", "mode", "position", "velocity"),
    outputs=("controlword", "mode", "target_position", "target_velocity"),
)
