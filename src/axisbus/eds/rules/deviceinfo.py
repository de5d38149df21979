"""Rules for [DeviceInfo], [DummyUsage] and [Comments] (DS 306 4.5, 4.6.2, 4.6.5)."""

from __future__ import annotations

import re
from collections.abc import Iterator

from axisbus.eds.io import values
from axisbus.eds.model import BAUD_RATES, DUMMIES
from axisbus.eds.rules.context import Hit, RuleContext, finds, number, short, text_of
from axisbus.wording import counted

_IDENTITY = ("VendorNumber", "ProductNumber", "RevisionNumber")
_RATES = tuple(f"BaudRate_{rate}" for rate in BAUD_RATES)
_NEEDED = (
    *("VendorName", "ProductName", "OrderCode", "SimpleBootUpMaster", "SimpleBootUpSlave", "Granularity"),
    *("GroupMessaging", "NrOfRXPDO", "NrOfTXPDO", "LSS_Supported", "DynamicChannelsSupported", *_RATES),
)
_LENGTHS = {"VendorName": 244, "ProductName": 243, "OrderCode": 245}
_FLAGS = ("SimpleBootUpMaster", "SimpleBootUpSlave", "GroupMessaging", "LSS_Supported")
_MAX_U32 = 0xFFFF_FFFF
_MAX_GRANULARITY = 64  # 64: no bit-wise mapping; else the smallest number of bits that can be mapped
_COMPACT_PARTS = 0b11_1111  # sub-indices 1 to 6 of a communication parameter
_RATE = re.compile(r"baudrate_?(.*)")
_RATE_AS_PRINTED = re.compile(r"\s*BaudRate_[0-9]+\s*=")
_DUMMY = re.compile(r"dummy[0-9a-f]{4}")
_COMMENT_LINE = re.compile(r"line[1-9][0-9]*")
MAX_COMMENT = 249


@finds("D001")
def missing_entries(context: RuleContext) -> Iterator[Hit]:
    """D001."""
    if context.device is None:
        yield Hit(0, 0, "there is no section [DeviceInfo]")
    yield from context.absent(context.device, _NEEDED)


@finds("D002")
def missing_identity(context: RuleContext) -> Iterator[Hit]:
    """D002."""
    if context.device is None:
        return
    for name in _IDENTITY:
        if not text_of(context.device, name):
            what = "is empty" if name.lower() in context.device.entries else "is missing"
            yield _at(context, name, f"{name} {what}")


@finds("D003")
def zero_identity(context: RuleContext) -> Iterator[Hit]:
    """D003."""
    for name in ("VendorNumber", "ProductNumber"):
        if number(context.device, name) == 0:
            yield _at(context, name, f"{name} is 0")


@finds("D004")
def other_identity(context: RuleContext) -> Iterator[Hit]:
    """D004."""
    for subindex, name in enumerate(_IDENTITY, 1):
        here, there = number(context.device, name), context.number(0x1018, subindex)
        if here is not None and there is not None and here != there:
            text = f"{name} is 0x{here:X}, but [1018sub{subindex}] has 0x{there:X}"
            yield _at(context, name, text, 0x1018, subindex)


@finds("D009")
def identity_numbers(context: RuleContext) -> Iterator[Hit]:
    """D009."""
    return context.beyond(context.device, _IDENTITY, _MAX_U32, "is not an UNSIGNED32")


@finds("D005")
def flags(context: RuleContext) -> Iterator[Hit]:
    """D005."""
    return context.flags(context.device, _FLAGS)


@finds("D014")
def granularity(context: RuleContext) -> Iterator[Hit]:
    """D014."""
    what = f"is not in 0 to {_MAX_GRANULARITY}"
    return context.beyond(context.device, ["Granularity"], _MAX_GRANULARITY, what)


@finds("D006")
def pdo_numbers(context: RuleContext) -> Iterator[Hit]:
    """D006."""
    for name, first in (("NrOfRXPDO", 0x1400), ("NrOfTXPDO", 0x1800)):
        text = text_of(context.device, name)
        given = values.plain(text)
        if text and (given is None or given < 0):
            yield _at(context, name, f"{name}={short(text)} is not a number")
            continue
        described = sum(first <= entry.index < first + 0x200 for entry in context.eds)
        if given is not None and given != described:
            yield _at(
                context, name, f"{name} is {given}, but the file describes {described} ({first:04X} and on)"
            )


