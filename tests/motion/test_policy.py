"""What else stops when an axis fails, or when its node is lost."""

from __future__ import annotations

import pytest

from axisbus.errors import DriveFault, NodeError
from axisbus.motion.stop.policy import FaultPolicy, LostNode

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
def test_who_stops(word, failed, error, stopped):
    policy = FaultPolicy(AXES, GROUPS, LostNode(word))
    assert policy.stops(failed, error) == frozenset(stopped)
    assert policy.all_stops({failed: error}) == dict.fromkeys(stopped, failed)


def test_axes_that_fail_together_do_not_stop_each_other():
    assert FaultPolicy(AXES, GROUPS).all_stops({"x": FAULT, "y": LOST}) == {"z": "y"}
