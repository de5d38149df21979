"""Settings of all tests: the examples to try, the slow tests, the memory limit of a test, and checks at the end of a run."""

from __future__ import annotations

import atexit
import gc
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import warnings
from collections import defaultdict
from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import pytest
from hypothesis import HealthCheck, settings

from kit import scan_file_access
from kit.scenarios import golden as scenario_golden
from kit.slow import is_real_time, is_slow, is_sweep, is_virtual_time, shares_virtual_time, swept_cases

if TYPE_CHECKING:
    from kit import command_line

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
)  # bytes of address space; a test that needs more fails alone, and does not stop the computer

# In the tests the core runs in the program, so that they can look into it; ``AXISBUS_PROCESS=own`` gives it a process of its own.
os.environ.setdefault("AXISBUS_PROCESS", "thread")
os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="axisbus-journals-")  # nothing is left in a home
atexit.register(shutil.rmtree, os.environ["XDG_STATE_HOME"], ignore_errors=True)

if sys.platform == "linux":
    import resource

    _soft, _hard = resource.getrlimit(resource.RLIMIT_AS)
    if _soft == resource.RLIM_INFINITY or _soft > _MEMORY:
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _hard))

# A shell ignores Ctrl-C for processes in the background.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# nohup has them ignored, and the programs that tests start would inherit that.
for _number in ("SIGHUP", "SIGQUIT"):
    if getattr(signal, _number, None) and signal.getsignal(getattr(signal, _number)) is signal.SIG_IGN:
        signal.signal(getattr(signal, _number), signal.SIG_DFL)

_MANY_OBJECTS = 100_000  # from here on a garbage collection takes as long as the opening of a machine
_freeze = gc.freeze
_PROCESSORS = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
QUICK = "not slow"  # the choice of ``make quick``
scan_file_access.begin()
_shared: dict[Path, ExitStack] = {}  # of the file whose tests run now, if they share their virtual time
_failed: set[str] = set()
_used: set[str] = set()
_kept: set[str] = set()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not even import slow tests if only the quick ones are run: importing takes as long as they do."""
    return True if config.option.markexpr == QUICK and is_slow(collection_path) else None


@pytest.hookimpl(tryfirst=True)  # before the tests are chosen by their marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that are slow, or have a time."""
    for (path, _), cases in _by_function(items).items():
        swept = swept_cases(path, len(cases))
        for number, case in enumerate(cases):
            if number in swept:
                case.add_marker(pytest.mark.sweep)
    for item in items:
        test = getattr(item, "originalname", item.name)
        if is_slow(item.path, test):
            item.add_marker(pytest.mark.slow)
        if is_sweep(item.path, test):
            item.add_marker(pytest.mark.sweep)
        if is_real_time(item.path, test):
            item.add_marker(pytest.mark.real_time)
        elif is_virtual_time(item.path, test):
            item.add_marker(pytest.mark.virtual_time)


def _by_function(items: list[pytest.Item]) -> dict[tuple[Path, str], list[pytest.Item]]:
    """Return the cases of each test that is not in real time."""
    found: dict[tuple[Path, str], list[pytest.Item]] = defaultdict(list)
    for item in items:
        test = getattr(item, "originalname", item.name)
        if not is_real_time(item.path, test):
            found[item.path, item.nodeid.partition("[")[0]].append(item)
    return found


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Collect from each process which golden messages its scenarios have used."""
    used, kept = getattr(node, "workeroutput", {}).get("golden", ((), ()))
    _used.update(used)
    _kept.update(kept)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail where all scenarios have passed and golden messages are left over."""
    if not _kept or exitstatus != 0:
        return
    if choice := scenario_golden.part(session):
        if (cache := getattr(session.config, "cache", None)) is None:
            return
        cache.set(f"golden/{choice}", sorted(_used))
        parts = [cache.get(f"golden/{each}", None) for each in scenario_golden.PARTS]
        if None in parts:
            return
        _used.update(name for names in parts for name in names)
    if _kept - _used:
        print(f"\nno scenario uses these golden messages: {', '.join(sorted(_kept - _used))}")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, Any, Any]:
    """Run a test in virtual time if it is marked so; some files have one virtual time for all their tests."""
    if item.get_closest_marker("real_time"):
        return (yield)
    with _on_one_processor():
        return (yield from _in_its_time(item, nextitem))


