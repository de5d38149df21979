"""The PDO plan: from what a drive has and what motion wants, which value travels where, and what must be changed for it.

Theory of operation
-------------------
Everything is decided here, from values, and nothing is sent: the plan can be printed, tested, and made again with another policy
after the drive has refused something. Each direction is planned on its own:

1. *Keep*: the PDOs that the drive maps now and that together carry most of what is wanted.
2. *Remap*: the mappable objects laid out by ``LAYOUT_OUTPUTS`` and ``LAYOUT_INPUTS``.
3. Keep wins unless remapping is allowed and carries more.

Then every chosen PDO gets its COB-ID, transmission type, event timer and inhibit time. What no PDO carries falls back to SDO, with
the reason in ``notes``; what must be synchronous and is not is ``impossible``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

from axisbus.bus.pdo import choose, eventtimer, setpoint_edge_order
from axisbus.bus.pdo.cobids import CobIds
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

# By importance, not in the order of mapping: many drives take the entries of an RPDO one by one, and one that reads the edge of a
# set-point before its target starts towards the old one. So the controlword is mapped last, wherever it is.
LAYOUT_OUTPUTS = (
    ("controlword", "mode", "target_position"),
    ("target_velocity", "target_torque"),
    tuple(OFFSET_OBJECTS),
    tuple(INTERPOLATION_OBJECTS),
)
LAYOUT_INPUTS = (("statusword", "mode", "position"), ("velocity", "torque"), ("demand",))
EVERY_SYNC = frozenset(LAYOUT_INPUTS[0])  # what a cyclic mode lives on


class PdoChange(Enum):
    """What is to be done with one PDO."""

    KEEP = "as the drive has it"
    COMMUNICATION = "communication parameters set"
    TIMER = "event timer set"
    MAPPING = "remapped"
    DISABLE = "switched off, others carry the same"


@dataclass(frozen=True, slots=True)
class Policy:
    """How the plan may be made.

    ``sync``: PDOs are tied to SYNC, else event-driven. ``remap``: mappings may be changed. ``communication``: communication
    parameters may be changed; without that, at most event timers (``timers``). ``event_timer`` (ms) and ``inhibit_time`` (100 µs)
    are for event-driven TPDOs. ``refused`` holds the indices that the drive would not map. ``taken`` are COB-IDs of other nodes,
    ``spare`` those that PDOs past the fourth may take. ``fixed`` are the PDOs (whether receive, number) whose transmission type the
    user has set, ``timed`` the TPDOs, by number, whose event timer is the user's; both stay. ``requests`` are the TPDOs, by number,
    that we ask for by remote frames, each with its period in seconds; no other is ever asked for. ``slow`` is the number of SYNCs
    after which a TPDO comes that carries nothing of ``EVERY_SYNC``.
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


