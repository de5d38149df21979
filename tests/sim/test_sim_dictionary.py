"""The object dictionary of a simulated drive: abort codes of CiA 301, storing and restoring, error history, PDO mapping rules."""

from __future__ import annotations

import pytest

from axisbus.cia301.datatypes import DataType
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.eds.model import Eds, Number, Object, ObjectType, Variable
from axisbus.errors import SdoAbort
from axisbus.sim.device import Device
from kit.sim.eds import drive_eds, two_axes
from kit.sim.rig import PP


def abort_of(call, *args) -> int:
    with pytest.raises(SdoAbort) as refused:
        call(*args)
    return refused.value.code


def small() -> Eds:
    """Entries with every kind of access and limit."""

    def var(index, kind, access, default=None, low=None, high=None):
        number = None if default is None else Number(default)
        limits = [None if value is None else Number(value) for value in (low, high)]
        entry = Variable(index, 0, f"{index:04X}", kind, access, number, None, limits[0], limits[1])
        return Object(index, entry.name, ObjectType.VAR, {0: entry})

    entries = [
        var(0x2000, DataType.UNSIGNED16, "rw", 5, 2, 100),
        var(0x2001, DataType.UNSIGNED16, "wo", 5),
        var(0x2002, DataType.UNSIGNED16, "const", 7),
        var(0x2003, DataType.INTEGER32, "rw", -5, -10, 10),
        var(0x2004, DataType.INTEGER8, "rw", 0xFB, 0, 0),
        var(0x2005, DataType.REAL32, "rw"),
        var(0x2006, DataType.VISIBLE_STRING, "rw"),
    ]
    return Eds("small", {entry.index: entry for entry in entries}, {})


@pytest.fixture
def device() -> Device:
    made = Device(drive_eds(), 5)
    made.power_on()
    return made


def test_invalid_sdo_requests_are_refused_with_the_standards_codes():
    dictionary = Device(small()).dictionary
    assert abort_of(dictionary.upload, 0x5000, 0) == 0x0602_0000
    assert abort_of(dictionary.upload, 0x2000, 1) == 0x0609_0011
    assert abort_of(dictionary.upload, 0x2001, 0) == 0x0601_0001
    assert abort_of(dictionary.download, 0x2002, 0, b"\1\0") == 0x0601_0002
    assert abort_of(dictionary.download, 0x2000, 0, b"\1\0\0") == 0x0607_0012
    assert abort_of(dictionary.download, 0x2000, 0, b"\1") == 0x0607_0013
    assert abort_of(dictionary.download, 0x2005, 0, b"\1") == 0x0607_0010
    assert abort_of(dictionary.download, 0x2000, 0, b"\x65\0") == 0x0609_0031
    assert abort_of(dictionary.download, 0x2000, 0, b"\1\0") == 0x0609_0032
    assert abort_of(dictionary.download, 0x2003, 0, b"\xf5\xff\xff\xff") == 0x0609_0032
    assert dictionary.upload(0x2000, 0) == b"\5\0"  # nothing of it was written


def test_values_travel_little_endian_and_keep_their_sign():
    dictionary = Device(small()).dictionary
    assert dictionary.upload(0x2003, 0) == b"\xfb\xff\xff\xff"
    assert dictionary.read(0x2004) == -5  # 0xFB as two's complement; limits 0 and 0 mean none
    dictionary.download(0x2003, 0, b"\xf6\xff\xff\xff")
    assert dictionary.read(0x2003) == -10
    dictionary.download(0x2006, 0, b"a name")
    assert dictionary.upload(0x2006, 0) == b"a name"
    dictionary.download(0x2005, 0, b"\0\0\x80\x3f")
    assert dictionary.get(0x2005_00) == 1.0


def test_an_integer_that_its_type_cannot_hold_is_out_of_range():
    dictionary = Device(drive_eds()).dictionary
    assert abort_of(dictionary.write, 0x6060, 0, 200) == 0x0609_0031
    assert abort_of(dictionary.write, 0x6040, 0, -1) == 0x0609_0032


def test_live_objects_show_the_drive(device):
    assert device.read(0x6041) == 0x0250
    device.write(0x607A, 0, -77)
    assert device.drive.target_position == -77
    device.drive.target_velocity = 55
    assert device.read(0x60FF) == 55
    assert device.read(0x6502) == 0x3AD


