"""Limits for browsers: the size of messages (rate: ``ipc.rate``), the number of sockets; stops are not counted."""

from __future__ import annotations

import json
from typing import Any

MESSAGE = 4096  # bytes of a message to this server
FOREIGN_MESSAGE = 65_536  # bytes of a message or a request to the page's library
FILE = 2 * 1024 * 1024  # bytes of a DCF
SAMPLES = 7 * 1024 * 1024  # bytes of the samples that a scope shows
UPLOAD_FILE, SAVE_SAMPLES = "/config/file", "/scope/mcap"
LONGER = {
    UPLOAD_FILE: FILE,
    SAVE_SAMPLES: SAMPLES,
}  # bytes by path, for requests that may be larger
SOCKETS = 64  # of all browsers together: two for each open page, and one for its scope
SOCKETS_OF_BROWSER = 32  # of one browser
SOCKETS_ALWAYS = 6  # that a browser may have whatever the number of the others
PAGES, PAGES_AT_ONCE = (
    1.0,
    10.0,
)  # that a browser may load per second, and at once: the server builds each of them
CONNECTIONS = 128  # without the sockets of pages


def max_bytes(path: str) -> int:
    """Return how many bytes a request for this path may have."""
    return LONGER.get(path, FOREIGN_MESSAGE)


# -- Decode a message of a browser as a JSON object --------------------------------------------------------------------


def as_object(text: str) -> dict[str, Any] | None:
    """Return the object in a text; None if it is not a JSON object."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None
