"""A decoded frame as plain values, for programs: one JSON object per frame; empty keys are omitted."""

from __future__ import annotations

import math
from typing import Any

from axisbus.trace.decoded import Decoded, DecodedSdo, ObjectValue


def plain(one: Decoded) -> dict[str, Any]:
    """Return a frame: ``time`` and ``delta`` in seconds, ``data`` and bytes as hexadecimal digits, ``sdo.waited`` in s."""
    frame = one.frame
    everything = {
        "time": frame.time,
        "delta": round(one.delta, 9),
        "cob_id": frame.can_id,
        "extended": frame.extended or None,
        "remote": frame.remote or None,
        "data": frame.data.hex(),
        "kind": one.kind.value,
        "node": one.node,
        "name": one.name or None,
        "from_node": one.from_node,
        "what": one.what or None,
        "objects": [value(each) for each in one.values] or None,
        "sdo": None if one.sdo is None else _sdo(one.sdo),
        "error": one.error or None,
        "problem": one.problem or None,
    }
    return _without_none(everything)


def value(value: ObjectValue) -> dict[str, Any]:
    """Return an object's value; NaN and infinity, which JSON does not have, as text."""
    raw: Any = value.value.hex() if isinstance(value.value, bytes) else value.value
    if isinstance(raw, float) and not math.isfinite(raw):
        raw = str(raw)
    quantity = value.quantity if value.quantity is not None and math.isfinite(value.quantity) else None
    return _without_none(
        {
            "index": value.index,
            "subindex": value.subindex,
            "name": value.name or None,
            "value": raw,
            "words": value.words or None,
            "quantity": quantity,
            "unit": value.unit or None,
        }
    )


def _sdo(sdo: DecodedSdo) -> dict[str, Any]:
    waited = None if sdo.waited is None else round(sdo.waited, 9)
    return _without_none(
        {
            "step": sdo.step,
            "write": sdo.write,
            "done": sdo.done,
            "total": sdo.total,
            "abort": sdo.abort,
            "waited": waited,
        }
    )


def _without_none(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}
