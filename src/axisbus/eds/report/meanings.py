"""What CiA 301 and CiA 402 say of the single bits and values of well-known objects, as rows for a person."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from axisbus.cia301 import emcy
from axisbus.cia301 import objects as cia301
from axisbus.cia402 import homing, modes, options, statusword
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import first_axis
from axisbus.cia402.controlword import Command
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import STATUSWORD_PATTERNS
from axisbus.eds.layout import is_pdo_parameter


class Meaning(NamedTuple):
    """One table: its title, the heading of its first column, and rows of (value or bit, what it means)."""

    title: str
    key: str
    rows: tuple[tuple[str, str], ...]


def meanings(index: int, subindex: int) -> tuple[Meaning, ...]:
    """Return the tables that the standards have for an entry of any axis; empty where they have none."""
    if is_pdo_parameter(index):
        return _PDO.get(subindex, ()) if index & 0x200 == 0 else ()
    return _TABLES.get((first_axis(index), subindex), ())


def _bits(title: str, names: Mapping[int, str]) -> Meaning:
    return Meaning(title, "bit", tuple((str(bit), names[bit]) for bit in sorted(names)))


def _values(title: str, names: Mapping[int, str]) -> Meaning:
    return Meaning(title, "value", tuple((str(value), text) for value, text in names.items()))


# CiA 402-2 8.4.1 and 8.4.2.
_CONTROL_BITS = {
    0: "switch on",
    1: "enable voltage",
    2: "quick stop (0 = stop)",
    3: "enable operation",
    4: "specific to the mode: pp new set-point, hm homing start, ip enable interpolation",
    5: "specific to the mode: pp change set immediately",
    6: "specific to the mode: pp relative",
    7: "fault reset (rising edge)",
    8: "halt",
    9: "specific to the mode: pp change on set-point",
    10: "reserved",
    **dict.fromkeys(range(11, 16), "specific to the maker"),
}


def _status_bits() -> dict[int, str]:
    bits = {
        0: "ready to switch on",
        1: "switched on",
        2: "operation enabled",
        3: "fault",
        5: "quick stop (0 = active)",
        6: "switch on disabled",
        14: "specific to the maker",
        15: "specific to the maker",
        **statusword.COMMON_BITS,
    }
    for bit in (12, 13):
        readings: dict[str, list[str]] = {}
        for mode, names in statusword.MODE_BITS.items():
            if bit in names:
                readings.setdefault(names[bit], []).append(modes.short(mode))
        each = ", ".join(f"{' '.join(shorts)} {name}" for name, shorts in readings.items())
        bits[bit] = f"specific to the mode: {each}"
    return bits


def _commands() -> Meaning:
    rows = tuple((f"0x{each.word:04X}", each.name.lower().replace("_", " ")) for each in Command)
    return Meaning("Commands", "controlword", rows)


def _states() -> Meaning:
    rows = tuple(
        (f"0x{value:04X}, mask 0x{mask:04X}", state.value) for mask, value, state in STATUSWORD_PATTERNS
    )
    return Meaning("States", "statusword", rows)


def _homing_methods() -> Meaning:
    rows: list[tuple[str, str]] = [("negative", "specific to the maker")]
    for method, text in homing.METHODS.items():
        if rows[-1][1] == text:
            rows[-1] = (f"{rows[-1][0].partition('-')[0]}-{method}", text)
        else:
            rows.append((str(method), text))
    return Meaning("Homing methods", "value", tuple(rows))


_MODES = _values(
    "Modes",
    {
        mode.value: f"{mode.text} ({modes.short(mode)})" if mode in modes.FACTS else "no mode"
        for mode in (ModeOfOperation.NONE, *modes.FACTS)
    },
)
_SUPPORTED = _bits(
    "Modes",
    {facts.supported_bit: f"{mode.text} ({facts.short})" for mode, facts in modes.FACTS.items()},
)
_SIGNATURES = {cia301.STORE_PARAMETERS: "0x65766173", cia301.RESTORE_DEFAULTS: "0x64616F6C"}

_TABLES: dict[tuple[int, int], tuple[Meaning, ...]] = {
    (cia301.ERROR_REGISTER, 0): (_bits("Bits", emcy.REGISTER_BITS),),
    (cia301.STORE_PARAMETERS, 1): (
        Meaning("Values", "value", ((_SIGNATURES[cia301.STORE_PARAMETERS], 'stores: the letters "save"'),)),
    ),
    (cia301.RESTORE_DEFAULTS, 1): (
        Meaning("Values", "value", ((_SIGNATURES[cia301.RESTORE_DEFAULTS], 'restores: the letters "load"'),)),
    ),
    (cia301.CONSUMER_HEARTBEAT, 1): (
        Meaning("Bits", "bit", (("0-15", "heartbeat time in ms"), ("16-22", "node ID that is watched"))),
    ),
    (cia402.CONTROLWORD, 0): (_commands(), _bits("Bits", _CONTROL_BITS)),
    (cia402.STATUSWORD, 0): (_states(), _bits("Bits", _status_bits())),
    (cia402.MODES_OF_OPERATION, 0): (_MODES,),
    (cia402.MODES_OF_OPERATION_DISPLAY, 0): (_MODES,),
    (cia402.SUPPORTED_DRIVE_MODES, 0): (_SUPPORTED,),
    (cia402.HOMING_METHOD, 0): (_homing_methods(),),
    (cia402.POLARITY, 0): (
        _bits("Bits", {6: "velocity: 1 multiplies by -1", 7: "position: 1 multiplies by -1"}),
    ),
    (cia402.DIGITAL_INPUTS, 0): (
        Meaning(
            "Bits",
            "bit",
            (
                ("0", "negative limit switch"),
                ("1", "positive limit switch"),
                ("2", "home switch"),
                ("3", "interlock"),
                ("4-15", "reserved"),
                ("16-31", "specific to the maker"),
            ),
        ),
    ),
    **{
        (option.index, option.subindex): (_values(f"What {option.title} does", option.meanings),)
        for option in options.ALL
    },
}

# Sub-indices of 14xxh and 18xxh (CiA 301 7.5.2.35, 7.5.2.37).
_PDO: dict[int, tuple[Meaning, ...]] = {
    cia301.PDO_COB_ID: (
        Meaning(
            "Bits",
            "bit",
            (
                ("0-10", "CAN identifier (0-28 with bit 29)"),
                ("29", "1: identifier of 29 bits"),
                ("30", "TPDO, 1: no remote request"),
                ("31", "1: the PDO is switched off"),
            ),
        ),
    ),
    cia301.PDO_TRANSMISSION_TYPE: (
        Meaning(
            "Values",
            "value",
            (
                ("0", "synchronous, acyclic"),
                ("1-240", "synchronous: with every n-th SYNC"),
                ("252-253", "on remote request (TPDO)"),
                ("254", "event-driven, specific to the maker"),
                ("255", "event-driven, as the device profile says"),
            ),
        ),
    ),
}
