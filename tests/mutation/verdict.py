"""Whether a test notices a mutant: tried in a copy of the source, each in a process of its own."""

from __future__ import annotations

import compileall
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from py_compile import PycInvalidationMode

import pytest

from mutation.code_swap import Functions
from mutation.mutant import Mutant
from mutation.process_run import Ran, become_quiet, run_items, watch_over

IMPORT_TIME = 60.0  # seconds that a new Python may take before its first test
FIRST = 25  # tests of a new Python's first try: the others take longer to collect
SHORT = 0.3  # seconds of a test that waits for nothing: its result if it is run again


@dataclass(frozen=True)
class Task:
    """A mutant and the tests that concern it, in their order; ``anew``: only a new import shows it."""

    mutant: Mutant
    tests: list[str]
    anew: bool


@dataclass(frozen=True)
class Verdict:
    """The result of a mutant: ``by`` names the test that noticed, ``how`` it did; ``ran`` counts the tests."""

    killed: bool
    by: str = ""
    how: str = ""
    ran: int = 0


class Judge:
    """A worker's copy of the source, and its knowledge of the tests."""

    def __init__(
        self, root: Path, items: dict[str, pytest.Item], functions: Functions, times: dict[str, float]
    ) -> None:
        self._root, self._items, self._functions, self._times = root, items, functions, times
        self._folder = Path(tempfile.mkdtemp(prefix="mutants-"))
        shutil.copytree(root / "src", self._folder / "src", ignore=shutil.ignore_patterns("__pycache__"))
        compileall.compile_dir(
            self._folder / "src", quiet=2, invalidation_mode=PycInvalidationMode.CHECKED_HASH
        )
        for name in ("eds", "examples"):
            (self._folder / name).symlink_to(root / name)
        os.environ["PYTHONPATH"] = os.pathsep.join(
            [str(self._folder / "src"), str(Path(__file__).parents[1])]
        )
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"  # a mutant's would be taken for the next one's
        self._sound: dict[str, bool] = {}

    def close(self) -> None:
        """Remove the copy."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def judge(self, task: Task) -> Verdict:
        """Run the tests until one notices; one that fails without the mutant, too, or only now and then, has not."""
        ran = 0
        for tests in _portions(task):
            verdict = self._judge(task, tests)
            ran += verdict.ran
            if verdict.killed:
                return replace(verdict, ran=ran)
        return Verdict(False, ran=ran)

    def _judge(self, task: Task, left: list[str]) -> Verdict:
        ran = 0
        while left:
            end = self._run(task.mutant, left, anew=task.anew)
            ran += end.count
            if end.failed is None:
                break
            if end.failed not in left or self._notices(task, end):
                return Verdict(True, end.failed, end.how, ran)
            left = left[left.index(end.failed) + 1 :]
        return Verdict(False, ran=ran)

    def _notices(self, task: Task, end: Ran) -> bool:
        test = end.failed
        if test not in self._sound:
            self._sound[test] = self._run(None, [test], anew=False).failed is None
        if not self._sound[test]:
            return False
        if end.how == "takes too long" or self._times.get(test, 0.0) < SHORT:
            return True
        return self._run(task.mutant, [test], anew=task.anew).failed is not None

    def _run(self, mutant: Mutant | None, tests: list[str], *, anew: bool) -> Ran:
        scratch = tempfile.mkdtemp(dir=self._folder)
        os.environ["PYTEST_DEBUG_TEMPROOT"] = scratch
        if mutant is None:
            try:
                return self._forked(None, "", tests)
            finally:
                shutil.rmtree(scratch, ignore_errors=True)
        path = self._folder / mutant.file
        text = (self._root / mutant.file).read_text()
        path.write_text(mutant.apply(text))
        try:
            return self._anew(tests) if anew else self._forked(mutant, text, tests)
        finally:
            path.write_text(text)
            shutil.rmtree(scratch, ignore_errors=True)

    def _forked(self, mutant: Mutant | None, text: str, tests: list[str]) -> Ran:
        read, write = os.pipe()
        pid = os.fork()
        if pid == 0:
            os.setpgid(0, 0)
            become_quiet()
            try:
                if mutant is not None:
                    for function, code in self._functions.changes(
                        str(self._root / mutant.file), text, mutant.apply(text)
                    ):
                        function.__code__ = code
                run_items([self._items[test] for test in tests], write)
            finally:
                os._exit(0)
        os.close(write)
        try:
            return watch_over(pid, read, self._times)
        finally:
            os.close(read)

    def _anew(self, tests: list[str]) -> Ran:
        read, write = os.pipe()
        process = subprocess.Popen(
            [sys.executable, "-m", "mutation.fresh_imports", str(write)],
            cwd=self._root,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=[write],
            start_new_session=True,
        )
        os.close(write)
        process.stdin.write(json.dumps(tests).encode())
        process.stdin.close()
        try:
            return watch_over(process.pid, read, self._times, IMPORT_TIME)
        finally:
            process.wait()
            os.close(read)


def _portions(task: Task) -> Iterator[list[str]]:
    if task.anew:
        yield task.tests[:FIRST]
        yield task.tests[FIRST:]
    else:
        yield task.tests
