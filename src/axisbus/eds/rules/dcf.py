"""Rules for a DCF: the node's settings and parameter values (DS 306 5)."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cia301.datatypes import DataType
from axisbus.cia301.objects import is_pdo_mapping
from axisbus.eds.concise import decode_leniently
from axisbus.eds.model import BAUD_RATES, ObjectType
from axisbus.eds.rules.context import Described, Hit, RuleContext, finds, number, short
from axisbus.wording import counted

_LENGTHS = {"NodeName": 246, "NetworkName": 243}
_U32 = ("NetNumber", "LSS_SerialNumber")
_MAX_U32 = 0xFFFF_FFFF
_FILES = ("UploadFile", "DownloadFile")
MAX_NAME = 241


@finds("K002")
def no_commissioning(context: RuleContext) -> Iterator[Hit]:
    """K002."""
    if context.named_dcf and context.commissioning is None:
        yield Hit(0, 0, "the file is called a DCF, but there is no section [DeviceComissioning]")


@finds("K004")
def baud_rate(context: RuleContext) -> Iterator[Hit]:
    """K004."""
    section = context.commissioning
    if section is not None and number(section, "baudrate") not in BAUD_RATES:
        given = section.entries.get("baudrate")
        what = "has no Baudrate" if not given else f"Baudrate={short(given)} is not a bit rate of CiA 301"
        yield context.at(section, "baudrate", f"[{section.name}] {what}")


@finds("K014")
def unsupported_baud_rate(context: RuleContext) -> Iterator[Hit]:
    """K014."""
    rate = number(context.commissioning, "baudrate")
    if rate in BAUD_RATES and number(context.device, f"baudrate_{rate}") == 0:
        yield context.at(
            context.commissioning, "baudrate", f"Baudrate={rate}, but BaudRate_{rate} is 0: not supported"
        )


@finds("K005")
def read_only_values(context: RuleContext) -> Iterator[Hit]:
    """K005."""
    for entry in context.described:
        variable = entry.variable
        if variable.writable or variable.parameter_value is None or variable.default is None:
            continue  # without a default it is unknown whether the device has another value
        if variable.parameter_value != variable.default:
            text = f"is {variable.access}, but has a ParameterValue other than its default"
            yield context.on(entry, "parametervalue", text)


@finds("K006")
def files_of_others(context: RuleContext) -> Iterator[Hit]:
    """K006."""
    for entry in context.described:
        variable = entry.variable
        if variable.object_type is ObjectType.DOMAIN or variable.data_type is DataType.DOMAIN:
            continue
        for name in _FILES:
            if name.lower() in entry.section.entries:
                yield context.on(
                    entry, name, f"{name} belongs to a DOMAIN, this is {variable.data_type.name}"
                )


@finds("K007")
def values_in_an_eds(context: RuleContext) -> Iterator[Hit]:
    """K007."""
    if context.is_dcf:
        return
    found = [entry for entry in context.described if "parametervalue" in entry.section.entries]
    if found:
        others = f", as have {counted(len(found) - 1, 'other')}" if len(found) > 1 else ""
        yield context.on(found[0], "parametervalue", f"has a ParameterValue{others}, but this is not a DCF")


@finds("K008")
def lengths(context: RuleContext) -> Iterator[Hit]:
    """K008."""
    yield from context.overlong(context.commissioning, _LENGTHS)


@finds("K009")
def network_numbers(context: RuleContext) -> Iterator[Hit]:
    """K009."""
    return context.beyond(context.commissioning, _U32, _MAX_U32, "is not an UNSIGNED32")


@finds("K015")
def manager_flag(context: RuleContext) -> Iterator[Hit]:
    """K015."""
    return context.flags(context.commissioning, ["CANopenManager"])


@finds("K013")
def long_denotations(context: RuleContext) -> Iterator[Hit]:
    """K013."""
    for entry in context.described:
        length = len(entry.text("denotation"))
        if length > MAX_NAME:
            yield context.on(
                entry,
                "denotation",
                f"has a Denotation of {counted(length, 'character')}, at most {MAX_NAME} are allowed",
            )


# -- Rules for concise DCFs in 1F22h: complete, and in an order that devices accept (CiA 302-3 4.3) --------------------


CONCISE_DCF, VERIFY = 0x1F22, 0x1020


@finds("K010")
def wrong_count(context: RuleContext) -> Iterator[Hit]:
    """K010."""
    for entry, key, data in _streams(context):
        decoded = decode_leniently(data)
        if decoded.remaining or decoded.declared != len(decoded.writes):
            remaining = (
                f" and {counted(decoded.remaining, 'octet')} beyond the last whole entry"
                if decoded.remaining
                else ""
            )
            yield context.on(
                entry,
                key,
                f"says {counted(decoded.declared, 'entry', 'entries')}, but holds {len(decoded.writes)}{remaining}",
            )


@finds("K011")
def order_of_mapping(context: RuleContext) -> Iterator[Hit]:
    """K011."""
    for entry, key, data in _streams(context):
        cleared: set[int] = set()
        for write in decode_leniently(data).writes:
            if not is_pdo_mapping(write.index):
                continue
            if write.subindex == 0:
                if any(write.data):
                    cleared.discard(write.index)
                else:
                    cleared.add(write.index)
            elif write.index not in cleared:
                text = (
                    f"writes {write.index:04X}:{write.subindex:02X} before {write.index:04X}:00 is set to 0"
                )
                yield context.on(entry, key, text)
                break


@finds("K012")
def verification_last(context: RuleContext) -> Iterator[Hit]:
    """K012."""
    for entry, key, data in _streams(context):
        indices = [write.index for write in decode_leniently(data).writes]
        if VERIFY in indices and any(index != VERIFY for index in indices[indices.index(VERIFY) :]):
            yield context.on(entry, key, "writes other objects after 1020 (Verify configuration)")


def _streams(context: RuleContext) -> Iterator[tuple[Described, str, bytes]]:
    """Yield each concise DCF in the file, with its entry and key."""
    for entry in context.described:
        variable = entry.variable
        if variable.index == CONCISE_DCF and variable.subindex:
            for key, value in (
                ("defaultvalue", variable.default),
                ("parametervalue", variable.parameter_value),
            ):
                if isinstance(value, bytes) and value:
                    yield entry, key, value
