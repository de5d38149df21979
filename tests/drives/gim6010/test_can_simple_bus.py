"""Identifiers that can share a bus (manual v2.2, 4.1.4), the bus load of periodic messages, and error words as text."""

from __future__ import annotations

import pytest

from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple.identifier import clashes, free_nodes, in_manual
from axisbus.errors import ArgumentError

# 4.1.4, typed off again: the first CANopen node, and the nodes of CAN Simple that go with it.
TABLE = [(32, "10 18 20 28"), (64, "10 11 18 19 20 21 28 29"), (96, "10 11 12 18 19 1A 20 21 22 28 29 2A")]


@pytest.mark.parametrize(("first", "nodes"), TABLE)
def test_combinations_listed_in_the_manual_do_not_clash(first, nodes):
    simple = [int(node, 16) for node in nodes.split()]
    canopen = range(first, 128)
    assert clashes(simple, canopen) == ()
    assert in_manual(simple, canopen)
    assert clashes(simple, [first - 1]) != ()
    assert set(simple) <= set(free_nodes(canopen)[: len(simple)])


@pytest.mark.parametrize(
    ("simple", "canopen", "words"),
    [
        (4, 1, "node 4 of CAN Simple has 081h, which is the EMCY of CANopen node 1"),
        (12, 1, "node 12 of CAN Simple has 181h, which is the TPDO1 of CANopen node 1"),
        (56, 5, "node 56 of CAN Simple has 705h, which is the heartbeat of CANopen node 5"),
        (63, 5, "node 63 of CAN Simple has 7E4h, which is LSS"),
    ],
)
def test_clashes_are_named(simple, canopen, words):
    assert str(clashes([simple], [canopen])[0]) == words


def test_combinations_without_a_clash_may_be_missing_in_the_manual():
    assert clashes([0], [1, 2, 127]) == ()
    assert not in_manual([0], [1, 2, 127])
    assert not in_manual([0x10], [1])


def test_configured_identifiers_count_too():
    (clash,) = clashes([0], [1], {0x01F: "an RPDO of node 1"})
    assert str(clash) == "node 0 of CAN Simple has 01Fh, which is an RPDO of node 1"


@pytest.mark.parametrize(("simple", "canopen"), [([64], [1]), ([0], [128]), ([0], [0])])
def test_an_invalid_node_id_is_refused(simple, canopen):
    with pytest.raises(ArgumentError, match="is not a node ID"):
        clashes(simple, canopen)


# -- error words ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", faults.FAULTS, ids=lambda each: f"{each.category} {each.name}")
def test_every_fault_bit_has_a_meaning_and_a_remedy(fault):
    (line,) = faults.words(fault.category, fault.bits)
    assert line.startswith(f"{fault.category} {fault.name}: {fault.meaning} (")
    assert fault.remedy
    assert "200A" not in line  # an object of CANopen is of no use there


def test_an_error_word_is_reported_bit_by_bit():
    lines = faults.words("axis", 0x0010_0040)
    assert [line.split(":")[0] for line in lines] == ["axis MOTOR_FAILED", "axis CAN_BUS_FAILED"]
    assert "can.config.break_timeout" in lines[1]
    assert faults.words("motor", 0) == []
    assert faults.words("system", 0x100) == ["system bit 0x00000100 is not in the module's fault table"]


def test_owner_bits_alone_are_reported_as_ambiguous_over_canopen():
    (line,) = faults.explain(0xFF00, {faults.ERROR_BITS_LOW: 0x0010_0000})
    assert "ambiguous" in line
    assert "axis CAN_BUS_FAILED" in line
    assert "motor CURRENT_MEASUREMENT_UNAVAILABLE" in line
    assert faults.explain(0, {}) == []
