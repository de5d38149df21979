"""The input of a check: the cell, the dictionaries of its nodes, and its drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from axisbus.cell.axis_description import Drive, with_makes
from axisbus.cell.model import AxisConfig, CellConfig, NodeConfig
from axisbus.cell.problem import CellProblem
from axisbus.cell.writes import initial, known_writes
from axisbus.cia402 import dictionary as catalogue
from axisbus.cia402 import objects
from axisbus.cia402.axes import FIRST_AXIS
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds, Severity

NEEDED = (objects.CONTROLWORD, objects.STATUSWORD)  # every axis needs these


@dataclass(frozen=True)
class CheckContext:
    """A cell with the EDS of each node whose file could be read; its axes have the behaviour of their makes.

    ``drives`` are the axes of those nodes. ``incomplete`` are the axes without controlword or statusword; each gets one
    finding and no other checks.
    """

    cell: CellConfig
    eds: Mapping[int, Eds]
    drives: tuple[Drive, ...] = field(init=False)
    incomplete: tuple[Drive, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cell", with_makes(self.cell, self.eds))
        found = [self._drive(axis) for axis in self.cell.axes.values() if axis.at.sound("node", "drive_axis")]
        drives = [drive for drive in found if drive is not None]
        complete = tuple(drive for drive in drives if not drive.missing(NEEDED))
        object.__setattr__(self, "drives", complete)
        object.__setattr__(self, "incomplete", tuple(drive for drive in drives if drive.missing(NEEDED)))

    def _drive(self, axis: AxisConfig) -> Drive | None:
        node, eds = self.cell.nodes.get(axis.node), self.eds.get(axis.node)
        return None if node is None or eds is None else Drive.of(axis, node, eds)

    @property
    def nodes(self) -> Iterator[tuple[NodeConfig, Eds, Dictionary]]:
        """The nodes whose EDS could be read."""
        for node in self.cell.nodes.values():
            if node.node_id in self.eds:
                eds = self.eds[node.node_id]
                yield node, eds, Dictionary(eds, node.node_id)

    def node_number(self, node: NodeConfig, index: int, subindex: int = 0) -> int | None:
        """Return the value of a node's object after boot, from its table and its EDS; None if it is not a known integer."""
        dictionary = Dictionary(self.eds[node.node_id], node.node_id)
        written = {write.address: write.value for write in known_writes(node.objects, dictionary)}
        value = written.get((index, subindex), initial(dictionary, node.node_id, index, subindex))
        return value if isinstance(value, int) else None

    @property
    def drive_of(self) -> Mapping[str, Drive]:
        """The drives by the names of their axes."""
        return {drive.axis.name: drive for drive in self.drives}

    def error(self, line: int, message: str, observed: str = "", remedy: str = "") -> CellProblem:
        """Return an error about the cell file."""
        return CellProblem(Severity.ERROR, self.cell.file, line, message, observed, remedy)

    def warning(self, line: int, message: str, observed: str = "", remedy: str = "") -> CellProblem:
        """Return a warning about the cell file."""
        return CellProblem(Severity.WARNING, self.cell.file, line, message, observed, remedy)

    def note(self, line: int, message: str, observed: str = "", remedy: str = "") -> CellProblem:
        """Return a note about the cell file."""
        return CellProblem(Severity.NOTE, self.cell.file, line, message, observed, remedy)


Problems = Iterator[CellProblem]
Check = Callable[[CheckContext], Problems]


def title(index: int) -> str:
    """Return an object of CiA 402 with its name: ``6081h (profile velocity)``."""
    name = catalogue.name(index) if index in FIRST_AXIS else ""
    return f"{index:04X}h ({_lower(name)})" if name else f"{index:04X}h"


def titles(indices: tuple[int, ...]) -> str:
    """Return several objects as ``title`` does, separated by commas."""
    return ", ".join(title(index) for index in indices)


def own_title(drive: Drive, index: int) -> str:
    """Return an object as ``title`` does, with the device's own index if that differs."""
    own = drive.index(index)
    return title(index) if own == index else f"{own:04X}h ({title(index)} of axis {drive.axis.drive_axis})"


def _lower(name: str) -> str:
    return name if name[:2].isupper() else name[:1].lower() + name[1:]
