"""What an error frame of the CAN controller says (classes of Linux's can/error.h, which python-can passes on)."""

from __future__ import annotations

_BUS_OFF = 0x40
_CONTROLLER = 0x04

_CLASSES = (
    (_BUS_OFF, "bus-off"),
    (0x20, "no acknowledge: no other node listens at this bitrate"),
    (0x01, "transmit time-out"),
    (0x02, "lost arbitration"),
    (0x08, "protocol violation: another bitrate on the bus, or bad wiring"),
    (0x10, "transceiver: a line is broken or shorted"),
    (0x80, "bus error"),
    (0x100, "controller restarted"),
)

# Data byte 1 of the class "controller".
_CONTROLLER_BITS = (
    (0x01, "receive buffer overflow"),
    (0x02, "transmit buffer overflow"),
    (0x04, "receive errors (warning)"),
    (0x08, "transmit errors (warning)"),
    (0x10, "receive errors (passive)"),
    (0x20, "transmit errors (passive)"),
    (0x40, "back to error active"),
)


def is_bus_off(error_class: int) -> bool:
    """Whether the frame's class bits hold bus-off."""
    return bool(error_class & _BUS_OFF)


def describe(error_class: int, data: bytes) -> str:
    """Return the frame's meaning in words; adapters that tell no class give ``error frame``."""
    texts = [text for bit, text in _CLASSES if error_class & bit]
    if error_class & _CONTROLLER and len(data) > 1:
        texts += [text for bit, text in _CONTROLLER_BITS if data[1] & bit]
    return ", ".join(texts) or "error frame"
