"""The HTTP server that Prometheus scrapes, on one address of this computer."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from socketserver import ThreadingMixIn
from typing import Any, Protocol
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

from prometheus_client import make_wsgi_app
from prometheus_client.core import Metric
from prometheus_client.registry import Collector, CollectorRegistry

from axisbus.errors import StateError

CONNECTIONS = 32  # at once; beyond that, the oldest is closed
CONNECTION_TIMEOUT = 10.0  # seconds for one connection


class MetricsSource(Protocol):
    """A source of metric families."""

    def collect(self) -> Iterable[Metric]:
        """Return the present families."""


class _Collector(Collector):
    def __init__(self, source: MetricsSource) -> None:
        self._source = source

    def collect(self) -> Iterable[Metric]:
        return self._source.collect()

    def describe(self) -> Iterable[Metric]:
        """Return nothing: the registry must not collect values only to learn their names."""
        return ()


class _Handler(WSGIRequestHandler):
    def address_string(self) -> str:
        return str(self.client_address[0])  # without a DNS query

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002  # name of the base class
        """Log nothing."""


class _Server(ThreadingMixIn, WSGIServer):
    """Serve each connection in a thread; their number and duration are limited, also for clients that neither send nor read."""

    daemon_threads = True
    request_queue_size = CONNECTIONS

    def __init__(self, *given: Any, **more: Any) -> None:
        self._started: dict[socket.socket, float] = {}  # oldest first
        self._lock = threading.Lock()
        super().__init__(*given, **more)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve one more connection; close the oldest if there are too many."""
        with self._lock:
            for old in list(self._started)[: max(0, len(self._started) - CONNECTIONS + 1)]:
                self._end(old)
            self._started[request] = time.monotonic()
        super().process_request(request, client_address)

    def service_actions(self) -> None:
        """Close the connections that take too long; called twice a second."""
        with self._lock:
            for old, started in list(self._started.items()):
                if time.monotonic() - started > CONNECTION_TIMEOUT:
                    self._end(old)

    def _end(self, connection: socket.socket) -> None:
        """Shut the connection down, so that its thread ends; the thread closes it."""
        del self._started[connection]
        with suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection that has been served."""
        with self._lock:
            self._started.pop(request, None)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report nothing if a client disconnects during its answer."""


class _Server6(_Server):
    address_family = socket.AF_INET6


class MetricsServer:
    """Serve the families of a source until ``close``; holds its thread."""

    def __init__(self, source: MetricsSource, address: str, port: int) -> None:
        """Serve on ``address`` and ``port`` (0: a free one).

        Raises:
            StateError: the address or port cannot be used.
        """
        registry = CollectorRegistry(auto_describe=False)
        registry.register(_Collector(source))
        try:
            family, number = _resolved(address)
            kind = _Server6 if family == socket.AF_INET6 else _Server
            self._server = make_server(number, port, make_wsgi_app(registry), kind, _Handler)
        except OSError as error:
            raise StateError(
                f"metrics cannot be served on {address}:{port}",
                observed=error.strerror or str(error),
                remedy="give another --port; 0 takes a free port",
            ) from error
        self._thread = threading.Thread(
            target=self._server.serve_forever, name="axisbus-metrics", daemon=True
        )
        self._thread.start()

    @property
    def url(self) -> str:
        """The URL of the metrics."""
        address, port = self._server.server_address[:2]
        shown = f"[{address!s}]" if ":" in str(address) else str(address)
        return f"http://{shown}:{port}/metrics"

    def close(self) -> None:
        """End the server; blocks briefly."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(2.0)


def _resolved(address: str) -> tuple[int, str]:
    family, _, _, _, endpoint = socket.getaddrinfo(
        address, None, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    return family, str(endpoint[0])
