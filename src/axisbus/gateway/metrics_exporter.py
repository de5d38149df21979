"""The metrics of a machine as families of Prometheus, made at each scrape.

Theory of operation
-------------------
The bridge joins the machine as any program does, and commands nothing. Values that are unknown or too old are left out: a metric
that is present is up to date, and ``axisbus_up`` is 0 if no machine runs. Counters of the core restart with each machine, as
Prometheus expects after a restart. Counters of the bridge itself (emergency messages, node events, data lost by programs) count
from its start.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from math import inf
from typing import Protocol

from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
    Metric,
)

from axisbus.boot.report import NodeReport
from axisbus.bus.link.ownership import command_of
from axisbus.errors import AxisbusError, StaleError
from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.session import LATENESS_BOUNDS, LatenessReport

_VALUES = {
    "position": "Actual position, in the axis's unit.",
    "velocity": "Actual velocity, in the axis's unit per second.",
    "torque": "Actual torque in N·m, or as a fraction of the rated torque if that is not given.",
    "following_error": "Demand minus actual position, in the axis's unit.",
}
_BOUNDS = ["+Inf" if bound == inf else repr(bound) for bound in LATENESS_BOUNDS]
_READER = ("program",)


class Exporter:
    """Hold the observed machine, None if none runs, and the counts; the server calls it, in any thread."""

    def __init__(self) -> None:
        self.machine: Machine | None = None
        self._emcy, self._events = MetricCounters(), MetricCounters()
        self._cycles, self._frames = Growth(), Growth()

    def poll(self) -> None:
        """Count new events; to be called about once a second, because the lists of a machine are short. May block briefly."""
        machine = self.machine
        if machine is None:
            return
        for report in machine.reports:
            node = machine.node(report.node_id)
            name = str(report.node_id)
            codes = ((each, (name, f"{each.code:04X}"), 1) for each in tuple(node.emcy))
            self._emcy.take(report.node_id, codes)
            events = ((each, (name, each.kind.name.lower()), each.times) for each in node.events)
            self._events.take(report.node_id, events)
        programs = machine.programs
        self._cycles.take((each.who, command_of(each.who), each.lost_cycles) for each in programs)
        self._frames.take((each.who, command_of(each.who), each.lost_frames) for each in programs)

    def collect(self) -> Iterable[Metric]:
        """Return all families; those that are unavailable now are left out."""
        machine = self.machine
        alive = machine is not None and machine.session.silent is None
        yield GaugeMetricFamily(
            "axisbus_up", "Whether the machine runs, and its process image is current.", float(alive)
        )
        for name, description, counts, labels in self._counted():
            family = CounterMetricFamily(f"axisbus_{name}", description, labels=labels)
            for values, count in list(counts.items()):
                family.add_metric(values, count)
            yield family
        if machine is not None and alive:
            for part in (_machine, _sdo, _nodes, _axes):
                yield from _all_of(part(machine))

    def _counted(self) -> Iterator[tuple[str, str, Counts, tuple[str, ...]]]:
        yield "emcy", "Emergency messages (CiA 301 7.2.7).", self._emcy.counts, ("node", "code")
        yield "node_events", "Events of error control.", self._events.counts, ("node", "event")
        yield (
            "lost_cycles",
            "Cycles that a program observed but did not receive in time.",
            self._cycles.counts,
            _READER,
        )
        yield (
            "lost_frames",
            "Frames that a program listened to but did not receive in time.",
            self._frames.counts,
            _READER,
        )


def _all_of(families: Iterator[Metric]) -> list[Metric]:
    """Return those of some families that can be read: the machine may end meanwhile."""
    found: list[Metric] = []
    with suppress(AxisbusError):  # ``axisbus_up`` reports it at the next scrape
        found.extend(families)
    return found


def _machine(machine: Machine) -> Iterator[Metric]:
    yield InfoMetricFamily(
        "axisbus_machine", "The real-time status of the core.", {"degree": machine.real_time_status}
    )
    yield from _cycle(machine.cycle_jitter)
    traffic = machine.bus_traffic
    if traffic is not None:
        yield CounterMetricFamily(
            "axisbus_bus_frames", "Frames on the bus, in both directions.", traffic.frames
        )
        yield CounterMetricFamily("axisbus_bus_octets", "Their data.", traffic.octets)
    yield GaugeMetricFamily(
        "axisbus_bus_bitrate", "Bit rate of the bus, in bit/s.", machine.cell.bus.bitrate or 0
    )


def _cycle(lateness: LatenessReport) -> Iterator[Metric]:
    yield CounterMetricFamily("axisbus_cycles", "Executed cycles.", lateness.cycles)
    skipped = CounterMetricFamily("axisbus_skipped_cycles", "Skipped cycles, by reason.", labels=("cause",))
    for cause, count in lateness.causes.items():
        skipped.add_metric((cause,), count)
    yield skipped
    yield HistogramMetricFamily(
        "axisbus_cycle_lateness_seconds",
        "How late cycles began.",
        buckets=list(zip(_BOUNDS, lateness.within, strict=True)),
        sum_value=lateness.total,
    )
    yield GaugeMetricFamily(
        "axisbus_cycle_lateness_worst_seconds",
        "The largest lateness since the machine started.",
        lateness.worst,
    )


def _sdo(machine: Machine) -> Iterator[Metric]:
    ends = CounterMetricFamily("axisbus_sdo_transfers", "SDO transfers, by result.", labels=("node", "end"))
    retry_family = CounterMetricFamily(
        "axisbus_sdo_retries", "Attempts after the first of each transfer.", labels=("node",)
    )
    for count in machine.sdo_counts:
        for end, number in count.ends.items():
            ends.add_metric((str(count.node), end.value), number)
        retry_family.add_metric((str(count.node),), count.retries)
    yield from (ends, retry_family)


def _nodes(machine: Machine) -> Iterator[Metric]:
    state = GaugeMetricFamily("axisbus_node_nmt_state", "The reported NMT state.", labels=("node", "state"))
    booted = GaugeMetricFamily(
        "axisbus_node_booted", "Whether the node has come up.", labels=("node", "device")
    )
    retry_family = GaugeMetricFamily(
        "axisbus_node_boot_retries", "Requests that its boot-up repeated.", labels=("node",)
    )
    for report in machine.reports:
        name = str(report.node_id)
        state.add_metric((name, machine.node(report.node_id).nmt.text), 1.0)
        booted.add_metric((name, report.device), float(_booted(report)))
        if report.outcome is not None:
            retry_family.add_metric((name,), report.outcome.retries)
    yield from (state, booted, retry_family)


def _booted(report: NodeReport) -> bool:
    return report.error is None and not report.absent


def _axes(machine: Machine) -> Iterator[Metric]:
    state = GaugeMetricFamily("axisbus_axis_state", "The axis's PLCopen state.", labels=("axis", "state"))
    failed = GaugeMetricFamily("axisbus_axis_error", "Whether the axis has an error.", labels=("axis",))
    values = {
        name: GaugeMetricFamily(f"axisbus_axis_{name}", description, labels=("axis", "unit"))
        for name, description in _VALUES.items()
    }
    for axis in machine:
        state.add_metric((axis.name, axis.state.value), 1.0)
        failed.add_metric((axis.name,), float(axis.error is not None))
        for name, family in values.items():
            found = _value(axis, name)
            if found is not None:
                family.add_metric((axis.name, axis.unit), found)
    yield from (state, failed, *values.values())


def _value(axis: Axis, name: str) -> float | None:
    try:
        return float(getattr(axis, name))
    except StaleError:
        return None


# -- Count events that a machine reports once: emergency messages, error control events, samples lost by programs ------


Counts = Counter[tuple[str, ...]]
_MAX_NAMES = 32  # the most names with a count of their own
_OTHERS = "others"


class Stamped(Protocol):
    """An item with a time (s, monotonic)."""

    @property
    def stamp(self) -> float:
        """The time at which it arrived."""


class MetricCounters:
    """Count new items of lists that store only the last ones; holds the counts, and the newest time of each list."""

    def __init__(self) -> None:
        self.counts: Counts = Counter()
        self._newest: dict[object, float] = {}

    def take(self, key: object, items: Iterable[tuple[Stamped, tuple[str, ...], int]]) -> None:
        """Count the items of a list that are newer than all seen before: each item with its labels and its multiplicity.

        ``key`` identifies the list, also for the next machine, because the clock is the computer's. Items of the first call count
        as well.
        """
        before = newest = self._newest.get(key, float("-inf"))
        for item, labels, times in items:
            if item.stamp > before:
                self.counts[labels] += times
                newest = max(newest, item.stamp)
        self._newest[key] = newest


class Growth:
    """Count the growth of numbers that begin with 0 for each source; holds the counts by name, and the last numbers."""

    def __init__(self) -> None:
        self.counts: Counts = Counter()
        self._last_counts: Counter[str] = Counter()

    def take(self, items: Iterable[tuple[str, str, int]]) -> None:
        """Count the growth since the last call: for each source its identity, its name (several may share one) and its number.

        ``items`` are all present sources. After 32 names, further ones count as ``others``.
        """
        now: Counter[str] = Counter()
        names: dict[str, str] = {}
        for who, name, number in items:
            now[who] += number
            names[who] = name
        for who, name in names.items():
            self.counts[self._label(name)] += max(0, now[who] - self._last_counts[who])
        self._last_counts = now

    def _label(self, name: str) -> tuple[str]:
        known = (name,) in self.counts or len(self.counts) < _MAX_NAMES
        return (name if known else _OTHERS,)
