"""A client's session and the simulated drive's server on a wire in virtual time: any frame can be lost or late."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from axisbus.cia301.datatypes import DataType
from axisbus.cia301.sdo import SdoTransferType
from axisbus.cia301.sdo_session import SdoSession, SdoTransferRequest
from axisbus.sim.dictionary import Dictionary
from axisbus.sim.fault_injection import NodeFaults
from axisbus.sim.node.sdo import SdoServer
from kit.sim.eds import make_eds

FILE = (0x2100, 0)
TIMEOUT = 0.5


class SdoWire:
    """One server with a domain 2100h. ``fate(number, frame)`` is the seconds that a frame takes, None if it gets lost.

    Frames of both directions are counted from 1; each direction keeps its order. Frames in transit when a session ends are
    still there for the next one.
    """

    def __init__(self, content: bytes = b"") -> None:
        rows = [
            (0x1000, 0, DataType.UNSIGNED32, "ro", 0x00020192),
            (0x1001, 0, DataType.UNSIGNED8, "ro", 0),
            (*FILE, DataType.DOMAIN, "rw", None),
        ]
        self.dials = NodeFaults()
        self.dictionary = Dictionary(make_eds(rows), 5)
        self.server = SdoServer(self.dictionary, self.dials)
        self.content = content
        self.fate: Callable[[int, bytes], float | None] = lambda _number, _frame: 0.0
        self.frames: list[tuple[str, bytes]] = []
        self.now = 0.0
        self.session: SdoSession
        self.heard = 0.0  # when the session last got the time
        self._to_server: deque[tuple[float, bytes]] = deque()
        self._to_client: deque[tuple[float, bytes]] = deque()
        self._late: tuple[tuple[int, int], ...] = ()

    @property
    def pipes(self) -> tuple[deque[tuple[float, bytes]], deque[tuple[float, bytes]]]:
        """The frames in transit, with their due times: to the server, to the client."""
        return self._to_server, self._to_client

    @property
    def content(self) -> bytes:
        return bytes(self.dictionary.values[FILE[0] << 8])

    @content.setter
    def content(self, data: bytes) -> None:
        self.dictionary.values[FILE[0] << 8] = data

    def upload(self, transfer_type: SdoTransferType = SdoTransferType.BLOCK, tries: int = 3) -> SdoSession:
        return self.run(SdoTransferRequest(*FILE, None, TIMEOUT, tries, transfer_type))

    def download(
        self, data: bytes, transfer_type: SdoTransferType = SdoTransferType.BLOCK, tries: int = 3
    ) -> SdoSession:
        return self.run(SdoTransferRequest(*FILE, data, TIMEOUT, tries, transfer_type))

    def run(self, request: SdoTransferRequest) -> SdoSession:
        session = self.begin(request)
        while not session.done:
            self.step()
        return session

    def begin(self, request: SdoTransferRequest) -> SdoSession:
        """Send the first frames of a request; ``step`` continues until the session is done."""
        self.session = SdoSession(request, late=self._late)
        self._send(self.session.start())
        self.heard = self.now
        return self.session

    def step(self) -> None:
        """Let the next thing happen: a frame arrives at either side, or the client's patience ends."""
        session = self.session
        deadline = self.heard + session.remaining
        if self._server_is_next(deadline):
            self._serve()
        elif self._to_client and self._to_client[0][0] <= deadline:
            due, frame = self._to_client.popleft()
            self.now = max(self.now, due)
            self._send(session.receive(frame, self.now - self.heard))
            self.heard = self.now
        else:
            self.now = deadline
            self._send(session.elapse(self.now - self.heard))
            self.heard = self.now
        self._late = session.late

    def settle(self) -> None:
        """Deliver all frames in transit to the server."""
        while self._to_server:
            self._serve()

    def said(self, transfer_type: str) -> list[str]:
        """All frames of one direction ("<" are the server's) as hexadecimal text."""
        return [frame.hex() for direction, frame in self.frames if direction == transfer_type]

    def _server_is_next(self, deadline: float) -> bool:
        if not self._to_server:
            return False
        due = self._to_server[0][0]
        return due <= deadline and (not self._to_client or due <= self._to_client[0][0])

    def _serve(self) -> None:
        due, frame = self._to_server.popleft()
        self.now = max(self.now, due)
        for answer in self.server.request(frame, self.now):
            self._travel("<", answer, self._to_client)

    def _send(self, frames: Iterable[bytes]) -> None:
        for frame in frames:
            self._travel(">", frame, self._to_server)

    def _travel(self, transfer_type: str, frame: bytes, pipe: deque[tuple[float, bytes]]) -> None:
        self.frames.append((transfer_type, frame))
        delay = self.fate(len(self.frames), frame)
        if delay is not None:
            arrival = self.now + delay
            pipe.append((max(arrival, pipe[-1][0]) if pipe else arrival, frame))
