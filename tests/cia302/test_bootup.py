"""The boot-up of CiA 302-2 without a bus: each letter by a node that is wrong in just one way, and nodes with lost answers."""

from __future__ import annotations

import random

import pytest

from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia302 import types as b
from axisbus.cia302.bootup import boot_up
from kit.boot_slave import IDENTITY, MISSING, SETTINGS, Slave

# CiA 302-2, the error status of the boot-up service: letter -> its subject, typed from the standard's table.
STANDARD = {
    "A": "list",
    "B": "1000h",
    "C": "device type",
    "D": "vendor",
    "E": "heartbeat",
    "F": "guarding",
    "G": "program",
    "H": "program",
    "I": "program",
    "J": "configuration",
    "K": "heartbeat",
    "L": "operational",
    "M": "product",
    "N": "revision",
    "O": "serial",
}


def plan(**changes: object) -> b.BootPlan:
    made = {"identity": IDENTITY, "settings": SETTINGS, "heartbeat": 0.1, **changes}
    return b.BootPlan(5, **made)  # type: ignore[arg-type]


def test_the_letters_are_those_of_the_standard():
    assert {letter.name for letter in b.Letter} == set(STANDARD)
    for letter, word in STANDARD.items():
        assert word in b.Letter[letter].sentence, letter


def test_a_good_node_is_booted_in_the_order_of_the_standard():
    slave = Slave()
    outcome = slave.run(plan())
    assert outcome.ok
    assert outcome.letter is None
    reads = [(each.index, each.subindex) for each in slave.asked if isinstance(each, b.Read)]
    steps = [
        each.known.step
        for each in slave.asked
        if isinstance(each, b.Local) and each.phase is b.BootPhase.STEP
    ]
    assert steps == [
        *("find", "identity", "state", "pre-operational", "program", "restore", "configuration"),
        *("error control", "completion", "start"),
    ]
    assert reads[:5] == [(0x1000, 0), (0x1018, 1), (0x1018, 2), (0x1018, 3), (0x1018, 4)]
    assert slave.wrote() == [(0x6065, 0, 3000), (0x6067, 0, 20), (0x1017, 0, 100)]
    assert slave.commands() == [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.START]
    assert outcome.consumer == pytest.approx(0.3)
    assert outcome.control is b.ErrorControl.HEARTBEAT
    assert outcome.written == 2
    assert slave.state is NmtState.OPERATIONAL
    assert outcome.elapsed == pytest.approx(
        0.1 + 2 * 0.01 + 0.002 * 12
    )  # a heartbeat, two commands, 12 transfers


# -- each letter -----------------------------------------------------------------------------------------------------------


def test_letter_a_a_node_that_is_not_in_the_list_is_not_accessed():
    slave = Slave()
    machine = boot_up(plan(listed=False))
    with pytest.raises(StopIteration) as end:
        next(machine)
    assert end.value.value.letter is b.Letter.A
    assert not slave.asked


def test_letter_b_the_node_does_not_answer():
    slave = Slave()
    slave.dead = True
    outcome = slave.run(plan(find_tries=4))
    assert (outcome.letter, outcome.step, outcome.address) == (b.Letter.B, "find", (0x1000, 0))
    assert outcome.tries == 4
    assert outcome.elapsed == pytest.approx(0.5 + 0.3 + 0.3 + 4 * 0.5)


@pytest.mark.parametrize(
    ("letter", "address", "got"),
    [
        ("C", (0x1000, 0), 0x191),
        ("D", (0x1018, 1), 0x124),
        ("M", (0x1018, 2), 0x457),
        ("N", (0x1018, 3), 0x10003),
        ("O", (0x1018, 4), 778),
    ],
)
def test_letters_c_d_m_n_o_another_device(letter, address, got):
    slave = Slave()
    slave.objects[address] = got
    outcome = slave.run(plan())
    assert (outcome.letter, outcome.step, outcome.address) == (b.Letter[letter], "identity", address)
    assert (outcome.expected, outcome.got) == (IDENTITY[address].value, got)
    assert not slave.wrote()
    assert not slave.commands()


