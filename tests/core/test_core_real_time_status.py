"""The real-time status of a core, described before it runs."""

import ast
import os
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from axisbus.cell.model import BusConfig
from axisbus.core import realtime_setup
from axisbus.core.process import launch

SIM = BusConfig(interface="sim")


@pytest.fixture
def nobody(monkeypatch):
    """A user without any right of that kind."""
    monkeypatch.setattr(realtime_setup, "_effective_capabilities", lambda: 0)
    monkeypatch.setattr(realtime_setup, "_LATENCY", Path("/nonexistent"))
    monkeypatch.setattr(resource, "getrlimit", lambda _: (0, 0))
    return monkeypatch


def test_without_permissions_the_text_names_the_settings(nobody):
    nobody.setenv("AXISBUS_PROCESS", "own")
    assert launch.expected(SIM) == (
        "in a process of its own; SCHED_FIFO is not permitted (rtprio 50 in limits.conf); "
        "memory locked is not permitted (memlock unlimited in limits.conf); "
        "quick waking is not permitted (a udev rule that lets your group write /dev/cpu_dma_latency)"
    )


def test_a_limit_that_is_high_enough_is_a_right(nobody):
    limits = {resource.RLIMIT_RTPRIO: 50, resource.RLIMIT_MEMLOCK: resource.RLIM_INFINITY}
    nobody.setattr(resource, "getrlimit", lambda which: (limits[which], 0))
    assert realtime_setup.permitted() == ["SCHED_FIFO", "memory locked"]
    limits[resource.RLIMIT_RTPRIO] = 49
    assert realtime_setup.permitted() == ["memory locked"]


@pytest.mark.parametrize(("bit", "got"), [(23, ["SCHED_FIFO"]), (14, ["memory locked"]), (22, [])])
def test_a_capability_is_one_too(nobody, bit, got):
    nobody.setattr(realtime_setup, "_effective_capabilities", lambda: 1 << bit)
    assert realtime_setup.permitted() == got


def test_a_core_in_the_program_is_described_as_such(nobody):
    assert launch.expected(replace(SIM, process="thread")) == "in a thread of the program"


def test_the_permitted_settings_are_those_that_a_core_gets():
    # In another process: this one keeps its own.
    code = (
        "from axisbus.core import realtime_setup\n"
        "print(realtime_setup.permitted() == realtime_setup.set_real_time_priority() + realtime_setup.prevent_deep_sleep())"
    )
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        == "True\n"
    )


def test_processors_are_kept_awake_while_the_process_lives(tmp_path):
    device = tmp_path / "latency"
    device.touch()
    code = (
        f"import pathlib\nfrom axisbus.core import realtime_setup\nrealtime_setup._LATENCY = pathlib.Path({str(device)!r})\n"
        "print(realtime_setup.prevent_deep_sleep())\n"
        "import os\nprint([os.readlink(f'/proc/self/fd/{one}') for one in (3, 4, 5) if os.path.exists(f'/proc/self/fd/{one}')])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    got, held = ran.stdout.splitlines()
    assert got == "['quick waking']"
    assert str(device) in held
    assert device.read_bytes() == bytes(4)


def test_without_permission_prevent_deep_sleep_returns_nothing(nobody):
    assert realtime_setup.prevent_deep_sleep() == []


@pytest.mark.parametrize(
    ("text", "found"),
    [("\n", []), ("3\n", [3]), ("2-4,7\n", [2, 3, 4, 7]), ("nonsense\n", []), (None, [])],
)
def test_the_processors_that_are_kept_free(tmp_path, monkeypatch, text, found):
    monkeypatch.setattr(realtime_setup, "_ISOLATED", tmp_path / "isolated")
    if text is not None:
        (tmp_path / "isolated").write_text(text)
    assert realtime_setup.isolated() == found


def in_a_process(isolated):
    """The processors of ``isolated`` that a process of its own gets, where it may run then, and where it could before."""
    code = (
        f"import os\nfrom axisbus.core import realtime_setup\nrealtime_setup.isolated = lambda: {isolated}\n"
        "before = sorted(os.sched_getaffinity(0))\n"
        "print([realtime_setup.pin_to_isolated_processor(), sorted(os.sched_getaffinity(0)), before])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return ast.literal_eval(done.stdout)


def test_a_core_moves_to_one_that_is_kept_free():
    last = max(os.sched_getaffinity(0))
    assert in_a_process([last])[:2] == [["an isolated processor"], [last]]


def test_an_unusable_processor_changes_nothing():
    for isolated in ([4000], []):
        taken, after, before = in_a_process(isolated)
        assert taken == []
        assert after == before


def test_an_isolated_processor_is_named_before_the_start(nobody):
    nobody.setattr(launch, "isolated", lambda: [3])
    nobody.setattr(launch, "permitted", lambda: ["SCHED_FIFO", "memory locked", "quick waking"])
    nobody.setenv("AXISBUS_PROCESS", "own")
    assert launch.expected(SIM) == (
        "in a process of its own, SCHED_FIFO, memory locked, quick waking, an isolated processor"
    )


@pytest.mark.skipif(
    "SCHED_FIFO" not in realtime_setup.permitted(), reason="needs the right to real-time priority"
)
def test_threads_with_priority_take_turns_and_the_scan_alone_is_ahead_of_them():
    code = (
        "import os\nfrom axisbus.core import realtime_setup\nrealtime_setup.set_real_time_priority()\n"
        "def rank(): return os.sched_getscheduler(0), os.sched_getparam(0).sched_priority\n"
        "others = rank()\nrealtime_setup.raise_scan_priority()\nprint(others, rank())"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == f"{(os.SCHED_RR, 10)} {(os.SCHED_FIFO, 50)}"
