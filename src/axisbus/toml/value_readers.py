"""Readers of single values of a TOML file: each returns the converted value, or raises an error with the expected format.

Each also describes its values as a JSON Schema for editors. The schema never refuses a value that the reader accepts, but it cannot
express everything that the reader refuses (the order of two numbers, the bounds of a time).
"""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction
from typing import Any

from axisbus.units import AXIS_UNITS

LARGEST = 1e15  # of any number in engineering units; up to this limit a float can hold each whole number

JsonSchema = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class ValueReader:
    """Converts a TOML value, or raises ``InvalidValue``; ``json`` describes the accepted values as a JSON Schema."""

    read: Callable[[Any], Any]
    json: JsonSchema

    def __call__(self, value: Any) -> Any:
        """Return the converted value."""
        return self.read(value)


def _takes(**json: Any) -> Callable[[Callable[[Any], Any]], ValueReader]:
    """Make a function a reader; ``json`` is its JSON Schema."""
    return lambda read: ValueReader(read, json)


class InvalidValue(Exception):
    """A value that cannot be used; ``expected`` completes "expected ...", ``remedy`` says what to write instead."""

    def __init__(self, expected: str, remedy: str = "") -> None:
        super().__init__(expected)
        self.expected = expected
        self.remedy = remedy


def told(value: object) -> str:
    """Return a TOML value in words, for "it is ..."."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"the text {_short(value)!r}"
    if isinstance(value, (int, float)):
        return f"the number {_short(repr(value))}"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return "a table"
    return f"the date or time {value}"


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


# -- texts and words -------------------------------------------------------------------------------------------------


@_takes(type="string", pattern=r"\S")
def text(value: Any) -> str:
    """Read a text that is not empty."""
    if not isinstance(value, str):
        raise InvalidValue(
            "a text", f'put it in quotes: "{_short(str(value))}"' if isinstance(value, (int, float)) else ""
        )
    if not value.strip():
        raise InvalidValue("a text that is not empty")
    return value.strip()


@_takes(type="boolean")
def boolean(value: Any) -> bool:
    """Read true or false."""
    if not isinstance(value, bool):
        raise InvalidValue("true or false", "write it without quotes" if isinstance(value, str) else "")
    return value


def words(*known: str) -> ValueReader:
    """Return a reader of one of the words ``known``."""

    def read(value: Any) -> str:
        if isinstance(value, str) and value in known:
            return value
        near = get_close_matches(str(value).lower(), known, n=1)
        hint = f'did you mean "{near[0]}"? ' if near else ""
        raise InvalidValue(
            "one of " + ", ".join(f'"{word}"' for word in known), f"{hint}write one of these words"
        )

    return ValueReader(read, {"enum": list(known)})


def list_of(read: ValueReader, what: str, empty: bool = False) -> ValueReader:
    """Return a reader of a list; the result is a tuple of the values from ``read``; ``what`` is the plural of an element."""

    def read_list(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list):
            raise InvalidValue(f"a list of {what}", "write it in brackets: [...]")
        if not value and not empty:
            raise InvalidValue(f"a list of {what} that is not empty")
        return tuple(_element(read, number, element) for number, element in enumerate(value, 1))

    return ValueReader(read_list, {"type": "array", "items": read.json, **({} if empty else {"minItems": 1})})


def _element(read: ValueReader, number: int, value: Any) -> Any:
    try:
        return read(value)
    except InvalidValue as unfit:
        raise InvalidValue(
            f"{unfit.expected} as element {number}, which is {told(value)}", unfit.remedy
        ) from None


@_takes(anyOf=[{"type": "integer"}, {"type": "string", "pattern": r"\S"}])
def text_or_number(value: Any) -> str | int:
    """Read a channel's name or number."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    name: str = text(value)
    return name


# -- numbers ---------------------------------------------------------------------------------------------------------


def integer(low: int, high: int) -> ValueReader:
    """Return a reader of a whole number from ``low`` to ``high``."""

    def read(value: Any) -> int:
        if not isinstance(value, int) or isinstance(value, bool):
            raise InvalidValue(f"a whole number from {low} to {high}", _unquote(value))
        if not low <= value <= high:
            raise InvalidValue(f"a whole number from {low} to {high}")
        return value

    return ValueReader(read, {"type": "integer", "minimum": low, "maximum": high})


