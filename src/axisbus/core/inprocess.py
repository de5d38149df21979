"""The way to a core that runs in the program's own process."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from axisbus.cia402.port import Waiter
from axisbus.core.scan import Scan
from axisbus.motion.commands import Command
from axisbus.motion.group.commands import GroupCommand
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.ticket import Ticket
from axisbus.session import AxisFacts, CommandEvent, LatenessReport, Observer, Target


class InProcess:
    """A ``Session`` with the scan of this process; holds who listens to the ends of commands."""

    def __init__(self, scan: Scan, waiter: Waiter) -> None:
        """``waiter``: how this process waits for ``scan``."""
        self._scan = scan
        self._waiter = waiter
        self._listeners: tuple[Callable[[CommandEvent], None], ...] = ()

    @property
    def axes(self) -> Mapping[str, AxisFacts]:
        """The axes that the scan has."""
        return {name: AxisFacts(core.parameters, core.capabilities) for name, core in self._scan.axes.items()}

    @property
    def snapshots(self) -> Mapping[str, Snapshot]:
        """As ``Session.snapshots``."""
        return self._scan.snapshots

    @property
    def dead(self) -> str | None:
        """As ``Session.dead``."""
        return self._scan.dead

    @property
    def silent(self) -> str | None:
        """As ``Session.silent``."""
        return self._scan.silent

    @property
    def ended(self) -> bool:
        """As ``Session.ended``."""
        return self._scan.ended

    @property
    def failed(self) -> bool:
        """As ``Session.failed``."""
        return self._scan.failure is not None

    @property
    def leaving_because(self) -> str | None:
        """As ``Session.leaving_because``."""
        return self._scan.leaving_because

    @property
    def lateness(self) -> LatenessReport:
        """As ``Session.lateness``."""
        return self._scan.lateness.report()

    @property
    def waiter(self) -> Waiter:
        """As ``Session.waiter``."""
        return self._waiter

    def submit(self, number: int, target: Target, command: Command | GroupCommand, name: str) -> int:
        """As ``Session.submit``."""
        return self._scan.submit(target, command, Ticket(name, self._tell, number)).number

    def listen(self, hear: Callable[[CommandEvent], None]) -> None:
        """As ``Session.listen``."""
        self._listeners = (*self._listeners, hear)

    def add_group(self, key: Target, members: Sequence[str]) -> None:
        """As ``Session.add_group``."""
        self._scan.add_group(key, members)

    def request_stop(self, reason: str, quick: bool = False) -> None:
        """As ``Session.request_stop``."""
        self._scan.request_stop(reason, quick)

    def observe(self, observer: Observer) -> None:
        """As ``Session.observe``."""
        self._scan.observers.append(observer)

    def forget(self, observer: Observer) -> None:
        """As ``Session.forget``."""
        self._scan.observers.remove(observer)

    def _tell(self, ticket: Ticket) -> None:
        event = CommandEvent(ticket.number, ticket.status, ticket.error, ticket.note)
        for hear in self._listeners:
            hear(event)