@dataclass(frozen=True, slots=True)
class PdoRequirements:
    """Which values motion wants (names of ``cia402.port``), and which of them must travel with SYNC."""

    inputs: tuple[str, ...] = tuple(INPUT_OBJECTS)
    outputs: tuple[str, ...] = tuple(OUTPUT_OBJECTS)
    synchronous_inputs: frozenset[str] = frozenset()
    synchronous_outputs: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class PlannedPdo:
    """One PDO as it is and as it shall be; ``values`` names what each mapping entry carries (None: nothing of motion's).

    ``request`` is the period in seconds in which we ask for a TPDO by remote frames, 0 for one that comes by itself.
    ``event_timer`` is the one in ms that it is to be given, None where it keeps its own; ``target`` has what was read back.
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
    """The plan of one axis: its PDOs, how each value travels, why some travel by SDO, and what cannot be had."""

    node_id: int
    axis: int
    pdos: tuple[PlannedPdo, ...]
    inputs: dict[str, ValueTransport]
    outputs: dict[str, ValueTransport]
    notes: tuple[str, ...] = ()
    impossible: tuple[str, ...] = ()

    @property
    def active(self) -> tuple[PlannedPdo, ...]:
        """The PDOs that carry values."""
        return tuple(pdo for pdo in self.pdos if pdo.change is not PdoChange.DISABLE)

    def carrier(self, index: int, subindex: int) -> PdoLocation | None:
        """Return where a PDO in use carries an object, None where none does."""
        for pdo in (pdo for pdo in self.active if pdo.target.valid):
            shift = 0
            for entry in pdo.target.mapping:
                if (entry.index, entry.subindex) == (index, subindex):
                    return PdoLocation(pdo.target.cob_id, pdo.name, shift, entry.bits)
                shift += entry.bits
        return None

    @property
    def edge_after_target(self) -> bool:
        """Whether the edge of a new set-point must go one SYNC after its target (see ``edge``)."""
        return setpoint_edge_order.after_target([pdo.values for pdo in self.active if pdo.receive])

    @property
    def event_timers(self) -> tuple[EventTimer, ...]:
        """The event timers that were to be changed; once the plan holds, with what has become of them."""
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
    """Plan one axis (1 to 8); ``objects``: see ``mapping.axis_objects``. Raises nothing: what is wrong stands in the plan."""
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
    )


def spare_cob_ids(used_nodes: frozenset[int], node_id: int | None = None) -> tuple[int, ...]:
    """Return COB-IDs of the predefined connection set that no node of the bus has, for PDOs past the fourth of a node.

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
    """One direction: the wanted objects that the axis has, by the value's name."""

    receive: bool
    entries: dict[str, MapEntry]
    policy: Policy

    def plan(self, pdos: tuple[PdoConfiguration, ...], axis: int, ids: CobIds) -> tuple[PlannedPdo, ...]:
        """Plan the PDOs of an axis, out of all that the device has."""
        usable = [pdo for pdo in pdos if self._usable(pdo, axis)]
        slots = choose.slots([pdo for pdo in pdos if self.travels(pdo)], axis)
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
        """Plan by what ``usable`` PDOs map already, or by a ``layout`` over ``slots``, where that may be made and carries more."""
        kept = choose.keep(usable, self.entries, switch_on=self.policy.communication)
        if self.policy.remap and self.policy.communication:
            laid = choose.lay_out(slots, self._mappable(), layout, last=setpoint_edge_order.CONTROLWORD)
            if len(laid.carried) > len(kept.carried):
                kept = laid
        planned = [self._planned(pdo, mapping, ids) for pdo, mapping in kept.pdos]
        return [pdo for pdo in planned if pdo is not None]

    def travels(self, pdo: PdoConfiguration) -> bool:
        """Whether it may be used: it is sent or taken by itself, or can be made so, or is one that we ask for."""
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
            return f"its dictionary does not let it be mapped into {direction}, and no present mapping has it"
        if not (self.policy.remap and self.policy.communication):
            return "the mapping is fixed and does not hold it"
        return f"{direction} with room for it is not there"

    def sources(self, wanted: tuple[str, ...], pdos: Sequence[PlannedPdo]) -> dict[str, ValueTransport]:
        """Return how each value travels by these PDOs."""
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
                texts.append(f"{what} travels by SDO: {self.reason(name)}")
        return texts

    def _usable(self, pdo: PdoConfiguration, axis: int) -> bool:
        """Whether its present mapping may serve: no other axis's targets beside ours, and sent or taken without being asked for."""
        if self.receive and any(_is_of_other_axis(mapped, axis) for mapped in pdo.mapping):
            return False
        return self.travels(pdo)

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
            wanted = SYNC_EVERY if self.receive else self._pace(pdo)
            keeps = pdo.synchronous if self.receive else pdo.transmission_type == wanted
            return pdo if keeps else replace(pdo, transmission_type=wanted)
        if pdo.transmission_type not in _EVENT_TYPES:
            pdo = replace(pdo, transmission_type=EVENT_PROFILE)
        return pdo if self.receive else self._timers(pdo)

    def _pace(self, pdo: PdoConfiguration) -> int:
        """With which SYNC a TPDO comes: each, unless the wire is too full for what may come less often."""
        carried = choose.names_in(pdo.mapping, self.entries)
        return SYNC_EVERY if EVERY_SYNC.intersection(carried) else self.policy.slow

    def _timers(self, pdo: PdoConfiguration) -> PdoConfiguration:
        """Event timer and inhibit time of an event-driven TPDO, where the drive has them and they are not set tighter."""
        inhibit = self.policy.inhibit_time if pdo.inhibit_time == 0 else pdo.inhibit_time
        return self._timed(replace(pdo, inhibit_time=inhibit), start=True)

    def _quicker(self, pdo: PdoConfiguration) -> PdoConfiguration:
        """The statusword's TPDO, event-driven by the user's wish or because the drive keeps it so: the handshake lives on it."""
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
        """TPDOs that are on, are not chosen and hold only what the chosen ones carry: they would only load the bus."""
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
    """How its values travel; a TPDO of type 0 comes at SYNC, but only when something changed: its silence means nothing."""
    on_change = not pdo.receive and pdo.target.transmission_type == 0
    return ValueTransport.SYNC_PDO if pdo.target.synchronous and not on_change else ValueTransport.EVENT_PDO


def _not_synchronous(
    names: frozenset[str], sources: Mapping[str, ValueTransport], policy: Policy
) -> list[str]:
    return [
        f"{name.replace('_', ' ')} must travel in a synchronous PDO, but "
        + (f"travels by {sources[name].value}" if policy.sync else "the bus has no SYNC (sync = false)")
        for name in sorted(names)
        if sources.get(name, ValueTransport.NONE) is not ValueTransport.SYNC_PDO
    ]
