"""How the values of an axis travel: PDOs of a drive that are arranged before it is booted, as its maker may have done it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest.mock import patch

from axisbus.boot import comms
from axisbus.bus.pdo.configure import configure, set_pdo
from axisbus.bus.pdo.plan import LAYOUT_INPUTS, LAYOUT_OUTPUTS, PdoPlan, PdoRequirements, Policy
from axisbus.bus.pdo.read import read_pdo
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301 import cob
from axisbus.cia301.pdo import MappedObject
from axisbus.cia402.axes import own_index
from axisbus.cia402.port import ALL_OUTPUTS, INPUT_OBJECTS, ValueTransport

_SYNC, _EVENT = 1, 255
_BITS = {"mode": 8, "statusword": 16, "controlword": 16, "torque": 16, "target_torque": 16}
Options = Mapping[str, Any]
Travels = Options | Callable[[int, int], Options]


@contextmanager
def transported(options: Travels) -> Iterator[None]:
    """Boot drives with these transports of values within the block; values that are not named have the usual one.

    ``inputs`` and ``outputs`` are transports by the value's name, ``event_timer`` (s) that of event-driven inputs, ``every`` the
    number of SYNCs for each sample of an input, ``apart`` the inputs with a TPDO of their own (the second and further ones),
    ``controlword_first`` puts the controlword before the other outputs. A function of node-ID and axis returns the options of each.
    """
    if not options:
        yield
        return

    def arranged(
        sdo: SdoClient,
        wanted: PdoRequirements,
        policy: Policy,
        axis: int = 1,
        also: Sequence[tuple[bool, int]] = (),
    ) -> PdoPlan:
        own = options(sdo.node_id, axis) if callable(options) else options
        if not own:
            return configure(sdo, wanted, policy, axis, also=also)
        return _arrange(sdo, wanted, policy, axis, own)

    with patch.object(comms, "configure", arranged):
        yield


def _arrange(sdo: SdoClient, wanted: PdoRequirements, policy: Policy, axis: int, own: Options) -> PdoPlan:
    inputs, outputs = dict(own.get("inputs", {})), dict(own.get("outputs", {}))
    every, timer = own.get("every", {}), own.get("event_timer")
    here = [name for name in wanted.inputs if sdo.dictionary.has(own_index(INPUT_OBJECTS[name], axis))]
    travels = {name: inputs.get(name, ValueTransport.SYNC_PDO) for name in here}
    first = 4 * (axis - 1) + 1
    apart = own.get("apart", ())
    rows = [tuple(name for name in row if name not in apart) for row in LAYOUT_INPUTS]
    rows[1:1] = [(name,) for name in apart]
    groups = _grouped(rows, travels, every)
    for number, (names, transport) in enumerate(groups, start=first):
        is_event = transport is ValueTransport.EVENT_PDO
        set_pdo(
            sdo,
            False,
            number,
            mapping=tuple(_mapped(INPUT_OBJECTS, name, axis) for name in names),
            transmission_type=_EVENT if is_event else max(every.get(name, _SYNC) for name in names),
            event_timer=round((timer or 0.0) * 1000) if is_event else None,
            cob_id=cob.of_pdo(
                number, sdo.node_id, receive=False
            ),  # a maker's file may give all nodes the same
        )
    _empty(sdo, False, first + len(groups), first + 4)
    there = [name for name in wanted.outputs if sdo.dictionary.has(own_index(ALL_OUTPUTS[name], axis))]
    sent = {name: outputs.get(name, ValueTransport.SYNC_PDO) for name in there}
    layout = LAYOUT_OUTPUTS
    if own.get("controlword_first"):
        layout = (("controlword",), *(tuple(n for n in row if n != "controlword") for row in layout))
    sending = _grouped(layout, sent, {})
    _empty(sdo, True, first + len(sending), first + 4)
    for number, (names, transport) in enumerate(sending, start=first):
        ordered = sorted(names, key=lambda name: name == "controlword")
        set_pdo(
            sdo,
            True,
            number,
            mapping=tuple(_mapped(ALL_OUTPUTS, name, axis) for name in ordered),
            transmission_type=_EVENT if transport is ValueTransport.EVENT_PDO else _SYNC,
            cob_id=cob.of_pdo(number, sdo.node_id, receive=True),
        )
    kept = replace(policy, remap=False, communication=False, timers=False)
    asked = replace(
        wanted,
        inputs=tuple(name for name in wanted.inputs if inputs.get(name) is not ValueTransport.NONE),
        synchronous_inputs=frozenset(),
        synchronous_outputs=frozenset(),
    )
    plan = configure(sdo, asked, kept, axis)
    return replace(plan, inputs=plan.inputs | {n: t for n, t in inputs.items() if t is ValueTransport.NONE})


def _empty(sdo: SdoClient, receive: bool, begin: int, end: int) -> None:
    """Let these PDOs carry nothing."""
    for number in range(begin, end):
        if read_pdo(sdo, receive, number) is not None:
            set_pdo(sdo, receive, number, mapping=())


def _grouped(
    layout: Sequence[Sequence[str]], travels: Mapping[str, ValueTransport], every: Mapping[str, int]
) -> list[tuple[list[str], ValueTransport]]:
    """Return the PDOs: the values of a row of the layout that travel alike."""
    found: list[tuple[list[str], ValueTransport]] = []
    for row in layout:
        alike: dict[tuple[ValueTransport, int], list[str]] = {}
        for name in row:
            transport = travels.get(name)
            if transport in (ValueTransport.SYNC_PDO, ValueTransport.EVENT_PDO):
                alike.setdefault((transport, every.get(name, 1)), []).append(name)
        found += [(names, transport) for (transport, _), names in alike.items()]
    return found


def _mapped(objects: Mapping[str, int], name: str, axis: int) -> MappedObject:
    return MappedObject(own_index(objects[name], axis), 0, _BITS.get(name, 32))
