"""The PDO plan: from the PDOs of a drive and the wanted values, which PDO carries each value, and the necessary changes.

Theory of operation
-------------------
All decisions are made here, from values, without sending anything. So the plan can be printed, tested, and made again with another
policy after the drive has refused something. Each direction is planned separately:

1. *Keep*: the present PDOs that together carry most of the wanted values.
2. *Remap*: the mappable objects laid out by ``LAYOUT_OUTPUTS`` and ``LAYOUT_INPUTS``.
3. Keep is chosen unless remapping is allowed and carries more.

Then every chosen PDO gets its COB-ID, transmission type, event timer and inhibit time. Values without a PDO are transferred by SDO,
with the reason in ``notes``. Values that must be synchronous and are not are listed in ``impossible``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

from axisbus.bus.pdo import choose, eventtimer, setpoint_edge_order
from axisbus.bus.pdo.choose import CobIds
from axisbus.bus.pdo.eventtimer import EventTimer
from axisbus.bus.pdo.mapping import DevicePdos, MapEntry
from axisbus.cia301 import cob
from axisbus.cia301.pdo import MappedObject, PdoConfiguration, PdoLocation
from axisbus.cia402 import dictionary as catalogue
from axisbus.cia402.axes import PROFILE_AREA, axis_of, own_index
from axisbus.cia402.port import (
    ALL_OUTPUTS,
    INPUT_OBJECTS,
    INTERPOLATION_OBJECTS,
    OFFSET_OBJECTS,
    OUTPUT_OBJECTS,
    ValueTransport,
)

SYNC_EVERY = 1  # transmission type: with every SYNC (CiA 301 table 72)
EVENT_PROFILE = 255  # transmission type: event-driven by the device profile
_EVENT_TYPES = (254, 255)

# By importance, not in the order of mapping. Many drives take the entries of an RPDO one by one. A drive that reads the edge of a
# set-point before its target starts towards the old target. So the controlword is always mapped last.
LAYOUT_OUTPUTS = (
    ("controlword", "mode", "target_position"),
    ("target_velocity", "target_torque"),
    tuple(OFFSET_OBJECTS),
    tuple(INTERPOLATION_OBJECTS),
)
LAYOUT_INPUTS = (("statusword", "mode", "position"), ("velocity", "torque"), ("demand",))
EVERY_SYNC = frozenset(LAYOUT_INPUTS[0])  # needed in every cycle of a cyclic mode


class PdoChange(Enum):
    """Change of one PDO."""

    KEEP = "as the drive has it"
    COMMUNICATION = "communication parameters set"
    TIMER = "event timer set"
    MAPPING = "remapped"
    DISABLE = "switched off, others contain the same"


@dataclass(frozen=True, slots=True)
class Policy:
    """Limits for the plan.

    - ``sync``: PDOs are synchronous, else event-driven.
    - ``remap``: mappings may be changed.
    - ``communication``: communication parameters may be changed; without it, at most event timers (``timers``).
    - ``event_timer`` (ms) and ``inhibit_time`` (100 µs) are for event-driven TPDOs.
    - ``refused``: indices that the drive refused to map.
    - ``taken``: COB-IDs of other nodes.
    - ``spare``: COB-IDs available to PDOs after the fourth.
    - ``fixed``: PDOs (whether receive, number) whose transmission type stays: the user has set it, or the drive has refused one.
    - ``timed``: numbers of TPDOs whose event timer the user has set; it is not changed.
    - ``requests``: numbers of TPDOs that the master requests by remote frames, each with its period in seconds; no other TPDO is
      requested.
    - ``slow``: transmission type (number of SYNCs) of a TPDO that carries nothing of ``EVERY_SYNC``.
    - ``receive``: transmission type of a synchronous RPDO. 0 to 240 are alike: the next SYNC applies its data (CiA 301 7.5.2.36).
    """

    sync: bool = True
    remap: bool = True
    communication: bool = True
    timers: bool = True
    event_timer: int = eventtimer.LIMIT
    inhibit_time: int = 50
    refused: frozenset[int] = frozenset()
    taken: frozenset[int] = frozenset()
    spare: tuple[int, ...] = ()
    fixed: frozenset[tuple[bool, int]] = frozenset()
    timed: frozenset[int] = frozenset()
    requests: Mapping[int, float] = field(default_factory=dict)
    slow: int = 1
    receive: int = SYNC_EVERY


@dataclass(frozen=True, slots=True)
class PdoRequirements:
    """The values that motion needs (names of ``axisbus.cia402.port``), and those of them that must be synchronous."""

    inputs: tuple[str, ...] = tuple(INPUT_OBJECTS)
    outputs: tuple[str, ...] = tuple(OUTPUT_OBJECTS)
    synchronous_inputs: frozenset[str] = frozenset()
    synchronous_outputs: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class PlannedPdo:
    """One PDO before and after; ``values`` names the value of each mapping entry (None: not used by motion).

    ``request`` is the period in seconds in which the master requests a TPDO by remote frames, 0 if the drive sends it
    automatically. ``event_timer`` is the new one in ms, None if it is not changed; ``target`` has the value read back.
    """

    receive: bool
    before: PdoConfiguration
    target: PdoConfiguration
    change: PdoChange
    values: tuple[str | None, ...]
    signed: tuple[bool, ...]
    request: float = 0.0
    event_timer: int | None = None

    @property
    def name(self) -> str:
        """``RPDO1`` and so on."""
        return f"{'RPDO' if self.receive else 'TPDO'}{self.target.number}"


@dataclass(frozen=True, slots=True)
class PdoPlan:
    """The plan of one axis: its PDOs, the transport of each value, the reasons for SDO, and unmet requirements.

    ``unused``: the other PDOs of the device that are switched on, and whether each is an RPDO.
    """

    node_id: int
    axis: int
    pdos: tuple[PlannedPdo, ...]
    inputs: dict[str, ValueTransport]
    outputs: dict[str, ValueTransport]
    notes: tuple[str, ...] = ()
    impossible: tuple[str, ...] = ()
    unused: tuple[tuple[bool, PdoConfiguration], ...] = ()

    @property
    def active(self) -> tuple[PlannedPdo, ...]:
        """The PDOs that carry values."""
        return tuple(pdo for pdo in self.pdos if pdo.change is not PdoChange.DISABLE)

    def carrier(self, index: int, subindex: int) -> PdoLocation | None:
        """Return the location of an object in the PDOs in use, None if none carries it."""
        for pdo in (pdo for pdo in self.active if pdo.target.valid):
            shift = 0
            for entry in pdo.target.mapping:
                if (entry.index, entry.subindex) == (index, subindex):
                    return PdoLocation(pdo.target.cob_id, pdo.name, shift, entry.bits)
                shift += entry.bits
        return None

    @property
    def edge_after_target(self) -> bool:
        """Whether the edge of a new set-point must go one SYNC after its target (see ``setpoint_edge_order``)."""
        return setpoint_edge_order.after_target([pdo.values for pdo in self.active if pdo.receive])

    @property
    def event_timers(self) -> tuple[EventTimer, ...]:
        """The event timers to be changed; after the plan has been applied, with the result."""
        return tuple(
            EventTimer(
                pdo.name,
                tuple(name for name in pdo.values if name is not None),
                pdo.before.event_timer or 0,
                pdo.event_timer,
                pdo.target.event_timer or 0,
            )
            for pdo in self.active
            if pdo.event_timer is not None
        )

    @property
    def remapped(self) -> bool:
        """Whether a mapping changes."""
        return any(pdo.change is PdoChange.MAPPING for pdo in self.pdos)


def make_plan(
    node_id: int,
    device: DevicePdos,
    objects: Mapping[int, MapEntry],
    wanted: PdoRequirements | None = None,
    policy: Policy | None = None,
    axis: int = 1,
) -> PdoPlan:
    """Plan one axis (1 to 8); ``objects``: see ``mapping.axis_objects``. Raises nothing: problems are listed in the plan."""
    wanted = wanted or PdoRequirements()
    policy = policy or Policy()
    ids = CobIds(node_id, device, policy.taken, policy.spare)
    outputs = DirectionPlan(True, _entries(ALL_OUTPUTS, wanted.outputs, objects, axis), policy)
    inputs = DirectionPlan(False, _entries(INPUT_OBJECTS, wanted.inputs, objects, axis), policy)
    pdos = (*outputs.plan(device.rpdos, axis, ids), *inputs.plan(device.tpdos, axis, ids))
    sources_out = outputs.sources(wanted.outputs, pdos)
    sources_in = inputs.sources(wanted.inputs, pdos)
    return PdoPlan(
        node_id,
        axis,
        pdos,
        sources_in,
        sources_out,
        notes=(*outputs.notes(sources_out, axis), *inputs.notes(sources_in, axis)),
        impossible=(
            *_not_synchronous(wanted.synchronous_outputs, sources_out, policy),
            *_not_synchronous(wanted.synchronous_inputs, sources_in, policy),
        ),
        unused=unused(device, pdos),
    )


def unused(device: DevicePdos, planned: Sequence[PlannedPdo]) -> tuple[tuple[bool, PdoConfiguration], ...]:
    """Return the PDOs of a device that are on and that a plan neither uses nor changes, each with whether it is an RPDO."""
    numbers = {(pdo.receive, pdo.target.number) for pdo in planned}
    rows = [*((True, pdo) for pdo in device.rpdos), *((False, pdo) for pdo in device.tpdos)]
    return tuple(
        (receive, pdo) for receive, pdo in rows if pdo.valid and (receive, pdo.number) not in numbers
    )


def spare_cob_ids(used_nodes: frozenset[int], node_id: int | None = None) -> tuple[int, ...]:
    """Return COB-IDs of the predefined connection set that no node of the bus has, for PDOs after the fourth of a node.

    With ``node_id``, one of ``used_nodes``, only this node's share: no two nodes get the same.
    """
    bases = (*cob.RPDO, *cob.TPDO)
    free = [node for node in reversed(cob.NODE_IDS) if node not in used_nodes]
    if node_id is not None:
        free = free[sorted(used_nodes).index(node_id) :: len(used_nodes)]
    return tuple(base + node for node in free for base in bases)


def _entries(
    table: Mapping[str, int], wanted: tuple[str, ...], objects: Mapping[int, MapEntry], axis: int
) -> dict[str, MapEntry]:
    indices = {name: own_index(table[name], axis) for name in wanted}
    return {name: objects[index] for name, index in indices.items() if index in objects}


@dataclass(frozen=True, slots=True)
class DirectionPlan:
    """Plan of one direction; ``entries`` are the wanted objects that the axis has, by the value's name."""

    receive: bool
    entries: dict[str, MapEntry]
    policy: Policy

    def plan(self, pdos: tuple[PdoConfiguration, ...], axis: int, ids: CobIds) -> tuple[PlannedPdo, ...]:
        """Plan the PDOs of an axis, from all PDOs of the device."""
        usable = [pdo for pdo in pdos if self._usable(pdo, axis)]
        slots = choose.slots([pdo for pdo in pdos if self.is_transmitted(pdo)], axis)
        layout = LAYOUT_OUTPUTS if self.receive else LAYOUT_INPUTS
        chosen = self.chosen(usable, slots, layout, ids)
        return (*chosen, *self._redundant(pdos, chosen))

    def chosen(
        self,
        usable: Sequence[PdoConfiguration],
        slots: Sequence[PdoConfiguration],
        layout: Sequence[Sequence[str]],
        ids: CobIds,
    ) -> list[PlannedPdo]:
        """Plan with the present mappings of ``usable`` PDOs, or a ``layout`` over ``slots`` if that is allowed and carries more."""
        mappings = choose.keep_mappings(usable, self.entries, switch_on=self.policy.communication)
        if self.policy.remap and self.policy.communication:
            new_layout = choose.lay_out(slots, self._mappable(), layout, last=setpoint_edge_order.CONTROLWORD)
            if len(new_layout.carried) > len(mappings.carried):
                mappings = new_layout
        planned = [self._planned(pdo, mapping, ids) for pdo, mapping in mappings.pdos]
        return [pdo for pdo in planned if pdo is not None]

    def is_transmitted(self, pdo: PdoConfiguration) -> bool:
        """Whether the PDO may be used: it is sent or accepted automatically, can be set to that, or the master requests it."""
        if self._may_retype(pdo) or self._requested(pdo):
            return True
        return pdo.synchronous or pdo.transmission_type in _EVENT_TYPES

    def reason(self, name: str) -> str:
        """Return why no PDO carries a value that the device has."""
        entry = self.entries[name]
        direction = "an RPDO" if self.receive else "a TPDO"
        if entry.index in self.policy.refused:
            return f"the drive refuses to map it into {direction}"
        if not self._may_map(entry):
            return f"its dictionary does not allow it to be mapped into {direction}, and no present mapping has it"
        if not (self.policy.remap and self.policy.communication):
            return "the mapping is fixed and does not contain it"
        return f"{direction} with room for it does not exist"

    def sources(self, wanted: tuple[str, ...], pdos: Sequence[PlannedPdo]) -> dict[str, ValueTransport]:
        """Return the transport of each value by these PDOs."""
        found = {name: ValueTransport.SDO if name in self.entries else ValueTransport.NONE for name in wanted}
        for pdo in pdos:
            if pdo.receive is self.receive:
                found.update((name, _source(pdo)) for name in pdo.values if name is not None)
        return found

    def notes(self, sources: Mapping[str, ValueTransport], axis: int) -> list[str]:
        table = ALL_OUTPUTS if self.receive else INPUT_OBJECTS
        texts = []
        for name, source in sources.items():
            index = table[name]
            what = f"{own_index(index, axis):04X}h ({catalogue.name(index)})"
            if source is ValueTransport.NONE:
                texts.append(f"{what} is not in the drive's dictionary")
            elif source is ValueTransport.SDO:
                texts.append(f"{what} is transmitted by SDO: {self.reason(name)}")
        return texts

    def _usable(self, pdo: PdoConfiguration, axis: int) -> bool:
        """Whether the present mapping may be used: it has no other axes' objects, and the PDO may be used (``is_transmitted``)."""
        if self.receive and any(_is_of_other_axis(mapped, axis) for mapped in pdo.mapping):
            return False
        return self.is_transmitted(pdo)

    def _may_retype(self, pdo: PdoConfiguration) -> bool:
        return self.policy.communication and (self.receive, pdo.number) not in self.policy.fixed

    def _requested(self, pdo: PdoConfiguration) -> bool:
        return not self.receive and pdo.on_request and pdo.number in self.policy.requests

    def _mappable(self) -> dict[str, MapEntry]:
        return {name: entry for name, entry in self.entries.items() if self._may_map(entry)}

    def _may_map(self, entry: MapEntry) -> bool:
        return (entry.receive if self.receive else entry.transmit) and entry.index not in self.policy.refused

    def _planned(
        self, pdo: PdoConfiguration, mapping: tuple[MappedObject, ...], ids: CobIds
    ) -> PlannedPdo | None:
        target = replace(pdo, mapping=mapping)
        if self.policy.communication:
            cob_id = ids.choose(pdo, self.receive)
            if cob_id is None:
                return None
            target = self._communication(replace(target, cob_id=cob_id, valid=True))
        elif self.policy.timers:
            target = self._quicker(target)
        change = PdoChange.COMMUNICATION if self.policy.communication else PdoChange.TIMER
        if target == pdo:
            change = PdoChange.KEEP
        return PlannedPdo(
            self.receive,
            pdo,
            target,
            change if mapping == pdo.mapping else PdoChange.MAPPING,
            choose.names_in(mapping, self.entries),
            tuple(self._signed(mapped) for mapped in mapping),
            self.policy.requests[target.number] if self._requested(target) else 0.0,
            target.event_timer if target.event_timer != pdo.event_timer else None,
        )

    def _communication(self, pdo: PdoConfiguration) -> PdoConfiguration:
        if not self._may_retype(pdo):
            return self._quicker(pdo)
        if self.policy.sync:
            wanted = self.policy.receive if self.receive else self._pace(pdo)
            keeps = pdo.synchronous if self.receive else pdo.transmission_type == wanted
            return pdo if keeps else replace(pdo, transmission_type=wanted)
        if pdo.transmission_type not in _EVENT_TYPES:
            pdo = replace(pdo, transmission_type=EVENT_PROFILE)
        return pdo if self.receive else self._timers(pdo)

    def _pace(self, pdo: PdoConfiguration) -> int:
        """Return the transmission type of a TPDO: every SYNC, unless the bus is too full and the values may come less often."""
        carried = choose.names_in(pdo.mapping, self.entries)
        return SYNC_EVERY if EVERY_SYNC.intersection(carried) else self.policy.slow

    def _timers(self, pdo: PdoConfiguration) -> PdoConfiguration:
        """Set event timer and inhibit time of an event-driven TPDO, if the drive has them and they are not set tighter."""
        inhibit = self.policy.inhibit_time if pdo.inhibit_time == 0 else pdo.inhibit_time
        return self._timed(replace(pdo, inhibit_time=inhibit), start=True)

    def _quicker(self, pdo: PdoConfiguration) -> PdoConfiguration:
        """Shorten the event timer of an event-driven TPDO with the statusword, because the set-point handshake depends on it."""
        carries = "statusword" in choose.names_in(pdo.mapping, self.entries)
        if not carries or pdo.transmission_type not in _EVENT_TYPES:
            return pdo
        return self._timed(pdo, start=False)

    def _timed(self, pdo: PdoConfiguration, *, start: bool) -> PdoConfiguration:
        if pdo.number in self.policy.timed:
            return pdo
        event = eventtimer.quicker(pdo.event_timer, self.policy.event_timer, start=start)
        return replace(pdo, event_timer=event)

    def _signed(self, mapped: MappedObject) -> bool:
        return any(entry.mapped == mapped and entry.signed for entry in self.entries.values())

    def _redundant(self, pdos: tuple[PdoConfiguration, ...], chosen: list[PlannedPdo]) -> list[PlannedPdo]:
        """Switch off valid TPDOs that are not chosen and hold only values of the chosen ones: they would only load the bus."""
        if self.receive or not self.policy.communication:
            return []
        carried = {mapped for planned in chosen for mapped in planned.target.mapping}
        numbers = {planned.target.number for planned in chosen}
        numbers |= {number for receive, number in self.policy.fixed if not receive}  # the user wants it
        return [
            PlannedPdo(False, pdo, replace(pdo, valid=False), PdoChange.DISABLE, (), ())
            for pdo in pdos
            if pdo.valid and pdo.number not in numbers and pdo.mapping and carried.issuperset(pdo.mapping)
        ]


def _is_of_other_axis(mapped: MappedObject, axis: int) -> bool:
    return mapped.index in PROFILE_AREA and axis_of(mapped.index) != axis


def _source(pdo: PlannedPdo) -> ValueTransport:
    """Return the transport of a PDO's values.

    A TPDO of type 0 is sent at SYNC only after a change, so its silence has no meaning.
    """
    on_change = not pdo.receive and pdo.target.transmission_type == 0
    return ValueTransport.SYNC_PDO if pdo.target.synchronous and not on_change else ValueTransport.EVENT_PDO


def _not_synchronous(
    names: frozenset[str], sources: Mapping[str, ValueTransport], policy: Policy
) -> list[str]:
    return [
        f"{name.replace('_', ' ')} must be transmitted in a synchronous PDO, but "
        + (
            f"is transmitted by {sources[name].value}"
            if policy.sync
            else "the bus has no SYNC (sync = false)"
        )
        for name in sorted(names)
        if sources.get(name, ValueTransport.NONE) is not ValueTransport.SYNC_PDO
    ]
