"""Carry out the requests of a node's boot-up, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping

from axisbus.boot.comms import NodeServices
from axisbus.boot.objects import NodeObjects, Progress
from axisbus.cia301.datatypes import Value
from axisbus.cia301.nmt import NmtState
from axisbus.cia302 import types as b
from axisbus.errors import AxisbusError, NodeRefused, NodeTimeout, SdoAbort, SdoError

Locals = Mapping[b.BootPhase, Callable[[b.BootOutcome], bool | None]]


class Answerer:
    """Answer the requests for one node; holds state: the error behind the last failed answer."""

    def __init__(
        self,
        objects: NodeObjects,
        nmt: NodeServices,
        local: Locals,
        progress: Progress | None = None,
    ) -> None:
        """``local`` are the application's own steps; the result of ``LOOK`` says whether the node may be configured.

        ``progress(done, all)`` is called in this thread with the bytes of a program that the node has confirmed.
        """
        self._objects = objects
        self._nmt = nmt
        self._local = local
        self._progress = progress
        self._now = nmt.clock.now
        self.error: AxisbusError | None = None

    def run(self, machine: Generator[b.Request, b.Answer, b.BootOutcome]) -> b.BootOutcome:
        """Answer all requests until the boot-up ends; blocks. An error becomes an answer, and ``error`` holds the error."""
        request = next(machine)
        while True:
            try:
                request = machine.send(self.answer(request))
            except StopIteration as end:
                outcome: b.BootOutcome = end.value
                return outcome

    def answer(self, request: b.Request) -> b.Answer:
        """Make one request, once; blocks for about its deadline at most."""
        start = self._now()
        try:
            value = self._do(request)
        except AxisbusError as error:
            self.error = error
            return _bad_answer(request, error, self._now() - start)
        elapsed = self._now() - start
        if value is None and isinstance(request, (b.Listen, b.GuardRequest)):
            return b.NoReply(elapsed)
        return b.Got(value, elapsed)

    def _do(self, request: b.Request) -> Value | NmtState | None:
        match request:
            case b.Local():
                with self._nmt.trying(b.TRIES, b.DEADLINE):
                    return self._local[request.phase](request.known)
            case b.BootNmtCommand():
                return self._nmt.command(request.command, request.deadline, always=request.always)
            case b.Listen():
                return self._nmt.listen(request.deadline)
            case b.GuardRequest():
                return self._nmt.ask(request.deadline)
            case b.Pause():
                self._nmt.pause(request.seconds)
                return None
        return self._transfer(request)

    def _transfer(self, request: b.Read | b.BootWrite | b.ProgramDownload) -> Value | None:
        with self._nmt.trying(1, request.deadline):
            if isinstance(request, b.Read):
                return self._objects.read(request.index, request.subindex)
            if isinstance(request, b.ProgramDownload):
                where = request.index, request.subindex
                self._objects.download(
                    *where, request.data, transfer_type=request.transfer_type, progress=self._progress
                )
            else:
                self._write(request)
        return None

    def _write(self, request: b.BootWrite) -> None:
        if request.checked:
            self._objects.write(request.index, request.subindex, request.value)
        else:
            assert isinstance(request.value, int)
            self._objects.write_unchecked(request.index, request.subindex, request.value)


def _bad_answer(request: b.Request, error: AxisbusError, elapsed: float) -> b.Answer:
    hopeless = isinstance(request, b.Local) or isinstance(error, NodeRefused)
    if hopeless or not isinstance(error, (SdoError, NodeTimeout)):
        return b.Failed(elapsed)
    if isinstance(error, SdoAbort):
        return b.SdoAbortReply(error.code, elapsed)
    return b.NoReply(elapsed, isinstance(error, SdoError) and error.for_this_only)
