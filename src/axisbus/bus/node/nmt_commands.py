"""NMT commands of the user to one node or to all, each confirmed by the reaction of the node (CiA 301 7.2.8, 7.3.2).

Theory of operation
-------------------
Before the command, the master determines how each node can confirm it. If the node sends heartbeats, these confirm it. Otherwise
answers to guarding requests do, but only if the node's life guarding is off (100Ch x 100Dh is 0): the first request would start it,
and the missing requests afterwards would put the node into a fault. Otherwise the answers of its SDO server do. A reset is
confirmed only by the boot-up message. Then the command is sent once, and all nodes are observed in parallel.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from axisbus.bus.link.channel import Channel
from axisbus.bus.node import nmt
from axisbus.bus.node.nmt import Confirmation
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.parallel import in_parallel
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.nmt import RESULT, NmtCommand, NmtState
from axisbus.clock import poll_until
from axisbus.errors import SdoError

LISTEN = 1.2  # seconds: long enough for the usual heartbeat period of 1 s
PATIENCE = 2.0
BOOT_PATIENCE = 5.0  # seconds that a node may take to restart
_GUARD_WAIT = 0.1
_SDO_TIMEOUT = 0.4
_SLICE = 0.02
_RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)


@dataclass(frozen=True, slots=True)
class NmtConfirmation:
    """How a node can confirm a command, its state before (None: unknown), and its heartbeat's period in s (0: none).

    ``heard``: whether anything was received from the node while this was determined.
    """

    by: Confirmation
    before: NmtState | None
    period: float = 0.0
    heard: bool = True


@dataclass(frozen=True, slots=True)
class NodeReaction:
    """Reaction of a node: ``state`` is the state it showed (None: it showed nothing), ``seconds`` the time until then."""

    node_id: int
    ok: bool
    confirmation: NmtConfirmation
    state: NmtState | None
    seconds: float

    @property
    def silent(self) -> bool:
        """Whether nothing was received from the node since the command."""
        return not self.ok and self.state is None

    @property
    def disobeyed(self) -> bool:
        """Whether the node shows a state other than the commanded one."""
        return not self.ok and self.state is not None

    @property
    def text(self) -> str:
        """The outcome as text."""
        if self.silent:
            return self._silence()
        before = f" (was {self.confirmation.before.text})" if self.confirmation.before is not None else ""
        if self.ok and self.state is not None:
            return f"{self.state.text}{before}, confirmed by {self.confirmation.by.value} after {self.seconds:.2f} s"
        seen = "it shows nothing" if self.state is None else f"it still reports {self.state.text}"
        return f"NOT confirmed{before}: {seen} {self.seconds:.1f} s after the command (expected: {self.confirmation.by.value})"

    def _silence(self) -> str:
        if not self.confirmation.heard:
            before = f"nothing came from it in {LISTEN:g} s before the command, nor any answer to SDO"
        elif self.confirmation.before is None:
            before = "it answered before the command"
        else:
            before = f"before the command it was {self.confirmation.before.text}"
        return f"SILENT: {before}, and nothing came in {self.seconds:.1f} s after it (expected: {self.confirmation.by.value})"


def confirmations(nodes: Iterable[CanopenNode]) -> dict[int, NmtConfirmation]:
    """Determine how each node can confirm a command; blocks up to ``LISTEN`` seconds, and for some SDO transfers if one is silent.

    Raises:
        AdapterError: the channel failed.
    """
    listed = list(nodes)
    if not listed:
        return {}
    clock = listed[0].channel.clock
    poll_until(clock, lambda: all(node.nmt.reports > 0 for node in listed), clock.now() + LISTEN, _SLICE)
    return dict(
        zip((node.node_id for node in listed), in_parallel(clock, _confirmation_of, listed), strict=True)
    )


def command(
    channel: Channel,
    nodes: Sequence[CanopenNode],
    wanted: NmtCommand,
    found: dict[int, NmtConfirmation],
    *,
    to_all: bool,
) -> list[NodeReaction]:
    """Send an NMT command to each node, or one to all (``to_all``), and return the reactions; blocks up to about 5 s.

    A node that shows nothing is a result, not an exception.

    Raises:
        AdapterError: the channel failed.
    """
    marks = {node.node_id: (node.nmt.reports, node.nmt.bootups) for node in nodes}
    begin = channel.clock.now()
    for node_id in (0,) if to_all else tuple(marks):
        nmt.send(channel, wanted, node_id)

    def look(node: CanopenNode) -> NodeReaction:
        return _look(node, wanted, found[node.node_id], marks[node.node_id], begin)

    return in_parallel(channel.clock, look, nodes)


def _confirmation_of(node: CanopenNode) -> NmtConfirmation:
    if node.nmt.reports:
        return NmtConfirmation(
            Confirmation.HEARTBEAT, node.nmt.state, _read(node, o.PRODUCER_HEARTBEAT) / 1000
        )
    period = _read(node, o.PRODUCER_HEARTBEAT) / 1000
    if period:
        return NmtConfirmation(Confirmation.HEARTBEAT, None, period)
    if _read(node, o.GUARD_TIME) * _read(node, o.LIFE_TIME_FACTOR) == 0 and _guarded(node) is not None:
        return NmtConfirmation(Confirmation.GUARDING, node.nmt.state)
    return NmtConfirmation(Confirmation.SDO, None, heard=node.answers_sdo(_SDO_TIMEOUT))


def _read(node: CanopenNode, index: int) -> int:
    """Return a number of the node, 0 if it has none or does not answer (a stopped node does not)."""
    try:
        return int.from_bytes(node.sdo.upload(index, timeout=_SDO_TIMEOUT, tries=1), "little")
    except SdoError:
        return 0


def _look(
    node: CanopenNode, wanted: NmtCommand, confirmation: NmtConfirmation, marks: tuple[int, int], begin: float
) -> NodeReaction:
    reports, bootups = marks
    if wanted in _RESETS:
        confirmation = replace(confirmation, by=Confirmation.BOOT_UP)
        ok = poll_until(node.channel.clock, lambda: node.nmt.bootups > bootups, begin + BOOT_PATIENCE, _SLICE)
    else:
        ok = _reaches(node, RESULT[wanted], confirmation, reports, begin)
    state = node.nmt.state if node.nmt.reports > reports or (ok and node.nmt.assumed) else None
    return NodeReaction(node.node_id, ok, confirmation, state, node.channel.clock.now() - begin)


def _reaches(
    node: CanopenNode, state: NmtState, confirmation: NmtConfirmation, reports: int, begin: float
) -> bool:
    clock, deadline = node.channel.clock, begin + max(PATIENCE, 2.5 * confirmation.period)
    if confirmation.by is Confirmation.HEARTBEAT:
        return node.nmt.wait_state(state, max(0.0, deadline - clock.now()), after=reports)
    if confirmation.by is Confirmation.GUARDING:
        return poll_until(clock, lambda: _guarded(node) is state, deadline, _SLICE)
    serves = state is not NmtState.STOPPED
    if poll_until(clock, lambda: node.answers_sdo(_SDO_TIMEOUT) is serves, deadline, _SLICE):
        node.nmt.assume(state)
        return True
    return False


def _guarded(node: CanopenNode) -> NmtState | None:
    """Send one guarding request; return None if no answer comes."""
    asked = node.nmt.reports
    node.channel.send_remote(cob.HEARTBEAT + node.node_id)
    return node.nmt.state if node.nmt.wait_report(asked, _GUARD_WAIT) else None