@finds("D007")
def lengths(context: RuleContext) -> Iterator[Hit]:
    """D007."""
    yield from context.overlong(context.device, _LENGTHS)


@finds("D008")
def no_baud_rate(context: RuleContext) -> Iterator[Hit]:
    """D008."""
    if context.device is None:
        return
    if not any(number(context.device, name) for name in _RATES):
        yield _at(context, _RATES[0], "no bit rate is supported, by BaudRate_10 to BaudRate_1000")


@finds("D010")
def baud_rate_values(context: RuleContext) -> Iterator[Hit]:
    """D010."""
    return context.flags(context.device, _RATES)


@finds("D011")
def unknown_baud_rates(context: RuleContext) -> Iterator[Hit]:
    """D011."""
    known = {name.lower() for name in _RATES}

    for key in context.device.entries if context.device is not None else ():
        found = _RATE.match(key)
        if found and key not in known:
            yield _at(
                context, key, f"a bit rate of {short(found[1]) or 'no number'} is not a bit rate of CiA 301"
            )


@finds("D012")
def baud_rate_letters(context: RuleContext) -> Iterator[Hit]:
    """D012."""
    if context.device is None:
        return
    for name in _RATES:
        if name.lower() in context.device.entries:
            line, _ = context.document.location(context.device, name.lower())
            if not _RATE_AS_PRINTED.match(context.document.lines[line - 1]):
                written = context.document.lines[line - 1].partition("=")[0].strip()
                yield Hit(line, 1, f"{short(written)} is written {name} in the standard")
                return


@finds("D013")
def dynamic_channels(context: RuleContext) -> Iterator[Hit]:
    """D013."""
    supported = number(context.device, "dynamicchannelssupported")
    if supported and context.section("dynamicchannels") is None:
        text = "DynamicChannelsSupported is set, but there is no section [DynamicChannels]"
        yield _at(context, "dynamicchannelssupported", text)


@finds("D015")
def compact_pdo(context: RuleContext) -> Iterator[Hit]:
    """D015."""
    what = "is not a mask of the sub-indices 1 to 6"
    return context.beyond(context.device, ["CompactPDO"], _COMPACT_PARTS, what)


@finds("D016")
def dummy_usage(context: RuleContext) -> Iterator[Hit]:
    """D016."""
    section = context.section("dummyusage")
    for key, text in section.entries.items() if section is not None else ():
        if not _DUMMY.fullmatch(key):
            yield context.at(
                section, key, f"[DummyUsage] has no key {short(key)!r}: Dummy and four digits are meant"
            )
        elif values.plain(text) not in (0, 1):
            yield context.at(section, key, f"{key.capitalize()}={short(text)} is neither 0 nor 1")


@finds("D019")
def dummies_left_out(context: RuleContext) -> Iterator[Hit]:
    """D019."""
    section = context.section("dummyusage")
    if section is not None and all(_DUMMY.fullmatch(key) for key in section.entries):
        yield from context.absent(section, [f"Dummy{number:04X}" for number in DUMMIES])


@finds("D017")
def comment_count(context: RuleContext) -> Iterator[Hit]:
    """D017."""
    section = context.section("comments")
    if section is None:
        return
    lines = sum(1 for key in section.entries if _COMMENT_LINE.fullmatch(key))
    given = section.entries.get("lines", "")
    if values.plain(given) != lines:
        yield context.at(section, "lines", f"[Comments] says Lines={short(given)}, but has {lines}")


@finds("D018")
def comment_length(context: RuleContext) -> Iterator[Hit]:
    """D018."""
    section = context.section("comments")
    for key, text in section.entries.items() if section is not None else ():
        if len(text) > MAX_COMMENT:
            yield context.at(
                section,
                key,
                f"the comment has {counted(len(text), 'character')}, at most {MAX_COMMENT} are allowed",
            )


def _at(
    context: RuleContext, key: str, message: str, index: int | None = None, subindex: int | None = None
) -> Hit:
    return context.at(context.device, key, message, index, subindex)
