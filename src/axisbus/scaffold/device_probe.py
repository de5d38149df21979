"""Read the data for a first cell file from a device; nothing is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from axisbus.bus.sdo.access import try_upload
from axisbus.bus.sdo.client import SdoClient
from axisbus.cell import scale_proposal
from axisbus.cia301.datatypes import decode
from axisbus.cia402 import modes, options, state
from axisbus.cia402 import objects as o
from axisbus.cia402.axes import own_index
from axisbus.eds.dictionary import standard
from axisbus.errors import SdoAbort, SdoTimeout

MOST_AXES = 8

# Objects of an axis for a first cell file, beside the option codes and those of ``scale_proposal``.
OBJECTS = (
    *(
        (o.PROFILE_VELOCITY, 0),
        (o.PROFILE_ACCELERATION, 0),
        (o.PROFILE_DECELERATION, 0),
        (o.MAX_PROFILE_VELOCITY, 0),
    ),
    *(
        (o.SOFTWARE_POSITION_LIMIT, 1),
        (o.SOFTWARE_POSITION_LIMIT, 2),
        (o.HOMING_METHOD, 0),
        (o.RATED_TORQUE, 0),
    ),
    *((o.QUICK_STOP_DECELERATION, 0), (o.SUPPORTED_DRIVE_MODES, 0), (o.POLARITY, 0)),
)

Values = Mapping[tuple[int, int], int | None]


@dataclass(frozen=True, slots=True)
class ProbedAxis:
    """One axis of a device: its number (from 1), its state in words, and the values of its objects (None: missing)."""

    number: int
    power: str
    energised: bool
    values: Values = field(default_factory=dict)

    def get(self, index: int, subindex: int = 0) -> int | None:
        """Return the value of a first-axis object."""
        return self.values.get((index, subindex))

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes that 6502h lists, by their short names."""
        claimed = self.get(o.SUPPORTED_DRIVE_MODES)
        return (
            () if claimed is None else tuple(modes.short(mode) for mode in sorted(modes.supported(claimed)))
        )


def axes(sdo: SdoClient) -> list[ProbedAxis]:
    """Return the axes of a device: those with a statusword, 800h apart (CiA 402-2 5); blocks for several dozen transfers each.

    Raises:
        SdoTimeout, AdapterError: the device does not answer. SdoError: its answer for a statusword is no value.
    """
    found: list[ProbedAxis] = []
    while len(found) < MOST_AXES:
        number = len(found) + 1
        word = _read(sdo, o.STATUSWORD, 0, number)
        if word is None:
            break
        now = state.decode(word)
        wanted = (*OBJECTS, *scale_proposal.OBJECTS, *((each.index, each.subindex) for each in options.ALL))
        values = {key: _read(sdo, *key, number) for key in wanted}
        found.append(ProbedAxis(number, now.value, now in state.ENERGISED, values))
    return found


def _read(sdo: SdoClient, index: int, subindex: int, axis: int) -> int | None:
    data = try_upload(sdo, own_index(index, axis), subindex)
    if index == o.STATUSWORD and not isinstance(data, (bytes, SdoAbort, SdoTimeout)):
        raise data  # the axis exists, but its state is unknown
    if not isinstance(data, bytes):
        return None
    kind = standard(index, subindex)[1]
    value = decode(data, kind) if kind is not None and kind.integer else int.from_bytes(data, "little")
    return value if isinstance(value, int) else None
