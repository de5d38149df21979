"""Boot-up of a simulated module that speaks CAN Simple, on a bus in real time: its report, and it commands nothing."""

from __future__ import annotations

import json
from contextlib import contextmanager
from pathlib import Path

import pytest

from axisbus.boot.report import Booted
from axisbus.boot.stop_report import Watchdog
from axisbus.bus.link.channel import Channel
from axisbus.cell import reader
from axisbus.drives.gim6010.boot.module import WATCHDOG, ModuleBoot, feed_time, watchdog_of
from axisbus.drives.gim6010.can_simple.endpoints import Firmware as Given
from axisbus.drives.gim6010.can_simple.port.port import ModulePort
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.cell import settings_of
from axisbus.drives.gim6010.settings.watchdog import Armed
from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import BootError
from kit.can_simple.mixed_cell import MODULE, write
from kit.can_simple_bus import modules_on_bus

# The permitted requests, by the manual's numbers (v2.2, 4.1.2): Get_Error, endpoints, the supply voltage.
QUESTIONS = {0x03, 0x04, 0x17}


class Bus:
    """A bus with one module, and the frames that others sent on it."""

    def __init__(self, folder: Path, module: Module, channel: Channel) -> None:
        self.module = module
        self.channel = channel
        self.cell = reader.load(write(folder, 'interface = "sim"'))
        self.sent: list[int] = []
        self.feed_within = -1.0
        module_sends = module.on_frame

        def noted(can_id: int, data: bytes, now: float, *, remote: bool = False) -> None:
            self.sent.append(can_id)
            module_sends(can_id, data, now, remote=remote)

        module.on_frame = noted  # type: ignore[method-assign]

    def boot(self, find_time: float = 1.0) -> Booted:
        port = ModulePort(settings_of(self.cell, MODULE))
        boot = ModuleBoot(self.cell, port.settings, port.objects, self.channel, find_time)
        booted = boot.run()
        self.feed_within = boot.feed_within
        assert {each & 0x1F for each in self.sent} <= QUESTIONS
        assert all(each >> 5 == MODULE for each in self.sent)
        return booted


@contextmanager
def bus(folder: Path, node_id: int = MODULE, **given):
    module = Module(node_id, **given)
    with modules_on_bus(module) as name, Channel.open("virtual", name) as channel:
        yield Bus(folder, module, channel)


def test_a_module_is_up_with_its_axis_and_nothing_was_commanded(tmp_path):
    with bus(tmp_path) as one:
        booted = one.boot()
        report = booted.report
        assert report.ok, report.error
        assert "firmware 0.5.13, by its endpoints" in report.identity
        assert "reports idle" in report.nmt
        assert not booted.found_enabled
        assert booted.parameters["m"].node == MODULE
        (axis,) = report.axes
        assert axis.modes == ("pp", "pv", "hm", "csp")  # without rated_torque no torques
        assert "power stage   idle" in report.text()
        assert report.as_json()["axes"][0]["stop_sequence"][1]["object"] == "velocity 0"
        assert not one.module.energised


def test_a_module_that_answers_no_endpoint_is_booted_with_unconfirmed_firmware(tmp_path):
    with bus(tmp_path) as one:
        one.module.dials.endpoints = False
        assert "which it does not confirm" in one.boot().report.identity


def test_a_module_that_is_in_closed_loop_is_left_in_it(tmp_path):
    with bus(tmp_path) as one:
        one.module.axis.request(8)
        booted = one.boot()
        assert booted.found_enabled
        assert any("found enabled" in text for text in booted.report.warnings)
        assert one.module.energised


def test_a_module_in_fault_is_booted_and_its_error_words_are_reported(tmp_path):
    with bus(tmp_path) as one:
        one.module.dials.motor_error = 0x20000
        report = one.boot().report
        assert report.ok
        (told,) = [text for text in report.warnings if "in fault" in text]
        assert "MOTOR_THERMISTOR_OVER_TEMP" in told
        one.module.dials.get_error_answered = False
        (told,) = [text for text in one.boot().report.warnings if "in fault" in text]
        assert "MOTOR_FAILED" in told


def test_a_module_with_another_firmware_is_refused_and_a_missing_module_is_reported(tmp_path):
    with bus(tmp_path, firmware=Firmware(0, 5, 11)) as one:
        error = one.boot().report.error
        assert isinstance(error, BootError)
        assert (error.step, error.node) == ("identity", MODULE)
        assert "it reports 0.5.11" in error.observed
        one.module.dials.dead = True
        error = one.boot(0.3).report.error
        assert isinstance(error, BootError)
        assert error.step == "heartbeat"
        assert "does not answer" in error.message


@pytest.mark.parametrize("word", ["quick_stop = 'coast'", "fault = 'ramp'", "deceleration = 5.0"])
def test_a_reaction_that_a_module_has_not_fails_the_boot_as_it_fails_the_check(tmp_path, word):
    with bus(tmp_path) as one:
        one.cell = reader.load(write(tmp_path, 'interface = "sim"', word))
        error = one.boot().report.error
        assert isinstance(error, BootError)
        assert "does not accept" in error.message


# -- armed time-outs ----


