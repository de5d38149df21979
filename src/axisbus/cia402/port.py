"""The seam between motion and a drive: what one cycle brings in and takes out, and what a bus or a simulation must offer.

``bus`` implements ``Port`` and ``BusCycle`` over CAN, ``sim`` over arithmetic. Everything here is a plain value in raw increments
that can be pickled, so that the scan can run in another process than the program that commands it. The values are NamedTuples
because they are made in every cycle, where frozen dataclasses cost three times as much.

All times are seconds of the monotonic clock that ``BusCycle.now`` reads; indices are those of a single-axis device, a port adds its
axis's offset (800h each).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

from axisbus.cia301.emcy import Emcy
from axisbus.errors import BusError


class Sample(NamedTuple):
    """A received value and when it was received; where it is known to come late, when it was sampled at the earliest."""

    value: int
    stamp: float


class ValueTransport(Enum):
    """How a value travels."""

    SYNC_PDO = "synchronous PDO"
    EVENT_PDO = "event-driven PDO"
    SDO = "SDO"
    NONE = "not available"


class SdoRequest(NamedTuple):
    """An SDO transfer that motion wants: ``value`` None reads (upload), a number writes (download)."""

    id: int
    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody wants here
    subindex: int
    value: int | None


class SdoReply(NamedTuple):
    """The end of a transfer: ``abort`` is None when it succeeded, else the code (0x05040000 also for no answer)."""

    id: int
    value: int | None
    abort: int | None


class Inputs(NamedTuple):
    """What is known of a drive at the beginning of a cycle; a value never received is None.

    ``operational`` holds when the node's NMT state is operational and its heartbeat (where watched) is not overdue; ``nmt`` is the
    last state it reported (-1: none). ``emcy`` and ``sdo`` hold what came since the last cycle. ``bus`` is why the bus itself
    carries nothing, or has not in between (bus-off), or why nothing can be sent (a full transmit queue); the node is then not
    operational, whatever it may have said before.
    ``overdue``: its heartbeat, or its answer to node guarding, has not come in time.

    ``restarted``: the node sent a boot-up message, or may have restarted unheard, since it was taken into service. Its PDO
    configuration may be gone: the samples are then only those received since, and nothing but a stop is sent to it. ``duplicate``
    says what shows that a second device has its node-ID (empty: nothing does). ``lag``: by how many seconds its process data come
    later than they should, as far as that matters; the stamps of the samples allow for it.
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
    """What a drive is to get in this cycle; None leaves a value as it was last sent.

    A ``controlword`` of None sends nothing that holds 6040h. ``cancel`` names SDO requests that are no longer wanted.
    ``nmt_stop`` asks for the NMT command *stop*, the last rung of the stop ladder. The offsets are those of feed-forward (60B1h in
    velocity increments, 60B2h in 0.1 % of rated torque): None for an axis without it, and for a drive that is left as it was found.
    ``interpolation_target`` (60C1h:01) is the target position once more, for a drive that is led in ip (``interpolated``).
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


# The names that Capabilities uses, and the CiA 402 object behind each.
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
# What is sent beside them to an axis with feed-forward, and to no other.
OFFSET_OBJECTS = {"velocity_offset": 0x60B1, "torque_offset": 0x60B2}
# What is sent beside them to an axis that is led in ip.
INTERPOLATION_OBJECTS = {"interpolation_target": 0x60C1}
ALL_OUTPUTS = OUTPUT_OBJECTS | OFFSET_OBJECTS | INTERPOLATION_OBJECTS


@dataclass(frozen=True, slots=True)
class Capabilities:
    """How each value of a drive travels, and how old an input may be (seconds) before it counts as unknown.

    ``edge_delay``: by how many cycles the edge of a set-point must come after its target; 0 where the drive never sees the
    controlword of a cycle before the target of the same cycle. ``guarded``: the node sends no heartbeat and is asked for its state.
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
        """How its values travel."""

    def read(self, now: float) -> Inputs:
        """Return the newest values; does not block."""

    def write(self, outputs: Outputs) -> None:
        """Take the values for this cycle; does not block, sends nothing before ``BusCycle.commit``."""


class BusCycle(Protocol):
    """One bus, as the scan drives it. Every method raises ``BusError`` when the bus fails."""

    def now(self) -> float:
        """Return the monotonic time in seconds."""

    def wait_until(self, t: float) -> float | None:
        """Return None when ``now() >= t``; a simulated plant advances in here.

        Where another device's SYNC begins each cycle, ``t`` is only expected: return when it came.
        """

    def receive(self) -> bool:
        """Take what has come since the last cycle, where nobody else does; does not block.

        Return whether simulated drives had not yet taken all of the last cycle when this one began: they are given no time.
        """

    def commit(self) -> None:
        """Send what the ports were given since the last commit."""

    def sync(self) -> None:
        """Send SYNC, where the bus has it."""

    def heartbeat(self) -> None:
        """Send our own heartbeat when it is due."""

    def quick_stop_all(self) -> bool:
        """Send the last committed frames once more with a quick stop in each controlword, and one SYNC.

        Return whether the bus took all of them; whether the drives obey is another matter. Never raises; used when the scan has
        failed.
        """

    def close(self) -> None:
        """Release the bus."""


class Waiter(Protocol):
    """How a command's owner waits for its end: a condition in real time, a pump of the scan in virtual time."""

    realtime: bool  # whether time passes while nobody waits

    def wait(self, done: Callable[[], bool], timeout: float | None) -> bool:
        """Block until ``done()`` is true or ``timeout`` seconds passed; return ``done()``."""