@pytest.mark.parametrize(("letter", "subindex"), [("D", 1), ("M", 2), ("N", 3), ("O", 4)])
def test_an_identity_that_the_node_does_not_have_is_not_the_expected_one(letter, subindex):
    slave = Slave()
    del slave.objects[0x1018, subindex]
    outcome = slave.run(plan())
    assert (outcome.letter, outcome.got, outcome.abort) == (b.Letter[letter], None, MISSING)


@pytest.mark.parametrize("subindex", [1, 2, 3, 4])
def test_a_node_that_falls_silent_while_its_identity_is_read_is_not_called_another_device(subindex):
    slave = Slave()
    slave.dies_at = b.Read(0x1018, subindex)
    outcome = slave.run(plan())
    assert (outcome.letter, outcome.step, outcome.address) == (None, "identity", (0x1018, subindex))
    assert outcome.tries == b.TRIES


def test_a_lenient_expectation_accepts_a_node_that_does_not_report_the_value():
    slave = Slave()
    del slave.objects[0x1018, 2]
    lenient = {(0x1018, 1): b.Expected(0x999, lenient=True), (0x1018, 2): b.Expected(0x456, lenient=True)}
    slave.objects[0x1018, 1] = 0
    assert slave.run(plan(identity=lenient)).ok
    slave.objects[0x1018, 1] = 0x123
    assert slave.run(plan(identity=lenient)).letter is b.Letter.D


def test_letter_e_a_node_that_should_send_heartbeats_and_does_not():
    slave = Slave()
    slave.objects[0x1017, 0] = 200
    slave.beats = False
    outcome = slave.run(plan())
    assert (outcome.letter, outcome.step, outcome.address) == (b.Letter.E, "state", (0x1017, 0))
    assert not slave.wrote()


def test_letter_f_a_node_without_heartbeat_that_does_not_answer_guarding():
    slave = Slave()
    del slave.objects[0x1017, 0]
    slave.guards = False
    outcome = slave.run(plan())
    assert (outcome.letter, outcome.step) == (b.Letter.F, "error control")
    assert NmtCommand.START not in slave.commands()


def test_a_node_whose_life_time_runs_is_not_guarded_unless_guarding_will_continue():
    slave = Slave()
    del slave.objects[0x1017, 0]
    slave.objects |= {(0x100C, 0): 100, (0x100D, 0): 3}
    outcome = slave.run(plan())
    assert outcome.ok
    assert outcome.control is b.ErrorControl.GUARDING
    assert not [each for each in slave.asked if isinstance(each, b.GuardRequest)]


def test_letter_j_a_refused_object_with_its_abort_code():
    slave = Slave()
    slave.refuses[0x6067, 0] = 0x0800_0022
    outcome = slave.run(plan())
    assert (outcome.letter, outcome.address, outcome.abort) == (b.Letter.J, (0x6067, 0), 0x0800_0022)
    assert outcome.setting == SETTINGS[1]
    assert outcome.written == 1
    assert slave.state is NmtState.PRE_OPERATIONAL


def test_letter_j_an_object_that_reads_back_another_value():
    slave = Slave()
    slave.clips[0x6065, 0] = 2999
    outcome = slave.run(plan())
    assert (outcome.letter, outcome.expected, outcome.got) == (b.Letter.J, 3000, 2999)


def test_letter_j_a_node_that_could_send_heartbeats_but_refuses_this_period():
    slave = Slave()
    slave.objects[0x1017, 0] = 0
    slave.refuses[0x1017, 0] = 0x0609_0032  # too low
    outcome = slave.run(plan())
    assert (outcome.letter, outcome.step, outcome.address) == (
        b.Letter.J,
        "error control",
        (0x1017, 0),
    )
    assert outcome.abort == 0x0609_0032
    assert outcome.setting is not None
    assert outcome.setting.value == 100
    assert NmtCommand.START not in slave.commands()


