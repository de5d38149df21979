"""Boot one module: detect it, identify it, read its state, and report. Boot-up energises nothing and commands nothing."""

from __future__ import annotations

import math

from axisbus.boot.failure import at_step
from axisbus.boot.report import AxisReport, Booted, NodeReport
from axisbus.boot.stop_report import StopSequenceReport, Watchdog, WatchdogReport
from axisbus.bus.link.channel import Channel
from axisbus.cell import scale_proposal
from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.cell.scale_proposal import ScaleReport
from axisbus.cia301.tables import rows
from axisbus.cia402 import modes
from axisbus.cia402 import objects as o
from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.boot import identity
from axisbus.drives.gim6010.boot.identity import NodeListener
from axisbus.drives.gim6010.can_simple.endpoints import Firmware
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, IDLE, state_words
from axisbus.drives.gim6010.can_simple.port.objects import ModuleObjects
from axisbus.drives.gim6010.can_simple.port.settings import FEEDS, ModuleSettings
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import MAKE
from axisbus.drives.gim6010.cell import drive_of, list_of, module_of, module_parameters
from axisbus.drives.gim6010.discovery import questions
from axisbus.drives.gim6010.discovery.questions import SimpleFacts
from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN, GIM6010
from axisbus.drives.gim6010.settings.watchdog import Armed, armed, axis_watchdog_works, in_effect
from axisbus.errors import AxisbusError, BootError
from axisbus.motion.parameters import AxisParameters, HoldsLoad, StopTimes
from axisbus.motion.stop.promises import promises

_BEATS = 0.55  # s, five heartbeats: enough to see two modules with one node ID
_SELDOM = 1.5  # s more, if only one heartbeat has come by then
_WITHIN_A_TURN = "; until it is enabled, its position is known only within one turn of the rotor"
_TRAVELS = (
    "sent when it changes: mode, targets, limits; in every cycle: position of a path; polled in every cycle: position, "
    "velocity; by heartbeat: state, faults"
)
_BY_LINE = "registers, read one after the other: state, faults, position, velocity; written and read back: limits, targets"
_MAKE_BY_LINE = f"{GIM6010.name} (Modbus RTU)"
_FOUND = "found enabled and left unchanged; take it over with enable() or switch it off with disable()"
_FOUND_BY_LINE = "found enabled and left unchanged; on RS485 quick_stop(), and also enable(), brakes it and then switches it off"


