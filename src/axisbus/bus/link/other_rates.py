"""Which other bit rate a bus runs at, found by listening in an adapter's listen-only mode, and never otherwise.

A controller with another rate than the bus's takes every frame for an error, and says so: in normal mode it destroys them all. In
listen-only mode it cannot. But then it does not acknowledge either, and what nobody acknowledges is no valid frame to anybody: a
node that is alone with the adapter is not heard like this.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from axisbus.bus.link import interfaces, listenonly
from axisbus.bus.link.listen import listen
from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.factory_protocols import ProtocolListener, Speaker
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
SECONDS = 0.6  # of listening at each: several heartbeats of 100 ms
_MORE = 1.2  # seconds in all at the rate where something is heard: heartbeats of 1 s
_PROOF = 2  # sound frames; a wrong rate gives none but by chance


@dataclass(frozen=True, slots=True)
class BitRateTraffic:
    """What was heard at a bit rate (bit/s): sound frames, CANopen nodes by their heartbeats, and who speaks another protocol."""

    bitrate: int
    frames: int
    nodes: tuple[int, ...] = ()
    speakers: tuple[Speaker, ...] = ()


def possible(interface: str, options: Mapping[str, object]) -> bool:
    """Whether an adapter can be opened in listen-only mode, at a rate of our choice."""
    return listenonly.can_be_silent(interface) and interfaces.sets_rate(interface, options)


def find(
    interface: str,
    channel: str | int | None,
    tried: int | None,
    options: Mapping[str, object],
    tell: Callable[[int], None] = lambda rate: None,  # noqa: ARG005
) -> BitRateTraffic | None:
    """Listen at each rate of CiA 301 but the one that was tried, and return what was heard first; None where nothing was.

    The adapter must be closed. ``tell`` is told each rate before. Blocks some 6 s where nothing is heard.

    Raises:
        ArgumentError: the adapter has no listen-only mode that can be asked for.
        AdapterError: it cannot be opened at any rate.
    """
    if not possible(interface, options):
        raise ArgumentError(f"the CAN interface {interface!r} has no listen-only mode that python-can offers")
    refused: AdapterError | None = None
    opened = False
    for rate in (rate for rate in RATES if rate != tried):
        tell(rate)
        try:
            heard = _at(interface, channel, rate, options)
        except AdapterError as error:  # many adapters lack one rate or another
            refused = error
            continue
        opened = True
        if heard.frames >= _PROOF:
            return heard
    if refused is not None and not opened:
        raise refused
    return None


def _at(
    interface: str, channel: str | int | None, rate: int, options: Mapping[str, object]
) -> BitRateTraffic:
    listening, nodes = ProtocolListener(), set[int]()
    with listen(interface, channel, rate, listenonly.forced(interface, options)) as listener:
        for seconds in (SECONDS, _MORE - SECONDS):
            for frame in listener.frames(seconds):
                listening.note(frame)
                if _heartbeat(frame):
                    nodes.add(frame.can_id & 0x7F)
            if not listening.frames:
                break
    return BitRateTraffic(rate, listening.frames, tuple(sorted(nodes)), tuple(listening.speakers))


def _heartbeat(frame: CanFrame) -> bool:
    if frame.error or frame.remote or frame.extended or len(frame.data) != 1:
        return False
    return frame.can_id - cob.HEARTBEAT in cob.NODE_IDS
