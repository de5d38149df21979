"""Describe how each axis stops, in plain words: its stop sequence, and how the drive detects the loss of the master."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.cia402 import options
from axisbus.motion.parameters import HoldsLoad, StopTimes


class Watchdog(Enum):
    """How a drive notices that the master is dead."""

    ARMED = "armed"
    UNKNOWN = "armed, reaction unknown"
    NONE = "none"


@dataclass(frozen=True, slots=True)
class WatchdogReport:
    """The kind of watchdog, and a sentence that names its objects and its effect."""

    kind: Watchdog
    text: str


NO_WATCHDOG = WatchdogReport(
    Watchdog.NONE,
    "nothing on this drive detects the loss of the master: if this program or the bus fails, it continues with its last command",
)


@dataclass(frozen=True, slots=True)
class StopSequenceReport:
    """The stop sequence of one axis: rows of (step, object, effect), and warnings of dangerous settings."""

    axis: str
    rows: tuple[tuple[str, str, str], ...]
    warnings: tuple[str, ...]


# Step of the stop sequence or event -> option object, in the order of printing.
_ROWS = (
    ("1 halt", options.HALT),
    ("2 quick stop", options.QUICK_STOP),
    ("3 power off", options.DISABLE),
    ("on a fault", options.FAULT),
    ("on a lost link", options.CONNECTION_LOSS),
    ("its NMT state", options.COMMUNICATION_ERROR),
)
_UNKNOWN = "not in this drive: its manual says how it reacts"
# The standard's definition for a drive without the object, 1029h (CiA 301 7.5.2.32).
_MISSING = {
    options.COMMUNICATION_ERROR.index: "not in this drive: by the standard it changes to pre-operational"
}
# Values with which a moving load coasts.
_COASTS = {
    options.QUICK_STOP.index: (0,),
    options.DISABLE.index: (0,),
    options.FAULT.index: (0,),
    options.HALT.index: (0,),
    options.CONNECTION_LOSS.index: (0, 2),
}


def stop_sequence_report(
    axis: str, values: Mapping[int, int | None], times: StopTimes, holds_load: HoldsLoad
) -> StopSequenceReport:
    """Describe the option codes read from a drive; ``values`` maps their index to the value, None: no such object."""
    rows, warnings = [], []
    limits = {"1 halt": times.halt, "2 quick stop": times.quick_stop, "3 power off": times.disable}
    for title, option in _ROWS:
        value = values.get(option.index)
        text = _MISSING.get(option.index, _UNKNOWN) if value is None else option.meaning(value)
        if title in limits:
            text += f" (at most {limits[title]:g} s, then the next step)"
        rows.append((title, _object(option, value), text))
        if value is not None and value in _COASTS.get(option.index, ()):
            warnings.append(
                f"{axis}: {option.title}: {option.meaning(value)} ({option.index:04X}h = {value})"
            )
    rows.insert(
        3,
        (
            "4 NMT stop",
            "",
            "the node leaves operational; the reaction of its drive is listed under 'on a lost link'",
        ),
    )
    if holds_load is not HoldsLoad.NO:
        rows.append(
            ("holds a load", "", f"by its {holds_load.value}: never switched off before it is at standstill")
        )
    return StopSequenceReport(axis, tuple(rows), tuple(warnings))


def _object(option: options.OptionCode, value: int | None) -> str:
    return f"{option.index:04X}h missing" if value is None else f"{option.index:04X}h = {value}"
