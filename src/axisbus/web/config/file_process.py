"""Parse the DCF of a page in a process of its own: it must not delay the stops, the jogs and the values of other pages.

Theory of operation
-------------------
``python -m axisbus.web.config.file_process`` reads a ``FileTask``, the cell and the file from standard input. It describes the
file, or carries out a job of ``file_jobs``. If the job needs something of the node, the process asks the server, which makes the
transfer. So everything that depends on the size of the file is computed in the process.

The process has a low priority, and its memory is limited. The server ends it if it sends nothing for ``SILENCE_TIMEOUT``, and
when the job is cancelled. Both sides send one JSON object per line.
"""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Self

import msgspec

from axisbus.bus.sdo.access import decoded
from axisbus.bus.sdo.transfer import Progress
from axisbus.cell.model import CellConfig
from axisbus.cia301.datatypes import DataType, Value
from axisbus.configuration.dcf_values import Key
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import AxisbusError, StateError
from axisbus.ipc.errors import ErrorFields, from_fields, register_message_types, to_fields
from axisbus.ipc.values import Codec
from axisbus.system import process_limits
from axisbus.system.signals import OWN_GROUP
from axisbus.web.config import file_jobs, files
from axisbus.web.config.file_jobs import JobNode, OnProgress
from axisbus.web.config.files import Dcf
from axisbus.web.config.report import ConfigJobKind, ConfigReport

SILENCE_TIMEOUT = 20.0  # seconds that the process may compute until it sends something
MEMORY = 1 << 30  # bytes of its address space; the largest files that are accepted need half of it
_PROCESSOR_TIME = 600  # seconds, after which the kernel ends a process that has lost its server
_NICE = 15
_POLL_PERIOD = 0.1  # seconds between two checks whether the job is cancelled
_COMMAND = (sys.executable, "-m", "axisbus.web.config.file_process")
_CELLS = Codec([CellConfig])
_BUSY = "if this computer is busy, try again later"
_COMMAND_LINE = "give the file to axisbus config on the command line, or a smaller file"


class FileTask(msgspec.Struct, frozen=True):
    """The task for a file of ``size`` bytes: carry out the job ``kind`` for a node, or describe the file if it is None."""

    name: str
    size: int
    kind: ConfigJobKind | None = None
    node: int = 0
    cell: bytes = b""
    cyclic: tuple[Key, ...] = ()


class FileUpload(msgspec.Struct, frozen=True, tag=True):
    """Asks for the bytes of an object."""

    index: int
    subindex: int


class FileDownload(msgspec.Struct, frozen=True, tag=True):
    """Asks to write an object."""

    index: int
    subindex: int
    data: bytes


class FileRestCheck(msgspec.Struct, frozen=True, tag=True):
    """Asks for an error if the node is energised."""


class FileRefusal(msgspec.Struct, frozen=True, tag=True):
    """Asks for the error that says why the node is not restored completely."""


class FileProgress(msgspec.Struct, frozen=True, tag=True):
    """Reports the progress; is not answered."""

    done: int
    whole: int


class FileEnd(msgspec.Struct, frozen=True, tag=True):
    """Ends the work: a description or a report, or an error."""

    text: str = ""
    report: ConfigReport | None = None
    error: ErrorFields | None = None


class FileAnswer(msgspec.Struct, frozen=True):
    """Answers a question of the process."""

    data: bytes = b""
    error: ErrorFields | None = None


FileQuestion = FileUpload | FileDownload | FileRestCheck | FileRefusal
register_message_types(FileTask, FileAnswer, FileEnd, FileUpload, FileDownload, FileProgress)
_MESSAGES = msgspec.json.Decoder(FileQuestion | FileProgress | FileEnd)
_ANSWERS = msgspec.json.Decoder(FileAnswer)
_pack = msgspec.json.Encoder().encode


# -- in the server -----------------------------------------------------------------------------------------------------------


