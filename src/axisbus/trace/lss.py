"""Text of LSS frames (CiA 305): each service of ``cia305.services``, as the master's request and as the slave's answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from axisbus.cia305 import services
from axisbus.cia305.services import PARTS, LssService, LssState
from axisbus.wording import counted

_NUMBERS = dict(zip(services.SELECTIVE, PARTS, strict=True))
_INQUIRED = dict(zip(services.INQUIRIES, PARTS, strict=True))
_RANGES = dict(
    zip(
        services.IDENTIFY,
        (*PARTS[:2], *(f"{end} {part}" for part in PARTS[2:] for end in ("lowest", "highest"))),
        strict=True,
    )
)
_KBIT = {entry: f"{rate // 1000} kbit/s" for rate, entry in services.BIT_TIMINGS.items()}

Words = Callable[[bytes], str]


def words(data: bytes, *, request: bool) -> tuple[str, str]:
    """Return the text of an LSS frame, and its problem (usually empty); ``request``: the master sent it."""
    if not data:
        return "empty", "an LSS frame has 8 bytes (CiA 305)"
    full = data.ljust(8, b"\0")
    problem = "" if len(data) == 8 else f"{counted(len(data), 'byte')}, an LSS frame has 8 (CiA 305)"
    reader = (_REQUESTS if request else _ANSWERS).get(full[0])
    if reader is None:
        return f"command 0x{full[0]:02X}", problem or f"0x{full[0]:02X} is not an LSS command (CiA 305)"
    return reader(full), problem


def _number(data: bytes) -> int:
    return int.from_bytes(data[1:5], "little")


def _bit_timing(data: bytes) -> str:
    table, entry = data[1], data[2]
    if table != services.STANDARD_TABLE:
        return f"set bit rate: entry {entry} of the manufacturer's table {table}"
    rate = (
        "determined by the receiver"
        if entry == services.AUTOMATIC_RATE
        else _KBIT.get(entry, f"entry {entry}")
    )
    return f"set bit rate: {rate}"


def _fast_scan(data: bytes) -> str:
    if data[5] == services.ALL_BITS:
        return "fast scan: is a slave unconfigured?"
    part = PARTS[data[6]] if data[6] < len(PARTS) else f"part {data[6]}"
    return f"fast scan: {part} 0x{_number(data):08X} from bit {data[5]} on" + (
        "" if data[7] == data[6] else ", then the next part"
    )


def _named(names: Mapping[LssService, str], text: str) -> dict[int, Words]:
    def reader(name: str) -> Words:
        return lambda data: f"{text} {name} 0x{_number(data):08X}"

    return {command: reader(name) for command, name in names.items()}


def _said(text: str) -> Words:
    return lambda _: text


def _result(text: str, service: LssService) -> Words:
    return lambda data: (
        f"{text}: "
        + ("done" if not data[1] else f"refused: {services.refusal(service, data[1], data[2])[0]}")
    )


def _node_id(data: bytes) -> str:
    return "" if data[1] == services.UNCONFIGURED else f" {data[1]}"


_REQUESTS: dict[int, Words] = {
    LssService.SWITCH_STATE_GLOBAL: lambda data: (
        f"all to {LssState.CONFIGURATION.name.lower() if data[1] else LssState.WAITING.name.lower()} state"
    ),
    **_named(_NUMBERS, "select by"),
    LssService.CONFIGURE_NODE_ID: lambda data: (
        f"set node ID{_node_id(data)}" if _node_id(data) else "take the node ID away"
    ),
    LssService.CONFIGURE_BIT_TIMING: _bit_timing,
    LssService.ACTIVATE_BIT_TIMING: lambda data: f"activate the bit rate after {data[1] | data[2] << 8} ms",
    LssService.STORE_CONFIGURATION: _said("store the configuration"),
    **_named(_RANGES, "identify by"),
    LssService.IDENTIFY_NON_CONFIGURED_REMOTE_SLAVE: _said("which slave has no node ID?"),
    LssService.FASTSCAN: _fast_scan,
    **{command: _said(f"what is your {name}?") for command, name in _INQUIRED.items()},
    LssService.INQUIRE_NODE_ID: _said("what is your node ID?"),
}
_ANSWERS: dict[int, Words] = {
    LssService.CONFIGURE_NODE_ID: _result("set node ID", LssService.CONFIGURE_NODE_ID),
    LssService.CONFIGURE_BIT_TIMING: _result("set bit rate", LssService.CONFIGURE_BIT_TIMING),
    LssService.STORE_CONFIGURATION: _result("store the configuration", LssService.STORE_CONFIGURATION),
    LssService.SWITCH_STATE_SELECTIVE: _said("selected"),
    LssService.IDENTIFY_SLAVE: _said("identified: it is there"),
    LssService.IDENTIFY_NON_CONFIGURED_SLAVE: _said("has no node ID"),
    **_named(_INQUIRED, "its"),
    LssService.INQUIRE_NODE_ID: lambda data: (
        f"its node ID is{_node_id(data)}" if _node_id(data) else "it has no node ID"
    ),
}
