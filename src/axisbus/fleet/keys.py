"""Key expressions of Zenoh for a cell's state, events, lease, commands, objects and history."""

from __future__ import annotations

import re
from dataclasses import dataclass

from axisbus.errors import ArgumentError

ROOT = "ax"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
_ANY = "*"


def is_name(name: str) -> bool:
    """Whether a name may be part of a key."""
    return _NAME.fullmatch(name) is not None


def named(what: str, name: str) -> str:
    """Return a name that may be part of a key; ``what`` says for people what the name belongs to.

    Raises:
        ArgumentError: the name is empty, too long, or has characters that a key may not have.
    """
    if not is_name(name):
        raise ArgumentError(
            f"{what} {name!r} cannot be part of a key of Zenoh",
            remedy="use at most 64 characters: A to Z, a to z, 0 to 9, _, and after the first also . -",
        )
    return name


@dataclass(frozen=True, slots=True)
class ZenohCellKeys:
    """The keys of one cell of a plant; both names as ``named`` returns them, or ``*`` for all (``of_all``)."""

    plant: str
    cell: str

    @classmethod
    def of_all(cls, plant: str) -> ZenohCellKeys:
        """Return the keys of all cells of a plant, to query or subscribe to them."""
        return cls(plant, _ANY)

    @property
    def base(self) -> str:
        """The beginning of all keys of the cell."""
        return f"{ROOT}/{self.plant}/{self.cell}"

    @property
    def alive(self) -> str:
        """The liveliness token of the cell: present while a machine and its bridge run."""
        return f"{self.base}/@alive"

    def presence(self, bridge: str) -> str:
        """A liveliness token: present while this run of a bridge lasts, whether a machine runs or not; ``*`` is every bridge."""
        return f"{self.base}/@bridge/{bridge}"

    @property
    def info(self) -> str:
        """A query for the description of the cell (``messages.CellInfo``)."""
        return f"{self.base}/info"

    def state(self, axis: str) -> str:
        """The published state of an axis (``messages.AxisStateMessage``); a query returns the newest one. ``*`` is every axis."""
        return f"{self.base}/{axis}/state"

    @property
    def events(self) -> str:
        """The published events (``messages.Event``); a query (``messages.EventsAsk``) returns stored events in one answer."""
        return f"{self.base}/events"

    @property
    def lease(self) -> str:
        """A query about control of the cell (``messages.LeaseAsk``, ``LeaseAnswer``)."""
        return f"{self.base}/lease"

    def command(self, verb: str) -> str:
        """A query that is a command (``messages.CommandAsk``, ``CommandAnswer``). ``*`` is every verb."""
        return f"{self.base}/cmd/{verb}"

    def object(self, node: int | str, index: int, subindex: int) -> str:
        """A query for an object of a node, to read it, or to write it with a lease (``messages.ObjectWrite``, ``ObjectAnswer``)."""
        return f"{self.base}/od/{node}/{index:04X}/{subindex:02X}"

    @property
    def objects(self) -> str:
        """All objects of all nodes."""
        return f"{self.base}/od/*/*/*"

    @property
    def history(self) -> str:
        """A query for the contents of recordings (``messages.HistoryAsk``, ``HistoryAnswer``)."""
        return f"{self.base}/history"
