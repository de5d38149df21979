"""``axisbus gim6010 find`` and ``errors`` on buses with simulated modules."""

from __future__ import annotations

import json

import can
import pytest

from axisbus.bus.link import adapter, other_rates
from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from kit.can_simple_bus import Bystander, modules_on_bus
from kit.sim.can_simple_module import gim_eds

EDS = gim_eds()


@pytest.fixture
def gim(axisbus):
    def call(command, channel, *more):
        return axisbus("gim6010", command, "-i", "virtual", "-c", channel, *more)

    return call


def test_the_protocol_of_each_module_and_the_next_command_are_printed(gim):
    ill = Module(16, firmware=Firmware(0, 5, 11), dials=ModuleFaults(motor_error=8))
    with modules_on_bus(Module(0), ill, Module(33, eds=EDS, protocol=2)) as channel:
        code, out, _ = gim("find", channel)
    assert code == 0
    assert "node 0: CAN Simple" in out
    assert "node ID 0 is the factory's" in out
    assert "firmware:  0.5.11" in out
    assert "error:     motor DRV_FAULT" in out
    assert "supply:    24.0 V" in out
    assert "node 33: CANopen" in out
    assert f"next: axisbus gim6010 errors -i virtual -c {channel} --node 16" in out
    assert f"next: axisbus init -i virtual -c {channel} -o cell.toml" in out


def test_as_json(gim):
    with (
        modules_on_bus(Module(9, firmware=Firmware(0, 6, 8))) as channel,
        Bystander(channel, [(0x3E8, b"1")]),
    ):
        code, out, _ = gim("find", channel, "--json")
    found = json.loads(out)
    assert code == 0
    (module,) = found["modules"]
    assert (module["protocol"], module["firmware"], module["state"]) == ("29-bit", "0.6.8 or later", None)
    assert [each["can_id"] for each in found["foreign"]] == [0x3E8]
    assert found["asked"] == "heard"


def test_a_bus_without_modules_is_distinguished_from_a_silent_one(gim):
    with modules_on_bus() as channel, Bystander(channel, [(0x3E8, b"1")]) as other:
        code, out, _ = gim("find", channel)
        assert code == 1
        assert "no module was found" in out
        assert "foreign: 1 identifier belongs to no known device" in out
        assert other.heard == []
        assert gim("find", channel, "--ask", "none").code == 1
    with modules_on_bus() as channel:
        code, out, _ = gim("find", channel, "--ask", "none")
    assert code == 1
    assert "nothing was heard: check supply" in out


def test_two_modules_of_one_id_are_something_wrong(gim):
    with modules_on_bus(Module(5, serial=1), Module(5, serial=2, heartbeat_rate_ms=90)) as channel:
        code, out, _ = gim("find", channel, "--ask", "heard")
    assert code == 1
    assert "node 5: CAN Simple, several modules" in out


def test_errors_of_a_module_in_either_protocol(gim):
    ill = Module(16, dials=ModuleFaults(motor_error=8))
    with modules_on_bus(ill, Module(33, eds=EDS, protocol=2)) as channel:
        code, out, _ = gim("errors", channel, "--node", 16)
        assert code == 1
        assert "motor: 00000008h\n    motor DRV_FAULT" in out
        assert "encoder: 00000000h, no error" in out
        code, out, _ = gim("errors", channel, "--node", 33)
        assert code == 0
        assert "node 33: CANopen" in out
        assert "no error" in out
        (told,) = json.loads(gim("errors", channel, "--node", 16, "--json").out)
        assert told["error_words"]["motor"] == 8
        code, _, err = gim("errors", channel, "--node", 7)
        assert code == 3
        assert f"axisbus gim6010 find -i virtual -c {channel}" in err


def test_words_are_explained_without_a_bus(axisbus):
    code, out, _ = axisbus("gim6010", "errors", "--word", "axis=0x100000")
    assert code == 0
    assert "CAN_BUS_FAILED" in out
    assert axisbus("gim6010", "errors", "--word", "axis=many").code == 2
    assert axisbus("gim6010", "errors", "-i", "virtual", "-c", "x").code == 2
    assert axisbus("gim6010", "find").code == 2


def test_without_an_acknowledge_no_second_frame_is_sent(gim, monkeypatch):
    """The controller reports it by an error frame, as in Linux."""

    def complain(message):
        return [
            can.Message(arbitration_id=0x20, data=bytes(8), is_error_frame=True, is_extended_id=False)
        ] * (not message.is_error_frame)

    monkeypatch.setattr("axisbus.bus.link.controller.LINUX_CLASSES", frozenset({"virtual"}))
    with modules_on_bus() as channel, Bystander(channel, answer=complain) as wire:
        code, out, _ = gim("find", channel)
    assert code == 1
    assert len(wire.heard) == 1
    assert "the requests were ended at the first sign that no node acknowledges" in out


# -- bit rates ----------------------------------------------------------------------------------------------------------------


class Wire:
    """An adapter on a bus of one bit rate; notes how it was opened each time."""

    def __init__(self, channel: str, rate: int) -> None:
        self.channel, self.rate = channel, rate
        self.opened: list[tuple[int, bool]] = []

    def open(self, interface, channel, bitrate, options):
        self.opened.append((bitrate, bool(options.get("listen_only"))))
        name = self.channel if bitrate == self.rate else f"{self.channel}-nothing"
        return can.Bus(interface="virtual", channel=name)


def test_another_bit_rate_is_found_by_listening_without_a_request(axisbus, monkeypatch):
    monkeypatch.setattr(other_rates, "SECONDS", 0.3)
    with modules_on_bus(Module(5)) as channel, Bystander(channel) as other:
        wire = Wire(channel, 500_000)
        monkeypatch.setattr(adapter, "open_adapter", wire.open)
        code, out, _ = axisbus("gim6010", "find", "-i", "slcan", "-c", "/dev/x", "-b", "1000000")
        assert code == 1
        assert "this bus runs at 500000 bit/s" in out
        assert "use this rate: -b 500000" in out
        assert wire.opened == [(1_000_000, True), (500_000, True)]
        wire.opened.clear()
        code, out, _ = axisbus(
            "gim6010", "find", "-i", "slcan", "-c", "/dev/x", "-b", "500000", "--ask", "none"
        )
        assert (code, "node 5: CAN Simple" in out) == (0, True)
        assert wire.opened == [(500_000, True), (500_000, False)]
    beats = {5 << 5 | 1, 5 << 5 | 9}
    assert {each.arbitration_id for each in other.heard} <= beats


def test_an_adapter_without_a_listen_only_mode_tries_one_rate_and_reports_so(axisbus, monkeypatch):
    with modules_on_bus(Module(5)) as channel:
        wire = Wire(channel, 500_000)
        monkeypatch.setattr(adapter, "open_adapter", wire.open)
        code, out, _ = axisbus("gim6010", "find", "-i", "ixxat", "-c", "0", "-b", "1000000", "--ask", "none")
    assert code == 1
    assert wire.opened == [(1_000_000, False)]
    assert "python-can cannot open this adapter in listen-only mode" in out


def test_the_bit_rate_is_required_if_the_adapter_sets_it(axisbus):
    code, _, err = axisbus("gim6010", "find", "-i", "slcan", "-c", "/dev/x")
    assert code == 2
    assert "add -b" in err
