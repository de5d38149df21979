"""The messages of CAN Simple as one table (manual v2.2, 4.1.2), from which they are encoded, decoded and documented.

Before it the states of the axis, which several messages contain (the manual's; the other names are from owners' reports).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.cia301.tables import rows
from axisbus.drives.gim6010.can_simple.fields import MessageField, from_row
from axisbus.errors import ArgumentError

IDLE = 1
CLOSED_LOOP = 8

STATES = {
    1: "idle",
    2: "start-up",
    3: "full calibration",
    4: "motor calibration",
    5: "sensorless control",
    6: "encoder index search",
    7: "encoder calibration",
    8: "closed loop",
    9: "lock-in spin",
    10: "encoder direction search",
    11: "homing",
    12: "Hall polarity calibration",
    13: "Hall phase calibration",
    14: "anticogging or inertia calibration",
    15: "encoder linearisation",
    16: "motor dead-time calibration",
}
# The manual also lists 0 (undefined), for which there is no use.
REQUESTED_STATES = {state: STATES[state] for state in (IDLE, 3, 4, 7, CLOSED_LOOP)}


def state_words(state: int) -> str:
    """Return the name of a state; for an unknown state, its number."""
    return STATES.get(state, f"state {state}, which the manual does not name")


LENGTH = 8  # bytes of every data frame sent (4.1.1)


class MessageRequestMethod(Enum):
    """How a master requests a message."""

    NEVER = ""  # it never sends it, or only unasked
    EMPTY = "by a remote frame, or by eight bytes of 0"
    WITH_DATA = "by a data frame that names the requested value"


@dataclass(frozen=True, slots=True, repr=False)
class Message:
    """One message: the fields that the master sends, those that the module sends, and its meaning.

    ``shortest`` is the minimum number of data bytes of an answer, if it may omit fields.
    """

    command: int
    name: str
    meaning: str
    sent: tuple[MessageField, ...] = ()
    answer: tuple[MessageField, ...] = ()
    asked: MessageRequestMethod = MessageRequestMethod.NEVER
    shortest: int = 0

    def __repr__(self) -> str:
        return f"<{self.command:02X}h {self.name}>"

    @property
    def answer_bytes(self) -> int:
        """Minimum number of data bytes of an answer."""
        return self.shortest or max(((each.end + 7) // 8 for each in self.answer), default=0)

    @property
    def sent_bytes(self) -> int:
        """Number of data bytes of the master's fields; all sent frames have ``LENGTH``."""
        return max(((each.end + 7) // 8 for each in self.sent), default=0)


ERROR_TYPES = {0: "motor", 1: "encoder", 3: "controller", 4: "system"}
CONTROL_MODES = {0: "voltage", 1: "torque", 2: "velocity", 3: "position"}
INPUT_MODES = {
    0: "inactive",
    1: "direct",
    2: "velocity ramp",
    3: "position filter",
    5: "trapezoidal trajectory",
    6: "torque ramp",
    9: "motion control (MIT)",
}
_LISTED: Mapping[str, Mapping[int, str]] = {
    "Error_Type": ERROR_TYPES,
    "opcode": {0: "read", 1: "write"},
    "Axis_Requested_State": REQUESTED_STATES,
    "Control_Mode": CONTROL_MODES,
    "Input_Mode": INPUT_MODES,
}


def _read() -> Iterator[Message]:
    """Yield the messages of ``messages.tsv`` with their fields of ``message_fields.tsv``."""
    fields = rows(__package__, "message_fields.tsv")
    for row in rows(__package__, "messages.tsv"):
        sent, answer = (
            tuple(
                from_row(each, _LISTED.get(each["name"], {}))
                for each in fields
                if each["message"] == row["name"] and each["way"] in ways
            )
            for ways in (">*", "<*")
        )
        yield Message(
            int(row["command"], 16),
            row["name"],
            row["meaning"],
            sent,
            answer,
            MessageRequestMethod[row["asked"]],
            int(row["shortest"] or 0),
        )


MESSAGES = tuple(_read())
BY_COMMAND = {each.command: each for each in MESSAGES}
BY_NAME = {each.name: each for each in MESSAGES}
HEARTBEAT_FIELDS = BY_NAME["Heartbeat"].answer  # the newest layout; ``heartbeat`` has those of other firmware
HIGHEST_CURRENT = next(each.high for each in BY_NAME["Set_Limits"].sent if each.unit == "A")  # (3.1.3)


def command_name(command: int) -> str:
    """Return the name of a command; for an unknown one, its number."""
    return BY_COMMAND[command].name if command in BY_COMMAND else f"command {command:02X}h"


def named(name: str) -> Message:
    """Return a message by its name in the manual. Raises ArgumentError: no message has this name."""
    if name not in BY_NAME:
        raise ArgumentError(f"CAN Simple has no message {name!r}", remedy=f"there are {', '.join(BY_NAME)}")
    return BY_NAME[name]
