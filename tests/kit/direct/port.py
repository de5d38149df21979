"""One axis of a simulated drive as a ``cia402.port.Port``: samples, outputs and SDO in virtual time, as each value travels."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

from axisbus.cia301.emcy import Emcy
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia402.port import (
    INPUT_OBJECTS,
    OFFSET_OBJECTS,
    OUTPUT_OBJECTS,
    Capabilities,
    Inputs,
    Outputs,
    Sample,
    ValueTransport,
)
from axisbus.errors import SdoTimeout
from axisbus.sim.control_bits import CW_ENABLE_VOLTAGE, CW_FAULT_RESET, CW_QUICK_STOP_LOW
from axisbus.sim.device import Device
from axisbus.sim.settings import AXIS_SPAN
from kit.direct.sdo import SdoQueue, shifted

# Looked at in every cycle.
_OPERATIONAL, _INITIALISING = NmtState.OPERATIONAL, NmtState.INITIALISING
_SYNC_PDO, _EVENT_PDO, _SDO = ValueTransport.SYNC_PDO, ValueTransport.EVENT_PDO, ValueTransport.SDO
_NOTHING = Outputs()
_CONTROLWORD = OUTPUT_OBJECTS["controlword"]
_INPUTS = tuple(INPUT_OBJECTS)
_READ = attrgetter("statusword", "mode_display", "position", "velocity", "torque", "position_demand")
# Outputs in the order in which they take effect: the controlword last, so that it finds its target.
_ORDER = ("mode", "target_position", "target_velocity", "target_torque", "controlword")
_MAX_AGE = {
    ValueTransport.SYNC_PDO: 0.1,
    ValueTransport.EVENT_PDO: 1.0,
    ValueTransport.SDO: 1.0,
    ValueTransport.NONE: 0.0,
}


@dataclass(slots=True)
class CycleFaultSettings:
    """Faults of the bus as a whole; may be changed at any time.

    read, write, commit, sync, heartbeat, wait: an exception that the call of this name raises
    send_blocks: seconds of virtual time that the next ``commit`` takes, as with a full send queue
    wait_late: seconds by which ``wait_until`` returns too late
    sync_lost: SYNC does not reach the nodes
    heartbeat_lost: the master's heartbeat does not reach the nodes
    """

    read: Exception | None = None
    write: Exception | None = None
    commit: Exception | None = None
    sync: Exception | None = None
    heartbeat: Exception | None = None
    wait: Exception | None = None
    send_blocks: float = 0.0
    wait_late: float = 0.0
    sync_lost: bool = False
    heartbeat_lost: bool = False


class DirectPort:
    """One axis of a device; holds the samples, the pending outputs, and the SDO queue."""

    def __init__(
        self,
        device: Device,
        axis: int = 0,
        *,
        inputs: dict[str, ValueTransport] | None = None,
        outputs: dict[str, ValueTransport] | None = None,
        max_age: dict[str, float] | None = None,
        event_timer: float | None = None,
        sdo_time: float = 0.001,
        sdo_timeout: float = 0.5,
        sdo_poll: float = 0.1,
        node_heartbeat: float = 0.1,
        remappable: bool = True,
        controlword_first: bool = False,
        dials: CycleFaultSettings | None = None,
    ) -> None:
        """Offer axis ``axis`` (from 0) of ``device``.

        ``inputs``, ``outputs`` and ``max_age`` (s) change single values; without, everything that the dictionary has travels in
        synchronous PDOs. ``event_timer`` (s) repeats event-driven inputs; None sends them on change only. ``sdo_time`` is how long
        a transfer takes, ``sdo_timeout`` how long is waited for an answer, ``sdo_poll`` how often inputs by SDO are read,
        ``node_heartbeat`` how often the node says its NMT state (three missing ones and it counts as lost); all in s.
        ``controlword_first``: the drive takes the controlword of a cycle before its targets, as its mappings may have it.
        """
        self.device = device
        self.drive = device.drives[axis]
        self.dials = dials or CycleFaultSettings()
        self._offset = axis * AXIS_SPAN
        self._event_timer = event_timer
        self._sdo_poll = sdo_poll
        self._node_heartbeat = node_heartbeat
        self._sdo = SdoQueue(device, self._offset, sdo_time, sdo_timeout)
        self._samples: list[Sample | None] = [None] * len(_INPUTS)
        self._under_way: list[tuple[int, Sample]] = []  # sampled at SYNC, not received yet
        self._emcy: tuple[Emcy, ...] = ()
        self._pending = _NOTHING
        self._latched: dict[str, int] = {}
        self._last_controlword: int | None = None
        self._sent_by_sdo: dict[str, int] = {}
        self._next_poll = self._next_beat = 0.0
        self._last_beat = -1e9
        self._reported, self._nmt = NmtState.UNKNOWN, int(NmtState.UNKNOWN)
        self._boot_ups = device.boot_ups  # so many were received, or lost
        self._in_service = False
        self._rebooted = False  # since it was operational: its configuration is gone, as on a bus
        taken = self._sources(OUTPUT_OBJECTS, outputs)
        self.capabilities = Capabilities(
            self._sources(INPUT_OBJECTS, inputs),
            taken,
            remappable,
            {},
            int(controlword_first or _overtakes(taken)),
        )
        self._offsets = tuple(name for name in OFFSET_OBJECTS if name in taken)
        more = tuple(name for name in taken if name not in OUTPUT_OBJECTS)
        order = (*_ORDER[-1:], *_ORDER[:-1]) if controlword_first else _ORDER
        self._order: tuple[str, ...] = (*more, *order)
        self.capabilities.max_age.update(self._ages(max_age or {}))
        self._synchronous = self._numbers(ValueTransport.SYNC_PDO)
        self._events = self._numbers(ValueTransport.EVENT_PDO)
        self._polled = self._numbers(ValueTransport.SDO) + self._silent_positions()
        self._primed = False

    def _sources(
        self, objects: dict[str, int], changes: dict[str, ValueTransport] | None
    ) -> dict[str, ValueTransport]:
        has = self.device.dictionary.has
        found = {
            name: ValueTransport.SYNC_PDO if has(index + self._offset) else ValueTransport.NONE
            for name, index in objects.items()
        }
        return found | (changes or {})

    def _ages(self, changes: dict[str, float]) -> dict[str, float]:
        return {name: _MAX_AGE[source] for name, source in self.capabilities.inputs.items()} | changes

    def _numbers(self, source: ValueTransport) -> list[int]:
        return [number for number, name in enumerate(_INPUTS) if self.capabilities.inputs[name] is source]

    def _silent_positions(self) -> list[int]:
        """A position that is sent on change only is polled as well, as on a bus: silence does not prove standstill."""
        silent = (
            self.capabilities.inputs["position"] is ValueTransport.EVENT_PDO and self._event_timer is None
        )
        return [_INPUTS.index("position")] if silent else []

    # Calls of motion.

    def read(self, now: float) -> Inputs:
        """Return the newest values.

        Raises:
            Exception: the one in the fault setting ``read``.
        """
        if self.dials.read is not None:
            raise self.dials.read
        emcy, self._emcy = self._emcy, ()
        statusword, mode, position, velocity, torque, demand = self._samples
        alive = now - self._last_beat <= 3.0 * self._node_heartbeat + 1e-9
        if self._rebooted:
            statusword = mode = position = velocity = torque = demand = None
        return Inputs(
            now,
            alive and self._reported is _OPERATIONAL and not self._rebooted,
            statusword,
            mode,
            position,
            velocity,
            torque,
            demand,
            emcy,
            self._sdo.take_replies(),
            self._nmt,
            overdue=not alive,
            restarted=self._rebooted,
        )

    def write(self, outputs: Outputs) -> None:
        """Take the values for this cycle; nothing happens before the commit.

        Raises:
            Exception: the one in the fault setting ``write``.
        """
        if self.dials.write is not None:
            raise self.dials.write
        self._pending = outputs

    # Access for a boot-up, outside the cycle.

    def upload(self, index: int, subindex: int = 0) -> int:
        """Read an integer by SDO at once; indices are those of a single-axis device.

        Raises:
            SdoAbort: the drive refuses.
            SdoTimeout: it does not answer.
        """
        self._check_answers(index, subindex)
        return self.device.read(shifted(index, self._offset), subindex)

    def download(self, index: int, subindex: int, value: int) -> None:
        """Write an integer by SDO at once; indices are those of a single-axis device.

        Raises:
            SdoAbort: the drive refuses.
            SdoTimeout: it does not answer.
        """
        self._check_answers(index, subindex)
        self.device.write(shifted(index, self._offset), subindex, value)

    def _check_answers(self, index: int, subindex: int) -> None:
        if not self.device.answers_sdo:
            raise SdoTimeout(
                f"node {self.device.node_id}: no answer to the SDO request for {index:04X}h:{subindex:02X}",
                node=self.device.node_id,
                index=index,
                subindex=subindex,
                observed=f"NMT state {self.device.nmt.text}",
            )

    # Calls of the cycle.

    def commit(self, now: float) -> None:
        """Let event-driven outputs take effect, hold synchronous ones for SYNC, queue SDO and NMT."""
        pending, self._pending = self._pending, _NOTHING
        sources = self.capabilities.outputs
        if pending.cancel:
            self._sdo.cancel(pending.cancel)
        if self._rebooted:
            pending = self._only_stop(pending)
        if pending.sdo:
            self._sdo.add(pending.sdo, now)
        if pending.controlword is not None:
            self._last_controlword = pending.controlword
        for name in self._order:
            value = getattr(pending, name)
            if value is None:
                continue
            source = sources[name]
            if source is _SYNC_PDO:
                self._latched[name] = value
            elif source is _EVENT_PDO:
                self._apply(name, value)
            elif source is _SDO:
                self._send_by_sdo(name, value, now)
        if pending.nmt_stop and not self.device.dials.dead:
            self.device.nmt_command(NmtCommand.STOP)

    def _only_stop(self, pending: Outputs) -> Outputs:
        """The outputs that a node still gets after a boot-up message, as on a bus: stops, and requests."""
        refused = [
            request
            for request in pending.sdo
            if request.value is not None and not (request.index == _CONTROLWORD and _stops(request.value))
        ]
        self._sdo.refuse(refused)
        asked = tuple(request for request in pending.sdo if request not in refused)
        word = pending.controlword
        stop = word if word is not None and _stops(word) else None
        return Outputs(controlword=stop, sdo=asked, nmt_stop=pending.nmt_stop)

    def sample(self, now: float) -> None:
        """Take the synchronous inputs, which are received as soon as time passes."""
        if not self.device.operational or self.device.dials.dead:
            return
        values = _READ(self.drive)
        self._under_way = [(number, Sample(values[number], now)) for number in self._synchronous]

    def latch(self) -> None:
        """Let the synchronous outputs take effect."""
        if not self._latched:
            return
        latched, self._latched = self._latched, {}
        for name in self._order:
            if name in latched:
                self._apply(name, latched[name])

    def advance(self, now: float, emcy: tuple[Emcy, ...]) -> None:
        """Time has passed until ``now``: emergencies, heartbeats, event-driven and polled inputs, SDO."""
        device = self.device
        if self._under_way:
            self._receive()
        if emcy:
            self._emcy += emcy
        self._sdo.serve(now)
        boot_ups, self._boot_ups = self._boot_ups, device.boot_ups
        if device.dials.dead:
            return
        self._rebooted = self._rebooted or (self._in_service and boot_ups != self._boot_ups)
        if now >= self._next_beat - 1e-9 and device.nmt is not _INITIALISING:
            self._next_beat = now + self._node_heartbeat
            if not device.dials.heartbeat_stops:
                self.receive_state(now)
        if self._events:
            self._watch_events(now)
        if self._polled and now >= self._next_poll and device.answers_sdo:
            self._next_poll = now + self._sdo_poll + device.dials.sdo_delay
            self._take(self._polled, now)

    def _receive(self) -> None:
        under_way, self._under_way = self._under_way, []
        for number, sample in under_way:
            self._samples[number] = sample

    def know_state(self, now: float) -> None:
        """The node's NMT state is known at once, as after a boot-up that was watched."""
        self.receive_state(now)
        self._boot_ups = self.device.boot_ups
        self._next_beat = now + self._node_heartbeat

    def receive_state(self, now: float) -> None:
        """A heartbeat came."""
        self._last_beat, self._reported, self._nmt = now, self.device.nmt, int(self.device.nmt)
        self._in_service = self._in_service or self._reported is _OPERATIONAL

    def quick_stop(self) -> None:
        """Send the last controlword once more as a quick stop, if one was ever sent."""
        word = self._last_controlword
        if word is not None:
            self._latched.update(dict.fromkeys(self._offsets, 0))
            quick = word & ~(CW_QUICK_STOP_LOW | CW_FAULT_RESET) | CW_ENABLE_VOLTAGE
            self._latched.pop("controlword", None)
            if self.capabilities.outputs["controlword"] is ValueTransport.SYNC_PDO:
                self._latched["controlword"] = quick
            else:
                self._apply("controlword", quick)

    def _watch_events(self, now: float) -> None:
        if not self.device.operational:
            self._primed = False
            return
        if not self._primed:
            self._primed = True  # a node sends its event-driven PDOs when it becomes operational
            self._take(self._events, now)
            return
        values, timer = _READ(self.drive), self._event_timer
        for number in self._events:
            sample = self._samples[number]
            stale = timer is not None and sample is not None and now - sample.stamp >= timer - 1e-9
            if sample is None or stale or sample.value != values[number]:
                self._samples[number] = Sample(values[number], now)

    def _take(self, numbers: list[int], now: float) -> None:
        values = _READ(self.drive)
        for number in numbers:
            self._samples[number] = Sample(values[number], now)

    def _apply(self, name: str, value: int) -> None:
        """A value arrives in the drive by PDO."""
        if not self.device.operational or self.device.dials.dead:
            return
        if name == "mode":
            self.drive.write_mode(value)
        elif name != "controlword":
            setattr(self.drive, name, value)
        elif value != self.drive.controlword:
            self.drive.controlword = value
            self.drive.evaluate_controlword()

    def _send_by_sdo(self, name: str, value: int, now: float) -> None:
        if self._sent_by_sdo.get(name) != value:
            self._sent_by_sdo[name] = value
            self._sdo.add_write(OUTPUT_OBJECTS[name], value, now, urgent=name == "controlword")


def _stops(word: int) -> bool:
    """Whether a controlword is a quick stop or *disable voltage*."""
    running = word & CW_ENABLE_VOLTAGE and word & CW_QUICK_STOP_LOW
    return not running and not word & CW_FAULT_RESET


def _overtakes(outputs: dict[str, ValueTransport]) -> bool:
    """Whether a controlword takes effect before the target of the same cycle, which waits for SYNC."""
    return outputs["target_position"] is _SYNC_PDO and outputs["controlword"] not in (
        _SYNC_PDO,
        ValueTransport.NONE,
    )
