"""The cells of a plant, for programs: find them on the network, observe, command and stop them."""

from __future__ import annotations

import getpass
import ipaddress
import logging
import os
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import TracebackType

from axisbus.errors import StateError
from axisbus.fleet import network
from axisbus.fleet.cell import FleetCell, FleetServices
from axisbus.fleet.command_sender import CommandSender
from axisbus.fleet.event_loop import EventLoopThread
from axisbus.fleet.keys import ZenohCellKeys, named
from axisbus.fleet.lease_session import Leases
from axisbus.fleet.network import ZenohNetwork
from axisbus.fleet.subscriptions import FleetSubscriptions
from axisbus.fleet.zenoh_client import ZenohClient
from axisbus.machine.handle import Handle

_SEARCH_TIME = 1.0  # seconds for which opening waits for the cells that are present
_LISTENING_SEARCH_TIME = 1.5  # the same if cells connect to this program: they try once a second
_STEP = 0.02


class Fleet:
    """The cells of a plant, over its Zenoh network; for a ``with`` block. ``fleet["press"]["x"]`` is an axis.

    Iterating yields the cells, including those that have disappeared.

    Opening only observes and commands nothing. It blocks until the cells that are present have reported their description, at most
    about 1 s (1.5 s if it listens or searches). Cells that appear later are found as they appear. Any thread may use it.
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
        """``connect``, ``listen``: endpoints such as ``tcp/10.0.0.5:7447``. ``config``: a file for Zenoh. ``who``: for people.

        ``scouting``: also search for cells by multicast. ``look``: the most seconds for which opening waits; 0: do not wait.

        Raises:
            ArgumentError: ``plant`` cannot be part of a key, an endpoint is invalid, or no endpoint could be reached.
            StateError: zenoh is not installed, or the network cannot be joined.
        """
        self.plant = named("the plant", plant)
        file = None if config is None else Path(config)
        options = ZenohNetwork(tuple(connect), tuple(listen), scouting, file)
        self._zenoh_client = ZenohClient(network.opened(options))
        self._connect = network.far_ends(options)
        self._worker = EventLoopThread("axisbus fleet")
        self._subscriptions = FleetSubscriptions(plant, self._zenoh_client, self._worker)
        self._sender = CommandSender(self._subscriptions, self._zenoh_client, self._worker)
        self._leases = Leases(
            who or _program_name(), self._subscriptions, self._zenoh_client, self._worker, self._sender
        )
        self._cells: dict[str, FleetCell] = {}
        self._forget = ENDING.add(self.close)
        self._subscriptions.begin()
        may_connect = bool(listen or scouting)  # the number of cells is unknown
        self._await_cells(
            (_LISTENING_SEARCH_TIME if may_connect else _SEARCH_TIME) if look is None else look, may_connect
        )

    def __enter__(self) -> Fleet:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Fleet {self.plant}: {', '.join(map(repr, self)) or 'no cells'}>"

    def __iter__(self) -> Iterator[FleetCell]:
        return iter([self._cell(name) for name in self._subscriptions.names])

    def __len__(self) -> int:
        return len(self._subscriptions.names)

    def __contains__(self, cell: object) -> bool:
        return isinstance(cell, str) and self._subscriptions.has(cell)

    def __getitem__(self, cell: str) -> FleetCell:
        """Return the cell of this name, even if it has disappeared since.

        Raises:
            StateError: no cell of this name has been heard.
        """
        if not self._subscriptions.has(cell):
            names = self._subscriptions.names
            raise StateError(
                f"plant {self.plant}: cell {cell!r} was not found",
                observed=f"there are {', '.join(names)}" if names else "no cell was found",
                remedy="check that its bridge runs for this plant, and its endpoints (axisbus bridge zenoh)",
            )
        return self._cell(cell)

    @property
    def cells(self) -> dict[str, FleetCell]:
        """The cells that have been heard, by name, including those that have disappeared."""
        return {cell.name: cell for cell in self}

    @property
    def unreachable_endpoints(self) -> list[str]:
        """The endpoints of ``connect``, or else of ``config``, without a connection now: the cells behind them are unknown."""
        return unreached(self._connect, self._zenoh_client.links)

    @property
    def invalid_messages(self) -> int:
        """The number of invalid messages received under the plant's keys."""
        return self._subscriptions.invalid_count

    def wait_for(self, *cells: str, timeout: float = 10.0) -> list[FleetCell]:
        """Block until these cells are alive and have reported their state, at most ``timeout`` seconds; return them.

        Raises:
            TimeoutError: a cell is not there in time.
        """
        end = time.monotonic() + timeout
        while missing := [name for name in cells if not self._is_settled(name)]:
            if time.monotonic() > end:
                raise TimeoutError(f"{', '.join(missing)}: not found within {timeout:g} s")
            time.sleep(_STEP)
        return [self._cell(name) for name in cells]

    def halt(self) -> list[Handle]:
        """Brake all axes of all cells to Standstill, whichever client has control; return one handle per cell."""
        return [cell.halt() for cell in self]

    def quick_stop(self) -> list[Handle]:
        """Make all drives of all cells do their quick stop, whichever client has control; return one handle per cell."""
        return [cell.quick_stop() for cell in self]

    def any_cell(self, name: str) -> FleetCell:
        """Return the cell of this name even if it has not been heard, because a stop is sent in any case.

        Raises:
            ArgumentError: the name is not valid for a cell.
        """
        return self._cell(named("the cell", name))

    def close(self) -> None:
        """Release control of all cells and end the session; blocks for some seconds at most. Harmless when repeated.

        If a program ends without calling it, it is called when the main thread ends. The handles of running commands end with the
        result unknown.
        """
        self._forget()
        self._leases.end()
        self._subscriptions.end()
        self._sender.end()
        self._worker.end()
        self._zenoh_client.close()

    def _cell(self, name: str) -> FleetCell:
        services = FleetServices(self._zenoh_client, self._subscriptions, self._sender, self._leases)
        return self._cells.setdefault(name, FleetCell(name, services))

    def _is_settled(self, name: str) -> bool:
        return self._subscriptions.settled([name]) and self._cell(name).alive

    def _await_cells(self, seconds: float, may_connect: bool) -> None:
        """Wait until the present cells have reported their description; ``may_connect``: more cells may connect to this program."""
        end = time.monotonic() + seconds
        alive_keys = ZenohCellKeys.of_all(self.plant).alive
        while (remaining := end - time.monotonic()) > 0:
            found = [key.split("/")[2] for key in self._zenoh_client.tokens(alive_keys, remaining)]
            if (
                not may_connect
                and not self.unreachable_endpoints
                and found
                and self._subscriptions.settled(found)
            ):
                return
            time.sleep(_STEP)


