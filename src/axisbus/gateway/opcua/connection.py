"""The connections of the server: their limits, which one is closed if there are too many, and protection against bad clients."""

from __future__ import annotations

import asyncio
import logging
import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

from asyncua import ua
from asyncua.common.connection import TransportLimits
from asyncua.common.utils import Buffer
from asyncua.server import subscription_service
from asyncua.server.binary_server_asyncio import BinaryServer, OPCUAProtocol
from asyncua.server.uaprocessor import UaProcessor
from asyncua.ua import ua_binary
from asyncua.ua.ua_binary import nodeid_from_binary, struct_from_binary

from axisbus.gateway.opcua import limits
from axisbus.gateway.opcua.limited_server import CHECKED, GuardedServer
from axisbus.gateway.opcua.monitoring import LimitedSubscription

log = logging.getLogger("axisbus")
_KINDS = (b"HEL", b"OPN", b"MSG", b"CLO", b"ERR")
_HEADER = 8  # octets: kind, chunk, and length
_ACTIVATES = ua.NodeId(ua.ObjectIds.ActivateSessionRequest_Encoding_DefaultBinary)
_CALLS = ua.NodeId(ua.ObjectIds.CallRequest_Encoding_DefaultBinary)
_CHECK_PERIOD = 1.0  # seconds between two checks for an active session


class GuardedProcessor(UaProcessor):
    """Process the messages of a connection.

    A password is checked first, because asyncua would block all other clients for that. Methods of a user are called in tasks of
    their own: a stop must not wait until an earlier call of the same connection ends. All other requests of clients wait for each
    other (``GuardedServer.await_lock``), so that no stop waits for many of them.
    """

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._calls: set[asyncio.Task[None]] = set()

    async def process_message(self, seqhdr: Any, body: Any) -> Any:
        """Process a message."""
        session = self.session
        if session is not None and session.is_activated():
            if session.is_named and nodeid_from_binary(body.copy()) == _CALLS:
                call = asyncio.get_running_loop().create_task(self._call(seqhdr, body))
                self._calls.add(call)
                call.add_done_callback(self._calls.discard)
                return True
            await self.iserver.await_lock(named=session.is_named)
            allow(limits.PIECES)
        given = self._given(body.copy())
        right = given is not None and await self.iserver.gate.check(*given)
        token = CHECKED.set(None if given is None else (*given, right))
        try:
            return await super().process_message(seqhdr, body)
        finally:
            CHECKED.reset(token)

    async def _call(self, seqhdr: Any, body: Any) -> None:
        """Call methods, and answer when they have ended."""
        allow(limits.PIECES)
        if not await super().process_message(seqhdr, body):
            self._transport.close()

    def _given(self, body: Any) -> tuple[str, str] | None:
        """Return the name and the password of a request to activate a session; None if it is another request."""
        if nodeid_from_binary(body) != _ACTIVATES:
            return None
        header = struct_from_binary(ua.RequestHeader, body)
        token = struct_from_binary(ua.ActivateSessionParameters, body).UserIdentityToken
        session = self.session or self.iserver.lookup_external_session(header.AuthenticationToken)
        if session is None or not isinstance(token, ua.UserNameIdentityToken):
            return None
        try:
            return self.iserver.decrypt_user_token(session, token)
        except Exception:  # noqa: BLE001  # asyncua refuses it with the status code of the standard
            return None


