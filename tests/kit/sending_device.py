"""Another device on a virtual channel, which sends in a thread of its own while its block lasts."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from typing import Self

import can


class Talker(ABC):
    """``_talk`` runs until ``_over`` is set, and sends on ``_bus``."""

    def __init__(self, channel: str) -> None:
        self._bus = can.Bus(interface="virtual", channel=channel)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._talk, name=type(self).__name__, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(5.0)
        self._bus.shutdown()

    @abstractmethod
    def _talk(self) -> None:
        """Send."""
