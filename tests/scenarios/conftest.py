"""Fixtures of all scenarios: golden messages, and a check that a scenario of stopping fails without its safety nets.

With ``AXISBUS_PROCESS=own`` each core has a process of its own. Scenarios that look into the core are then skipped, and safety nets
are removed only where a scenario has a process remove them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, NoReturn

import pytest

from axisbus.core.process.client import RemoteCore
from axisbus.machine.signal_shutdown import EXIT
from kit.cell import Stage
from kit.plant_probe import PlantMoves
from kit.scenarios import golden as scenario_golden
from kit.scenarios.safety_nets import cut
from kit.slow import is_real_time

OWN = os.environ["AXISBUS_PROCESS"] == "own"


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers",
        "nets(*names): run the scenario also with these nets cut (see scenario_nets); then its look at the plant must fail",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    marker = metafunc.definition.get_closest_marker("nets")
    if marker is not None:
        cuts = {"whole": ()} if OWN else {"whole": (), "without " + " and ".join(marker.args): marker.args}
        metafunc.parametrize("nets_cut", cuts.values(), ids=cuts.keys())


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Run the check for unused golden messages after all scenarios; scenarios in virtual time have no processes."""
    items.sort(key=lambda item: item.path.name == "test_scenario_zz_golden.py")
    if OWN:
        virtual = [item for item in items if not is_real_time(item.path)]
        items[:] = [item for item in items if item not in virtual]
        config.hook.pytest_deselected(items=virtual)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Report the golden messages that this process has used to the process that distributes the tests."""
    output = getattr(session.config, "workeroutput", None)
    if output is not None:
        whole = scenario_golden.whole(session) or scenario_golden.part(session)
        output["golden"] = sorted(scenario_golden.USED), sorted(scenario_golden.kept()) if whole else []


@pytest.fixture(autouse=True)
def nets_cut() -> tuple[str, ...]:
    """The safety nets that are removed in this run of the scenario."""
    return ()


def _of_another_process(_: object) -> NoReturn:
    pytest.skip("looks into the core, which is in a process of its own")


@pytest.fixture(autouse=True)
def from_outside(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Skip tests that look into a core that is in a process of its own, and leave no such core behind."""
    cores: list[RemoteCore] = []
    if OWN:
        make = RemoteCore.__init__

        def noted(core: RemoteCore, *given: Any) -> None:
            make(core, *given)
            cores.append(core)

        monkeypatch.setattr(RemoteCore, "__init__", noted)
        for name in ("scan", "runtime"):
            monkeypatch.setattr(RemoteCore, name, property(_of_another_process), raising=False)
    yield
    for core in cores:
        if not core._rpc.over:
            core.leave("the scenario is over")
            EXIT.part(core.session)
        if core._control is not None:  # else its drives go on beside all scenarios that follow
            core._control.end()


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Iterator[None]:
    callspec = getattr(pyfuncitem, "callspec", None)
    names = callspec.params.get("nets_cut", ()) if callspec is not None else ()
    if not names:
        return (yield)
    with cut(names):
        try:
            yield
        except PlantMoves:
            return True
    pytest.fail(f"the plant stands without {' and '.join(names)}: this scenario proves nothing")


@pytest.fixture
def golden(tmp_path):
    """Compare the text of an error with its golden file."""
    return scenario_golden.Golden(tmp_path)


@pytest.fixture
def scenario(tmp_path):
    """Make simulated cells in virtual time; see ``kit.cell.Stage``. They are released afterwards in any case."""
    with Stage(tmp_path) as stage:
        yield stage