def _finite(value: Any, expected: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InvalidValue(expected, _unquote(value))
    try:
        number = float(value)
    except OverflowError:
        raise InvalidValue(expected) from None
    if not abs(number) <= LARGEST:
        raise InvalidValue(expected, f"it must be within ±{LARGEST:g}" if math.isfinite(number) else "")
    return number


def _unquote(value: Any) -> str:
    return "write the number without quotes and without a unit" if isinstance(value, str) else ""


@_takes(type="number", exclusiveMinimum=0, maximum=LARGEST)
def positive(value: Any) -> float:
    """Read a finite number above 0."""
    number = _finite(value, "a number above 0")
    if number <= 0:
        raise InvalidValue("a number above 0")
    return number


@_takes(type="number", minimum=-LARGEST, maximum=LARGEST)
def finite(value: Any) -> float:
    """Read a finite number."""
    return _finite(value, "a finite number")


@_takes(type=["number", "boolean"])
def safe(value: Any) -> float:
    """Read the safe state of an output: a number, or true and false for 1 and 0."""
    return float(value) if isinstance(value, bool) else _finite(value, "a number, true or false")


@_takes(
    type="array", items={"type": "number", "minimum": -LARGEST, "maximum": LARGEST}, minItems=2, maxItems=2
)
def interval(value: Any) -> tuple[float, float]:
    """Read [lowest, highest]; the first must be below the second."""
    expected = "a list of two numbers, [lowest, highest]"
    if not isinstance(value, list) or len(value) != 2:
        raise InvalidValue(expected)
    low, high = (_finite(each, expected) for each in value)
    if low >= high:
        raise InvalidValue(
            f"the lowest first and the highest second, but {low:g} is not below {high:g}",
            "exchange or correct them",
        )
    return low, high


@_takes(type=["number", "string"])
def setting(value: Any) -> int | float | str:
    """Read a value to write into an object: a number or a text."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        remedy = "write 1 or 0" if isinstance(value, bool) else 'put the whole key in quotes: "6099:01" = 100'
        raise InvalidValue("a number or a text", remedy if isinstance(value, (bool, dict)) else "")
    if isinstance(value, float) and not math.isfinite(value):
        raise InvalidValue("a finite number")
    return value


_RATIO = re.compile(r"\s*(\d{1,30}(?:\.\d{1,30})?)\s*(?:/\s*(\d{1,30}(?:\.\d{1,30})?)\s*)?", re.ASCII)
_SMALLEST_SCALE, _LARGEST_SCALE = Fraction(1, 10**12), Fraction(10**15)


def _whole(pattern: re.Pattern[str]) -> str:
    """Return a pattern for a whole text in the syntax of JSON Schema (ECMA 262), where ``\\d`` matches only 0 to 9."""
    return f"^(?:{pattern.pattern})$"


_SCALE = 'increments per unit as a number above 0, or as a ratio such as "131072/360"'


@_takes(
    anyOf=[
        {"type": "number", "exclusiveMinimum": 0, "maximum": LARGEST},
        {"type": "string", "pattern": _whole(_RATIO)},
    ]
)
def scale(value: Any) -> Fraction:
    """Read increments per unit: a number above 0, or a ratio of two as a text; the result is exact."""
    if isinstance(value, str):
        found = _RATIO.fullmatch(value)
        divisor = Fraction(found[2] or "1") if found else Fraction(0)
        exact = Fraction(found[1]) / divisor if found and divisor else Fraction(0)
    else:
        exact = Fraction(_finite(value, _SCALE))
    if exact < 0:
        raise InvalidValue(_SCALE, 'to invert the direction write invert = "master" (or "drive")')
    if not _SMALLEST_SCALE <= exact <= _LARGEST_SCALE:
        raise InvalidValue(_SCALE)
    return exact


# -- dates and times of day --------------------------------------------------------------------------------------------

_FIRST_DAY = dt.date(1984, 1, 1)  # of 1020h:01 and TIME (CiA 301 7.1.6.6, 7.5.2.21)
_LAST_DAY = _FIRST_DAY + dt.timedelta(days=0xFFFF)


@_takes(type="string", format="date")
def days(value: Any) -> int:
    """Read a date, as days since 1984-01-01."""
    if not isinstance(value, dt.date) or isinstance(value, dt.datetime):
        raise InvalidValue("a date such as 2026-03-31", "write it without quotes and without a time")
    if not _FIRST_DAY <= value <= _LAST_DAY:
        raise InvalidValue(f"a date from {_FIRST_DAY} to {_LAST_DAY}")
    return (value - _FIRST_DAY).days


@_takes(type="string", format="time")
def time_of_day(value: Any) -> int:
    """Read a time of day, as milliseconds after midnight."""
    if not isinstance(value, dt.time):
        raise InvalidValue(
            "a time of day such as 14:30:00", "write it without quotes, with hours, minutes and seconds"
        )
    seconds = (value.hour * 60 + value.minute) * 60 + value.second
    return seconds * 1000 + value.microsecond // 1000


@_takes(type="string", format="date-time")
def date_time(value: Any) -> tuple[int, int]:
    """Read a date with a time of day, as days since 1984-01-01 and milliseconds after midnight."""
    expected = "a date with a time such as 2026-03-31T14:30:00"
    if not isinstance(value, dt.datetime):
        raise InvalidValue(expected, "write it without quotes, with hours, minutes and seconds")
    if value.tzinfo is not None:
        raise InvalidValue(
            f"{expected}, without a time zone", "leave Z or the offset out: the node's date has none"
        )
    return days(value.date()), time_of_day(value.time())


# -- times -----------------------------------------------------------------------------------------------------------

_DURATION = re.compile(r"(\d{1,12}(?:\.\d{1,12})?)\s*([^\s\d]+)", re.ASCII)
_UNITS = {
    "us": Fraction(1, 1_000_000),
    "\u00b5s": Fraction(1, 1_000_000),  # micro sign
    "\u03bcs": Fraction(1, 1_000_000),  # Greek letter mu
    "ms": Fraction(1, 1000),
    "s": Fraction(1),
    "min": Fraction(60),
}
_TIME = rf"^\s*\d{{1,12}}(?:\.\d{{1,12}})?\s*(?:{'|'.join(_UNITS)})\s*$"


def duration(low: str, high: str) -> ValueReader:
    """Return a reader of a time with its unit, such as "2.5 ms", from ``low`` to ``high``; the result is in seconds."""
    lowest, highest = _seconds(low), _seconds(high)
    expected = f'a time with its unit, from "{low}" to "{high}"'

    def within(seconds: Fraction | None) -> bool:
        return None not in (seconds, lowest, highest) and lowest <= seconds <= highest  # type: ignore[operator]

    def read(value: Any) -> float:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            number = _short(repr(value))
            fit = [f'"{number}{unit}"' for unit in ("ms", "s") if within(_seconds(f"{number}{unit}"))]
            raise InvalidValue(
                expected, f"add the unit: {' or '.join(fit)}" if fit else "add the unit: us, ms, s or min"
            )
        seconds = _seconds(value) if isinstance(value, str) else None
        if seconds is None or lowest is None:
            raise InvalidValue(expected, "units are us, ms, s and min")
        if not within(seconds):
            raise InvalidValue(
                expected, f'"{low}" is the shortest' if seconds < lowest else f'"{high}" is the longest'
            )
        return float(seconds)

    return ValueReader(read, {"type": "string", "pattern": _TIME, "examples": [low, high]})


def _seconds(value: str) -> Fraction | None:
    found = _DURATION.fullmatch(value.strip())
    if found is None or found[2] not in _UNITS:
        return None
    return Fraction(found[1]) * _UNITS[found[2]]


def or_word(word: str, meaning: Any, read: ValueReader) -> ValueReader:
    """Return a reader that converts ``word`` to ``meaning``, and any other value by ``read``."""
    return _or(word, f'"{word}"', meaning, read)


def never_true(meaning: Any, read: ValueReader) -> ValueReader:
    """Return a reader that converts false to ``meaning``, and any other value by ``read``."""
    return _or(False, "false", meaning, read)


def _or(constant: str | bool, said: str, meaning: Any, read: ValueReader) -> ValueReader:
    def read_either(value: Any) -> Any:
        if type(value) is type(constant) and value == constant:  # 0 is not false
            return meaning
        try:
            return read(value)
        except InvalidValue as unfit:
            raise InvalidValue(f"{unfit.expected}, or {said}", unfit.remedy) from None

    return ValueReader(read_either, {"anyOf": [{"const": constant}, read.json]})


def names(known: Sequence[str], what: str) -> ValueReader:
    """Return a reader of a list of words of ``known``, without duplicates."""
    read = list_of(words(*known), what)

    def read_once(value: Any) -> tuple[str, ...]:
        found: tuple[str, ...] = read(value)
        if len(set(found)) < len(found):
            raise InvalidValue(f"each of the {what} once")
        return found

    return ValueReader(read_once, {**read.json, "uniqueItems": True})


# -- engineering units -------------------------------------------------------------------------------------------------


@_takes(enum=list(AXIS_UNITS))
def unit(value: Any) -> str:
    """Read an engineering unit of ``AXIS_UNITS``."""
    if isinstance(value, str) and value in AXIS_UNITS:
        return value
    known: str = text(value)
    near = get_close_matches(known.lower(), AXIS_UNITS, n=1)
    hint = f'did you mean "{near[0]}"? ' if near else ""
    raise InvalidValue(
        f"one of {', '.join(AXIS_UNITS)}", f'{hint}write one of these; "increments" needs no scale'
    )
