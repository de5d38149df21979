"""``axisbus config`` with simulated drives: backup, diff, restore, and refusals without a write."""

from __future__ import annotations

import json
import threading
import time

import pytest

from axisbus.bus.sdo.access import try_upload
from axisbus.cia301.nmt import NmtCommand
from axisbus.configuration import dcf_backup, preconditions, store_parameters
from axisbus.drives import registry
from axisbus.drives.plugin import DrivePlugin
from axisbus.eds import load, loads
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from kit import command_line

# Numbers by hand: objects of the generic drive that a configuration changes, with their new values.
CHANGES = {(0x6081, 0): 123_456, (0x6083, 0): 7_654_321, (0x607D, 1): -50_000, (0x607D, 2): 50_000}


@pytest.fixture
def axisbus(monkeypatch, capsys, tmp_path) -> command_line.Run:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(store_parameters, "RESTART_DETECTION_TIME", 0.3)
    return command_line.runner(monkeypatch, capsys)


@pytest.fixture
def bus():
    """Nodes 5 and 6 on a bus of their own: the options that reach it, and the drives."""
    with command_line.drives(5, 6) as (simulated_nodes, channel):
        yield ("-i", "virtual", "-c", channel), simulated_nodes


def _set(simulated_nodes, values, device=0):
    with simulated_nodes.lock:
        for key, value in values.items():
            simulated_nodes.devices[device].write(*key, value)


def _held(simulated_nodes, keys=CHANGES, device=0):
    with simulated_nodes.lock:
        return {key: simulated_nodes.devices[device].read(*key) for key in keys}


@pytest.fixture
def saved(axisbus, bus):
    """A backup of node 5 with the changes, after which the drive has its factory values again."""
    options, simulated_nodes = bus
    factory = _held(simulated_nodes)
    _set(simulated_nodes, CHANGES)
    assert axisbus("config", "backup", "5", *options, "--eds", command_line.GENERIC, "-o", "x.dcf").code == 0
    _set(simulated_nodes, factory)
    return factory


def _objects(report, outcome):
    return {
        (each["index"], each["subindex"]): each for each in report["objects"] if each["outcome"] == outcome
    }


# -- backup ------------------------------------------------------------------------------------------------------------


def test_a_backup_contains_the_values_and_the_identity(axisbus, bus, saved, tmp_path):
    eds = load(tmp_path / "x.dcf")
    assert eds.node_id == 5
    assert {key: eds.get(*key).initial(5) for key in CHANGES} == CHANGES
    assert eds.get(0x6041).parameter_value is not None  # read-only objects are in it, too
    assert eds.info["fileinfo"]["filename"] == "x.dcf"
    assert eds.info["fileinfo"]["lasteds"] == "generic-cia402.eds"


def test_a_backup_without_an_eds_reads_the_objects_of_the_standards(axisbus, bus, tmp_path):
    options, simulated_nodes = bus
    _set(simulated_nodes, CHANGES)
    code, out, _ = axisbus("config", "backup", "5", *options)
    assert code == 0
    assert "a skeleton of the standard objects" in out
    eds = load(tmp_path / "node-5.dcf")
    assert {key: eds.get(*key).initial(5) for key in CHANGES} == CHANGES


STORED = b"""[FileInfo]
FileName=small.eds
[2000]
ParameterName=Only the maker knows it
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=7
"""


def test_the_eds_that_the_drive_stores_is_taken_before_asking_object_by_object(axisbus, tmp_path):
    text = (command_line.ROOT / "eds" / "generic-cia402.eds").read_text()
    text += "\n[1021]\nParameterName=Store EDS\nObjectType=0x7\nDataType=0x000A\nAccessType=ro\n"
    text += f"DefaultValue={STORED.hex()}\n"
    text += STORED.decode().partition("[2000]")[2].join(("\n[2000]", "\n"))
    drive = device_from_eds(loads(text.encode(), "live.eds"), 5)
    drive.write(0x2000, 0, 99)
    with SimulatedNetwork("config-stored", [drive]):
        code, out, _ = axisbus("config", "backup", "5", "-i", "virtual", "-c", "config-stored", "-o", "x.dcf")
    assert code == 0
    assert "the EDS that the drive stores (1021h)" in out
    assert load(tmp_path / "x.dcf").get(0x2000).initial(5) == 99


def test_the_default_name_has_the_serial_number(axisbus, bus, tmp_path):
    options, simulated_nodes = bus
    simulated_nodes.devices[0].dictionary.values[0x1018 << 8 | 4] = 0x4D2
    code, out, _ = axisbus("config", "backup", "5", *options, "--eds", command_line.GENERIC, "--json")
    assert code == 0
    assert json.loads(out)["serial"] == 0x4D2
    assert load(tmp_path / "node-5-serial-4D2.dcf").info["devicecomissioning"]["lss_serialnumber"] == "1234"