class ModuleBoot:
    """The boot-up of one module; holds the results of its steps."""

    def __init__(
        self,
        cell: CellConfig,
        settings: ModuleSettings,
        objects: ModuleObjects,
        channel: Channel,
        find_time: float,
    ) -> None:
        """``objects`` are those of the module's port, for the cell file's writes; ``find_time`` (s) limits the first heartbeat."""
        self._cell = cell
        self._node = cell.nodes[settings.node]
        self._settings = settings
        self._objects = objects
        self._channel = channel
        self._find_time = find_time
        self._report = NodeReport(settings.node)
        self._listening = NodeListener(channel, settings.node, settings.fresh)
        self._facts = SimpleFacts()
        self._armed = Armed()
        self.feed_within = 0.0
        """The shortest armed time-out that was read, in s, which the master must feed; 0: none, or unknown."""
        self._parameters: dict[str, AxisParameters] = {}

    def run(self) -> Booted:
        """Do all steps; the report contains an error, which is not raised.

        Blocks for about a second, and for up to ``find_time`` if no module answers.
        """
        try:
            with self._channel.frames_to(self._listening.hear):
                self._hear()
                self._ask()
            self._tell()
            self.feed_within = feed_time(self._armed, self._facts.version, self._settings)
            for axis in self._cell.axes_of(self._settings.node):
                self._parameters[axis.name] = self._axis(axis)
        except AxisbusError as error:
            self._report.error = at_step(self._settings.node, "configuration", error)
        return Booted(self._report, self._parameters, None, self._found_enabled)

    # -- steps ---------------------------------------------------------------------------------------------------------------------

    def _hear(self) -> None:
        listening = self._listening
        if not listening.wait(self._find_time, lambda: listening.pulse.last is not None):
            health = (
                self._channel.health() or f"nothing is wrong with the channel {self._channel.name} itself"
            )
            raise identity.no_answer_error(listening, self._find_time, health)
        listening.wait(_BEATS)
        listening.wait(_SELDOM, lambda: len(listening.pulse.stamps) > 1)
        identity.require_one(listening, self._settings.heartbeat)
        self._report.steps.append("heard")

    def _ask(self) -> None:
        faulty = bool(self._beat_faults)
        asking = questions.simple(
            self._settings.node, self._facts, words=faulty, remote=self._settings.remote
        )
        self._listening.ask(asking)
        identity.require_firmware(self._listening, self._facts, self._node.firmware)
        self._report.steps.append("identified")
        self._look_what_is_armed()

    def _look_what_is_armed(self) -> None:
        listed = list_of(self._node, self._cell.folder)
        if listed is None:
            return
        self._armed = self._listening.ask(armed(self._settings.node, *listed, self._facts))
        if self._armed == Armed():
            self._report.warnings.append(
                "its list of endpoints was not used: it answers no endpoint over CAN"
            )

    def _tell(self) -> None:
        report, state = self._report, self._state
        report.device = _MAKE_BY_LINE if self._settings.relayed else MAKE.name
        report.identity = identity.words(self._listening, self._facts, self._node.firmware)
        report.nmt = f"a module has none; its heartbeat reports {state_words(state)}" + (
            "" if self._found_enabled else _WITHIN_A_TURN
        )
        report.configured = "nothing is written into it: its limits are sent when its axis is enabled"
        report.watchdog = watchdog_of(self._armed, self._facts.version, relayed=self._settings.relayed)
        report.warnings.append(report.watchdog.text)
        if self._found_enabled:
            report.warnings.append(_FOUND_BY_LINE if self._settings.relayed else _FOUND)
        elif state != IDLE:
            report.warnings.append(
                f"it is in {state_words(state)}, which may turn the motor without a command: it gets no requests before it "
                "is idle"
            )
        report.warnings += self._fault_words()

    def _fault_words(self) -> list[str]:
        if not self._beat_faults:
            return []
        beat = self._listening.pulse.last
        known = {"axis": 0 if beat is None else beat.axis_error, **self._facts.errors}
        texts = [text for category, word in known.items() for text in faults.words(category, word)]
        unknown = " (its error words are not answered by this firmware)" if self._facts.silent else ""
        told = "; ".join(texts) or f"of {', '.join(self._beat_faults)}{unknown}"
        return [f"it is in fault, so its axis must be reset first: {told}"]

    def _axis(self, axis: AxisConfig) -> AxisParameters:
        self._write(axis)
        found = module_parameters(self._cell, axis.name)
        rungs = ladder(axis.name, self._settings, found.stop_times, found.holds_load)
        scale = scale_proposal.compare(found.units.position, self._turns())
        rated = None
        if axis.rated_torque is not None:
            rated = ScaleReport(f"{abs(axis.rated_torque):g} N·m", "no message of a module contains it", None)
        warnings = self._report.warnings
        warnings += rungs.warnings
        if scale.agrees is False:
            warnings.append(f"{axis.name}: scale {scale.configured}, but {scale.proposed}")
        self._report.axes.append(
            AxisReport(
                axis.name,
                state_words(self._state),
                self._found_enabled,
                tuple(modes.short(mode) for mode in sorted(found.modes)),
                (),
                _BY_LINE if self._settings.relayed else _TRAVELS,
                (),
                False,
                rungs,
                scale,
                rated,
                promises(found),
            )
        )
        return found

    def _write(self, axis: AxisConfig) -> None:
        """Write the values that the cell file gives for drive objects into the module's port."""
        for write in drive_of(self._cell, axis).written.values():
            code = self._objects.write(write.index, write.subindex, int(write.value))
            if code is not None:
                raise BootError(
                    f"node {self._settings.node}: a module does not accept {write.source} = {write.value}",
                    node=self._settings.node,
                    step="configuration",
                    index=write.index,
                    subindex=write.subindex,
                    remedy="leave it out: axisbus check reports the behaviour of a module",
                )

    # -- evaluation of the frames --------------------------------------------------------------------------------------------------

    @property
    def _state(self) -> int:
        beat = self._listening.pulse.last
        return 0 if beat is None else beat.state

    @property
    def _beat_faults(self) -> tuple[str, ...]:
        beat = self._listening.pulse.last
        return () if beat is None else beat.faults

    @property
    def _found_enabled(self) -> bool:
        return self._state == CLOSED_LOOP

    def _turns(self) -> scale_proposal.Values:
        """The encoder counts of one turn, and the gear ratio if the cell file gives one."""
        module = module_of(self._node)
        gear = None if module is None or module.gear_ratio is None else round(module.gear_ratio * 1000)
        motor = {(o.ENCODER_RESOLUTION, 1): COUNTS_PER_ROTOR_TURN, (o.ENCODER_RESOLUTION, 2): 1}
        return {**motor, (o.GEAR_RATIO, 1): gear, (o.GEAR_RATIO, 2): 1000}


# -- Describe how the axis of a module stops, and which of its watchdogs detect the loss of the master, in plain words ----------


