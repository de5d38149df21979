"""Parse the values of an EDS: texts to numbers, strings and bytes, as DS 306 4.3 defines them and as real files write them."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from functools import lru_cache
from typing import Generic, NamedTuple, TypeVar

from axisbus.cia301.datatypes import DataType
from axisbus.eds.model import Number

_T = TypeVar("_T", covariant=True)

Default = Number | float | str | bytes | None
Limit = Number | float | None

MAX_DIGITS = 40  # 64 bits need 20; longer texts are not numbers, and int() is slow on them


class ValueProblem(NamedTuple):
    """A problem of a value: the rule's id, half a sentence, and the key if it is not the parsed one."""

    rule: str
    text: str
    key: str = ""


class Parsed(NamedTuple, Generic[_T]):
    """A parsed value (None if absent or not understood) with the problems of its text."""

    value: _T
    problems: tuple[ValueProblem, ...] = ()


Integer = Parsed[Number | None]
ABSENT: Parsed[None] = Parsed(None)

_PLAIN = re.compile(r"[+-]?(?:0|[1-9][0-9]*)|0[xX][0-9A-Fa-f]+", re.ASCII)
_NEGATIVE_HEX = re.compile(r"(?:-0[xX]-?|0[xX]-)([0-9A-Fa-f]+)")
_FRACTION = re.compile(r"[+-]?[0-9]+[.,][0-9]*", re.ASCII)
_REAL = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?", re.ASCII)
_COMMENT = re.compile(r";|(?<!\S)#")  # not inside a word: 16#1F4
_IEC = re.compile(r"(2|8|10|16)#([0-9A-Fa-f]+(?:_[0-9A-Fa-f]+)*)")
_TEXT_TYPES = frozenset((DataType.VISIBLE_STRING, DataType.UNICODE_STRING))
_BOOLEAN_WORDS = {"true": 1, "false": 0}
_NODE_ID_WORDS = ("$nodeid", "$mynodeid", "nodeid")
_REAL_FORMATS = {DataType.REAL32: ">f", DataType.REAL64: ">d"}


def parse(text: str, data_type: DataType) -> Parsed[Default]:
    """Parse a DefaultValue or ParameterValue of ``data_type``; an empty text is an absent value."""
    if data_type in _TEXT_TYPES:
        return _string(text)
    return _other(text, data_type)


@lru_cache(maxsize=4096)
def _other(text: str, data_type: DataType) -> Parsed[Default]:
    if not text:
        return ABSENT
    if data_type.integer:
        return typed_integer(text, data_type)
    read = _READERS.get(data_type)
    return (
        read(text, data_type) if read is not None else ABSENT
    )  # the meaning of values in a maker's own type is unknown


class ValueLimits(NamedTuple):
    """The parsed LowLimit and HighLimit."""

    low: Limit
    high: Limit
    problems: tuple[ValueProblem, ...] = ()


NO_LIMITS = ValueLimits(None, None)


@lru_cache(maxsize=1024)
def limits(low_text: str, high_text: str, data_type: DataType, only_zero: bool = False) -> ValueLimits:
    """Parse LowLimit and HighLimit together; limits that contradict each other or the type are ignored.

    Limits of strings, bytes and times have no meaning and are left out. With ``only_zero``, two limits of 0 are real limits.
    """
    if not data_type.integer and data_type not in _REAL_FORMATS:
        return NO_LIMITS
    low, high = parse(low_text, data_type), parse(high_text, data_type)
    problems = (
        *(problem._replace(key="lowlimit") for problem in low.problems),
        *(problem._replace(key="highlimit") for problem in high.problems),
    )
    bottom, top = _plain(low.value), _plain(high.value)
    if bottom == top == 0 and not only_zero:
        problem = ValueProblem("V018", "LowLimit and HighLimit are both 0, which is read as no limit")
        return ValueLimits(None, None, (*problems, problem))
    wrapped = top is not None and top < 0 and "-" not in high_text
    if wrapped and (bottom is None or bottom >= 0):  # such as 0xFF for INTEGER8
        problem = ValueProblem("V002", f"{high_text} is beyond {data_type.name}", "highlimit")
        return ValueLimits(None, None, (*_without(problems, "V010"), problem))
    if bottom is not None and top is not None and bottom > top:
        problem = ValueProblem("V004", f"LowLimit={low_text} is above HighLimit={high_text}")
        return ValueLimits(None, None, (*problems, problem))
    return ValueLimits(_limit(low.value), _limit(high.value), problems)


