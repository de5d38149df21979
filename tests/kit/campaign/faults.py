"""The faults of the campaign, by name: their begin, their end, and the words that name them in an error."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from axisbus.cia301.nmt import NmtCommand
from axisbus.errors import AxisbusError
from axisbus.sim.virtual_can import VirtualAdapter
from kit.campaign.pdo_faults import OTHER_MASTER, Wire, boot_up_frame, let_link_slow_down
from kit.cell import Cell

Doing = Callable[["Site", str, float], object]


@dataclass(frozen=True)
class Site:
    """A cell with the wires between its axes and their drives."""

    cell: Cell
    wires: Mapping[str, Wire]


@dataclass(frozen=True)
class Mishap:
    """``do`` is how it begins; the event ``ends`` undoes it ("": it is over at once).

    ``says``: an error that comes of it has one of these words. ``moves``: the plant may move by it alone. ``deaf``: the drive may
    not hear a stop, or the master not see it. ``shared``: it happens to all axes of the cell.
    """

    do: Doing
    says: tuple[str, ...] = ()
    ends: str = ""
    moves: bool = False
    deaf: bool = False
    shared: bool = False


def _set(of: Callable[[Site, str], object], **values: Any) -> Doing:
    def turn(site: Site, axis: str, _: float) -> None:
        for name, value in values.items():
            setattr(of(site, axis), name, value)

    return turn


_dial = partial(_set, lambda site, axis: site.cell.drive(axis).dials)
_node_dial = partial(_set, lambda site, axis: site.cell.device(axis).dials)
_bus_dial = partial(_set, lambda site, _: site.cell.faults)
_fault_of_wire = partial(_set, lambda site, _: site.cell.wire.faults)


def _wire_setting(**values: Any) -> Doing:
    def turn(site: Site, axis: str, _: float) -> None:
        for name, value in values.items():
            site.wires[axis].turn(name, value)

    return turn


def _adapter(change: Callable[[VirtualAdapter], object]) -> Doing:
    return lambda site, _axis, _: change(site.cell.wire.masters[0])


def _nmt(command: NmtCommand) -> Doing:
    return lambda site, axis, _: site.cell.nmt(command, site.cell.device(axis).node_id)


def _other(name: str) -> Doing:
    return lambda site, axis, value: OTHER_MASTER[name](site.cell, axis, value)


def _push(site: Site, axis: str, value: float) -> None:
    """A person pushes a side of a beam; other axes are not pushed."""
    pushes = getattr(site.cell, "pushes", {})
    if axis in pushes:
        pushes[axis] = 60.0 * value


def _let_go(site: Site, axis: str, _: float) -> None:
    _push(site, axis, 0.0)


def _jump(site: Site, axis: str, value: float) -> None:
    site.cell.drive(axis).dials.encoder_jump = round(3.0 * value * site.cell.scale_of(axis))


def _fork(site: Site, axis: str, _: float) -> None:
    """A child tries everything that it must not do, and ends."""
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", DeprecationWarning
        )  # other threads of the test run: nothing of theirs is touched
        child = os.fork()
    if child == 0:
        code = 0
        for attempt in (site.cell[axis].enable, site.cell[axis].halt, site.cell.machine.close):
            try:
                attempt()
            except (AxisbusError, ExceptionGroup):
                continue
            except BaseException:  # noqa: BLE001 - the parent gets it
                code = 1
        os._exit(code)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0, "a forked child could not even try"


_STANDS = (
    "blocked",
    "held",
    "does not",
    "not at standstill",
    "behind",
    "did not",
    "not follow",
    "oscillates",
)
_UNSEEN = (
    "node",
    "heartbeat",
    "lost",
    "unknown",
    "too old",
    "not known",
    "no frames",
    "silent",
    "no answer",
    "is at standstill at",
)
_BY_ITSELF = ("without a command", "not by this program", "another master")
_MODE = ("mode", "Mode", "6060h", "6061h")
_NO_STOP = ("harder", "halt", "quick stop", "switched off", "stop")
_NO_FRAMES = (*_UNSEEN, *_STANDS, "8130", *_BY_ITSELF, "bus-off", "queue", "come too late")
_SDO = ("SDO", "answer", "6060h", "not written", "cannot be", "mode")

MISHAPS: Mapping[str, Mishap] = {
    "jam": Mishap(_dial(blocked=True), _STANDS, "free", moves=True),
    # It leaps when it comes loose.
    "sticks": Mishap(_dial(sticks=400.0), _STANDS, "sticks_no_more", moves=True),
    "pushed": Mishap(
        _push, _STANDS, "pushed_no_more", moves=True
    ),  # with more than the friction of a motor without power
    "encoder_frozen": Mishap(_dial(encoder_frozen=True), _STANDS, "encoder_live", moves=True, deaf=True),
    "fault": Mishap(  # a report before the code is known is replaced by the later one
        lambda site, name, _: site.cell.drive(name).fault(0x2310),
        ("2310", "state 'fault'", "code is being read"),
    ),
    "drops_power": Mishap(lambda site, name, _: site.cell.drive(name).power.force(9), _BY_ITSELF),
    "dead": Mishap(_node_dial(dead=True), _UNSEEN, "alive", deaf=True),
    "pre_operational": Mishap(_nmt(NmtCommand.ENTER_PRE_OPERATIONAL), _UNSEEN, "start", deaf=True),
    "no_heartbeat": Mishap(_node_dial(heartbeat_stops=True), _UNSEEN, "heartbeat"),
    "sdo_late": Mishap(_node_dial(sdo_delay=0.3), _SDO, "sdo_well"),
    "sdo_silent": Mishap(_node_dial(sdo_silent=True), _SDO, "sdo_well"),
    "slips_to_pp": Mishap(_dial(spontaneous_mode=1), _MODE, "slips_no_more", moves=True),
    "slips_to_pv": Mishap(_dial(spontaneous_mode=3), _MODE, "slips_no_more", moves=True),
    "slips_to_csp": Mishap(_dial(spontaneous_mode=8), (*_MODE, "not follow"), "slips_no_more", moves=True),
    "resumes": Mishap(_dial(resumes_on_enable=True), (*_BY_ITSELF, *_STANDS), "resumes_no_more", moves=True),
    "ignores_halt": Mishap(  # a halted one continues its move
        _dial(ignore_halt=True), (*_NO_STOP, *_BY_ITSELF), "hears_halt", moves=True, deaf=True
    ),
    "ignores_quick_stop": Mishap(_dial(ignore_quick_stop=True), _NO_STOP, "hears_quick_stop", deaf=True),
    "ignores_off": Mishap(_dial(ignore_disable_voltage=True), _NO_STOP, "hears_off", deaf=True),
    "creeps": Mishap(
        _dial(drift_velocity=1500.0), (*_BY_ITSELF, *_STANDS), "creeps_no_more", moves=True, deaf=True
    ),
    "demand_stuck": Mishap(_dial(demand_frozen=True), _STANDS, "demand_live"),
    "always_there": Mishap(_dial(target_reached_always=True), (), "there_as_it_is"),
    "never_there": Mishap(_dial(target_reached_never=True), _STANDS, "there_as_it_is"),
    "keeps_acknowledge": Mishap(
        _dial(acknowledge_stays=True), ("set-point", "acknowledge"), "lets_acknowledge_go"
    ),
    "slow_to_enable": Mishap(_dial(transition_delay={4: 0.5}), (), "quick_to_enable"),
    "slow_mode": Mishap(_dial(mode_delay=0.3), _MODE, "quick_mode"),
    "keeps_mode_during_halt": Mishap(_dial(ignore_mode_during_halt=True), _MODE, "takes_mode_during_halt"),
    "encoder_jumps": Mishap(_jump, (*_STANDS, *_BY_ITSELF), moves=True),
    "late_feedback": Mishap(_dial(feedback_delay=0.1), _STANDS, "prompt_feedback"),
    "inputs_lost": Mishap(_wire_setting(inputs_lost=0.4), _UNSEEN, "inputs_come"),
    "outputs_lost": Mishap(_wire_setting(outputs_lost=0.4), _STANDS, "outputs_go"),
    "frames_late": Mishap(_wire_setting(late=2), (*_UNSEEN, *_STANDS), "frames_prompt"),
    "sync_lost": Mishap(
        _bus_dial(sync_lost=True), (*_UNSEEN, *_STANDS), "sync_comes", deaf=True, shared=True
    ),
    "heartbeat_lost": Mishap(
        _bus_dial(heartbeat_lost=True), (*_UNSEEN, "8130", *_BY_ITSELF), "heartbeat_comes", shared=True
    ),
    "stalls": Mishap(
        _bus_dial(send_blocks=0.7), ("did not run", *_UNSEEN, "8130", *_BY_ITSELF), deaf=True, shared=True
    ),
    "stutters": Mishap(_bus_dial(send_blocks=0.04), shared=True),
    # Faults of the wire affect all frames of all nodes, in both directions.
    "wire_loses": Mishap(
        _fault_of_wire(loss=0.05), (*_NO_FRAMES, *_SDO), "wire_carries", deaf=True, shared=True
    ),
    "wire_doubles": Mishap(_fault_of_wire(duplication=0.3), (), "wire_carries", shared=True),
    "wire_jitters": Mishap(
        _fault_of_wire(jitter=0.004), (*_STANDS, "come too late"), "wire_carries", shared=True
    ),
    "wire_delays": Mishap(
        _fault_of_wire(delay=0.03), (*_UNSEEN, *_STANDS, "come too late"), "wire_carries", shared=True
    ),
    "wire_slows": Mishap(
        lambda site, _axis, _: let_link_slow_down(site.cell),
        (*_UNSEEN, *_STANDS, *_SDO, "come too late"),
        "wire_carries",
        deaf=True,
        shared=True,
    ),
    "wire_cut": Mishap(
        _fault_of_wire(cut=True), (*_NO_FRAMES, *_SDO), "wire_carries", deaf=True, shared=True
    ),
    "bus_off": Mishap(
        _adapter(lambda adapter: adapter.go_off(True)),
        (*_NO_FRAMES, *_SDO),
        "bus_on",
        deaf=True,
        shared=True,
    ),
    "queue_full": Mishap(
        _adapter(lambda adapter: setattr(adapter, "full", True)),
        (*_NO_FRAMES, *_SDO),
        "queue_free",
        deaf=True,
        shared=True,
    ),
    "forks": Mishap(_fork),
    "other_shuts_down": Mishap(_other("other_shuts_down"), _BY_ITSELF),
    "other_quick_stops": Mishap(_other("other_quick_stops"), _BY_ITSELF),
    "other_enables": Mishap(_other("other_enables"), _BY_ITSELF, moves=True),
    "other_sets_point": Mishap(_other("other_sets_point"), (*_BY_ITSELF, *_STANDS), moves=True),
    "other_takes_velocity": Mishap(
        _other("other_takes_velocity"), (*_BY_ITSELF, *_MODE, *_STANDS), moves=True
    ),
    "other_program": Mishap(_other("other_program"), (*_BY_ITSELF, *_MODE, *_STANDS), moves=True),
    "other_stops_node": Mishap(_other("other_stops_node"), (*_UNSEEN, "went into fault"), "start", deaf=True),
    "second_device": Mishap(
        lambda site, axis, _: boot_up_frame(site.cell, axis),
        (*_UNSEEN, "two devices", "restarted"),
        "start",
    ),
    "reboots": Mishap(_other("reboots"), _UNSEEN, "start", deaf=True),
    "loses_supply": Mishap(_node_dial(unpowered=True), (*_UNSEEN, "boot"), "supply_returns", deaf=True),
}

ENDS: Mapping[str, Doing] = {
    "free": _dial(blocked=False),
    "sticks_no_more": _dial(sticks=0.0),
    "pushed_no_more": _let_go,
    "encoder_live": _dial(encoder_frozen=False),
    "alive": _node_dial(dead=False),
    "supply_returns": _node_dial(unpowered=False),
    "start": _nmt(NmtCommand.START),
    "heartbeat": _node_dial(heartbeat_stops=False),
    "sdo_well": _node_dial(sdo_silent=False, sdo_delay=0.0),
    "slips_no_more": _dial(spontaneous_mode=None),
    "resumes_no_more": _dial(resumes_on_enable=False),
    "hears_halt": _dial(ignore_halt=False),
    "hears_quick_stop": _dial(ignore_quick_stop=False),
    "hears_off": _dial(ignore_disable_voltage=False),
    "creeps_no_more": _dial(drift_velocity=0.0),
    "demand_live": _dial(demand_frozen=False),
    "there_as_it_is": _dial(target_reached_always=False, target_reached_never=False),
    "lets_acknowledge_go": _dial(acknowledge_stays=False),
    "quick_to_enable": _dial(transition_delay={}),
    "quick_mode": _dial(mode_delay=0.0),
    "takes_mode_during_halt": _dial(ignore_mode_during_halt=False),
    "prompt_feedback": _dial(feedback_delay=0.0),
    "inputs_come": _wire_setting(inputs_lost=0.0),
    "outputs_go": _wire_setting(outputs_lost=0.0),
    "frames_prompt": _wire_setting(late=0),
    "sync_comes": _bus_dial(sync_lost=False),
    "heartbeat_comes": _bus_dial(heartbeat_lost=False),
    "wire_carries": _fault_of_wire(loss=0.0, duplication=0.0, jitter=0.0, delay=0.0, cut=False),
    "bus_on": _adapter(lambda adapter: adapter.go_off(False) if adapter.off else None),
    "queue_free": _adapter(lambda adapter: setattr(adapter, "full", False)),
}
