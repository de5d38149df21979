"""The state of a machine without its axes: bus load, cycle, and connected programs; as texts and as values."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cli.shared.buses import rate_of
from axisbus.machine.machine import Machine

_SHORTEST = 0.1  # seconds, the shortest time over which a load is computed


class _Traffic(NamedTuple):
    """The traffic of a bus: frames per second, and the load, if the bit rate is known."""

    frames: float
    load: tuple[float, float] | None


class MachineStatus:
    """Observe a machine repeatedly; holds the bus counters of the last computed load."""

    def __init__(self, machine: Machine) -> None:
        """Start counting; blocks for an answer of the core."""
        self._machine = machine
        self._rate = rate_of(machine.cell)
        self._before = machine.bus_traffic
        self._traffic: _Traffic | None = None

    def lines(self) -> list[str]:
        """Return lines for people: bus, cycle, and other programs if there are any; blocks for answers of the core."""
        return [line for line in (self._bus(), self._cycle(), self._programs()) if line]

    def values(self) -> dict[str, object]:
        """Return the same as plain values; the load is None at the first call, and if the bit rate is unknown."""
        traffic = self._read_traffic()
        load = None if traffic is None else traffic.load
        jitter = self._machine.cycle_jitter
        return {
            "frames_per_second": None if traffic is None else traffic.frames,
            "load_least": None if load is None else load[0],
            "load_worst": None if load is None else load[1],
            "cycles": jitter.cycles,
            "skipped": jitter.skipped,
            "late_p50": jitter.p50,
            "late_p99": jitter.p99,
            "late_worst": jitter.worst,
            "programs": [{"who": each.who, "commands": each.commands} for each in self._machine.programs],
        }

    def _read_traffic(self) -> _Traffic | None:
        before, now = self._before, self._machine.bus_traffic
        if before is None or now is None or now.time < before.time + _SHORTEST:
            return self._traffic
        load = None if self._rate is None else now.load(before, self._rate)
        self._traffic = _Traffic((now.frames - before.frames) / (now.time - before.time), load)
        self._before = now
        return self._traffic

    def _bus(self) -> str:
        traffic = self._read_traffic()
        if traffic is None:
            return ""
        full = f"{traffic.frames:.0f} frames/s"
        if traffic.load is not None and self._rate is not None:
            lowest, highest = traffic.load
            full = f"{lowest:.0%} to {highest:.0%} of {self._rate / 1000:g} kbit/s, {full}"
        events = self._machine.bus_events
        return f"bus: {full}" + (f"; the controller is {events[-1].condition.value}" if events else "")

    def _cycle(self) -> str:
        return f"cycle of {self._machine.cell.bus.scan_period * 1000:g} ms: {self._machine.cycle_jitter}"

    def _programs(self) -> str:
        programs = self._machine.programs
        if len(programs) < 2:
            return ""
        holder = next((each.who for each in programs if each.commands), "nobody")
        others = "; ".join(each.who for each in programs if not each.commands)
        return f"{holder} has control; other clients: {others}"
