"""The HTTP server that Prometheus asks, on one address of this computer."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from typing import Protocol
from wsgiref.simple_server import WSGIServer

from prometheus_client import start_http_server
from prometheus_client.core import Metric
from prometheus_client.registry import Collector, CollectorRegistry

from axisbus.errors import StateError


class Source(Protocol):
    """What has families."""

    def collect(self) -> Iterable[Metric]:
        """Return them as they are now."""


class _Collector(Collector):
    def __init__(self, source: Source) -> None:
        self._source = source

    def collect(self) -> Iterable[Metric]:
        return self._source.collect()

    def describe(self) -> Iterable[Metric]:
        """Nothing: the registry is not to ask for values in order to know their names."""
        return ()


class MetricsServer:
    """Serves the families of a source until ``close``; holds its thread."""

    def __init__(self, source: Source, address: str, port: int) -> None:
        """Serve on ``address`` and ``port`` (0: one that is free).

        Raises:
            StateError: it cannot be served there.
        """
        registry = CollectorRegistry(auto_describe=False)
        registry.register(_Collector(source))
        self._server: WSGIServer
        self._thread: threading.Thread
        try:
            self._server, self._thread = start_http_server(port, address, registry)
        except OSError as error:
            raise StateError(
                f"metrics cannot be served on {address}:{port}",
                observed=error.strerror or str(error),
                remedy="give another --port; 0 takes one that is free",
            ) from error

    @property
    def url(self) -> str:
        """Where they are."""
        address, port = self._server.server_address[:2]
        return f"http://{address!s}:{port}/metrics"

    def close(self) -> None:
        """End it; blocks for a moment."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(2.0)
