"""What a search for LSS slaves (CiA 305) is told, and what it finds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from axisbus.cia305.services import UNCONFIGURED, LssAddress


class Check(Enum):
    """How an address that fast scan found was checked, with a sentence each."""

    NOT_NEEDED = "its LSS did what CiA 305 says"
    CONFIRMED = "the four numbers were read from it and are the same"
    SILENT = (
        "it does not tell its numbers (inquire identity), so only fast scan and its selection vouch for them"
    )
    OTHERWISE = "the numbers read from it are not the same"
    UNSELECTABLE = "it cannot be selected by its address: only the only slave on a bus can be set so"

    @property
    def sentence(self) -> str:
        """What it means."""
        return str(self.value)


@dataclass(frozen=True, slots=True)
class KnownIdentity:
    """What is known of the slaves that are looked for, None where it is not; each number that is known spares 32 bits."""

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
    """A slave without a node-ID; ``twins`` says that more than one answered as this address, so that LSS cannot tell them apart.

    On a wire their equal frames may also fall together into one, so that False does not prove that there is only one.
    ``answers_on`` says that it goes on answering fast scan after it was found, against CiA 305; only of such a slave is asked how
    it checks (``check``) and which node-ID it has (``node_id``, None where it does not tell), because some answer with one, too.
    """

    address: LssAddress
    twins: bool = False
    answers_on: bool = False
    check: Check = Check.NOT_NEEDED
    node_id: int | None = None

    @property
    def has_node_id(self) -> bool:
        """Whether it says that it has a node-ID already."""
        return self.node_id is not None and self.node_id != UNCONFIGURED


@dataclass(frozen=True, slots=True)
class Scanned:
    """The slaves that were found, by address; ``others``: there are more, and none of these is as ``KnownIdentity`` says.

    ``incomplete`` says why there may be slaves that were not found; it is empty where the search came to its end.
    """

    slaves: tuple[Unconfigured, ...]
    others: bool = False
    incomplete: str = ""
