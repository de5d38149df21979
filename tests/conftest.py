"""What all tests share: which examples are tried, how much memory a test may
take, and what only the end of a shared-out run can tell."""

from __future__ import annotations

import os
import sys
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from kit import undisturbed

# The same examples in every run, so that a run says something of the change and not of chance; ``make explore`` tries fresh ones.
settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("fresh", print_blob=True, deadline=None)
# ``--hypothesis-profile=deep``: a long random search.
settings.register_profile(
    "deep",
    max_examples=5000,
    stateful_step_count=80,
    deadline=None,
    derandomize=False,
    suppress_health_check=list(HealthCheck),
)
settings.load_profile(os.environ.get("AXISBUS_EXAMPLES", "same"))

_MEMORY = (
    8 << 30
)  # bytes of address space; a test that wants more fails by itself, and does not take the machine with it

if sys.platform == "linux":
    import resource

    _soft, _hard = resource.getrlimit(resource.RLIMIT_AS)
    if _soft == resource.RLIM_INFINITY or _soft > _MEMORY:
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _hard))

# Begun first: a long file that one process begins last is waited for by all the others.
_LONG = (
    "test_readme.py",
    "test_story_random.py",
    "test_story_suspended.py",
    "test_story_plants.py",
    "test_eds_corpus.py",
    "test_story_bus_off.py",
    "test_story_signals.py",
    "test_story_dead_bus.py",
    "test_eds_reports_fuzz.py",
    "test_eds_check_planted.py",
    "test_cli_commands.py",
    "test_cli_fuzz.py",
    "test_sim_sdo_sweep.py",
    "test_bus_inbox.py",
)
undisturbed.begin()
_used: set[str] = set()
_kept: set[str] = set()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first."""
    items.sort(key=lambda item: _LONG.index(item.path.name) if item.path.name in _LONG else len(_LONG))


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Collect from each process which golden messages its stories have used."""
    used, kept = getattr(node, "workeroutput", {}).get("golden", ((), ()))
    _used.update(used)
    _kept.update(kept)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail where all stories have passed and golden messages are left over."""
    if _kept - _used and exitstatus == 0:
        print(f"\nno story uses these golden messages: {', '.join(sorted(_kept - _used))}")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> None:
    """Fail a test in which a scan waited for a disk."""
    found = undisturbed.taken()
    assert not found, f"a running scan opens nothing: {found}"