class GuardedProtocol(OPCUAProtocol):
    """One connection: closed if its data are not OPC UA or too long, if no session is activated, or if the client does not read."""

    _unread: asyncio.TimerHandle | None = None
    _check_timer: asyncio.TimerHandle | None = None
    _since = 0.0  # when it last had an active session, or began
    _hello_received = False
    _paused = False  # reading is paused until the waiting messages are processed

    @property
    def is_in(self) -> bool:
        """Whether the connection has an activated session that has not ended."""
        if self.processor is None or self.processor.session is None:
            return False
        session, last_message = self.processor.session, self.processor.session_last_activity
        silent = last_message is not None and time.monotonic() - last_message > (
            session.session_timeout or 0.0
        )
        return session.is_activated() and not silent  # its client may have moved to another connection

    def connection_made(self, transport: Any) -> None:
        """Accept the connection if there is room."""
        peer = transport.get_extra_info("peername")
        of_address = [] if peer is None else [each for each in self.clients if each.peer_name[0] == peer[0]]
        if (
            peer is None
            or not self._admits(of_address, limits.OF_ADDRESS.connections)
            or not self._admits(self.clients, limits.CONNECTIONS)
        ):
            transport.abort()
            return
        super().connection_made(transport)
        self.processor = GuardedProcessor(self.iserver, self.transport, self.limits)
        self.processor.set_policies(self.policies)
        self._since = time.monotonic()
        self._check_session()

    def _admits(self, lines: list[OPCUAProtocol], limit: int) -> bool:
        """Return whether one more connection fits; if not, close the oldest without an activated session (OPC 10000-4 5.5.2.1).

        Connections without a session are closed first; then those whose session waits for its password to be checked.
        """
        if len(lines) < limit:
            return True
        without_session = [each for each in lines if isinstance(each, GuardedProtocol) and not each.is_in]
        oldest = min(without_session, key=GuardedProtocol.has_session, default=None)
        if oldest is None or oldest.transport is None:
            return False
        self.clients.remove(oldest)
        oldest.transport.abort()
        return True

    def has_session(self) -> bool:
        """Whether a session was created on it."""
        return self.processor is not None and self.processor.session is not None

    def _check_session(self) -> None:
        """Close the connection if it has had no active session for too long: none was activated, or it has ended."""
        transport, now = self.transport, time.monotonic()
        if transport is None:
            return
        if self.is_in and not transport.is_closing():
            self._since = now
        elif now - self._since > limits.PATIENCE:
            transport.abort()
            return
        self._check_timer = asyncio.get_running_loop().call_later(_CHECK_PERIOD, self._check_session)

    def data_received(self, data: bytes) -> None:
        """Process received data if they can be the beginning of a message."""
        super().data_received(data)
        if self.transport is None or self.transport.is_closing():
            return
        if self._is_wrong():
            self.transport.abort()
        elif not self._paused and self.messages.qsize() > limits.WAITING:
            self._paused = True
            self.transport.pause_reading()

    async def _process_one_msg(self, header: Any, buf: Any) -> bool:
        continues = await self._processed(header, buf)
        if not continues and self.transport is not None:
            self.transport.close()
        if self._paused and self.messages.qsize() <= limits.WAITING // 2 and self.transport is not None:
            self._paused = False
            if not self.transport.is_closing():
                self.transport.resume_reading()
        return continues

    async def _processed(self, header: Any, buf: Any) -> bool:
        """Process a message, return whether the connection continues; asyncua would also continue after an unreadable message."""
        await asyncio.sleep(0)  # other connections are served between two messages of this one
        allow(limits.PIECES)
        try:
            return self._is_permitted(header, buf) and bool(await super()._process_one_msg(header, buf))
        except Exception:
            log.debug("OPC UA: a message cannot be decoded", exc_info=True)
            return False

    def _is_permitted(self, header: Any, buf: Any) -> bool:
        """Return whether a message is permitted now: asyncua would accept one even without an open channel."""
        if header.MessageType == ua.MessageType.Hello:
            return self._is_valid_hello(buf)
        if header.MessageType in (ua.MessageType.SecureMessage, ua.MessageType.SecureClose):
            return self.processor is not None and bool(self.processor._connection.is_open())
        return True

    def _is_valid_hello(self, buf: Any) -> bool:
        """Return whether it is the first Hello, and its buffers are as large as required (OPC 10000-6 7.1.2.3)."""
        _, receives, sends = struct.unpack_from("<III", bytes(buf))
        repeated, self._hello_received = self._hello_received, True
        return not repeated and min(receives, sends) >= limits.LEAST_CHUNK

    def _is_wrong(self) -> bool:
        """Return whether the remaining data are no beginning of a message, or the client has too much unread data."""
        assert self.transport is not None
        unread = self._buffer
        length = int.from_bytes(unread[4:_HEADER], "little") if len(unread) >= _HEADER else 0
        kind = bool(unread) and not any(each.startswith(unread[:3]) for each in _KINDS)
        return kind or length > limits.CHUNK or self.transport.get_write_buffer_size() > limits.UNREAD

    def pause_writing(self) -> None:
        """Note that the client reads too slowly: close the connection unless it catches up in time."""
        loop = asyncio.get_running_loop()
        if self._unread is None and self.transport is not None:
            self._unread = loop.call_later(limits.PATIENCE, self.transport.abort)

    def resume_writing(self) -> None:
        """Note that the client has caught up."""
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None

    def connection_lost(self, ex: BaseException | None) -> None:
        """Note that the connection has ended."""
        self.resume_writing()
        if self._check_timer is not None:
            self._check_timer.cancel()
        super().connection_lost(ex)


