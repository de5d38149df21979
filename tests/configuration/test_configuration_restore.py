"""Restoring a configuration: a strict device is cut off at every write, and comes to the same end all the same."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

import pytest

from axisbus.cia301.datatypes import encode, size_in_bytes
from axisbus.configuration.dcf_backup import backup
from axisbus.configuration.dcf_values import Selection, SkipReason, require_within_limits, select
from axisbus.configuration.restore import Restore, ValueEnd
from axisbus.configuration.write_order import ordered
from axisbus.drives.plugin import GENERIC, DrivePlugin
from axisbus.eds import dcf, writer
from axisbus.eds.io import reader
from axisbus.errors import ArgumentError, EdsError, LimitError
from kit.strict_device import PDO_MAPPING, Cut, StrictDevice

NODE = 5
ROOT = Path(__file__).parents[2]


def _section(name, **keys):
    return f"\n[{name}]\n" + "".join(f"{key}={value}\n" for key, value in keys.items())


def _variable(name, title, kind, access="rw", **more):
    return _section(name, ParameterName=title, ObjectType="0x7", DataType=kind, AccessType=access, **more)


def _record(index, title, count):
    head = _section(index, ParameterName=title, ObjectType="0x9", SubNumber=count + 1)
    return head + _variable(f"{index}sub0", "Highest sub-index", "0x0005", "const", DefaultValue=count)


# Objects that the generic drive lacks: those with an order of their own, and a text.
EXTRA = (
    _variable("1019", "Synchronous counter overflow value", "0x0005", DefaultValue=0)
    + _record("1020", "Verify configuration", 2)
    + _variable("1020sub1", "Configuration date", "0x0007", DefaultValue=0)
    + _variable("1020sub2", "Configuration time", "0x0007", DefaultValue=0)
    + _record("1280", "SDO client parameter", 3)
    + _variable("1280sub1", "COB-ID client to server", "0x0007", DefaultValue="0x80000000")
    + _variable("1280sub2", "COB-ID server to client", "0x0007", DefaultValue="0x80000000")
    + _variable("1280sub3", "Node-ID of the SDO server", "0x0005", DefaultValue=0)
    + _variable("2000", "Name given by the user", "0x0009", DefaultValue="")
    + _variable("2001", "Encoder offset", "0x0004", DefaultValue=0)
    + _variable("2002", "Gain", "0x0008", DefaultValue="0.5")
)
EDS = reader.read((ROOT / "eds" / "generic-cia402.eds").read_bytes() + EXTRA.encode(), "drive.eds")

# A configuration far from the defaults (numbers by hand): index, sub-index, octets as they go over the wire.
GOLDEN = {
    (0x1005, 0): "80 00 00 40",  # produces SYNC
    (0x1006, 0): "10 27 00 00",
    (0x1014, 0): "85 00 00 00",
    (0x1016, 1): "f4 01 01 00",
    (0x1016, 2): "f4 01 02 00",
    (0x1017, 0): "64 00",
    (0x1019, 0): "0a",
    (0x1020, 1): "10 20 00 00",
    (0x1020, 2): "00 10 00 00",
    (0x1280, 1): "09 06 00 00",
    (0x1280, 2): "89 05 00 00",
    (0x1280, 3): "09",
    (0x1400, 1): "05 03 00 00",  # RPDO1 has the default COB-ID of RPDO2, and RPDO2 that of RPDO1
    (0x1401, 1): "05 02 00 00",
    (0x1600, 0): "02",
    (0x1600, 1): "10 00 40 60",
    (0x1600, 2): "20 00 7a 60",
    (0x1800, 1): "85 01 00 40",
    (0x1800, 2): "01",
    (0x1800, 3): "64 00",
    (0x1A00, 0): "02",
    (0x1A00, 1): "10 00 41 60",
    (0x1A00, 2): "20 00 64 60",
    (0x2000, 0): "41 78 69 73 20 31",  # "Axis 1"
    (0x2002, 0): "00 00 40 40",  # 3.0
    (0x6081, 0): "80 84 1e 00",  # 2 000 000, above the maximum that the drive has by default
    (0x607F, 0): "c0 c6 2d 00",  # 3 000 000
}
GOLDEN = {key: bytes.fromhex(text) for key, text in GOLDEN.items()}


def _factory() -> dict[tuple[int, int], bytes]:
    """The factory values of the drive."""
    values = {}
    for entry in EDS.eds:
        for sub in entry.subs.values():
            value = sub.initial(NODE)
            size = size_in_bytes(sub.data_type)
            values[sub.index, sub.subindex] = (
                bytes(size or 0) if value is None else encode(value, sub.data_type)
            )
    return values


FACTORY = _factory()


def _configured() -> StrictDevice:
    return StrictDevice({**FACTORY, **GOLDEN})


def _taken(device=None):
    """A backup, once written to a file and read again."""
    made = backup(device or _configured(), EDS, dcf.Settings(NODE)).reading
    return reader.read(writer.dumps(made), "node-5.dcf").eds


DCF = _taken()
SELECTION = select(DCF, NODE, GENERIC)
WANTED = {item.key: item.data for item in SELECTION.items}


def _differing(device):
    """The oracle: the differences, found without the code under test."""
    return {key for key, data in WANTED.items() if device.values[key] != data}


# -- backup ------------------------------------------------------------------------------------------------------------


def test_a_backup_holds_every_readable_object_with_its_value_identity_and_serial_number():
    device = _configured()
    device.values[0x1018, 4] = bytes.fromhex("d2 04 00 00")
    eds = _taken(device)
    assert eds.node_id == NODE
    assert eds.info["devicecomissioning"]["lss_serialnumber"] == "1234"
    readable = [sub for entry in EDS.eds for sub in entry.subs.values() if sub.readable]
    told = {(each.index, each.subindex): eds.get(each.index, each.subindex) for each in readable}
    for key, variable in told.items():
        value = variable.parameter_value
        if device.values[key]:
            assert value is not None, key
            assert encode(variable.initial(NODE), variable.data_type) == device.values[key], key


def test_cob_ids_that_follow_the_node_id_are_formulas_and_others_are_not():
    for key in ((0x1014, 0), (0x1800, 1)):
        assert DCF.get(*key).parameter_value.plus_node_id, key
    assert not DCF.get(0x1400, 1).parameter_value.plus_node_id  # RPDO1 with the COB-ID of RPDO2
    assert DCF.get(0x1800, 1).initial(7) == 0x4000_0187


def test_a_value_that_a_dcf_cannot_contain_is_left_out_with_its_reason():
    device = _configured()
    del device.values[0x6083, 0]
    device.values[0x6081, 0] = b"\1\2"
    device.values[0x2000, 0] = b" \xff "
    made = backup(device, EDS, dcf.Settings(NODE))
    reasons = {(each.index, each.subindex): each.reason for each in made.left_out}
    assert "Object does not exist" in reasons[0x6083, 0]
    assert "the device sends 2 octets, UNSIGNED32 has 4" in reasons[0x6081, 0]
    assert "20 ff 20 cannot be written in an EDS" in reasons[0x2000, 0]
    assert len(reasons) == 3


# -- values for the device ---------------------------------------------------------------------------------------------


def _why(selection: Selection):
    return {(each.variable.index, each.variable.subindex): each.why for each in selection.skipped}


def test_objects_that_act_are_never_restored():
    orders = {index for (index, _), why in _why(SELECTION).items() if why is SkipReason.ORDER}
    assert orders >= {
        0x1003,
        0x1010,
        0x1011,
        0x6040,
        0x6060,
        0x6071,
        0x607A,
        0x60B0,
        0x60B1,
        0x60B2,
        0x60FE,
        0x60FF,
    }
    assert orders.isdisjoint(index for index, _ in WANTED)
    with_orders = select(DCF, NODE, GENERIC, include=[(0x6040, 0), (0x607A, 0)])
    assert {each.key for each in with_orders.items} == set(WANTED)


def test_calibration_objects_are_not_restored_unless_they_are_named():
    make = DrivePlugin("maker", calibration_objects=((0x2001, None),))
    left = select(DCF, NODE, make)
    assert _why(left)[0x2001, 0] is SkipReason.CALIBRATION
    assert "--include 2001:0" in next(
        each.text for each in left.skipped if each.why is SkipReason.CALIBRATION
    )
    assert (0x2001, 0) in {each.key for each in select(DCF, NODE, make, include=[(0x2001, 0)]).items}


def test_an_object_that_is_named_must_have_a_value():
    with pytest.raises(ArgumentError, match="gives no value for 5FFFh:00"):
        select(DCF, NODE, GENERIC, exclude=[(0x5FFF, 0)])


def test_values_beyond_the_files_limits_are_named_before_anything_is_written():
    made = dcf.record(EDS, dcf.Settings(NODE), {(0x6098, 0): "-128"}).eds
    text = writer.dumps(made).decode().replace("[6098]\n", "[6098]\nLowLimit=-1\nHighLimit=37\n", 1)
    eds = reader.read(text.encode(), "limits.dcf").eds
    selection = select(eds, NODE, GENERIC)
    with pytest.raises(LimitError) as raised:
        require_within_limits(selection.items, eds, NODE)
    assert "nothing was written" in str(raised.value)
    assert "6098h:00" in raised.value.observed


# -- the order ---------------------------------------------------------------------------------------------------------


def test_a_pdo_is_switched_off_emptied_filled_counted_and_switched_on():
    """CiA 301 7.5.2.38: COB-ID invalid, count 0, entries, count, COB-ID valid; here with the type of transmission."""
    held = {**FACTORY}
    writes = list(ordered({key: WANTED[key] for key in WANTED if key[0] in (0x1800, 0x1A00)}, held))
    told = [(f"{each.index:X}:{each.subindex}", int.from_bytes(each.data, "little")) for each in writes]
    assert told == [
        ("1800:1", 0xC000_0185),
        ("1800:2", 1),
        ("1800:3", 100),
        ("1A00:0", 0),
        ("1A00:1", 0x6041_0010),
        ("1A00:2", 0x6064_0020),
        ("1A00:0", 2),
        ("1800:1", 0x4000_0185),
    ]


def test_without_a_difference_nothing_is_written():
    assert ordered(WANTED, WANTED) == []


def test_the_date_of_the_configuration_is_cleared_first_and_written_last():
    held = {**WANTED, (0x6083, 0): bytes(4)}
    writes = [(each.index, each.subindex, any(each.data)) for each in ordered(WANTED, held)]
    assert writes == [
        (0x1020, 1, False),
        (0x1020, 2, False),
        (0x6083, 0, True),
        (0x1020, 1, True),
        (0x1020, 2, True),
    ]


# -- restoring ---------------------------------------------------------------------------------------------------------


def _run(device):
    return Restore(device, SELECTION).run()


def test_a_strict_device_takes_all_of_it():
    device = StrictDevice(FACTORY)
    report = _run(device)
    assert report.ok
    assert not _differing(device)
    restored = {each.item.key for each in report.of(ValueEnd.RESTORED)}
    assert restored == {key for key in WANTED if FACTORY[key] != WANTED[key]}
    assert report.writes == len(device.log)


def test_a_second_run_writes_nothing():
    device = StrictDevice(FACTORY)
    _run(device)
    device.log.clear()
    report = _run(device)
    assert device.log == []
    assert {each.outcome for each in report.results} == {ValueEnd.SAME}


def test_back_to_the_factory_values_too():
    device = _configured()
    wanted = select(_taken(StrictDevice(FACTORY)), NODE, GENERIC)
    assert Restore(device, wanted).run().ok
    text = (0x2000, 0)  # empty in the factory, which an EDS cannot say
    assert {key for key in WANTED if device.values[key] != FACTORY[key]} == {text}


def _writes_of_a_whole_run():
    device = StrictDevice(FACTORY)
    _run(device)
    return len(device.log)


@pytest.mark.parametrize("done_first", [False, True], ids=["before", "after"])
@pytest.mark.parametrize("budget", range(_writes_of_a_whole_run()))
def test_after_an_interruption_at_any_write_the_next_run_names_the_differences_and_completes(
    budget, done_first
):
    device = StrictDevice(FACTORY)
    device.budget, device.done_first = budget, done_first
    cut = Restore(device, SELECTION)
    with pytest.raises(Cut):
        cut.run()
    assert not [
        each for each in cut.report().results if each.outcome is ValueEnd.FAILED and not device.refuse
    ]
    stamped = all(device.values[0x1020, sub] == WANTED[0x1020, sub] for sub in (1, 2))
    assert not stamped or not _differing(device)  # 1020h vouches for nothing that is not whole
    device.budget = None
    again = Restore(device, SELECTION)
    assert {item.key for item in again.read_present()} == _differing(device)
    assert again.run().ok
    assert not _differing(device)


def test_runs_that_are_interrupted_after_every_write_complete():
    device = StrictDevice(FACTORY)
    device.done_first = True
    for _ in range(10 * _writes_of_a_whole_run()):
        device.log.clear()
        device.budget = 0
        try:
            _run(device)
        except Cut:
            continue
        break
    assert not _differing(device)


# -- refusals of a device ----------------------------------------------------------------------------------------------


def test_a_mapping_entry_alone_in_a_dcf_made_by_hand_is_restored():
    """The PDO is switched off, emptied, filled, counted and switched on for it, also when the first run is cut off."""
    eds = dcf.make(EDS, dcf.Settings(NODE), [(EDS.eds.get(0x1A00, 1), "0x606C0020")]).eds
    selection = select(eds, NODE, GENERIC)
    for budget in range(6):
        device = StrictDevice(FACTORY)
        device.budget = budget
        with suppress(Cut):
            Restore(device, selection).run()
        device.budget = None
        assert Restore(device, selection).run().ok
        assert device.values == {**FACTORY, (0x1A00, 1): bytes.fromhex("20 00 6c 60")}
    forgetful = Forgetful(FACTORY)
    assert Restore(forgetful, selection).run().ok
    assert forgetful.values[0x1A00, 2] == FACTORY[0x1A00, 2]


class Forgetful(StrictDevice):
    """Empties the entries of a mapping with its count, as some drives do."""

    def download(self, index, subindex, data):
        super().download(index, subindex, data)
        if index in PDO_MAPPING and subindex == 0 and not any(data):
            self.values |= {key: bytes(4) for key in self.values if key[0] == index and key[1]}


def test_a_drive_that_clears_a_mapping_with_its_count_is_restored():
    device = Forgetful(FACTORY)
    assert _run(device).ok
    assert not _differing(device)


def test_a_refused_object_is_named_with_its_reason_and_the_others_are_restored():
    device = StrictDevice(FACTORY)
    device.refuse[0x6085, 0] = 0x0800_0021
    device.values[0x6085, 0] = bytes(4)
    report = _run(device)
    (failed,) = report.of(ValueEnd.FAILED)
    assert failed.item.key == (0x6085, 0)
    assert "0x08000021" in failed.reason
    assert _differing(device) == {(0x6085, 0)}
    assert not report.ok


def test_a_pdo_with_a_refused_entry_is_restored():
    device = StrictDevice(FACTORY)
    device.refuse[0x1A00, 2] = 0x0604_0041
    report = _run(device)
    failed = {each.item.key: each.reason for each in report.of(ValueEnd.FAILED)}
    assert "its PDO was left unchanged, because 1A00h:02 is refused" in failed[0x1800, 2]
    # The refused entry cannot be restored either; the others are.
    assert device.values[0x1800, 1] == FACTORY[0x1800, 1]
    assert device.values[0x1800, 2] == FACTORY[0x1800, 2]
    assert _differing(device) <= {key for key in WANTED if key[0] in (0x1800, 0x1A00, 0x1020)}


def test_an_object_that_the_device_lacks_or_has_in_another_size_is_not_written():
    device = StrictDevice(FACTORY)
    del device.values[0x2002, 0]
    device.values[0x6083, 0] = b"\1\2"
    report = _run(device)
    failed = {each.item.key: each.reason for each in report.of(ValueEnd.FAILED)}
    assert failed == {
        (0x2002, 0): "the device does not have it",
        (0x6083, 0): "the device has 2 octets there, the file's type UNSIGNED32 has 4",
    }
    assert not [each for each in device.log if each[:2] in failed]


class Mute(StrictDevice):
    """Does not let 2000h be read."""

    def upload(self, index, subindex=0):
        if index == 0x2000:
            raise self.abort(index, subindex, 0x0601_0001)
        return super().upload(index, subindex)


def test_an_unreadable_object_is_written_once_and_reported_as_not_verified():
    device = Mute(FACTORY)
    report = _run(device)
    (blind,) = report.of(ValueEnd.UNVERIFIED)
    assert blind.item.key == (0x2000, 0)
    assert [data for index, _, data in device.log if index == 0x2000] == [b"Axis 1"]
    assert report.ok


class Rounding(StrictDevice):
    """Takes 6084h in steps of 1000."""

    def download(self, index, subindex, data):
        if index == 0x6084:
            data = (int.from_bytes(data, "little") // 1000 * 1000).to_bytes(4, "little")
        super().download(index, subindex, data)


def test_a_value_that_is_rounded_is_no_success():
    golden = _configured()
    golden.values[0x6084, 0] = (12_345).to_bytes(4, "little")
    device = Rounding(FACTORY)
    report = Restore(device, select(_taken(golden), NODE, GENERIC)).run()
    (failed,) = report.of(ValueEnd.FAILED)
    assert (failed.item.key, failed.after) == ((0x6084, 0), (12_000).to_bytes(4, "little"))
    assert failed.reason == "it was accepted, and reads back another value"


def test_progress_is_reported_for_reading_and_writing():
    told = []
    device = StrictDevice(FACTORY)
    Restore(device, SELECTION, lambda *each: told.append(each)).run()
    assert {what for what, _, _ in told} == {"reading", "writing"}
    assert all(0 < done <= total for _, done, total in told)


HUGE = (0xFFFF_FFFF).to_bytes(4, "little")


@pytest.mark.parametrize("index", [0x1600, 0x1A00])
def test_a_number_of_mapped_objects_that_no_pdo_has_is_refused_at_once(index):
    count = _variable(f"{index:X}sub0", "Number", "0x0007", DefaultValue=HUGE[0], ParameterValue="4294967295")
    text = _record(f"{index:X}", "Mapping", 0).split("\n[")[1] + count
    head = "[FileInfo]\nFileName=x.dcf\n[DeviceInfo]\nVendorNumber=1\n["
    with pytest.raises(EdsError, match=rf"^x\.dcf:\d+: .*4294967295 objects \({index:X}h:00\)") as told:
        select(reader.read((head + text).encode(), "x.dcf").eds, NODE, GENERIC)
    assert told.value.remedy


def test_the_writes_of_a_mapping_follow_its_values_and_not_its_count():
    wanted = {(0x1A00, 0): HUGE, (0x1A00, 1): GOLDEN[0x1A00, 1]}
    assert [write.key for write in ordered(wanted, {})] == [(0x1A00, 0), (0x1A00, 1), (0x1A00, 0)]


SOME_SECONDS = 10.0  # of the processor, on a slow machine; a pass over all values for each PDO takes minutes


def _large(sections):
    """Return a DCF with a value for each (index, sub-index)."""
    head = "[FileInfo]\nFileName=x.dcf\n[DeviceInfo]\nVendorNumber=1\n"
    each = "[{:X}sub{:X}]\nDataType=7\nAccessType=rw\nParameterValue={}\n"
    return reader.read((head + "".join(each.format(*keys) for keys in sections)).encode(), "x.dcf").eds


def test_a_file_that_fills_every_pdo_is_restored_in_time_also_if_the_device_refuses_all_of_them():
    communication = (*range(0x1400, 0x1600), *range(0x1800, 0x1A00))
    values = [(index, 1, 0x8000_0185) for index in communication]
    values += [(index + 0x200, sub, 40) for index in communication for sub in range(41)]
    eds, start = _large(values), time.process_time()
    selection = select(eds, NODE, GENERIC)
    device = StrictDevice({item.key: bytes(4) for item in selection.items})
    device.refuse = {(index + 0x200, 1): 0x0604_0041 for index in communication}
    report = Restore(device, selection).run()
    assert time.process_time() - start < SOME_SECONDS
    assert len(report.results) == len(values)
    assert len(report.of(ValueEnd.FAILED)) == len(values)
