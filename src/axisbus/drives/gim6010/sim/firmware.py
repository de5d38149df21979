"""Versions of the firmware, and their differences."""

from __future__ import annotations

from typing import NamedTuple


class Firmware(NamedTuple):
    """A version; versions compare as numbers."""

    major: int
    minor: int
    revision: int

    @classmethod
    def read(cls, text: str) -> Firmware:
        """Return the version in a text like ``0.5.13``.

        Raises:
            ValueError: it is not a version of three numbers up to 255.
        """
        parts = text.split(".")
        if len(parts) != 3 or not all(
            part.isascii() and part.isdigit() and int(part) < 256 for part in parts
        ):
            raise ValueError(text)
        return cls(*(int(part) for part in parts))

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.revision}"


OLD_HEARTBEAT = Firmware(0, 5, 11)  # last version with flags in three bytes (manual 4.1.2)
SYSTEM_FLAG = Firmware(0, 5, 13)  # first version whose heartbeat has the system error flag
MIT_RANGES = Firmware(
    0, 6, 0
)  # first version with the ranges of MIT as parameters, and without effect of the watchdog
EXTENDED = Firmware(0, 6, 8)  # first version seen with the 29-bit protocol
FACTORY = Firmware(0, 5, 13)