def test_a_node_that_restarts_meanwhile_gets_no_backup(axisbus, bus, monkeypatch, tmp_path):
    options, simulated_nodes = bus
    device, reads = simulated_nodes.devices[0], list[int]()

    def read(sdo, index, subindex):
        reads.append(index)
        if len(reads) == 50:
            device.dials.unpowered = True
            time.sleep(0.2)
            device.dials.unpowered = False
            command_line.until(lambda: device.answers_sdo)
        return try_upload(sdo, index, subindex)

    monkeypatch.setattr(dcf_backup, "try_upload", read)
    code, _, err = axisbus("config", "backup", "5", *options, "--eds", command_line.GENERIC, "-o", "y.dcf")
    assert code == 3
    assert "node 5 has restarted while its objects were read; there is no backup" in err
    assert not (tmp_path / "y.dcf").exists()


def test_a_backup_that_is_there_is_not_replaced(axisbus, bus, saved, tmp_path):
    options, _ = bus
    before = (tmp_path / "x.dcf").read_bytes()
    arguments = ("config", "backup", "6", *options, "--eds", command_line.GENERIC, "-o", "x.dcf")
    code, _, err = axisbus(*arguments)
    assert (code, (tmp_path / "x.dcf").read_bytes()) == (1, before)
    assert "x.dcf already exists; nothing was written" in err
    assert axisbus(*arguments, "--force").code == 0
    assert (tmp_path / "x.dcf").read_bytes() != before


def test_a_folder_that_is_not_there_is_made(axisbus, bus, tmp_path):
    options, _ = bus
    code, _, _ = axisbus(
        "config", "backup", "5", *options, "--eds", command_line.GENERIC, "-o", "new/deep/x.dcf"
    )
    assert code == 0
    assert (tmp_path / "new" / "deep" / "x.dcf").is_file()


def test_a_node_that_is_not_there_leaves_no_file(axisbus, bus, tmp_path):
    options, _ = bus
    code, _, err = axisbus("config", "backup", "9", *options, "--eds", command_line.GENERIC, "-o", "x.dcf")
    assert code == 3
    assert "got no answer" in err
    assert list(tmp_path.iterdir()) == []


# -- diff --------------------------------------------------------------------------------------------------------------


def test_a_file_and_the_drive(axisbus, bus, saved):
    options, _ = bus
    code, out, _ = axisbus("config", "diff", "x.dcf", "5", *options, "--json")
    found = json.loads(out)
    assert code == 1
    assert {
        (each["index"], each["subindex"]): (each["left"], each["right"]) for each in found["differences"]
    } == {key: (value, saved[key]) for key, value in CHANGES.items()}


def test_a_drive_and_its_own_eds(axisbus, bus):
    options, simulated_nodes = bus
    assert axisbus("config", "diff", "5", *options, "--eds", command_line.GENERIC).code == 0
    _set(simulated_nodes, {(0x6081, 0): 99})
    code, out, _ = axisbus("config", "diff", "5", *options, "--eds", command_line.GENERIC)
    assert code == 1
    assert "6081h:00 Profile velocity: generic-cia402.eds 100000, node 5 99" in out


def test_two_files_of_different_nodes_differ_in_values_only(axisbus, bus, saved):
    options, _ = bus
    assert axisbus("config", "backup", "6", *options, "--eds", command_line.GENERIC, "-o", "y.dcf").code == 0
    code, out, _ = axisbus("config", "diff", "x.dcf", "y.dcf", "--json")
    assert code == 1
    assert {(each["index"], each["subindex"]) for each in json.loads(out)["differences"]} == set(CHANGES)
    assert axisbus("config", "diff", "x.dcf", "x.dcf").code == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("a.dcf",), "compare FILE with FILE"),
        (("5", "6", "-i", "virtual"), "compare FILE with FILE"),
        (("5",), "give a cell file with --cell, or the bus"),
    ],
)
def test_an_invalid_comparison_is_misuse(axisbus, arguments, words):
    result = axisbus("config", "diff", *arguments)
    assert result.code == 2
    assert words in result.err


# -- restore -----------------------------------------------------------------------------------------------------------


