"""Open the Zenoh session of a cell's bridge or a fleet: explicit endpoints, short leases, no discovery unless requested."""

from __future__ import annotations

import ipaddress
import json
import logging
import os
import re
import socket
import struct
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from axisbus.errors import ArgumentError, StateError
from axisbus.optional_dependencies import require

if TYPE_CHECKING:
    import zenoh


PORT = 7447  # the usual port of Zenoh
LEASE = 0.8  # seconds without a message after which a connection counts as lost
LARGEST = 16 * 1024 * 1024  # bytes; larger messages are not accepted
_BLOCKED = 0.5  # seconds for which a message that must arrive waits for a peer that does not read, before the peer is cut off
_BATCH = 16_384  # bytes in a batch: on a slow network, a batch must be sent within _BLOCKED
_HANDSHAKE = 2.0  # seconds for the handshake of both ends; a connection in its handshake is not closed before
_MAX_HANDSHAKES = 4000  # connections in their handshake: many that never finish it must not keep others out
_ENDPOINT = re.compile(r"(tcp|tls|quic|udp|ws|unixsock-stream|vsock|serial)/[^\s?#]+(\?[^\s#]*)?(#[^\s]*)?")
_EXAMPLE = f"write it as tcp/192.168.0.10:{PORT}, or tls/cell-one.example:{PORT}"


@dataclass(frozen=True, slots=True)
class ZenohNetwork:
    """How a network is joined: endpoints to ``connect`` to and to ``listen`` on, and a ``config`` file of Zenoh (JSON5).

    ``scouting``: peers may also be found by multicast and by gossip. ``receives``: the largest accepted message in bytes. Settings
    of the file are not changed, except that given endpoints replace those of the file.
    """

    connect: tuple[str, ...] = ()
    listen: tuple[str, ...] = ()
    scouting: bool = False
    config: Path | None = None
    receives: int = LARGEST


def require_zenoh() -> None:
    """Check that the package is installed.

    Raises:
        StateError: it is not installed.
    """
    require("zenoh", "a Zenoh network needs eclipse-zenoh", "zenoh")


def require_reachable(network: ZenohNetwork) -> None:
    """Check that the endpoints are valid, and that at least one way to reach a peer is given.

    Raises:
        ArgumentError: an endpoint is invalid, or there is no endpoint, file or scouting.
    """
    for endpoint in (*network.connect, *network.listen):
        if not _ENDPOINT.fullmatch(endpoint):
            raise ArgumentError(f"{endpoint!r} is not an endpoint of Zenoh", remedy=_EXAMPLE)
    if not (network.connect or network.listen or network.scouting or network.config):
        raise ArgumentError(
            "no endpoint is given, so no cell can be reached",
            remedy=f"give one to listen at or to connect to (--listen tcp/0.0.0.0:{PORT}), a --config, or --scouting",
        )


def opened(network: ZenohNetwork) -> zenoh.Session:
    """Open a session; blocks briefly. If no peer answers at an endpoint to connect to, Zenoh keeps trying in the background.

    Raises:
        StateError: the file cannot be used, or an endpoint cannot be listened on.
        UserError: the package is not installed.
        ArgumentError: as ``require_reachable``.
    """
    require_zenoh()
    require_reachable(network)
    import zenoh

    zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]  # RUST_LOG=zenoh=debug shows what it does
    config = _config(network)
    try:
        session = zenoh.open(config)
    except Exception as error:  # zenoh has an error class of its own, and raises others too
        raise StateError(
            "the Zenoh network cannot be joined",
            observed=_short(error),
            remedy="check the endpoints: another program may already listen there; and check the files of the configuration",
        ) from error
    switch_off_linger(session)
    return session


def far_ends(network: ZenohNetwork) -> tuple[str, ...]:
    """Return the endpoints to which a session connects, each of them, as given or from its file.

    If the file makes the session a client, a connection to one of its endpoints is enough: then the result is empty.

    Raises:
        StateError: the file cannot be used.
    """
    config = _config(network)
    if not network.connect and json.loads(config.get_json("mode")) == "client":
        return ()
    found = json.loads(config.get_json("connect/endpoints"))
    ends = found.get("peer", ()) if isinstance(found, dict) else found
    return tuple(end for end in ends or () if isinstance(end, str))


def connected(session: zenoh.Session, seconds: float) -> bool:
    """Wait until a peer or router is connected, at most ``seconds``; return whether one is."""
    until = time.monotonic() + seconds
    while not (session.info.peers_zid() or session.info.routers_zid()):
        if time.monotonic() >= until:
            return False
        time.sleep(0.02)
    return True


