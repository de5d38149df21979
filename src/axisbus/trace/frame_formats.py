"""Format a decoded frame as one line for people."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from axisbus.cia301.datatypes import Value
from axisbus.trace.decoded import Decoded, DecodedSdo, FrameKind, ObjectValue
from axisbus.trace.value_text import in_hex
from axisbus.wording import counted

_LONGEST = 48  # bytes of a long value that a line shows
_IN_PDO = frozenset({FrameKind.TPDO, FrameKind.RPDO})


def line(one: Decoded, start: float = 0.0) -> str:
    """Return a frame's line: seconds since ``start``, seconds since the frame before, identifier, who, kind and what."""
    identifier = f"{one.frame.can_id:08X}h" if one.frame.extended else f"{one.frame.can_id:03X}h"
    times = f"{one.frame.time - start:12.6f} {one.delta:+10.6f}"
    return f"{times} {identifier:>9}  {who(one):<10} {one.kind.value:<9} {what(one)}".rstrip()


def who(one: Decoded) -> str:
    """Return node and axis, after an arrow if the frame goes to the node: ``5 x``, ``> 5 x``."""
    if one.node is None:
        return "bus"
    name = f"{one.node} {one.name}".rstrip()
    return name if one.from_node else f"> {name}"


def what(one: Decoded) -> str:
    """Return the contents of the frame, with its trouble at the end."""
    said = _sdo(one, one.sdo) if one.sdo is not None else _plain(one)
    return f"{said}  !! {one.problem}" if one.problem else said


def address(value: ObjectValue) -> str:
    """Return an object as people write it: ``6041h Statusword``, ``1018h:01 Vendor-ID``."""
    number_text = f"{value.index:04X}h" + (f":{value.subindex:02X}" if value.subindex else "")
    return f"{number_text} {value.name}".rstrip()


def shown(value: ObjectValue) -> str:
    """Return an object's value with its unit and its meaning: ``32768 = 90 deg``, ``0x0237 (operation enabled; ...)``."""
    text = number(value.value, value.index, value.subindex)
    if value.quantity is not None:
        text += f" = {value.quantity:.6g} {value.unit}"
    return f"{text} ({value.words})" if value.words else text


def number(value: Value | None, index: int, subindex: int) -> str:
    """Return a value as text: in hexadecimal if it is an identifier or bits."""
    if isinstance(value, bool) or value is None:
        return str(value)
    if isinstance(value, int):
        return f"0x{value:04X}" if value >= 0 and in_hex(index, subindex) else str(value)
    if isinstance(value, bytes):
        more = f" ... {counted(len(value), 'byte')}" if len(value) > _LONGEST else ""
        return (value[:_LONGEST].hex(" ").upper() or "no bytes") + more
    return repr(value[:200]) if isinstance(value, str) else f"{value:g}"


def _plain(one: Decoded) -> str:
    if not one.values:
        return one.what
    return f"{one.what}: " + ", ".join(f"{_short(value)} {shown(value)}" for value in one.values)


def _short(value: ObjectValue) -> str:
    return value.name or address(value)


def _sdo(one: Decoded, sdo: DecodedSdo) -> str:
    parts = [sdo.step, *(address(value) for value in one.values)]
    text = " ".join(parts)
    value = one.values[0] if one.values else None
    if sdo.abort is not None:
        text += f": {one.what}"
    elif value is not None and value.value is not None:
        text += f" = {shown(value)}"
    return text + "".join(_extras(one, sdo))


def _extras(one: Decoded, sdo: DecodedSdo) -> Iterator[str]:
    if sdo.done is not None:
        yield (
            f", {sdo.done} of {counted(sdo.total, 'byte')}"
            if sdo.total is not None
            else f", {counted(sdo.done, 'byte')}"
        )
    if sdo.waited is not None:
        yield f"  [{sdo.waited * 1000:.3g} ms]"
    if sdo.abort is None and one.what:
        yield f"  ({one.what})"


# -- A decoded frame as plain values, for programs: one JSON object per frame; empty keys are omitted ------------------


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
        "sdo": None if one.sdo is None else _json_form_sdo(one.sdo),
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


def _json_form_sdo(sdo: DecodedSdo) -> dict[str, Any]:
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