def test_restore_writes_all_values_and_reads_them_again(axisbus, bus, saved):
    options, simulated_nodes = bus
    code, out, _ = axisbus("config", "restore", "x.dcf", "5", *options, "--json")
    report = json.loads(out)
    assert code == 0
    assert _held(simulated_nodes) == CHANGES
    restored = _objects(report, "restored")
    assert {key: (each["before"], each["after"]) for key, each in restored.items()} == {
        key: (saved[key], value) for key, value in CHANGES.items()
    }
    assert report["in_ram_only"]
    assert report["ok"]
    assert 0x6040 in {each["index"] for each in report["skipped"]}
    assert axisbus("config", "diff", "x.dcf", "5", *options).code == 0


def test_a_dry_run_writes_nothing(axisbus, bus, saved):
    options, simulated_nodes = bus
    code, out, _ = axisbus("config", "restore", "x.dcf", "5", *options, "--dry-run")
    assert code == 1
    assert "would write 6081h:00 Profile velocity = 123456" in out
    assert _held(simulated_nodes) == saved


def test_an_excluded_object_stays(axisbus, bus, saved):
    options, simulated_nodes = bus
    assert axisbus("config", "restore", "x.dcf", "5", *options, "--exclude", "607D:1").code == 0
    assert _held(simulated_nodes) == {**CHANGES, (0x607D, 1): saved[0x607D, 1]}


@pytest.fixture
def made_by_a_calibrated_make(monkeypatch, bus):
    """The generic drive as one of a make whose 607Dh:01 belongs to one specimen."""
    _, simulated_nodes = bus
    vendor = simulated_nodes.devices[0].read(0x1018, 1)
    make = DrivePlugin("Maker", vendor_id=vendor, calibration_objects=((0x607D, 1),))
    monkeypatch.setattr(registry, "plugins", lambda _: (make,))


def test_calibration_stays_as_the_drive_has_it_unless_it_is_named(
    axisbus, bus, saved, made_by_a_calibrated_make
):
    options, simulated_nodes = bus
    code, out, _ = axisbus("config", "restore", "x.dcf", "5", *options)
    assert code == 0
    assert _held(simulated_nodes) == {**CHANGES, (0x607D, 1): saved[0x607D, 1]}
    assert "skipped   607Dh:01 Min position limit" in out
    assert "it calibrates the drive: --include 607D:1 writes it" in out
    code, out, _ = axisbus("config", "diff", "x.dcf", "5", *options)
    assert code == 1  # a diff reports differences, whatever the access
    assert "607Dh:01" in out
    assert axisbus("config", "restore", "x.dcf", "5", *options, "--include", "607D:1").code == 0
    assert _held(simulated_nodes) == CHANGES


def test_pdos_are_restored_with_their_mapping(axisbus, bus):
    options, simulated_nodes = bus
    tpdo1 = {(0x1800, 1): 0x8000_0185, (0x1A00, 0): 0, (0x1A00, 1): 0x6064_0020, (0x1800, 2): 255}
    after = {(0x1A00, 0): 1, (0x1800, 1): 0x185}
    _set(simulated_nodes, tpdo1)
    _set(simulated_nodes, after)
    assert axisbus("config", "backup", "5", *options, "--eds", command_line.GENERIC, "-o", "x.dcf").code == 0
    wanted = {**tpdo1, **after}
    for other in (
        0x8000_0185,
        0x8000_0199,
    ):  # switched off; then switched off with another COB-ID, and emptied
        _set(simulated_nodes, {(0x1800, 1): 0x8000_0185})
        _set(simulated_nodes, {(0x1A00, 0): 0, (0x1800, 1): other})
        assert axisbus("config", "restore", "x.dcf", "5", *options).code == 0
        assert _held(simulated_nodes, wanted) == wanted


def test_storing_waits_through_the_restart_and_verifies_again(axisbus, bus, saved):
    options, simulated_nodes = bus
    simulated_nodes.devices[0].dials.reboot_on_store = True
    simulated_nodes.devices[0].dials.reboot_time = 0.1
    code, out, _ = axisbus("config", "restore", "x.dcf", "5", *options, "--store", "--json")
    report = json.loads(out)
    assert code == 0
    assert report["stored"]["restarted"]
    assert not report["in_ram_only"]
    _set_nmt(simulated_nodes, NmtCommand.RESET_NODE)
    command_line.until(lambda: simulated_nodes.devices[0].answers_sdo)
    assert _held(simulated_nodes) == CHANGES


def _set_nmt(simulated_nodes, command):
    with simulated_nodes.lock:
        simulated_nodes.devices[0].nmt_command(command)


