"""The PDOs of a node, from its EDS and the cell file's PDO tables."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.cell.model import NodeConfig, PdoConfig
from axisbus.cell.writes import initial
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.pdo import MappedObject, PdoConfiguration
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds, Number
from axisbus.errors import ArgumentError

_MULTIPLEXED = 0xFE  # sub-index 0 of an MPDO (CiA 301 7.5.2.36)
_SIZED = re.compile(r"(.+?)\s*/\s*(\d{1,2})", re.ASCII)


@dataclass(frozen=True, slots=True)
class NodePdo:
    """One PDO of a node: its description in the EDS, with the configuration in the cell file (None: none).

    ``own_id`` says whether its COB-ID is specific to this node: configured, or with ``$NODEID`` in the EDS.
    """

    receive: bool
    pdo: PdoConfiguration
    config: PdoConfig | None
    own_id: bool

    @property
    def name(self) -> str:
        """``RPDO1`` and so on."""
        return f"{'RPDO' if self.receive else 'TPDO'}{self.pdo.number}"


def communication_index(receive: bool, number: int) -> int:
    """Return the index of the communication parameter of a PDO (number from 1)."""
    return (o.RPDO_COMMUNICATION if receive else o.TPDO_COMMUNICATION) + number - 1


def mapping_index(receive: bool, number: int) -> int:
    """Return the index of the mapping parameter of a PDO (number from 1)."""
    return (o.RPDO_MAPPING if receive else o.TPDO_MAPPING) + number - 1


def node_pdos(node: NodeConfig, eds: Eds) -> tuple[NodePdo, ...]:
    """Return the PDOs of the EDS; entries of a map that name no object are left out."""
    dictionary = Dictionary(eds, node.node_id)
    configs = {(config.receive, config.number): config for config in node.pdos}
    return tuple(
        _node_pdo(node, dictionary, eds, receive, number, configs.get((receive, number)))
        for receive in (True, False)
        for number in _numbers(eds, receive)
    )


def _numbers(eds: Eds, receive: bool) -> list[int]:
    """Return the numbers of the PDOs whose communication parameter the EDS has, ascending."""
    first = communication_index(receive, 1)
    area = range(first, first + o.PDOS_OF_A_KIND)
    return sorted(index - first + 1 for index in eds.objects if index in area)


def fixed_pdos(configs: Iterable[PdoConfig]) -> frozenset[tuple[bool, int]]:
    """Return the PDOs (whether receive, number) whose transmission type the cell file gives: the plan does not change it."""
    return frozenset((config.receive, config.number) for config in configs if config.transmission is not None)


def timed_pdos(configs: Iterable[PdoConfig]) -> frozenset[int]:
    """Return the TPDOs, by number, whose event timer the cell file gives: the plan does not change it."""
    return frozenset(
        config.number for config in configs if config.event_timer is not None and not config.receive
    )


def requested_pdos(configs: Iterable[PdoConfig]) -> dict[int, float]:
    """Return the TPDOs, by number, that the master requests by remote frames, with the period in seconds."""
    return {config.number: config.rtr for config in configs if config.rtr is not None and not config.receive}


def device_pdos(node: NodeConfig, eds: Eds) -> DevicePdos:
    """Return the same as the value from which a PDO plan is made."""
    found = node_pdos(node, eds)
    return DevicePdos(
        tuple(each.pdo for each in found if each.receive),
        tuple(each.pdo for each in found if not each.receive),
    )


def map_entry(key: str, dictionary: Dictionary) -> tuple[MappedObject, int | None]:
    """Return the object of an element of ``map`` (0 bits: no fixed size), and the size written after ``/``.

    Raises:
        ArgumentError: it names no object.
    """
    sized = _SIZED.fullmatch(key)
    entry = dictionary.resolve(sized[1] if sized else key)
    if entry.index in range(1, 8):  # a dummy is its data type (CiA 301 7.4.7)
        bits = {1: 1, 2: 8, 3: 16, 4: 32, 5: 8, 6: 16, 7: 32}[entry.index]
    else:
        bits = (entry.data_type.bits if entry.data_type is not None else None) or 0
    return MappedObject(entry.index, entry.subindex, bits), int(sized[2]) if sized else None


def _node_pdo(
    node: NodeConfig,
    dictionary: Dictionary,
    eds: Eds,
    receive: bool,
    number: int,
    config: PdoConfig | None,
) -> NodePdo:
    def read(subindex: int) -> int | None:
        return _number(dictionary, node, communication_index(receive, number), subindex)

    cob_id = read(o.PDO_COB_ID)
    pdo = PdoConfiguration(
        number,
        _identifier(cob_id or 0),
        cob_id is not None and not cob_id & cob.INVALID,
        255 if (kind := read(o.PDO_TRANSMISSION_TYPE)) is None else kind,
        tuple(_mapping(dictionary, node, mapping_index(receive, number))),
        None if receive else read(o.PDO_INHIBIT_TIME),
        read(o.PDO_EVENT_TIMER),
        None if receive else read(o.PDO_SYNC_START),
    )
    own = _formula(eds, communication_index(receive, number))
    if config is None:
        return NodePdo(receive, pdo, None, own)
    return NodePdo(receive, _configured(pdo, config, dictionary), config, own or config.cob_id is not None)


def _configured(pdo: PdoConfiguration, config: PdoConfig, dictionary: Dictionary) -> PdoConfiguration:
    """Return a PDO with the settings of its table; a table enables the PDO, an empty map disables it."""
    if config.cob_id is not None:
        pdo = replace(pdo, cob_id=config.cob_id)
    if config.transmission is not None:
        pdo = replace(pdo, transmission_type=config.transmission)
    if config.event_timer is not None:
        pdo = replace(pdo, event_timer=round(config.event_timer * 1000))
    if config.inhibit_time is not None:
        pdo = replace(pdo, inhibit_time=round(config.inhibit_time * 10_000))
    if config.sync_start is not None:
        pdo = replace(pdo, sync_start=config.sync_start)
    if config.map is not None:
        pdo = replace(pdo, mapping=tuple(_known(config.map, dictionary)))
    return replace(pdo, valid=config.map != ())


def _known(keys: tuple[str, ...], dictionary: Dictionary) -> Iterator[MappedObject]:
    for key in keys:
        try:
            yield map_entry(key, dictionary)[0]
        except ArgumentError:
            continue  # ``check.pdos`` reports it


def _mapping(dictionary: Dictionary, node: NodeConfig, index: int) -> Iterator[MappedObject]:
    count = _number(dictionary, node, index, 0) or 0
    for subindex in range(1, count + 1 if count < _MULTIPLEXED else 1):
        entry = _number(dictionary, node, index, subindex)
        if entry is None:
            return
        yield MappedObject.from_entry(entry)


def _number(dictionary: Dictionary, node: NodeConfig, index: int, subindex: int) -> int | None:
    value = initial(dictionary, node.node_id, index, subindex)
    return value if isinstance(value, int) else None


def _identifier(cob_id: int) -> int:
    return cob_id & (cob.ID_MASK_29 if cob_id & cob.EXTENDED else cob.ID_MASK_11)


def _formula(eds: Eds, index: int) -> bool:
    """Whether the COB-ID contains the node-ID: by ``$NODEID``, or because the file is a DCF, made for one node."""
    variable = eds.get(index, o.PDO_COB_ID)
    if variable is None:
        return False
    value = variable.parameter_value if variable.parameter_value is not None else variable.default
    return eds.node_id is not None or (isinstance(value, Number) and value.plus_node_id)
