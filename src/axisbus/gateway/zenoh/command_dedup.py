"""The commands of each client by their ids: a repeated id is the same command, and an id that comes too late is rejected."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from axisbus.errors import ArgumentError, StateError
from axisbus.fleet.messages import TOO_LATE

KEPT = 256  # commands of a client
CLIENTS = 64
Under = TypeVar("Under")  # the state of a given command


@dataclass(slots=True)
class _Client(Generic[Under]):
    highest: int = 0
    given: OrderedDict[int, tuple[Hashable, Under]] = field(default_factory=OrderedDict)


class CommandDeduplicator(Generic[Under]):
    """Hold the last commands of the last clients. For one thread at a time.

    Only the holder of the lease enters commands. A client that was forgotten has not had the lease since many others, and its token
    is void.
    """

    def __init__(self, kept: int = KEPT, clients: int = CLIENTS) -> None:
        self._kept = kept
        self._most = clients
        self._clients: OrderedDict[str, _Client[Under]] = OrderedDict()

    def again(self, client: str, number: int, what: Hashable) -> Under | None:
        """Return the command that a client has already given with this id; None if the id is new.

        Raises:
            StateError: the id is lower than the newest and no longer cached, or it belonged to another command.
        """
        known = self._clients.get(client)
        if known is None or (number not in known.given and number > known.highest):
            return None
        if number not in known.given:
            raise StateError(
                f"command {number} of {client} {TOO_LATE}",
                observed=f"command {known.highest} was received before, and this one is no longer stored",
                remedy="count the ids upwards; a restarted program uses another name",
            )
        before, under = known.given[number]
        if (
            before != what
        ):  # also if a program restarts under its old name: it must not get answers of its previous run
            raise StateError(
                f"command {number} of {client} was a different command: nothing was done",
                observed="it had other contents, or belonged to an earlier lease",
                remedy="give each command its own id; a restarted program uses another name",
            )
        return under

    def enter(self, client: str, number: int, what: Hashable, under: Under) -> None:
        """Note a command that is given now."""
        known = self._known(client)
        known.highest = max(known.highest, number)
        known.given[number] = what, under
        while len(known.given) > self._kept:
            known.given.popitem(last=False)

    def passed(self, client: str, number: int) -> bool:
        """Note an id without storing its command; return whether it is higher than all earlier ids of the client."""
        known = self._known(client)
        newer = number > known.highest
        known.highest = max(known.highest, number)
        return newer

    def _known(self, client: str) -> _Client[Under]:
        known = self._clients.setdefault(client, _Client())
        self._clients.move_to_end(client)
        while len(self._clients) > self._most:
            self._clients.popitem(last=False)
        return known


def require_id(number: int) -> None:
    """Check that a number is valid as the id of a command.

    Raises:
        ArgumentError: the number is below 1, or above 2^53.
    """
    if not 0 < number <= 1 << 53:
        raise ArgumentError(f"{number} is not the id of a command", remedy="count them from 1")
