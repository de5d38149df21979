"""TIME_OF_DAY (CiA 301 7.1.6.6): milliseconds since midnight and days since 1 January 1984, as sent by the TIME service."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import NamedTuple

from axisbus.errors import ArgumentError

EPOCH = datetime(1984, 1, 1, tzinfo=UTC)
SIZE = 6  # bytes: 28 bits of milliseconds, 4 void bits, 16 bits of days
_DAY = 86_400_000
_MILLISECONDS = (1 << 28) - 1
_DAYS = (1 << 16) - 1


class TimeOfDay(NamedTuple):
    """One time: milliseconds after midnight (0 to 86399999) and days since 1984-01-01 (0 to 65535, which is in 2163).

    The standard specifies no time zone; this package sends and reads UTC.
    """

    milliseconds: int
    days: int

    @classmethod
    def of(cls, moment: datetime) -> TimeOfDay:
        """Convert a time, truncated to milliseconds.

        Raises:
            ArgumentError: it has no time zone, or is before 1984 or after 2163.
        """
        if moment.tzinfo is None:
            raise ArgumentError(
                f"{moment} has no time zone", remedy="write datetime.now(UTC), not datetime.now()"
            )
        days, rest = divmod(moment - EPOCH, timedelta(days=1))
        if not 0 <= days <= _DAYS:
            raise ArgumentError(
                f"{moment:%Y-%m-%d} cannot be sent as TIME", observed="its days cover the years 1984 to 2163"
            )
        return cls(rest // timedelta(milliseconds=1), days)

    @property
    def moment(self) -> datetime:
        """The time in UTC."""
        return EPOCH + timedelta(days=self.days, milliseconds=self.milliseconds)

    def encode(self) -> bytes:
        """Return the six bytes of a TIME message."""
        return self.milliseconds.to_bytes(4, "little") + self.days.to_bytes(2, "little")


def parse(data: bytes) -> TimeOfDay | None:
    """Read a TIME message, ignoring its void bits; None if it is too short, or its milliseconds are a day or more."""
    if len(data) < SIZE:
        return None
    milliseconds = int.from_bytes(data[:4], "little") & _MILLISECONDS
    if milliseconds >= _DAY:
        return None
    return TimeOfDay(milliseconds, int.from_bytes(data[4:6], "little"))
