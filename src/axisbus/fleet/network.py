"""A session of Zenoh as the bridge of a cell and a fleet open it: explicit endpoints, short leases, nothing found by itself."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from axisbus.errors import ArgumentError, StateError
from axisbus.fleet.nonblocking_close import never_linger
from axisbus.optional_dependencies import require

if TYPE_CHECKING:
    import zenoh

PORT = 7447  # by which Zenoh is known
LEASE = 0.8  # seconds without a word after which the far end of a connection is gone
LARGEST = 16 * 1024 * 1024  # bytes of a message that is taken
_BLOCKED = 0.5  # seconds that what must arrive waits for one who does not read, before he is cut off
_BATCH = 16_384  # bytes in a piece: on a slow network one must have left within that time
_HANDSHAKE = 2.0  # seconds until both ends must have greeted; one that tries to is not closed before
_GREETING = 4000  # connections that have not greeted yet: a crowd that never does must not keep others out
_ENDPOINT = re.compile(r"(tcp|tls|quic|udp|ws|unixsock-stream|vsock|serial)/[^\s?#]+(\?[^\s#]*)?(#[^\s]*)?")
_EXAMPLE = f"write it as tcp/192.168.0.10:{PORT}, or tls/cell-one.example:{PORT}"


@dataclass(frozen=True, slots=True)
class ZenohNetwork:
    """How a network is joined: endpoints to ``connect`` to and to ``listen`` on, and a ``config`` file of Zenoh (JSON5).

    ``scouting``: others may also be found by multicast and by gossip. ``receives``: bytes of a message that is taken. What the file
    says is left as it is; endpoints that are given replace its own.
    """

    connect: tuple[str, ...] = ()
    listen: tuple[str, ...] = ()
    scouting: bool = False
    config: Path | None = None
    receives: int = LARGEST


def require_zenoh() -> None:
    """Check that the package is installed.

    Raises:
        StateError: it is not.
    """
    require("zenoh", "a Zenoh network needs eclipse-zenoh", "zenoh")


def require_reachable(network: ZenohNetwork) -> None:
    """Check that somebody could be reached at all, and that the endpoints are some.

    Raises:
        ArgumentError: no endpoint is given, or one that is none.
    """
    for endpoint in (*network.connect, *network.listen):
        if not _ENDPOINT.fullmatch(endpoint):
            raise ArgumentError(f"{endpoint!r} is no endpoint of Zenoh", remedy=_EXAMPLE)
    if not (network.connect or network.listen or network.scouting or network.config):
        raise ArgumentError(
            "no endpoint is given, so nobody could be reached",
            remedy=f"give one to listen on or to connect to (--listen tcp/0.0.0.0:{PORT}), a --config, or --scouting",
        )


def opened(network: ZenohNetwork) -> zenoh.Session:
    """Open a session; blocks for a moment. Where nobody is at an endpoint to connect to, it is tried again and again meanwhile.

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
    except Exception as error:  # it has one kind, and raises others too
        raise StateError(
            "the Zenoh network cannot be joined",
            observed=_short(error),
            remedy="look at the endpoints: another program may listen there already; and at the files of the configuration",
        ) from error
    never_linger(session)
    return session


def far_ends(network: ZenohNetwork) -> tuple[str, ...]:
    """Return the endpoints that a session connects to each of, by what is given or by its file.

    A client by its file is content with one of those in it: then they are none.

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
    """Wait until somebody is connected, at most so many seconds; return whether somebody is."""
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
            if config.get_json(key) == usual.get_json(key):  # the file says nothing of it
                config.insert_json5(key, json.dumps(value))
    except Exception as error:
        what = "an endpoint" if network.config is None else f"{network.config}"
        raise StateError(
            f"{what} cannot be used for a Zenoh network",
            observed=_short(error),
            remedy="it is to be a configuration of Zenoh in JSON5; examples/zenoh has some to copy"
            if network.config is not None
            else _EXAMPLE,
        ) from error
    return config


def _given(network: ZenohNetwork) -> Mapping[str, Any]:
    """Return what was asked for on purpose."""
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
    """Return what is so where a file does not say otherwise."""
    return {
        "mode": "peer",
        "scouting/multicast/enabled": network.scouting,
        "scouting/gossip/enabled": network.scouting,
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2},
        "transport/unicast/open_timeout": round(_HANDSHAKE * 1000),
        "transport/unicast/accept_timeout": round(_HANDSHAKE * 1000),
        "transport/unicast/accept_pending": _GREETING,
        "transport/link/tx/lease": round(LEASE * 1000),
        "transport/link/tx/queue/congestion_control/block/wait_before_close": round(_BLOCKED * 1e6),
        "transport/link/tx/batch_size": _BATCH,
        "transport/link/rx/max_message_size": network.receives,
        "transport/shared_memory/enabled": False,
    }


def _short(error: Exception) -> str:
    """Return what Zenoh says without the places in its own source."""
    return re.sub(r" at /\S+:\d+\.?", "", str(error)).strip()