def _program_name() -> str:
    """Return the name of this program, for people at the cell."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):
        user = "somebody"
    return f"{user}@{socket.gethostname()}, process {os.getpid()}"


# -- Determine to which of its endpoints a fleet has a connection ------------------------------------------------------


def unreached(endpoints: Sequence[str], links: Iterable[str]) -> list[str]:
    """Return the endpoints without a link; ``links``: the far ends of the present links, as Zenoh writes them.

    An endpoint given by host name counts as reached if there is a link to its port that belongs to no other endpoint.
    """
    linked = {_plain_endpoint(link) for link in links}
    unused = linked - {_plain_endpoint(endpoint) for endpoint in endpoints}
    missing = []
    for endpoint in endpoints:
        plain = _plain_endpoint(endpoint)
        by_name = None if plain in linked or not _is_name(plain) else _same_port(plain, unused)
        if by_name is not None:
            unused.discard(by_name)
        elif plain not in linked:
            missing.append(endpoint)
    return missing


def _plain_endpoint(endpoint: str) -> str:
    """Return an endpoint without the metadata and configuration after its address."""
    return endpoint.partition("?")[0].partition("#")[0]


def _is_name(plain: str) -> bool:
    host = plain.partition("/")[2].rpartition(":")[0].strip("[]")
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return True
    return False


def _same_port(plain: str, links: Iterable[str]) -> str | None:
    protocol, _, address = plain.partition("/")
    port = address.rpartition(":")[2]
    return next(
        (
            each
            for each in sorted(links)
            if each.startswith(f"{protocol}/") and each.rpartition(":")[2] == port
        ),
        None,
    )


# -- Close the fleets that a program has not closed, when its main thread ends -----------------------------------------
#
# Otherwise Zenoh's threads would keep the interpreter alive, and the fleet's thread would keep renewing its leases: motion that
# the program has started would continue although the program seems to be over. Functions registered with ``atexit`` run only
# after these threads have ended.


log = logging.getLogger("axisbus")


class ExitHook:
    """Hold the functions to call once, when the main thread ends."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._calls: dict[int, Callable[[], None]] = {}
        self._thread: threading.Thread | None = None

    def add(self, call: Callable[[], None]) -> Callable[[], None]:
        """Register ``call``, run in its own thread at the end; return a function that unregisters it, harmless when repeated."""
        with self._lock:
            self._calls[id(call)] = call
            if (
                self._thread is None or not self._thread.is_alive()
            ):  # the thread does not exist in a forked child
                # no daemon, so that the interpreter waits for it: closing a session while the interpreter ends aborts the process
                self._thread = threading.Thread(target=self._run, name="axisbus fleet end", daemon=False)
                self._thread.start()
        return lambda: self._forget(id(call))

    def _forget(self, key: int) -> None:
        with self._lock:
            self._calls.pop(key, None)

    def _run(self) -> None:
        threading.main_thread().join()
        for call in list(self._calls.values()):
            try:
                call()
            except Exception:  # the next fleet has to be closed in any case
                log.exception("a fleet could not be closed")


ENDING = ExitHook()
