"""Configure a live drive's PDOs by a plan, with the procedure of CiA 301, and read everything back.

Theory of operation
-------------------
``configure`` reads the present PDOs, makes a plan, and applies it. If the drive refuses a step, the next plan takes the refusal
into account: an object that cannot be mapped is left out; RPDOs that do not take transmission type 1 get 0, which is synchronous
too; and types, mappings or communication parameters that cannot be changed stay as they are. Before every new attempt the old
parameters are restored in the drive, so that a refusal half-way never leaves a PDO switched off.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import replace

from axisbus.bus.pdo.io_plan import IoObjects, Used, make_io_plan
from axisbus.bus.pdo.mapping import DevicePdos, axis_objects
from axisbus.bus.pdo.plan import PdoChange, PdoPlan, PdoRequirements, PlannedPdo, Policy, make_plan
from axisbus.bus.pdo.read import Indices, read_number, read_pdo, read_pdos
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.pdo import MappedObject, PdoConfiguration
from axisbus.errors import BootError, SdoAbort
from axisbus.wording import counted

_STEP = "PDO configuration"


# Abort codes on a mapping entry that refer to the object; any other means that the mapping cannot be changed at all.
_OBJECT_REFUSED = frozenset({0x0602_0000, 0x0604_0041, 0x0604_0043, 0x0609_0011, 0x0609_0030})


_RPDO_PARAMETERS = range(o.RPDO_COMMUNICATION, o.RPDO_COMMUNICATION + o.PDOS_OF_A_KIND)
_TPDO_PARAMETERS = range(o.TPDO_COMMUNICATION, o.TPDO_COMMUNICATION + o.PDOS_OF_A_KIND)
_ACYCLIC = 0  # transmission type: synchronous, at no fixed number of SYNCs
_ATTEMPTS = 16
_MAPPING = "its mapping"
# Keys of the cell file for communication parameters.
_KEYS = {
    "its COB-ID": "cob_id",
    "its transmission type": "transmission",
    "its SYNC start value": "sync_start",
}


class _Refusal(Exception):
    """The drive refused a step; contains what the next plan must not change."""

    def __init__(self, what: str, abort: SdoAbort, index: int | None = None) -> None:
        super().__init__(what)
        self.what = what
        self.abort = abort
        self.index = index


class _ValueNotStored(Exception):
    """The drive accepted a communication parameter, and reads back another value; contains the error if no plan avoids it."""

    def __init__(self, error: BootError) -> None:
        super().__init__(error.message)
        self.error = error


def configure(
    sdo: SdoClient,
    wanted: PdoRequirements | None = None,
    policy: Policy | None = None,
    axis: int = 1,
    on_plan: Callable[[PdoPlan], None] | None = None,
    also: Collection[tuple[bool, int]] = (),
) -> PdoPlan:
    """Plan the PDOs of one axis and configure the drive, which should be pre-operational; blocks for some dozen transfers.

    Returns the resulting plan with the values read back from the drive. ``on_plan`` is called with each plan before it is applied.
    ``also``: see ``read_pdos``.

    Raises:
        BootError: a step failed in a way that no other plan avoids; the old parameters are restored as far as the drive permits.
        SdoTimeout, SdoError, AdapterError: as ``SdoClient.upload``.
    """

    def made(device: DevicePdos, policy: Policy) -> PdoPlan:
        return make_plan(
            sdo.node_id, device, axis_objects(sdo.dictionary, device, axis), wanted, policy, axis
        )

    return negotiate(sdo, made, policy or Policy(), on_plan, also)


def negotiate(
    sdo: SdoClient,
    made: Callable[[DevicePdos, Policy], PdoPlan],
    policy: Policy,
    on_plan: Callable[[PdoPlan], None] | None = None,
    also: Collection[tuple[bool, int]] = (),
) -> PdoPlan:
    """Configure the device by the plan that ``made`` returns for its PDOs and a policy.

    The policy allows less after each refusal.
    """
    learnt: list[str] = []
    for _ in range(_ATTEMPTS):
        device = read_pdos(sdo, also)
        plan = made(device, policy)
        plan = replace(plan, notes=(*learnt, *plan.notes))
        if on_plan is not None:
            on_plan(plan)
        try:
            return _apply(sdo, plan)
        except _Refusal as refusal:
            policy = _reduced_policy(sdo, policy, refusal)
            learnt.append(f"{refusal.what} (abort code {refusal.abort.code:08X}h)")
        except _ValueNotStored as refusal:
            if not policy.communication:
                raise refusal.error from None
            policy = replace(policy, communication=False)
            learnt.append(f"{refusal.error.message} ({refusal.error.observed})")
    raise BootError(f"node {sdo.node_id}: no PDO plan that the drive accepts", node=sdo.node_id, step=_STEP)


def set_pdo(
    sdo: SdoClient,
    receive: bool,
    number: int,
    *,
    mapping: tuple[MappedObject, ...] | None = None,
    transmission_type: int | None = None,
    event_timer: int | None = None,
    inhibit_time: int | None = None,
    cob_id: int | None = None,
    sync_start: int | None = None,
    rtr: bool | None = None,
    on: bool = True,
) -> PdoConfiguration:
    """Set one PDO as requested, read it back and return it; None leaves a parameter as it is. Blocks.

    ``on``: whether it is switched on in the end. ``event_timer`` in ms, ``inhibit_time`` in 100 µs, ``sync_start`` a value of the
    SYNC counter (0: none). ``rtr``: whether the drive shall answer remote frames (bit 30 of 18xxh:01). The node should be
    pre-operational.

    Raises:
        BootError: the node has no such PDO, refuses a step, or the values read back are different.
        SdoTimeout, SdoError, AdapterError: as ``SdoClient.upload``.
    """
    name = f"{'RPDO' if receive else 'TPDO'}{number}"
    before = read_pdo(sdo, receive, number)
    if before is None:
        raise BootError(
            f"node {sdo.node_id}: the drive has no {name}",
            node=sdo.node_id,
            step=_STEP,
            index=Indices.of(receive, number).communication,
            remedy="remove this table from cell.toml, or use the drive's numbers",
        )
    target = replace(
        before,
        valid=on,
        mapping=before.mapping if mapping is None else mapping,
        transmission_type=before.transmission_type if transmission_type is None else transmission_type,
        event_timer=before.event_timer if event_timer is None else event_timer,
        inhibit_time=before.inhibit_time if inhibit_time is None else inhibit_time,
        cob_id=before.cob_id if cob_id is None else cob_id,
        sync_start=before.sync_start if sync_start is None else sync_start,
    )
    change = PdoChange.COMMUNICATION if target.mapping == before.mapping else PdoChange.MAPPING
    planned = PlannedPdo(receive, before, target, change, (), ())
    if target == before and (rtr is None or _answers_rtr(sdo, planned) is rtr):
        return before
    try:
        plan = _apply(sdo, PdoPlan(sdo.node_id, 1, (planned,), {}, {}), rtr)
    except _Refusal as refusal:
        raise _boot_error(sdo, refusal.what, refusal.abort) from refusal.abort
    except _ValueNotStored as refusal:
        raise refusal.error from None
    return plan.pdos[0].target


def _reduced_policy(sdo: SdoClient, policy: Policy, refusal: _Refusal) -> Policy:
    """Return the policy for the next attempt after a refusal."""
    about_object = refusal.abort.code in _OBJECT_REFUSED and refusal.index not in policy.refused
    if refusal.index is not None and about_object:
        return replace(policy, refused=policy.refused | {refusal.index})
    if refusal.abort.subindex == o.PDO_TRANSMISSION_TYPE and (
        less := _without_type(policy, refusal.abort.index)
    ):
        return less
    if policy.remap:
        return replace(policy, remap=False)
    if policy.communication:
        return replace(policy, communication=False)
    raise _boot_error(sdo, refusal.what, refusal.abort) from refusal.abort


def _without_type(policy: Policy, index: int) -> Policy | None:
    """Return the policy after a refused transmission type; None if ``index`` is no PDO, or its type was to stay already.

    A drive that refuses the type of one PDO refuses it for all of that direction.
    """
    if index in _RPDO_PARAMETERS and policy.receive != _ACYCLIC:
        return replace(policy, receive=_ACYCLIC)
    for receive, parameters in ((True, _RPDO_PARAMETERS), (False, _TPDO_PARAMETERS)):
        all_of_them = frozenset((receive, number) for number in range(1, len(parameters) + 1))
        if index in parameters and not all_of_them <= policy.fixed:
            return replace(policy, fixed=policy.fixed | all_of_them)
    return None


# -- applying ---------------------------------------------------------------------------------------------------------------------


def _apply(sdo: SdoClient, plan: PdoPlan, rtr: bool | None = None) -> PdoPlan:
    """Configure the drive by the plan; return the plan with the values read back.

    Raises ``_Refusal`` and ``_ValueNotStored`` after restoring.
    """
    changed = [pdo for pdo in plan.pdos if pdo.change is not PdoChange.KEEP]
    # An event timer may change while its PDO is on (CiA 301 7.5.2.37). It is changed alone if nothing else may be changed.
    switched = [pdo for pdo in changed if pdo.change is not PdoChange.TIMER]
    touched: list[PlannedPdo] = []
    try:
        for pdo in switched:
            touched.append(pdo)
            _switch_off(sdo, pdo)
        for pdo in changed:
            _write(sdo, pdo)
        for pdo in switched:
            _switch_on(sdo, pdo, rtr)
        checked = tuple(_checked(sdo, pdo) if pdo in changed else pdo for pdo in plan.pdos)
    except (_Refusal, _ValueNotStored):
        for pdo in reversed(touched):
            _restore(sdo, pdo)
        raise
    return replace(plan, pdos=checked)


def _switch_off(sdo: SdoClient, pdo: PlannedPdo) -> None:
    """Step 1 of CiA 301 7.5.2.36: set bit 31 of the COB-ID."""
    at = Indices.of(pdo.receive, pdo.before.number)
    _step(
        sdo,
        f"{pdo.name} cannot be switched off, so it cannot be changed",
        at.communication,
        o.PDO_COB_ID,
        _raw_cob_id(sdo, at, pdo.before.cob_id) | cob.INVALID,
        4,
    )


def _write(sdo: SdoClient, pdo: PlannedPdo) -> None:
    at = Indices.of(pdo.receive, pdo.before.number)
    if pdo.change is PdoChange.MAPPING:
        _write_mapping(sdo, pdo.name, at.mapping, pdo.target.mapping)
    if pdo.change is not PdoChange.DISABLE:
        _write_communication(sdo, pdo.name, at.communication, pdo.before, pdo.target)


def _write_mapping(sdo: SdoClient, name: str, index: int, mapping: tuple[MappedObject, ...]) -> None:
    """Steps 2 to 4: no entries, the entries, their count."""
    _step(sdo, f"the mapping of {name} is fixed", index, 0, 0, 1)
    for subindex, mapped in enumerate(mapping, start=1):
        what = f"{mapped.index:04X}h cannot be mapped into {name}"
        _step(sdo, what, index, subindex, mapped.entry, 4, refused=mapped.index)
    _step(
        sdo, f"{name} does not accept {counted(len(mapping), 'entry', 'entries')}", index, 0, len(mapping), 1
    )


def _write_communication(
    sdo: SdoClient, name: str, index: int, before: PdoConfiguration, target: PdoConfiguration
) -> None:
    if target.transmission_type != before.transmission_type:
        what = f"{name} does not accept transmission type {target.transmission_type}"
        _step(sdo, what, index, o.PDO_TRANSMISSION_TYPE, target.transmission_type, 1)
    timers = (
        (o.PDO_INHIBIT_TIME, before.inhibit_time, target.inhibit_time),
        (o.PDO_EVENT_TIMER, before.event_timer, target.event_timer),
    )
    if target.sync_start is not None and target.sync_start != before.sync_start:
        what = f"{name} does not accept the SYNC start value {target.sync_start}"
        _step(sdo, what, index, o.PDO_SYNC_START, target.sync_start, 1)
    for subindex, old, new in timers:
        if new is not None and new != old:
            with suppress(_Refusal):  # the drive's value is read back, and freshness depends on that
                _step(sdo, f"{name}: timer {subindex}", index, subindex, new, 2)


def _switch_on(sdo: SdoClient, pdo: PlannedPdo, rtr: bool | None = None) -> None:
    """Step 5: write the COB-ID without bit 31; ``rtr`` None keeps bit 30 as the drive has it."""
    if pdo.target.valid:
        at = Indices.of(pdo.receive, pdo.before.number)
        value = _raw_cob_id(sdo, at, pdo.target.cob_id)
        if rtr is not None:
            value = value & ~cob.NO_RTR | (0 if rtr else cob.NO_RTR)
        what = (
            f"{pdo.name} cannot be requested by remote frames" if rtr else f"{pdo.name} cannot be switched on"
        )
        _step(sdo, what, at.communication, o.PDO_COB_ID, value, 4)


def _answers_rtr(sdo: SdoClient, pdo: PlannedPdo) -> bool | None:
    """Return whether a TPDO may be requested by remote frames; None for an RPDO."""
    if pdo.receive:
        return None
    at = Indices.of(pdo.receive, pdo.before.number)
    return not (read_number(sdo, at.communication, o.PDO_COB_ID) or 0) & cob.NO_RTR


def _raw_cob_id(sdo: SdoClient, at: Indices, cob_id: int) -> int:
    """Return the UNSIGNED32 of a valid PDO, which keeps the drive's own "no RTR" bit."""
    flags = (read_number(sdo, at.communication, o.PDO_COB_ID) or 0) & cob.NO_RTR
    return cob_id | flags | (cob.EXTENDED if cob_id > cob.ID_MASK_11 else 0)


