"""``axisbus gim6010 params`` on simulated modules: from the list of endpoints to a backup that is brought back."""

from __future__ import annotations

import json

import pytest

from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from kit import command_line
from kit.can_simple_bus import modules_on_bus

LIMIT, GAIN, KT = (
    "axis0.controller.config.vel_limit",
    "axis0.controller.config.pos_gain",
    "axis0.motor.config.torque_constant",
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for version in ("0.5.13", "0.6.0"):
        module = Module(5, firmware=Firmware.read(version))
        (tmp_path / f"endpoints_{version}.json").write_text(json.dumps(module.json()), "utf-8")
    return tmp_path


@pytest.fixture
def params(monkeypatch, capsys, folder):
    run = command_line.runner(monkeypatch, capsys)

    def call(command, *arguments, channel="nobody", node=5, listed="endpoints_0.5.13.json"):
        bus = ("-i", "virtual", "-c", channel, "--node", node, "--list", listed)
        return run("gim6010", "params", command, *arguments, *bus)

    return call


def test_values_are_read_and_written_and_the_output_names_ram_or_flash(params):
    module = Module(5, dials=ModuleFaults(restart_time=0.3))
    with modules_on_bus(module) as channel:
        code, out, _ = params("get", LIMIT, "odrv0.vbus_voltage", channel=channel)
        assert (code, out) == (0, f"{LIMIT} = 30\nodrv0.vbus_voltage = 24\n")
        assert json.loads(params("get", LIMIT, "--json", channel=channel).out) == {LIMIT: 30}
        code, out, _ = params("set", f"{LIMIT}=12.5", f"{KT}=0.1", channel=channel)
        assert code == 0
        assert f"{LIMIT} = 12.5 (was 30)" in out
        assert f"note: {KT} is the factor for every torque" in out
        assert "in RAM only" in out
        assert module.restarts == 0
        code, out, _ = params("set", f"{GAIN}=7", "--save", channel=channel)
        assert code == 0
        assert "saved: module 32323334h restarted" in out
    assert module.restarts == 1
    assert [module.usb_read(path) for path in (LIMIT, GAIN)] == [12.5, 7]


def test_no_value_is_written_if_one_of_several_is_invalid(params):
    module = Module(5)
    with modules_on_bus(module) as channel:
        for wrong, word in (
            ("axis0.requested_state=8", "not written here"),
            ("axis0.config.can.node_id=7", "set-id"),
            (f"{GAIN}=fast", "not a value of type float"),
            ("can.config.break_timeout=70000", "beyond the range of uint16"),
            ("axis0.none=1", "there is no parameter"),
            ("vbus_voltage", "write PATH=VALUE"),
            ("vbus_voltage=3", "cannot be written"),
        ):
            code, _, err = params("set", f"{LIMIT}=12.5", wrong, channel=channel)
            assert code == 2, wrong
            assert word in err
    assert module.usb_read(LIMIT) == 30
    assert not module.energised


def test_a_value_that_is_not_taken_leaves_the_ones_before_it_in_ram_with_their_notes(params):
    module = Module(5, dials=ModuleFaults(protocol_by_usb=True))
    with modules_on_bus(module) as channel:
        code, out, err = params("set", f"{KT}=0.1", "can.config.protocol=2", f"{LIMIT}=12.5", channel=channel)
    assert code == 3
    assert "can.config.protocol holds 1 after 2 was written" in err
    assert "1 of 3 were written into RAM before the error" in err
    assert f"note: {KT} is the factor for every torque" in out
    assert module.usb_read(KT) == pytest.approx(0.1)
    assert module.usb_read(LIMIT) == 30


def test_a_list_is_refused_that_does_not_fit(params, folder):
    module = Module(5, firmware=Firmware(0, 6, 0))
    with modules_on_bus(module) as channel:
        code, _, err = params("get", LIMIT, channel=channel)
        assert code == 2
        assert "made for firmware 0.5.13, and the module has 0.6.0" in err
        assert params("get", LIMIT, channel=channel, listed="endpoints_0.6.0.json").code == 0
        (folder / "list.json").write_text((folder / "endpoints_0.6.0.json").read_text("utf-8"), "utf-8")
        code, _, err = params("get", LIMIT, channel=channel, listed="list.json")
        assert (code, "--made-for" in err) == (2, True)
        assert params("get", LIMIT, "--made-for", "0.6.0", channel=channel, listed="list.json").code == 0
        code, _, err = params("get", LIMIT, "--made-for", "0.6.0", channel=channel)
        assert (code, "according to its name" in err) == (2, True)


def test_invalid_arguments_are_refused_before_the_bus_is_opened(params):
    assert params("get", LIMIT, listed="missing.json").code == 1
    code, _, _err = params("get", LIMIT, node=64)
    assert code == 2
    assert params("get").code == 2


def test_a_module_that_answers_no_endpoint(params):
    with modules_on_bus(Module(5, dials=ModuleFaults(endpoints=False))) as channel:
        code, _, err = params("dump", channel=channel)
    assert code == 3
    assert "does not answer" in err
    assert "over USB" in err


def test_dump_reads_all_endpoints_that_can_be_read(params):
    with modules_on_bus(Module(5)) as channel:
        code, out, _ = params("dump", channel=channel)
        found = json.loads(params("dump", "can", "--json", channel=channel).out)
        assert params("dump", "wheel", channel=channel).code == 2
    assert code == 0
    assert "axis0.motor.config.current_lim = 45" in out
    assert "axis0.motor.error" not in out
    assert found["can.config.baud_rate"] == 500_000
    assert all(path.startswith("can.") for path in found)


def test_a_backup_is_restored_to_its_module_and_to_no_other(params, folder):
    module, other = Module(5, serial=0xA1), Module(6, serial=0xB2)
    with modules_on_bus(module, other) as channel:
        code, out, _ = params("backup", channel=channel)
        assert code == 0
        file = folder / "gim6010-000000A1-0.5.13.json"
        assert file.exists()
        assert params("backup", channel=channel).code == 1  # it is there already
        assert params("diff", file, channel=channel).code == 0
        params("set", f"{LIMIT}=5", f"{KT}=0.2", channel=channel)
        code, out, _ = params("diff", file, channel=channel)
        assert code == 1
        assert f"{LIMIT}: 30 -> 5" in out
        assert "protected: is the factor for every torque" in out

        code, out, _ = params("restore", file, "--dry-run", channel=channel)
        assert f"would write {LIMIT} = 30" in out
        assert module.usb_read(LIMIT) == 5
        code, out, _ = params("restore", file, channel=channel)
        assert code == 0
        assert f"left: {KT}: protected" in out
        assert module.usb_read(LIMIT) == 30
        assert module.usb_read(KT) == pytest.approx(0.2)
        code, out, _ = params("restore", file, "--include", KT, "--save", channel=channel)
        assert code == 0
        assert module.usb_read(KT) == pytest.approx(0.097)
        assert module.restarts == 1

        code, _, err = params("restore", file, channel=channel, node=6)
        assert code == 1
        assert "is of the module 000000A1h, and this one is 000000B2h" in err
        params("set", f"{LIMIT}=5", channel=channel, node=6)
        code, out, _ = params("restore", file, "--other-module", channel=channel, node=6)
        assert code == 0
        assert other.usb_read(LIMIT) == 30
        assert other.node_id == 6
        assert "axis0.config.can.node_id: it is changed by set-id alone" in out


def test_two_files_are_compared_without_a_bus(params, folder, monkeypatch, capsys):
    with modules_on_bus(Module(5)) as channel:
        params("backup", "-o", "one.json", channel=channel)
        params("set", f"{LIMIT}=5", channel=channel)
        params("backup", "-o", "other.json", channel=channel)
    run = command_line.runner(monkeypatch, capsys)
    code, out, _ = run("gim6010", "params", "diff", "one.json", "other.json")
    assert (code, out) == (1, f"{LIMIT}: 30 -> 5\n1 setting differs\n")
    assert run("gim6010", "params", "diff", "one.json", "one.json").code == 0
    assert params("diff", "one.json", "other.json").code == 2
    (folder / "broken.json").write_text("{", "utf-8")
    assert run("gim6010", "params", "diff", "one.json", "broken.json").code == 2


def test_an_enabled_module_is_left_alone(params):
    module = Module(5)
    module.on_frame(5 << 5 | 7, (8).to_bytes(8, "little"), 0.0)
    with modules_on_bus(module) as channel:
        code, _, err = params("set", f"{LIMIT}=5", channel=channel)
    assert code == 1
    assert "closed loop" in err
    assert module.usb_read(LIMIT) == 30
