"""What came of reading a frame: a message with its values, or what is not as the table says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.can_simple.messages import Message


class Reason(Enum):
    """Why a frame is not what the table says."""

    NOT_STANDARD = "an identifier of 29 bits is not CAN Simple's"
    NO_COMMAND = "there is no such command"
    LENGTH = "it is too short"
    NOT_SENT = "that is not sent by this side"
    NOT_FINITE = "a value is no finite number"
    WRONG_NODE = "it names another node than its identifier"
    VALUE = "a value is not one that the manual lists"


@dataclass(frozen=True, slots=True)
class DecodedMessage:
    """A message of a node; ``values`` by the manual's names of the fields, each in its field's unit and at its field's side."""

    node: int
    message: Message
    values: Mapping[str, Number]
    from_module: bool


@dataclass(frozen=True, slots=True)
class MessageRequest:
    """A master asks a node for a message, by a remote frame or by a data frame of zeros."""

    node: int
    message: Message


@dataclass(frozen=True, slots=True)
class Unexpected:
    """A frame that is not as the table says; it is a value, since no frame of another may end a cycle.

    ``node`` and ``command`` are those of its identifier as CAN Simple splits it, whoever sent it; -1 of an identifier of 29 bits.
    """

    node: int
    command: int
    data: bytes
    reason: Reason
    details: str = ""

    @property
    def words(self) -> str:
        """What is wrong: ``command 09h: it is too short (7 bytes where 8 are needed)``."""
        more = f" ({self.details})" if self.details else ""
        where = "a frame" if self.command < 0 else f"command {self.command:02X}h"
        return f"{where}: {self.reason.value}{more}"
