"""The interface between motion and a drive: the inputs and outputs of one cycle, and the protocols of a bus or a simulation.

``bus`` implements ``Port`` and ``BusCycle`` over CAN, ``sim`` by computation. All values are plain values in raw increments that
can be pickled, so that the scan can run in a process other than the client's. The values are NamedTuples because they are made in
every cycle, in which frozen dataclasses cost three times as much.

All times are seconds of the monotonic clock that ``BusCycle.now`` reads. Indices are those of a single-axis device; a port adds the
offset of its axis (800h each).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

from axisbus.cia301.emcy import Emcy
from axisbus.errors import BusError


class Sample(NamedTuple):
    """A received value and its time of reception; if it is known to be delayed, its earliest sampling time."""

    value: int
    stamp: float


class ValueTransport(Enum):
    """Transport of a value."""

    SYNC_PDO = "synchronous PDO"
    EVENT_PDO = "event-driven PDO"
    SDO = "SDO"
    NONE = "not available"


class SdoRequest(NamedTuple):
    """An SDO transfer requested by motion: ``value`` None reads (upload), a number writes (download)."""

    id: int
    index: int  # type: ignore[assignment]  # hides tuple.index, which is not needed here
    subindex: int
    value: int | None


class SdoReply(NamedTuple):
    """The end of a transfer: ``abort`` is None for success, else the code (0x05040000 also for no answer)."""

    id: int
    value: int | None
    abort: int | None


class Inputs(NamedTuple):
    """State of a drive at the beginning of a cycle; a value never received is None.

    ``operational``: the node's NMT state is operational and its heartbeat (if monitored) is not overdue. ``nmt`` is the last
    reported state (-1: none). ``emcy`` and ``sdo`` contain the messages and replies since the last cycle. ``bus`` is the reason why
    the bus carries nothing now or did not in between (bus-off), or why nothing can be sent (a full transmit queue). The node is
    then not operational, whatever it reported before. ``overdue``: its heartbeat, or its answer to node guarding, has not come in
    time.

    ``restarted``: the node sent a boot-up message, or may have restarted unnoticed, since it was booted. Its PDO configuration may
    be lost. The samples are then only those received since, and only stops are sent to it. ``duplicate`` is the evidence that a
    second device has its node-ID (empty: none). ``lag``: delay in seconds of its process data, as far as it is relevant; the stamps
    of the samples allow for it.
    """

    now: float
    operational: bool
    statusword: Sample | None
    mode: Sample | None
    position: Sample | None
    velocity: Sample | None
    torque: Sample | None
    demand: Sample | None
    emcy: tuple[Emcy, ...] = ()
    sdo: tuple[SdoReply, ...] = ()
    nmt: int = -1
    bus: BusError | None = None
    overdue: bool = False
    restarted: bool = False
    duplicate: str = ""
    lag: float = 0.0


class Outputs(NamedTuple):
    """Outputs to a drive in this cycle; None leaves a value as it was last sent.

    If ``controlword`` is None, no frame with 6040h is sent. ``cancel`` contains SDO requests that are no longer needed.
    ``nmt_stop`` requests the NMT command *stop*, the last step of the stop sequence. The offsets are those of feed-forward (60B1h
    in velocity increments, 60B2h in 0.1 % of rated torque): None for an axis without it, and for a drive that is left as it was
    found. ``interpolation_target`` (60C1h:01) repeats the target position for a drive that is commanded in ip (``ip_as_csp``).
    """

    controlword: int | None = None
    mode: int | None = None
    target_position: int | None = None
    target_velocity: int | None = None
    target_torque: int | None = None
    sdo: tuple[SdoRequest, ...] = ()
    cancel: tuple[int, ...] = ()
    nmt_stop: bool = False
    velocity_offset: int | None = None
    torque_offset: int | None = None
    interpolation_target: int | None = None


# The names in Capabilities, and the CiA 402 object of each.
INPUT_OBJECTS = {
    "statusword": 0x6041,
    "mode": 0x6061,
    "position": 0x6064,
    "velocity": 0x606C,
    "torque": 0x6077,
    "demand": 0x6062,
}
OUTPUT_OBJECTS = {
    "controlword": 0x6040,
    "mode": 0x6060,
    "target_position": 0x607A,
    "target_velocity": 0x60FF,
    "target_torque": 0x6071,
}
# Additional outputs of an axis with feed-forward.
OFFSET_OBJECTS = {"velocity_offset": 0x60B1, "torque_offset": 0x60B2}
# Additional outputs of an axis that is commanded in ip.
INTERPOLATION_OBJECTS = {"interpolation_target": 0x60C1}
ALL_OUTPUTS = OUTPUT_OBJECTS | OFFSET_OBJECTS | INTERPOLATION_OBJECTS


@dataclass(frozen=True, slots=True)
class Capabilities:
    """The transport of each value of a drive, and the maximum age of an input (seconds) before it is unknown.

    ``edge_delay``: number of cycles by which the edge of a set-point must follow its target; 0 if the drive never sees the
    controlword of a cycle before the target of the same cycle. ``guarded``: the node sends no heartbeat and is monitored by node
    guarding.
    """

    inputs: dict[str, ValueTransport]
    outputs: dict[str, ValueTransport]
    remappable: bool
    max_age: dict[str, float]
    edge_delay: int = 0
    guarded: bool = False


class Port(Protocol):
    """One axis of a drive, as motion sees it."""

    @property
    def capabilities(self) -> Capabilities:
        """The transport of its values."""

    def read(self, now: float) -> Inputs:
        """Return the newest values; does not block."""

    def write(self, outputs: Outputs) -> None:
        """Set the values for this cycle; does not block, sends nothing before ``BusCycle.commit``."""


class BusCycle(Protocol):
    """One bus, as used by the scan. Every method raises ``BusError`` if the bus fails."""

    def now(self) -> float:
        """Return the monotonic time in seconds."""

    def wait_until(self, t: float) -> float | None:
        """Return None when ``now() >= t``; a simulated plant advances in this call.

        If another device's SYNC begins each cycle, ``t`` is only the expected time: return the time of that SYNC.
        """

    def receive(self) -> bool:
        """Read the frames since the last cycle, if no other thread does; does not block.

        Return whether simulated drives had not yet received all frames of the last cycle when this one began: they lack processor
        time.
        """

    def commit(self) -> None:
        """Send the outputs given to the ports since the last commit."""

    def sync(self) -> None:
        """Send SYNC, if the bus has it."""

    def heartbeat(self) -> None:
        """Send the master's heartbeat when it is due."""

    def resume(self) -> None:
        """Send frames again after ``quick_stop_all``, because the adapter was opened again; the scan must not run yet."""

    def quick_stop_all(self) -> bool:
        """Send the last committed frames once more with a quick stop in each controlword, and one SYNC.

        Return whether the bus accepted all of them; this does not show whether the drives obey. Never raises; used after the scan
        has failed.
        """

    def close(self) -> None:
        """Release the bus."""


class Waiter(Protocol):
    """How the owner of a command waits for its end: by a condition in real time, by running the scan in virtual time."""

    realtime: bool  # whether time passes without a call of ``wait``

    def wait(self, done: Callable[[], bool], timeout: float | None) -> bool:
        """Block until ``done()`` is true or ``timeout`` seconds passed; return ``done()``."""