def _config(network: ZenohNetwork) -> zenoh.Config:
    import zenoh

    try:
        config = zenoh.Config() if network.config is None else zenoh.Config.from_file(network.config)
        for key, value in _given(network).items():
            config.insert_json5(key, json.dumps(value))
        usual = zenoh.Config()
        for key, value in _settings(network).items():
            if config.get_json(key) == usual.get_json(key):  # the file does not set it
                config.insert_json5(key, json.dumps(value))
    except Exception as error:
        what = "an endpoint" if network.config is None else f"{network.config}"
        raise StateError(
            f"{what} cannot be used for a Zenoh network",
            observed=_short(error),
            remedy="it must be a configuration of Zenoh in JSON5; examples/zenoh has some to copy"
            if network.config is not None
            else _EXAMPLE,
        ) from error
    return config


def _given(network: ZenohNetwork) -> Mapping[str, Any]:
    """Return the settings that follow from the given endpoints and from scouting."""
    found: dict[str, Any] = {}
    if network.connect:
        found["connect/endpoints"] = list(network.connect)
    if network.listen:
        found["listen/endpoints"] = list(network.listen)
    elif network.config is None and not network.scouting:
        found["listen/endpoints"] = []
    if network.scouting:
        found |= {"scouting/multicast/enabled": True, "scouting/gossip/enabled": True}
    return found


def _settings(network: ZenohNetwork) -> Mapping[str, Any]:
    """Return the settings that apply unless the file sets them."""
    return {
        "mode": "peer",
        "scouting/multicast/enabled": network.scouting,
        "scouting/gossip/enabled": network.scouting,
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2},
        "transport/unicast/open_timeout": round(_HANDSHAKE * 1000),
        "transport/unicast/accept_timeout": round(_HANDSHAKE * 1000),
        "transport/unicast/accept_pending": _MAX_HANDSHAKES,
        "transport/link/tx/lease": round(LEASE * 1000),
        "transport/link/tx/queue/congestion_control/block/wait_before_close": round(_BLOCKED * 1e6),
        "transport/link/tx/batch_size": _BATCH,
        "transport/link/rx/max_message_size": network.receives,
        "transport/shared_memory/enabled": False,
    }


def _short(error: Exception) -> str:
    """Return Zenoh's message without the locations in its source code."""
    return re.sub(r" at /\S+:\d+\.?", "", str(error)).strip()


# -- Close connections of Zenoh without waiting, so that a far end that is cut off does not block other connections ----
#
# Zenoh sets SO_LINGER: when it closes a TCP connection, the system waits up to 10 s until the far end has taken the data sent. If
# the far end is cut off, a thread of Zenoh that other connections need blocks meanwhile. New connections are not accepted, and if
# several far ends are cut off at once, no message of any peer is received. So this module switches lingering off for each new
# connection. The system still sends the remaining data.


log = logging.getLogger("axisbus")
_FILES = Path("/proc/self/fd")
_OFF = struct.pack("ii", 0, 0)
_PROTOCOLS = frozenset({"tcp", "tls"})


def switch_off_linger(session: Any) -> None:
    """Switch lingering off for all present and future connections of a session. Only on Linux does closing wait at all."""
    import zenoh

    def changed(event: Any) -> None:
        if event.kind == zenoh.SampleKind.PUT:
            _switch_off_linger_of(str(event.link.src), str(event.link.dst))

    if _FILES.is_dir():
        session.info.declare_link_events_listener(changed, history=True)


def _switch_off_linger_of(near: str, far: str) -> None:
    try:
        ends = _end(near), _end(far)
        if None not in ends:
            for file in _FILES.iterdir():
                _switch_off(int(file.name), ends)
    except Exception:  # a thread of zenoh calls this
        log.exception("a connection could not be inspected")


def _switch_off(number: int, ends: tuple[Any, Any]) -> None:
    """Switch lingering off for an open file if it is the connection between these two ends."""
    with suppress(OSError), _connection(number) as one:  # already closed, not a socket, or not connected
        if one.type == socket.SOCK_STREAM and _ends(one) == ends:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _OFF)


def _connection(number: int) -> socket.socket:
    """Return a duplicate of an open file as a socket: the number may be reused for another file, the duplicate stays valid."""
    duplicate = os.dup(number)
    try:
        return socket.socket(fileno=duplicate)
    except OSError:
        os.close(duplicate)
        raise


def _ends(one: socket.socket) -> Any:
    if one.family not in (socket.AF_INET, socket.AF_INET6):
        return None
    return tuple((_address(name[0]), name[1]) for name in (one.getsockname(), one.getpeername()))


def _end(link_end: str) -> tuple[Any, int] | None:
    """Return the address and port of an end as Zenoh writes it; None if it has another protocol."""
    protocol, _, rest = link_end.partition("?")[0].partition("#")[0].partition("/")
    host, _, port = rest.rpartition(":")
    return (_address(host.strip("[]")), int(port)) if protocol in _PROTOCOLS else None


def _address(host: str) -> Any:
    return ipaddress.ip_address(host.partition("%")[0])
