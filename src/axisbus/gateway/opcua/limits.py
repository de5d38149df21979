"""How much clients may take, all together and each: connections, sessions, subscriptions, messages, tries of a password."""

from __future__ import annotations

CONNECTIONS = 64
SESSIONS = 50
SUBSCRIPTIONS = 64
MONITORED = 2_000  # items of one subscription
QUEUE = 100  # values that wait for a subscriber, of each item
UNACKNOWLEDGED = 20  # messages that are kept for one subscription
CHUNK = 65_535  # bytes
MESSAGE = 1 << 20  # bytes of a request
UNREAD = 4 << 20  # bytes that wait for a client that does not read
PENDING = 500  # requests that come from one client at once
WAITING = 20  # of which so many wait before more is read from it
PATIENCE = 10.0  # seconds for a connection to become a session, and for one that does not read
SESSION_MS = 120_000  # after which a session of which nothing is heard has ended
FASTEST_MS, SLOWEST_MS = 20.0, 60_000.0  # between two messages of a subscription
LIFETIME = 1_200  # such times without a client that takes them
OPERANDS = 64  # elements of the filter of an event
READS, BROWSES, CALLS = 500, 200, 16  # nodes of one request
TRIES, TRIES_AT_ONCE = (
    1.0,
    5.0,
)  # wrong passwords that are looked at, from one address: each second, and at once
ADDRESSES = 256  # of which that is known
HALTING = 15.0  # seconds that a method waits for its command
