"""The axes that stop when an axis fails, or when its node is lost."""

from __future__ import annotations

import pytest

from axisbus.errors import DriveFault, NodeError
from axisbus.motion.stop.policy import FaultPolicy, GroupFault, LostNode

AXES = ("x", "y", "z", "w")
GROUPS = {"xy": ["x", "y"], "zy": ["z", "y"]}
LOST = NodeError("lost", node=1)
FAULT = DriveFault("fault", axis="x")


@pytest.mark.parametrize(
    ("word", "failed", "error", "stopped"),
    [
        ("group", "x", LOST, "y"),
        ("group", "y", LOST, "xz"),
        ("group", "w", LOST, "xyz"),  # in no group: the cell
        ("cell", "x", LOST, "yzw"),
        ("cell", "x", FAULT, "y"),
        ("report", "x", LOST, ""),
        ("report", "w", LOST, ""),
        ("report", "x", FAULT, "y"),
        ("report", "x", None, "y"),
    ],
)
def test_a_failure_stops_the_axes_that_the_policy_selects(word, failed, error, stopped):
    policy = FaultPolicy(AXES, GROUPS, LostNode(word))
    assert policy.stops(failed, error) == frozenset(stopped)
    assert policy.all_stops({failed: error}) == dict.fromkeys(stopped, failed)


def test_axes_that_fail_together_do_not_stop_each_other():
    assert FaultPolicy(AXES, GROUPS).all_stops({"x": FAULT, "y": LOST}) == {"z": "y"}


PAIR = {"x": "y", "y": "x"}


@pytest.mark.parametrize(
    ("groups", "word", "failed", "error", "stopped"),
    [
        ({}, "group", "x", FAULT, "yzw"),  # as without the pair: the cell
        ({"zw": ["z", "w"]}, "group", "x", FAULT, "yzw"),
        ({"xz": ["x", "z"]}, "group", "x", FAULT, "yz"),
        ({"xz": ["x", "z"]}, "group", "z", FAULT, "xy"),
        ({"zw": ["z", "w"]}, "group", "z", FAULT, "w"),
        ({}, "report", "x", LOST, "y"),
        ({}, "report", "z", LOST, ""),
        ({"xz": ["x", "z"]}, "cell", "y", LOST, "xzw"),
    ],
)
def test_a_failure_of_one_axis_of_a_pair_stops_both(groups, word, failed, error, stopped):
    policy = FaultPolicy(AXES, groups, LostNode(word), mates=PAIR)
    assert policy.stops(failed, error) == frozenset(stopped)


def test_both_axes_of_a_pair_are_braked_together():
    each = {"xyz": GroupFault.EACH}
    policy = FaultPolicy(AXES, {"xyz": ["x", "y", "z"]}, on_fault=each, mates=PAIR)
    assert policy.how("x", "y") is policy.how("y", "z") is GroupFault.PATH
    assert policy.how("z", "x") is GroupFault.EACH
    quick = FaultPolicy(AXES, {"xyz": ["x", "y", "z"]}, on_fault={"xyz": GroupFault.QUICK}, mates=PAIR)
    assert quick.how("x", "y") is GroupFault.QUICK