def armed(
    one: Bus, folder: Path, name: str = "endpoints_0.5.13.json", listed: Module | None = None
) -> Booted:
    """Boot with the list of endpoints of ``listed``, which is the module itself where none is given."""
    (folder / name).write_text(json.dumps((listed or one.module).json()))
    path = write(folder, 'interface = "sim"')
    path.write_text(path.read_text().replace("[axes.m]", f'endpoints = "{name}"\n[axes.m]', 1))
    one.cell = reader.load(path)
    return one.boot()


@pytest.mark.parametrize(
    ("set_to", "kind", "words"),
    [
        (
            {},
            Watchdog.NONE,
            ("break_timeout is off; the axis's watchdog is off", "no function is known to detect"),
        ),
        (
            {"break_timeout": 500},
            Watchdog.UNKNOWN,
            (
                "break_timeout is 500 ms",
                "latched CAN_BUS_FAILED",
                "the master feeds it at least every 125 ms",
            ),
        ),
        (
            {"enable_watchdog": True, "watchdog_timeout": 0.25},
            Watchdog.UNKNOWN,
            ("watchdog is armed with 0.25 s (WATCHDOG_TIMER_EXPIRED latches)", "Untested"),
        ),
        (
            {"enable_watchdog": False, "watchdog_timeout": 0.25},
            Watchdog.NONE,
            ("the axis's watchdog is off",),
        ),
    ],
)
def test_with_an_endpoint_list_boot_reports_armed_time_outs_and_writes_nothing(tmp_path, set_to, kind, words):
    with bus(tmp_path, **set_to) as one:
        before = one.module.usb_read("can.config.break_timeout")
        report = armed(one, tmp_path).report
        assert report.ok, report.error
        assert report.watchdog.kind is kind
        assert all(word in report.watchdog.text for word in words), report.watchdog.text
        assert report.watchdog.text in report.warnings
        assert one.module.usb_read("can.config.break_timeout") == before


@pytest.mark.parametrize(
    ("set_to", "within"),
    [
        ({}, 0.0),
        ({"break_timeout": 500}, 0.5),
        ({"break_timeout": 80}, 0.08),  # four scan periods
        ({"break_timeout": 500, "enable_watchdog": True, "watchdog_timeout": 0.25}, 0.25),
    ],
)
def test_the_core_gets_the_shortest_time_out_that_boot_has_read(tmp_path, set_to, within):
    with bus(tmp_path, **set_to) as one:
        assert armed(one, tmp_path).report.ok
        assert one.feed_within == pytest.approx(within)


def test_a_time_out_that_the_scan_cannot_feed_in_time_fails_the_boot(tmp_path):
    with bus(tmp_path, break_timeout=79) as one:
        error = armed(one, tmp_path).report.error
        assert isinstance(error, BootError)
        assert (error.step, error.node) == ("watchdog", MODULE)
        assert "break_timeout is 79 ms and the scan period 20 ms" in error.observed
        assert "arm at least 80 ms (axisbus gim6010 watchdog --break-timeout)" in error.remedy
        assert "scan_period of at most 19.75 ms" in error.remedy


def test_on_a_serial_line_an_armed_time_out_is_not_fed_and_reported_to_trip():
    settings = ModuleSettings(1, 20.0, 10.0, 40.0, 80.0, 0.02, relayed=True)
    found = Armed(0.05, 0.0)
    assert feed_time(found, Given(0, 5, 13), settings) == 0.0
    text = watchdog_of(found, Given(0, 5, 13), relayed=True).text
    assert "the master does not feed it" in text
    assert "watchdog --off" in text


def test_the_axis_watchdog_of_newer_firmware_is_reported_as_without_effect():
    found = watchdog_of(Armed(0.0, 0.5), Given(0, 6, 0))
    assert found.kind is Watchdog.NONE
    assert "without effect in this firmware" in found.text


def test_a_module_that_answers_one_of_two_time_outs_is_reported_so():
    found = watchdog_of(Armed(None, 0.0), Given(0, 5, 13))
    assert found.kind is Watchdog.NONE
    assert "break_timeout is not answered" in found.text
    assert "no function is known to detect" in found.text


def test_a_module_that_answers_no_endpoint_is_booted_and_its_list_reported_as_unused(tmp_path):
    with bus(tmp_path) as one:
        one.module.dials.endpoints = False
        report = armed(one, tmp_path).report
        assert report.ok
        assert report.watchdog is WATCHDOG
        assert "does not feed a time-out that it has not read" in report.watchdog.text
        assert one.feed_within == 0.0
        assert any("was not used" in text for text in report.warnings)


def test_a_list_of_another_firmware_is_not_used(tmp_path):
    with bus(tmp_path) as one:
        report = armed(one, tmp_path, listed=Module(MODULE, firmware=Firmware(0, 6, 0))).report
        assert not report.ok
        assert "does not fit" in str(report.error) or "made for firmware" in str(report.error)
        assert {each & 0x1F for each in one.sent} <= QUESTIONS


def test_a_missing_list_fails_the_boot_with_the_reason(tmp_path):
    with bus(tmp_path) as one:
        path = write(tmp_path, 'interface = "sim"')
        path.write_text(
            path.read_text().replace("[axes.m]", 'endpoints = "nowhere_0.5.13.json"\n[axes.m]', 1)
        )
        one.cell = reader.load(path)
        assert "nowhere_0.5.13.json cannot be read" in str(one.boot().report.error)