def _limit(value: Default) -> Limit:
    return None if isinstance(value, (str, bytes)) else value


def _plain(value: Default) -> float | None:
    """Return a limit as a number for comparisons, without the node-ID."""
    if isinstance(value, Number):
        return value.value
    return value if isinstance(value, (int, float)) else None


def _without(problems: tuple[ValueProblem, ...], rule: str) -> tuple[ValueProblem, ...]:
    return tuple(problem for problem in problems if problem.rule != rule)


def plain(text: str) -> int | None:
    """Return the number of a key such as ObjectType or NrOfEntries, None if it holds none."""
    number = integer(text).value
    return number.value if number is not None and not number.plus_node_id else None


@lru_cache(maxsize=4096)
def integer(text: str) -> Integer:
    """Parse an integer: decimal, hexadecimal, octal, or with ``$NODEID`` in any unambiguous spelling."""
    comment = _COMMENT.search(text)
    if comment:
        inner = integer(text[: comment.start()].rstrip())
        return Parsed(
            inner.value,
            (*inner.problems, ValueProblem("S011", f"a comment follows the value: {_short(text)}")),
        )
    if not text:
        return Parsed(None)
    if len(text) > MAX_DIGITS:
        return _not_understood(text)
    if "node" in text.lower() or "$" in text:
        return _formula(text)
    return _number(text)


def _number(text: str) -> Integer:
    """Parse a number without a formula, including wrong notations that can mean only one number."""
    if _PLAIN.fullmatch(text):
        return Parsed(Number(int(text, 0)))
    negative = _NEGATIVE_HEX.fullmatch(text)
    if negative:
        minus = Number(-int(negative[1], 16))
        if text[-len(negative[1]) - 1] == "-":
            return Parsed(minus, (ValueProblem("V021", f"{text} is read as -0x{negative[1]}"),))
        return Parsed(minus, (ValueProblem("V010", f"{text} is a negative hexadecimal number"),))
    if _FRACTION.fullmatch(text):
        whole, fraction = re.split("[.,]", text)
        exact = Number(int(whole)) if not fraction.strip("0") else None
        return Parsed(exact, (ValueProblem("V011", f"{text} has a decimal point, the type is an integer"),))
    if text.lower() in _BOOLEAN_WORDS:
        return Parsed(Number(_BOOLEAN_WORDS[text.lower()]), (ValueProblem("V015", f"{text} is a word"),))
    digits = text.lstrip("+-")
    if digits.isascii() and digits.isdigit() and len(text) - len(digits) <= 1:
        octal = not digits.strip("01234567")
        value = int(digits, 8 if octal else 10) * (-1 if text[0] == "-" else 1)
        harmless = octal and not digits.strip("0")
        how = "octal" if octal else "decimal, for octal has no 8 or 9"
        return Parsed(
            Number(value), () if harmless else (ValueProblem("V012", f"{text} is read as {how}: {value}"),)
        )
    return _not_understood(text)


def has_comment(text: str) -> bool:
    """Whether a comment follows a value."""
    return _COMMENT.search(text) is not None


def iec_number(text: str) -> str | None:
    """Return a number of IEC 61131-3 (``16#1F4``, ``2#1010``) in the notation of DS 306, or None."""
    found = _IEC.fullmatch(text)
    if found is None:
        return None
    base, digits = int(found[1]), found[2].replace("_", "")
    try:
        return str(int(digits, 10)) if base == 10 else f"0x{int(digits, base):X}"
    except ValueError:  # a digit that is not allowed in this base
        return None


def _not_understood(text: str) -> Integer:
    suggested = iec_number(text) if len(text) <= MAX_DIGITS else None
    if suggested is not None:
        return Parsed(
            None, (ValueProblem("V001", f"{text} is a number of IEC 61131-3, DS 306 has it as {suggested}"),)
        )
    return Parsed(None, (ValueProblem("V001", f"{_short(text)} is not an integer"),))


def _formula(text: str) -> Integer:
    """Parse a sum of numbers and one ``$NODEID`` in any order, case and spelling (DS 306 4.3 requires it first and in capitals)."""
    terms = [term.strip() for term in text.lstrip("=").split("+")]
    node_ids = [term for term in terms if term.lower().replace("_", "") in _NODE_ID_WORDS]
    numbers = [_number(term) for term in terms if term not in node_ids]
    constants = [number.value.value for number in numbers if number.value is not None]
    if len(node_ids) != 1 or len(constants) != len(numbers):
        return Parsed(None, (ValueProblem("V020", f"{_short(text)} is not a formula of $NODEID"),))
    value = Number(sum(constants), plus_node_id=True)
    problems = tuple(problem for number in numbers for problem in number.problems)
    return Parsed(value, problems + _spelling(text, terms[0], node_ids[0], value))


