"""``axisbus program`` without a running machine: show, write and verify on a bus, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from axisbus import eds
from axisbus.cli.program import _Announced
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.node.network import SimulatedNetwork
from kit import command_line
from kit.command_line import Run
from kit.eds.loader import loader_eds, program

NEW = (15_400, 43_200_000)
IMAGE = program(NEW, 300)
NODE = 5


@pytest.fixture
def device(tmp_path) -> Device:
    return device_from_eds(eds.load(tmp_path / loader_eds(tmp_path)), NODE)


@pytest.fixture
def bus(device) -> Iterator[tuple[str, ...]]:
    name = next(command_line._channels)
    with SimulatedNetwork(name, [device]):
        yield ("-i", "virtual", "-c", name)


@pytest.fixture
def file(tmp_path) -> Path:
    path = tmp_path / "firmware.bin"
    path.write_bytes(IMAGE)
    return path


def as_hex(data: bytes) -> str:
    """Intel HEX with records of 16 bytes from address 0; the sum of the bytes of each record is 0 modulo 256."""
    lines = []
    for at in range(0, len(data), 16):
        record = bytes([len(data[at : at + 16]), at >> 8, at & 0xFF, 0]) + data[at : at + 16]
        lines.append(f":{record.hex()}{-sum(record) & 0xFF:02x}".upper())
    return "\n".join([*lines, ":00000001FF", ""])


def test_show_lists_what_the_node_reports(axisbus: Run, bus):
    code, out, _ = axisbus("program", "show", NODE, *bus)
    assert code == 0
    assert out.startswith("node 5: ")
    assert "  application software (1F52h)  2025-11-20 08:15:00\n" in out
    assert "  program 1 (1F51h)             runs\n" in out
    assert "  can be written over CANopen   yes\n" in out


def test_show_of_a_node_in_its_boot_loader_names_the_next_step(axisbus: Run, bus, device):
    device.dials.program.few_objects = True
    device.write(0x1F51, 1, 0)
    device.write(0x1F51, 1, 3)
    code, out, _ = axisbus("program", "show", NODE, *bus)
    assert code == 1
    assert "cleared: the node has no program" in out
    assert "error 1: it has no valid program" in out
    assert "next: axisbus program write FILE 5 ..." in out
    code, out, _ = axisbus("program", "show", NODE, *bus, "--json")
    assert json.loads(out)["programs"] == [
        {"number": 1, "control": 3, "runs": False, "identification": 0, "flash": 2}
    ]


def test_a_binary_file_is_written_and_verified(axisbus: Run, bus, device, file):
    code, out, err = axisbus("program", "write", file, NODE, *bus, "--raw")
    assert code == 0, err
    assert device.loader.program == IMAGE
    assert "node 5: its program is being replaced; do not switch it off\n" in err
    assert "node 5: program replaced, 300 bytes\n" in out
    assert "2025-11-20 08:15:00 -> 2026-03-01 12:00:00\n" in out
    code, out, _ = axisbus("program", "verify", file, NODE, *bus, "--raw")
    assert code == 0
    assert "node 5 has the program of the file: its identification (1F56h)" in out


def test_a_hex_file_is_written_as_the_bytes_that_it_describes(axisbus: Run, bus, device, file):
    file.write_text(as_hex(IMAGE))
    code, out, _ = axisbus("program", "write", file, NODE, *bus, "--json")
    assert code == 0
    assert device.loader.program == IMAGE
    found = json.loads(out)
    assert (found["bytes"], found["retries"]) == (300, 0)
    assert (found["before"]["date_time"], found["after"]["date_time"]) == (
        "2025-11-20T08:15:00",
        "2026-03-01T12:00:00",
    )


def test_another_program_is_not_verified(axisbus: Run, bus, file):
    code, out, _ = axisbus("program", "verify", file, NODE, *bus, "--raw", "--json")
    assert code == 1
    assert json.loads(out)["same"] is None


@pytest.mark.parametrize("command", ["write", "verify"])
def test_a_damaged_file_is_refused_before_the_bus_is_opened(axisbus: Run, file, command):
    file.write_text(as_hex(IMAGE)[:-12])
    code, _, err = axisbus("program", command, file, NODE, "-i", "no-such-interface", "-c", "x")
    assert code == 1
    assert "was cut off: it has no end record" in err


def test_a_binary_file_needs_raw(axisbus: Run, bus, device, file):
    code, _, err = axisbus("program", "write", file, NODE, *bus)
    assert code == 1
    assert "--raw" in err
    assert device.loader.orders == []


def test_a_node_without_the_objects_is_refused(axisbus: Run, file):
    with command_line.drives(NODE) as (_, name):
        code, _, err = axisbus("program", "write", file, NODE, "-i", "virtual", "-c", name, "--raw")
        assert code == 1
        assert "the program of node 5 cannot be written over CANopen; nothing was sent" in err
        code, out, _ = axisbus("program", "show", NODE, "-i", "virtual", "-c", name)
    assert code == 1
    assert "it reports no program" in out


def test_a_node_with_an_energised_drive_is_refused(axisbus: Run, bus, device, file):
    device.power_on()
    device.drives[0].start_enabled(1)
    code, _, err = axisbus("program", "write", file, NODE, *bus, "--raw")
    assert code == 1
    assert "node 5 is energised" in err
    assert device.loader.orders == []


def test_a_failed_write_has_exit_code_3_and_can_be_repeated(axisbus: Run, bus, device, file):
    device.dials.program.flash_error = 5
    code, _, err = axisbus("program", "write", file, NODE, *bus, "--raw")
    assert code == 3
    assert "error 5: its memory could not be written" in err
    device.dials.program.flash_error = 0
    assert axisbus("program", "write", file, NODE, *bus, "--raw").code == 0
    assert device.loader.program == IMAGE


def test_ctrl_c_says_that_the_node_has_no_program_and_how_to_continue(
    axisbus: Run, bus, device, file, monkeypatch
):
    def interrupt(_self: object, done: int, _total: int | None) -> None:
        if done:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(_Announced, "__call__", interrupt)
        code, _, err = axisbus("program", "write", file, NODE, *bus, "--raw")
    assert code == 130
    assert "node 5 cannot be used until a write has succeeded; run this command again" in err
    assert axisbus("program", "write", file, NODE, *bus, "--raw").code == 0
    assert device.loader.program == IMAGE


@pytest.mark.parametrize(
    "words",
    [("--fill", "256"), ("--fill", "x"), ("--identification", "-1"), ("--deadline", "0")],
    ids=" ".join,
)
def test_wrong_numbers_are_wrong_use(axisbus: Run, bus, file, words):
    assert axisbus("program", "write", file, NODE, *bus, *words).code == 2


def test_without_a_bus_it_is_wrong_use(axisbus: Run, file):
    assert axisbus("program", "show", NODE).code == 2
    assert axisbus("program", "write", file, NODE, "--raw").code == 2