def _step(
    sdo: SdoClient, what: str, index: int, subindex: int, value: int, size: int, refused: int | None = None
) -> None:
    try:
        sdo.download(index, subindex, value.to_bytes(size, "little"))
    except SdoAbort as error:
        raise _Refusal(what, error, refused) from error


def _restore(sdo: SdoClient, pdo: PlannedPdo) -> None:
    """Restore a PDO's old parameters as far as the drive permits; ignore refusals, because the first one is reported."""
    at = Indices.of(pdo.receive, pdo.before.number)
    now = read_pdo(sdo, pdo.receive, pdo.before.number)
    if now is None or now == pdo.before:
        return
    back = replace(pdo, before=now, target=pdo.before)
    with suppress(_Refusal):
        _switch_off(sdo, back)
    with suppress(_Refusal):
        if now.mapping != pdo.before.mapping:
            _write_mapping(sdo, pdo.name, at.mapping, pdo.before.mapping)
    with suppress(_Refusal):
        _write_communication(sdo, pdo.name, at.communication, now, pdo.before)
    with suppress(_Refusal):
        _switch_on(sdo, back)


def _checked(sdo: SdoClient, pdo: PlannedPdo) -> PlannedPdo:
    """Read a PDO back; timers may be rounded, everything else must be as written.

    Raises:
        BootError: it has another mapping, or cannot be read.
        _ValueNotStored: another parameter is not as written.
    """
    now = read_pdo(sdo, pdo.receive, pdo.target.number)
    if now is None:
        raise _unlike(sdo, pdo, "its COB-ID", "a value", "nothing")
    checks: list[tuple[str, object, object]] = [("switched on", pdo.target.valid, now.valid)]
    if pdo.target.valid:
        checks += [
            ("its COB-ID", pdo.target.cob_id, now.cob_id),
            ("its transmission type", pdo.target.transmission_type, now.transmission_type),
            ("its SYNC start value", pdo.target.sync_start, now.sync_start),
            (_MAPPING, pdo.target.mapping, now.mapping),
        ]
    for what, expected, got in checks:
        if expected != got:
            unlike = _unlike(sdo, pdo, what, expected, got)
            raise unlike if what == _MAPPING else _ValueNotStored(unlike)
    return replace(pdo, target=now)


