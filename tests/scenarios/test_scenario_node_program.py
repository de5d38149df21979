"""A node's program at boot-up, on a bus: checked, replaced, refused, and a download that fails (CiA 302-2, letters G, H, I)."""

from __future__ import annotations

import json

import pytest

from axisbus import eds
from axisbus.cia301.nmt import NmtState
from axisbus.cia302.types import Letter
from axisbus.cli import boot as boot_command
from axisbus.core import canlink, late_boot
from axisbus.errors import BootError
from axisbus.machine.machine import Machine
from axisbus.machine.opening import boot
from axisbus.sim.build import device_from_eds
from kit.eds.loader import OLD, loader_eds, program
from kit.plant_probe import ENABLED
from kit.scenarios.simulated_bus import Line, enable, until

NEW = (15_400, 43_200_000)  # 2026-03-01 12:00:00, by hand
EXPECTED = "\n[nodes.1.program]\ndate_time = 2026-03-01T12:00:00\n"
DOWNLOAD = EXPECTED + 'file = "firmware.bin"\ndownload = true\ndeadline = "{deadline}"\n'
PATIENT, IMPATIENT = "60s", "2s"


def rig(folder, more: str, *without: int, data: bytes | None = None, deadline: str = PATIENT) -> Line:
    """A drive with a boot loader, and a cell file that expects a program of it."""
    (folder / "firmware.bin").write_bytes(program(NEW) if data is None else data)
    return Line(folder, eds=loader_eds(folder, *without), more=more.format(deadline=deadline))


def refused(line: Line) -> BootError:
    with pytest.raises(BootError) as caught:
        line.open()
    return caught.value


def running(line: Line) -> tuple[int, int]:
    """The date of the program that the drive runs, by its own look at it."""
    device = line.devices["x"]
    return device.read(0x1F52, 1), device.read(0x1F52, 2)


# -- correct programs ----------------------------------------------------------------------------------------------------


def test_the_expected_program_is_left_alone(tmp_path):
    as_it_is = (
        "\n[nodes.1.program]\ndate_time = 2025-11-20T08:15:00\nfile = 'firmware.bin'\ndownload = true\n"
    )
    with rig(tmp_path, as_it_is) as line:
        (report,) = boot(line.file)
        assert line.devices["x"].loader.orders == []
    assert report.ok
    assert "  program       2025-11-20 08:15:00, as expected\n" in report.text()


def test_a_program_is_replaced_once_and_the_drive_then_used(tmp_path):
    told = []
    with rig(tmp_path, DOWNLOAD) as line:
        device = line.devices["x"]
        (report,) = boot(line.file, on_program=lambda *facts: told.append(facts))
        assert report.ok, report.text()
        assert device.loader.orders == [0, 3, 1]
        assert device.loader.program == program(NEW)
        assert running(line) == NEW
        assert device.boot_ups == 2
        assert device.read(0x6065) == device.dictionary.defaults[0x6065 << 8]
        with line.open() as machine:
            assert machine.reports[0].outcome.program.found.version == NEW
            enable(machine["x"])
            machine["x"].move_relative(2.0).wait(10)
        assert device.loader.orders == [0, 3, 1]
    assert (
        "  program       2026-03-01 12:00:00: replaced, 3000 bytes; it was 2025-11-20 08:15:00\n"
        in report.text()
    )
    assert told[-1] == (1, 3000, 3000)
    assert [done for _, done, _ in told] == sorted(done for _, done, _ in told)


def test_a_slow_drive_that_ignores_sdo_and_restarts_at_every_program_command_is_loaded(tmp_path):
    with rig(tmp_path, DOWNLOAD) as line:
        dials = line.devices["x"].dials
        dials.program.stop_restarts, dials.program.deaf = True, True
        dials.program.clear_time = dials.program.flash_time = 1.2
        dials.program.restart_delay, dials.reboot_time = 0.6, 1.0
        (report,) = boot(line.file)
        assert report.ok, report.text()
        assert running(line) == NEW
        assert line.devices["x"].boot_ups == 3


def test_a_drive_without_flash_status_is_taken_at_its_date(tmp_path):
    with rig(tmp_path, DOWNLOAD, 0x1F57, 0x1F56) as line:
        (report,) = boot(line.file)
        assert report.ok, report.text()
        assert running(line) == NEW


def test_a_drive_without_a_program_date_is_identified_by_its_program_identification(tmp_path):
    """Which in the simulated drive is the sum of all bytes of its program."""
    told = sum(program(NEW))
    lines = DOWNLOAD.replace("date_time = 2026-03-01T12:00:00", f"identification = {told}")
    with rig(tmp_path, lines, 0x1F52) as line:
        (report,) = boot(line.file)
        assert report.ok, report.text()
        assert line.devices["x"].loader.orders == [0, 3, 1]
        (again,) = boot(line.file)
    assert f"  program       identification {told:08X}h, as expected\n" in again.text()
    assert again.as_json()["program"]["now"] == {"date_time": None, "identification": told}


