"""An EDS held against a live device, and taken from one: simulated drives on the virtual bus."""

import configparser
import itertools
import time
from datetime import datetime
from pathlib import Path
from types import MappingProxyType

import can
import pytest

from axisbus import eds
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.from_device import as_file, skeleton, stored_eds
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.node.verify import VerifiedAspect, verify
from axisbus.cia301.datatypes import DataType
from axisbus.eds import writer
from axisbus.errors import SdoTimeout
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from kit.sending_device import Talker

ROOT = Path(__file__).parents[2]
GENERIC = (ROOT / "eds" / "generic-cia402.eds").read_text()
NUMBER = itertools.count(1)


@pytest.fixture
def live():
    """A function that puts a simulated drive of an EDS on a bus and returns an SDO client for it."""
    opened = []

    def put(text=GENERIC, dictionary=None):
        name = f"verify-{next(NUMBER)}"
        simulated_nodes = SimulatedNetwork(name, [device_from_eds(eds.loads(text.encode(), "live.eds"), 5)])
        simulated_nodes.start()
        channel = Channel.open("virtual", name)
        node = CanopenNode(channel, 5, dictionary)
        opened.extend((node, channel, simulated_nodes))
        return node.sdo

    yield put
    for thing in opened:
        thing.close()


def section(name, **keys):
    return f"\n[{name}]\n" + "".join(f"{key}={value}\n" for key, value in keys.items())


def changed(name, old, new, text=GENERIC):
    begin = text.index(f"[{name}]")
    end = text.find("\n[", begin)
    part = text[begin:end]
    assert old in part, part
    return text[:begin] + part.replace(old, new) + text[end:]


def found(result):
    return {
        (each.kind, each.index, each.subindex): each
        for each in result.differences
        if each.severity.value != "note"
    }


def test_a_file_agrees_with_the_device_made_from_it(live):
    told = []
    result = verify(
        live(), eds.loads(GENERIC.encode(), "generic.eds"), lambda done, total: told.append((done, total))
    )
    assert result.agrees
    assert result.read > 200
    assert told[-1] == (result.read, result.read)


def test_an_object_that_the_device_lacks_is_named_with_its_line(live):
    text = GENERIC + section(
        "2FFF", ParameterName="Not there", ObjectType="0x7", DataType="0x0005", AccessType="ro"
    )
    dictionary = eds.loads(text.encode(), "more.eds")
    (difference,) = found(verify(live(), dictionary)).values()
    assert (difference.kind, difference.index) == (VerifiedAspect.EXISTENCE, 0x2FFF)
    assert difference.line == text[: text.index("[2FFF]")].count("\n") + 1
    assert "is not in the device" in difference.message


def test_a_size_other_than_in_the_eds_is_detected_by_the_received_bytes(live):
    dictionary = eds.loads(changed("6081", "DataType=0x0007", "DataType=0x0006").encode(), "size.eds")
    (difference,) = found(verify(live(), dictionary)).values()
    assert (difference.kind, difference.index) == (VerifiedAspect.TYPE, 0x6081)
    assert "UNSIGNED16 (2 bytes) in the EDS, the device sends 4 bytes" in difference.message


def test_an_identity_other_than_in_the_eds_is_an_error_and_another_setting_a_note(live):
    other = changed("1018sub2", "DefaultValue=", "DefaultValue=0x77;")
    other = other.replace("DefaultValue=0x77;", "DefaultValue=0x77\n;")
    device = changed("6081", "DefaultValue=", "DefaultValue=4321\n;")
    sdo = live(changed("1018sub2", "DefaultValue=", "DefaultValue=0x78\n;", device))
    result = verify(sdo, eds.loads(other.encode(), "other.eds"))
    (difference,) = found(result).values()
    assert (difference.kind, difference.index, difference.subindex) == (VerifiedAspect.IDENTITY, 0x1018, 2)
    notes = [each for each in result.differences if each.severity.value == "note"]
    assert [(each.kind, each.index) for each in notes] == [(VerifiedAspect.DEFAULT, 0x6081)]
    assert "is 0x10E1" in notes[0].message


def test_objects_that_cannot_be_read_or_can_be_read_against_their_access_type(live):
    device = changed("6081", "AccessType=rw", "AccessType=wo")
    result = verify(live(device), eds.loads(GENERIC.encode(), "a.eds"))
    (difference,) = found(result).values()
    assert (difference.kind, difference.severity.value) == (VerifiedAspect.ACCESS, "error")
    result = verify(live(), eds.loads(device.encode(), "b.eds"))
    (difference,) = found(result).values()
    assert (difference.kind, difference.severity.value) == (VerifiedAspect.ACCESS, "warning")


def test_verifying_writes_nothing(live, monkeypatch):
    sdo = live()
    monkeypatch.setattr(sdo, "download", lambda *_: pytest.fail("verify wrote to the device"))
    monkeypatch.setattr(sdo, "write", lambda *_: pytest.fail("verify wrote to the device"))
    assert verify(sdo, eds.loads(GENERIC.encode(), "generic.eds")).read > 200
    assert skeleton(sdo).objects


