"""Links and simulated drives for the SocketCAN tests; they are only collected where ``make test-socketcan`` has made a link."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from kit.can_interface import LINK
from kit.socketcan_cell import Ends, Stage

collect_ignore_glob = [] if LINK else ["test_*.py"]


@pytest.fixture
def ends() -> Iterator[Ends]:
    made = Ends()
    yield made
    made.close()


@pytest.fixture
def make_stage(tmp_path: Path) -> Iterator[Callable[[str, str], Stage]]:
    """A function that sets the stage on two links."""
    stages: list[Stage] = []

    def make(ours: str, theirs: str) -> Stage:
        stages.append(Stage(tmp_path, ours, theirs))
        return stages[-1]

    yield make
    for stage in stages:
        stage.simulated_nodes._shut()


@pytest.fixture
def stage(make_stage: Callable[[str, str], Stage]) -> Stage:
    """Both on the one link of the run."""
    return make_stage(LINK, LINK)
