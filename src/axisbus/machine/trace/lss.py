"""LSS frames (CiA 305) in words: one table of command specifiers to what each says."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.cia301.lss import BIT_TIMINGS

_NUMBERS = {0x40: "vendor-ID", 0x41: "product code", 0x42: "revision number", 0x43: "serial number"}
_RANGES = {
    0x46: "vendor-ID",
    0x47: "product code",
    0x48: "lowest revision number",
    0x49: "highest revision number",
    0x4A: "lowest serial number",
    0x4B: "highest serial number",
}
_INQUIRED = {0x5A: "vendor-ID", 0x5B: "product code", 0x5C: "revision number", 0x5D: "serial number"}
_FAST_SCAN = ("vendor-ID", "product code", "revision number", "serial number")
_KBIT = {entry: rate // 1000 for rate, entry in BIT_TIMINGS.items()}
_ERRORS = {0: "done", 1: "refused: out of range", 0xFF: "refused, with the maker's error"}
_STORE_ERRORS = {
    0: "done",
    1: "refused: storing is not supported",
    2: "refused: storage failed",
    0xFF: "refused, with the maker's error",
}

Words = Callable[[bytes], str]


def words(data: bytes, *, request: bool) -> tuple[str, str]:
    """Return what an LSS frame says, and what is wrong with it (mostly nothing); ``request``: it is the master's."""
    if not data:
        return "empty", "an LSS frame has 8 bytes (CiA 305)"
    full = data.ljust(8, b"\0")
    problem = "" if len(data) == 8 else f"{len(data)} bytes, an LSS frame has 8 (CiA 305)"
    reader = (_REQUESTS if request else _ANSWERS).get(full[0])
    if reader is None:
        return f"command 0x{full[0]:02X}", problem or f"0x{full[0]:02X} is no LSS command (CiA 305)"
    return reader(full), problem


def _number(data: bytes) -> int:
    return int.from_bytes(data[1:5], "little")


def _bit_timing(data: bytes) -> str:
    if data[1]:
        return f"set bit rate: entry {data[2]} of the maker's table {data[1]}"
    rate = (
        "found out by itself"
        if data[2] == 9
        else f"{_KBIT[data[2]]} kbit/s"
        if data[2] in _KBIT
        else f"entry {data[2]}"
    )
    return f"set bit rate: {rate}"


def _fast_scan(data: bytes) -> str:
    if data[5] == 0x80:
        return "fast scan: is anybody unconfigured?"
    part = _FAST_SCAN[data[6]] if data[6] < len(_FAST_SCAN) else f"part {data[6]}"
    return f"fast scan: {part} 0x{_number(data):08X} from bit {data[5]} on" + (
        "" if data[7] == data[6] else ", then the next part"
    )


def _named(names: dict[int, str], text: str) -> dict[int, Words]:
    def reader(name: str) -> Words:
        return lambda data: f"{text} {name} 0x{_number(data):08X}"

    return {command: reader(name) for command, name in names.items()}


def _said(text: str) -> Words:
    return lambda _: text


def _result(text: str, errors: dict[int, str]) -> Words:
    return lambda data: (
        f"{text}: {errors.get(data[1], f'refused, error {data[1]}')}"
        + (f" {data[2]}" if data[1] == 0xFF else "")
    )


_REQUESTS: dict[int, Words] = {
    0x04: lambda data: f"all to {'configuration' if data[1] else 'waiting'} state",
    **_named(_NUMBERS, "select by"),
    0x11: lambda data: f"set node ID {data[1]}" if data[1] != 0xFF else "take the node ID away",
    0x13: _bit_timing,
    0x15: lambda data: f"activate the bit rate after {data[1] | data[2] << 8} ms",
    0x17: _said("store the configuration"),
    **_named(_RANGES, "identify by"),
    0x4C: _said("who has no node ID?"),
    0x51: _fast_scan,
    **{command: _said(f"what is your {name}?") for command, name in _INQUIRED.items()},
    0x5E: _said("what is your node ID?"),
}
_ANSWERS: dict[int, Words] = {
    0x11: _result("set node ID", _ERRORS),
    0x13: _result("set bit rate", _ERRORS),
    0x17: _result("store the configuration", _STORE_ERRORS),
    0x44: _said("selected"),
    0x4F: _said("identified: it is there"),
    0x50: _said("has no node ID"),
    **_named(_INQUIRED, "its"),
    0x5E: lambda data: f"its node ID is {data[1]}" if data[1] != 0xFF else "it has no node ID",
}