@pytest.mark.parametrize("abort", [0x0601_0002, 0x0609_0032, 0x0800_0022])
def test_a_node_that_refuses_another_heartbeat_period_is_monitored_with_its_own(abort):
    slave = Slave()
    slave.objects[0x1017, 0] = 500
    slave.refuses[0x1017, 0] = abort
    outcome = slave.run(plan())
    assert outcome.ok
    assert outcome.control is b.ErrorControl.HEARTBEAT
    assert outcome.consumer == pytest.approx(1.5)
    assert any("500 ms" in each and f"0x{abort:08X}" in each for each in outcome.skipped)


def test_a_node_that_cannot_write_1017h_is_guarded_and_the_refusal_is_named():
    slave = Slave()
    slave.objects[0x1017, 0] = 0
    slave.refuses[0x1017, 0] = 0x0601_0002
    outcome = slave.run(plan())
    assert outcome.ok
    assert outcome.control is b.ErrorControl.GUARDING
    assert any("1017h" in each and "0x06010002" in each for each in outcome.skipped)


def test_letter_k_no_heartbeat_after_error_control_was_started():
    slave = Slave()
    slave.beats = False
    outcome = slave.run(plan())
    assert (outcome.letter, outcome.step) == (b.Letter.K, "error control")
    assert NmtCommand.START not in slave.commands()


def test_heartbeats_that_are_rare_are_not_waited_for():
    slave = Slave()
    slave.objects[0x1017, 0] = 5000
    outcome = slave.run(plan(heartbeat=5.0))
    assert outcome.ok
    assert outcome.consumer == pytest.approx(15.0)
    assert not [each for each in slave.asked if isinstance(each, b.Listen)]


def test_letter_l_a_node_found_operational_is_not_reset():
    slave = Slave()
    slave.state = NmtState.OPERATIONAL
    slave.objects[0x1017, 0] = 100
    outcome = slave.run(plan())
    assert outcome.ok
    assert outcome.letter is b.Letter.L
    assert slave.commands() == [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.START]


def test_letter_l_with_keep_alive_nothing_is_written_and_nothing_commanded():
    slave = Slave()
    slave.state = NmtState.OPERATIONAL
    slave.objects[0x1017, 0] = 100
    outcome = slave.run(plan(keep_alive=True, restore=True))
    assert outcome.ok
    assert outcome.letter is b.Letter.L
    assert not slave.wrote()
    assert not slave.commands()
    assert any("left as it was found" in text for text in outcome.skipped)


def test_a_drive_that_the_application_wants_undisturbed_is_only_started():
    slave = Slave()
    slave.may_disturb = False
    outcome = slave.run(plan())
    assert outcome.ok
    assert not slave.wrote()
    assert slave.commands() == [NmtCommand.START]


# -- further options of a plan ---------------------------------------------------------------------------------------------


def test_a_configuration_whose_date_and_time_match_is_not_downloaded_again():
    slave = Slave()
    slave.objects |= {(0x1020, 1): 15_430, (0x1020, 2): 52_200_000}
    outcome = slave.run(plan(version=(15_430, 52_200_000)))
    assert outcome.ok
    assert outcome.written == 0
    assert (0x6065, 0, 3000) not in slave.wrote()
    assert any("1020h" in text for text in outcome.skipped)


def test_a_configuration_of_another_date_is_downloaded_and_then_sealed():
    slave = Slave()
    slave.objects |= {(0x1020, 1): 15_429, (0x1020, 2): 52_200_000}
    assert slave.run(plan(version=(15_430, 52_200_000))).written == 2
    assert slave.wrote()[:4] == [
        (0x6065, 0, 3000),
        (0x6067, 0, 20),
        (0x1020, 1, 15_430),
        (0x1020, 2, 52_200_000),
    ]


def test_a_node_without_1020_is_configured_every_time():
    slave = Slave()
    outcome = slave.run(plan(version=(15_430, 0)))
    assert outcome.ok
    assert outcome.written == 2
    assert "1020h: the node does not keep date and time of its configuration" in outcome.skipped


