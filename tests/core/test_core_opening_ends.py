"""A core whose program or watchdog process ends while it opens a cell does not run: nothing would stop its axes."""

from __future__ import annotations

import pytest

from axisbus.core.process.server import CoreServer
from axisbus.errors import ScanError
from axisbus.ipc.rescue_memory import CoreStage, LifelineWriter
from axisbus.machine.machine import Machine
from kit.core_in_threads import core_in_threads
from kit.scenarios.core_process import OWN_PROCESS, own_cell

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
WHY = "the watchdog process of the core has ended"


@pytest.fixture
def stages(monkeypatch) -> list[CoreStage]:
    found: list[CoreStage] = []
    monkeypatch.setattr(LifelineWriter, "stage", lambda _, stage: found.append(stage))
    return found


@pytest.mark.parametrize("step", ["_await_watchdog", "_take_signals"])
def test_a_machine_is_not_opened_if_its_core_has_to_leave_before(tmp_path, monkeypatch, stages, step):
    """Before the nodes are booted, and when the scan is about to begin."""
    with core_in_threads():
        do = getattr(CoreServer, step)
        monkeypatch.setattr(CoreServer, step, lambda server: (do(server), server._leave(WHY)))
        with pytest.raises(ScanError, match=f"the machine was not opened: {WHY}"):
            Machine.open(own_cell(tmp_path, "x"))
    assert CoreStage.RUNNING not in stages


def test_a_machine_is_closed_if_its_core_has_to_leave_when_it_has_just_been_opened(tmp_path, monkeypatch):
    opened = CoreServer._opened

    def leave(server):
        server._leave(WHY)
        return opened(server)

    monkeypatch.setattr(CoreServer, "_opened", leave)
    with core_in_threads(), Machine.open(own_cell(tmp_path, "x")) as machine:
        machine.session.waiter.wait(lambda: machine.session.ended, 20.0)
        assert machine.session.left[1] == WHY
