"""The inputs and outputs of a simulated drive in virtual time, as they travel in PDOs (``cia401.port.IoPort``)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from axisbus.cia301.nmt import NmtState
from axisbus.cia401.port import IoInputs, SignalValidity
from axisbus.cia401.signal import Address
from axisbus.cia402.port import Sample, ValueTransport
from axisbus.sim.device import Device

_SYNC_AGE = 0.1  # seconds


class DirectIoPort:
    """Holds samples, outputs that wait for SYNC, and the heartbeat state of the node."""

    def __init__(
        self,
        device: Device,
        inputs: Sequence[Address],
        outputs: Sequence[Address],
        *,
        sync: bool = True,
        heartbeat: float = 0.1,
    ) -> None:
        """``sync``: values travel with SYNC, else when they change; ``heartbeat`` is the period of the node's, in seconds."""
        self.device = device
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        self.found = self.alone = tuple(device.dictionary.get_int(*address) for address in self.outputs)
        self.max_age = (_SYNC_AGE if sync else math.inf,) * len(self.inputs)
        self.sources = (ValueTransport.SYNC_PDO if sync else ValueTransport.EVENT_PDO,) * len(self.inputs)
        self._sync = sync
        self._heartbeat = heartbeat
        self._samples: list[Sample | None] = [None] * len(self.inputs)
        self._under_way: list[Sample] = []
        self._pending: tuple[int | None, ...] = ()
        self._latched: tuple[int | None, ...] = ()
        self._boot_ups = device.boot_ups
        self._last_beat, self._next_beat, self._state = -math.inf, 0.0, NmtState.UNKNOWN

    def know_state(self, now: float) -> None:
        """The node's NMT state is known at once, as after a boot-up that was watched."""
        self._boot_ups = self.device.boot_ups
        self.found = tuple(self.device.dictionary.get_int(*address) for address in self.outputs)
        self.alone = tuple(map(self.device.io.alone, self.outputs, self.found))
        self.receive_state(now)

    def read(self, now: float) -> IoInputs:
        """Return the newest values."""
        if self._boot_ups != self.device.boot_ups:
            known = SignalValidity.RESTARTED
        elif now - self._last_beat > 3 * self._heartbeat + 1e-9:
            known = SignalValidity.SILENT
        else:
            known = (
                SignalValidity.YES if self._state is NmtState.OPERATIONAL else SignalValidity.NOT_OPERATIONAL
            )
        stamps = [sample.stamp for sample in self._samples if sample is not None]
        return IoInputs(known, tuple(self._samples), max([self._last_beat, *stamps]))

    def write(self, words: tuple[int | None, ...]) -> None:
        """Take the values for this cycle; nothing happens before the commit."""
        self._pending = words

    # Calls of the cycle.

    def commit(self) -> None:
        """Let outputs take effect, or wait for SYNC."""
        if self._sync:
            self._latched = self._pending
        else:
            self._apply(self._pending)
        self._pending = ()

    def sample(self, now: float) -> None:
        """SYNC: take the inputs, which are received as soon as time passes."""
        if self._sync:
            self._under_way = self._now(now)

    def latch(self) -> None:
        """SYNC: let the outputs take effect."""
        latched, self._latched = self._latched, ()
        self._apply(latched)

    def advance(self, now: float) -> None:
        """Time has passed until ``now``: send heartbeats, and changed or sampled values."""
        for place, sample in enumerate(self._under_way):
            self._samples[place] = sample
        self._under_way = []
        if self.device.dials.dead:
            return
        if now >= self._next_beat - 1e-9 and self.device.nmt is not NmtState.INITIALISING:
            self._next_beat = now + self._heartbeat
            if not self.device.dials.heartbeat_stops:
                self.receive_state(now)
        if not self._sync:
            for place, sample in enumerate(self._now(now)):
                before = self._samples[place]
                if before is None or before.value != sample.value:
                    self._samples[place] = sample

    def receive_state(self, now: float) -> None:
        self._last_beat, self._state = now, self.device.nmt

    @property
    def _sends(self) -> bool:
        return self.device.operational and not self.device.dials.dead

    def _now(self, now: float) -> list[Sample]:
        get = self.device.dictionary.get_int
        return [Sample(get(*address), now) for address in self.inputs] if self._sends else []

    def _apply(self, words: tuple[int | None, ...]) -> None:
        if self._sends:
            for (index, subindex), word in zip(self.outputs, words, strict=False):
                if word is not None:
                    self.device.dictionary.write_mapped(index << 8 | subindex, word)
