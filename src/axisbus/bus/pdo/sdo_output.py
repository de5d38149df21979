"""Outputs without an RPDO: written by SDO when they change; a controlword that stops the drive is written at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from axisbus.bus.sdo.worker import SdoJob, SdoWorker
from axisbus.cia402 import controlword as cw
from axisbus.cia402.port import ALL_OUTPUTS, ValueTransport

RETRY = 0.25  # seconds after a refusal before the same value is written again
_ENABLED = cw.SWITCH_ON | cw.ENABLE_VOLTAGE | cw.QUICK_STOP | cw.ENABLE_OPERATION


def is_motion(controlword: int) -> bool:
    """Whether a controlword may let the motor move: operation enabled and not halted."""
    return controlword & _ENABLED == _ENABLED and not controlword & cw.HALT


def is_stop(controlword: int) -> bool:
    """Whether a controlword takes the drive out of operation at once: quick stop or disable voltage, no fault reset."""
    is_command = not controlword & cw.ENABLE_VOLTAGE or not controlword & cw.QUICK_STOP
    return is_command and not controlword & cw.FAULT_RESET


class _Output:
    """One such output; holds state: the last written value, the running writes, and the last refusal with its time."""

    __slots__ = ("index", "pending", "refused", "refused_at", "written")

    def __init__(self, index: int) -> None:
        self.index = index
        self.written: int | None = None
        # A token for each running write: two threads change the set, so a counter would not do.
        self.pending: set[object] = set()
        self.refused: int | None = None
        self.refused_at = float("-inf")

    def wants(self, value: int) -> bool:
        """Whether ``value`` must be written now: it is new, or it failed some time ago."""
        if value == self.written:
            return False
        return value != self.refused or time.monotonic() - self.refused_at >= RETRY

    def job(self, owner: object, value: int) -> SdoJob:
        """Return the write of ``value``, which counts as written unless it fails."""
        self.written = value
        token = object()
        self.pending.add(token)

        def done(_value: int | None, abort: int | None) -> None:
            self.pending.discard(token)
            if abort is not None and self.written == value:
                self.written = None
                self.refused, self.refused_at = value, time.monotonic()

        return SdoJob((owner, self.index), self.index, 0, value, done)


class SdoOutputs:
    """All outputs of an axis by SDO; holds state. Used by the scan's thread; the worker's thread reports the results."""

    def __init__(
        self, worker: SdoWorker, outputs: Mapping[str, ValueTransport], index_of: Callable[[int], int]
    ) -> None:
        self._worker = worker
        self._outputs = {
            name: _Output(index_of(ALL_OUTPUTS[name]))
            for name, source in outputs.items()
            if source is ValueTransport.SDO
        }
        self._controlword = self._outputs.pop("controlword", None)
        self.commanded = False  # whether a controlword was ever written by SDO

    @property
    def none(self) -> bool:
        """Whether every output has a PDO."""
        return self._controlword is None and not self._outputs

    @property
    def pending(self) -> bool:
        """Whether a write of a value other than the controlword is running."""
        return any(output.pending for output in self._outputs.values())

    def take(self, given: Mapping[str, int], controlword: int | None) -> int | None:
        """Write the changed outputs; return the controlword for the RPDOs (None if it is written by SDO)."""
        for name, value in given.items():
            output = self._outputs.get(name)
            if output is not None and output.wants(value):
                self._worker.submit(output.job(self, value))
        if self._controlword is None:
            return controlword
        if controlword is not None and self._wants_controlword(self._controlword, controlword):
            self._write_controlword(self._controlword, controlword)
        return None

    def _wants_controlword(self, output: _Output, controlword: int) -> bool:
        """Whether the controlword must be written; a stop that failed is repeated at once."""
        return output.wants(controlword) or (is_stop(controlword) and controlword != output.written)

    def _write_controlword(self, output: _Output, controlword: int) -> None:
        """Queue the controlword after the targets, or write it before all others if it stops the drive."""
        self.commanded = True
        job = output.job(self, controlword)
        if is_stop(controlword):
            self._worker.urgent(job)
        else:
            self._worker.submit(job)