def summary(file: Dcf) -> str:
    """Return the description of a file; blocks for at most ``SILENCE_TIMEOUT``.

    Raises:
        EdsError: as ``files.summary``.
        StateError: it takes too long or too much memory.
    """
    with FileProcess(file, FileTask(file.name, len(file.data))) as process:
        end = process.next(_no_check)
        assert isinstance(end, FileEnd)
        return _checked(end).text


def carry_out(
    kind: ConfigJobKind, node: JobNode, file: Dcf, on_progress: OnProgress, check: Callable[[], None]
) -> ConfigReport:
    """Do what ``file_jobs.carry_out`` does; ``check`` raises Stopped if the job is cancelled.

    Raises:
        StateError: the file takes too long or too much memory. The other errors of ``file_jobs.carry_out``.
    """
    cell = _CELLS.pack(node.cell)
    task = FileTask(file.name, len(file.data), kind, node.node_id, cell, tuple(node.cyclic))
    with FileProcess(file, task) as process:
        while True:
            message = process.next(check)
            if isinstance(message, FileEnd):
                report = _checked(message).report
                assert report is not None
                return report
            if isinstance(message, FileProgress):
                on_progress(message.done, message.whole)
            else:
                if isinstance(message, FileDownload):  # a restore that has written reports this in any case
                    check = _no_check
                process.answer(_answer_to(node, message))


def _no_check() -> None:
    pass


def _checked(end: FileEnd) -> FileEnd:
    if end.error is not None:
        raise from_fields(end.error)
    return end


def _answer_to(node: JobNode, question: FileQuestion) -> FileAnswer:
    try:
        if isinstance(question, FileUpload):
            return FileAnswer(node.sdo.upload(question.index, question.subindex))
        if isinstance(question, FileDownload):
            node.sdo.download(question.index, question.subindex, question.data)
        elif isinstance(question, FileRestCheck):
            node.require_not_energised()
        else:
            return FileAnswer(error=to_fields(node.refusal()))
    except AxisbusError as error:
        return FileAnswer(error=to_fields(error))
    return FileAnswer()


