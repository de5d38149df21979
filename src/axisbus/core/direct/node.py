"""A stand-in without a bus as direct access sees a node: NMT state, emergency messages, incidents, and what error control tells."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.boot.configure import HEARTBEATS
from axisbus.bus.node.events import NodeEvents
from axisbus.bus.node.nmt import not_obeyed
from axisbus.cia301.emcy import Emcy
from axisbus.cia301.incident import EmcyLog
from axisbus.cia301.nmt import RESULT, NmtCommand, NmtState
from axisbus.errors import NodeTimeout
from axisbus.sim.device import Device

_INITIALISING = NmtState.INITIALISING  # looked at in every cycle


class DirectMonitor:
    """What the heartbeats of a stand-in have told; holds state: the last of them. Times in seconds of virtual time."""

    guarded = False

    def __init__(self, device: Device, now: float, heartbeat: float) -> None:
        """Begin with the node as it is: a dead one has never been heard. ``heartbeat`` is its period."""
        self.state = NmtState.UNKNOWN if device.dials.dead else device.nmt
        self.stamp: float | None = None if device.dials.dead else now
        self.bootups = device.boot_ups
        self.reports = 0  # of its state
        self.bootup_stamp: float | None = None
        self.duplicate = ""  # what shows that a second device has its node-ID
        self._device = device
        self._heartbeat = heartbeat
        self._next = now

    @property
    def node_id(self) -> int:
        """The node's ID."""
        return self._device.node_id

    @property
    def deadline(self) -> float:
        """When the next heartbeat is overdue."""
        return (self.stamp or 0.0) + HEARTBEATS * self._heartbeat + 1e-9

    def overdue(self, now: float) -> bool:
        """Whether it is at the time ``now``."""
        return now > self.deadline

    def listen(self, now: float) -> bool:
        """Hear what the node says until ``now``; return whether that was a boot-up message."""
        device = self._device
        if device.dials.dead:
            return False
        if device.boot_ups != self.bootups:
            self.bootups, self.bootup_stamp, self.stamp = device.boot_ups, now, now
            self.state, self._next = NmtState.PRE_OPERATIONAL, now + self._heartbeat
            self.reports += 1
            return True
        if now < self._next - 1e-9:
            return False
        if not device.dials.heartbeat_stops and device.nmt is not _INITIALISING:
            self.state, self.stamp, self._next = device.nmt, now, now + self._heartbeat
            self.reports += 1
        return False


class DirectNode:
    """One node without a bus; holds its monitor, its log of messages, and what error control has told of it."""

    def __init__(
        self, device: Device, now: float, heartbeat: float, confirmed: Callable[[], None] = lambda: None
    ) -> None:
        """``now`` is the virtual time, ``heartbeat`` the period of the node's heartbeats, both in seconds.

        ``confirmed`` is called after a command that the node has obeyed.
        """
        self._confirmed = confirmed
        self.nmt = DirectMonitor(device, now, heartbeat)
        self.emcy = EmcyLog()
        self.events = NodeEvents(self.nmt)
        self._device = device

    def listen(self, now: float, emcys: tuple[Emcy, ...]) -> None:
        """Hear what has come until ``now``."""
        if self.nmt.listen(now):
            self.emcy.incidents.booted(now)
        if not self._device.dials.dead:
            for emcy in emcys:
                self.emcy.note(emcy)
        self.events.look(now)

    def command(self, command: NmtCommand, timeout: float) -> None:  # noqa: ARG002 - no time passes here
        """Give the node an NMT command, which it obeys at once; a restart takes it virtual time.

        Raises:
            NodeTimeout: it is not there, or stays in another state.
        """
        if self._device.dials.dead:
            raise NodeTimeout(
                f"node {self._device.node_id} did not confirm {command.name.lower().replace('_', ' ')}",
                node=self._device.node_id,
                observed="it is silent",
                remedy="check its supply, cable, node ID and bit rate",
            )
        self._device.nmt_command(command)
        if self._device.nmt is NmtState.INITIALISING:  # that ends with a boot-up message
            return
        state = self.nmt.state = self._device.nmt
        self.nmt.reports += 1
        if state is not RESULT[command]:
            raise not_obeyed(self._device.node_id, command, state, f"NMT state {state.text}")
        self._confirmed()
