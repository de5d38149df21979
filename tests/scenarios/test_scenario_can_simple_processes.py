"""Two CANopen axes and a CAN Simple module whose program, core or watchdog process dies, or is signalled: the module must stop."""

from __future__ import annotations

import json
import signal
import time

import pytest

from axisbus.cell import reader
from axisbus.machine.stop_external import stop_on_bus
from kit.can_simple.mixed_cell import RESTS, TURNS, Doomed, served, stay
from kit.scenarios.core_process import OWN_PROCESS

pytestmark = pytest.mark.timeout(120)


NO_PROGRAM, NO_WATCHDOG = "the core's eye on its program", "the core's check of its watchdog process"


DEATHS = {
    "the program is killed": ("program", signal.SIGKILL, NO_PROGRAM),
    "the core is killed": ("core", signal.SIGKILL, "the rescue"),
    "the core hangs": ("core", signal.SIGSTOP, "the watchdog process's patience"),
    "the watchdog process is killed": ("watchdog", signal.SIGKILL, NO_WATCHDOG),
}


@OWN_PROCESS
@pytest.mark.parametrize("whole", [True, False], ids=["whole", "without the safety net"])
@pytest.mark.parametrize("death", DEATHS)
def test_the_module_stops_whichever_process_dies(tmp_path, death, whole):
    who, number, net = DEATHS[death]
    with served(tmp_path) as plants, Doomed(tmp_path, "sleeping", "" if whole else net) as one:
        assert plants.turn()
        one.strike(who, number)
        module = plants.module.shaft
        assert plants.rest(6.0 if whole else 1.5, lambda: [module.speed]) is whole
        if whole:
            assert plants.rest(3.0)
            assert stay(lambda: not plants.module.energised, 3.0)
        else:
            assert module.speed == pytest.approx(TURNS, abs=0.1)


@OWN_PROCESS
def test_an_armed_break_timeout_stops_the_module_of_a_dead_core_without_a_watchdog_process(tmp_path):
    with served(tmp_path) as plants:
        (tmp_path / "endpoints_0.5.13.json").write_text(json.dumps(plants.module.json()))
        listed = '[nodes.16.can_simple]\nendpoints = "endpoints_0.5.13.json"\n'
        plants.file.write_text(plants.file.read_text().replace("[nodes.16.can_simple]\n", listed))
        plants.module.usb_write("can.config.break_timeout", 1000)
        with Doomed(tmp_path, "sleeping", "the rescue") as one:
            time.sleep(3.0)
            assert plants.turn()
            one.strike("core", signal.SIGKILL)
            assert plants.rest(4.0, lambda: [plants.module.shaft.speed])
            assert not plants.module.energised
            assert plants.module.axis.error == 0x00100000  # CAN_BUS_FAILED


@pytest.mark.parametrize(
    ("process", "number"),
    [
        ("thread", signal.SIGINT),
        ("thread", signal.SIGTERM),
        pytest.param("own", signal.SIGINT, marks=OWN_PROCESS),
        pytest.param("own", signal.SIGTERM, marks=OWN_PROCESS),
    ],
)
def test_a_signal_stops_it(tmp_path, process, number):
    with served(tmp_path, process) as plants, Doomed(tmp_path, "sleeping") as one:
        assert plants.turn()
        one.strike("program", number)
        assert plants.rest(6.0), one.errors
        assert one.process.wait(20) in (-signal.SIGINT, 128 + signal.SIGINT, 128 + signal.SIGTERM)
        assert not plants.module.energised


@pytest.mark.parametrize(
    ("process", "scene", "code"),
    [
        ("thread", "raising", 1),
        ("thread", "returning", 0),
        pytest.param("own", "closing", 0, marks=OWN_PROCESS),
    ],
)
def test_a_program_that_ends_leaves_the_module_at_standstill_and_off(tmp_path, process, scene, code):
    with served(tmp_path, process) as plants, Doomed(tmp_path, scene) as one:
        assert one.process.wait(30) == code, one.errors
        assert max(map(abs, plants.speeds)) < RESTS
        assert not plants.module.energised


def test_a_module_continues_after_its_program_and_core_are_killed_until_axisbus_stop(tmp_path):
    """If the core is a thread of its program, no process is left to stop the module; ``axisbus stop`` does."""
    with served(tmp_path, "thread") as plants, Doomed(tmp_path, "sleeping") as one:
        one.strike("program", signal.SIGKILL)
        time.sleep(0.7)
        assert plants.module.shaft.speed == pytest.approx(TURNS, abs=0.1)
        found = {each.axis: each for each in stop_on_bus(reader.load(plants.file))}
        assert plants.rest(1.0)
        assert all(each.ok for each in found.values()), found
        assert found["m"].text == "stands, without power"
        assert not plants.module.energised