class FileProcess:
    """Hold the process and a thread that reads its messages; ends both on exit."""

    def __init__(self, file: Dcf, task: FileTask) -> None:
        self._file, self._task = file, task
        self._messages: queue.Queue[bytes] = queue.Queue()

    def __enter__(self) -> Self:
        try:
            self._process = subprocess.Popen(
                _COMMAND,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C in the terminal must only end the server
                creationflags=OWN_GROUP,
            )
        except OSError as error:
            raise self._failed(f"its process cannot be started: {error}", _BUSY) from error
        # At once, because starting takes longer than most of the work.
        process_limits.lower_priority(_NICE, self._process.pid)
        self._thread = threading.Thread(target=self._exchange, name="axisbus-file", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._thread.join()
        with suppress(BrokenPipeError):  # of an answer that it has not read
            self._process.__exit__(None, None, None)

    def next(self, check: Callable[[], None]) -> FileQuestion | FileProgress | FileEnd:
        """Return the next message; blocks for at most ``SILENCE_TIMEOUT``, and calls ``check`` meanwhile, which may raise.

        Raises:
            StateError: none came in time, or the process has ended.
        """
        until = time.monotonic() + SILENCE_TIMEOUT
        while time.monotonic() < until:
            check()
            with suppress(queue.Empty):
                return self._understood(self._messages.get(timeout=_POLL_PERIOD))
        raise self._failed(
            f"its process sent nothing for {SILENCE_TIMEOUT:g} s", f"{_BUSY}, or {_COMMAND_LINE}"
        )

    def answer(self, answer: FileAnswer) -> None:
        """Answer a question."""
        assert self._process.stdin is not None
        with suppress(OSError):  # it has ended: ``next`` says so
            self._process.stdin.write(_pack(answer) + b"\n")
            self._process.stdin.flush()

    def _exchange(self) -> None:
        """Send the task and the file, and read messages until the process ends."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(OSError):
            self._process.stdin.write(_pack(self._task) + b"\n" + self._file.data)
            self._process.stdin.flush()
        for line in self._process.stdout:
            self._messages.put(line)
        self._messages.put(b"")

    def _understood(self, line: bytes) -> FileQuestion | FileProgress | FileEnd:
        if not line:
            raise self._failed(f"its process ended with exit code {self._process.wait(1.0)}", _COMMAND_LINE)
        message: FileQuestion | FileProgress | FileEnd = _MESSAGES.decode(line)
        return message

    def _failed(self, observed: str, remedy: str) -> StateError:
        return StateError(f"{self._file.name} could not be read", observed=observed, remedy=remedy)


# -- in the process of the file ----------------------------------------------------------------------------------------------


class _Server:
    """The server, at the other end of the standard streams."""

    def send(self, message: FileQuestion | FileProgress | FileEnd) -> None:
        sys.stdout.buffer.write(_pack(message) + b"\n")
        sys.stdout.buffer.flush()

    def query(self, question: FileQuestion) -> FileAnswer:
        self.send(question)
        if not (line := sys.stdin.buffer.readline()):
            raise SystemExit(1)  # the server has ended
        return _ANSWERS.decode(line)

    def query_data(self, question: FileQuestion) -> bytes:
        """Return the data of the answer; raises its error."""
        answer = self.query(question)
        if answer.error is not None:
            raise from_fields(answer.error)
        return answer.data


class _FileSdo:
    """The objects of the node, by the server; with the interface of ``bus.sdo.access.SdoObjectAccess``."""

    def __init__(self, server: _Server, node_id: int) -> None:
        self.node_id = node_id
        self.dictionary = Dictionary(None, node_id)
        self._server = server

    def upload(self, index: int, subindex: int = 0, *, progress: Progress | None = None) -> bytes:
        data = self._server.query_data(FileUpload(index, subindex))
        if progress is not None:
            progress(len(data), len(data))
        return data

    def download(self, index: int, subindex: int, data: bytes) -> None:
        self._server.query_data(FileDownload(index, subindex, data))

    def read(self, key: int | str, subindex: int = 0, *, data_type: DataType | None = None) -> Value:
        entry = self.dictionary.resolve(key, subindex)
        return decoded(self.upload(entry.index, entry.subindex), data_type or entry.data_type)


class _FileNode:
    """The node of the task; with the interface of ``file_jobs.JobNode``."""

    eds = None  # what needs it is done by the server

    def __init__(self, server: _Server, task: FileTask) -> None:
        self.node_id, self.cyclic = task.node, frozenset(task.cyclic)
        self.cell: CellConfig = _CELLS.unpack(task.cell)
        self.sdo = _FileSdo(server, task.node)
        self._server = server

    def require_not_energised(self) -> None:
        self._server.query_data(FileRestCheck())

    def refusal(self) -> StateError:
        answer = self._server.query(FileRefusal())
        assert answer.error is not None
        found = from_fields(answer.error)
        assert isinstance(found, StateError)
        return found


def main() -> None:
    """Do one task; ends without a word if the server does."""
    process_limits.limit(MEMORY, _PROCESSOR_TIME)
    server = _Server()
    task = msgspec.json.decode(sys.stdin.buffer.readline(), type=FileTask)
    file = Dcf(task.name, sys.stdin.buffer.read(task.size))
    with suppress(BrokenPipeError):
        try:
            end = _end_of(server, task, file)
        except AxisbusError as error:
            end = FileEnd(error=to_fields(error))
        except MemoryError:
            end = FileEnd(error=to_fields(_too_large(file.name)))
        server.send(end)


def _end_of(server: _Server, task: FileTask, file: Dcf) -> FileEnd:
    if task.kind is None:
        return FileEnd(files.summary(file))

    def on_progress(done: int, whole: int) -> None:
        server.send(FileProgress(done, whole))

    return FileEnd(
        report=file_jobs.carry_out(task.kind, _FileNode(server, task), file, on_progress).bounded()
    )


def _too_large(name: str) -> StateError:
    return StateError(
        f"{name} could not be read",
        observed=f"it needs more than {MEMORY >> 20} MB of memory",
        remedy=_COMMAND_LINE,
    )


if __name__ == "__main__":
    main()
