"""Opening an adapter: each way to get it wrong has its own sentence."""

from __future__ import annotations

import json
import socket
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import can
import pytest

from axisbus.bus.link import adapter, failures, listen, socketcan
from axisbus.bus.link.socketcan import CanInterface
from axisbus.errors import AdapterError, ArgumentError
from kit.bus.fake_bus import FakeBus


def test_an_unknown_interface_gets_its_nearest_names() -> None:
    with pytest.raises(AdapterError, match="'socketkan'") as caught:
        adapter.open_adapter("socketkan", "can0", None, {})
    assert "'socketcan'" in caught.value.remedy


@pytest.mark.parametrize("broken", [False, True])
def test_an_adapter_opened_for_listening_is_closed_in_every_case(
    monkeypatch: pytest.MonkeyPatch, broken: bool
) -> None:
    closed: list[bool] = []
    bus = SimpleNamespace(shutdown=lambda: closed.append(True))
    monkeypatch.setattr(adapter, "open_adapter", lambda *_: bus)
    with suppress(KeyError), listen.listen("pcan", "PCAN_USBBUS1", 500_000, {}):
        assert closed == []
        if broken:
            raise KeyError
    assert closed == [True]


def test_no_more_than_the_three_nearest_names_are_reported() -> None:
    with pytest.raises(AdapterError) as caught:
        adapter.check_interface("socketkan")
    assert caught.value.remedy == "did you mean 'socketcan' or 'socketcand' or 'slcan'?"


def test_a_bitrate_is_required_if_the_adapter_sets_it() -> None:
    with pytest.raises(AdapterError, match="no bitrate") as caught:
        adapter.open_adapter("pcan", "PCAN_USBBUS1", None, {})
    assert "bitrate" in caught.value.remedy


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError("pcanbasic library not found."), "PCAN-Basic"),
        (can.CanInterfaceNotImplementedError("Cannot import module"), "PCAN-Basic"),
        (PermissionError(13, "Permission denied"), "group"),
        (can.CanInitializationError("in use"), "plugged in"),
    ],
)
def test_an_error_of_the_driver_has_a_remedy(
    error: Exception, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**_: object) -> can.BusABC:
        raise error

    monkeypatch.setattr(can, "Bus", refuse)
    with pytest.raises(AdapterError, match="pcan:PCAN_USBBUS1 cannot be opened") as caught:
        adapter.open_adapter("pcan", "PCAN_USBBUS1", 500_000, {})
    assert words in caught.value.remedy
    assert str(error) in caught.value.observed


