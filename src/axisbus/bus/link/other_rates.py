"""Find the bit rate of a bus by listening, only with an adapter in listen-only mode.

A controller at a wrong bit rate takes every frame for an error. In normal mode it signals that, which destroys all
frames; in listen-only mode it cannot. But then it does not acknowledge frames either, and a frame that no node acknowledges is not
valid. A node that is alone with the adapter can therefore not be found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from axisbus.bus.link import adapter, interfaces
from axisbus.bus.link.listen import listen
from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame
from axisbus.drives.foreign_protocols import ForeignProtocols
from axisbus.errors import AdapterError, ArgumentError

RATES = (
    500_000,
    1_000_000,
    250_000,
    125_000,
    800_000,
    50_000,
    20_000,
    10_000,
)  # CiA 301 5.5, the likeliest first
SECONDS = 0.6  # of listening at each rate: several heartbeats of 100 ms
_MORE = 1.2  # seconds in total at a rate with traffic: heartbeats of 1 s
_PROOF = 2  # valid frames; at a wrong rate they occur only by chance


@dataclass(frozen=True, slots=True)
class BitRateTraffic:
    """Traffic at a bit rate (bit/s): valid frames, CANopen nodes by their heartbeats, and devices with another protocol."""

    bitrate: int
    frames: int
    nodes: tuple[int, ...] = ()
    others: ForeignProtocols = field(default_factory=ForeignProtocols)


def possible(interface: str, options: Mapping[str, object]) -> bool:
    """Whether an adapter can be opened in listen-only mode, at a chosen rate."""
    return adapter.can_be_silent(interface) and interfaces.sets_rate(interface, options)


def find(
    interface: str,
    channel: str | int | None,
    tried: int | None,
    options: Mapping[str, object],
    on_rate: Callable[[int], None] = lambda rate: None,  # noqa: ARG005
) -> BitRateTraffic | None:
    """Listen at each rate of CiA 301 except ``tried``; return the traffic at the first rate with frames, None if there is none.

    The adapter must be closed. ``on_rate`` is called with each rate before listening. Blocks about 6 s if nothing is received.

    Raises:
        ArgumentError: python-can offers no listen-only mode for the adapter.
        AdapterError: it cannot be opened at any rate.
    """
    if not possible(interface, options):
        raise ArgumentError(f"the CAN interface {interface!r} has no listen-only mode that python-can offers")
    failure: AdapterError | None = None
    opened = False
    for rate in (rate for rate in RATES if rate != tried):
        on_rate(rate)
        try:
            traffic = _at(interface, channel, rate, options)
        except AdapterError as error:  # many adapters do not support all rates
            failure = error
            continue
        opened = True
        if traffic.frames >= _PROOF:
            return traffic
    if failure is not None and not opened:
        raise failure
    return None


def _at(
    interface: str, channel: str | int | None, rate: int, options: Mapping[str, object]
) -> BitRateTraffic:
    listening, nodes = ForeignProtocols(), set[int]()
    with listen(interface, channel, rate, adapter.forced(interface, options)) as listener:
        for seconds in (SECONDS, _MORE - SECONDS):
            for frame in listener.frames(seconds):
                listening.note(frame)
                if _heartbeat(frame):
                    nodes.add(frame.can_id & 0x7F)
            if not listening.frames:
                break
    return BitRateTraffic(rate, listening.frames, tuple(sorted(nodes)), listening)


def _heartbeat(frame: CanFrame) -> bool:
    if frame.error or frame.remote or frame.extended or len(frame.data) != 1:
        return False
    return frame.can_id - cob.HEARTBEAT in cob.NODE_IDS
