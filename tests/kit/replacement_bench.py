"""Two simulated drives on a wire in virtual time, one of which is replaced by a program without a machine."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from axisbus.bus.node.node import CanopenNode
from axisbus.clock import VirtualClock
from axisbus.configuration.dcf_backup import backup
from axisbus.configuration.nameplate import Nameplate
from axisbus.configuration.replacement import DriveReplacement, Tell, find_drives
from axisbus.configuration.replacement_order import FoundDrive, ReplacementOutcome
from axisbus.configuration.replacement_plan import (
    NodeToReplace,
    ReplacementPlan,
    UnfinishedReplacement,
    plan,
)
from axisbus.drives.plugin import DrivePlugin, NodeIdObject
from axisbus.eds import dcf, loads, writer
from axisbus.eds.io import reader
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.node.network import ForeignNode
from axisbus.sim.power import Effort
from axisbus.sim.virtual_can import VirtualWire
from kit.cell import with_identity
from kit.virtual_channel import KilledChannel

NODE, OTHER, MASTER = 1, 2, 127
VENDOR, PRODUCT, OLD, NEW = 0x123, 7, 4711, 4712
# Objects of the old drive's configuration, with values that no drive has from the factory.
CONFIGURED = {0x6081_00: 123_456, 0x6083_00: 7_654_321, 0x607D_01: -50_000, 0x607D_02: 50_000}
SAVE = 0x6576_6173
NODE_ID_OBJECT = """[ManufacturerObjects]
SupportedObjects=1
1=0x2009

[2009]
ParameterName=Node-ID
ObjectType=0x7
DataType=0x5
AccessType=rw
DefaultValue=1
PDOMapping=0
"""
WAS = Nameplate(
    NODE, "generic", VENDOR, PRODUCT, 0, OLD, "axisbus generic CiA 402 drive", "", "", None, None, None, None
)
Swap = Callable[[Device], None]


class Bench:
    """The drives, the backup of the first one, and the note of its replacement, over several programs."""

    def __init__(self, folder: Path, *foreign_nodes: ForeignNode, own_node_id: bool = False) -> None:
        """The old drive has been configured, stored and backed up; then it has no supply. ``foreign_nodes`` are on the bus as well.

        ``own_node_id``: the drives have no LSS; 2009h is their node-ID after the next restart, if it was stored.
        """
        text = with_identity(VENDOR, PRODUCT)
        self._makes: tuple[DrivePlugin, ...] = ()
        if own_node_id:
            self._makes = (DrivePlugin("own node-ID", VENDOR, node_id=NodeIdObject((0x2009, 0))),)
            text = text.replace("[ManufacturerObjects]\nSupportedObjects=0\n", NODE_ID_OBJECT)
        source = text.encode()
        self._eds = loads(source, "drive.eds")
        self.clock = VirtualClock()
        self.device, self.other = (
            device_from_eds(self._eds, node_id, seed=node_id, serial=serial)
            for node_id, serial in ((NODE, OLD), (OTHER, 1))
        )
        if own_node_id:
            self.device.dials.lss.absent = True
            restart = self.device.lss.restart

            def by_object(*, whole: bool) -> int:
                self.device.lss.stored = self.device._stored.get(0x2009_00, self.device.lss.stored)  # type: ignore[assignment]
                return restart(whole=whole)

            self.device.lss.restart = by_object  # type: ignore[method-assign]
        self.wire = VirtualWire(self.clock, [self.device, self.other], foreign_nodes)
        self.file = folder / "old.dcf"
        self.note: UnfinishedReplacement | None = None
        self.downloads: list[tuple[int, int]] = []
        self.energised = False
        self.revision = 0  # of the EDS
        self.clock.sleep(0.5)
        for key, value in CONFIGURED.items():
            self.device.write(key >> 8, key & 0xFF, value)
        self.device.write(0x1010, 1, SAVE)
        with self.program() as (_, node):
            reading = reader.read(source, "drive.eds")
            made = backup(node.sdo, reading, dcf.Settings(NODE))
        self.file.write_bytes(writer.dumps(made.reading))
        self.factory = {key: self._eds.get(key >> 8, key & 0xFF).initial(NODE) for key in CONFIGURED}
        self.device.dials.unpowered = True
        self.clock.sleep(0.5)
        self._count_downloads()

    def _count_downloads(self) -> None:
        before = self.device.dictionary.download

        def download(index: int, subindex: int, data: bytes) -> None:
            self.downloads.append((index, subindex))
            self.energised |= any(drive.power.effort is not Effort.OFF for drive in self.device.drives)
            before(index, subindex, data)

        self.device.dictionary.download = download  # type: ignore[method-assign]

    def swap(self, **what: int) -> None:
        """Put the new drive in, and switch it on."""
        self.device.swap(NEW, **what)
        self.device.dials.unpowered = False
        self.clock.sleep(1.0)

    def program(self, killed_at: int | None = None) -> _Program:
        """A program on the bus, killed before one of its frames."""
        return _Program(KilledChannel(killed_at=killed_at, wire=self.wire, clock=self.clock))

    def known(self) -> NodeToReplace:
        """What is known of the node."""
        return NodeToReplace(
            NODE,
            "cell.toml",
            VENDOR,
            PRODUCT,
            self.revision,
            was=WAS,
            unfinished=self.note,
            configuration=str(self.file),
        )

    def find(self) -> list[FoundDrive]:
        """What a program finds."""
        with self.program() as (_, node):
            return find_drives(node, (NODE, OTHER, MASTER))

    def replace(
        self, on_step: Tell = lambda _: None, killed_at: int | None = None
    ) -> tuple[ReplacementPlan, ReplacementOutcome, list[tuple[int, bytes]]]:
        """Replace the drive as the command does; return the plan, the outcome, and the frames sent."""
        with self.program(killed_at) as (channel, node):
            made = plan(self.known(), find_drives(node, (NODE, OTHER, MASTER)))
            self.note = made.note
            outcome = DriveReplacement(node, made.order, self._makes, on_step=on_step).run()
            self.note = None
            return made, outcome, channel.sent

    def assert_replaced(self) -> None:
        """The new drive is node 1, keeps the configuration without supply, and had no power; the other one is unchanged."""
        for _ in range(2):
            assert self.device.node_id == NODE
            assert {key: self.device.read(key >> 8, key & 0xFF) for key in CONFIGURED} == CONFIGURED
            assert self.device.read(0x1018, 4) == NEW
            assert self.other.read(0x6081) != CONFIGURED[0x6081_00]
            self.device.dials.unpowered = True
            self.clock.sleep(0.5)
            self.device.dials.unpowered = False
            self.clock.sleep(0.5)
        assert not self.energised


class _Program:
    """A program with the channel and node 1; its end, even if it is killed, closes both."""

    def __init__(self, channel: KilledChannel) -> None:
        self._channel = channel
        self._stack = ExitStack()

    def __enter__(self) -> tuple[KilledChannel, CanopenNode]:
        self._stack.enter_context(self._channel)
        return self._channel, self._stack.enter_context(CanopenNode(self._channel, NODE))

    def __exit__(self, *_: object) -> None:
        self._channel.killed_at = None
        self._stack.close()
