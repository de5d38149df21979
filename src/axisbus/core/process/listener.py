"""The acceptor of a running core: the socket of its claim, by which other programs of this computer connect.

Theory of operation
-------------------
A program finds a machine by its claim (``bus.link.claims``), which depends on no environment and on no file. Both sides check the
user of the other one, which the kernel reports. A core admits its own user and root. A program connects to a core of its own user;
root also connects to a core of the user that owns the cell file. No other claim counts as a machine.

The first byte is the purpose. ``a``: the program joins; it gets the images of the cycles, read only, and sends ``m.Attach``. ``s``:
the program wants axes to stop, and names them in the same message; it needs no place among the clients, and neither the same
version nor the same text of the cell file. A program that sends no purpose in time is disconnected; if there are too many of these,
the oldest is disconnected.
"""

from __future__ import annotations

import hashlib
import json
import mmap
import os
import select
import socket
import struct
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from axisbus.bus.link.claims import CellFileId, ChannelClaim, claims, peer_of
from axisbus.bus.link.ownership import described, holder, user_name
from axisbus.cell.model import SIMULATED, CellConfig
from axisbus.errors import ScanError
from axisbus.link import StopResult

_ROOT = 0
_JOINS, _STOPS = b"a", b"s"
_FULL = b"f"
_LENGTH = struct.Struct("<H")
_JOIN_TIMEOUT = 10.0  # seconds that a joining program waits for a core, which may be booting its nodes
_FIRST_MESSAGE_TIME = 5.0  # seconds for a program to send its purpose
_MAX_PENDING = 128  # programs that have not sent it
_BATCH = 8  # programs that are accepted at a time
_PAUSE = 0.002  # seconds after each batch, so that many programs do not delay the scan
_MAX_STOP_TIME = 60.0  # maximum seconds to wait for the answer to a stop request
_POLL_PERIOD = 100  # milliseconds
_READ_SIZE = 1 << 12


@dataclass(frozen=True, slots=True)
class StopRequest:
    """The stop that a program requests: these axes, or all if it is empty, by quick stop or by halt."""

    axes: tuple[str, ...] = ()
    quick: bool = True

    def pack(self) -> bytes:
        """Return it as the first message of a program."""
        text = json.dumps([self.axes, self.quick]).encode()
        return _STOPS + _LENGTH.pack(len(text)) + text

    @classmethod
    def read(cls, text: bytes) -> StopRequest:
        """Return the request of a program; raises ValueError if the data are not a request."""
        try:
            found = json.loads(text)
        except RecursionError:
            raise ValueError("nested too deeply") from None
        if not (isinstance(found, list) and len(found) == 2 and isinstance(found[0], list)):
            raise ValueError("not a stop request")
        return cls(tuple(map(str, found[0])), bool(found[1]))


@dataclass(frozen=True, slots=True)
class StopAnswer:
    """The result of a stop by a core; ``text`` is the digest of its cell file at the time of opening."""

    axes: tuple[StopResult, ...]
    text: str = ""


@dataclass(frozen=True, slots=True)
class Caller:
    """A connected program: its connection, its process, and the axes to stop; None if it joins."""

    line: socket.socket
    process: int
    stop: StopRequest | None


class _PendingConnection:
    """A program that has not sent its purpose; holds the bytes received so far."""

    def __init__(self, line: socket.socket, process: int) -> None:
        self.line = line
        self.process = process
        self.since = time.monotonic()
        self._received = b""

    def receive(self) -> Caller:
        """Return the caller when its message is complete.

        Raises:
            BlockingIOError: it is not complete yet.
            OSError, ValueError: the program is gone, or sends something else.
        """
        while part := self.line.recv(_READ_SIZE if self._received else 1):
            self._received += part
            if self._received == _JOINS:
                return self._caller(None)
            if self._received[:1] != _STOPS:
                raise ValueError(self._received[:1])
            said = self._received[1:]
            if len(said) >= _LENGTH.size and len(said) >= (
                end := _LENGTH.size + _LENGTH.unpack_from(said)[0]
            ):
                return self._caller(StopRequest.read(said[_LENGTH.size : end]))
        raise ConnectionResetError

    def _caller(self, stop: StopRequest | None) -> Caller:
        self.line.setblocking(True)
        return Caller(self.line, self.process, stop)