class LostConfirmation(set[int]):
    """Loses one SDO frame after the program was cleared: the answer to the first 127 segments of the data, counted by hand.

    Before it come the answer to *clear*, 1F57h asked and answered, the transfer asked for and granted, and the segments.
    """

    def __init__(self, loader) -> None:
        super().__init__()
        self.loader = loader
        self.left = 1 + 2 + 2 + 127 + 1

    def __contains__(self, _: object) -> bool:
        if self.left and self.loader.orders[-1:] == [3]:
            self.left -= 1
            return self.left == 0
        return False


def test_a_lost_confirmation_in_mid_transfer_costs_another_transfer_from_the_beginning(tmp_path):
    with rig(tmp_path, DOWNLOAD, deadline="3s") as line:
        device = line.devices["x"]
        device.dials.sdo_lost = LostConfirmation(device.loader)
        (report,) = boot(line.file)
        assert report.ok, report.text()
        assert device.loader.orders[:4] == [0, 3, 0, 3]
        assert device.loader.orders[-1] == 1
        assert running(line) == NEW
    assert report.outcome.retries > 0


def test_two_drives_get_their_programs_at_once(tmp_path):
    (tmp_path / "firmware.bin").write_bytes(program(NEW))
    lines = DOWNLOAD.format(deadline=PATIENT)
    told = set()
    with Line(
        tmp_path, "xy", eds=loader_eds(tmp_path), more=lines + lines.replace("nodes.1", "nodes.2")
    ) as line:
        reports = boot(line.file, on_program=lambda node, done, total: told.add((node, done == total)))
        assert [report.error for report in reports] == [None, None]
        assert [device.loader.program for device in line.devices.values()] == [program(NEW)] * 2
    assert {(1, True), (2, True)} <= told


def test_a_program_is_replaced_in_virtual_time_too(tmp_path):
    line = rig(tmp_path, DOWNLOAD)
    made = device_from_eds(eds.load(tmp_path / "drive.eds"), 1)
    made.dials.program.flash_time, made.dials.program.restart_delay = 3.0, 1.0
    with Machine.simulated(line.file, {1: made}) as machine:
        assert machine.reports[0].outcome.program.replaced
        assert made.loader.orders == [0, 3, 1]
        machine["x"].enable().wait(5)
        machine["x"].move_relative(5.0).wait(5)


# -- letters -------------------------------------------------------------------------------------------------------------


def test_letter_g_a_drive_that_does_not_report_its_program(tmp_path, golden):
    with rig(tmp_path, DOWNLOAD, 0x1F52) as line:
        error = refused(line)
        assert line.devices["x"].loader.orders == []
    assert (error.letter, error.index, error.subindex) == ("G", 0x1F52, 1)
    golden("node_program_g", error)


def test_letter_h_another_program_is_not_replaced_without_leave(tmp_path, golden):
    with rig(tmp_path, EXPECTED) as line:
        error = refused(line)
        assert line.devices["x"].loader.orders == []
        assert line.devices["x"].nmt is NmtState.PRE_OPERATIONAL
        assert running(line) == OLD
    assert (error.letter, error.step, error.index, error.abort) == ("H", "program", 0x1F52, None)
    golden("node_program_h", error)


def test_letter_i_the_memory_could_not_be_written(tmp_path, golden):
    with rig(tmp_path, DOWNLOAD) as line:
        line.devices["x"].dials.program.flash_error = 5
        error = refused(line)
        assert line.devices["x"].loader.orders == [0, 3]
    assert (error.letter, error.index, error.subindex) == ("I", 0x1F57, 1)
    golden("node_program_i_flash", error)


def test_letter_i_the_data_are_no_program(tmp_path):
    with rig(tmp_path, DOWNLOAD, data=b"text") as line:
        error = refused(line)
    assert error.letter == "I"
    assert "error 3" in error.observed


@pytest.mark.parametrize(("order", "name"), [(0, "stop"), (3, "clear"), (1, "start")])
def test_letter_i_an_order_is_refused(tmp_path, golden, order, name):
    with rig(tmp_path, DOWNLOAD) as line:
        line.devices["x"].dials.program.control_refused[order] = 0x0800_0022
        error = refused(line)
    assert (error.letter, error.index, error.abort) == ("I", 0x1F51, 0x0800_0022)
    golden(f"node_program_i_{name}", error)


def test_letter_i_the_data_are_refused(tmp_path, golden):
    with rig(tmp_path, DOWNLOAD) as line:
        line.devices["x"].dials.program.data_refused = 0x0607_0012
        error = refused(line)
        assert line.devices["x"].loader.orders == [0, 3]
    assert (error.letter, error.index, error.abort) == ("I", 0x1F50, 0x0607_0012)
    golden("node_program_i_data", error)


def test_letter_i_the_drive_dies_in_mid_transfer(tmp_path, golden):
    with rig(tmp_path, DOWNLOAD, deadline=IMPATIENT) as line:
        device = line.devices["x"]

        def die(_node: int, done: int, _all: int | None) -> None:
            device.dials.dead = device.dials.dead or done > 0

        (report,) = boot(line.file, on_program=die)
        assert device.loader.orders == [0, 3]
    assert (report.error.letter, report.error.index) == ("I", 0x1F50)
    golden("node_program_i_silence", report.error, volatile=True)


