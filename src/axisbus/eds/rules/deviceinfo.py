"""Rules for [DeviceInfo], [DummyUsage] and [Comments] (DS 306 4.5, 4.6.2, 4.6.5)."""

from __future__ import annotations

import re
from collections.abc import Iterator

from axisbus.eds.io import values
from axisbus.eds.model import DUMMIES, Object
from axisbus.eds.rules.context import Hit, Looks, RuleContext, number, short, text_of
from axisbus.eds.rules.text import BAUD_RATES
from axisbus.wording import counted

_NUMBERS = {
    "vendornumber": "VendorNumber",
    "productnumber": "ProductNumber",
    "revisionnumber": "RevisionNumber",
}
_NEEDED = {
    "vendorname": "VendorName",
    "productname": "ProductName",
    "ordercode": "OrderCode",
    "simplebootupmaster": "SimpleBootUpMaster",
    "simplebootupslave": "SimpleBootUpSlave",
    "granularity": "Granularity",
    "groupmessaging": "GroupMessaging",
    "nrofrxpdo": "NrOfRXPDO",
    "nroftxpdo": "NrOfTXPDO",
    "lss_supported": "LSS_Supported",
    "dynamicchannelssupported": "DynamicChannelsSupported",
    **{f"baudrate_{rate}": f"BaudRate_{rate}" for rate in BAUD_RATES},
}
_LENGTHS = {
    "vendorname": ("VendorName", 244),
    "productname": ("ProductName", 243),
    "ordercode": ("OrderCode", 245),
}
_FLAGS = {
    "simplebootupmaster": "SimpleBootUpMaster",
    "simplebootupslave": "SimpleBootUpSlave",
    "groupmessaging": "GroupMessaging",
    "lss_supported": "LSS_Supported",
}
_MAX_U32 = 0xFFFF_FFFF
_MAX_GRANULARITY = 64  # 64: no bit-wise mapping; else the smallest number of bits that can be mapped
_COMPACT_PARTS = 0b11_1111  # sub-indices 1 to 6 of a communication parameter
_RATE = re.compile(r"baudrate_?(.*)")
_RATE_AS_PRINTED = re.compile(r"\s*BaudRate_[0-9]+\s*=")
_DUMMY = re.compile(r"dummy[0-9a-f]{4}")
_COMMENT_LINE = re.compile(r"line[1-9][0-9]*")
MAX_COMMENT = 249


def missing_entries(sheet: RuleContext) -> Iterator[Hit]:
    """D001."""
    if sheet.device is None:
        yield Hit(0, 0, "there is no section [DeviceInfo]")
    yield from sheet.absent(sheet.device, _NEEDED)


def missing_identity(sheet: RuleContext) -> Iterator[Hit]:
    """D002."""
    if sheet.device is None:
        return
    for key, name in _NUMBERS.items():
        if not sheet.device.entries.get(key):
            what = "is empty" if key in sheet.device.entries else "is missing"
            yield _at(sheet, key, f"{name} {what}")


def zero_identity(sheet: RuleContext) -> Iterator[Hit]:
    """D003."""
    for key in ("vendornumber", "productnumber"):
        if number(sheet.device, key) == 0:
            yield _at(sheet, key, f"{_NUMBERS[key]} is 0")


def other_identity(sheet: RuleContext) -> Iterator[Hit]:
    """D004."""
    for subindex, (key, name) in enumerate(_NUMBERS.items(), 1):
        here, there = number(sheet.device, key), sheet.number(0x1018, subindex)
        if here is not None and there is not None and here != there:
            text = f"{name} is 0x{here:X}, but [1018sub{subindex}] has 0x{there:X}"
            yield _at(sheet, key, text, 0x1018, subindex)


def identity_numbers(sheet: RuleContext) -> Iterator[Hit]:
    """D009."""
    for key, name in _NUMBERS.items():
        given = _entry(sheet, key)
        value = values.plain(given)
        if given and (value is None or not 0 <= value <= _MAX_U32):
            yield _at(sheet, key, f"{name}={short(given)} is not an UNSIGNED32")


def flags(sheet: RuleContext) -> Iterator[Hit]:
    """D005."""
    for key, name in _FLAGS.items():
        given = _entry(sheet, key)
        if given and values.plain(given) not in (0, 1):
            yield _at(sheet, key, f"{name}={short(given)} is neither 0 nor 1")


def granularity(sheet: RuleContext) -> Iterator[Hit]:
    """D014."""
    given = _entry(sheet, "granularity")
    value = values.plain(given)
    if given and (value is None or not 0 <= value <= _MAX_GRANULARITY):
        yield _at(sheet, "granularity", f"Granularity={short(given)} is not in 0 to {_MAX_GRANULARITY}")


def pdo_numbers(sheet: RuleContext) -> Iterator[Hit]:
    """D006."""
    for key, name, first in (("nrofrxpdo", "NrOfRXPDO", 0x1400), ("nroftxpdo", "NrOfTXPDO", 0x1800)):
        text = _entry(sheet, key)
        given = values.plain(text)
        if text and (given is None or given < 0):
            yield _at(sheet, key, f"{name}={short(text)} is not a number")
            continue
        described = sum(_communicates(entry, first) for entry in sheet.eds)
        if given is not None and given != described:
            yield _at(
                sheet, key, f"{name} is {given}, but the file describes {described} ({first:04X} and on)"
            )


