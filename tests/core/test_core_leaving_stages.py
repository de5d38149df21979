"""The stages that a core stores for its watchdog process: from the closing of its machine on, none gives it more time again."""

from __future__ import annotations

import pytest

from axisbus.core.core import AdapterLoss
from axisbus.core.process.server import CoreServer
from axisbus.ipc.rescue_memory import CoreStage, LifelineWriter
from axisbus.machine.machine import Machine
from kit.core_in_threads import core_in_threads
from kit.scenarios.core_process import OWN_PROCESS, own_cell

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]


@pytest.fixture
def stages(monkeypatch) -> list[CoreStage]:
    """The stages that are stored, in their order."""
    found: list[CoreStage] = []
    store = LifelineWriter.stage

    def noted(self, stage: CoreStage) -> None:
        found.append(stage)
        store(self, stage)

    monkeypatch.setattr(LifelineWriter, "stage", noted)
    return found


def test_a_core_that_closes_has_stopped_its_axes_before_it_may_run_no_cycle(tmp_path, stages, monkeypatch):
    running = []
    take = CoreServer._stage

    def note(self, stage):
        if stage is CoreStage.RELEASING:
            running.append((self._core.scan.has_stopped, self._core.scan.ended))
        take(self, stage)

    monkeypatch.setattr(CoreServer, "_stage", note)
    with core_in_threads(), Machine.open(own_cell(tmp_path, "x")) as machine:
        machine["x"].enable().wait(10)
        machine["x"].move_velocity(50.0).wait(10)
    assert stages == [CoreStage.RUNNING, CoreStage.LEAVING, CoreStage.RELEASING, CoreStage.LEFT]
    assert running == [(True, False)]


def test_a_core_whose_scan_has_ended_is_not_expected_to_run_cycles_while_it_closes(
    tmp_path, stages, monkeypatch
):
    leave = CoreServer._leave

    def ended(self, reason):
        self._core.scan.quit()
        self._core._waiter.wait(lambda: self._core.scan.ended, 5.0)
        leave(self, reason)

    with core_in_threads(), Machine.open(own_cell(tmp_path, "x")):
        monkeypatch.setattr(CoreServer, "_leave", ended)
    assert stages == [CoreStage.RUNNING, CoreStage.RELEASING, CoreStage.LEFT]


@pytest.mark.parametrize("loss", AdapterLoss)
def test_the_loss_of_the_adapter_gives_a_core_that_leaves_no_more_time(tmp_path, stages, loss, monkeypatch):
    leave = CoreServer._do_leave

    def lost(self, reason):
        leave(self, reason)
        self._core.on_adapter_loss(loss)

    monkeypatch.setattr(CoreServer, "_do_leave", lost)
    with core_in_threads(), Machine.open(own_cell(tmp_path, "x")):
        pass
    assert stages[-1] is CoreStage.LEFT