def _spelling(text: str, first: str, node_id: str, value: Number) -> tuple[ValueProblem, ...]:
    suggested = f"$NODEID+0x{value.value:X}"
    if text[0] == "=" or node_id.lower() != "$nodeid":
        return (ValueProblem("V020", f"{text} is taken for {suggested}"),)
    if first != "$NODEID":
        return (ValueProblem("V006", f"{text} is meant as {suggested}"),)
    return ()


def typed_integer(text: str, data_type: DataType) -> Integer:
    """Parse an integer and convert it to its type; for a signed type, two's complement means a negative number."""
    number, problems = integer(text)
    if number is None:
        return Parsed(number, problems)
    low, high = data_type.range
    value = number.value
    if low <= value <= high:
        return Parsed(number, problems)
    if data_type.signed and high < value <= 2 * high + 1 and not number.plus_node_id:
        wrapped = value - 2 * (high + 1)
        problem = ValueProblem("V010", f"{text} is {wrapped} as two's complement of {data_type.name}")
        return Parsed(Number(wrapped), (*problems, problem))
    if value < 0 <= low:
        return Parsed(
            None, (*problems, ValueProblem("V009", f"{text} is negative, the type is {data_type.name}"))
        )
    return Parsed(
        None, (*problems, ValueProblem("V005", f"{text} does not fit {data_type.name} ({low} to {high})"))
    )


def _string(text: str) -> Parsed[str | None]:
    if not text:
        return ABSENT
    if len(text) >= 2 and text[0] == text[-1] == '"':
        return Parsed(text[1:-1], (ValueProblem("V013", f"{_short(text)} is in quotation marks"),))
    return Parsed(text)


def _real(text: str, data_type: DataType) -> Parsed[float | None]:
    """Parse a decimal number, or the hexadecimal digits of its bit pattern (IEEE 754), which DS 306 does not define."""
    if len(text) <= MAX_DIGITS and _REAL.fullmatch(text):
        number = float(text)
        if math.isfinite(number):
            return Parsed(number)
    size = struct.calcsize(_REAL_FORMATS[data_type])
    digits = text[2:]
    if text[:2].lower() == "0x" and 0 < len(digits) <= 2 * size:
        octets = _hex(digits.rjust(2 * size, "0"))
        if octets is not None:
            value: float = struct.unpack(_REAL_FORMATS[data_type], octets)[0]
            if math.isfinite(value):
                return Parsed(
                    value, (ValueProblem("V014", f"{text} is read as the bit pattern of {value:g}"),)
                )
    return Parsed(None, (ValueProblem("V001", f"{_short(text)} is not a number of {data_type.name}"),))


def _octets(text: str, _: DataType) -> Parsed[bytes | None]:
    """Parse pairs of hexadecimal digits; spaces between them and a leading 0x are accepted."""
    prefixed = text[:2].lower() == "0x"
    octets = _hex(text[2:] if prefixed else text)
    if octets is None:
        return Parsed(
            None, (ValueProblem("V017", f"{_short(text)} is not a string of octets, and counts as absent"),)
        )
    return Parsed(
        octets, (ValueProblem("V017", f"{_short(text)} has 0x before its octets"),) if prefixed else ()
    )


def _time(text: str, _: DataType) -> Parsed[bytes | None]:
    """Parse the 48 bits of a time as one number, or as its six octets."""
    octets = _hex(text) if len(text) >= 12 else None
    number = plain(text) if octets is None else None
    if number is not None and 0 <= number < 1 << 48:
        return Parsed(number.to_bytes(6, "little"))
    if octets is not None and len(octets) == 6:
        return Parsed(octets)
    return Parsed(None, (ValueProblem("V001", f"{_short(text)} is not a time of 48 bits"),))


_READERS: dict[DataType, Callable[[str, DataType], Parsed[Default]]] = {
    DataType.REAL32: _real,
    DataType.REAL64: _real,
    DataType.OCTET_STRING: _octets,
    DataType.DOMAIN: _octets,
    DataType.TIME_OF_DAY: _time,
    DataType.TIME_DIFFERENCE: _time,
}


def _hex(text: str) -> bytes | None:
    try:
        return bytes.fromhex(text)
    except ValueError:
        return None


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."