def test_a_value_lost_in_a_restart_is_found_by_reading_again(axisbus, bus, saved):
    """A drive that says yes to storing, restarts, and has forgotten one object."""
    options, simulated_nodes = bus
    device = simulated_nodes.devices[0]
    device.dials.reboot_on_store = True
    whole = device.dictionary.snapshot
    device.dictionary.snapshot = lambda: {key: each for key, each in whole().items() if key >> 8 != 0x6083}
    code, out, _ = axisbus("config", "restore", "x.dcf", "5", *options, "--store")
    assert code == 1
    assert "FAILED    6083h:00" in out
    assert "it restarted, and all values were read again" in out


def test_a_drive_that_refuses_to_store_is_reported_and_keeps_its_values_in_ram(axisbus, bus, saved):
    options, simulated_nodes = bus
    simulated_nodes.devices[0].dials.sdo_write_aborts[0x1010, 1] = 0x0800_0022
    code, out, err = axisbus("config", "restore", "x.dcf", "5", *options, "--store")
    assert code == 3
    assert "1010h:01" in err
    assert "0x08000022" in err
    assert "4 restored" in out
    assert "in RAM only" in out
    assert _held(simulated_nodes) == CHANGES


def test_another_drive_is_refused_unless_it_replaces_the_one_of_the_file(axisbus, bus, saved):
    options, simulated_nodes = bus
    before = _held(simulated_nodes, device=1)
    code, _, err = axisbus("config", "restore", "x.dcf", "6", *options)
    assert (code, _held(simulated_nodes, device=1)) == (1, before)
    assert "was not taken from node 6; nothing was written" in err
    assert axisbus("config", "restore", "x.dcf", "6", *options, "--replacement").code == 0
    assert _held(simulated_nodes, device=1) == CHANGES
    with simulated_nodes.lock:
        assert simulated_nodes.devices[1].read(0x1800, 1) & 0x7FF == 0x186  # COB-IDs follow the node-ID


def test_restore_to_a_drive_with_another_serial_number_is_refused(axisbus, bus):
    options, simulated_nodes = bus
    serial = simulated_nodes.devices[0].dictionary.values
    serial[0x1018 << 8 | 4] = 1234
    assert axisbus("config", "backup", "5", *options, "--eds", command_line.GENERIC, "-o", "x.dcf").code == 0
    serial[0x1018 << 8 | 4] = 1235
    code, _, err = axisbus("config", "restore", "x.dcf", "5", *options)
    assert code == 1
    assert "serial number: the file has 0x4D2, the device 0x4D3" in err


def test_another_type_of_device_is_refused_even_as_a_replacement(axisbus, bus, saved):
    options, simulated_nodes = bus
    simulated_nodes.devices[0].dictionary.values[0x1000 << 8] = 0x0004_0192
    code, _, err = axisbus("config", "restore", "x.dcf", "5", *options, "--replacement")
    assert code == 1
    assert "is not for a device of the type of node" in err
    assert _held(simulated_nodes) == saved


def test_an_energised_drive_is_not_configured(axisbus, bus, saved):
    options, simulated_nodes = bus
    for word in (6, 7, 15):
        _set(simulated_nodes, {(0x6040, 0): word})
        time.sleep(0.05)
    command_line.until(lambda: simulated_nodes.devices[0].drives[0].statusword & 0x6F == 0x27)
    code, _, err = axisbus("config", "restore", "x.dcf", "5", *options)
    assert code == 1
    assert "node 5 is energised" in err
    assert _held(simulated_nodes) == saved


def test_an_operational_node_is_not_configured(axisbus, bus, saved, monkeypatch):
    options, simulated_nodes = bus
    monkeypatch.setattr(preconditions, "LISTEN", 20.0)  # ends with the first heartbeat
    _set(simulated_nodes, {(0x1017, 0): 50})
    _set_nmt(simulated_nodes, NmtCommand.START)
    code, _, err = axisbus("config", "restore", "x.dcf", "5", *options)
    assert code == 1
    assert "node 5 is operational: it is configured in pre-operational only; nothing was written" in err
    assert _held(simulated_nodes) == saved


def test_a_cable_pulled_during_a_restore_is_reported_and_the_next_run_completes_it(axisbus, bus, saved):
    options, simulated_nodes = bus
    device = simulated_nodes.devices[0]
    hook = [lambda _: setattr(device.dials, "sdo_silent", True)]
    device.dictionary.hooks.setdefault(0x6081 << 8, []).append(lambda value: hook and hook[0](value))
    code, _, err = axisbus("config", "restore", "x.dcf", "5", *options)
    assert code == 3
    assert "was cut off after" in err
    assert "run it again" in err
    hook.clear()
    device.dials.sdo_silent = False
    assert axisbus("config", "diff", "x.dcf", "5", *options).code == 1
    assert axisbus("config", "restore", "x.dcf", "5", *options).code == 0
    assert _held(simulated_nodes) == CHANGES


