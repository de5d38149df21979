"""Which PDOs carry the named inputs and outputs of a node, beside those of its axes.

No PDO of an axis is touched, and no RPDO is shared with one: its controlword keeps its frames, and their order, to itself. Else it
is planned as for an axis: what the node maps already, where that carries all; else a layout of our own over what is free.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from axisbus.bus.pdo.cobids import CobIds
from axisbus.bus.pdo.mapping import DevicePdos, MapEntry, map_entry_of
from axisbus.bus.pdo.plan import DirectionPlan, PdoPlan, PlannedPdo, Policy
from axisbus.cia301.pdo import PdoConfiguration
from axisbus.cia401.signal import Address
from axisbus.cia402.axes import first_axis
from axisbus.cia402.port import OUTPUT_OBJECTS, ValueTransport
from axisbus.eds.dictionary import Dictionary

_MOTION = frozenset(OUTPUT_OBJECTS.values())
Used = Collection[tuple[bool, int]]  # PDOs of axes: whether the node receives it, its number


@dataclass(frozen=True, slots=True)
class IoObjects:
    """The objects that are to be carried, each with how it may be mapped."""

    inputs: tuple[MapEntry, ...] = ()
    outputs: tuple[MapEntry, ...] = ()

    @classmethod
    def of(cls, dictionary: Dictionary, inputs: Sequence[Address], outputs: Sequence[Address]) -> IoObjects:
        """Look these objects up; those that the EDS does not have are left out."""
        sides = ([map_entry_of(dictionary, *key) for key in keys] for keys in (inputs, outputs))
        return cls(*(tuple(entry for entry in side if entry is not None) for side in sides))


def name_of(address: Address) -> str:
    """Return the name that a plan calls an object by, such as ``6200h:01``."""
    return f"{address[0]:04X}h:{address[1]:02X}"


def make_io_plan(
    node_id: int, device: DevicePdos, objects: IoObjects, policy: Policy, used: Used = ()
) -> PdoPlan:
    """Plan the PDOs of a node's inputs and outputs; ``used`` are those of its axes. What none carries stands in ``impossible``."""
    ids = CobIds(node_id, device, policy.taken, policy.spare)
    for receive, pdo in _of(device, used):
        ids.choose(pdo, receive)  # an axis has it
    sides = [
        DirectionPlan(
            receive,
            {name_of((entry.index, entry.subindex)): entry for entry in entries},
            replace(policy, slow=1, requests={}),  # nobody asks for inputs
        )
        for receive, entries in ((True, objects.outputs), (False, objects.inputs))
    ]
    plans = [_planned(side, device, ids, used) for side in sides]
    sources = [side.sources(tuple(side.entries), plan) for side, plan in zip(sides, plans, strict=True)]
    impossible = tuple(
        f"{name} is in no PDO: {side.reason(name)}"
        for side, found in zip(sides, sources, strict=True)
        for name, source in found.items()
        if source not in (ValueTransport.SYNC_PDO, ValueTransport.EVENT_PDO)
    )
    return PdoPlan(node_id, 0, (*plans[0], *plans[1]), sources[1], sources[0], impossible=impossible)


def _of(device: DevicePdos, used: Used) -> list[tuple[bool, PdoConfiguration]]:
    rows = [*((True, pdo) for pdo in device.rpdos), *((False, pdo) for pdo in device.tpdos)]
    return [(receive, pdo) for receive, pdo in rows if (receive, pdo.number) in used]


def _planned(side: DirectionPlan, device: DevicePdos, ids: CobIds, used: Used) -> list[PlannedPdo]:
    if not side.entries:
        return []
    pdos = device.rpdos if side.receive else device.tpdos
    free = [pdo for pdo in pdos if (side.receive, pdo.number) not in used and side.travels(pdo)]
    usable = [pdo for pdo in free if not (side.receive and _moves(pdo))]
    return side.chosen(usable, free, [list(side.entries)], ids)


def _moves(pdo: PdoConfiguration) -> bool:
    """Whether it holds what belongs to an axis: it is not ours to send."""
    return any(first_axis(mapped.index) in _MOTION for mapped in pdo.mapping)
