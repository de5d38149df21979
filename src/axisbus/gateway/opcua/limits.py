"""How much clients may take, all together and each: connections, sessions, subscriptions and messages."""

from __future__ import annotations

from typing import NamedTuple


class ConnectionLimits(NamedTuple):
    """How many one address may have of each; sessions and subscriptions: of clients without a name."""

    connections: int
    sessions: int
    subscriptions: int


CONNECTIONS = 64
SESSIONS = 40  # of clients without a name; those with one have as many beside them
SUBSCRIPTIONS, NAMELESS_SUBSCRIPTIONS = 64, 48  # of all; of clients without a name
OF_ADDRESS = ConnectionLimits(48, 32, 40)
MONITORED = 2_000  # items of one subscription
ALL_MONITORED, NAMELESS_MONITORED = 20_000, 16_000  # of all; of clients without a name
QUEUE = 100  # values that wait for a subscriber, of each item
UNACKNOWLEDGED = 20  # messages that are kept for one subscription
CHUNK, LEAST_CHUNK = 65_535, 8_192  # bytes; what a client must be able to take at least (OPC 10000-6 7.1.2.3)
MESSAGE = 1 << 20  # bytes of a request
PIECES = 60_000  # numbers, texts and the like of a request: 2,000 items to monitor have 40,000
UNREAD = 4 << 20  # bytes that wait for a client that does not read
PENDING = 500  # requests that come from one client at once
WAITING = 20  # of which so many wait before more is read from it
PATIENCE = 10.0  # seconds for a connection to become a session, and for one that does not read
SESSION_MS = 120_000  # after which a session of which nothing is heard has ended
FASTEST_MS, SLOWEST_MS = 20.0, 60_000.0  # between two messages of a subscription
LIFETIME = 1_200  # such times without a client that takes them
OPERANDS = 64  # elements of the filter of an event
READS, BROWSES, CALLS, ITEMS = 500, 200, 16, 2_000  # nodes of one request, which clients are told
REFERENCES = 5_000  # that are told for one request: some 600 kB
ANSWER = 1 << 20  # bytes of values for one request
LARGE = (
    32_768  # bytes of a value that cannot be subscribed to: the standard's own dictionaries have some 300,000
)
WRONG = 1.0  # seconds until a wrong password is refused: one connection tries no more often
HALTING = 15.0  # seconds that a method waits for its command
