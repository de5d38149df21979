"""All entries of an EDS as plain values for other programs, and as CSV (a row for each) and JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from typing import Any

from axisbus.eds import layout
from axisbus.eds.layout import PdoLayout
from axisbus.eds.model import Eds, Number, Object, Variable
from axisbus.eds.report import overview, wording

Plain = int | float | str | None
Facts = dict[str, Any]  # plain values for JSON, by name

_COLUMNS = (
    *("index", "subindex", "name", "object_name", "object_type", "data_type", "access", "pdo", "default"),
    *("parameter_value", "low", "high", "object_flags", "denotation", "line"),
)


def all_values(eds: Eds, node_id: int | None) -> Facts:
    """Return the whole contents of the file; values are those for ``node_id`` (1 to 127; None leaves formulas)."""
    return {
        "file": eds.source,
        "node_id": node_id,
        "device": device(eds, node_id),
        "pdos": [pdo(each) for each in layout.layouts(eds, node_id)],
        "entries": list(entries(eds, node_id)),
    }


def csv_text(eds: Eds, node_id: int | None) -> str:
    """Return all entries as CSV (RFC 4180, lines end with LF), the columns those of ``entry``.

    Index and sub-index are hexadecimal (``0x1018``, ``0x01``), other numbers decimal; absent values are empty. Values are those for
    ``node_id`` (1 to 127); without one, values that depend on it are formulas such as ``$NODEID+0x180``.
    """
    out = io.StringIO()
    writer = csv.DictWriter(out, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    for each in entries(eds, node_id):
        writer.writerow({**each, "index": f"0x{each['index']:04X}", "subindex": f"0x{each['subindex']:02X}"})
    return out.getvalue()


def json_text(eds: Eds, node_id: int | None) -> str:
    """Return the result of ``all_values`` as JSON, with a line feed at the end."""
    return json.dumps(all_values(eds, node_id), indent=2, ensure_ascii=False) + "\n"


def entries(eds: Eds, node_id: int | None) -> Iterator[Facts]:
    """Yield all entries in the order of index and sub-index."""
    for owner in eds:
        for sub in owner.subs.values():
            yield entry(owner, sub, node_id)


def entry(owner: Object, sub: Variable, node_id: int | None) -> Facts:
    """Return one entry; values are numbers or texts, bytes are hexadecimal digits, None is absent.

    A value that depends on the node-ID is a text such as ``$NODEID+0x180`` until a node-ID resolves it. ``line`` counts from 1
    (0: implied by the file, not written in it). ``pdo`` is ``TPDO``, ``RPDO``, ``TPDO/RPDO`` or empty.
    """
    return {
        "index": sub.index,
        "subindex": sub.subindex,
        "name": sub.name,
        "object_name": owner.name,
        "object_type": owner.object_type.name,
        "data_type": wording.type_name(sub),
        "access": sub.access,
        "pdo": wording.pdo_direction(sub),
        "default": _plain(sub.default, node_id),
        "parameter_value": _plain(sub.parameter_value, node_id),
        "low": _plain(sub.low, node_id),
        "high": _plain(sub.high, node_id),
        "object_flags": sub.object_flags,
        "denotation": sub.denotation,
        "line": sub.line,
    }


def device(eds: Eds, node_id: int | None) -> Facts:
    """Return the kind of device that the file describes; a mode's ``claimed`` is None if 6502h has no value."""
    summary = overview.overview(eds, node_id)
    return {
        "vendor": summary.vendor,
        "product": summary.product,
        "order_code": summary.order_code,
        "vendor_id": summary.identity.vendor_id,
        "product_code": summary.identity.product_code,
        "revision": summary.identity.revision,
        "device_type": summary.device_type,
        "kind": summary.kind,
        "axes": summary.axes,
        "modes": [
            {"axis": each.axis, "mode": each.short, "claimed": each.claimed, "missing": list(each.missing)}
            for each in summary.claims
        ],
        "bit_rates": list(summary.bit_rates),
    }


def pdo(given: PdoLayout) -> Facts:
    """Return one PDO; ``cob_id`` is the CAN identifier without flags, None if it is unknown; ``first_bit`` counts from 0."""
    formula = given.formula
    text = "" if formula is None else str(_plain(formula, None))
    return {
        "name": given.name,
        "number": given.number,
        "receive": given.receive,
        "cob_id": given.identifier,
        "cob_id_text": text,
        "extended": given.extended,
        "valid": given.valid,
        "transmission_type": given.transmission_type,
        "inhibit_time": given.inhibit_time,
        "event_timer": given.event_timer,
        "mapping": [_slot(slot) for slot in given.slots],
        "notes": list(given.notes),
    }


def _slot(slot: layout.PdoSlot) -> Facts:
    return {
        "index": slot.mapped.index,
        "subindex": slot.mapped.subindex,
        "name": slot.name,
        "first_bit": slot.first_bit,
        "bits": slot.bits,
        "data_type": slot.data_type.name if slot.data_type else None,
        "signed": slot.signed,
    }


def _plain(given: Number | float | str | bytes | None, node_id: int | None) -> Plain:
    if isinstance(given, Number):
        if given.plus_node_id and node_id is None:
            return f"$NODEID+0x{given.value:X}" if given.value else "$NODEID"
        return given.resolve(node_id)
    return given.hex().upper() if isinstance(given, bytes) else given
