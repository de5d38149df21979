"""Outputs without an RPDO: written by SDO when they change; a controlword that stops the drive is written at once.

A drive is enabled only with values that were written for that: another master may have changed the objects since they were written
last. So all values are written again after the controlword has ceased to command *operation enabled*, and after a stop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from axisbus.bus.pdo.plan import PdoPlan
from axisbus.bus.pdo.rpdo import RpdoImage
from axisbus.bus.sdo.access import require_answering, try_upload
from axisbus.bus.sdo.client import SdoClient
from axisbus.bus.sdo.worker import SdoJob, SdoWorker
from axisbus.cia301.pdo import MappedObject
from axisbus.cia402 import controlword as cw
from axisbus.cia402.port import ALL_OUTPUTS, INPUT_OBJECTS, OFFSET_OBJECTS, Sample, ValueTransport
from axisbus.clock import Clock
from axisbus.errors import BootError, SdoError

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

    def wants(self, value: int, now: float) -> bool:
        """Whether ``value`` must be written at ``now``: it is new, or it failed some time ago."""
        if value == self.written:
            return False
        return value != self.refused or now - self.refused_at >= RETRY

    def job(self, owner: object, value: int, clock: Clock) -> SdoJob:
        """Return the write of ``value``, which counts as written unless it fails."""
        self.written = value
        token = object()
        self.pending.add(token)

        def done(_value: int | None, abort: int | None) -> None:
            self.pending.discard(token)
            if abort is not None and self.written == value:
                self.written = None
                self.refused, self.refused_at = value, clock.now()

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
        self._commands = (False, False)  # the last controlword: to stay enabled, to stay out of operation
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
        if controlword is not None:
            self._note_controlword(controlword)
        for name, value in given.items():
            output = self._outputs.get(name)
            if output is not None and output.wants(value, self._worker.clock.now()):
                self._worker.submit(output.job(self, value, self._worker.clock))
        if self._controlword is None:
            return controlword
        if controlword is not None and self._wants_controlword(self._controlword, controlword):
            self._write_controlword(self._controlword, controlword)
        return None

    def _note_controlword(self, controlword: int) -> None:
        """Forget the written values when the drive is to leave *operation enabled*, and at the first word after a stop."""
        commands = controlword & _ENABLED == _ENABLED, is_stop(controlword)
        if commands == self._commands:
            return
        (was_enabled, was_stop), self._commands = self._commands, commands
        if (was_enabled and not commands[0]) or (was_stop and not commands[1]):
            for output in self._outputs.values():
                output.written = None

    def _wants_controlword(self, output: _Output, controlword: int) -> bool:
        """Whether the controlword must be written; a stop that failed is repeated at once."""
        return output.wants(controlword, self._worker.clock.now()) or (
            is_stop(controlword) and controlword != output.written
        )

    def _write_controlword(self, output: _Output, controlword: int) -> None:
        """Queue the controlword after the targets, or write it before all others if it stops the drive."""
        self.commanded = True
        job = output.job(self, controlword, self._worker.clock)
        if is_stop(controlword):
            self._worker.urgent(job)
        else:
            self._worker.submit(job)


# -- Slow SDO polling of the inputs without a PDO, through the node's worker -------------------------------------------


class Poller:
    """Polls some inputs; holds state: the due time of each, the running requests, and the newest answers.

    A polled value counts only if no PDO has brought a value of this input since the poll began: a newer TPDO may have overtaken the
    answer in the drive. The value has the time of its request, because it was sampled after that.
    """

    def __init__(
        self,
        worker: SdoWorker,
        periods: Mapping[str, float],
        index_of: Callable[[int], int],
    ) -> None:
        """``periods`` in seconds by the input's name; ``index_of`` converts a first-axis index into the axis's."""
        self._worker = worker
        self._periods = dict(periods)
        self._index_of = index_of
        self._due = dict.fromkeys(periods, float("-inf"))
        self._pending: set[str] = set()
        self._answers: dict[str, tuple[Sample, float]] = {}

    def poll(self, now: float) -> None:
        """Request the inputs that are due; does not block."""
        for name, period in self._periods.items():
            if now >= self._due[name] and name not in self._pending:
                self._due[name] = now + period
                self._pending.add(name)
                self._worker.submit(self._job(name))

    def read_into(self, samples: dict[str, Sample]) -> None:
        """Put the received answers into ``samples``."""
        for name in tuple(self._answers):
            sample, began = self._answers.pop(name)
            known = samples.get(name)
            if known is None or known.stamp <= began:
                samples[name] = sample

    def _job(self, name: str) -> SdoJob:
        began = self._worker.clock.now()

        def done(value: int | None, abort: int | None) -> None:
            if abort is None and value is not None:
                self._answers[name] = Sample(value, self._worker.began), began
            self._pending.discard(name)

        return SdoJob((self, name), self._index_of(INPUT_OBJECTS[name]), 0, None, done)


# ----------------------------------------------------------------------------------------------------------------------
# First values of a port, read by SDO: inputs that no TPDO may send soon, and all entries that an RPDO would overwrite.


_STEP = "priming"


# Start value of an output that cannot be read: the input that shows the same, or 0 if 0 means standstill.
_SUBSTITUTES = {"target_position": "position", "interpolation_target": "position", "mode": "mode"}
_REST = frozenset({"target_velocity", "target_torque", *OFFSET_OBJECTS})


def prime_inputs(sdo: SdoClient, plan: PdoPlan, index_of: Callable[[int], int]) -> dict[str, Sample]:
    """Read every input of the axis; leave out inputs that cannot be read. Blocks, raises as ``SdoClient.read``."""
    samples = {}
    for name, source in plan.inputs.items():
        if source is ValueTransport.NONE:
            continue
        try:
            value = sdo.read(index_of(INPUT_OBJECTS[name]))
        except SdoError as error:
            require_answering(sdo, error)
            continue
        if isinstance(value, int):
            samples[name] = Sample(value, sdo.clock.now())
    return samples


def prime_outputs(
    sdo: SdoClient, plan: PdoPlan, images: Sequence[RpdoImage], samples: Mapping[str, Sample]
) -> None:
    """Set every entry of every RPDO to the present value in the drive; blocks.

    Raises:
        BootError: an entry that is not an output of motion cannot be read, and setting it to zero could have any effect.
        others as ``SdoClient.upload``.
    """
    for image in images:
        for mapped, name in image.unknown:
            image.put(mapped.index, mapped.subindex, _first_value(sdo, plan, image, mapped, name, samples))


def _first_value(
    sdo: SdoClient,
    plan: PdoPlan,
    image: RpdoImage,
    mapped: MappedObject,
    name: str | None,
    samples: Mapping[str, Sample],
) -> int:
    found = try_upload(sdo, mapped.index, mapped.subindex)
    if isinstance(found, bytes):
        return int.from_bytes(found, "little")
    shown = samples.get(_SUBSTITUTES.get(name or "", ""))
    if shown is not None:
        return shown.value
    if name in _REST:
        return 0
    raise BootError(
        f"node {plan.node_id}: {image.name} contains {sdo.dictionary.entry(mapped.index, mapped.subindex)}, which cannot be "
        "read, so sending it could write a wrong value",
        node=plan.node_id,
        step=_STEP,
        index=mapped.index,
        subindex=mapped.subindex,
        observed=found.observed,
        remedy="allow the mapping to be changed, or disable this RPDO in the node's [pdo] table",
    ) from found