def test_objects_that_the_file_lacks_do_not_exist(device):
    assert abort_of(device.read, 0x6072, 1) == 0x0609_0011
    assert abort_of(device.read, 0x6079) == 0x0602_0000


def test_a_second_axis_lies_800h_higher():
    device = Device(two_axes())
    device.power_on()
    assert len(device.drives) == 2
    for word in (6, 7, 15):
        device.write(0x6840, 0, word)
        device.step(0.02)
    assert device.read(0x6841) & 0x6F == 0x27
    assert device.read(0x6041) & 0x4F == 0x40
    device.drives[1].fault(0x2310)
    assert device.read(0x683F) == 0x2310
    assert device.read(0x603F) == 0
    assert device.read(0x1001) == 0x03


def test_the_error_history_counts_keeps_the_newest_first_and_is_cleared_with_0(device):
    for code in (0x2310, 0x3210, 0x4310, 0x5000, 0x6000):
        device.errors.report(0, code)
    assert device.read(0x1003) == 4
    assert [device.read(0x1003, sub) for sub in (1, 2, 3, 4)] == [0x6000, 0x5000, 0x4310, 0x3210]
    assert abort_of(device.write, 0x1003, 0, 1) == 0x0609_0030
    device.write(0x1003, 0, 0)
    assert device.read(0x1003) == 0


@pytest.mark.parametrize(
    ("code", "register"),
    [
        (0x1000, 1),
        (0x2310, 3),
        (0x3220, 5),
        (0x4210, 9),
        (0x8130, 0x11),
        (0x8611, 0x21),
        (0x7305, 0x21),
        (0xFF01, 0x81),
    ],
)
def test_the_error_register_by_class_of_code(device, code, register):
    device.errors.report(0, code)
    assert device.read(0x1001) == register


# Storing and restoring.


def test_stored_parameters_survive_a_reset_and_others_do_not(device):
    device.write(0x6081, 0, 111)
    device.write(0x1010, 1, 0x65766173)
    device.write(0x6083, 0, 222)
    device.nmt_command(NmtCommand.RESET_NODE)
    device.step(1.0)
    assert device.read(0x6081) == 111
    assert device.read(0x6083) == 100_000
    assert device.drive.settings.profile_velocity == 111


def test_a_restart_restores_mode_and_targets_of_the_file():
    device = Device(drive_eds(x6060=1), 5)
    device.power_on()
    assert device.read(0x6061) == 1
    device.write(0x6060, 0, 3)
    device.drive.target_position = 99
    device.step(0.1)
    device.nmt_command(NmtCommand.RESET_NODE)
    device.step(1.0)
    assert device.read(0x6060) == device.read(0x6061) == 1
    assert device.read(0x607A) == 0


def test_restored_defaults_count_after_the_next_reset(device):
    device.write(0x6081, 0, 111)
    device.write(0x1010, 1, 0x65766173)
    device.write(0x1011, 1, 0x64616F6C)
    assert device.read(0x6081) == 111
    device.nmt_command(NmtCommand.RESET_NODE)
    device.step(1.0)
    assert device.read(0x6081) == 20_000


def test_storing_needs_the_signature_and_a_drive_that_is_off(device):
    assert abort_of(device.write, 0x1010, 1, 1) == 0x0800_0020
    assert abort_of(device.write, 0x1011, 1, 0x65766173) == 0x0800_0020
    device.drive.start_enabled(PP)
    assert abort_of(device.write, 0x1010, 1, 0x65766173) == 0x0800_0022
    assert device.read(0x1010, 1) == 1


def test_storing_may_restart_the_node(device):
    device.dials.reboot_on_store = True
    device.dials.reboot_time = 0.5
    before = device.boot_ups
    device.write(0x6081, 0, 111)
    device.write(0x1010, 1, 0x65766173)
    assert device.nmt is NmtState.INITIALISING
    device.step(0.4)
    assert device.boot_ups == before
    device.step(0.2)
    assert device.boot_ups == before + 1
    assert device.nmt is NmtState.PRE_OPERATIONAL
    assert device.read(0x6081) == 111


# Mapping rules.


def test_a_mapping_changes_in_the_order_of_the_standard(device):
    assert abort_of(device.write, 0x1A00, 1, 0x60640020) == 0x0601_0000  # the PDO is valid
    device.write(0x1800, 1, 0x8000_0185)
    assert abort_of(device.write, 0x1A00, 1, 0x60640020) == 0x0601_0000  # sub-index 0 is not 0
    device.write(0x1A00, 0, 0)
    device.write(0x1A00, 1, 0x60640020)
    device.write(0x1A00, 2, 0x606C0020)
    device.write(0x1A00, 0, 2)
    device.write(0x1800, 1, 0x0000_0185)
    pdo = device.pdos.transmit[0]
    assert (pdo.valid, pdo.cob_id, pdo.size) == (True, 0x185, 8)