class GuardedListener(BinaryServer):
    """Listen on a socket that is already bound, and make guarded connections."""

    def __init__(self, server: GuardedServer, listening: socket.socket) -> None:
        address, port = listening.getsockname()[:2]
        sizes = TransportLimits(
            limits.CHUNK, limits.CHUNK, limits.MESSAGE // limits.CHUNK + 1, limits.MESSAGE
        )
        super().__init__(server, address, port, sizes)
        self._listening = listening
        server.connections = self.clients

    def _make_protocol(self) -> OPCUAProtocol:
        return GuardedProtocol(self.iserver, self._policies, self.clients, self.closing_tasks, self.limits)

    async def start(self) -> None:
        """Start listening."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(self._make_protocol, sock=self._listening)
        self.cleanup_task = asyncio.create_task(self._close_task_loop())

    async def stop(self) -> None:
        """Close every connection, including those of clients that do not read, and stop listening."""
        for client in list(self.clients):
            if client.transport is not None:
                client.transport.abort()
        await super().stop()


# -- Limit asyncua's decoder: the lengths in a message must not cost more memory or time than its size permits ---------
#
# Theory of operation
# asyncua trusts the lengths in a message. A negative length moves backwards, so that a short message is read for ever, and an
# array of null values may claim two thousand million elements. Any client that reaches the port can send such messages, before it
# is authenticated. Here a negative length is an error, an array has at most as many elements as octets are left (of null values:
# none), and each message in the server's thread is decoded in at most the number of pieces given to ``allow``.


_Unpack = Callable[[Any], Any]
_read = Buffer.read
_arrays, _lists = ua_binary._create_uatype_array_deserializer, ua_binary._create_list_deserializer
_remaining = (
    threading.local()
)  # ``pieces`` left for the present message; unset in other threads, such as a client's


def allow(pieces: int) -> None:
    """Set the number of pieces in which the next message of this thread may be decoded."""
    _remaining.pieces = pieces


def _refused(why: str) -> Exception:
    return ua.uaerrors.BadDecodingError(why)


def _read_checked(buffer: Buffer, size: int) -> bytes:
    if size < 0:
        raise _refused("a length below zero")
    pieces = getattr(_remaining, "pieces", None)
    if pieces is not None:
        if pieces <= 0:
            raise _refused("too many chunks")
        _remaining.pieces = pieces - 1
    return _read(buffer, size)


def _bounded(unpack: _Unpack, null_values: bool = False) -> _Unpack:
    """Return an array decoder that checks whether the elements can fit into the remaining octets."""

    def unpacked(data: Any) -> Any:
        start = data.copy()
        length = ua_binary.Primitives.Int32.unpack(start)
        if length > (0 if null_values else len(start)):
            raise _refused("an array that is longer than its message")
        return unpack(data)

    return unpacked


def _array(kind: Any) -> _Unpack:
    return _bounded(_arrays(kind), kind is ua.VariantType.Null)


def _list(kind: Any) -> _Unpack:
    return _bounded(_lists(kind))


def install() -> None:
    """Install the limits in asyncua for the whole process; harmless when repeated."""
    Buffer.read = _read_checked
    ua_binary._create_uatype_array_deserializer = _array
    ua_binary._create_list_deserializer = _list
    subscription_service.InternalSubscription = LimitedSubscription
    for cached in (ua_binary._create_type_deserializer, ua_binary._create_dataclass_deserializer):
        cached.cache_clear()  # decoders made before have no limits
