"""A bus whose modules speak their factory's protocol, or that runs at another bit rate, is not called silent."""

from __future__ import annotations

import json
import re
import struct

import can
import pytest

from axisbus.bus.link import adapter, other_rates
from axisbus.errors import AdapterError, ArgumentError
from kit import command_line
from kit.sending_device import Talker


class Modules(Talker):
    """Modules that speak CAN Simple, with the heartbeats of the factory; stores the frames sent to them."""

    def __init__(self, channel: str, *nodes: int) -> None:
        super().__init__(channel)
        self.nodes = nodes
        self.taken: list[can.Message] = []

    def _talk(self) -> None:
        life = 0
        while not self._over.is_set():
            for node in self.nodes:
                data = struct.pack("<IBBBB", 0, 1, 0, 0, life)
                self._bus.send(can.Message(arbitration_id=node << 5 | 1, data=data, is_extended_id=False))
            life = (life + 1) % 256
            self._over.wait(0.1)
            while (message := self._bus.recv(0.0)) is not None:
                self.taken.append(message)


def log(path, nodes, *, canopen=()):
    lines = []
    for number in range(20):
        stamp = 100.0 + number * 0.1
        for node in nodes:
            data = struct.pack("<IBBBB", 0, 1, 0, 0, number).hex()
            lines.append(f"({stamp:.6f}) can0 {node << 5 | 1:03X}#{data}")
        lines += [f"({stamp + 0.01:.6f}) can0 {0x700 + node:03X}#05" for node in canopen]
    path.write_text("\n".join(lines))
    return path


# -- scan and init ------------------------------------------------------------------------------------------------------------


def test_scan_names_the_protocol_of_the_modules(axisbus):
    with Modules("factory-scan", 0, 1):
        code, out, _ = axisbus("scan", "-i", "virtual", "-c", "factory-scan")
    assert code == 1
    assert "2 modules speak CAN Simple, not CANopen: node 0 (001h every" in out
    assert "axisbus gim6010 to-canopen changes its protocol" in out
    assert "check supply" not in out
    assert "next:" not in out


def test_scan_finds_canopen_nodes_beside_them(axisbus):
    with command_line.drives(3) as (_, name), Modules(name, 1):
        code, out, _ = axisbus("scan", "-i", "virtual", "-c", name)
        again = axisbus("scan", "-i", "virtual", "-c", name, "--json")
    assert code == 0
    assert "servo drive (CiA 402)" in out
    assert "1 module speaks CAN Simple, not CANopen: node 1 (021h" in out
    found = json.loads(again.out)
    assert [(each["protocol"], each["node_id"]) for each in found] == [("CANopen", 3), ("CAN Simple", 1)]
    assert found[1]["state"] == "idle"


def test_scan_skips_identifiers_that_are_commands_of_a_module(axisbus):
    """601h to 61Fh are the commands of CAN Simple's node 48, an emergency stop among them."""
    with Modules("factory-48", 48) as modules:
        axisbus("scan", "-i", "virtual", "-c", "factory-48")
    asked = {message.arbitration_id for message in modules.taken}
    assert not asked & set(range(0x600, 0x620))
    assert asked >= set(range(0x620, 0x680))


def test_init_reports_can_simple_modules_too(axisbus, tmp_path):
    with Modules("factory-init", 1):
        result = axisbus("init", "-i", "virtual", "-c", "factory-init", "--output", tmp_path / "cell.toml")
    assert result.code == 1
    assert "1 module speaks CAN Simple, not CANopen: node 1" in result.err
    assert re.search(
        r"\n  remedy:   a GIM6010-8 leaves its factory like this .*axisbus gim6010 to-canopen changes its protocol",
        result.err,
    )
    assert result.err.count("remedy:") == 1
    assert not (tmp_path / "cell.toml").exists()


# -- trace ----------------------------------------------------------------------------------------------------------------------


