"""The cells of a plant as a program sees them: found on the network, watched, commanded and stopped."""

from __future__ import annotations

import getpass
import os
import socket
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType

from axisbus.errors import StateError
from axisbus.fleet import network
from axisbus.fleet.cell import FleetCell, Ways
from axisbus.fleet.command_sender import CommandSender
from axisbus.fleet.endpoint_status import unreached
from axisbus.fleet.event_loop import EventLoopThread
from axisbus.fleet.exit_hook import ENDING
from axisbus.fleet.keys import ZenohCellKeys, named
from axisbus.fleet.lease_session import Leases
from axisbus.fleet.network import ZenohNetwork
from axisbus.fleet.subscriptions import FleetSubscriptions
from axisbus.fleet.zenoh_client import ZenohClient
from axisbus.machine.handle import Handle

_LOOK = 1.0  # seconds for which opening waits for the cells that are there
_COMING = 1.5  # and for those that come by themselves: they try once a second
_STEP = 0.02


class Fleet:
    """The cells of a plant, over its Zenoh network; for a ``with`` block. ``fleet["press"]["x"]`` is an axis.

    Iterating yields cells, gone ones included.

    Opening looks on and commands nothing; it blocks for about a second at most (1.5 s where it listens or searches), until the
    cells that are there have told what they are. Cells that come later are seen as they come. Any thread may use it.
    """

    plant: str

    def __init__(
        self,
        plant: str,
        *,
        connect: Sequence[str] = (),
        listen: Sequence[str] = (),
        scouting: bool = False,
        config: str | Path | None = None,
        who: str = "",
        look: float | None = None,
    ) -> None:
        """``connect``, ``listen``: endpoints such as ``tcp/10.0.0.5:7447``. ``config``: a file of Zenoh's. ``who``: for people.

        ``scouting``: cells are searched for by multicast as well. ``look``: seconds for which opening waits at most; 0: not at all.

        Raises:
            ArgumentError: ``plant`` cannot stand in a key, an endpoint is none, or nobody could be reached.
            StateError: zenoh is not installed, or the network cannot be joined.
        """
        self.plant = named("the plant", plant)
        file = None if config is None else Path(config)
        way = ZenohNetwork(tuple(connect), tuple(listen), scouting, file)
        self._asking = ZenohClient(network.opened(way))
        self._connect = network.far_ends(way)
        self._worker = EventLoopThread("axisbus fleet")
        self._hearing = FleetSubscriptions(plant, self._asking, self._worker)
        self._sending = CommandSender(self._hearing, self._asking, self._worker)
        self._leases = Leases(who or _who(), self._hearing, self._asking, self._worker, self._sending)
        self._cells: dict[str, FleetCell] = {}
        self._forget = ENDING.add(self.close)
        self._hearing.begin()
        comes = bool(listen or scouting)  # nobody knows how many
        self._first_look((_COMING if comes else _LOOK) if look is None else look, comes)

    def __enter__(self) -> Fleet:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Fleet {self.plant}: {', '.join(map(repr, self)) or 'no cells'}>"

    def __iter__(self) -> Iterator[FleetCell]:
        return iter([self._cell(name) for name in self._hearing.names])

    def __len__(self) -> int:
        return len(self._hearing.names)

    def __contains__(self, cell: object) -> bool:
        return isinstance(cell, str) and self._hearing.has(cell)

    def __getitem__(self, cell: str) -> FleetCell:
        """Return the cell of this name, be it gone since.

        Raises:
            StateError: none of this name was heard of.
        """
        if not self._hearing.has(cell):
            names = self._hearing.names
            raise StateError(
                f"plant {self.plant}: no cell {cell!r} was heard of",
                observed=f"there are {', '.join(names)}" if names else "no cell was heard of at all",
                remedy="see that its bridge runs for this plant, and which endpoints it has (axisbus bridge zenoh)",
            )
        return self._cell(cell)

    @property
    def cells(self) -> dict[str, FleetCell]:
        """The cells that were heard of, by name, gone ones included."""
        return {cell.name: cell for cell in self}

    @property
    def unreachable_endpoints(self) -> list[str]:
        """The endpoints of ``connect``, or else of ``config``, to which there is no connection now: nobody knows what is there."""
        return unreached(self._connect, self._asking.links)

    @property
    def invalid_messages(self) -> int:
        """How many messages under the plant's keys were none of its."""
        return self._hearing.junk

    def wait_for(self, *cells: str, timeout: float = 10.0) -> list[FleetCell]:
        """Block until these cells are alive and have told what they are and do, at most ``timeout`` seconds; return them.

        Raises:
            TimeoutError: some have not come.
        """
        end = time.monotonic() + timeout
        while missing := [name for name in cells if not self._is_here(name)]:
            if time.monotonic() > end:
                raise TimeoutError(f"{', '.join(missing)}: not there after {timeout:g} s")
            time.sleep(_STEP)
        return [self._cell(name) for name in cells]

    def halt(self) -> list[Handle]:
        """Brake all axes of all cells to Standstill, whoever has their command; returns a handle per cell."""
        return [cell.halt() for cell in self]

    def quick_stop(self) -> list[Handle]:
        """Let all drives of all cells do their quick stop, whoever has their command; returns a handle per cell."""
        return [cell.quick_stop() for cell in self]

    def any_cell(self, name: str) -> FleetCell:
        """Return the cell of this name even where it was not heard of: a stop is sent all the same.

        Raises:
            ArgumentError: it can be no cell's name.
        """
        return self._cell(named("the cell", name))

    def close(self) -> None:
        """Give back every command, and end the session; blocks for at most some seconds. Harmless when repeated.

        A program that ends without it has it done as its main thread ends. The handles of what runs still end, as not known.
        """
        self._forget()
        self._leases.end()
        self._hearing.end()
        self._sending.end()
        self._worker.end()
        self._asking.close()

    def _cell(self, name: str) -> FleetCell:
        ways = Ways(self._asking, self._hearing, self._sending, self._leases)
        return self._cells.setdefault(name, FleetCell(name, ways))

    def _is_here(self, name: str) -> bool:
        return self._hearing.settled([name]) and self._cell(name).alive

    def _first_look(self, seconds: float, comes: bool) -> None:
        """Wait until the cells that are there have told what they are; ``comes``: more may come by themselves."""
        end = time.monotonic() + seconds
        every = ZenohCellKeys.of_all(self.plant).alive
        while (left := end - time.monotonic()) > 0:
            found = [key.split("/")[2] for key in self._asking.tokens(every, left)]
            if not comes and not self.unreachable_endpoints and found and self._hearing.settled(found):
                return
            time.sleep(_STEP)


def _who() -> str:
    """Return who this is, for people at the cell."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):
        user = "somebody"
    return f"{user}@{socket.gethostname()}, process {os.getpid()}"