def test_an_invalid_mapping_is_refused(device):
    device.write(0x1800, 1, 0x8000_0185)
    device.write(0x1A00, 0, 0)
    assert abort_of(device.write, 0x1A00, 1, 0x50000010) == 0x0602_0000
    assert abort_of(device.write, 0x1A00, 1, 0x60410110) == 0x0609_0011
    assert abort_of(device.write, 0x1A00, 1, 0x605A0010) == 0x0604_0041  # not mappable
    assert abort_of(device.write, 0x1A00, 1, 0x60410020) == 0x0604_0041  # wrong length
    for sub, entry in ((1, 0x60640020), (2, 0x606C0020), (3, 0x60410010)):
        device.write(0x1A00, sub, entry)
    assert abort_of(device.write, 0x1A00, 0, 3) == 0x0604_0042  # 80 bits
    assert abort_of(device.write, 0x1A00, 0, 9) == 0x0604_0042  # more entries than there are
    device.write(0x1400, 1, 0x8000_0205)
    device.write(0x1600, 0, 0)
    assert abort_of(device.write, 0x1600, 1, 0x60410010) == 0x0604_0041  # read-only


def test_pdo_parameters_have_rules_too(device):
    assert abort_of(device.write, 0x1800, 1, 0x0000_0285) == 0x0609_0030  # bits 0 to 29 of a valid PDO
    assert abort_of(device.write, 0x1800, 2, 245) == 0x0609_0030
    assert abort_of(device.write, 0x1800, 3, 100) == 0x0609_0030
    device.write(0x1800, 1, 0x8000_0185)
    device.write(0x1800, 3, 100)
    assert abort_of(device.write, 0x1800, 1, 0x0000_0080) == 0x0609_0030  # SYNC's own identifier
    assert abort_of(device.write, 0x1800, 1, 0x2000_0185) == 0x0609_0030  # 29-bit identifiers


@pytest.mark.parametrize("code", [0x0601_0002, 0x0601_0000])
def test_a_fixed_mapping_refuses_with_the_code_of_the_dial(device, code):
    device.dials.fixed_mapping = code
    device.write(0x1800, 1, 0x8000_0185)
    assert abort_of(device.write, 0x1A00, 0, 0) == code


def test_packing_to_the_bit_with_dummies():
    flags = [
        Variable(0x2100, sub, f"flag {sub}", DataType.BOOLEAN, "rw", Number(0), pdo_mapping=True)
        for sub in (1, 2)
    ]
    mapping = {1: 0x21000101, 2: 0x00050003, 3: 0x21000201, 4: 0x21010010}
    objects = {
        0x2100: Object(0x2100, "flags", ObjectType.ARRAY, {v.subindex: v for v in flags}),
        0x2101: Object(
            0x2101,
            "word",
            ObjectType.VAR,
            {0: Variable(0x2101, 0, "word", DataType.INTEGER16, "rw", Number(0), pdo_mapping=True)},
        ),
        0x1400: Object(
            0x1400,
            "RPDO 1",
            ObjectType.RECORD,
            {1: Variable(0x1400, 1, "COB-ID", DataType.UNSIGNED32, "rw", Number(0x201))},
        ),
        0x1600: Object(
            0x1600,
            "mapping",
            ObjectType.ARRAY,
            {
                0: Variable(0x1600, 0, "count", DataType.UNSIGNED8, "rw", Number(4)),
                **{
                    s: Variable(0x1600, s, f"{s}", DataType.UNSIGNED32, "rw", Number(e))
                    for s, e in mapping.items()
                },
            },
        ),
    }
    device = Device(Eds("bits", objects, {}))
    pdo = device.pdos.receive[0]
    assert pdo.size == 3
    # bit 0, three bits of space, bit 4, then -2 from bit 5 on
    pdo.unpack(((-2 & 0xFFFF) << 5 | 0b1_111_1).to_bytes(3, "little"), commands=False)
    assert device.read(0x2100, 1) == 1
    assert device.read(0x2100, 2) == 1
    assert device.read(0x2101) == -2