# Used if nothing could be read: no message reports the armed watchdogs. Users and the maker describe each (docs/gim6010-8.md).
WATCHDOG = WatchdogReport(
    Watchdog.NONE,
    "no function of this module is known to detect the loss of the master: break_timeout and watchdog_timeout were not read, and "
    "are off by factory setting. Positions hold, a velocity or a torque continues. The master does not feed a time-out that it "
    "has not read: if break_timeout is armed, the module trips whenever no set-point is sent for that time. Then switch it "
    "off (axisbus gim6010 watchdog --off), or name the firmware's list in the cell file (endpoints). On another joint of "
    "the manufacturer a trip switched the power off and latched CAN_BUS_FAILED; watchdog_timeout has no effect in newer "
    "firmware. Both are untested here",
)
_LATCHES = (
    "only set-points feed it, it counts in every state of the axis, and on another joint of the manufacturer it switched "
    "the power off and latched CAN_BUS_FAILED"
)
_GOES_ON = "positions hold, a velocity or a torque continues"
_TINY = 1e-6  # s
_FED_BY_LINE = (
    "over RS485 no register is known to feed it, and the master does not feed it: the module trips. Switch it off "
    "(axisbus gim6010 watchdog --off)"
)
_COASTS = "the motor coasts: a module has no ramp for it"


def watchdog_of(found: Armed, firmware: Firmware | None, *, relayed: bool = False) -> WatchdogReport:
    """Return which watchdogs of a module detect the loss of the master, from the watchdogs ``found`` armed in it, and who feeds
    them.

    ``relayed``: the module is on a serial line.
    """
    if found == Armed():
        return WATCHDOG
    counts = in_effect(found, firmware)
    texts = [_break(found.break_timeout), _axis(found.watchdog, works=axis_watchdog_works(firmware))]
    if counts:
        texts += [_FED_BY_LINE if relayed else _fed(min(counts.values())), "Untested here"]
    else:
        texts.append(f"no function is known to detect the loss of the master: {_GOES_ON}")
    return WatchdogReport(Watchdog.UNKNOWN if counts else Watchdog.NONE, "; ".join(texts))


def feed_time(found: Armed, firmware: Firmware | None, settings: ModuleSettings) -> float:
    """Return the shortest armed time-out (s) that the master must feed; 0: it feeds none.

    On a serial line the master feeds none, because no register is known to feed it.

    Raises:
        BootError: a quarter of the time-out is shorter than the scan period, so that one late cycle could trip the module.
    """
    counts = {} if settings.relayed else in_effect(found, firmware)
    if not counts:
        return 0.0
    name = min(counts, key=lambda each: counts[each])
    shortest, least = counts[name], FEEDS * settings.period
    if shortest >= least - _TINY:
        return shortest
    option = {"break_timeout": "--break-timeout", "watchdog_timeout": "--axis-timeout"}[name]
    raise BootError(
        f"node {settings.node}: its {name} is too short for this scan period: the module would trip in motion, and coast",
        node=settings.node,
        step="watchdog",
        observed=f"{name} is {shortest * 1000:g} ms and the scan period {settings.period * 1000:g} ms; "
        f"at least {FEEDS} scan periods are needed",
        remedy=f"arm at least {math.ceil(least * 1000 - _TINY)} ms (axisbus gim6010 watchdog {option}), switch it off "
        f"(axisbus gim6010 watchdog --off), or give [bus] a scan_period of at most {shortest * 1000 / FEEDS:g} ms",
    )


def _fed(seconds: float) -> str:
    return (
        f"the master feeds it at least every {seconds * 1000 / FEEDS:g} ms, from the first command to its axis until the program "
        "ends; without a program the module trips, and the next program must reset the axis"
    )


def _break(seconds: float | None) -> str:
    if seconds is None:
        return "break_timeout is not answered, and the master does not feed it"
    return f"break_timeout is {seconds * 1000:g} ms: {_LATCHES}" if seconds else "break_timeout is off"


def _axis(seconds: float | None, *, works: bool) -> str:
    if seconds is None:
        return "the axis's watchdog is not answered"
    if not seconds:
        return "the axis's watchdog is off"
    how = (
        "WATCHDOG_TIMER_EXPIRED latches"
        if works
        else "without effect in this firmware, according to the manufacturer"
    )
    return f"the axis's watchdog is armed with {seconds:g} s ({how})"


def ladder(
    axis: str, settings: ModuleSettings, times: StopTimes, holds_load: HoldsLoad
) -> StopSequenceReport:
    """Return the stop sequence of an axis with the effect of each step; ``times`` are the deadlines of the steps."""
    holds = settings.quick_stop_holds
    values = {
        "ramp": settings.velocity_ramp,
        "at_rest": "then stays in closed loop and holds its position" if holds else "then power off",
        "coasts": _COASTS,
        "goes_on": _GOES_ON,
        **{
            name: f" (at most {getattr(times, name):g} s, then the next step)"
            for name in ("halt", "quick_stop", "disable")
        },
    }
    steps = [
        (row["step"], row["request"], row["effect"].format(**values))
        for row in rows(__package__, "stop_sequence.tsv")
    ]
    if holds_load is not HoldsLoad.NO:
        steps.append(
            ("holds a load", "", f"by its {holds_load.value}: never switched off before it is at standstill")
        )
    return StopSequenceReport(axis, tuple(steps), (f"{axis}: power off, and any fault: {_COASTS}",))
