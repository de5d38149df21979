"""Run tests in a Python that imports everything again.

``python -m mutation.fresh_imports PIPE``, with the tests' names as JSON in its input.
"""

from __future__ import annotations

import json
import os
import sys

import pytest

from mutation.process_run import run_items

OPTIONS = ["--capture=sys", "-p", "no:cacheprovider", "-p", "no:xdist", "-qq", "--no-header"]


class Chosen:
    """A plugin that runs the given tests in their order."""

    def __init__(self, tests: list[str], write: int) -> None:
        self._tests, self._write = tests, write

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run instead of pytest's own loop."""
        by_name = {item.nodeid: item for item in session.items}
        run_items([by_name[test] for test in self._tests if test in by_name], self._write)
        os._exit(0)


def main() -> None:
    """Read the names and run."""
    tests = json.load(sys.stdin)
    files = sorted({test.split("::")[0] for test in tests})
    write = int(sys.argv[1])
    code = pytest.main([*files, *OPTIONS], plugins=[Chosen(tests, write)])
    os.write(write, json.dumps(["failed", f"collection ({code})"]).encode() + b"\n")  # the loop never returns


if __name__ == "__main__":
    main()
