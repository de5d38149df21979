"""A node configured from ``dcf = "x.dcf"``: its values reach the drive, the cell file takes precedence, the rest is reported."""

from __future__ import annotations

import itertools
import os
import time
from pathlib import Path

import pytest

from axisbus import Machine, eds
from axisbus.boot.dcf import settings
from axisbus.cell import reader as cells
from axisbus.check.run import check
from axisbus.configuration import dcf_values
from axisbus.drives import registry
from axisbus.drives.plugin import GENERIC as GENERIC_MAKE
from axisbus.drives.plugin import DrivePlugin
from axisbus.eds import assign, dcf, writer
from axisbus.eds.io import reader
from axisbus.errors import BootError
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork

ROOT = Path(__file__).parents[2]
PATH = ROOT / "eds" / "generic-cia402.eds"
GENERIC = eds.load(PATH)
CHANNELS = (f"dcf-{os.getpid()}-{number}" for number in itertools.count())
CELL = """
[bus]
interface = "sim"
scan_period = "5ms"
[nodes.3]
dcf = "node3.dcf"
[axes.x]
node = 3
unit = "deg"
scale = 100
[axes.x.defaults]
velocity = 50.0
acceleration = 500.0
"""
# The values of a user with ``axisbus eds dcf --set``: objects and values by hand.
VALUES = {"6083": "4321", "6065": "1111", "6085": "222", "6098": "17", "607D:1": "-9000"}


@pytest.fixture
def cell(tmp_path):
    """A function that writes the cell file with more lines and a DCF with more values, and returns its path."""

    def write(more="", text=CELL, **values):
        reading = reader.read(PATH.read_bytes(), str(PATH))
        wanted = {**VALUES, **{key.replace("_", ":").lstrip("x"): value for key, value in values.items()}}
        parameters = [(assign.entry(reading.eds, key), value) for key, value in wanted.items()]
        made = dcf.make(reading, dcf.Settings(3, 1000), parameters)
        (tmp_path / "node3.dcf").write_bytes(writer.dumps(made))
        path = tmp_path / "cell.toml"
        path.write_text(text + more)
        return path

    return write


def _booted(path, made):
    with Machine.simulated(path, {3: made}):
        pass
    return made


def test_the_values_of_the_dcf_reach_the_drive(cell):
    made = _booted(cell(), device_from_eds(GENERIC, 3))
    assert made.read(0x6083) == 4321
    assert made.read(0x6065) == 1111
    assert made.read(0x6098) == 17
    assert made.read(0x607D, 1) == -9000


def test_values_that_the_drive_has_already_are_not_written_again(cell):
    path = cell()
    made = _booted(path, device_from_eds(GENERIC, 3))
    written = []
    made.dictionary.on_write(0x6083 << 8, written.append)
    _booted(path, made)
    assert written == []


@pytest.mark.parametrize(
    ("more", "index", "value"),
    [
        ('[nodes.3.objects]\n"6065" = 3000\n', 0x6065, 3000),
        ('[axes.x.objects]\n"Following error window" = 77\n', 0x6065, 77),
        ("[axes.x.stop]\ndeceleration = 9.0\n", 0x6085, 900),
    ],
    ids=["the node's objects", "the axis's objects", "the axis's words"],
)
def test_values_of_the_cell_file_take_precedence_over_the_dcf(cell, more, index, value):
    made = device_from_eds(GENERIC, 3)
    written = []
    made.dictionary.on_write(index << 8, written.append)
    _booted(cell(more), made)
    assert made.read(index) == value
    assert written == [value]


def test_the_heartbeat_of_the_bus_wins(cell):
    path = cell(x1017="777")
    made = device_from_eds(GENERIC, 3)
    with Machine.simulated(path, {3: made}):
        assert made.read(0x1017) == 100


def test_orders_in_a_dcf_are_not_carried_out(cell):
    made = device_from_eds(GENERIC, 3)
    written = []
    for index in (0x6040, 0x607A, 0x60FF):
        made.dictionary.on_write(index << 8, written.append)
    with Machine.simulated(cell(x607A="5000", x60FF="100"), {3: made}):
        pass
    assert 5000 not in written
    assert 100 not in written


def test_a_value_that_the_drive_refuses_ends_the_boot_with_its_name(cell):
    made = device_from_eds(GENERIC, 3)
    made.dials.sdo_write_aborts[0x6083, 0] = 0x0800_0021
    with pytest.raises(BootError) as raised:
        _booted(cell(), made)
    error = raised.value
    assert (error.node, error.index, error.subindex) == (3, 0x6083, 0)
    assert "rejects 1 value of its DCF" in error.message
    assert "0x08000021" in error.observed


def test_a_value_beyond_the_files_limits_is_found_by_check_and_refused_by_boot(cell, tmp_path):
    path = cell()
    file = tmp_path / "node3.dcf"
    file.write_text(file.read_text().replace("[6065]\n", "[6065]\nHighLimit=1000\n"))
    (problem,) = [each for each in check(path) if "beyond its own limits" in each.message]
    assert "6065h:00" in problem.observed
    with pytest.raises(BootError, match="beyond its own limits; nothing was written"):
        _booted(path, device_from_eds(GENERIC, 3))


def test_a_check_of_a_cell_with_a_dcf_finds_no_error(cell):
    assert not [each for each in check(cell()) if each.severity.value == "error"]


