"""A CAN channel has one owner on this computer, until the last of its processes is gone."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time

import pytest

from axisbus.bus.link import ownership
from axisbus.errors import SecondMasterError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the lock is one of Linux")
NAME = f"test{os.getpid()}"
HOLD = """\
import time, sys
from axisbus.bus.link import ownership
lock = ownership.take("pcan", sys.argv[1])
print("has it", flush=True)
time.sleep(30)
"""


def test_a_channel_is_taken_once_and_free_again_when_it_is_given_back():
    lock = ownership.take("pcan", NAME)
    assert lock is not None
    with pytest.raises(SecondMasterError, match=f"pcan:{NAME}"):
        ownership.take("pcan", NAME)
    other = ownership.take("pcan", f"{NAME}-2")
    assert other is not None
    other.close()
    lock.close()
    again = ownership.take("pcan", NAME)
    assert again is not None
    again.close()


@pytest.mark.parametrize("interface", ["virtual", "udp_multicast"])
def test_a_bus_without_an_adapter_is_for_everybody(interface):
    assert ownership.take(interface, NAME) is None


def test_another_program_that_has_it_is_named_and_its_death_frees_it():
    with subprocess.Popen([sys.executable, "-c", HOLD, NAME], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline().strip() == "has it"
        with pytest.raises(SecondMasterError) as caught:
            ownership.take("pcan", NAME)
        assert f"process {holder.pid} (" in caught.value.observed
        assert "import time, sys" in caught.value.observed
        assert "axisbus stop" in caught.value.remedy
        assert caught.value.heard
        assert ownership.take("pcan", NAME, beside=True) is None
        holder.kill()
        holder.wait()
    lock = _taken_soon()
    lock.close()


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.2, "0 s"),
        (7.0, "7 s"),
        (119.4, "119 s"),
        (120.0, "2 min"),
        (600.0, "10 min"),
        (7199.0, "120 min"),
        (7200.0, "2.0 h"),
        (36000.0, "10.0 h"),
    ],
)
def test_the_age_of_a_program_is_told_in_whole_seconds_minutes_or_in_hours(seconds, text):
    assert ownership._ago(seconds) == text


def test_a_program_is_told_by_its_command_and_its_age_and_one_that_has_ended_as_that():
    text = ownership.described(os.getpid())
    assert re.fullmatch(rf"process {os.getpid()} \(.+\), which began \d+(\.\d)? (s|min|h) ago", text)
    assert re.search(r", which began at \d\d:\d\d:\d\d$", ownership.described(os.getpid(), kept=True))
    with subprocess.Popen(["true"]) as ended:
        ended.wait()
    assert ownership.described(ended.pid).startswith(f"process {ended.pid}, which has ended")


def test_the_age_of_a_program_counts_from_its_own_start():
    with subprocess.Popen(["sleep", "30"]) as young:
        text = ownership.described(young.pid)
        young.kill()
    assert re.search(r" \(.*\), which began \d\d? s ago$", text), text


def test_however_many_were_refused_the_next_one_is_refused_at_once_and_told_by_whom():
    """Nobody takes their questions out of the queue of the one who has it."""
    lock = ownership.take("pcan", NAME)
    assert lock is not None
    refused = []

    def ask() -> None:
        for _ in range(40):
            with pytest.raises(SecondMasterError) as caught:
                ownership.take("pcan", NAME)
            refused.append(caught.value)

    with lock:
        asking = threading.Thread(target=ask, daemon=True)
        asking.start()
        asking.join(10.0)
        assert len(refused) == 40
        assert {error.observed.partition(" (")[0] for error in refused} == {
            f"it is held by process {os.getpid()}"
        }
    asking.join(10.0)


def test_nobody_is_named_who_cannot_be_found():
    assert ownership._looked_up("@axisbus nobody:0") is None


def test_a_process_that_has_inherited_it_keeps_it_when_its_owner_is_gone():
    lock = ownership.take("pcan", NAME)
    assert lock is not None
    with subprocess.Popen(["sleep", "30"], pass_fds=[lock.fileno()]) as child:
        lock.close()
        with pytest.raises(SecondMasterError):
            ownership.take("pcan", NAME)
        child.kill()
        child.wait()
    _taken_soon().close()


def _taken_soon():
    until = time.monotonic() + 5.0
    while True:
        try:
            lock = ownership.take("pcan", NAME)
        except SecondMasterError:
            if time.monotonic() > until:
                raise
            time.sleep(0.01)
            continue
        assert lock is not None
        return lock
