"""The whole bus package against the simulated drive on python-can's virtual bus: from boot-up to an enabled drive, by frames."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.discover import scan
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.configure import set_pdo
from axisbus.bus.pdo.plan import Policy
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia402.port import Outputs, ValueTransport
from axisbus.eds import load
from kit.bus.master import EDS, Master
from kit.can_interface import line

sim_network = pytest.importorskip("axisbus.sim.node.network")
sim_build = pytest.importorskip("axisbus.sim.build")

NODES = (3, 4)
_channels = itertools.count()
_simulated_nodes: list[Any] = []


@pytest.fixture
def nodes() -> Iterator[list[CanopenNode]]:
    """Two simulated drives on a channel of their own, listened to since before they boot."""
    name = f"stand-ins {next(_channels)}"
    with Channel.open(*line(name)) as channel, ExitStack() as stack:
        made = [stack.enter_context(CanopenNode(channel, node_id, load(EDS))) for node_id in NODES]
        devices = [sim_build.device_from_eds(load(EDS), node_id) for node_id in NODES]
        with sim_network.SimulatedNetwork(line(name)[1], devices, interface=line(name)[0]) as simulated_nodes:
            _simulated_nodes.append(simulated_nodes)
            for node in made:
                node.nmt.wait_bootup(5.0)
            yield made


@pytest.fixture
def channel(nodes: list[CanopenNode]) -> Channel:
    return nodes[0].channel


def test_the_simulated_drives_are_found(channel: Channel, nodes: list[CanopenNode]) -> None:
    found = scan(channel, ids=range(1, 11), listen=0.3)
    assert [node.node_id for node in found] == list(NODES)
    assert found[0].kind.endswith("(CiA 402)")
    assert nodes[0].identity() == found[0].identity


@pytest.mark.parametrize("sync", [True, False])
def test_from_boot_up_to_operation_enabled_and_a_quick_stop(
    channel: Channel, nodes: list[CanopenNode], sync: bool
) -> None:
    master = Master(channel, nodes, Policy(sync=sync))
    for port in master.ports:
        told = port.capabilities
        wanted = ValueTransport.SYNC_PDO if sync else ValueTransport.EVENT_PDO
        assert {told.inputs[name] for name in ("statusword", "mode", "position")} == {wanted}
        assert {told.outputs[name] for name in ("controlword", "mode", "target_position")} == {wanted}
    master.until(0x40, 0x4F, Outputs())
    master.until(0x21, 0x6F, Outputs(controlword=0x06))
    master.until(0x23, 0x6F, Outputs(controlword=0x07))
    seen = master.until(0x27, 0x6F, Outputs(controlword=0x0F, mode=1))
    assert all(inputs.operational for inputs in seen)
    assert all(inputs.position is not None and abs(inputs.position.value) < 100 for inputs in seen)
    master.cycle.quick_stop_all()
    for node in nodes:
        deadline = time.monotonic() + 5
        while node.sdo.read(0x6041) & 0x6F == 0x27:  # type: ignore[operator]
            assert time.monotonic() < deadline
    channel.check()


def test_a_drive_is_driven_with_the_mapping_that_it_has(channel: Channel, nodes: list[CanopenNode]) -> None:
    master = Master(channel, nodes[:1], Policy(remap=False))
    assert not any(pdo.change.name == "MAPPING" for pdo in master.ports[0].plan.pdos)
    master.until(0x21, 0x6F, Outputs(controlword=0x06))


def test_a_drive_that_resets_is_unknown_until_it_is_booted_again(
    channel: Channel, nodes: list[CanopenNode]
) -> None:
    master = Master(channel, nodes[:1], Policy())
    port = master.ports[0]
    master.until(0x40, 0x4F, Outputs())
    nodes[0].command(NmtCommand.RESET_NODE, timeout=5.0)
    assert port.rebooted
    seen = port.read(master.cycle.now())
    assert (seen.operational, seen.statusword) == (False, None)


def test_sdo_and_pdo_side_by_side(channel: Channel, nodes: list[CanopenNode]) -> None:
    """User threads read while the scan runs: nothing is mixed up."""
    master = Master(channel, nodes, Policy())
    values = [nodes[0].sdo.read("6502h") for _ in range(20)]
    master.until(0x21, 0x6F, Outputs(controlword=0x06))
    assert len(set(values)) == 1


@pytest.mark.parametrize("kind", [252, 253])
def test_a_drive_that_sends_its_tpdos_only_on_request_is_requested(
    channel: Channel, nodes: list[CanopenNode], kind: int
) -> None:
    """The statusword comes by remote frames every 20 ms, and the drive is taken to operation enabled with it."""
    node = nodes[0]
    _simulated_nodes[-1].nodes[0].device.dials.rtr = True
    node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
    set_pdo(node.sdo, False, 1, transmission_type=kind, rtr=True)
    policy = Policy(remap=False, fixed=frozenset({(False, 1)}), requests={1: 0.02})
    master = Master(channel, [node], policy)
    assert master.ports[0].capabilities.inputs["statusword"] is ValueTransport.EVENT_PDO
    master.until(0x21, 0x6F, Outputs(controlword=0x06))
    master.until(0x23, 0x6F, Outputs(controlword=0x07))
    master.until(0x27, 0x6F, Outputs(controlword=0x0F, mode=1))
    assert not [event for event in node.pdo_events if event.pdo == "TPDO1"]