def test_trace_decodes_the_heartbeats_of_modules_and_reports_the_modules_at_the_end(axisbus, tmp_path):
    code, out, err = axisbus("trace", log(tmp_path / "run.log", (0, 4)))
    assert code == 0
    lines = out.splitlines()
    assert "unknown" in lines[0]
    assert "EMCY" in lines[1]
    assert "001h  bus        foreign   CAN Simple, node 0, heartbeat: idle, no axis error" in lines[-2]
    assert "081h  bus        foreign   CAN Simple, node 4, heartbeat: idle, no axis error" in lines[-1]
    assert "2 modules speak CAN Simple, not CANopen: node 0 (001h every 100 ms: idle), node 4 (081h" in err


def test_trace_leaves_emcy_and_tpdo_of_a_canopen_node_alone(axisbus, tmp_path):
    _, out, err = axisbus("trace", log(tmp_path / "run.log", (4, 12), canopen=(1,)))
    assert "foreign" not in out
    assert "CAN Simple" not in err
    assert out.count("EMCY") == out.count("TPDO1") == 20


def test_trace_knows_the_29_bit_protocol(axisbus, tmp_path):
    path = tmp_path / "run.log"
    path.write_text(
        "\n".join(
            f"({100 + number * 0.1:.6f}) can0 19200404#{(number % 8) << 5:02X}134E0000000000"
            for number in range(12)
        )
    )
    _, out, err = axisbus("trace", path, "--filter", "kind=foreign")
    assert "19200404h  bus        foreign   the 29-bit protocol of newer firmware, node 1, heartbeat" in out
    assert "1 module speaks the 29-bit protocol of newer firmware, not CANopen: node 1 (19200404h" in err


