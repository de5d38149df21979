"""The replacement of a drive as frozen values: what was found, the steps, the order to do them, and the outcome."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from axisbus.cia305.services import LssAddress
from axisbus.errors import StateError


class ReplacementStep(Enum):
    """A step of a replacement, in the order of execution. Each looks at the device first, so that it may be repeated."""

    NODE_ID = "set its node-ID, and let it store that"
    CONFIGURE = "write the stored values that differ, except those that calibrate the drive"
    STORE = "store its parameters (1010h)"
    RESTART = "restart it"
    VERIFY = "read every object again"
    BOOT = "boot it into the running machine; its axes then wait for a reset"
    RECORD = "write its nameplate into the record"


Tell = Callable[[ReplacementStep], None]


@dataclass(frozen=True, slots=True)
class FoundDrive:
    """A drive that may be the new one, with what it reports; None: unknown.

    ``node_id`` None: it has none, and was found by LSS fast scan.
    """

    node_id: int | None
    vendor: int | None = None
    product: int | None = None
    revision: int | None = None
    serial: int | None = None
    device_name: str | None = None
    hardware_version: str | None = None
    software_version: str | None = None

    @property
    def where(self) -> str:
        """Where it was found, in words."""
        return "without a node-ID" if self.node_id is None else f"at node-ID {self.node_id}"

    @property
    def address(self) -> LssAddress:
        """Its address for LSS.

        Raises:
            StateError: it does not report its whole identity (1018h).
        """
        parts = self.vendor, self.product, self.revision, self.serial
        if None in parts:
            raise StateError(
                f"the drive {self.where} cannot get another node-ID by LSS",
                observed="it does not report its whole identity (1018h), by which LSS selects it",
                remedy="set its node-ID by its switches or the tool of its manufacturer, and run the command again",
            )
        return LssAddress(*(part or 0 for part in parts))


@dataclass(frozen=True, slots=True)
class ReplacementOrder:
    """The steps to do with the drive of node ``node_id``; ``file`` is the DCF to restore (None: none).

    ``swapped``: it is known that this drive is not the previous one.
    """

    node_id: int
    drive: FoundDrive
    steps: tuple[ReplacementStep, ...]
    file: str | None
    swapped: bool


@dataclass(frozen=True, slots=True)
class ReplacementOutcome:
    """The result: the numbers of values in the file, of those written, and of those that calibrate and were left.

    ``not_stored``: why the node does not store on command; empty if it has stored.
    """

    values: int = 0
    written: int = 0
    calibration: int = 0
    not_stored: str = ""
