"""Network management (CiA 301 7.2.8, 7.3.2): commands and node states."""

from __future__ import annotations

from enum import IntEnum

from axisbus.cia301.cob import NODE_IDS

TOGGLE_BIT = 0x80  # of node guarding, in the byte that holds the state


class NmtCommand(IntEnum):
    """Command specifier of the NMT message on COB-ID 0."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130

    @property
    def text(self) -> str:
        """The standard's name, such as ``reset node``."""
        return _COMMANDS[self]


class NmtState(IntEnum):
    """State of a node as its heartbeat reports it; an unknown value becomes a member, too."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127
    UNKNOWN = -1

    @classmethod
    def _missing_(cls, value: object) -> NmtState | None:
        if not isinstance(value, int):
            return None
        member = int.__new__(cls, value)
        member._name_ = f"STATE_{value}"
        member._value_ = value
        return member

    @property
    def text(self) -> str:
        """The standard's name, such as ``pre-operational``."""
        return self.name.lower().replace("_", "-")


_COMMANDS = {
    NmtCommand.START: "start",
    NmtCommand.STOP: "stop",
    NmtCommand.ENTER_PRE_OPERATIONAL: "enter pre-operational",
    NmtCommand.RESET_NODE: "reset node",
    NmtCommand.RESET_COMMUNICATION: "reset communication",
}


def is_boot_up(data: bytes) -> bool:
    """Whether an error control message is a boot-up: the first byte is 0 apart from the toggle bit; further bytes are ignored."""
    return bool(data) and not data[0] & ~TOGGLE_BIT


RESULT = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.INITIALISING,
    NmtCommand.RESET_COMMUNICATION: NmtState.INITIALISING,
}


def watched_node(entry: int) -> int:
    """Return the node whose heartbeat an entry of 1016h monitors; 0 if the entry is unused: time 0, or node-ID not 1 to 127."""
    node = entry >> 16 & 0xFF
    return node if entry & 0xFFFF and node in NODE_IDS else 0
