"""The simulated nodes of a cell: one device for each of its nodes, and the user's access to it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager

from axisbus.cell.model import CellConfig
from axisbus.drives.plugin import DrivePlugin
from axisbus.drives.registry import make_of
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, ConfigError
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.drive import Drive
from axisbus.sim.node.lss import NO_NODE_ID

_KEY = "unconfigured"


class SimulatedNode:
    """One simulated node; exists only if the cell is simulated. Its methods may be called from any thread."""

    def __init__(self, device: Device, lock: AbstractContextManager[object]) -> None:
        self.device = device
        self.lock = lock

    def drive(self, axis: int = 1) -> Drive:
        """Return the drive of an axis (from 1): its values, and its fault settings (``dials``)."""
        return self.device.drives[axis - 1]

    def history(self) -> tuple[float, float, int] | None:
        """Return position, velocity and stage of its motor for a ``PlantLog``; None for a CANopen node, whose device has them."""
        return None

    def switch_off(self) -> None:
        """Take the supply away: the node is silent, its motors have no power, and all but stored values is lost."""
        with self.lock:
            self.device.dials.unpowered = True

    def switch_on(self) -> None:
        """Give the supply back: the node boots."""
        with self.lock:
            self.device.dials.unpowered = False

    def swap(
        self,
        serial: int,
        node_id: int | None = None,
        revision: int | None = None,
        software_version: str | None = None,
        product_code: int | None = None,
    ) -> None:
        """Replace the drive by another one of the same type with factory parameters; it boots if it has a supply.

        ``node_id`` 1 to 127 is its own; 255: it has none, and answers LSS only; None: that of the drive before it. ``revision`` and
        ``product_code`` (1018h) and ``software_version`` (100Ah) are those of the EDS if they are None.

        Raises:
            ArgumentError: the node-ID is another one.
        """
        if node_id is not None and node_id not in (*range(1, 128), NO_NODE_ID):
            raise ArgumentError(f"{node_id} is not a node-ID", remedy="give 1 to 127, or 255 for none")
        with self.lock:
            self.device.swap(serial, node_id, revision, software_version, product_code)

    def fault(self, code: int, maker_bits: int = 0, axis: int = 1) -> None:
        """Put the drive into fault with the error code ``code`` (603Fh) and the vendor's error bits."""
        with self.lock:
            self.drive(axis).fault(code, maker_bits=maker_bits)


def devices(cell: CellConfig, dictionaries: Mapping[int, Eds]) -> dict[int, Device]:
    """Make a device for each node, powered off; ``unconfigured = [1, 2]`` in ``[bus.options]`` leaves nodes without a node-ID.

    These wait for one by LSS, with their number in the cell as serial number.

    Raises:
        ConfigError: ``unconfigured`` is not a list of the cell's nodes.
    """
    unconfigured = cell.bus.options.get(_KEY, [])
    if not isinstance(unconfigured, list) or not all(node in list(cell.nodes) for node in unconfigured):
        raise ConfigError(
            f"[bus.options] {_KEY} = {unconfigured!r} is not a list of nodes of this cell",
            remedy=f"write some of {sorted(cell.nodes)}, such as {_KEY} = [{min(cell.nodes, default=1)}]",
        )
    return {
        node_id: _device(
            node_id, eds, make_of(eds, cell.nodes[node_id].makes), unconfigured=node_id in unconfigured
        )
        for node_id, eds in dictionaries.items()
    }


def _device(node_id: int, eds: Eds, make: DrivePlugin, *, unconfigured: bool) -> Device:
    own, serial = (NO_NODE_ID, node_id) if unconfigured else (node_id, None)
    device = device_from_eds(eds, own, seed=node_id, serial=serial)
    device.dials.reboot_on_store = make.behaviour.store_restarts
    return device