def test_an_error_reports_a_kernel_without_can(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> can.BusABC:
        raise OSError(97, "Address family not supported by protocol")

    monkeypatch.setattr(can, "Bus", refuse)
    with pytest.raises(AdapterError) as caught:
        adapter.open_adapter("socketcan", "can0", None, {}, lambda name: CanInterface(name, up=True))
    assert "modprobe" in caught.value.remedy


def test_an_option_that_the_adapter_does_not_take() -> None:
    with pytest.raises(ArgumentError, match="colour"):
        adapter.open_adapter(
            "virtual", "x", None, {"colour": "red", "channel_id": 5, "protocol": 1, "self": 1}
        )


def test_a_link_that_is_not_there() -> None:
    with pytest.raises(AdapterError, match="no CAN interface 'can7'"):
        adapter.check_link("can7", 500_000, lambda _: None)


def test_a_link_that_is_down_is_reported_with_the_line_that_brings_it_up() -> None:
    with pytest.raises(AdapterError, match="is down") as caught:
        adapter.check_link("can0", 500_000, lambda name: CanInterface(name, up=False))
    assert caught.value.remedy.startswith("sudo ip link set can0 up type can bitrate 500000")


def test_a_link_at_another_bitrate_than_configured() -> None:
    with pytest.raises(AdapterError, match="runs at 500000 bit/s, but 1000000 is configured") as caught:
        adapter.check_link("can0", 1_000_000, lambda name: CanInterface(name, up=True, bitrate=500_000))
    assert "down" in caught.value.remedy
    assert "bitrate 1000000" in caught.value.remedy


@pytest.mark.parametrize("bitrate", [None, 500_000])
def test_a_link_that_fits_or_does_not_report(bitrate: int | None) -> None:
    adapter.check_link("can0", bitrate, lambda name: CanInterface(name, up=True, bitrate=500_000))
    adapter.check_link("vcan0", bitrate, lambda name: CanInterface(name, up=True, kind="vcan"))


# As iproute2 prints it; the keys are those of its ip/iplink_can.c.
IP_ANSWER = """[{"ifindex":4,"ifname":"can0","flags":["NOARP","UP","LOWER_UP","ECHO"],"mtu":16,"qdisc":"pfifo_fast",
"operstate":"UP","txqlen":10,"link_type":"can","linkinfo":{"info_kind":"can","info_data":{"state":"ERROR-ACTIVE",
"berr_counter":{"tx":0,"rx":0},"restart_ms":100,"bittiming":{"bitrate":500000,"sample_point":"0.875"}}}}]"""


def test_the_answer_of_ip_is_read() -> None:
    assert socketcan.parse_ip(IP_ANSWER) == CanInterface("can0", True, "can", 500_000, 10, "ERROR-ACTIVE")


@pytest.mark.parametrize("text", ["", "[]", "{}", "no json", json.dumps([{}])])
def test_an_unusable_answer_of_ip_is_ignored(text: str) -> None:
    assert socketcan.parse_ip(text) is None


def test_without_ip_sysfs_gives_state_and_queue_length(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, kind, flags in (
        ("can0", "280", "0x10041"),
        ("eth0", "1", "0x1003"),
        ("can1", "280", "0x10040"),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(kind)
        (tmp_path / name / "flags").write_text(flags)
        (tmp_path / name / "tx_queue_len").write_text("10")
    monkeypatch.setattr(socketcan, "_NET", tmp_path)
    monkeypatch.setattr(socketcan, "_ip", lambda _: "")
    assert socketcan.links() == ["can0", "can1"]
    assert socketcan.link("can0") == CanInterface("can0", True, queue_length=10)
    assert socketcan.link("can1") == CanInterface("can1", False, queue_length=10)
    assert socketcan.link("eth0") is None


@pytest.mark.parametrize(
    ("script", "answer"),
    [
        ("echo answer", "answer\n"),
        ("echo answer; exit 1", "answer\n"),  # it rejects unknown options in its own way
        ("sleep 9", ""),
        (None, ""),
    ],
)
def test_values_that_ip_does_not_report_stay_unknown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str | None, answer: str
) -> None:
    program = tmp_path / "ip"
    if script is not None:
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
    monkeypatch.setattr(socketcan, "_IP_TIMEOUT", 0.2 if answer == "" else 60.0)
    monkeypatch.setattr(socketcan.shutil, "which", lambda *_, **__: str(program))
    assert socketcan._ip("can0") == answer
    monkeypatch.setattr(socketcan.shutil, "which", lambda *_, **__: None)
    assert socketcan._ip("can0") == ""


@pytest.mark.parametrize(("interface", "told"), [("pcan", True), ("socketcan", False)])
def test_a_rate_is_given_to_the_adapters_that_set_it_alone(
    interface: str, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[dict[str, object]] = []
    monkeypatch.setattr(can, "Bus", lambda **arguments: given.append(arguments))
    adapter._construct(interface, "can0", 500_000, {})
    assert [arguments.get("bitrate") for arguments in given] == [500_000 if told else None]


def test_a_listener_looks_often_enough_whether_it_is_to_continue(fake: FakeBus) -> None:
    waits: list[float] = []

    def recv(timeout: float) -> None:
        waits.append(timeout)
        time.sleep(min(timeout, 0.1))

    fake.recv = recv  # type: ignore[method-assign,assignment]
    assert list(listen.Listener(fake, "fake").frames(0.3)) == []
    assert len(waits) >= 3
    assert max(waits) <= 0.1


def test_only_of_socketcan_links_the_system_knows_the_bit_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    known = {
        "can0": CanInterface("can0", True, bitrate=500_000),
        "5": CanInterface("5", True, bitrate=250_000),
    }
    monkeypatch.setattr(socketcan, "link", known.get)
    assert listen.link_bitrate("socketcan", "can0") == 500_000
    assert listen.link_bitrate("socketcan", 5) == 250_000
    assert listen.link_bitrate("socketcan", "can7") is None
    assert listen.link_bitrate("pcan", "can0") is None


class Reluctant:
    """A socketcand server that serves a channel, and then reads nothing."""

    def __init__(self) -> None:
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self.end: socket.socket | None = None
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        self._listening.accept()[0].close()  # the look whether it is there
        self.end, _ = self._listening.accept()
        self.end.sendall(b"< hi >")
        for _ in ("< open can0 >", "< rawmode >"):
            self.end.recv(100)
            self.end.sendall(b"< ok >")

    def close(self) -> None:
        self._thread.join(5)
        for end in (self._listening, self.end):
            if end is not None:
                end.close()


def test_a_socketcand_server_that_reads_no_more_is_a_full_queue_and_gets_every_frame_whole() -> None:
    server = Reluctant()
    bus = adapter.open_adapter("socketcand", "can0", None, {"host": "127.0.0.1", "port": server.port})
    try:
        message = can.Message(arbitration_id=0x201, data=bytes(range(8)), is_extended_id=False)
        sent, full = 0, None
        while full is None and sent < 1_000_000:
            try:
                bus.send(message)
                sent += 1
            except can.CanOperationError as error:
                full = error
        assert full is not None
        assert failures.is_full(full)
        assert sent > 100
        server.end.settimeout(0.5)
        came = b""
        for _ in range(2):  # the waiting frames are read, then a frame finds room again
            with suppress(TimeoutError):
                while True:
                    came += server.end.recv(65536)
            bus.send(message)
        with suppress(TimeoutError):
            while True:
                came += server.end.recv(65536)
        assert came == came[: came.index(b">") + 1] * (sent + 2)
    finally:
        bus.shutdown()
        server.close()
