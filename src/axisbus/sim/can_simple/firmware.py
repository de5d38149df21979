"""Versions of the firmware, and what depends on them."""

from __future__ import annotations

from typing import NamedTuple


class Firmware(NamedTuple):
    """A version; they compare as numbers."""

    major: int
    minor: int
    revision: int

    @classmethod
    def read(cls, text: str) -> Firmware:
        """Return the version that a text like ``0.5.13`` gives.

        Raises:
            ValueError: it is no version of three numbers up to 255.
        """
        parts = text.split(".")
        if len(parts) != 3 or not all(
            part.isascii() and part.isdigit() and int(part) < 256 for part in parts
        ):
            raise ValueError(text)
        return cls(*(int(part) for part in parts))

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.revision}"


OLD_HEARTBEAT = Firmware(0, 5, 11)  # the last one with flags in three bytes (manual 4.1.2)
SYSTEM_FLAG = Firmware(0, 5, 13)  # the first whose heartbeat has the flag of the system's errors
MIT_RANGES = Firmware(
    0, 6, 0
)  # the first in which the ranges of MIT are parameters, and the watchdog does nothing
EXTENDED = Firmware(0, 6, 8)  # the first that was seen with the 29-bit protocol
FACTORY = Firmware(0, 5, 13)
