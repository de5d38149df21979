"""Change the bit rate of a whole bus (CiA 305 activate bit timing): slaves and adapter; then check that the slaves answer.

Theory of operation
-------------------
After *activate bit timing* a slave uses the old rate for one switch delay, changes the rate, and is silent for one more delay.
During that silence the master closes its adapter and opens it again at the new rate. Before the silence, the adapter might not have
sent the command yet. After it, the adapter would destroy every frame of the others, as every controller with another rate does.
When both delays are over, the master sends requests to the slaves.

How the adapter's rate is set depends on the interface. Most drivers set it on opening. A SocketCAN link belongs to the system: the
master then re-opens nothing and sends no requests, and the result contains the commands for the user. A virtual bus has no rate, so
its slaves are requested without re-opening.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from enum import Enum

from axisbus.bus.link import interfaces, socketcan
from axisbus.bus.link.channel import Channel
from axisbus.bus.lss import LssMaster
from axisbus.bus.node import discover
from axisbus.cia305.services import LssAddress
from axisbus.clock import sleep_until
from axisbus.errors import AdapterError, LssError, one_line

ANSWER_TIME = 5.0  # seconds that a slave may take to answer at the new rate; some restart for it
_PAUSE = 0.2


class OwnRate(Enum):
    """Result for the rate of the master's adapter."""

    REOPENED = "re-opened at the new rate"
    SYSTEM = "still at the old rate: the system sets it"
    NONE = "has no rate"


@dataclass(frozen=True, slots=True)
class Opening:
    """Parameters to open a channel again at another rate; ``bitrate`` in bit/s."""

    interface: str
    channel: str | int | None
    bitrate: int | None = None
    options: Mapping[str, object] = field(default_factory=dict)

    @property
    def own_rate(self) -> OwnRate:
        """How the rate is set: by opening, by the system, or not at all."""
        if self.interface in interfaces.NO_RATE:
            return OwnRate.NONE
        return OwnRate.REOPENED if interfaces.sets_rate(self.interface, self.options) else OwnRate.SYSTEM

    def open(self, bitrate: int | None = None) -> Channel:
        """Open the channel, at ``bitrate`` if given; blocks and raises as ``Channel.open``."""
        return Channel.open(self.interface, self.channel, bitrate or self.bitrate, **self.options)


@dataclass(frozen=True, slots=True)
class ChangedOver:
    """The result of a change, in bit/s and by LSS address.

    ``asked``: whether the master has searched for slaves at the new rate. ``answered`` and ``silent`` are the slaves in
    ``addresses``. If all slaves were changed, ``nodes`` are the node-IDs that answer, and ``others`` is whether a slave without a
    node-ID answers. The user must run ``commands``, in this order, before the bus can be used again.
    """

    bitrate: int
    adapter: OwnRate
    asked: bool = True
    answered: tuple[LssAddress, ...] = ()
    silent: tuple[LssAddress, ...] = ()
    nodes: tuple[int, ...] = ()
    others: bool = False
    commands: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether all slaves in ``addresses`` (or at least one, if all were changed) are known to be at the new rate."""
        return self.asked and not self.silent and bool(self.answered or self.nodes or self.others)


def change_over(
    master: LssMaster,
    addresses: Sequence[LssAddress] | None,
    bitrate: int,
    delay: float,
    opening: Opening,
    stack: ExitStack,
    open_again: Callable[[Opening, int], Channel] = Opening.open,
) -> ChangedOver:
    """Change slaves (None: all) and the adapter to ``bitrate`` (bit/s), which ``set_bit_rate`` has configured in the slaves.

    Blocks for twice ``delay`` s (0.01 to 65.535), the adapter's opening, and up to 5 s for each slave that stays silent. The
    master's channel is closed if the adapter is opened again; ``stack`` then closes the new channel.

    Raises:
        ArgumentError: the delay cannot be used, or ``addresses`` is empty.
        LssTimeout: a slave in ``addresses`` does not answer; nothing was activated.
        AdapterError: the slaves have changed, and the adapter cannot be opened at the new rate; or the channel failed.
    """
    own = opening.own_rate
    if own is OwnRate.SYSTEM:
        master.activate(addresses, delay)
        return ChangedOver(bitrate, own, asked=False, commands=_commands(opening, bitrate))
    sent = master.start_activation(addresses, delay)
    channel = master.channel
    sleep_until(channel.clock, sent + delay)
    try:
        if own is OwnRate.REOPENED:
            channel.close()
            channel = stack.enter_context(open_again(opening, bitrate))
        sleep_until(channel.clock, sent + 2 * delay)
        return _ask(channel, master, addresses, bitrate, own)
    except AdapterError as error:
        raise _half_changed(opening, bitrate, error) from error


def _commands(opening: Opening, bitrate: int) -> tuple[str, ...]:
    if opening.interface != "socketcan":
        return ()  # a link of another computer
    return tuple(socketcan.change_command(str(opening.channel), bitrate).split("; "))


def _half_changed(opening: Opening, bitrate: int, error: AdapterError) -> AdapterError:
    return AdapterError(
        f"the slaves were changed over to {bitrate} bit/s, but the adapter {opening.interface}:{opening.channel} cannot be used "
        "at it",
        observed=one_line(error),
        remedy=f"remove the cause and open the bus at {bitrate} bit/s (axisbus scan): at the old rate this computer would "
        "destroy the frames of the slaves that have changed over; a power cycle brings the other slaves back, unless "
        "the rate was stored",
    )


def _ask(
    channel: Channel,
    before: LssMaster,
    addresses: Sequence[LssAddress] | None,
    bitrate: int,
    own: OwnRate,
) -> ChangedOver:
    master = LssMaster(channel, before.pace.timing, beside_operation=True)  # already checked before
    if addresses is None:
        nodes = tuple(node.node_id for node in discover.scan(channel))
        return ChangedOver(bitrate, own, nodes=nodes, others=master.any_unconfigured())
    there = [address for address in addresses if _answers(master, address)]
    silent = tuple(address for address in addresses if address not in there)
    return ChangedOver(bitrate, own, answered=tuple(there), silent=silent)


def _answers(master: LssMaster, address: LssAddress) -> bool:
    clock = master.channel.clock
    deadline = clock.now() + ANSWER_TIME
    while True:
        try:
            master.inquire(address)
        except LssError:  # silent, or another slave answers: it is not known to be there
            if clock.now() > deadline:
                return False
            clock.sleep(_PAUSE)
        else:
            return True
