"""The seam between the cycle and the inputs and outputs of one node; see ``cia402.port`` for the one of an axis."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple, Protocol

from axisbus.cia401.signal import Address
from axisbus.cia402.port import Sample, ValueTransport


class SignalValidity(Enum):
    """Whether the value of a point is known, and else why not."""

    YES = "it is known"
    NOT_YET = "it has not come yet"
    UNSET = "its node was lost meanwhile, and it has not been set since"
    OLD = "it has not come for longer than it may stay away"
    SILENT = "its node is lost: its heartbeat or guarding answer stays away"
    NOT_OPERATIONAL = (
        "its node is not operational: it has left that state, by an error of its own or by another's command"
    )
    RESTARTED = "its node has restarted, and lost its configuration; open the machine again"
    BUS_OFF = "the CAN controller is bus-off"
    QUEUE_FULL = "the transmit queue of the CAN adapter is full"
    NOT_BOOTED = "its node has not come up, or was found with an enabled drive and is left as it is"


# A node that may still hear us, and whose PDOs are mapped as we know it.
MAY_HEAR = frozenset({SignalValidity.YES, SignalValidity.SILENT, SignalValidity.NOT_OPERATIONAL})


class IoInputs(NamedTuple):
    """What is known of a node at the beginning of a cycle: the newest of each input, in the order of ``IoPort.inputs``.

    ``heard`` is when it last gave a sign of life, a TPDO or its error control; infinite where none of it is expected.
    """

    known: SignalValidity
    samples: tuple[Sample | None, ...]
    heard: float = math.inf


class IoPort(Protocol):
    """The inputs and outputs of one node. Values are whole objects, signed where their type is."""

    @property
    def inputs(self) -> tuple[Address, ...]:
        """The objects of its inputs."""

    @property
    def outputs(self) -> tuple[Address, ...]:
        """The objects of its outputs."""

    @property
    def max_age(self) -> tuple[float, ...]:
        """How old each input may be, in seconds; infinite where its silence says nothing."""

    @property
    def sources(self) -> tuple[ValueTransport, ...]:
        """How each input travels: whether one that has not come was lost on its way, or has not changed."""

    @property
    def found(self) -> tuple[int, ...]:
        """What each output had at boot."""

    @property
    def alone(self) -> tuple[int, ...]:
        """What each output becomes by the module itself when it is left alone, as its objects said at boot; else as ``found``."""

    def read(self, now: float) -> IoInputs:
        """Return the newest values; does not block."""

    def write(self, words: tuple[int | None, ...]) -> None:
        """Take a value for each output (None: never set). Sends nothing before ``BusCycle.commit``; does not block."""
