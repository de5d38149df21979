"""The interface between the cycle and the inputs and outputs of one node; ``axisbus.cia402.port`` is that of an axis."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple, Protocol

from axisbus.cia401.signal import Address
from axisbus.cia402.port import Sample, ValueTransport


class SignalValidity(Enum):
    """Whether the value of a point is known, and otherwise the reason."""

    YES = "it is known"
    NOT_YET = "it has not come yet"
    UNSET = "its node was lost meanwhile, and it has not been set since"
    OLD = "it has not come for longer than it may stay away"
    SILENT = "its node is lost: its heartbeat or guarding answer stays away"
    NOT_OPERATIONAL = "its node is not operational: it has left that state, by its own error or by the command of another master"
    RESTARTED = "its node has restarted, and lost its configuration"
    BUS_OFF = "the CAN controller is bus-off"
    QUEUE_FULL = "the transmit queue of the CAN adapter is full"
    NOT_BOOTED = "its node did not boot, or was found with an enabled drive and was left unchanged"


# A node that may still receive frames, and whose PDOs have the known mapping.
MAY_HEAR = frozenset({SignalValidity.YES, SignalValidity.SILENT, SignalValidity.NOT_OPERATIONAL})


class IoInputs(NamedTuple):
    """The inputs of a node at the beginning of a cycle: the newest sample of each, in the order of ``IoPort.inputs``.

    ``heard`` is the time of its last sign of life, a TPDO or its error control; infinite if none is expected.
    """

    known: SignalValidity
    samples: tuple[Sample | None, ...]
    heard: float = math.inf


class IoPort(Protocol):
    """The inputs and outputs of one node. Values are whole objects, signed if their type is."""

    @property
    def inputs(self) -> tuple[Address, ...]:
        """The objects of its inputs."""

    @property
    def outputs(self) -> tuple[Address, ...]:
        """The objects of its outputs."""

    @property
    def max_age(self) -> tuple[float, ...]:
        """Maximum age of each input, in seconds; infinite if its silence has no meaning."""

    @property
    def sources(self) -> tuple[ValueTransport, ...]:
        """The transport of each input; it shows whether a missing one was lost, or has not changed."""

    @property
    def found(self) -> tuple[int, ...]:
        """Value of each output at boot."""

    @property
    def alone(self) -> tuple[int, ...]:
        """Value that the module itself gives each output when it loses its master, by its objects at boot.

        Otherwise as ``found``.
        """

    def read(self, now: float) -> IoInputs:
        """Return the newest values; does not block."""

    def write(self, words: tuple[int | None, ...]) -> None:
        """Set a value for each output (None: never set). Sends nothing before ``BusCycle.commit``; does not block."""
