"""Boot one node: find it, check its identity, configure it, start it, and report.

Theory of operation
-------------------
Two rules:

1. Boot-up energises nothing. It sends no controlword; it writes objects, maps PDOs, and starts the node (NMT).
2. A drive found enabled is left as it is: it gets no configuration and no new mapping (a half-configured moving axis is worse than
   an unconfigured one), and the report says so. ``axis.enable()`` takes control of it, ``axis.disable()`` switches it off.

``cia302.bootup`` defines the order of the steps, their tries and their letters. This module adds the needs of a drive: reading the
state of its power stage before anything is written, the watchdogs, the PDOs, and the report. ``CanComms`` contains the services of
the bus that it uses beside SDO.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TypeVar

from axisbus.boot import dcf, error_state, io, nameplate_comparison, program_text
from axisbus.boot import failure as ids
from axisbus.boot.comms import CanComms
from axisbus.boot.configure import DriveMonitoringSetup, plan_of, set_services
from axisbus.boot.demand import demand_text
from axisbus.boot.failure import (
    NAMES_NO_ERROR,
    OTHER_DEVICE,
    SILENT_OR_STRANGE,
    as_error,
    at_step,
    with_facts,
)
from axisbus.boot.objects import NodeObjects, Progress, read_int
from axisbus.boot.report import AxisReport, Booted, NodeReport
from axisbus.boot.requests import Answerer, Locals
from axisbus.boot.stop_report import Watchdog, stop_sequence_report
from axisbus.cell import scale_proposal, sync_window
from axisbus.cell.axis_description import Drive, by_make, of_make
from axisbus.cell.cyclic_modes import carried, feed_forward, led_modes
from axisbus.cell.io_signals import points_of
from axisbus.cell.model import AxisConfig, CellConfig, NodeConfig
from axisbus.cell.parameters import axis_parameters, braking_of, fixed_ramps, known_units, mode_list
from axisbus.cell.parameters import modes as used_modes
from axisbus.cell.read_only_values import contradictions
from axisbus.cell.writes import node_writes
from axisbus.cia301 import objects as o301
from axisbus.cia302.bootup import boot_up
from axisbus.cia302.types import DEADLINE, Address, BootOutcome, BootPhase, ErrorControl, Letter
from axisbus.cia402 import modes, options
from axisbus.cia402 import objects as o
from axisbus.cia402.axes import own_index
from axisbus.cia402.port import Capabilities, ValueTransport
from axisbus.cia402.state import ENERGISED, PowerState, decode
from axisbus.drives import registry
from axisbus.drives.plugin import GENERIC
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, BootError, ConfigError, NodeError, SdoError
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.promises import promises
from axisbus.wording import counted

_NO_WINDOW = 0xFFFF_FFFF
_T = TypeVar("_T")


class NodeBoot:
    """The boot-up of one node; holds the results of its steps."""

    def __init__(
        self,
        cell: CellConfig,
        node_id: int,
        eds: Eds,
        objects: NodeObjects,
        comms: CanComms,
        progress: Progress | None = None,
        late: bool = False,
        again: bool = False,
        before: Mapping[Address, int] | None = None,
        on_step: Callable[[str], None] = lambda _: None,
    ) -> None:
        """``progress(done, all)`` gets the bytes of a program download; ``late``: the node boots while the machine runs.

        ``again``: this machine has booted the node before, so a drive found enabled is one that the machine may have to stop.
        ``before``: the identity of the only device that is booted; None: any that fits cell file and EDS.
        ``on_step`` gets the name of each step as it begins.
        """
        self._cell = cell
        self._node: NodeConfig = cell.nodes[node_id]
        self._eds = eds
        self._objects = objects
        self._comms = comms
        self._progress = progress
        self._late = late
        self._again = again
        self._on_step = on_step
        self._identity = ids.expected(self._node, eds)
        self._before = ids.unspecified(before or {}, self._identity)
        self._report = NodeReport(node_id)
        self._axes = [of_make(axis, self._node, eds) for axis in cell.axes_of(node_id)]
        self._power: dict[str, PowerState] = {}
        self._make = GENERIC
        self._watch = DriveMonitoringSetup(objects, cell.bus)
        self._parameters: dict[str, AxisParameters] = {}
        self._restarts: int | None = None
        self._by_dcf = 0

    def run(self) -> Booted:
        """Do all steps; the report contains an error, which is not raised.

        Blocks for several dozen SDO transfers, and for minutes if the node's program is replaced.
        """
        self._report.optional = self._node.optional
        answerer = Answerer(self._objects, self._comms, self._locals(), self._progress)
        try:
            tries = self._comms.find_tries
            identity = self._identity | ids.as_before(self._before)
            plan = plan_of(self._cell, self._objects.node_id, self._eds, identity, tries, self._late)
            with self._comms.repeating_busy():
                outcome = answerer.run(boot_up(plan))
            self._finish(outcome, answerer)
        except AxisbusError as error:
            self._report.error = at_step(self._objects.node_id, "configuration", error)
        return Booted(self._report, self._parameters, self._watch, self.found_enabled)

    def _locals(self) -> Locals:
        return {
            BootPhase.STEP: lambda known: self._on_step(known.step),
            BootPhase.LOOK: lambda known: self._step("state", partial(self._look, known)),
            BootPhase.PREPARE: lambda known: self._step("configuration", partial(self._prepare, known)),
            BootPhase.CONFIGURE: lambda _: self._step("configuration", self._apply_dcf),
            BootPhase.COMPLETE: self._complete,
        }

    def _finish(self, outcome: BootOutcome, answerer: Answerer) -> None:
        report = self._report
        report.outcome = outcome
        report.steps = list(outcome.done)
        if not outcome.ok:
            cause = self._comms.no_answer_error() if outcome.letter is Letter.B else answerer.error
            report.error = self._failure(outcome, cause)
            if outcome.letter not in SILENT_OR_STRANGE:
                self._add_errors(report.error, always=outcome.step == "start")
            return
        report.nmt = self._comms.state()
        report.program = program_text.line(outcome.program)
        if self.found_enabled:
            report.configured = "NOT configured: a drive of this node was found enabled"
        elif any(text.startswith("configuration") for text in outcome.skipped):
            report.configured = "not configured again: 1020h has the date and time that the cell file expects"
        else:
            report.configured = f"{counted(outcome.written, 'object')} written and read back"
            if self._by_dcf:
                report.configured += f", {self._by_dcf} have the values of its DCF"

    def _failure(self, outcome: BootOutcome, cause: AxisbusError | None) -> AxisbusError:
        if outcome.letter not in OTHER_DEVICE or outcome.address not in self._before:
            return as_error(outcome, self._node, cause)
        serial = outcome.identity.get(ids.SERIAL)
        with self._comms.trying(1, DEADLINE), suppress(SdoError):
            serial = serial or read_int(self._objects, *ids.SERIAL)  # if another part of the identity differs
        return with_facts(ids.swapped(outcome, self._before, serial), outcome)

    def _add_errors(self, error: AxisbusError, *, always: bool) -> None:
        """Add the errors that the node reports. If it reports none, add that only if ``always`` is set."""
        last, ago = self._comms.last_emcy() or (None, 0.0)
        with self._comms.trying(1, DEADLINE):
            found = error_state.read(self._objects, last, ago)
        if always or found.has_error:
            error.observed = "; ".join(filter(None, (error.observed, found.words(self._make))))
        if always and not found.has_error:
            error.remedy = NAMES_NO_ERROR

    @property
    def found_enabled(self) -> bool:
        """Whether a drive of the node already energises its motor."""
        return any(state in ENERGISED for state in self._power.values())

    def _step(self, name: str, work: Callable[[], _T]) -> _T:
        try:
            return work()
        except BootError:
            raise
        except AxisbusError as error:
            raise at_step(self._objects.node_id, name, error) from error

    def _identify(self, found: Mapping[Address, int]) -> None:
        vendor, product, revision = (
            found.get((o301.IDENTITY, sub))
            for sub in (o301.VENDOR_ID, o301.PRODUCT_CODE, o301.REVISION_NUMBER)
        )
        self._make = registry.find(vendor, product, revision, self._node.makes)
        with self._comms.trying(1, DEADLINE):  # the name is only shown
            self._report.device = ids.heading(self._objects, found, self._make)
        self._report.identity = ids.text(found)
        self._report.warnings += ids.differences(found, self._eds)
        with self._comms.trying(1, DEADLINE):
            self._report.changed = tuple(
                nameplate_comparison.changed(self._objects, self._cell, self._objects.node_id)
            )

    def _look(self, known: BootOutcome) -> bool:
        """Read the identity and the drives' states before anything is written; return whether the node may be configured."""
        self._identify(known.identity)
        self._comms.follow_emcy()
        for axis in self._axes:
            word = self._value(axis, o.STATUSWORD)
            self._power[axis.name] = PowerState.UNKNOWN if word is None else decode(word)
        if self.found_enabled and self._again:
            raise self._still_enabled()
        if self.found_enabled:
            self._report.warnings.append(
                "found enabled: left unchanged and not configured; take it over with enable() or switch it off with disable()"
            )
        return not self.found_enabled

    def _still_enabled(self) -> BootError:
        names = ", ".join(name for name, state in self._power.items() if state in ENERGISED)
        return BootError(
            f"node {self._objects.node_id} is not booted again: its drive is enabled ({names})",
            node=self._objects.node_id,
            step="state",
            index=o.STATUSWORD,
            observed="nothing was changed in it; the axis may still be held, or move",
            remedy=f"TREAT {names} AS MOVING; switch it off: axis.disable(), or the emergency stop; then boot the node again",
        )

    def _prepare(self, known: BootOutcome) -> None:
        if known.program is not None and known.program.replaced:
            self._report.warnings.clear()  # they were about the previous revision
            self._identify(known.identity)
        self._restarts = self._comms.restarts()
        set_services(self._objects, self._cell.bus)

    def _apply_dcf(self) -> None:
        """Apply the DCF before the cell file's own objects; skipped if 1020h has the expected date and time (CiA 302-2)."""
        self._by_dcf = dcf.apply(self._objects, self._cell, self._eds, self._make)

    def _require_no_restart(self) -> None:
        """Raise if the node has restarted meanwhile: its configuration is lost, and it must not start with half of it."""
        if self._restarts is not None and self._comms.restarts() != self._restarts:
            raise NodeError(
                f"node {self._objects.node_id} restarted while it was being configured",
                node=self._objects.node_id,
                observed="it sent a boot-up message, and the values written before are lost",
                remedy="check its supply, and look for another master or tool that resets it; then boot again",
            )

    def _complete(self, known: BootOutcome) -> None:
        """Do the last steps before the start: monitoring on both sides, and the axes with their PDOs."""
        if not self.found_enabled:
            self._comms.watch(known.consumer)
        self._step("watchdog", partial(self._arm, known.control))
        for axis in self._axes:
            self._parameters[axis.name] = self._step(f"axis {axis.name}", partial(self._axis, axis))
        self._step("inputs and outputs", self._io)
        separate = partial(self._comms.separate_cob_ids, disturb=not self.found_enabled)
        self._report.warnings += self._step("PDO configuration", separate)
        self._step("configuration", self._look_at_sync)
        self._step("watchdog", self._arm_deadlines)
        self._add_unread_watchdog()
        self._step("restart", self._require_no_restart)

    def _io(self) -> None:
        """Connect the inputs and outputs, after the axes, whose PDOs come first. A node found enabled is not connected."""
        dictionary = Dictionary(self._eds, self._objects.node_id)
        points = points_of(self._cell, self._objects.node_id, dictionary)
        if not points:
            return
        if self.found_enabled:
            names = ", ".join(point.name for point in points)
            self._report.warnings.append(f"found enabled: {names} cannot be read or set")
            return
        given = [write.address for write in node_writes(self._node, dictionary)]
        listed = io.prepare(self._objects, points, alone=not self._axes, given=given)
        self._report.io = (f"transmitted by {self._comms.connect_io(points)}", *listed)

    def _look_at_sync(self) -> None:
        """Warn if the node may not react to SYNC, expects it with another period, or may discard RPDOs after it."""
        if not any(axis.in_one_sync for axis in self._report.axes):
            return
        if read_int(self._objects, o301.COB_ID_SYNC) is None:
            self._report.warnings.append(
                "it has no 1005h (COB-ID SYNC), so it may not react to SYNC: if its values stay unknown, or its axes do not move, "
                "write sync = false in [bus], or transmission = 255 for each of its PDOs "
                f"([nodes.{self._objects.node_id}.pdo.tpdo1] ...)"
            )
        bus, window = self._cell.bus, read_int(self._objects, o301.SYNC_WINDOW)
        if sync_window.misses(window, bus):
            remedy = sync_window.remedy(self._objects.node_id)
            self._report.warnings.append(
                f"it may discard the master's synchronous RPDOs: {sync_window.closes(window, bus)}; {remedy}"
            )
        period = read_int(self._objects, o301.CYCLE_PERIOD)
        if sync_window.has_other_period(period, bus):
            remedy = sync_window.period_remedy(self._objects.node_id, bus)
            self._report.warnings.append(
                f"it expects SYNC with another period: {sync_window.other_period(period, bus)}; {remedy}"
            )

    def _arm(self, control: ErrorControl) -> None:
        self._comms.begin_heartbeat()  # before a node monitors it
        self._report.watchdog = self._watch.arm(self._reaction())
        if self._watch.guarding is not None:
            self._comms.guard(self._watch.guarding)
        elif control is ErrorControl.GUARDING and self._cell.bus.heartbeat is not None:
            self._comms.guard(self._cell.bus.heartbeat)

    def _arm_deadlines(self) -> None:
        report = self._report.watchdog
        if report is None or report.kind is not Watchdog.NONE:
            return
        if not self.found_enabled:
            report = self._watch.arm_deadlines(self._comms.cyclic_rpdos(), self._reaction())
            self._report.watchdog = report
        if report.kind is Watchdog.NONE:
            self._report.warnings.append(report.text)

    def _add_unread_watchdog(self) -> None:
        """Add the watchdog of the make that no object reads."""
        report, unread = self._report.watchdog, self._make.unread_watchdog
        if report is not None and unread:
            self._report.watchdog = replace(report, text=f"{report.text}; {unread}")

    def _reaction(self) -> str | None:
        """Return the drives' reaction to the loss of the master (6007h), None if a drive has no 6007h.

        A node without axes reacts as CiA 301 defines (7.5.2.32); the report of its outputs has more.
        """
        if not self._axes:
            return "changes to pre-operational, or reacts as its 1029h defines"
        codes = [self._option(axis, options.CONNECTION_LOSS) for axis in self._axes]
        if None in codes:
            return None
        return "; ".join(
            sorted({options.CONNECTION_LOSS.meaning(code) for code in codes if code is not None})
        )

    def _axis(self, axis: AxisConfig) -> AxisParameters:
        values = {key: self._value(axis, *key) for key in scale_proposal.OBJECTS}
        parameters = self._live_parameters(axis, values)
        how = self._comms.connect(axis, disturb=not self.found_enabled)
        configured, parameters = parameters.feed_forward, carried(parameters, how.outputs)
        if parameters.feed_forward is not configured:
            self._report.warnings.append(
                f"{axis.name}: no feed-forward is sent: its PDOs do not contain it, and were left unchanged"
            )
        codes = {option.index: self._option(axis, option) for option in options.ALL}
        stop_sequence = stop_sequence_report(axis.name, codes, parameters.stop_times, parameters.holds_load)
        self._report.warnings += stop_sequence.warnings
        scale = scale_proposal.compare(parameters.units.position, values)
        self._require_units(axis, values, scale)
        if scale.agrees is False:
            self._report.warnings.append(f"{axis.name}: scale {scale.configured}, but {scale.proposed}")
        self._report.warnings += self._read_only(axis, parameters)
        rated = scale_proposal.compare_torque(axis.rated_torque, self._read(axis, o.RATED_TORQUE))
        if rated is not None and rated.agrees is False:
            self._report.warnings.append(
                f"{axis.name}: rated_torque {rated.configured}, but {rated.proposed}"
            )
        self._report.axes.append(
            AxisReport(
                axis.name,
                self._power[axis.name].value,
                self._power[axis.name] in ENERGISED,
                *self._modes_shown(axis, parameters),
                _transport_text(how),
                self._comms.event_timers(axis),
                how.outputs.get("controlword") is ValueTransport.SYNC_PDO,
                stop_sequence,
                scale,
                rated,
                promises(parameters),
                demand_text(parameters, how.inputs.get("demand", ValueTransport.NONE)),
                by_make(self._cell.axes[axis.name], self._node, self._eds),
            )
        )
        return parameters

    def _read_only(self, axis: AxisConfig, parameters: AxisParameters) -> list[str]:
        """Describe the commands that will fail because a read-only object of the drive has another value."""
        read = partial(self._value, axis)
        found = contradictions(self._drive(axis), self._cell.bus.scan_period, parameters.modes, read)
        return [f"{each.message}: {each.observed}; {each.remedy}" for each in found]

    def _require_units(
        self, axis: AxisConfig, values: scale_proposal.Values, scale: scale_proposal.ScaleReport
    ) -> None:
        """Refuse an axis whose drive uses other velocity or acceleration units than the cell file.

        Only warn if the drive was found enabled, or if the conflict depends on a 608Fh that ``scale`` does not agree with.

        Raises:
            ConfigError: the units differ.
        """
        for found in scale_proposal.contradictions(axis, values):
            if not self.found_enabled and (found.is_certain or scale.agrees is not False):
                raise ConfigError(
                    found.message, file=self._cell.file, observed=found.observed, remedy=found.remedy
                )
            self._report.warnings.append(f"{found.message}: {found.observed}; {found.remedy}")

    def _live_parameters(self, axis: AxisConfig, values: scale_proposal.Values) -> AxisParameters:
        """Return the parameters of cell file and EDS, corrected by the values read from the drive."""
        parameters = axis_parameters(self._cell, axis.name, self._eds, self._make)
        parameters = replace(parameters, units=known_units(axis, values))
        window = self._value(axis, o.POSITION_WINDOW)
        if parameters.position_window is None and window and window != _NO_WINDOW:
            parameters = replace(parameters, position_window=window)
        parameters = self._with_following_error(axis, parameters)
        claimed = self._value(axis, o.SUPPORTED_DRIVE_MODES)
        holds = self._option(axis, options.QUICK_STOP) in options.HOLDING_QUICK_STOPS
        read = partial(self._read, axis)
        drive = self._drive(axis)
        used = used_modes(drive, None if claimed is None else modes.supported(claimed))
        parameters = replace(parameters, modes=led_modes(drive, used))
        limits = parameters.limits
        if axis.max_torque is None:
            limits = scale_proposal.limited_torque(replace(limits, torque=None), axis.rated_torque, read)
        return replace(
            parameters,
            quick_stop_holds=holds,
            braking=braking_of(parameters.units, read),
            fixed_ramps=fixed_ramps(drive, read),
            limits=limits,
            torque_slope=read(o.TORQUE_SLOPE),
            feed_forward=feed_forward(axis, read(o.POLARITY)),
        )

    def _modes_shown(
        self, axis: AxisConfig, parameters: AxisParameters
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the modes and the doubts about them: from the cell file, else from the objects and the drive's 6502h."""
        if axis.modes is not None:
            return tuple(modes.short(mode) for mode in sorted(parameters.modes)), ()
        claimed = self._value(axis, o.SUPPORTED_DRIVE_MODES)
        shown = mode_list(self._drive(axis), None if claimed is None else frozenset(modes.supported(claimed)))
        return tuple(modes.short(mode) for mode in shown.modes), shown.doubts

    def _drive(self, axis: AxisConfig) -> Drive:
        return Drive.of(axis, self._node, self._eds)

    def _value(self, axis: AxisConfig, index: int, subindex: int = 0) -> int | None:
        """Read an object of an axis, named by its index on the first axis."""
        return read_int(self._objects, own_index(index, axis.drive_axis), subindex)

    def _read(self, axis: AxisConfig, index: int, subindex: int = 0) -> int | None:
        """Read an object of an axis; None also if it is to be ignored."""
        return None if index in (axis.ignored_objects or ()) else self._value(axis, index, subindex)

    def _with_following_error(self, axis: AxisConfig, parameters: AxisParameters) -> AxisParameters:
        """Add the drive's own following error window of its position modes; 0 and FFFFFFFFh mean no monitoring."""
        window = self._value(axis, o.FOLLOWING_ERROR_WINDOW)
        if not window or window == _NO_WINDOW:
            return parameters
        time = self._value(axis, o.FOLLOWING_ERROR_TIME_OUT) or 0
        return replace(parameters, drive_following_error=window, drive_following_time=time / 1000)

    def _option(self, axis: AxisConfig, option: options.OptionCode) -> int | None:
        return self._read(axis, option.index, option.subindex)


def _transport_text(how: Capabilities) -> str:
    """Return how values are transferred, in groups: ``synchronous PDO: statusword, position; SDO: torque``."""
    groups: dict[ValueTransport, list[str]] = {}
    for name, source in (*how.outputs.items(), *how.inputs.items()):
        if name.replace("_", " ") not in groups.setdefault(source, []):
            groups[source].append(name.replace("_", " "))
    parts = [f"{source.value}: {', '.join(names)}" for source, names in groups.items()]
    if how.edge_delay:
        cycles = "one cycle" if how.edge_delay == 1 else counted(how.edge_delay, "cycle")
        parts.append(
            f"the edge of a set-point is sent {cycles} after its target, because of the order of mapping"
        )
    return "; ".join(parts)
