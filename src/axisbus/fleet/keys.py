"""Where a cell's state, events, lease, commands, objects and history are, as key expressions of Zenoh."""

from __future__ import annotations

import re
from dataclasses import dataclass

from axisbus.errors import ArgumentError

ROOT = "ax"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
_ANY = "*"


def is_name(name: str) -> bool:
    """Whether a name may stand in a key."""
    return _NAME.fullmatch(name) is not None


def named(what: str, name: str) -> str:
    """Return a name that may stand in a key; ``what`` says for people what it is the name of.

    Raises:
        ArgumentError: it is empty, too long, or has other letters than a key may have.
    """
    if not is_name(name):
        raise ArgumentError(
            f"{what} {name!r} cannot stand in a key of Zenoh",
            remedy="take at most 64 of the letters A to Z, a to z, 0 to 9, and _ . - after the first",
        )
    return name


@dataclass(frozen=True, slots=True)
class ZenohCellKeys:
    """The keys of one cell of a plant; both names as ``named`` returns them, or ``*`` for all (``of_all``)."""

    plant: str
    cell: str

    @classmethod
    def of_all(cls, plant: str) -> ZenohCellKeys:
        """The keys of every cell of a plant, to ask or hear them all."""
        return cls(plant, _ANY)

    @property
    def base(self) -> str:
        """What all keys of the cell begin with."""
        return f"{ROOT}/{self.plant}/{self.cell}"

    @property
    def alive(self) -> str:
        """The liveliness token: there while a machine runs and its bridge does."""
        return f"{self.base}/@alive"

    def presence(self, bridge: str) -> str:
        """A liveliness token: there while this run of a bridge is, whether a machine runs or not; ``*`` is every bridge."""
        return f"{self.base}/@bridge/{bridge}"

    @property
    def info(self) -> str:
        """A query: what the cell is (``messages.CellInfo``)."""
        return f"{self.base}/info"

    def state(self, axis: str) -> str:
        """What an axis does (``messages.AxisStateMessage``), published; an answer to a query is the newest. ``*`` is every axis."""
        return f"{self.base}/{axis}/state"

    @property
    def events(self) -> str:
        """What has happened (``messages.Event``), published; a query (``messages.EventsAsk``) gives what is kept, in one answer."""
        return f"{self.base}/events"

    @property
    def lease(self) -> str:
        """A query: who may command (``messages.LeaseAsk``, ``LeaseAnswer``)."""
        return f"{self.base}/lease"

    def command(self, verb: str) -> str:
        """A query: a command (``messages.CommandAsk``, ``CommandAnswer``). ``*`` is every verb."""
        return f"{self.base}/cmd/{verb}"

    def object(self, node: int | str, index: int, subindex: int) -> str:
        """A query: an object of a node, read, or written with a lease (``messages.ObjectWrite``, ``ObjectAnswer``)."""
        return f"{self.base}/od/{node}/{index:04X}/{subindex:02X}"

    @property
    def objects(self) -> str:
        """All objects of all nodes."""
        return f"{self.base}/od/*/*/*"

    @property
    def history(self) -> str:
        """A query: what recordings hold (``messages.HistoryAsk``, ``HistoryAnswer``)."""
        return f"{self.base}/history"
