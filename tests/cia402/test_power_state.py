"""The power-stage machine against tables typed off a second time."""

import csv
from itertools import product
from pathlib import Path

import pytest

from axisbus.cia402.controlword import words
from axisbus.cia402.state import TARGETS, TRANSITIONS, PowerState, decode, plan

HERE = Path(__file__).parent


def table(name):
    with (HERE / name).open() as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


@pytest.mark.parametrize("row", table("statuswords.csv"), ids=lambda row: row["word"])
def test_each_statusword_decodes_to_its_state(row):
    assert decode(int(row["word"], 16)).value == row["state"]


def test_every_word_decodes_and_ignores_the_other_bits():
    for word in range(0x10000):
        assert decode(word) is decode(word & 0x6F)


@pytest.mark.parametrize("row", table("planner.csv"), ids=lambda row: f"{row['seen']} -> {row['wanted']}")
def test_planner_gives_the_word_of_the_figure(row):
    command = plan(PowerState(row["seen"]), PowerState(row["wanted"]))
    assert (f"{command.word:02X}" if command else "") == row["word"]


def test_planner_reaches_every_target_and_never_passes_operation_enabled():
    """Walk the planner over the figure: the drive obeys, whatever the state it starts from."""
    obey = {
        (t.source, t.command): t.target
        for t in TRANSITIONS
        if t.command is not None and t.number not in (8, 9)
    }
    startable = [s for s in PowerState if s not in (PowerState.FAULT, PowerState.UNKNOWN)]
    for start, target in product(startable, TARGETS):
        if target is PowerState.QUICK_STOP_ACTIVE and start not in (PowerState.OPERATION_ENABLED, target):
            continue
        state, passed = start, []
        if state is PowerState.NOT_READY_TO_SWITCH_ON:
            state = PowerState.SWITCH_ON_DISABLED  # transition 1, automatically
        if state is PowerState.FAULT_REACTION_ACTIVE:
            continue  # ends in fault, which needs a reset
        while state is not target:
            command = plan(state, target)
            assert command is not None, (start, target, state)
            state = obey[state, command]
            passed.append(state)
            assert len(passed) < 6
        assert PowerState.OPERATION_ENABLED not in passed[:-1], (start, target)


def test_no_plan_resets_a_fault_or_coasts():
    assert all(plan(PowerState.FAULT, target) is None for target in TARGETS)
    assert plan(PowerState.OPERATION_ENABLED, PowerState.SWITCH_ON_DISABLED).word != 0


@pytest.mark.parametrize("wrong", [PowerState.FAULT, PowerState.NOT_READY_TO_SWITCH_ON, PowerState.UNKNOWN])
def test_asking_for_a_state_that_is_the_drives_own_is_refused(wrong):
    with pytest.raises(ValueError, match="no drive can be asked"):
        plan(PowerState.OPERATION_ENABLED, wrong)


@pytest.mark.parametrize(
    ("word", "text"),
    [
        (0x0F, "enable operation"),
        (0x10F, "enable operation, halt"),
        (0x3F, "enable operation, bit 4, bit 5"),
        (0x02, "quick stop"),
        (0x00, "disable voltage"),
        (0x06, "shutdown"),
        (0x07, "switch on / disable operation"),
        (0x80, "fault reset"),
    ],
)
def test_controlword_in_words(word, text):
    assert words(word) == text
