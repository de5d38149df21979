"""What all stories share: golden messages, and that a story of stopping fails when its nets are cut."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from kit.cell import Stage
from kit.probe import PlantMoves
from kit.stories import golden as story_golden
from kit.stories.nets import cut


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers",
        "nets(*names): run the story also with these nets cut (see story_nets); then its look at the plant must fail",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    marker = metafunc.definition.get_closest_marker("nets")
    if marker is not None:
        names = ["whole", "without " + " and ".join(marker.args)]
        metafunc.parametrize("nets_cut", [(), marker.args], ids=names)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let the look for golden messages that no story uses come after all stories."""
    items.sort(key=lambda item: item.path.name == "test_story_zz_golden.py")


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