def test_a_listening_monitor_reports_can_simple_modules(axisbus, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(
        '[bus]\ninterface = "virtual"\nchannel = "factory-monitor"\nscan_period = "10ms"\n'
        '[nodes.1]\neds = "builtin:gim6010-8"\n[axes.x]\nnode = 1\nunit = "increments"\n'
    )
    with Modules("factory-monitor", 1):
        _, out, _ = axisbus("monitor", path, "--listen", "--every", "0.6", "--count", "1")
    assert "1 module speaks CAN Simple, not CANopen: node 1 (021h" in out


# -- other bit rates --------------------------------------------------------------------------------------------------------------


class Wire:
    """An adapter on a bus of one bit rate: it receives at that one, and notes how it was opened each time."""

    def __init__(self, rate: int) -> None:
        self.rate = rate
        self.opened: list[tuple[int, dict[str, object]]] = []

    def open(self, interface, channel, bitrate, options):
        if interface == "virtual":
            return can.Bus(interface="virtual", channel=channel)
        self.opened.append((bitrate, dict(options)))
        name = "factory-wire" if bitrate == self.rate else "factory-nothing"
        return can.Bus(interface="virtual", channel=name)


@pytest.fixture
def wire(monkeypatch):
    found = Wire(500_000)
    monkeypatch.setattr(adapter, "open_adapter", found.open)
    monkeypatch.setattr(other_rates, "SECONDS", 0.3)
    return found


@pytest.mark.parametrize(
    "interface", [name for name in sorted(adapter.can.interfaces.VALID_INTERFACES) if name != "virtual"]
)
def test_a_different_rate_is_tried_in_listen_only_mode_or_not_at_all(interface, wire):
    """Whatever python-can knows: each opening at another rate carries the option that silences the controller."""
    given = {"listen_only": False, "state": can.BusState.ACTIVE, "monitor": False, "operation_mode": "normal"}
    if not other_rates.possible(interface, {}):
        with pytest.raises(ArgumentError, match="no listen-only mode"):
            other_rates.find(interface, "1", 1_000_000, given)
        assert wire.opened == []
        return
    other_rates.find(interface, "1", 1_000_000, given)
    silencing = adapter.silent(interface, {})
    assert silencing
    assert [rate for rate, _ in wire.opened] == [rate for rate in other_rates.RATES if rate != 1_000_000]
    for _, options in wire.opened:
        assert {key: options[key] for key in silencing} == silencing


def test_adapters_with_a_listen_only_mode():
    having = {name for name in adapter.can.interfaces.VALID_INTERFACES if other_rates.possible(name, {})}
    assert having == {"cantact", "pcan", "seeedstudio", "slcan", "systec", "vector"}
    assert not other_rates.possible("pcan", {"timing": object()})


def test_scan_of_a_silent_bus_finds_its_rate(axisbus, wire):
    with Modules("factory-wire", 0, 1):
        code, out, err = axisbus("scan", "-i", "slcan", "-c", "/dev/ttyACM0", "-b", "1000000")
    assert code == 1
    assert wire.opened == [(1_000_000, {}), (500_000, {"listen_only": True})]
    assert "listening at other bit rates, in the adapter's listen-only mode" in err
    assert "this bus runs at 500000 bit/s: " in out
    assert "2 modules speak CAN Simple" in out
    assert "next: use this rate: -b 500000" in out


def test_scan_as_json_contains_the_bit_rate(axisbus, wire):
    with Modules("factory-wire", 1):
        _, out, _ = axisbus("scan", "-i", "slcan", "-c", "/dev/ttyACM0", "-b", "1000000", "--json")
    assert [(each["node_id"], each["bitrate"]) for each in json.loads(out)] == [(1, 500_000)]


def test_trace_of_a_silent_bus_finds_its_rate(axisbus, wire):
    with Modules("factory-wire", 1):
        _, _, err = axisbus("trace", "-i", "pcan", "-c", "PCAN_USBBUS1", "-b", "250000", "--seconds", "0.1")
    assert "this bus runs at 500000 bit/s" in err


def test_without_an_acknowledge_the_bit_rate_is_searched_before_the_error_is_reported(
    axisbus, wire, monkeypatch
):
    def refused(*_, **__):
        raise AdapterError("frame 601h was not taken")

    monkeypatch.setattr("axisbus.bus.node.discover.scan", refused)
    with Modules("factory-wire", 1):
        code, out, _ = axisbus("scan", "-i", "pcan", "-c", "PCAN_USBBUS1", "-b", "1000000")
    assert code == 1
    assert "this bus runs at 500000 bit/s" in out
    wire.rate = 0
    code, _, err = axisbus("scan", "-i", "pcan", "-c", "PCAN_USBBUS1", "-b", "1000000")
    assert code == 3
    assert "frame 601h was not taken" in err


def test_without_listen_only_mode_no_other_rate_is_tried_and_the_option_is_named(axisbus, wire):
    code, out, _ = axisbus("scan", "-i", "kvaser", "-c", "0", "-b", "1000000")
    assert code == 1
    assert len(wire.opened) == 1
    assert "a wrong bit rate destroys every frame of a working bus" in out
    assert "with -b 500000" in out


def test_socketcan_gets_the_lines_to_type(axisbus, wire):
    _, out, _ = axisbus("scan", "-i", "socketcan", "-c", "can0")
    assert len(wire.opened) == 1
    assert "sudo ip link set can0 up type can bitrate 500000 listen-only on" in out


def test_a_rate_that_an_adapter_does_not_have_is_skipped(wire, monkeypatch):
    def picky(interface, channel, bitrate, options):
        if bitrate != 125_000:
            raise AdapterError(f"no {bitrate}")
        return wire.open(interface, channel, bitrate, options)

    monkeypatch.setattr(adapter, "open_adapter", picky)
    assert other_rates.find("slcan", "1", 1_000_000, {}) is None
    monkeypatch.setattr(adapter, "open_adapter", lambda *_: picky(*_[:2], 1, {}))
    with pytest.raises(AdapterError):
        other_rates.find("slcan", "1", 1_000_000, {})
