"""The power stage against the figure and tables of CiA 402-2, typed off by hand into power_stage.csv."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import pytest

from axisbus.sim.fault_injection import NEVER, DriveFaults
from axisbus.sim.power import Effort, PowerStage, Stage

STAGES = {
    "not ready to switch on": Stage.NOT_READY,
    "switch on disabled": Stage.SWITCH_ON_DISABLED,
    "ready to switch on": Stage.READY,
    "switched on": Stage.SWITCHED_ON,
    "operation enabled": Stage.ENABLED,
    "quick stop active": Stage.QUICK_STOP,
    "fault reaction active": Stage.FAULT_REACTION,
    "fault": Stage.FAULT,
}
WAY = {"ready to switch on": (6,), "switched on": (6, 7), "operation enabled": (6, 7, 15)}
TICK = 0.01
ROWS = list(
    csv.DictReader((Path(__file__).parent / "power_stage.csv").read_text(encoding="ascii").splitlines())
)


@dataclass
class Options:
    quick_stop_option: int = 2
    shutdown_option: int = 0
    disable_option: int = 1
    fault_option: int = 2


def stage_in(state: str, options: Options | None = None, dials: DriveFaults | None = None) -> PowerStage:
    """A power stage led to ``state``; every transition takes one tick."""
    stage = PowerStage(options or Options(), dials or DriveFaults(), delays=dict.fromkeys(range(17), TICK))
    if state == "not ready to switch on":
        return stage
    stage.step(TICK, True)
    for word in WAY.get(state, (6, 7, 15) if state.startswith(("quick", "fault")) else ()):
        stage.command(word)
        stage.step(TICK, True)
    if state == "quick stop active":
        stage.command(2)
        stage.step(TICK, False)
    if state.startswith("fault"):
        stage.fault()
    if state == "fault":
        stage.step(TICK, True)
    assert stage.stage is STAGES[state]
    return stage


@pytest.mark.parametrize(
    "row", ROWS, ids=lambda row: f"{row['state']}-{row['controlword']}-{row['quick_stop_option']}"
)
def test_each_state_obeys_each_command_as_the_standard_draws_it(row):
    stage = stage_in(row["state"], Options(quick_stop_option=int(row["quick_stop_option"])))
    before = stage.last_transition
    stage.command(int(row["controlword"], 16))
    stage.step(TICK, row["state"] == "operation enabled")
    assert stage.stage is STAGES[row["next_state"]]
    assert stage.last_transition == (int(row["transition"]) if row["transition"] else before)


def test_the_csv_covers_every_state_with_every_command():
    commands = {"0x0000", "0x0002", "0x0006", "0x0007", "0x000F", "0x0080"}
    for state in (
        "switch on disabled",
        "ready to switch on",
        "switched on",
        "operation enabled",
        "quick stop active",
        "fault",
    ):
        assert commands <= {row["controlword"] for row in ROWS if row["state"] == state}


@pytest.mark.parametrize(
    ("state", "pattern"),
    [
        ("not ready to switch on", 0b000_0000),
        ("switch on disabled", 0b100_0000),
        ("ready to switch on", 0b010_0001),
        ("switched on", 0b010_0011),
        ("operation enabled", 0b010_0111),
        ("quick stop active", 0b000_0111),
        ("fault reaction active", 0b000_1111),
        ("fault", 0b000_1000),
    ],
)
def test_the_statusword_bits_of_each_state(state, pattern):
    assert stage_in(state).pattern == pattern


def test_fault_reset_needs_a_rising_edge_of_bit_7():
    stage = stage_in("operation enabled")
    stage.command(0x8F)  # bit 7 rises here, while there is no fault
    stage.fault()
    stage.step(TICK, True)
    for _ in range(3):
        stage.command(0x8F)
        stage.step(TICK, True)
        assert stage.stage is Stage.FAULT
    stage.command(0x0F)
    stage.command(0x8F)
    stage.step(TICK, True)
    assert stage.stage is Stage.SWITCH_ON_DISABLED


def test_enable_operation_given_early_passes_switched_on():
    stage = stage_in("ready to switch on")
    stage.command(0x0F)
    stage.step(TICK, True)
    assert stage.stage is Stage.SWITCHED_ON
    stage.step(TICK, True)
    assert stage.stage is Stage.ENABLED


def test_disabling_waits_for_the_ramp_and_is_called_off_by_enable_operation():
    stage = stage_in("operation enabled")
    stage.command(7)
    stage.step(1.0, False)
    assert (stage.stage, stage.effort) == (Stage.ENABLED, Effort.SLOW)
    stage.command(15)
    stage.step(1.0, True)
    assert (stage.stage, stage.effort, stage.pending) == (Stage.ENABLED, Effort.RUN, None)


@pytest.mark.parametrize(
    ("option", "effort"),
    [
        (0, Effort.OFF),
        (1, Effort.SLOW),
        (2, Effort.QUICK),
        (3, Effort.LIMIT),
        (4, Effort.LIMIT),
        (5, Effort.SLOW),
        (6, Effort.QUICK),
        (7, Effort.LIMIT),
        (8, Effort.LIMIT),
    ],
)
def test_quick_stop_options_select_the_ramp_and_the_final_state(option, effort):
    stage = stage_in("operation enabled", Options(quick_stop_option=option))
    stage.command(2)
    stage.step(TICK, False)
    assert (stage.stage, stage.effort) == (Stage.QUICK_STOP, effort)
    stage.step(1.0, True)
    stage.step(1.0, True)
    assert stage.stage is (Stage.QUICK_STOP if option >= 5 else Stage.SWITCH_ON_DISABLED)


@pytest.mark.parametrize(
    ("option", "effort"), [(0, Effort.OFF), (1, Effort.SLOW), (2, Effort.QUICK), (3, Effort.LIMIT)]
)
def test_fault_reaction_options_choose_the_ramp(option, effort):
    stage = stage_in("operation enabled", Options(fault_option=option))
    stage.fault()
    assert (stage.stage, stage.effort) == (Stage.FAULT_REACTION, effort)
    stage.step(1.0, True)
    assert (stage.stage, stage.effort) == (Stage.FAULT, Effort.OFF)


def test_disable_voltage_cuts_a_quick_stop_ramp_short():
    stage = stage_in("quick stop active")
    stage.command(0)
    assert stage.effort is Effort.OFF
    stage.step(TICK, False)
    assert stage.stage is Stage.SWITCH_ON_DISABLED


def test_fault_settings_make_a_power_stage_ignore_delay_or_refuse_commands():
    dials = DriveFaults(ignore_quick_stop=True, ignore_disable_voltage=True)
    stage = stage_in("operation enabled", dials=dials)
    for word in (2, 0):
        stage.command(word)
        stage.step(1.0, True)
        assert stage.stage is Stage.ENABLED
    stage = stage_in("ready to switch on", dials=DriveFaults(transition_delay={3: 0.5}))
    stage.command(7)
    stage.step(0.4, True)
    assert stage.stage is Stage.READY
    stage.step(0.2, True)
    assert stage.stage is Stage.SWITCHED_ON
    stage = stage_in("switched on", dials=DriveFaults(transition_delay={4: NEVER}))
    stage.command(15)
    stage.step(1e6, True)
    assert stage.stage is Stage.SWITCHED_ON
    stage = stage_in("fault", dials=DriveFaults(fault_persists=True))
    stage.command(0x80)
    stage.step(1.0, True)
    assert stage.stage is Stage.FAULT


def test_a_forced_quick_stop_is_not_undone_by_an_unchanged_controlword():
    stage = stage_in("operation enabled", Options(quick_stop_option=6))
    stage.force(11)
    for _ in range(5):
        stage.command(15)
        stage.step(TICK, True)
    assert stage.stage is Stage.QUICK_STOP
    stage.command(6)
    stage.command(15)
    stage.step(TICK, True)
    assert stage.stage is Stage.ENABLED
