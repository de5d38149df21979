"""Bringing one node up: find it, make sure that it is the one that was meant, configure it, start it, and report.

Theory of operation
-------------------
Two rules:

1. Boot-up energises nothing. It sends no controlword; it writes objects, maps PDOs, and starts the node (NMT).
2. A drive found enabled is left as it is: it gets no configuration and no new mapping (a half-configured moving axis is worse than
   an unconfigured one), and the report says so. ``axis.enable()`` takes it over, ``axis.disable()`` switches it off.

The steps are the same for a node on a bus and for a stand-in without one; ``Comms`` is what only a bus has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol, TypeVar

from axisbus.cia402 import modes, options
from axisbus.cia402 import objects as o
from axisbus.cia402.port import Capabilities, Source
from axisbus.cia402.state import ENERGISED, State, decode
from axisbus.drives import registry
from axisbus.drives.make import Make
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, BootError
from axisbus.machine import dcf, proposal
from axisbus.machine import identity as ids
from axisbus.machine.access import Objects, read_int
from axisbus.machine.cell import AxisConfig, CellConfig, NodeConfig
from axisbus.machine.configure import Watch, write_all, writes_of
from axisbus.machine.parameters import axis_parameters
from axisbus.machine.report import AxisReport, NodeReport
from axisbus.machine.stopping import Watchdog, stop_ladder
from axisbus.machine.writes import own_index
from axisbus.motion.parameters import AxisParameters

_NO_WINDOW = 0xFFFF_FFFF
_T = TypeVar("_T")


class Comms(Protocol):
    """What boot-up needs of the bus beside SDO; a stand-in without a bus has none of its own."""

    def find(self) -> None:
        """Make sure that the node is there; raises ``NodeTimeout``."""

    def prepare(self, disturb: bool) -> None:
        """Bring the node to pre-operational, unless it must not be disturbed."""

    def connect(self, axis: AxisConfig, disturb: bool, sync_needed: bool) -> Capabilities:
        """Plan and set the PDOs of one axis; return how its values travel."""

    def watch(self, timeout: float | None) -> None:
        """Expect the node's heartbeat from now on; ``timeout`` in seconds."""

    def guard(self, period: float) -> None:
        """Ask for the node's state every ``period`` seconds from now on (node guarding)."""

    def start(self) -> str:
        """Start the node; return its NMT state in words."""


@dataclass(slots=True)
class Booted:
    """A node that is up: what it reported, the parameters of its axes, and how to let it go again."""

    report: NodeReport
    parameters: dict[str, AxisParameters]
    watch: Watch | None = None
    found_enabled: bool = False


