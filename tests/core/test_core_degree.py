"""What is said of how surely a core's cycles come in time, before one runs."""

import resource
import subprocess
import sys
from dataclasses import replace

import pytest

from axisbus.cell.model import BusConfig
from axisbus.core import tuning
from axisbus.core.process import launch

SIM = BusConfig(interface="sim")


@pytest.fixture
def nobody(monkeypatch):
    """A user without any right of that kind."""
    monkeypatch.setattr(tuning, "_rights", lambda: 0)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (0, 0))
    return monkeypatch


def test_without_rights_it_says_what_would_help(nobody):
    nobody.setenv("AXISBUS_PROCESS", "own")
    assert launch.expected(SIM) == (
        "in a process of its own; SCHED_FIFO is not permitted (rtprio 50 in limits.conf); "
        "memory locked is not permitted (memlock unlimited in limits.conf)"
    )


def test_a_limit_that_is_high_enough_is_a_right(nobody):
    limits = {resource.RLIMIT_RTPRIO: 50, resource.RLIMIT_MEMLOCK: resource.RLIM_INFINITY}
    nobody.setattr(resource, "getrlimit", lambda which: (limits[which], 0))
    assert tuning.permitted() == ["SCHED_FIFO", "memory locked"]
    limits[resource.RLIMIT_RTPRIO] = 49
    assert tuning.permitted() == ["memory locked"]


@pytest.mark.parametrize(("bit", "got"), [(23, ["SCHED_FIFO"]), (14, ["memory locked"]), (22, [])])
def test_a_capability_is_one_too(nobody, bit, got):
    nobody.setattr(tuning, "_rights", lambda: 1 << bit)
    assert tuning.permitted() == got


def test_a_core_in_the_program_says_so(nobody):
    assert launch.expected(replace(SIM, process="thread")) == "in a thread of the program"


def test_what_is_permitted_is_what_a_core_gets():
    code = "from axisbus.core import tuning\nprint(tuning.permitted() == tuning.take_priority())"  # this one keeps its own
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        == "True\n"
    )
