"""Input and result of a search for LSS slaves (CiA 305)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from axisbus.cia305.services import UNCONFIGURED, LssAddress


class Check(Enum):
    """How the master checked an address that fast scan found; each value is a sentence for the user."""

    NOT_NEEDED = "its LSS behaved as CiA 305 requires"
    CONFIRMED = "the four numbers were read from it and are the same"
    SILENT = (
        "it does not report its numbers (inquire identity), so only fast scan and its selection confirm them"
    )
    OTHERWISE = "the numbers read from it are not the same"
    UNSELECTABLE = "it cannot be selected by its address: only the only slave on a bus can be set so"

    @property
    def sentence(self) -> str:
        """The meaning as a sentence."""
        return str(self.value)


@dataclass(frozen=True, slots=True)
class KnownIdentity:
    """Known numbers of the slaves to search for (None: unknown); each known number saves the search of 32 bits."""

    vendor_id: int | None = None
    product_code: int | None = None
    revision_number: int | None = None
    serial_number: int | None = None

    @property
    def parts(self) -> tuple[int | None, ...]:
        """The four numbers in the order of the standard."""
        return self.vendor_id, self.product_code, self.revision_number, self.serial_number


@dataclass(frozen=True, slots=True)
class Unconfigured:
    """A slave without a node-ID; ``twins``: more than one slave answered to this address, so LSS cannot distinguish them.

    ``twins`` False does not prove that there is only one: equal frames may coincide on the wire. ``answers_on``: the slave
    continues to answer fast scan after it was found, against CiA 305. Only such slaves are checked (``check``) and inquired for
    their node-ID (``node_id``; None if they do not report it), because some answer although they have a node-ID.
    """

    address: LssAddress
    twins: bool = False
    answers_on: bool = False
    check: Check = Check.NOT_NEEDED
    node_id: int | None = None

    @property
    def has_node_id(self) -> bool:
        """Whether the slave reports that it already has a node-ID."""
        return self.node_id is not None and self.node_id != UNCONFIGURED


@dataclass(frozen=True, slots=True)
class Scanned:
    """The slaves found, by address; ``others``: there are more slaves, which do not match ``KnownIdentity``.

    ``incomplete`` is the reason why slaves may have been missed; it is empty if the search was completed.
    """

    slaves: tuple[Unconfigured, ...]
    others: bool = False
    incomplete: str = ""