def test_defaults_are_restored_and_the_node_restarted_before_it_is_configured():
    slave = Slave()
    assert slave.run(plan(restore=True)).ok
    assert slave.wrote()[0] == (0x1011, 1, 0x64616F6C)  # "load", the least significant byte first
    assert slave.commands()[1] is NmtCommand.RESET_NODE
    order = [type(each).__name__ for each in slave.asked]
    assert order.index("BootWrite") < order.index("BootNmtCommand", order.index("BootWrite"))


def test_a_restart_whose_boot_up_message_was_lost_is_detected_by_reading_the_state():
    slave = Slave()
    obey = slave.obey

    def deaf(command: NmtCommand) -> b.Answer:
        return b.NoReply(2.0) if command is NmtCommand.RESET_NODE else obey(command)

    slave.obey = deaf  # type: ignore[method-assign]
    assert slave.run(plan(restore=True)).ok
    assert slave.commands().count(NmtCommand.RESET_NODE) == 1


def test_a_node_left_in_the_state_stopped_is_woken():
    slave = Slave()
    slave.state = NmtState.STOPPED
    slave.objects[0x1017, 0] = 100
    outcome = slave.run(plan())
    assert outcome.ok
    assert slave.commands()[0] is NmtCommand.ENTER_PRE_OPERATIONAL
    assert outcome.done[0].startswith("woken")


@pytest.mark.parametrize("keep_alive", [False, True])
def test_a_node_in_the_state_stopped_that_sends_no_heartbeat_is_woken_unless_it_may_have_to_stay_operational(
    keep_alive,
):
    slave = Slave()
    slave.state = NmtState.STOPPED
    assert slave.run(plan(keep_alive=keep_alive)).ok is not keep_alive
    assert slave.commands()[:1] == ([] if keep_alive else [NmtCommand.ENTER_PRE_OPERATIONAL])


def test_a_failure_of_the_applications_own_part_ends_it_without_a_letter():
    slave = Slave()
    answer = slave.answer
    slave.answer = lambda request: (  # type: ignore[method-assign]
        b.Failed(0.2)
        if isinstance(request, b.Local) and request.phase is b.BootPhase.COMPLETE
        else answer(request)
    )
    outcome = slave.run(plan())
    assert (outcome.ok, outcome.letter, outcome.step) == (False, None, "completion")


# -- lost frames -----------------------------------------------------------------------------------------------------------


def test_a_node_that_falls_silent_in_mid_boot_up_has_no_letter_but_step_object_and_tries():
    slave = Slave()
    answer = slave.answer

    def dies(request: b.Request) -> b.Answer:
        slave.dead = slave.dead or (isinstance(request, b.Read) and request.index == 0x100C)
        return answer(request)

    slave.answer = dies  # type: ignore[method-assign]
    del slave.objects[0x1017, 0]
    outcome = slave.run(plan())
    assert (outcome.ok, outcome.letter, outcome.address) == (False, None, (0x100C, 0))
    assert outcome.tries == b.TRIES
    assert "silent" in outcome.sentence


def test_every_request_may_lose_its_first_answer():
    """Silence costs one more try of that request, and nothing else."""
    slave = Slave()
    answer = slave.answer
    last: list[b.Request] = []

    def once(request: b.Request) -> b.Answer:
        if not isinstance(request, b.Local) and last != [request]:
            last[:] = [request]
            return b.NoReply(0.5)
        return answer(request)

    slave.answer = once  # type: ignore[method-assign]
    outcome = slave.run(plan())
    assert outcome.ok
    assert outcome.retries == 15  # 12 transfers, two commands and a heartbeat


def test_with_a_tenth_of_the_answers_lost_five_hundred_nodes_boot():
    for seed in range(500):
        slave = Slave()
        slave.loses, slave.loss = random.Random(seed), 0.1
        outcome = slave.run(plan(restore=True, version=(1, 2)))
        assert outcome.ok, (seed, outcome)