def test_an_object_that_the_drive_refuses_is_named(axisbus, bus, saved):
    options, simulated_nodes = bus
    simulated_nodes.devices[0].dials.sdo_write_aborts[0x6083, 0] = 0x0800_0021
    code, out, _ = axisbus("config", "restore", "x.dcf", "5", *options)
    assert code == 1
    assert "FAILED    6083h:00 Profile acceleration" in out
    assert "0x08000021" in out
    assert _held(simulated_nodes) == {**CHANGES, (0x6083, 0): saved[0x6083, 0]}


def test_a_concise_dcf_is_written_and_restored(axisbus, bus, tmp_path):
    options, simulated_nodes = bus
    factory = _held(simulated_nodes)
    _set(simulated_nodes, CHANGES)
    eds = ("--eds", command_line.GENERIC)
    assert axisbus("config", "backup", "5", *options, *eds, "--concise", "x.bin").code == 0
    data = (tmp_path / "x.bin").read_bytes()
    assert data[:4] == bytes((4, 0, 0, 0))  # four values differ from the defaults
    assert bytes.fromhex("81 60 00 04 00 00 00 40 e2 01 00") in data  # 6081h:00, 4 octets, 123456
    _set(simulated_nodes, factory)
    assert axisbus("config", "restore", "x.bin", "5", *options, *eds, "--concise").code == 0
    assert _held(simulated_nodes) == CHANGES


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("none.dcf", "5"), 1, "none.dcf"),
        ((command_line.GENERIC, "5"), 1, "has no parameter values, so nothing can be restored"),
        (("x.dcf", "0"), 2, "'0' is not a node"),
        (("x.dcf", "5", "--include", "6098h;0"), 2, "does not name an object"),
        (("x.dcf", "5", "--include", "5FFF:1"), 2, "gives no value for 5FFFh:01"),
        (("x.dcf", "5", "--concise"), 2, "give the node's EDS with --eds"),
    ],
)
def test_bad_input_is_one_clear_sentence_and_nothing_is_written(axisbus, bus, saved, arguments, code, words):
    options, simulated_nodes = bus
    result = axisbus("config", "restore", *arguments, *options)
    assert result.code == code
    assert words in result.err
    assert _held(simulated_nodes) == saved


def test_a_value_that_is_no_number_is_named_with_its_line(axisbus, bus, saved, tmp_path):
    options, simulated_nodes = bus
    text = (tmp_path / "x.dcf").read_text()
    (tmp_path / "x.dcf").write_text(text.replace("ParameterValue=123456", "ParameterValue=fast"))
    code, _, err = axisbus("config", "restore", "x.dcf", "5", *options)
    assert code == 1
    assert "'fast' cannot be written to 6081h:00" in err
    assert _held(simulated_nodes) == saved


def test_a_value_beyond_the_files_limits_is_refused_unless_the_drive_is_to_judge(
    axisbus, bus, saved, tmp_path
):
    options, simulated_nodes = bus
    text = (tmp_path / "x.dcf").read_text()
    (tmp_path / "x.dcf").write_text(text.replace("[6081]\n", "[6081]\nHighLimit=1000\n"))
    code, _, err = axisbus("config", "restore", "x.dcf", "5", *options)
    assert (code, _held(simulated_nodes)) == (2, saved)
    assert "6081h:00" in err
    assert "nothing was written" in err
    assert axisbus("config", "restore", "x.dcf", "5", *options, "--ignore-limits").code == 0
    assert _held(simulated_nodes) == CHANGES


def test_a_master_on_the_bus_is_not_disturbed(axisbus, bus, saved):
    options, simulated_nodes = bus
    stop = threading.Event()

    def sync():
        while not stop.wait(0.01):
            simulated_nodes.network.send_message(0x80, b"")

    thread = threading.Thread(target=sync)
    thread.start()
    code, _, err = axisbus("config", "restore", "x.dcf", "5", *options)
    stop.set()
    thread.join()
    assert code == 1
    assert "another master is on the bus of node 5; nothing was sent" in err
    assert _held(simulated_nodes) == saved


def test_a_drive_that_consumes_the_heartbeats_of_others_is_restored_as_well(axisbus, bus, saved):
    options, simulated_nodes = bus
    _set(simulated_nodes, {(0x1016, 1): 6 << 16 | 1000})
    _set(simulated_nodes, {(0x1017, 0): 20}, device=1)
    assert axisbus("config", "restore", "x.dcf", "5", *options).code == 0
    assert _held(simulated_nodes) == CHANGES