@contextmanager
def _on_one_processor() -> Iterator[None]:
    """Keep a test in virtual time, and the threads that it starts, on one processor.

    Only one of its threads runs at a time, and waking one on another processor takes longer than most of their turns. The programs
    that it starts run on all processors.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")
    os.sched_setaffinity(0, {_PROCESSORS[int(worker) % len(_PROCESSORS)]})
    start = subprocess.Popen._execute_child

    def start_anywhere(*arguments: Any) -> None:
        mine = os.sched_getaffinity(0)
        os.sched_setaffinity(0, _PROCESSORS)
        try:
            start(*arguments)
        finally:
            os.sched_setaffinity(0, mine)

    try:
        with mock.patch.object(subprocess.Popen, "_execute_child", start_anywhere):
            yield
    finally:
        os.sched_setaffinity(0, _PROCESSORS)


def _in_its_time(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, Any, Any]:
    if not item.get_closest_marker("virtual_time"):
        return (yield)
    from kit.virtual_time import virtual_time  # imports the bus, which quick tests do not need

    if not shares_virtual_time(item.path):
        with virtual_time():
            return (yield)
    if item.path not in _shared:
        _shared[item.path] = ExitStack()
        _shared[item.path].enter_context(virtual_time())
    try:
        return (yield)
    finally:
        if nextitem is None or nextitem.path != item.path:
            _shared.pop(item.path).close()


@pytest.hookimpl(trylast=True)
def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Collect the garbage of a failed test once it is over: otherwise a later test in this process is blamed for it."""
    if hasattr(report, "node"):  # this process only gets the result
        return
    if report.failed:
        _failed.add(report.nodeid)
    if report.when != "teardown" or report.nodeid not in _failed:
        return
    for name in ("last_type", "last_value", "last_traceback", "last_exc"):  # they hold the frames of the test
        if hasattr(sys, name):
            delattr(sys, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gc.collect()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, Any, Any]:
    """Fail a test in which a scan waited for a disk, and the last one of a file that leaves a machine open for the next."""
    found = scan_file_access.taken()
    result = yield
    assert not found, f"a running scan opens nothing: {found}"
    if nextitem is not None and nextitem.path == item.path:
        return result
    if not _is_real_time(item.config) and len(gc.get_objects()) > _MANY_OBJECTS:
        gc.collect()
        _freeze()
    if (way_out := sys.modules.get("axisbus.machine.signal_shutdown")) is not None:
        left = list(way_out.EXIT._sessions)
        for session in left:
            way_out.EXIT.part(session)
        assert not left, f"{len(left)} machines were left open by tests of this file"
    return result


def _is_real_time(config: pytest.Config) -> bool:
    """Whether only tests in real time are run: there each machine excludes its own objects, as in a program."""
    return config.option.markexpr == "real_time"


@pytest.fixture(scope="session", autouse=True)
def collected_tests_are_no_garbage(request: pytest.FixtureRequest) -> Iterator[None]:
    """Exclude the collected tests from garbage collection; no machine may end that, as it does for its own objects when it closes.

    All tests together are a million objects, and each opening of a machine begins with a collection. Objects that the tests of a
    file leave in caches are excluded after that file. In virtual time a long collection delays no cycle.
    """
    if _is_real_time(request.config):
        yield
        return
    _freeze()
    with mock.patch.object(gc, "freeze"), mock.patch.object(gc, "unfreeze"):
        yield


@pytest.fixture
def axisbus(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> command_line.Run:
    """Run a command line in this process; returns its exit code and its output."""
    from kit import command_line  # imports the commands, which quick tests do not need

    return command_line.runner(monkeypatch, capsys)


@pytest.fixture
def core_in_threads() -> Iterator[None]:
    """Machines of cells with a core of its own run that in threads, which virtual time reaches."""
    from kit import core_in_threads  # imports the core, which quick tests do not need

    with core_in_threads.core_in_threads():
        yield