class ClientListener:
    """The core's side; holds the programs that have not sent their purpose."""

    def __init__(self, listening: socket.socket) -> None:
        """``listening``: the socket of the claim, which stays open after ``close``: it shows that the core lives."""
        self._listening = listening
        self._listening.setblocking(False)
        self._pending: dict[int, _PendingConnection] = {}
        self._early: list[Caller] = []  # programs that join, found by ``first_stop``
        self._poll = select.poll()
        self._poll.register(listening, select.POLLIN)
        self._open = True

    def first_stop(self) -> Caller | None:
        """Return a program that has requested a quick stop so far, None if there is none; does not block.

        For a core that is not open yet; ``callers`` yields the other programs when it is.
        """
        while len(self._pending) < _MAX_PENDING and self._accept_connections():
            pass
        for pending in list(self._pending.values()):
            caller = self._receive(pending)
            if caller is not None and caller.stop is not None and caller.stop.quick:
                return caller
            if caller is not None:
                self._early.append(caller)
        return None

    def callers(self) -> Iterator[Caller]:
        """Yield each program that has sent its purpose, until ``close``; blocks in between."""
        while self._early:
            yield self._early.pop(0)
        while self._open:
            ready = {number for number, _ in self._poll.poll(_POLL_PERIOD)}
            for number in ready & self._pending.keys():
                caller = self._receive(self._pending[number])
                if caller is not None:
                    yield caller
            self._disconnect_late()
            if self._listening.fileno() in ready:
                self._accept_connections()
                time.sleep(_PAUSE)
        self.dismiss()

    def dismiss(self) -> None:
        """Disconnect all programs that ``callers`` has not yielded."""
        for pending in list(self._pending.values()):
            self._disconnect(pending)
        while self._early:
            self._early.pop().line.close()

    def close(self) -> None:
        """Admit no more programs."""
        self._open = False

    def _accept_connections(self) -> bool:
        """Accept programs; return whether more may be waiting."""
        for _ in range(_BATCH):
            try:
                line, _ = self._listening.accept()
            except OSError:
                return False
            process, user, _ = peer_of(line)
            if user not in (os.geteuid(), _ROOT):
                line.close()
                continue
            line.setblocking(False)
            self._pending[line.fileno()] = _PendingConnection(line, process)
            self._poll.register(line, select.POLLIN)
            if len(self._pending) > _MAX_PENDING:
                self._disconnect(next(iter(self._pending.values())))
        return True

    def _receive(self, pending: _PendingConnection) -> Caller | None:
        try:
            caller = pending.receive()
        except BlockingIOError:
            return None
        except (OSError, ValueError):
            self._disconnect(pending)
            return None
        self._forget(pending)
        return caller

    def _disconnect_late(self) -> None:
        until = time.monotonic() - _FIRST_MESSAGE_TIME
        for pending in [pending for pending in self._pending.values() if pending.since < until]:
            self._disconnect(pending)

    def _disconnect(self, pending: _PendingConnection) -> None:
        self._forget(pending)
        pending.line.close()

    def _forget(self, pending: _PendingConnection) -> None:
        self._poll.unregister(pending.line)
        del self._pending[pending.line.fileno()]


def send_images(line: socket.socket, image: int) -> None:
    """Pass the images, by their descriptor, read only, to a joining program; raises OSError."""
    read_only = os.open(f"/proc/self/fd/{image}", os.O_RDONLY | os.O_CLOEXEC)
    try:
        socket.send_fds(line, [_JOINS], [read_only])
    finally:
        os.close(read_only)


def refuse(line: socket.socket) -> None:
    """Report to a joining program that there are too many, and close its connection."""
    with line, suppress(OSError):
        line.send(_FULL)


def answer_stop(line: socket.socket, answer: float | StopAnswer) -> None:
    """Report to a program the maximum duration of its stop in seconds, or the results; raises OSError."""
    said: object = answer
    if isinstance(answer, StopAnswer):
        said = [[[each.axis, each.ok, each.text] for each in answer.axes], answer.text]
    line.sendall(json.dumps(said).encode() + b"\n")


class ClientConnection:
    """A joined program's counterpart to ``launch.Processes``. Holds the connection, and the images."""

    watchdog = control = None

    def __init__(self, line: socket.socket, image: int) -> None:
        """``line`` leads to the core; ``image``: the descriptor of its images, which is closed."""
        self.line = line
        self.memory = mmap.mmap(image, 0, access=mmap.ACCESS_READ)
        os.close(image)

    def watch_core(self, process: int) -> None:
        """Do nothing: the core continues."""

    def end(self) -> None:
        """Do nothing: the core continues."""

    def disown(self) -> None:
        """Do nothing: a forked child has nothing to release."""


def machines_of(cell: str) -> list[ChannelClaim]:
    """Return the claims of running machines of this cell file on this computer, of any user, oldest first."""
    return claims(cell=CellFileId.of(cell)) if sys.platform == "linux" else []


