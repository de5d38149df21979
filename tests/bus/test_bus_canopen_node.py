"""A node as canopen sees it: the same objects, through our client."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import pytest
from canopen.objectdictionary import ODVariable
from canopen.objectdictionary.eds import import_eds
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.node.remote import canopen_dictionary, remote_node
from axisbus.eds import Eds, canopen_text, load, loads
from axisbus.errors import StateError
from kit.bus.fake_bus import FakeBus, Slave, eventually

EDS = load(Path(__file__).parents[2] / "eds" / "generic-cia402.eds")


@pytest.fixture
def slave(fake: FakeBus) -> Slave:
    slave = Slave(5, {(0x607A, 0): b"\xff\xff\xff\xff", (0x6081, 0): bytes(4)})
    fake.peers.append(slave)
    return slave


@pytest.fixture
def node(channel: Channel, slave: Slave) -> Iterator[CanopenNode]:
    with CanopenNode(channel, 5, EDS) as node:
        yield node


def test_objects_are_read_and_written_by_canopens_names(node: CanopenNode, slave: Slave) -> None:
    remote = remote_node(node)
    assert remote.sdo[0x607A].raw == -1
    remote.sdo[0x6081].raw = 500
    assert slave.objects[0x6081, 0] == (500).to_bytes(4, "little")


def test_sdo_failures_of_a_remote_node_are_raised_as_canopen_errors(node: CanopenNode, slave: Slave) -> None:
    remote = remote_node(node)
    with pytest.raises(SdoAbortedError) as caught:
        remote.sdo.upload(0x60FE, 1)
    assert caught.value.code == 0x0602_0000
    slave.ignore = 100
    node.sdo.timeout = 0.01
    with pytest.raises(SdoCommunicationError, match="no answer"):
        remote.sdo.upload(0x6081, 0)
    with pytest.raises(StateError, match="streams"):
        remote.sdo.open(0x1021)


def test_nmt_commands_are_sent_and_short_emergencies_are_recorded(
    node: CanopenNode, slave: Slave, fake: FakeBus
) -> None:
    remote = remote_node(node)
    remote.nmt.state = "OPERATIONAL"
    assert slave.commands == [1]
    fake.inject(0x085, "11 86")
    eventually(lambda: node.emcy.history)
    node.channel.check()


FORMULAS = """[DeviceComissioning]
NodeID=3
[2000]
ParameterName=Sum
DataType=7
AccessType=rw
DefaultValue=$NODEID+0x600
ParameterValue=$NODEID+1
[2001]
ParameterName=Text
DataType=9
AccessType=rw
DefaultValue=$NODEID+5
[2002]
ParameterName=Plain
DataType=7
AccessType=rw
DefaultValue=5
"""


@pytest.mark.parametrize("eds", [EDS, loads(FORMULAS.encode(), "x.dcf")])
def test_each_node_has_a_dictionary_of_its_own_with_its_node_id(eds: Eds) -> None:
    dictionaries = {}
    for node_id in (5, 127):
        dictionaries[node_id] = ours = canopen_dictionary(eds, node_id)
        theirs = import_eds(io.StringIO(canopen_text(eds)), node_id)
        assert ours.node_id == theirs.node_id
        for index in theirs:
            pairs = zip(variables(ours[index]), variables(theirs[index]), strict=True)
            for our, their in pairs:
                assert {**vars(our), "parent": None} == {**vars(their), "parent": None}
    first, second = dictionaries.values()
    assert first[next(iter(eds.objects))] is not second[next(iter(eds.objects))]


def variables(entry: object) -> list[ODVariable]:
    return [entry] if isinstance(entry, ODVariable) else list(entry.subindices.values())  # type: ignore[attr-defined]
