"""Inputs and outputs of one node: a pure step per cycle from received values to values to send.

Theory of operation
-------------------
An output belongs to the node until the program sets it: it keeps the value found at boot, and an RPDO is sent only after one of its
outputs was set. From then on the master controls the output, until it has its safe state.

- **A lost node loses its outputs.** If a node is not operational, or is not heard, the module has applied its error objects. Its
  outputs then no longer have the values set before. The stored values therefore become the safe ones, and the outputs get them when
  the node returns. Nothing switches on again automatically; the program has to set each output again. The safe values are also sent
  meanwhile, because a node that is not heard may still receive.
- **Done means sent, to a live node.** A command ends as done when its frame and the SYNC at which it takes effect have been sent,
  and the node was heard after that. If the node is lost instead, the command fails when the loss is detected, however long ago its
  frame was sent. Only an input can confirm that an output has switched.
- **Fresh or unknown.** If a sample came before the loss of the node, or is too old, the input is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.cia401.port import MAY_HEAR, IoInputs, IoPort, SignalValidity
from axisbus.cia401.signal import IoPoint
from axisbus.cia402.port import Sample
from axisbus.errors import AxisbusError, NodeError
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.stop.diagnosis import boot_node

_SAFE_UNTIL_SET = "its outputs get their safe values until they are set again"


def remedy_for(known: SignalValidity, node: int) -> str:
    """Return what to do about the inputs and outputs of a node that are unknown."""
    return boot_node(node) if known is SignalValidity.RESTARTED else f"check supply and cable of node {node}"


class NodeIo:
    """Holds the values of the outputs, the outputs that were set, and the commands that wait for their frame to be sent."""

    def __init__(self, node_id: int, points: Sequence[IoPoint], port: IoPort) -> None:
        """``port`` has the objects of all ``points``, and the values of its outputs at boot."""
        self.points = {point.name: point for point in points}
        self.node_id = node_id
        self._outputs = {address: index for index, address in enumerate(port.outputs)}
        self._inputs = {address: index for index, address in enumerate(port.inputs)}
        self._max_age = port.max_age
        self._raw_outputs = list(port.found)
        self._safe_outputs = self._with_safe(list(port.alone))
        self._set: set[str] = set()
        self._written: set[int] = set()  # indices of output objects with at least one part that was set
        self._known = SignalValidity.NOT_YET
        self._unknown_until = -math.inf  # when the node was last not operational
        self._accepted: list[CommandStatus] = []
        self._sent_commands: list[CommandStatus] = []
        self._unconfirmed: list[tuple[float, CommandStatus]] = []  # latest time since which each is in effect
        self._is_unsent = False  # whether the outputs' present values have not been sent yet
        self._awaits_sync = False  # whether they were sent in the previous cycle, and wait for SYNC
        self._started = math.inf  # time of the first cycle
        self._sent = -math.inf
        self.changed = False  # whether a command has ended in this cycle

    # -- commands ----------------------------------------------------------------------------------------------------

    def refusal(self, name: str, what: str) -> AxisbusError | None:
        """Return why an output cannot be set now; None if it can."""
        if self._known is SignalValidity.YES:
            return None
        return NodeError(
            f"{what} was not sent: {name} cannot be reached",
            node=self.node_id,
            observed=self._known.value,
            remedy=self._remedy(),
        )

    def set(self, values: Mapping[str, int], ticket: CommandStatus) -> None:
        """Accept raw values for outputs of this node; ``ticket`` ends when they act and the node has been heard after that."""
        for name, raw in values.items():
            self._set_raw(self.points[name], raw)
            self._set.add(name)
        self._accepted.append(ticket)

    def make_safe(self) -> None:
        """Set every output that the program has set to its safe state."""
        for name in self._set:
            self._set_raw(self.points[name], self.points[name].safe)

    def replace(self, earlier: NodeIo) -> None:
        """Replace ``earlier``, whose node was booted again: outputs that were set get their safe values, as after a loss."""
        earlier.abandon(
            NodeError(
                "the outputs were not confirmed: their node was booted again",
                node=self.node_id,
                remedy=f"set them again: {_SAFE_UNTIL_SET}",
            )
        )
        self._set = earlier._set & self.points.keys()
        self.make_safe()

    @property
    def ours(self) -> list[IoPoint]:
        """The outputs that the program has set."""
        return [self.points[name] for name in sorted(self._set)]

    @property
    def is_idle(self) -> bool:
        """Whether nothing waits to be sent: all values were sent, or cannot be sent now."""
        return self._known is not SignalValidity.YES or not (self._is_unsent or self._awaits_sync)

    def abandon(self, error: AxisbusError) -> None:
        """End every command with ``error``, because no further cycle will come."""
        for ticket in (*self._accepted, *self._take_sent()):
            ticket.finish(Status.ERROR, error)
        self._accepted = []

    def _lost(self, what: str) -> AxisbusError:
        return NodeError(
            f"{what} is not confirmed: its node was lost before it answered",
            node=self.node_id,
            observed=self._known.value,
            remedy=self._remedy(),
        )

    def _remedy(self) -> str:
        return f"{remedy_for(self._known, self.node_id)}; when it is back, {_SAFE_UNTIL_SET}"

    # -- the cycle -----------------------------------------------------------------------------------------------------

    def step(self, now: float, inputs: IoInputs) -> tuple[int | None, ...]:
        """Return the value of each output of the port; None for an output that was never set."""
        self.changed = False
        self._known = inputs.known
        self._started = min(self._started, now)
        if inputs.known is not SignalValidity.YES:
            self._lose(now)
            return self._to_send() if inputs.known in MAY_HEAR else (None,) * len(self._raw_outputs)
        # Their frames were sent, and the SYNC after them.
        self._unconfirmed += [(now, ticket) for ticket in self._sent_commands]
        self._end_confirmed(inputs.heard)
        self._sent_commands, self._accepted = self._accepted, []
        self._awaits_sync, self._is_unsent = self._is_unsent, False
        self._sent = now
        return self._to_send()

    def readings(self, now: float, inputs: IoInputs) -> dict[str, IoReading]:
        """Return the reading of every point, after ``step``."""
        return {
            name: self._output(point, now) if point.output else self._input(point, now, inputs)
            for name, point in self.points.items()
        }

    def _to_send(self) -> tuple[int | None, ...]:
        return tuple(
            raw_output if index in self._written else None
            for index, raw_output in enumerate(self._raw_outputs)
        )

    def _end_confirmed(self, heard: float) -> None:
        while self._unconfirmed and self._unconfirmed[0][0] <= heard:
            self._unconfirmed.pop(0)[1].finish(Status.DONE)
            self.changed = True

    def _take_sent(self) -> list[CommandStatus]:
        """Remove and return the commands that were sent and have not ended."""
        sent = [*(ticket for _, ticket in self._unconfirmed), *self._sent_commands]
        self._unconfirmed, self._sent_commands = [], []
        return sent

    def _lose(self, now: float) -> None:
        self._unknown_until = now
        self._awaits_sync = False
        # Outputs that were never set must not be switched on by a frame of this master either.
        self._raw_outputs = list(self._safe_outputs)
        self._is_unsent = bool(self._written)
        self.changed = bool(self._accepted or self._sent_commands or self._unconfirmed)
        for ticket in self._accepted:
            ticket.finish(Status.ERROR, self.refusal("its node", ticket.name))
        for ticket in self._take_sent():
            ticket.finish(Status.ERROR, self._lost(ticket.name))
        self._accepted = []

    def _with_safe(self, raw_outputs: list[int]) -> list[int]:
        for point in (point for point in self.points.values() if point.output):
            index = self._outputs[point.address]
            raw_outputs[index] = point.into(raw_outputs[index], point.safe)
        return raw_outputs

    def _set_raw(self, point: IoPoint, raw: int) -> None:
        index = self._outputs[point.address]
        self._raw_outputs[index] = point.into(self._raw_outputs[index], raw)
        self._written.add(index)
        self._is_unsent = True

    def _of(self, point: IoPoint) -> int:
        return point.of(self._raw_outputs[self._outputs[point.address]])

    def _output(self, point: IoPoint, now: float) -> IoReading:
        """Return the reading of an output; if it was never sent, its boot value is known only while its node was never lost."""
        is_set, sent, known = (
            point.name in self._set,
            self._outputs[point.address] in self._written,
            self._known,
        )
        stamp = self._sent if sent else self._started
        if known is SignalValidity.YES and not sent and self._unknown_until > -math.inf:
            known = SignalValidity.UNSET
        return IoReading(now, known, self._of(point) if known is SignalValidity.YES else None, stamp, is_set)

    def _input(self, point: IoPoint, now: float, inputs: IoInputs) -> IoReading:
        index = self._inputs[point.address]
        sample = inputs.samples[index]
        known = self._freshness(sample, self._max_age[index], now)
        stamp = -math.inf if sample is None else sample.stamp
        value = point.of(sample.value) if known is SignalValidity.YES and sample is not None else None
        return IoReading(now, known, value, stamp)

    def _freshness(self, sample: Sample | None, age: float, now: float) -> SignalValidity:
        if self._known is not SignalValidity.YES:
            return self._known
        if sample is None or sample.stamp <= self._unknown_until:
            return SignalValidity.NOT_YET
        return SignalValidity.YES if now - sample.stamp <= age else SignalValidity.OLD


# -- The command for outputs, as a frozen value that can be pickled ----------------------------------------------------


@dataclass(frozen=True, slots=True)
class SetOutputs:
    """Set outputs by name, to raw values; outputs of one node in one frame if they are mapped into one."""

    values: tuple[tuple[str, int], ...]


# -- The state of an input or output in one cycle ----------------------------------------------------------------------


class IoReading(NamedTuple):
    """``value`` is raw: of an input as received at ``stamp``, of an output as sent; None if it is not ``known``.

    ``now`` is the cycle's time. ``set``: this machine has set the output, and sets it to its safe state at the end.
    """

    now: float
    known: SignalValidity
    value: int | None
    stamp: float
    set: bool = False
