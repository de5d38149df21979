"""A client of the page's server without a browser: by requests, and by its sockets."""

from __future__ import annotations

import http.client

from websockets.sync.client import ClientConnection, connect


class Client:
    """A client that enters by a link, without a browser; holds the cookie."""

    def __init__(self, link: str) -> None:
        self.origin, _, self.path = link.partition("/enter")
        self.host = self.origin.partition("//")[2]
        self.headers = {"Origin": self.origin}
        answer = self.ask("/enter" + self.path, Origin="")
        self.headers["Cookie"] = str(answer.getheader("set-cookie")).partition(";")[0]

    def ask(
        self, path: str, method: str = "GET", body: str = "", seconds: float = 5.0, **headers: str
    ) -> http.client.HTTPResponse:
        """Send a request; an empty header is left out."""
        connection = http.client.HTTPConnection(self.host, timeout=seconds)
        given = {name: value for name, value in {**self.headers, **headers}.items() if value}
        connection.request(method, path, body or None, given)
        answer = connection.getresponse()
        answer.read()
        connection.close()
        return answer

    def page(self, path: str = "/live", queue: int | None = None, **headers: str) -> ClientConnection:
        """Open a socket of the page; one with a ``queue`` stops reading when so many messages wait."""
        given = {name: value for name, value in {**self.headers, **headers}.items() if value}
        origin = given.pop("Origin", None)
        url = f"ws://{self.host}{path}"
        return connect(
            url,
            origin=origin,
            additional_headers=given,
            max_size=None,
            max_queue=queue,
            compression=None,
            close_timeout=0.1,
        )
