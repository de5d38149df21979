"""What all tests share: the folder itself on the path (for ``can_line``), and what only the end of a shared-out run can tell."""

from __future__ import annotations

from typing import Any

import pytest

_used: set[str] = set()
_kept: set[str] = set()


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