class NodeBoot:
    """The boot-up of one node; holds what was found on the way."""

    def __init__(self, cell: CellConfig, node_id: int, eds: Eds, objects: Objects, comms: Comms) -> None:
        self._cell = cell
        self._node: NodeConfig = cell.nodes[node_id]
        self._eds = eds
        self._objects = objects
        self._comms = comms
        self._report = NodeReport(node_id)
        self._axes = list(cell.axes_of(node_id))
        self._power: dict[str, State] = {}
        self._make: Make = registry.find(None, None)
        self._watch = Watch(objects, cell.bus)

    def run(self) -> Booted:
        """Do all steps; blocks for some dozen SDO transfers. What fails stands in the report, and is not raised."""
        parameters: dict[str, AxisParameters] = {}
        try:
            self._step("find", self._comms.find)
            self._step("identity", self._identify)
            self._step("state", self._look)
            self._step("pre-operational", lambda: self._comms.prepare(not self.found_enabled))
            self._step("configuration", self._configure)
            self._step("watchdog", self._arm)
            for axis in self._axes:
                parameters[axis.name] = self._step(f"axis {axis.name}", partial(self._axis, axis))
            self._step("start", self._start)
        except AxisbusError as error:
            self._report.error = error
        return Booted(self._report, parameters, self._watch, self.found_enabled)

    @property
    def found_enabled(self) -> bool:
        """Whether a drive of the node drives its motor already."""
        return any(state in ENERGISED for state in self._power.values())

    def _step(self, name: str, work: Callable[[], _T]) -> _T:
        try:
            result = work()
        except AxisbusError as error:
            raise boot_error(self._objects.node_id, name, error) from error
        self._report.steps.append(name)
        return result

    def _identify(self) -> None:
        found = ids.read(self._objects)
        ids.require_same(found, self._eds, self._objects.node_id, self._node.file or "")
        self._make = registry.find(found.vendor_id, found.product_code)
        self._report.device = f"{found.name or self._make.name}"
        self._report.identity = found.text()
        self._report.warnings += ids.differences(found, self._eds)

    def _look(self) -> None:
        """See what the drives are doing before anything is written."""
        for axis in self._axes:
            word = read_int(self._objects, own_index(o.STATUSWORD, axis.drive_axis))
            self._power[axis.name] = State.UNKNOWN if word is None else decode(word)

    def _configure(self) -> None:
        if self.found_enabled:
            self._report.configured = "NOT configured: a drive of this node was found enabled"
            self._report.warnings.append(
                "found enabled: left as it is and not configured; take it over with enable() or switch it off with disable()"
            )
            return
        self._watch.set_sync()
        dictionary = Dictionary(self._eds, self._objects.node_id)
        by_dcf = dcf.apply(self._objects, self._cell, self._eds, self._make)
        count = write_all(
            self._objects, writes_of(self._cell, self._objects.node_id, dictionary), self._cell.file
        )
        self._report.configured = f"{count} objects written and read back"
        if by_dcf:
            self._report.configured += f", {by_dcf} are as its DCF says"
        self._comms.watch(self._watch.produce())

    def _arm(self) -> None:
        codes = [self._option(axis, options.CONNECTION_LOSS) for axis in self._axes]
        reaction = None
        if codes and all(code is not None for code in codes):
            reaction = "; ".join(
                sorted({options.CONNECTION_LOSS.meaning(code) for code in codes if code is not None})
            )
        report = self._watch.arm(reaction)
        self._report.watchdog = report
        if self._watch.guarding is not None:
            self._comms.guard(self._watch.guarding)
        if report.kind is Watchdog.NONE:
            self._report.warnings.append(report.text)

    def _axis(self, axis: AxisConfig) -> AxisParameters:
        parameters = self._live_parameters(axis)
        how = self._comms.connect(axis, not self.found_enabled, bool(list(self._cell.groups_of(axis.name))))
        codes = {option.index: self._option(axis, option) for option in options.ALL}
        ladder = stop_ladder(axis.name, codes, parameters.stop_times, parameters.holds_load)
        self._report.warnings += ladder.warnings
        values = {
            (index, sub): read_int(self._objects, own_index(index, axis.drive_axis), sub)
            for index, sub in proposal.OBJECTS
        }
        scale = proposal.compare(parameters.units.position, values)
        if scale.agrees is False:
            self._report.warnings.append(f"{axis.name}: scale {scale.configured}, but {scale.proposed}")
        self._report.axes.append(
            AxisReport(
                axis.name,
                self._power[axis.name].value,
                self._power[axis.name] in ENERGISED,
                tuple(modes.short(mode) for mode in sorted(parameters.modes)),
                _travels(how),
                how.outputs.get("controlword") is Source.SYNC_PDO,
                ladder,
                scale,
            )
        )
        return parameters

    def _live_parameters(self, axis: AxisConfig) -> AxisParameters:
        """What cell file and EDS say, mended by what the drive itself says."""
        parameters = axis_parameters(self._cell, axis.name, self._eds, self._make)
        window = read_int(self._objects, own_index(o.POSITION_WINDOW, axis.drive_axis))
        if parameters.position_window is None and window and window != _NO_WINDOW:
            parameters = replace(parameters, position_window=window)
        claimed = read_int(self._objects, own_index(o.SUPPORTED_DRIVE_MODES, axis.drive_axis))
        if axis.modes is None and claimed is not None:
            parameters = replace(parameters, modes=parameters.modes | frozenset(modes.supported(claimed)))
        holds = self._option(axis, options.QUICK_STOP) in options.HOLDING_QUICK_STOPS
        return replace(parameters, quick_stop_holds=holds)

    def _option(self, axis: AxisConfig, option: options.OptionCode) -> int | None:
        return read_int(self._objects, own_index(option.index, axis.drive_axis), option.subindex)

    def _start(self) -> None:
        self._report.nmt = self._comms.start()


def _travels(how: Capabilities) -> str:
    """Return how values travel, grouped: ``synchronous PDO: statusword, position; SDO: torque``."""
    groups: dict[Source, list[str]] = {}
    for name, source in (*how.outputs.items(), *how.inputs.items()):
        if name.replace("_", " ") not in groups.setdefault(source, []):
            groups[source].append(name.replace("_", " "))
    return "; ".join(f"{source.value}: {', '.join(names)}" for source, names in groups.items())


def boot_error(node_id: int, step: str, error: AxisbusError) -> AxisbusError:
    """Return an error of a step as one that names node and step."""
    if isinstance(error, BootError):
        return error
    failed = BootError(
        f"node {node_id}, step {step}: {error.message}",
        node=node_id,
        step=step,
        index=getattr(error, "index", None),
        subindex=getattr(error, "subindex", 0),
        observed=error.observed,
        remedy=error.remedy,
    )
    failed.__cause__ = error
    return failed
