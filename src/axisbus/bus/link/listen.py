"""Listen to a bus without sending: every frame of an adapter as it comes, remote and error frames included."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import can

from axisbus.bus.link import adapter, controller, failures, socketcan
from axisbus.bus.link.frame_files import of_message
from axisbus.cia301.frame import CanFrame

_SLICE = 0.1  # seconds; the maximum delay until a stop is noticed


class Listener:
    """An open adapter that only receives; holds state: the adapter. axisbus sends nothing on it, not even an error frame."""

    def __init__(self, bus: can.BusABC, name: str) -> None:
        self._bus = bus
        self._name = name
        self._linux_classes = name.partition(":")[0] in controller.LINUX_CLASSES

    def frames(self, seconds: float | None = None) -> Iterator[CanFrame]:
        """Yield frames as they come, for ``seconds`` (None: for ever); blocks between them.

        Raises:
            AdapterError: the adapter failed.
        """
        end = None if seconds is None else time.monotonic() + seconds
        while (left := _SLICE if end is None else end - time.monotonic()) > 0:
            try:
                message = self._bus.recv(min(left, _SLICE))
            except Exception as error:  # drivers raise anything
                raise failures.receive_failed(self._name, error) from error
            if message is not None:
                yield self._frame(message)

    def _frame(self, message: can.Message) -> CanFrame:
        """Return a message as a frame; clear identifier and data of error frames that do not use Linux's classes."""
        frame = of_message(message)
        return frame._replace(can_id=0, data=b"") if frame.error and not self._linux_classes else frame


@contextmanager
def listen(
    interface: str, channel: str | int | None, bitrate: int | None, options: Mapping[str, object]
) -> Iterator[Listener]:
    """Open an adapter for listening, and close it after the block. Blocks as long as its driver does.

    Raises:
        AdapterError, ArgumentError: see ``adapter.open_adapter``.
    """
    bus = adapter.open_adapter(interface, channel, bitrate, options)
    try:
        yield Listener(bus, f"{interface}:{channel}")
    finally:
        bus.shutdown()


def link_bitrate(interface: str, channel: str | int | None) -> int | None:
    """Return the bit rate of a link in the operating system, None if unknown."""
    if interface != "socketcan":
        return None
    found = socketcan.link(str(channel))
    return None if found is None else found.bitrate
