"""A pytest plugin that tries mutants instead of running the tests: workers are forked when all tests have been collected."""

from __future__ import annotations

import gc
import json
import os
import struct
import traceback
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

import pytest

from mutation.code_swap import Functions
from mutation.linemap import LineMap
from mutation.mutant import Mutant
from mutation.selection import tests_for
from mutation.verdict import Judge, Task, Verdict

_NUMBER = struct.Struct("I")


class Trial:
    """The mutants to try; ``tell`` is called with each verdict at once."""

    def __init__(
        self,
        root: Path,
        chosen: list[Mutant],
        known: LineMap,
        tell: Callable[[Task, Verdict], None],
        *,
        jobs: int,
        enough: float,
    ) -> None:
        self._root, self._chosen, self._known, self._tell = root, chosen, known, tell
        self._jobs, self._enough = jobs, enough

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Try the mutants instead of the tests."""
        items = {item.nodeid: item for item in session.items}
        functions = Functions(str(self._root / "src"))
        gc.freeze()
        tasks = [self._task(mutant, items, functions) for mutant in self._chosen]
        for number, verdict in share_out(tasks, self._jobs, lambda: self._judge(items, functions)):
            self._tell(tasks[number], verdict)
        return True

    def _judge(self, items: dict[str, pytest.Item], functions: Functions) -> Judge:
        return Judge(self._root, items, functions, self._known.times)

    def _task(self, mutant: Mutant, items: dict[str, pytest.Item], functions: Functions) -> Task:
        text = (self._root / mutant.file).read_text()
        tests = [test for test in tests_for(mutant, self._known, self._enough) if test in items]
        anew = self._known.at_import(mutant.file, *mutant.lines)
        anew = anew or functions.changes(str(self._root / mutant.file), text, mutant.apply(text)) is None
        return Task(mutant, tests, anew)


def share_out(tasks: list[Task], jobs: int, make: Callable[[], Judge]) -> Iterator[tuple[int, Verdict]]:
    """Let ``jobs`` processes judge the tasks; yield each one's number and verdict as it comes."""
    todo_read, todo_write = os.pipe()
    done_read, done_write = os.pipe()
    workers = []
    for _ in range(jobs):
        pid = os.fork()
        if pid == 0:
            os.close(todo_write)
            _work(tasks, make, todo_read, done_write)
        workers.append(pid)
    os.close(todo_read)
    os.close(done_write)
    with os.fdopen(todo_write, "wb") as todo:
        todo.write(b"".join(_NUMBER.pack(number) for number in range(len(tasks))))
    with os.fdopen(done_read) as done:
        for line in done:
            number, verdict = json.loads(line)
            yield number, Verdict(**verdict)
    for pid in workers:
        os.waitpid(pid, 0)


def _work(tasks: list[Task], make: Callable[[], Judge], todo: int, done: int) -> None:
    """Judge tasks, in a worker process, until there is no more."""
    code = 1
    try:
        judge = make()
        try:
            while data := os.read(todo, _NUMBER.size):
                (number,) = _NUMBER.unpack(data)
                verdict = judge.judge(tasks[number])
                os.write(done, json.dumps([number, asdict(verdict)]).encode() + b"\n")
            code = 0
        finally:
            judge.close()
    except BaseException:  # noqa: BLE001 - nothing of this process may go on as if it were the first one
        traceback.print_exc()
    finally:
        os._exit(code)
