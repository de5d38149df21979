"""A whole bus to another bit rate (CiA 305 activate bit timing): the slaves, then our own adapter, then whether they answer.

Theory of operation
-------------------
After *activate bit timing* a slave goes on for one switch delay at the old rate, changes over, and is silent for one delay more. In
that silence our adapter is closed and opened again at the new rate: earlier it might not have sent the command yet, later it would
destroy, as every controller with another rate does, each frame of the others. When both delays are over the slaves are asked.

Who sets the adapter's rate differs. Most drivers take it on opening. SocketCAN's link belongs to the system: nothing is re-opened
or asked then, and the result holds the lines to be typed. A virtual bus has no rate, and its slaves are asked at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from enum import Enum

from axisbus.bus.link import interfaces, socketcan
from axisbus.bus.link.channel import Channel
from axisbus.bus.lss import LssMaster
from axisbus.bus.node import discover
from axisbus.cia305.services import LssAddress
from axisbus.errors import AdapterError, LssError, one_line

ANSWER_TIME = 5.0  # seconds that a slave may take to answer at the new rate; some restart for it
_PAUSE = 0.2


class OwnRate(Enum):
    """What became of our own adapter's rate."""

    REOPENED = "re-opened at the new rate"
    SYSTEM = "still at the old rate: the system sets it"
    NONE = "has no rate"


@dataclass(frozen=True, slots=True)
class Opening:
    """How a channel is opened, so that it can be opened again at another rate; ``bitrate`` in bit/s."""

    interface: str
    channel: str | int | None
    bitrate: int | None = None
    options: Mapping[str, object] = field(default_factory=dict)

    @property
    def own_rate(self) -> OwnRate:
        """Who sets the rate: we, the system, or nobody."""
        if self.interface in interfaces.NO_RATE:
            return OwnRate.NONE
        return OwnRate.REOPENED if interfaces.sets_rate(self.interface, self.options) else OwnRate.SYSTEM

    def open(self, bitrate: int | None = None) -> Channel:
        """Open it, at ``bitrate`` where given; blocks and raises as ``Channel.open``."""
        return Channel.open(self.interface, self.channel, bitrate or self.bitrate, **self.options)


@dataclass(frozen=True, slots=True)
class ChangedOver:
    """What a change-over came to, in bit/s and by LSS address.

    ``asked``: whether slaves were looked for at the new rate at all. ``answered`` and ``silent`` are those that were named; where
    all were told, ``nodes`` are the node-IDs that answer, and ``others`` whether one without a node-ID does. ``commands`` is to be
    typed, in this order, before the bus can be used again.
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
        """Whether everybody named, or at least somebody where all were told, is known to be at the new rate."""
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
    """Have slaves (None: all) change over to ``bitrate`` (bit/s), which ``set_bit_rate`` told them, and our adapter with them.

    Blocks for twice ``delay`` s (0.01 to 65.535), the adapter's opening, and up to 5 s for each slave that stays silent. The
    master's channel is closed where the adapter is opened again; ``stack`` then closes the new one.

    Raises:
        ArgumentError: the delay cannot be used, or nobody is named.
        LssTimeout: a slave named does not answer; nothing was activated.
        AdapterError: the slaves have changed over, and our adapter cannot be opened at the new rate; or the channel failed.
    """
    own = opening.own_rate
    if own is OwnRate.SYSTEM:
        master.activate(addresses, delay)
        return ChangedOver(bitrate, own, asked=False, commands=_commands(opening, bitrate))
    sent = master.start_activation(addresses, delay)
    _sleep_until(sent + delay)
    channel = master.channel
    try:
        if own is OwnRate.REOPENED:
            channel.close()
            channel = stack.enter_context(open_again(opening, bitrate))
        _sleep_until(sent + 2 * delay)
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
        remedy=f"mend that and open the bus at {bitrate} bit/s (axisbus scan): at the old rate this computer would destroy the "
        "frames of those that have changed over; those that have not come back by switching them off and on, unless it was stored",
    )


def _ask(
    channel: Channel,
    before: LssMaster,
    addresses: Sequence[LssAddress] | None,
    bitrate: int,
    own: OwnRate,
) -> ChangedOver:
    master = LssMaster(channel, before.pace.timing, beside_operation=True)  # that was looked for before
    if addresses is None:
        nodes = tuple(node.node_id for node in discover.scan(channel))
        return ChangedOver(bitrate, own, nodes=nodes, others=master.any_unconfigured())
    there = [address for address in addresses if _answers(master, address)]
    silent = tuple(address for address in addresses if address not in there)
    return ChangedOver(bitrate, own, answered=tuple(there), silent=silent)


def _answers(master: LssMaster, address: LssAddress) -> bool:
    deadline = time.monotonic() + ANSWER_TIME
    while True:
        try:
            master.inquire(address)
        except LssError:  # silent, or somebody else answers: it is not known to be there
            if time.monotonic() > deadline:
                return False
            time.sleep(_PAUSE)
        else:
            return True


def _sleep_until(when: float) -> None:
    time.sleep(max(0.0, when - time.monotonic()))
