"""Watchdogs of a node for its master: heartbeat consumer (1016h) and life guarding (100Ch, 100Dh)."""

from __future__ import annotations

_UNSEEN = -1.0


class HeartbeatConsumer:
    """Monitored producers, and the time of their last heartbeat; monitoring begins with the first heartbeat."""

    def __init__(self) -> None:
        self._limits: dict[int, float] = {}
        self._heard: dict[int, float] = {}
        self._lost: set[int] = set()

    @property
    def armed(self) -> frozenset[int]:
        """Node IDs of the monitored producers."""
        return frozenset(self._limits)

    def configure(self, values: list[int]) -> None:
        """Take the values of 1016h: node ID in bits 16 to 23, time in ms in bits 0 to 15; 0: off."""
        limits = {}
        for value in values:
            node, time = value >> 16 & 0xFF, value & 0xFFFF
            if node and time:
                limits[node] = time / 1000.0
        self._heard = {
            node: stamp for node, stamp in self._heard.items() if limits.get(node) == self._limits[node]
        }
        self._limits = limits
        self._lost &= set(limits)

    def beat(self, node: int, now: float) -> bool:
        """Process a heartbeat of ``node``; return True if it had been lost."""
        if node not in self._limits:
            return False
        self._heard[node] = now
        if node in self._lost:
            self._lost.discard(node)
            return True
        return False

    def overdue(self, now: float) -> bool:
        """Return whether a producer was lost since the last call."""
        found = False
        for node, stamp in self._heard.items():
            if node not in self._lost and now - stamp > self._limits[node]:
                self._lost.add(node)
                found = True
        return found

    def reset(self) -> None:
        """Restart monitoring: wait for the first heartbeat."""
        self._heard.clear()
        self._lost.clear()


class LifeGuard:
    """Node guarding at the node's side: answers requests, and detects when they stop."""

    def __init__(self) -> None:
        self._limit = 0.0
        self._stamp = _UNSEEN
        self._toggle = 0

    def configure(self, guard_time: int, factor: int) -> None:
        """Take 100Ch (ms) and 100Dh; a product of 0: off."""
        self._limit = guard_time * factor / 1000.0

    def answer(self, state: int, now: float) -> bytes:
        """Return the answer to a guarding request: NMT state and toggle bit."""
        data = bytes([state & 0x7F | self._toggle])
        self._toggle ^= 0x80
        self._stamp = now
        return data

    def overdue(self, now: float) -> bool:
        """Return whether requests have stopped, once."""
        if self._limit <= 0.0 or self._stamp == _UNSEEN or now - self._stamp <= self._limit:
            return False
        self._stamp = _UNSEEN
        return True

    def reset(self) -> None:
        """Restart: toggle bit 0, wait for the first request."""
        self._stamp = _UNSEEN
        self._toggle = 0