def test_letter_i_the_drive_does_not_return(tmp_path, golden):
    with rig(tmp_path, DOWNLOAD, deadline=IMPATIENT) as line:
        line.devices["x"].dials.reboot_time = 30.0
        line.devices["x"].dials.program.restart_delay = 1.0  # it is found once more before it goes
        error = refused(line)
    assert error.letter == "I"
    golden("node_program_i_gone", error, volatile=True)


def test_letter_i_the_new_program_is_another_one(tmp_path, golden):
    with rig(tmp_path, DOWNLOAD, data=program((15_401, 0)), deadline=IMPATIENT) as line:
        error = refused(line)
        assert running(line) == (15_401, 0)
    assert (error.letter, error.index) == ("I", 0x1F52)
    golden("node_program_i_date", error)


def test_after_a_download_that_failed_the_next_boot_up_fixes_it(tmp_path):
    with rig(tmp_path, DOWNLOAD) as line:
        device = line.devices["x"]
        device.dials.program.flash_error = 5
        assert boot(line.file)[0].error.letter == "I"
        device.dials.program.flash_error = 0
        (report,) = boot(line.file)
        assert report.ok, report.text()
        assert running(line) == NEW


# -- nodes that may be disturbed -------------------------------------------------------------------------------------------


def test_a_drive_found_enabled_keeps_its_program_and_it_is_reported(tmp_path):
    with rig(tmp_path, DOWNLOAD) as line:
        device = line.devices["x"]
        with line.simulated_nodes.lock:
            device.power_on()
            device.drives[0].start_enabled(1)
        (report,) = boot(line.file)
        assert report.ok
        assert device.loader.orders == []
        assert line.stage() == ENABLED
    assert "2025-11-20 08:15:00, NOT 2026-03-01 12:00:00; left unchanged" in report.text()


def test_an_optional_drive_that_appears_while_the_machine_runs_keeps_its_program(
    tmp_path, monkeypatch, golden
):
    monkeypatch.setattr(canlink, "FIND_TIME", 0.8)
    monkeypatch.setattr(late_boot, "POLL_PERIOD", 0.2)
    (tmp_path / "firmware.bin").write_bytes(program(NEW))
    more = DOWNLOAD.format(deadline=PATIENT).replace("nodes.1", "nodes.2")
    with Line(tmp_path, "xy", eds=loader_eds(tmp_path), more=more) as line:
        text = line.file.read_text("utf-8")
        line.file.write_text(text.replace("[nodes.2]\n", "[nodes.2]\noptional = true\n"), "utf-8")
        late = line.devices["y"]
        late.dials.dead = True
        with line.open() as machine:
            late.dials.dead = False
            until(lambda: any(report.outcome.letter is Letter.H for report in machine.reports), 20)
        assert late.loader.orders == []
    (error,) = [report.error for report in machine.reports if report.error is not None]
    golden("node_program_h_late", error)


# -- the command line ------------------------------------------------------------------------------------------------------


def test_boot_reports_of_a_program_as_text_and_as_json(axisbus, tmp_path):
    with rig(tmp_path, EXPECTED) as line:
        told, plain = axisbus("boot", line.file), axisbus("boot", "--json", line.file)
    assert told.code == plain.code == 3
    assert "H: the node has a program other than the expected one" in told.out
    assert "  expected      2026-03-01 12:00:00\n  got           2025-11-20 08:15:00\n" in told.out
    (node,) = json.loads(plain.out)
    assert node["boot"]["letter"] == "H"
    assert node["program"] == {
        "expected": {"date_time": "2026-03-01T12:00:00", "identification": None},
        "found": {"date_time": "2025-11-20T08:15:00", "identification": None},
        "now": {"date_time": "2025-11-20T08:15:00", "identification": None},
        "replaced": False,
        "bytes": 0,
        "stage": "check",
        "flash": None,
    }


def test_boot_reports_that_a_program_is_being_downloaded(axisbus, tmp_path):
    with rig(tmp_path, DOWNLOAD) as line:
        told = axisbus("boot", line.file)
    assert told.code == 0, told.out
    assert "node 1: its program is being replaced, 3000 bytes; do not switch it off\n" in told.err


def test_an_interruption_reports_the_state_of_the_download(axisbus, tmp_path, monkeypatch):
    def interrupted(_path, _progress, on_program, **_options):
        on_program(3, 0, 3000)
        on_program(3, 889, 3000)
        raise KeyboardInterrupt

    monkeypatch.setattr(boot_command, "boot", interrupted)
    told = axisbus("boot", tmp_path / "cell.toml")
    assert told.code == 130
    assert told.err.count("node 3: its program is being replaced, 3000 bytes; do not switch it off\n") == 1
    assert (
        "(node 3): a node cannot be used after an interrupted download until a download has succeeded"
        in told.err
    )
    assert f"next: axisbus boot {tmp_path / 'cell.toml'}" in told.err
