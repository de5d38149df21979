"""For how long a watchdog process lets a core run no cycle, by its stage; in the test's own time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from axisbus.core.process import watchdog_process
from axisbus.core.process.rescue import CrashStop
from axisbus.core.process.startup_args import StartupArgs
from axisbus.ipc import image, rescue_memory
from axisbus.ipc.rescue_memory import CoreStage, LifelineWriter, RescueRpdo
from kit.cell import cell_file

AT = image.size_of(1)


class Core:
    """A core that runs no cycle, and takes its stages at given times; ``killed``: when it was, in s."""

    def __init__(
        self, monkeypatch, stages: dict[float, CoreStage | None], writer: LifelineWriter, ends: float
    ) -> None:
        """``stages``: by the time of their beginning; None: it ends."""
        self.now, self.killed = 0.0, None
        self._ends = min([ends, *(at for at, stage in stages.items() if stage is None)])
        self._stages = {at: stage for at, stage in stages.items() if stage is not None}
        self._writer = writer
        clock = SimpleNamespace(monotonic=lambda: self.now, sleep=self._pass)
        monkeypatch.setattr(watchdog_process, "time", clock)
        monkeypatch.setattr(watchdog_process, "_exit_code", lambda _: 0 if self.now >= self._ends else None)
        monkeypatch.setattr(watchdog_process, "_kill", lambda _: setattr(self, "killed", self.now))

    def _pass(self, seconds: float) -> None:
        self.now += seconds
        for at in [at for at in self._stages if at <= self.now]:
            self._writer.stage(self._stages.pop(at))


@pytest.fixture
def rescuer(tmp_path: Path) -> Iterator[CrashStop]:
    file = cell_file(tmp_path, "x")
    memory = os.memfd_create("test")
    os.ftruncate(memory, AT + rescue_memory.size_of(1))
    yield CrashStop(StartupArgs(-1, memory, -1, -1, str(file), 1, -1, -1, -1))
    os.close(memory)


@pytest.mark.parametrize(
    ("stages", "killed"),
    [
        ({0.0: CoreStage.OPENING}, None),
        ({0.0: CoreStage.RUNNING}, 0.5),
        (
            {0.0: CoreStage.RUNNING, 0.3: CoreStage.LOST},
            10.3,
        ),  # its driver blocks while the adapter is opened again
        ({0.0: CoreStage.RUNNING, 0.3: CoreStage.LOST, 5.0: CoreStage.WAITING}, None),
        (
            {0.0: CoreStage.WAITING, 5.0: CoreStage.RUNNING},
            5.5,
        ),  # the adapter is open again, and the scan does not run
        ({0.0: CoreStage.LEAVING}, 0.5),  # its scan runs until it has stopped the axes
        (
            {0.0: CoreStage.LEAVING, 0.3: CoreStage.RELEASING},
            20.3,
        ),  # it has stopped them, and its nodes do not answer, or it hangs
        ({0.0: CoreStage.RELEASING, 15.0: CoreStage.LEFT, 20.0: None}, None),
        ({0.0: CoreStage.LEFT}, 10.0),
    ],
)
def test_a_core_without_cycles_is_killed_after_the_time_of_its_stage(rescuer, monkeypatch, stages, killed):
    writer = LifelineWriter(rescuer._memory, AT)
    writer.enter([RescueRpdo(0)])
    writer.touched(0)
    core = Core(monkeypatch, dict(stages), writer, ends=60.0)
    watchdog_process._end_of(1, rescuer, SimpleNamespace(send=lambda _: None))
    assert core.killed == (None if killed is None else pytest.approx(killed, abs=0.1))


@pytest.mark.parametrize("stage", [CoreStage.RUNNING, CoreStage.LEAVING])
def test_a_core_that_has_commanded_nothing_has_ten_seconds_without_a_cycle(rescuer, monkeypatch, stage):
    """As after a pause of a loaded computer between opening and closing: there is nothing to stop."""
    writer = LifelineWriter(rescuer._memory, AT)
    writer.enter([RescueRpdo(0)])
    core = Core(monkeypatch, {0.0: stage}, writer, ends=60.0)
    watchdog_process._end_of(1, rescuer, SimpleNamespace(send=lambda _: None))
    assert core.killed == pytest.approx(10.0, abs=0.1)


def test_a_core_that_has_set_an_output_is_killed_as_soon_as_one_that_has_commanded_an_axis(
    rescuer, monkeypatch
):
    monkeypatch.setattr(CrashStop, "_outputs", lambda _: ["lamp"])
    core = Core(monkeypatch, {0.0: CoreStage.RUNNING}, LifelineWriter(rescuer._memory, AT), ends=60.0)
    watchdog_process._end_of(1, rescuer, SimpleNamespace(send=lambda _: None))
    assert core.killed == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("stage", CoreStage)
def test_the_drives_of_a_core_that_dies_are_stopped_unless_it_had_none_or_has_left_them(rescuer, stage):
    LifelineWriter(rescuer._memory, AT).stage(stage)
    assert rescuer.is_needed is (stage not in (CoreStage.OPENING, CoreStage.LEFT))