def test_on_a_bus_pdos_of_the_dcf_are_set_and_a_pdo_table_wins(cell, tmp_path):
    name = next(CHANNELS)
    text = CELL.replace('interface = "sim"', f'interface = "virtual"\nchannel = "{name}"')
    table = '[nodes.3.pdo.tpdo3]\nmap = ["606C"]\ntransmission = 1\n'
    path = cell(
        table,
        text,
        x1A02_0="1",
        x1A02_1="0x60640020",
        x1802_1="0x383",
        x1A03_0="1",
        x1A03_1="0x60770010",
        x1803_1="0x483",
        x1803_2="254",
    )
    with SimulatedNetwork(name, [device_from_eds(GENERIC, 3)]) as simulated_nodes:
        (made,) = simulated_nodes.devices
        with Machine.open(path):
            pass
        with simulated_nodes.lock:
            assert made.read(0x1A02, 1) == 0x606C_0020  # the table's
            assert made.read(0x1802, 2) == 1
            assert made.read(0x1A03, 1) == 0x6077_0010  # the DCF's
            assert made.read(0x1803, 2) == 254
            assert made.read(0x6083) == 4321


def test_calibration_in_a_dcf_is_not_written_at_boot(cell, monkeypatch):
    made = device_from_eds(GENERIC, 3)
    make = DrivePlugin("Maker", vendor_id=made.read(0x1018, 1), calibration_objects=((0x607D, None),))
    monkeypatch.setattr(registry, "plugins", lambda _: (make,))
    factory = made.read(0x607D, 1)
    _booted(cell(), made)
    assert made.read(0x607D, 1) == factory != -9000
    assert made.read(0x6083) == 4321


def _with_1020(path, tmp_path):
    """Let DCF and drive of ``cell`` keep date and time of the configuration; returns the EDS of the drive."""
    file = tmp_path / "node3.dcf"
    text = "\n[1020]\nParameterName=Verify configuration\nObjectType=0x8\nSubNumber=3\n"
    text += "\n[1020sub0]\nParameterName=Highest sub-index supported\nObjectType=0x7\nDataType=0x0005\n"
    text += "AccessType=const\nDefaultValue=2\n"
    for subindex, name in ((1, "Configuration date"), (2, "Configuration time")):
        text += f"\n[1020sub{subindex}]\nParameterName={name}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=0\n"
    file.write_text(file.read_text() + text)
    dates = "configuration_date = 2026-03-31\nconfiguration_time = 14:30:00\n"
    path.write_text(path.read_text().replace('"node3.dcf"\n', '"node3.dcf"\n' + dates))
    (tmp_path / "drive.eds").write_text(PATH.read_text() + text)
    return eds.load(tmp_path / "drive.eds")


def test_the_values_of_a_dcf_are_not_written_to_a_drive_that_has_the_configuration_of_its_date(
    cell, tmp_path, monkeypatch
):
    """2026-03-31 is day 15430 after 1984-01-01, 14:30 is 52200000 ms after midnight (by hand)."""
    path = cell()
    made = device_from_eds(_with_1020(path, tmp_path), 3)
    transfers = []
    for name in ("upload", "download"):
        done = getattr(made.dictionary, name)

        def counted(index, sub=0, *rest, done=done):
            transfers.append((index, sub))
            return done(index, sub, *rest)

        monkeypatch.setattr(made.dictionary, name, counted)
    of_the_dcf = {(0x6083, 0), (0x6098, 0), (0x607D, 1)}  # nothing else at boot reads these

    _booted(path, made)
    first = len(transfers)
    assert of_the_dcf <= set(transfers)
    assert (made.read(0x1020, 1), made.read(0x1020, 2)) == (15_430, 52_200_000)
    assert made.read(0x6083) == 4321

    transfers.clear()
    with Machine.simulated(path, {3: made}) as machine:
        assert "not configured again" in machine.reports[0].configured
    assert of_the_dcf.isdisjoint(transfers)
    assert len(transfers) <= first - 2 * len(VALUES)  # each is read before and after otherwise

    transfers.clear()
    path.write_text(path.read_text().replace("2026-03-31", "2026-04-01"))
    _booted(path, made)
    assert of_the_dcf <= set(transfers)
    assert made.read(0x1020, 1) == 15_431


def test_the_settings_of_a_large_dcf_are_selected_in_time(cell):
    each = "[{:04X}]\nParameterName=X\nDataType=7\nAccessType=rw\nParameterValue=1\n"
    text = PATH.read_text() + "".join(each.format(index) for index in range(0x2000, 0x6000))
    reading, path = reader.read(text.encode(), "large.dcf"), cell()
    begun = time.process_time()
    whole = dcf_values.select(reading.eds, 3, GENERIC_MAKE)
    found = settings(cells.load(path), 3, reading.eds, GENERIC_MAKE, frozenset(((0x2001, 0),)), whole)
    assert time.process_time() - begun < 5.0  # an algorithm that is not linear takes minutes
    assert [item.key for item in found.items] == [
        (0x2000, 0),
        *((index, 0) for index in range(0x2002, 0x6000)),
    ]
    assert {each.variable.index for each in found.skipped if each.why is dcf_values.SkipReason.MACHINE} == {
        0x2001
    }
