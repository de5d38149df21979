"""Limits for clients, in total and each: connections, sessions, subscriptions and messages."""

from __future__ import annotations

from typing import NamedTuple


class ConnectionLimits(NamedTuple):
    """The limits for one address; sessions and subscriptions: those of clients without a name."""

    connections: int
    sessions: int
    subscriptions: int


CONNECTIONS = 64
SESSIONS = 40  # of clients without a name; clients with a name have the same number in addition
SUBSCRIPTIONS, NAMELESS_SUBSCRIPTIONS = 64, 48  # of all; of clients without a name
OF_ADDRESS = ConnectionLimits(48, 32, 40)
MONITORED = 2_000  # items of one subscription
ALL_MONITORED, NAMELESS_MONITORED = 20_000, 16_000  # of all; of clients without a name
NAMELESS_OF_VARIABLE = 2_000  # items of one variable beyond which clients without a name get none
NOTIFICATIONS = 1_000  # waiting values of one message, apart from the rest of those of an item
QUEUE = 100  # waiting values of each item
NAMELESS_WAITING = 4_000  # waiting values of a subscription of a client without a name
NAMELESS_EVENTS = 200  # items for events of all clients, beyond which clients without a name get none
UNACKNOWLEDGED = 20  # stored messages of one subscription
CHUNK, LEAST_CHUNK = 65_535, 8_192  # bytes; the least that a client must accept (OPC 10000-6 7.1.2.3)
MESSAGE = 1 << 20  # bytes of a request
PIECES = 60_000  # numbers, texts and the like of a request: 2,000 items to monitor have 40,000
UNREAD = 4 << 20  # waiting bytes for a client that does not read
PENDING = 500  # simultaneous requests of one client
WAITING = 20  # waiting requests of a client before reading from it is paused
PATIENCE = 10.0  # seconds for a connection to get a session, and for a client that does not read
SESSION_MS = 120_000  # after which a silent session ends
FASTEST_MS, SLOWEST_MS = 20.0, 60_000.0  # the range of publishing intervals of a subscription
LIFETIME = 1_200  # publishing intervals without a request of the client, after which a subscription ends
OPERANDS = 64  # elements of the filter of an event
READS, BROWSES, CALLS, ITEMS = 500, 200, 16, 2_000  # nodes of one request, reported to clients
REFERENCES = 5_000  # in the answer to one request: some 600 kB
ANSWER = 1 << 20  # bytes of values in the answer to one request
# bytes of a value that cannot be subscribed to: the standard's own dictionaries have some 300,000
LARGE = 32_768
WRONG = 1.0  # seconds until a wrong password is refused, which limits the attempts of one connection
HALTING = 15.0  # seconds that a method waits for its command
REFUSALS = 10.0, 100.0  # events about failed methods of a user: per second, and at once
WAITING_CALLS = 200  # methods of a user that wait for their commands; further ones are answered at once