def _communicates(entry: Object, first: int) -> bool:
    return first <= entry.index < first + 0x200


def lengths(sheet: RuleContext) -> Iterator[Hit]:
    """D007."""
    yield from sheet.overlong(sheet.device, _LENGTHS)


def no_baud_rate(sheet: RuleContext) -> Iterator[Hit]:
    """D008."""
    if sheet.device is None:
        return
    given = [number(sheet.device, f"baudrate_{rate}") for rate in BAUD_RATES]
    if not any(given):
        yield _at(
            sheet, f"baudrate_{BAUD_RATES[0]}", "no bit rate is supported, by BaudRate_10 to BaudRate_1000"
        )


def baud_rate_values(sheet: RuleContext) -> Iterator[Hit]:
    """D010."""
    for rate in BAUD_RATES:
        given = _entry(sheet, f"baudrate_{rate}")
        if given and values.plain(given) not in (0, 1):
            yield _at(sheet, f"baudrate_{rate}", f"BaudRate_{rate}={short(given)} is neither 0 nor 1")


def unknown_baud_rates(sheet: RuleContext) -> Iterator[Hit]:
    """D011."""
    known = {f"baudrate_{rate}" for rate in BAUD_RATES}
    for key in sheet.device.entries if sheet.device is not None else ():
        found = _RATE.match(key)
        if found and key not in known:
            yield _at(
                sheet, key, f"a bit rate of {short(found[1]) or 'no number'} is not a bit rate of CiA 301"
            )


def baud_rate_letters(sheet: RuleContext) -> Iterator[Hit]:
    """D012."""
    if sheet.device is None:
        return
    for rate in BAUD_RATES:
        key = f"baudrate_{rate}"
        if key in sheet.device.entries:
            line, _ = sheet.document.place(sheet.device, key)
            if not _RATE_AS_PRINTED.match(sheet.document.lines[line - 1]):
                written = sheet.document.lines[line - 1].partition("=")[0].strip()
                yield Hit(line, 1, f"{short(written)} is written BaudRate_{rate} in the standard")
                return


def dynamic_channels(sheet: RuleContext) -> Iterator[Hit]:
    """D013."""
    supported = number(sheet.device, "dynamicchannelssupported")
    if supported and sheet.section("dynamicchannels") is None:
        text = "DynamicChannelsSupported is set, but there is no section [DynamicChannels]"
        yield _at(sheet, "dynamicchannelssupported", text)


def compact_pdo(sheet: RuleContext) -> Iterator[Hit]:
    """D015."""
    parts = _entry(sheet, "compactpdo")
    value = values.plain(parts)
    if parts and (value is None or value & ~_COMPACT_PARTS):
        yield _at(sheet, "compactpdo", f"CompactPDO={short(parts)} is not a mask of the sub-indices 1 to 6")


def dummy_usage(sheet: RuleContext) -> Iterator[Hit]:
    """D016."""
    section = sheet.section("dummyusage")
    for key, text in section.entries.items() if section is not None else ():
        if not _DUMMY.fullmatch(key):
            yield sheet.at(
                section, key, f"[DummyUsage] has no key {short(key)!r}: Dummy and four digits are meant"
            )
        elif values.plain(text) not in (0, 1):
            yield sheet.at(section, key, f"{key.capitalize()}={short(text)} is neither 0 nor 1")


def dummies_left_out(sheet: RuleContext) -> Iterator[Hit]:
    """D019."""
    section = sheet.section("dummyusage")
    if section is not None and all(_DUMMY.fullmatch(key) for key in section.entries):
        yield from sheet.absent(section, {f"dummy{number:04x}": f"Dummy{number:04X}" for number in DUMMIES})


def comment_count(sheet: RuleContext) -> Iterator[Hit]:
    """D017."""
    section = sheet.section("comments")
    if section is None:
        return
    lines = sum(1 for key in section.entries if _COMMENT_LINE.fullmatch(key))
    given = section.entries.get("lines", "")
    if values.plain(given) != lines:
        yield sheet.at(section, "lines", f"[Comments] says Lines={short(given)}, but has {lines}")


def comment_length(sheet: RuleContext) -> Iterator[Hit]:
    """D018."""
    section = sheet.section("comments")
    for key, text in section.entries.items() if section is not None else ():
        if len(text) > MAX_COMMENT:
            yield sheet.at(
                section,
                key,
                f"the comment has {counted(len(text), 'character')}, at most {MAX_COMMENT} are allowed",
            )


def _entry(sheet: RuleContext, key: str) -> str:
    return text_of(sheet.device, key)


def _at(
    sheet: RuleContext, key: str, message: str, index: int | None = None, subindex: int | None = None
) -> Hit:
    return sheet.at(sheet.device, key, message, index, subindex)


LOOKS: Looks = {
    "D001": missing_entries,
    "D002": missing_identity,
    "D003": zero_identity,
    "D004": other_identity,
    "D005": flags,
    "D006": pdo_numbers,
    "D007": lengths,
    "D008": no_baud_rate,
    "D009": identity_numbers,
    "D010": baud_rate_values,
    "D011": unknown_baud_rates,
    "D012": baud_rate_letters,
    "D013": dynamic_channels,
    "D014": granularity,
    "D015": compact_pdo,
    "D016": dummy_usage,
    "D017": comment_count,
    "D018": comment_length,
    "D019": dummies_left_out,
}
