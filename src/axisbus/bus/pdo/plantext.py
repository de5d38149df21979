"""The PDO plan as text, as ``boot`` prints it."""

from __future__ import annotations

from axisbus.bus.pdo.plan import PdoChange, PdoPlan, PlannedPdo


def describe(plan: PdoPlan) -> str:
    """Return the plan as lines: each PDO with its values, the values by SDO with the reason, and unmet requirements."""
    lines = [f"node {plan.node_id}, axis {plan.axis}: {_summary(plan)}"]
    lines += [f"  {_pdo(pdo)}" for pdo in plan.pdos]
    lines += [f"  note: {note}" for note in plan.notes]
    lines += [f"  NOT POSSIBLE: {text}" for text in plan.impossible]
    return "\n".join(lines)


def _summary(plan: PdoPlan) -> str:
    changed = [pdo.name for pdo in plan.pdos if pdo.change is not PdoChange.KEEP]
    return f"PDOs to be changed: {', '.join(changed)}" if changed else "PDOs as the drive has them"


def _pdo(pdo: PlannedPdo) -> str:
    target = pdo.target
    if pdo.change is PdoChange.DISABLE:
        return f"{pdo.name} {target.cob_id:03X}h {pdo.change.value}"
    entries = ", ".join(
        f"{mapped}{' ' + name.replace('_', ' ') if name else ' (not used)'}"
        for mapped, name in zip(target.mapping, pdo.values, strict=True)
    )
    return f"{pdo.name} {target.cob_id:03X}h {_timing(pdo)}: {entries} ({pdo.change.value})"


def _timing(pdo: PlannedPdo) -> str:
    target = pdo.target
    if pdo.request:
        return f"requested every {pdo.request * 1000:g} ms (type {target.transmission_type})"
    if target.synchronous:
        start = f", from SYNC counter {target.sync_start} on" if target.sync_start else ""
        return f"with SYNC (type {target.transmission_type}{start})"
    timer = target.event_timer
    if pdo.receive:
        return f"on arrival (type {target.transmission_type})"
    return f"on change (type {target.transmission_type})" + (
        f" and every {timer} ms" if timer else ", silent otherwise"
    )