def test_a_skeleton_has_the_standard_objects_of_the_device_with_their_types(live):
    sdo = live()
    model = eds.loads(GENERIC.encode(), "generic.eds")
    made = skeleton(sdo)
    standard = {index for index in model.objects if index < 0x1400 or 0x6000 <= index < 0x6800}
    assert standard - set(made.objects) == set()
    for index, data_type in (
        (0x6064, DataType.INTEGER32),
        (0x6041, DataType.UNSIGNED16),
        (0x6060, DataType.INTEGER8),
    ):
        assert made.get(index).data_type is data_type
    assert made.get(0x607D, 2).data_type is DataType.INTEGER32
    assert made.get(0x6041).access == "ro"
    assert made.get(0x607A).pdo_mapping
    assert made.get(0x1018, 1).default == model.get(0x1018, 1).default
    assert made.get(0x1010, 1).object_flags == 1  # a download must not store
    again = eds.loads(writer.dumps(made), "skeleton.eds")
    assert again.findings == ()
    assert verify(sdo, again).agrees


def test_a_skeleton_is_a_whole_file(live):
    device = changed("1018sub1", "DefaultValue=", "DefaultValue=0x78\n;")
    made = as_file(skeleton(live(device)), "node-5.eds", datetime(2024, 3, 25, 14, 38), 500_000)
    text = writer.dumps(made).decode()
    assert text.startswith(
        "[FileInfo]\nFileName=node-5.eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\nDescription=skeleton read from node 5, "
        "types and access by the standard\nCreationTime=02:38PM\nCreationDate=03-25-2024\nCreatedBy=axisbus\n\n[DeviceInfo]\n"
    )
    parser = configparser.ConfigParser()
    parser.read_string(text)
    assert parser.getint("DeviceInfo", "VendorNumber") == 0x78
    assert parser.getint("DeviceInfo", "BaudRate_500") == 1
    listed = {
        int(index, 16): name
        for name in ("MandatoryObjects", "OptionalObjects")
        for key, index in parser.items(name)
        if key.isdigit()
    }
    assert listed.keys() == made.objects.keys()
    assert [index for index, name in listed.items() if name == "MandatoryObjects"] == [0x1000, 0x1001, 0x1018]
    for entry in made:
        if entry.is_record:
            subs = [name for name in parser.sections() if name.startswith(f"{entry.index:04X}sub")]
            assert parser.getint(f"{entry.index:04X}", "SubNumber") == len(subs)


def test_the_stored_eds_is_used_if_there_is_one(live):
    assert stored_eds(live()) is None
    text = GENERIC + section(
        "1021",
        ParameterName="Store EDS",
        ObjectType="0x7",
        DataType="0x000A",
        AccessType="ro",
        DefaultValue="3B20454453",
    )
    assert stored_eds(live(text)) == b"; EDS"


class Terse(Talker):
    """Node 5 answers for the objects that it has, ``delay`` seconds after the request, and is silent for all others.

    Once ``gone_at`` is asked for it is silent for good.
    """

    HAS = MappingProxyType({0x1000: 0x00020192, 0x1001: 0, 0x6040: 0, 0x6041: 0x0250, 0x67FF: 0x00020192})

    def __init__(self, channel, delay=0.0, gone_at=None):
        super().__init__(channel)
        self._delay, self._gone_at = delay, gone_at

    def _talk(self):
        gone = False
        while not self._over.is_set():
            request = self._bus.recv(0.05)
            if request is None or request.arbitration_id != 0x605 or request.data[0] != 0x40:
                continue
            index = int.from_bytes(request.data[1:3], "little")
            gone = gone or index == self._gone_at
            if gone or index not in self.HAS or request.data[3]:
                continue
            if self._delay:
                time.sleep(self._delay)
            data = b"\x43" + bytes(request.data[1:4]) + self.HAS[index].to_bytes(4, "little")
            self._bus.send(can.Message(arbitration_id=0x585, data=data, is_extended_id=False))


def asked(delay=0.0, gone_at=None):
    """Return the skeleton of a terse node, the notes, and the seconds that asking took."""
    name, told, begun = f"terse-{next(NUMBER)}", [], time.monotonic()
    with (
        Terse(name, delay, gone_at),
        Channel.open("virtual", name) as channel,
        CanopenNode(channel, 5, None) as node,
    ):
        made = skeleton(node.sdo, on_note=told.append)
    return made, told, time.monotonic() - begun


@pytest.mark.parametrize(("delay", "limit"), [(0.0, "0.1 s"), (0.2, "0.5 s")])
def test_a_node_that_does_not_answer_for_missing_objects_gets_less_time_after_three_of_them(delay, limit):
    made, told, took = asked(delay)
    assert sorted(made.objects) == sorted(Terse.HAS)  # also the objects after the shorter limit
    (text,) = told
    assert limit in text
    assert "answers for 1000h" in text
    if not delay:
        assert took < 120.0  # it was 1.5 s for each of more than 300 objects


def test_a_node_that_falls_silent_during_the_comparison_is_reported_as_lost():
    with pytest.raises(SdoTimeout, match="node 5 is lost") as caught:
        asked(gone_at=0x6040)
    assert "nor for 1000h" in caught.value.observed
    assert caught.value.remedy
