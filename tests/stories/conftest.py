"""What all stories share: golden messages, and that a story of stopping fails when its nets are cut.

With ``AXISBUS_PROCESS=own`` each core has a process of its own: a story that looks into it is skipped where it does, and nets are
cut only where a story has a process cut them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, NoReturn

import pytest

from axisbus.core.process.client import RemoteCore
from axisbus.machine.signal_shutdown import EXIT
from kit.cell import Stage
from kit.probe import PlantMoves
from kit.slow import is_real_time
from kit.stories import golden as story_golden
from kit.stories.nets import cut

OWN = os.environ["AXISBUS_PROCESS"] == "own"


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers",
        "nets(*names): run the story also with these nets cut (see story_nets); then its look at the plant must fail",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    marker = metafunc.definition.get_closest_marker("nets")
    if marker is not None:
        cuts = {"whole": ()} if OWN else {"whole": (), "without " + " and ".join(marker.args): marker.args}
        metafunc.parametrize("nets_cut", cuts.values(), ids=cuts.keys())


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Let the look for golden messages that no story uses come after all stories; virtual time knows no processes."""
    items.sort(key=lambda item: item.path.name == "test_story_zz_golden.py")
    if OWN:
        virtual = [item for item in items if not is_real_time(item.path)]
        items[:] = [item for item in items if item not in virtual]
        config.hook.pytest_deselected(items=virtual)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Tell the process that shares the tests out which golden messages this one has used."""
    output = getattr(session.config, "workeroutput", None)
    if output is not None:
        whole = story_golden.whole(session)
        output["golden"] = sorted(story_golden.USED), sorted(story_golden.kept()) if whole else []


@pytest.fixture(autouse=True)
def nets_cut() -> tuple[str, ...]:
    """The nets that are cut in this run of the story."""
    return ()


def _of_another_process(_: object) -> NoReturn:
    pytest.skip("looks into the core, which is in a process of its own")


@pytest.fixture(autouse=True)
def from_outside(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Skip what looks into a core that is in a process of its own, and leave no such core behind."""
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
        if not core._calls.over:
            core.leave("the story is over")
            EXIT.part(core.session)
        if core._control is not None:  # else its drives go on beside all stories that follow
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
    pytest.fail(f"the plant stands without {' and '.join(names)}: this story proves nothing")


@pytest.fixture
def golden(tmp_path):
    """Compare the text of an error with its golden file."""
    return story_golden.Golden(tmp_path)


@pytest.fixture
def story(tmp_path):
    """Make simulated cells in virtual time; see ``kit.cell.Stage``. They are let go afterwards, whatever became of them."""
    with Stage(tmp_path) as stage:
        yield stage
