"""A pytest plugin that notes which test executes which lines, in this process and in those that the test starts."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import coverage
import pytest

FOLDER = "AXISBUS_MUTANTS_FOLDER"  # where the notes go
SOURCES = "AXISBUS_MUTANTS_SOURCES"  # the folders whose lines count, with os.pathsep between

# The tests' child processes load this automatically: a module of this name is imported at the start of Python.
CHILD = """\
import os
test = os.environ.get("PYTEST_CURRENT_TEST", "")
if test and "PYTEST_XDIST_WORKER" in os.environ:
    from mutation import line_coverage
    line_coverage.begin(test.rpartition(" (")[0])
"""


def begin(context: str) -> coverage.Coverage:
    """Start to note lines, under ``context`` until another is set."""
    os.environ["COVERAGE_CORE"] = "ctrace"  # the others cannot distinguish the tests
    noting = coverage.Coverage(
        data_file=str(Path(os.environ[FOLDER]) / "lines"),
        data_suffix=True,
        config_file=False,
        source=os.environ[SOURCES].split(os.pathsep),
        context=context or None,
        auto_data=True,
        messages=False,
    )
    noting._warn_no_data = False
    noting._warn_unimported_source = False
    noting.start()
    return noting


class Measuring:
    """One pytest process: a context per test, and how long each took."""

    def __init__(self) -> None:
        self._noting = begin("")
        self._took: dict[str, float] = {}
        self._failed: set[str] = set()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Note lines under the test's name."""
        self._noting.switch_context(item.nodeid)
        try:
            return (yield)
        finally:
            self._noting.switch_context("")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add up the parts of each test: set-up, call, tear-down."""
        self._took[report.nodeid] = self._took.get(report.nodeid, 0.0) + report.duration
        if not report.passed:
            self._failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Write the times and the lines."""
        name = f"times.{os.environ.get('PYTEST_XDIST_WORKER', 'alone')}.json"
        times = {test: [took, test not in self._failed] for test, took in self._took.items()}
        (Path(os.environ[FOLDER]) / name).write_text(json.dumps(times))
        self._noting.stop()
        self._noting.save()


def pytest_configure(config: pytest.Config) -> None:
    """Measure where the tests run: in the workers, if there are any."""
    if getattr(config.option, "numprocesses", None) is None or hasattr(config, "workerinput"):
        config.pluginmanager.register(Measuring(), "measuring")