def claims_of(cell: CellConfig) -> list[ChannelClaim]:
    """Return the claims of a cell's machines, and that of the holder of its CAN channel."""
    found, bus = machines_of(cell.file), cell.bus
    held = None if bus.interface == SIMULATED else holder(bus.interface, bus.channel)
    known = [each.name for each in found]
    return found if held is None or held.name in known else [*found, held]


def is_trusted(claim: ChannelClaim, cell: str) -> bool:
    """Whether this program may accept the holder of a claim as a machine of this cell file: by its user."""
    if claim.user == os.geteuid():
        return True
    with suppress(OSError):
        return os.geteuid() == _ROOT and claim.user == os.stat(cell).st_uid
    return False


def why_not_joinable(claim: ChannelClaim, cell: str) -> str:
    """Return why a program cannot connect to the holder of a claim, as text; empty if it can."""
    if not is_trusted(claim, cell):
        return f"of user {user_name(claim.user)}, which only programs of that user can join"
    return "" if claim.accepts_clients else "in its own process, so that no other program can join"


def connect(cell: str) -> tuple[socket.socket, int] | None:
    """Connect to the core of this cell file; return the connection, and the descriptor of its images. Blocks for a moment.

    None if no core of this user is found that can be joined.

    Raises:
        ScanError: it admits no program.
    """
    for claim in machines_of(cell):
        if claim.accepts_clients and is_trusted(claim, cell):
            line = _connect_to(claim, _JOINS, _JOIN_TIMEOUT)
            admitted = None if line is None else _admitted(line, claim, cell)
            if admitted is not None:
                return admitted
    return None


def ask_to_stop(claim: ChannelClaim, request: StopRequest, patience: float) -> StopAnswer:
    """Request the machine of a claim to stop its axes; blocks until the result, or for ``patience`` seconds without any answer.

    Raises:
        ScanError: it cannot be reached, or does not answer in time.
    """
    line = _connect_to(claim, request.pack(), patience)
    if line is None:
        raise _unreached(claim, "it is ending")
    with line, line.makefile("rb") as answers:
        try:
            within = float(json.loads(answers.readline()))
            line.settimeout(min(within, _MAX_STOP_TIME) + patience)
            results, text = json.loads(answers.readline())
            return StopAnswer(
                tuple(StopResult(str(axis), ok is True, str(said)) for axis, ok, said in results), text
            )
        except TimeoutError:
            raise _unreached(claim, "it does not answer: it hangs, or boots its nodes") from None
        except (OSError, ValueError, TypeError, RecursionError):
            raise _unreached(claim, "it closed the connection") from None


def text_of(cell: str) -> str:
    """Return a digest of a cell's file, so that both ends can check that they have the same text."""
    return hashlib.sha256(Path(cell).read_bytes()).hexdigest()


def _connect_to(claim: ChannelClaim, message: bytes, patience: float) -> socket.socket | None:
    """Connect to the holder of a claim and send ``message``; None if it is gone.

    Raises:
        ScanError: it does not answer within ``patience`` seconds, or its user differs from that of the claim.
    """
    line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    until = time.monotonic() + patience
    line.settimeout(patience)
    try:
        while not _connects(line, claim):  # too many programs are waiting to be accepted
            if time.monotonic() > until:
                raise _unreached(claim, "it does not answer: it hangs, or too many programs try to join")
            time.sleep(_PAUSE)
        if peer_of(line)[1] != claim.user:
            raise _unreached(claim, "another user answers")
        line.sendall(message)
    except OSError:
        line.close()
        return None
    except ScanError:
        line.close()
        raise
    return line


def _connects(line: socket.socket, claim: ChannelClaim) -> bool:
    try:
        line.connect(claim.name)
    except BlockingIOError:
        return False
    return True


def _admitted(line: socket.socket, claim: ChannelClaim, cell: str) -> tuple[socket.socket, int] | None:
    """Return the connection and the images from a core; None if it ends meanwhile."""
    why = ""
    try:
        hello, descriptors, _, _ = socket.recv_fds(line, 1, 1)
        if hello == _JOINS and descriptors:
            line.settimeout(None)
            return line, descriptors[0]
        why = "it has its maximum number of clients" if hello == _FULL else ""
    except TimeoutError:
        why = "it does not answer: it hangs, or boots its nodes"
    except OSError:
        pass
    line.close()
    if not why:
        return None
    raise ScanError(
        f"the machine of {cell} accepts no clients",
        observed=f"{why}; it belongs to {described(claim.process)}",
        remedy="end another program that is joined to it, or the machine itself if it hangs; axisbus stop and axisbus halt "
        "work without joining",
    )


def _unreached(claim: ChannelClaim, why: str) -> ScanError:
    return ScanError(
        f"the machine that {described(claim.process)} runs was not reached",
        observed=why,
        remedy="try again; or end that program",
    )