def _unlike(sdo: SdoClient, pdo: PlannedPdo, what: str, expected: object, got: object) -> BootError:
    at = Indices.of(pdo.receive, pdo.target.number)
    index = at.mapping if what == _MAPPING else at.communication
    return BootError(
        f"node {sdo.node_id}: {pdo.name} accepted {what} without an error but reads back another value",
        node=sdo.node_id,
        step=_STEP,
        index=index,
        observed=f"{index:04X}h: written {_words(expected)}, read back {_words(got)}",
        remedy=_keep_remedy(sdo.node_id, pdo.name.lower(), what, got),
    )


def _keep_remedy(node: int, name: str, what: str, got: object) -> str:
    if what == _MAPPING:
        return 'set remap = "never" for this node, so that the drive keeps its mapping'
    if what in _KEYS and got is not None:
        return f"write {_KEYS[what]} = {got} in [nodes.{node}.pdo.{name}], the value that the drive keeps"
    return f"leave [nodes.{node}.pdo.{name}] out of the cell file: the drive does not let this PDO be changed"


def _words(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "no entries"
    return f"{value:X}h" if isinstance(value, int) and not isinstance(value, bool) else str(value)


def _boot_error(sdo: SdoClient, what: str, abort: SdoAbort) -> BootError:
    return BootError(
        f"node {sdo.node_id}: {what}",
        node=sdo.node_id,
        step=_STEP,
        index=abort.index,
        subindex=abort.subindex,
        observed=f"{abort.message}; {abort.observed}",
        remedy=abort.remedy
        or "bring the node to pre-operational first; some drives lock their PDO parameters",
    )


# -- Configure the PDOs of a node's inputs and outputs by their plan ---------------------------------------------------


def configure_io(sdo: SdoClient, objects: IoObjects, policy: Policy, used: Used, also: Used = ()) -> PdoPlan:
    """Plan the PDOs and configure the node, which should be pre-operational, as ``configure``; blocks for some dozen transfers.

    Raises:
        BootError: an object is in no PDO, or as ``configure``.
        SdoTimeout, SdoError, AdapterError: as ``SdoClient.upload``.
    """
    plan = negotiate(
        sdo, lambda device, less: make_io_plan(sdo.node_id, device, objects, less, used), policy, also=also
    )
    if plan.impossible:
        raise BootError(
            f"node {sdo.node_id}: {'; '.join(plan.impossible)}",
            node=sdo.node_id,
            step="PDO configuration",
            observed="; ".join(plan.notes) or "it has no more PDOs that could contain it",
            remedy="map it in [nodes.N.pdo], or allow boot to change the mapping; inputs and outputs are never transmitted "
            "by SDO",
        )
    return plan
