"""Rules for [FileInfo] (DS 306 4.4)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import date
from pathlib import PurePath, PureWindowsPath

from axisbus.eds.rules.context import Hit, RuleContext, finds, short, text_of

_TIME = re.compile(r"(?:0?[0-9]|1[0-2]):[0-5][0-9](?:AM|PM)")
_DATE = re.compile(r"([0-9]{2})-([0-9]{2})-([0-9]{4})")
_VERSION = re.compile(r"[34]\.[0-9]")
_ABSOLUTE = re.compile(r"[A-Za-z]:[\\/]|[\\/]")

_NEEDED = (
    *("FileName", "FileVersion", "FileRevision", "Description", "CreationTime", "CreationDate"),
    "CreatedBy",
)
_USUAL = ("EDSVersion", "ModificationTime", "ModificationDate", "ModifiedBy")
_LENGTHS = {"Description": 243, "CreatedBy": 245, "ModifiedBy": 244}
_TIMES = ("CreationTime", "ModificationTime")
_DATES = ("CreationDate", "ModificationDate")


@finds("F001")
def missing_entries(context: RuleContext) -> Iterator[Hit]:
    """F001."""
    if context.file_info is None:
        yield Hit(0, 0, "there is no section [FileInfo]")
    yield from context.absent(context.file_info, _NEEDED)


@finds("F011")
def usual_entries(context: RuleContext) -> Iterator[Hit]:
    """F011."""
    yield from context.absent(context.file_info, _USUAL)


@finds("F002")
def other_name(context: RuleContext) -> Iterator[Hit]:
    """F002."""
    given = _entry(context, "filename")
    actual = PurePath(context.eds.source).name
    named = PureWindowsPath(given).name  # accepts both kinds of slashes
    if named and actual and named.lower() != actual.lower():
        yield _at(context, "filename", f"FileName={short(given)}, but the file is {actual}")


@finds("F010")
def absolute_name(context: RuleContext) -> Iterator[Hit]:
    """F010."""
    given = _entry(context, "filename")
    if _ABSOLUTE.match(given):
        yield _at(context, "filename", f"FileName={short(given)} is a path of the computer it was written on")


@finds("F003")
def version_numbers(context: RuleContext) -> Iterator[Hit]:
    """F003."""
    return context.beyond(context.file_info, ("FileVersion", "FileRevision"), 0xFF, "is not an UNSIGNED8")


@finds("F004")
def dates(context: RuleContext) -> Iterator[Hit]:
    """F004."""
    for name in _DATES:
        given = _entry(context, name)
        if given and _date(given) is None:
            yield _at(context, name, f"{name}={short(given)} is not a date of the form mm-dd-yyyy")


@finds("F005")
def times(context: RuleContext) -> Iterator[Hit]:
    """F005."""
    for name in _TIMES:
        given = _entry(context, name)
        if given and not _TIME.fullmatch(given):
            yield _at(context, name, f"{name}={short(given)} is not a time of the form hh:mm(AM|PM)")


@finds("F006")
def lengths(context: RuleContext) -> Iterator[Hit]:
    """F006."""
    yield from context.overlong(context.file_info, _LENGTHS)


@finds("F007")
def order_of_dates(context: RuleContext) -> Iterator[Hit]:
    """F007."""
    created, modified = (_date(_entry(context, key)) for key in _DATES)
    if created is not None and modified is not None and modified < created:
        yield _at(
            context, "modificationdate", f"the modification of {modified} is before the creation of {created}"
        )


@finds("F008")
def origin(context: RuleContext) -> Iterator[Hit]:
    """F008."""
    section = context.file_info
    if context.is_dcf and section is not None and not section.entries.get("lasteds"):
        yield context.at(
            section, "lasteds", f"[{section.name}] does not name the EDS from which the DCF was made"
        )


@finds("F009")
def eds_version(context: RuleContext) -> Iterator[Hit]:
    """F009."""
    given = _entry(context, "edsversion")
    if given and not _VERSION.fullmatch(given):
        yield _at(context, "edsversion", f"EDSVersion={short(given)} is not a version of the format")


def _entry(context: RuleContext, key: str) -> str:
    return text_of(context.file_info, key)


def _at(context: RuleContext, key: str, message: str) -> Hit:
    return context.at(context.file_info, key, message)


def _date(text: str) -> date | None:
    found = _DATE.fullmatch(text)
    try:
        return date(int(found[3]), int(found[1]), int(found[2])) if found else None
    except ValueError:
        return None
