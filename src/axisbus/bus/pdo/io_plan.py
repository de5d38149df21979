"""Plan the PDOs for the named inputs and outputs of a node, in addition to those of its axes.

The plan changes no PDO of an axis, and shares no RPDO with one: the frames of the controlword, and their order, belong to the axis
alone. Otherwise the planning is as for an axis: the present mappings of the node if they carry all objects, else a layout of
axisbus over the free PDOs.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from axisbus.bus.pdo.choose import CobIds
from axisbus.bus.pdo.mapping import DevicePdos, MapEntry, map_entry_of
from axisbus.bus.pdo.plan import DirectionPlan, PdoPlan, PlannedPdo, Policy, unused
from axisbus.cia301.pdo import PdoConfiguration
from axisbus.cia401.signal import Address
from axisbus.cia402.axes import first_axis
from axisbus.cia402.port import OUTPUT_OBJECTS, ValueTransport
from axisbus.eds.dictionary import Dictionary

_MOTION = frozenset(OUTPUT_OBJECTS.values())
Used = Collection[tuple[bool, int]]  # PDOs of axes: whether the node receives it, its number


@dataclass(frozen=True, slots=True)
class IoObjects:
    """The objects to be carried, each with its mapping options."""

    inputs: tuple[MapEntry, ...] = ()
    outputs: tuple[MapEntry, ...] = ()

    @classmethod
    def of(cls, dictionary: Dictionary, inputs: Sequence[Address], outputs: Sequence[Address]) -> IoObjects:
        """Look these objects up; leave out those that the EDS does not have."""
        sides = ([map_entry_of(dictionary, *key) for key in keys] for keys in (inputs, outputs))
        return cls(*(tuple(entry for entry in side if entry is not None) for side in sides))


def name_of(address: Address) -> str:
    """Return the name of an object in a plan, such as ``6200h:01``."""
    return f"{address[0]:04X}h:{address[1]:02X}"


def make_io_plan(
    node_id: int, device: DevicePdos, objects: IoObjects, policy: Policy, used: Used = ()
) -> PdoPlan:
    """Plan the PDOs of a node's inputs and outputs; ``used`` are those of its axes.

    ``impossible`` lists the objects that no PDO carries.
    """
    ids = CobIds(node_id, device, policy.taken, policy.spare)
    for receive, pdo in _of(device, used):
        ids.choose(pdo, receive)  # an axis has it
    sides = [
        DirectionPlan(
            receive,
            {name_of((entry.index, entry.subindex)): entry for entry in entries},
            replace(policy, slow=1, requests={}),  # inputs are never requested
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
    pdos = (*plans[0], *plans[1])
    unused_pdos = unused(device, pdos)
    return PdoPlan(node_id, 0, pdos, sources[1], sources[0], impossible=impossible, unused=unused_pdos)


def _of(device: DevicePdos, used: Used) -> list[tuple[bool, PdoConfiguration]]:
    rows = [*((True, pdo) for pdo in device.rpdos), *((False, pdo) for pdo in device.tpdos)]
    return [(receive, pdo) for receive, pdo in rows if (receive, pdo.number) in used]


def _planned(side: DirectionPlan, device: DevicePdos, ids: CobIds, used: Used) -> list[PlannedPdo]:
    if not side.entries:
        return []
    pdos = device.rpdos if side.receive else device.tpdos
    free = [pdo for pdo in pdos if (side.receive, pdo.number) not in used and side.is_transmitted(pdo)]
    usable = [pdo for pdo in free if not (side.receive and _has_axis_object(pdo))]
    return side.chosen(usable, free, [list(side.entries)], ids)


def _has_axis_object(pdo: PdoConfiguration) -> bool:
    """Whether the RPDO contains an object of an axis, so that it must not be sent for outputs."""
    return any(first_axis(mapped.index) in _MOTION for mapped in pdo.mapping)
