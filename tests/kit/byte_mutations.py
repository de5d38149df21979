"""Mutated bytes: a valid input after a bad disk, a wrong program, or an attack."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence

_EXTREMES = (b"\0", b"\xff", b"\x7f", b"\x80")
_NUMBERS = (
    b"-1",
    b"0",
    b"4294967295",
    b"18446744073709551616",
    b"9" * 400,
    b"1e308",
    b"1e999",
    b"nan",
    b"0x",
    b"",
)
_NUMBERS_HEX = (b"0xFFFFFFFF", b"0x10000000000000000", b"FFFF", b"FE", b"FFFFFFFF")
_TEXTS = (
    b"\x1b]0;x\x07",
    b"\r\n",
    b"\0",
    b"[",
    b"]",
    b"{",
    b'"',
    b"=",
    b",",
    b"#",
    b";",
    b"\xff\xfe",
    b"[" * 3000,
    b"\x91" * 3000,  # the same in MessagePack
    b"\n" * 50,
)
_DIGITS = re.compile(rb"(?:0x)?[0-9A-Fa-f]+")
Mutation = Callable[[bytes, random.Random], bytes]


def mutated(data: bytes, drawn: random.Random) -> bytes:
    """Return ``data`` with one to four mutations."""
    for _ in range(drawn.choice((1, 1, 1, 2, 4))):
        data = drawn.choice(MUTATIONS)(data, drawn)
    return data


def _place(data: bytes, drawn: random.Random) -> int:
    return drawn.randrange(len(data) + 1)


def _octet(data: bytes, drawn: random.Random) -> bytes:
    at = _place(data, drawn)
    return data[:at] + bytes((drawn.randrange(256),)) + data[at + 1 :]


def _extreme(data: bytes, drawn: random.Random) -> bytes:
    """Set a field of 1 to 8 octets, as lengths and counts are, to its least or largest."""
    at, size = _place(data, drawn), drawn.choice((1, 2, 4, 8))
    return data[:at] + drawn.choice(_EXTREMES) * size + data[at + size :]


def _cut(data: bytes, drawn: random.Random) -> bytes:
    return data[: _place(data, drawn)]


def _left_out(data: bytes, drawn: random.Random) -> bytes:
    at = _place(data, drawn)
    return data[:at] + data[at + drawn.choice((1, 2, 8, 100)) :]


def _repeated(data: bytes, drawn: random.Random) -> bytes:
    at = _place(data, drawn)
    part = data[at : at + drawn.choice((1, 8, 100, 1000))]
    return data[:at] + part * drawn.choice((1, 1, 20)) + data[at:]


def _moved(data: bytes, drawn: random.Random) -> bytes:
    """Write a part of it over another."""
    at, from_, size = _place(data, drawn), _place(data, drawn), drawn.choice((2, 4, 30, 300))
    return data[:at] + data[from_ : from_ + size] + data[at + size :]


def _number(data: bytes, drawn: random.Random) -> bytes:
    """Replace a number that is written as text."""
    at = _place(data, drawn)
    found = _DIGITS.search(data, at)
    if found is None:
        return _octet(data, drawn)
    return data[: found.start()] + drawn.choice((*_NUMBERS, *_NUMBERS_HEX)) + data[found.end() :]


def _text(data: bytes, drawn: random.Random) -> bytes:
    at = _place(data, drawn)
    return data[:at] + drawn.choice(_TEXTS) + data[at:]


MUTATIONS: Sequence[Mutation] = (_octet, _extreme, _cut, _left_out, _repeated, _moved, _number, _text)
