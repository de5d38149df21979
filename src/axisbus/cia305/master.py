"""Services of an LSS master (CiA 305) for slaves with a known address: inquire, set node-ID and bit rate, store, activate.

Each function is a dialogue (``axisbus.cia305.dialogue``) that first switches every slave to *waiting*. If the address is None, the
function switches every slave to *configuration*. That is correct only with a single slave on the bus: with two, different answers
collide on the wire.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from axisbus.cia301 import cob
from axisbus.cia305 import services
from axisbus.cia305.dialogue import (
    CONFIRM_WAIT,
    STORE_WAIT,
    AdaptiveLssTimeout,
    Dialogue,
    absent,
    all_waiting,
    ask,
    configured,
    confirmed,
    enter,
    say,
    select,
)
from axisbus.cia305.services import LssAddress, LssService
from axisbus.errors import ArgumentError, LssError, LssTimeout

_ROUNDS = 5
SHORTEST_DELAY = 0.01  # s; a shorter delay leaves a slave no time to change the bit rate


@dataclass(frozen=True, slots=True)
class Inquired:
    """Identity and node-ID as a slave reports them; ``node_id`` is 255 if it has none, None if unknown or out of range."""

    address: LssAddress
    node_id: int | None

    @property
    def configured(self) -> bool:
        """Whether the slave has a node-ID."""
        return self.node_id is not None and self.node_id != services.UNCONFIGURED


@dataclass(frozen=True, slots=True)
class NodeIdSet:
    """A node-ID that a slave accepted; ``old`` as ``Inquired.node_id``.

    A slave without a node-ID uses the new one at once and boots. A slave that has one keeps it until NMT *reset communication*.
    """

    address: LssAddress
    old: int | None
    node_id: int
    stored: bool

    @property
    def at_once(self) -> bool:
        """Whether the slave uses the new node-ID already."""
        return self.old == services.UNCONFIGURED


def name(address: LssAddress | None) -> str:
    """Return the text for a slave in an error message."""
    return "the only LSS slave on the bus" if address is None else f"the LSS slave {address}"


def inquire(pace: AdaptiveLssTimeout, address: LssAddress | None) -> Dialogue[Inquired]:
    """Read a slave's identity and node-ID; the slave stays in *configuration*.

    Raises:
        LssTimeout: there is no such slave, or it does not answer an inquiry of its identity.
        LssError: several slaves answer.
    """
    yield from enter(pace, address)
    who = name(address)
    found = (yield from _own_address(pace)) if address is None else address
    if address is not None:
        yield from _same_serial(pace, address)
    try:
        answer = yield from confirmed(
            pace, services.inquire(LssService.INQUIRE_NODE_ID), who, CONFIRM_WAIT / 2
        )
    except LssTimeout:  # older slaves do not have this service
        return Inquired(found, None)
    told = answer[1]
    known = told in cob.NODE_IDS or told == services.UNCONFIGURED
    return Inquired(found, told if known else None)  # 0 would address all nodes in the commands that follow


def _own_address(pace: AdaptiveLssTimeout) -> Dialogue[LssAddress]:
    numbers = []
    for service in services.INQUIRIES:
        answer = yield from confirmed(pace, services.inquire(service), name(None))
        numbers.append(services.number_in(answer))
    return LssAddress(*numbers)


def numbers_of(
    pace: AdaptiveLssTimeout, address: LssAddress
) -> Dialogue[tuple[LssAddress | None, int | None]]:
    """Return the address and node-ID that the slave in *configuration* reports; None for each that it does not report.

    Raises:
        LssError: several slaves answer, with different numbers.
    """
    numbers = []
    for service in services.INQUIRIES:
        answer = yield from _told(pace, service, address)
        if answer is None:
            break
        numbers.append(services.number_in(answer))
    node_id = yield from _told(pace, LssService.INQUIRE_NODE_ID, address)
    whole = LssAddress(*numbers) if len(numbers) == len(services.INQUIRIES) else None
    return whole, None if node_id is None else node_id[1]


def _told(pace: AdaptiveLssTimeout, service: LssService, address: LssAddress) -> Dialogue[bytes | None]:
    """Inquire one number; return None if the slave does not have the service."""
    try:
        return (
            yield from confirmed(pace, services.inquire(service), name(address), CONFIRM_WAIT / 2, many=True)
        )
    except LssTimeout:
        return None


def _same_serial(pace: AdaptiveLssTimeout, address: LssAddress) -> Dialogue[None]:
    """Before anything is changed, check that the selected slave answers, and no other."""
    service = LssService.INQUIRE_SERIAL_NUMBER
    try:
        answer = yield from confirmed(pace, services.inquire(service), name(address), CONFIRM_WAIT / 2)
    except LssTimeout:  # CiA 305 does not require this service
        return
    if services.number_in(answer) != address.serial_number:
        raise LssError(
            f"an LSS slave other than {address} answered",
            service=service.text,
            slave=str(address),
            observed=f"its serial number is 0x{services.number_in(answer):X}",
            remedy="see whether a second LSS master is on the bus, and try again",
        )


def set_node_id(
    pace: AdaptiveLssTimeout, address: LssAddress | None, node_id: int, *, store: bool
) -> Dialogue[NodeIdSet]:
    """Give a slave a node-ID (1 to 127; 255 removes it), and store it if requested; leaves every slave in *waiting*.

    Raises:
        ArgumentError: the node-ID is out of range.
        LssRefused: the slave does not accept or store it; LssTimeout, LssError: as ``inquire``.
    """
    services.require_node_id(node_id)
    before = yield from inquire(pace, address)
    who = name(before.address)
    yield from configured(pace, services.configure_node_id(node_id), who)
    if store:
        yield from configured(pace, services.store_configuration(), who, STORE_WAIT)
    yield from all_waiting(pace)
    return NodeIdSet(before.address, before.node_id, node_id, store)


def set_bit_rate(
    pace: AdaptiveLssTimeout, addresses: Sequence[LssAddress] | None, bitrate: int, *, store: bool
) -> Dialogue[None]:
    """Set the bit rate (bit/s) that slaves (None: all at once) change to when activated; leaves every slave in *waiting*.

    Raises:
        ArgumentError: CiA 305 has no such rate.
        LssRefused: a slave does not accept or store it; LssTimeout, LssError: as ``inquire``.
    """
    frame = services.configure_bit_timing(services.bit_timing_index(bitrate))
    for address in [None] if addresses is None else addresses:
        yield from enter(pace, address)
        who = "an LSS slave (all were asked)" if address is None else name(address)
        yield from configured(pace, frame, who, many=address is None)
        if store:
            keep = services.store_configuration()
            yield from configured(pace, keep, who, STORE_WAIT, many=address is None)
    yield from all_waiting(pace)


def store(pace: AdaptiveLssTimeout, address: LssAddress | None) -> Dialogue[None]:
    """Make a slave store its node-ID and bit rate; leaves every slave in *waiting*.

    Raises:
        LssRefused: it cannot; LssTimeout, LssError: as ``inquire``.
    """
    before = yield from inquire(pace, address)
    yield from configured(pace, services.store_configuration(), name(before.address), STORE_WAIT)
    yield from all_waiting(pace)


def activate(
    pace: AdaptiveLssTimeout, addresses: Sequence[LssAddress] | None, delay: float
) -> Dialogue[None]:
    """Make slaves (None: all) change to the configured bit rate ``delay`` s after this returns.

    Nothing is activated unless every slave in ``addresses`` has answered: a bus with two bit rates does not work.

    Raises:
        ArgumentError: the delay is not 0.01 to 65.535 s.
        LssTimeout, LssError: as ``inquire``.
    """
    require_delay(delay)
    yield from (enter(pace, None) if addresses is None else _gather(pace, addresses))
    yield from say(pace, services.activate_bit_timing(delay), 0.0)


def require_delay(delay: float) -> None:
    """Check a switch delay in s.

    Raises:
        ArgumentError: it is not 0.01 to 65.535 s.
    """
    if not SHORTEST_DELAY <= delay <= services.LONGEST_DELAY:
        raise ArgumentError(
            f"a switch delay of {delay:g} s cannot be used",
            remedy=f"give one from {SHORTEST_DELAY:g} to {services.LONGEST_DELAY:g} s",
        )


def identify(pace: AdaptiveLssTimeout, low: LssAddress, high: LssAddress) -> Dialogue[bool]:
    """Return whether any slave lies in a range of revision and serial numbers, with or without a node-ID; changes no state.

    ``low`` and ``high`` must agree in vendor-ID and product code.

    Raises:
        ArgumentError: they do not.
    """
    if low.parts[:2] != high.parts[:2]:
        raise ArgumentError("identify remote slave takes one vendor-ID and one product code")
    return (yield from _anybody(pace, services.identify_remote(low, high)))


def any_unconfigured(pace: AdaptiveLssTimeout) -> Dialogue[bool]:
    """Return whether any slave has no node-ID; changes no state."""
    return (yield from _anybody(pace, (services.identify_non_configured(),)))


def _anybody(pace: AdaptiveLssTimeout, frames: Sequence[bytes]) -> Dialogue[bool]:
    *before, last = frames
    for _ in range(pace.timing.tries):
        for frame in before:
            yield from say(pace, frame)
        heard = yield from ask(pace, last, pace.patience)
        if heard.answers:
            return True
    return False


def _gather(pace: AdaptiveLssTimeout, addresses: Sequence[LssAddress]) -> Dialogue[None]:
    """Switch exactly these slaves to *configuration*, each confirmed by an answer.

    If the answer of a slave was lost, the slave is in *configuration* and silent. Only a new start from *waiting* distinguishes it
    from a slave that never received the request.
    """
    silent = addresses[0]
    for _ in range(_ROUNDS):
        yield from all_waiting(pace)
        for address in addresses:
            if not ((yield from select(pace, address)) or (yield from select(pace, address, pace.timeout))):
                silent = address
                break
        else:
            return
    raise absent(pace, silent)
