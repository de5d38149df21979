"""How much a browser may send: messages by size (rate: ``client_support.rate``), sockets by number; a stop is never counted."""

from __future__ import annotations

MESSAGE = 4096  # bytes of a message to us
FOREIGN_MESSAGE = 65_536  # bytes of a message or a request to the library of the page
FILE = 2 * 1024 * 1024  # bytes of a DCF
SAMPLES = 7 * 1024 * 1024  # bytes of what a scope shows
BRING_FILE, SAVE_SAMPLES = "/config/file", "/scope/mcap"
LONGER = {
    BRING_FILE: FILE,
    SAVE_SAMPLES: SAMPLES,
}  # by path, what a request may bring where it may bring more
SOCKETS = 64  # two for each open page, and one for its scope; of all browsers together
SOCKETS_OF_BROWSER = 32  # of one browser
SOCKETS_ALWAYS = 6  # that a browser may have however many the others have
PAGES, PAGES_AT_ONCE = (
    1.0,
    10.0,
)  # that one browser may load each second, and at once: each is built by the server
CONNECTIONS = 128  # that are no sockets of pages


def most_bytes(path: str) -> int:
    """Return how much a request of a path may bring."""
    return LONGER.get(path, FOREIGN_MESSAGE)
