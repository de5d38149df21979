"""Open the nodes of a subcommand: by a cell file or a bus, EDS files, and node IDs or axis names."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import require_objects
from axisbus.cell.quantities import Quantities
from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.frames import eds_of
from axisbus.cli.shared.options import PATH, bus_options, packed, together
from axisbus.eds import Eds, builtin, load
from axisbus.errors import ArgumentError

if TYPE_CHECKING:
    from axisbus.bus.link.channel import Channel
    from axisbus.bus.node.node import CanopenNode


class Address(NamedTuple):
    """A node, and the named axis of it."""

    node_id: int
    drive_axis: int = 1


@dataclass(frozen=True, slots=True)
class NodeFiles:
    """The cell file (None: none) and the given EDS files, read on demand."""

    cell: CellConfig | None
    eds: dict[int, Eds] = field(default_factory=dict)
    default_eds: Eds | None = None

    @classmethod
    def of(cls, cell: Path | None, eds: tuple[str, ...]) -> NodeFiles:
        """Read the given files: --cell, and --eds as ``FILE`` (for every node) or ``N=FILE``.

        Raises:
            ConfigError, EdsError, ArgumentError: a file cannot be read, or the option has another form.
        """
        numbered = dict(eds_of(text) for text in eds if "=" in text)
        plain = [text for text in eds if "=" not in text]
        default_eds = load(plain[-1]) if plain else None
        return cls(reader.load(cell) if cell is not None else None, numbered, default_eds)

    def address(self, text: str) -> Address:
        """Return the node for a text: a node ID, or an axis of the cell.

        Raises:
            ArgumentError: it is neither.
            StateError: the node uses CAN Simple.
        """
        found = self._address(text)
        require_objects(self.cell, found.node_id)
        return found

    def _address(self, text: str) -> Address:
        if text.isdigit() and 1 <= int(text) <= 127:
            return Address(int(text))
        axes = self.cell.axes if self.cell is not None else {}
        if text in axes and axes[text].virtual:
            raise axes[text].no_drive("no node")
        if text in axes:
            return Address(axes[text].node, axes[text].drive_axis)
        known = (
            f"axes of the cell are {', '.join(axes)}"
            if axes
            else "without a cell file only node IDs can be used"
        )
        raise ArgumentError(f"{text!r} is not a node", observed=known, remedy="give a node ID from 1 to 127")

    def eds_for(self, node_id: int) -> Eds | None:
        """Return the EDS of a node; None if none was given."""
        found = self.eds.get(node_id, self.default_eds)
        if found is not None or self.cell is None or node_id not in self.cell.nodes:
            return found
        file = self.cell.nodes[node_id].file
        return None if file is None else load(builtin.resolve(file, self.cell.folder))

    def described_by(self, node_id: int, eds: Eds) -> NodeFiles:
        """Return these files, with ``eds`` for a node for which none was given.

        Without the types of its objects, the bytes of a device that does not send their number have no certain meaning.
        """
        return self if self.eds_for(node_id) is not None else replace(self, eds={**self.eds, node_id: eds})

    @property
    def quantities(self) -> Quantities:
        """The units of the cell's objects."""
        return Quantities(self.cell)


@dataclass(frozen=True, slots=True)
class NodeOptions:
    """The given bus and files."""

    interface: str | None
    channel: str | None
    bitrate: int | None
    option: tuple[str, ...]
    cell: Path | None
    eds: tuple[str, ...]

    def files(self) -> NodeFiles:
        """Return the given files, for a command that needs a bus.

        Raises:
            UsageError: no bus is given.
            Other errors as ``NodeFiles.of``.
        """
        require_bus(self)
        return NodeFiles.of(self.cell, self.eds)


# The bus options, --cell and --eds; a command gets them together as ``options``.
node_options = together(
    click.option("--cell", type=PATH, help="Take bus, EDS files and units from this cell file."),
    bus_options,
    click.option(
        "--eds",
        multiple=True,
        metavar="[N=]FILE",
        help="EDS or DCF of node N; without N=, of every node named.",
    ),
    packed(NodeOptions, "options"),
)


class NodeSession:
    """A bus with the requested nodes; holds state: the open channel and nodes, which ``stack`` closes."""

    def __init__(
        self, stack: ExitStack, options: NodeOptions, files: NodeFiles, node_ids: Iterable[int] = ()
    ) -> None:
        """Read the EDS files of the nodes known so far, then open the bus.

        Raises:
            UsageError: neither --cell nor -i is given.
            Other errors as ``NodeFiles.eds_for`` and ``buses.open_bus``.
        """
        require_bus(options)
        self.files = files
        self._stack = stack
        self._eds = {node_id: files.eds_for(node_id) for node_id in node_ids}
        self.bus: Channel = open_bus(
            stack, options.cell, options.interface, options.channel, options.bitrate, options.option
        )
        self._nodes: dict[int, CanopenNode] = {}

    def node(self, node_id: int) -> CanopenNode:
        """Return a node, opened at the first call."""
        from axisbus.bus.node.node import CanopenNode

        if node_id not in self._nodes:
            eds = self._eds[node_id] if node_id in self._eds else self.files.eds_for(node_id)
            self._nodes[node_id] = self._stack.enter_context(CanopenNode(self.bus, node_id, eds))
        return self._nodes[node_id]


def require_bus(options: NodeOptions) -> None:
    """Raise UsageError if no bus is given."""
    if options.cell is None and options.interface is None:
        raise click.UsageError(
            "give a cell file with --cell, or the bus with -i and -c (such as: -i socketcan -c can0)"
        )
