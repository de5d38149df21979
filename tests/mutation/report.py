"""The printed report: each verdict at once, the survivors as diffs, and a table by kind and by package."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

from mutation.mutant import Mutant
from mutation.verdict import Task, Verdict


class Report:
    """The verdicts so far, and where they are printed."""

    def __init__(self, root: Path, total: int, out: TextIO) -> None:
        self._root, self._total, self._out = root, total, out
        self._began = time.monotonic()
        self.verdicts: list[tuple[Task, Verdict]] = []

    def tell(self, task: Task, verdict: Verdict) -> None:
        """Print a verdict; a survivor with its change."""
        self.verdicts.append((task, verdict))
        mutant = task.mutant
        survived = f"SURVIVED: {mutant.change((self._root / mutant.file).read_text())}"
        became = f"killed: {verdict.by} {verdict.how}" if verdict.killed else survived
        self._print(
            f"[{len(self.verdicts)}/{self._total}] {mutant.file}:{mutant.line} {mutant.kind}: {became}"
        )

    def _survivor(self, task: Task) -> str:
        text = (self._root / task.mutant.file).read_text()
        ran = Counter(test.split("::")[0] for test in task.tests)
        tests = (
            ", ".join(f"{count} of {file}" for file, count in ran.most_common(6)) or "none executes this line"
        )
        more = f" and {len(ran) - 6} more files" if len(ran) > 6 else ""
        return (
            f"{task.mutant.diff(text)}\n  change: {task.mutant.change(text)}\n  tests that ran: {tests}{more}"
        )

    @property
    def killed(self) -> int:
        """How many were noticed."""
        return sum(verdict.killed for _, verdict in self.verdicts)

    def finish(self) -> None:
        """Print the survivors once more, the tables and the sum."""
        survivors = sorted(
            (task for task, verdict in self.verdicts if not verdict.killed), key=lambda task: task.mutant
        )
        if survivors:
            self._print(f"\n{len(survivors)} survived:")
        for task in survivors:
            self._print(
                f"\n{task.mutant.file}:{task.mutant.line} in {task.mutant.inside or 'the module'}: {task.mutant.kind}"
            )
            self._print(self._survivor(task))
        self._print("\n" + self._table("kind", lambda mutant: mutant.kind))
        self._print("\n" + self._table("package", lambda mutant: Path(mutant.file).parent.name))
        took = time.monotonic() - self._began
        share = 100.0 * self.killed / max(1, len(self.verdicts))
        self._print(f"\n{self.killed} of {len(self.verdicts)} killed ({share:.1f} %) in {took / 60:.0f} min")

    def _table(self, title: str, key: Callable[[Mutant], str]) -> str:
        total = Counter(key(task.mutant) for task, _ in self.verdicts)
        killed = Counter(key(task.mutant) for task, verdict in self.verdicts if verdict.killed)
        rows = [
            f"{name:<18} {killed[name]:>6} {count:>6} {100 * killed[name] / count:>5.0f} %"
            for name, count in sorted(total.items())
        ]
        return "\n".join([f"{title:<18} {'killed':>6} {'of':>6}", *rows])

    def _print(self, line: str) -> None:
        print(line, file=self._out, flush=True)
