"""The interface ``cia402.port`` over arithmetic: simulated drives in virtual time, without frames, threads or a clock.

Theory of operation
-------------------

Time passes only in ``DirectCycle.wait_until``: plants, watchdogs and SDO transfers advance in it, so the machine moves on even
if the scan no longer asks. Outputs take effect according to their transport: event-driven values at ``commit``; synchronous
values at ``sync``, which samples the inputs first (an answer to a command is seen one SYNC later); values by SDO when their
transfer has been served. Sampled inputs are in transit until time passes: a read right after SYNC returns the sample of the
previous SYNC, as on a wire. A value with the transport ``NONE`` is never received and never sent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from axisbus.cia301.nmt import NmtCommand
from axisbus.errors import AdapterError
from axisbus.sim.device import Device
from kit.direct.port import CycleFaultSettings, DirectPort

__all__ = ["CycleFaultSettings", "DirectCycle", "DirectPort"]

_LONGEST_STEP = 0.01  # s


class DirectCycle:
    """One bus of simulated drives in virtual time; holds that time."""

    def __init__(
        self,
        ports: Sequence[DirectPort],
        *,
        start: float = 0.0,
        master_id: int = 127,
        heartbeat: float = 0.1,
        operational: bool = True,
        dials: CycleFaultSettings | None = None,
    ) -> None:
        """Drive ``ports``. ``heartbeat`` is the period of the master's in s (0: none).

        ``operational`` boots all nodes at once and starts them, but for dead ones, which hear nothing; else they boot as time
        passes, and ``nmt`` starts them.
        """
        self.ports = list(ports)
        self.dials = dials or CycleFaultSettings()
        self.devices: list[Device] = []
        for port in self.ports:
            port.dials = self.dials
            if port.device not in self.devices:
                self.devices.append(port.device)
        self._now = start
        self._master_id = master_id
        self._heartbeat = heartbeat
        self._next_heartbeat = start
        self.closed = False
        if operational:
            self._boot()

    def _boot(self) -> None:
        for device in self.devices:
            device.power_on()
            if not device.dials.dead:
                device.nmt_command(NmtCommand.START)
        for port in self.ports:
            if not port.device.dials.dead:
                port.know_state(self._now)
            port.advance(self._now, ())

    def now(self) -> float:
        """Return the virtual time in s."""
        return self._now

    def wait_until(self, t: float) -> None:
        """Let the plant run until ``t``; returns at once if ``t`` has passed.

        Raises:
            Exception: the one in the fault setting ``wait``.
        """
        if self.dials.wait is not None:
            raise self.dials.wait
        self._advance(t + self.dials.wait_late)

    def receive(self) -> bool:
        """Nothing to do: samples are received as time passes; no peer is behind."""
        return False

    def commit(self) -> None:
        """Send the outputs of the ports.

        Raises:
            AdapterError: the bus is closed.
            Exception: the one in the fault setting ``commit``.
        """
        self._check_open()
        if self.dials.commit is not None:
            raise self.dials.commit
        if self.dials.send_blocks > 0.0:
            blocked, self.dials.send_blocks = self.dials.send_blocks, 0.0
            self._advance(self._now + blocked)
        for port in self.ports:
            port.commit(self._now)

    def sync(self) -> None:
        """Send SYNC: inputs are sampled, outputs take effect, cyclic targets are latched.

        Raises:
            AdapterError: the bus is closed.
            Exception: the one in the fault setting ``sync``.
        """
        self._check_open()
        if self.dials.sync is not None:
            raise self.dials.sync
        if self.dials.sync_lost:
            return
        now = self._now
        for port in self.ports:
            port.sample(now)
        for port in self.ports:
            port.latch()
        for device in self.devices:
            if device.operational and not device.dials.dead:
                device.sync()

    def heartbeat(self) -> None:
        """Send our heartbeat when it is due.

        Raises:
            AdapterError: the bus is closed.
            Exception: the one in the fault setting ``heartbeat``.
        """
        self._check_open()
        if self.dials.heartbeat is not None:
            raise self.dials.heartbeat
        if self._heartbeat <= 0.0 or self._now < self._next_heartbeat - 1e-9:
            return
        self._next_heartbeat = self._now + self._heartbeat
        if self.dials.heartbeat_lost:
            return
        for device in self.devices:
            if not device.dials.dead:
                device.receive_heartbeat(self._master_id)

    def quick_stop_all(self) -> bool:
        """Send the last controlwords once more as quick stops, and one SYNC, and return whether that was possible; never raises."""
        for port in self.ports:
            port.quick_stop()
            port.latch()
        for device in self.devices:
            if device.operational and not device.dials.dead:
                device.sync()
        return not self.closed

    def close(self) -> None:
        """Release the bus: nothing can be sent any more, the plant continues in ``wait_until``."""
        self.closed = True

    def _check_open(self) -> None:
        if self.closed:
            raise AdapterError("the simulated bus is closed", remedy="make a new one")

    def nmt(self, command: NmtCommand, node_id: int = 0) -> None:
        """Send an NMT command to one node, or to all (0)."""
        for device in self.devices:
            if node_id in (0, device.node_id) and not device.dials.dead:
                device.nmt_command(command)

    def run(self, seconds: float, each: Callable[[], None] | None = None, period: float = 0.01) -> None:
        """Let ``seconds`` pass with a commit, SYNC and heartbeat in every ``period``, and ``each`` called before them."""
        end = self._now + seconds
        while self._now < end - 1e-9:
            self.wait_until(min(end, self._now + period))
            if each is not None:
                each()
            self.commit()
            self.sync()
            self.heartbeat()

    def _advance(self, t: float) -> None:
        while t - self._now > 1e-12:
            dt = t - self._now
            if dt > _LONGEST_STEP * 1.001:
                dt = _LONGEST_STEP
                self._now += dt
            else:
                self._now = t
            for device in self.devices:
                device.step(dt)
            self._inform_ports()

    def _inform_ports(self) -> None:
        now = self._now
        messages = {device.node_id: device.errors.take_emcy(now) for device in self.devices}
        for port in self.ports:
            dead = port.device.dials.dead
            port.advance(now, () if dead else messages[port.device.node_id])
