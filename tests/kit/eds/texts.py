"""Small EDS texts of our own, and the same facts as canopen's own reader gives them, to hold against the model."""

from __future__ import annotations

import io

import canopen
from canopen.objectdictionary import ODVariable

from axisbus.eds import Eds, EdsFinding, Number, loads

HEAD = "[DeviceInfo]\nVendorNumber=1\n\n[1000]\nParameterName=Device type\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\n\n"
HEAD_LINES = HEAD.count("\n")


def variable(section: str, **keys: str) -> str:
    """Return one section; keys not given are those of a plain UNSIGNED32."""
    entries = {
        "ParameterName": "Thing",
        "ObjectType": "0x7",
        "DataType": "0x0007",
        "AccessType": "rw",
        **keys,
    }
    return f"[{section}]\n" + "".join(f"{key}={value}\n" for key, value in entries.items()) + "\n"


def record(index: str, *subs: str, kind: str = "0x9") -> str:
    """Return a RECORD (or ARRAY) with its sub-index sections."""
    return f"[{index}]\nParameterName=Record\nObjectType={kind}\nSubNumber={len(subs)}\n\n" + "".join(subs)


def read(body: str) -> Eds:
    """Read a text that follows the usual head."""
    return loads((HEAD + body).encode(), "test.eds")


def only(eds: Eds) -> EdsFinding:
    """Return the one finding that there must be."""
    assert len(eds.findings) == 1, eds.findings
    return eds.findings[0]


def rules(eds: Eds) -> list[str]:
    """Return the ids of the findings."""
    return [finding.rule for finding in eds.findings]


Facts = tuple[object, ...]


def our_facts(eds: Eds, node_id: int) -> dict[tuple[int, int], Facts]:
    """Return name, type, access, mappable, default, parameter value and limits of every entry."""

    def plain(value: object) -> object:
        return value.resolve(node_id) if isinstance(value, Number) else value or None if value != 0 else value

    return {
        (entry.index, subindex): (
            sub.name,
            int(sub.data_type),
            sub.access,
            sub.pdo_mapping,
            plain(sub.default),
            plain(sub.parameter_value),
            plain(sub.low),
            plain(sub.high),
        )
        for entry in eds
        for subindex, sub in entry.subs.items()
    }


def import_text(text: str, node_id: int) -> canopen.ObjectDictionary:
    """Let canopen read a text as an EDS."""
    stream = io.StringIO(text)
    stream.name = "test.eds"
    return canopen.import_od(stream, node_id)


def canopen_facts(text: str, node_id: int) -> dict[tuple[int, int], Facts]:
    """Return the same facts as canopen reads them; its dummy entries (0001h to 0007h) are left out."""
    facts: dict[tuple[int, int], Facts] = {}
    dictionary = import_text(text, node_id)
    for index in dictionary:
        if index < 8:
            continue
        entry = dictionary[index]
        subs = {0: entry} if isinstance(entry, ODVariable) else entry.subindices
        for subindex, sub in subs.items():
            default = None if sub.default in ("", b"") else sub.default
            value = None if sub.value in ("", b"") else sub.value
            facts[index, subindex] = (
                sub.name,
                sub.data_type,
                sub.access_type,
                sub.pdo_mappable,
                default,
                value,
                sub.min,
                sub.max,
            )
    return facts
