"""Settings of a module at commissioning: values that have to be given, each read back; and interrupted before each act."""

from __future__ import annotations

import math

import pytest

from axisbus.drives.gim6010.discovery.finder import ProbeScope
from axisbus.drives.gim6010.discovery.results import findings
from axisbus.drives.gim6010.node_id_preconditions import require_no_other_master
from axisbus.drives.gim6010.settings import watchdog, zero
from axisbus.drives.gim6010.settings.parameter_settings import (
    PATHS,
    ParameterBatch,
    apply,
    bit_rate,
    check,
    limits,
    shown,
    termination,
)
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import ArgumentError, LimitError, NodeError, StateError
from kit.module_search import search
from kit.plain_parameters import Cut, PlainParameters
from kit.sim.can_simple_module import Bench, gim_eds

# The test's own names, as the manual and the owners' list have them.
R120, BAUD = "can.config.enable_r120", "can.config.baud_rate"
BREAK, WATCH, WATCH_TIME = (
    "can.config.break_timeout",
    "axis0.config.enable_watchdog",
    "axis0.config.watchdog_timeout",
)
VEL, CUR = "axis0.controller.config.vel_limit", "axis0.motor.config.current_lim"
OFFSET, USED = "axis0.encoder.config.index_offset", "axis0.encoder.config.use_index_offset"


def applied(wanted, module=None, **more):
    told = []
    found = PlainParameters(module or Module(5), **more)
    apply(found, wanted, told.append)
    return found, told


# -- written settings --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wanted", "held"),
    [
        (termination(on=False), {R120: 0}),
        (termination(on=True), {R120: 1}),
        (limits(20.0, 15.0), {VEL: 20.0, CUR: 15.0}),
        (limits(None, 50.0), {VEL: 30.0, CUR: 50.0}),
        (watchdog.wanted(0.5, None), {BREAK: 500, WATCH: 0, WATCH_TIME: 0.0}),
        (watchdog.wanted(None, 0.25), {BREAK: 0, WATCH: 1, WATCH_TIME: 0.25}),
        (watchdog.wanted(65.535, 2.0), {BREAK: 65535, WATCH: 1, WATCH_TIME: 2.0}),
        (bit_rate(1_000_000), {BAUD: 1_000_000}),
    ],
    ids=lambda each: ",".join(map(str, each)) if isinstance(each, dict) else "",
)
def test_requested_settings_are_written_and_saved(wanted, held):
    found, told = applied(wanted)
    assert {path: found.module.usb_read(path) for path in held} == held
    assert len(told) == len(wanted.values)
    found.save()
    assert found.module.restarts == 1
    assert {path: found.module.usb_read(path) for path in held} == held


def test_the_watchdogs_are_switched_off_both():
    module = Module(5, break_timeout=500, enable_watchdog=1, watchdog_timeout=1.0)
    found, told = applied(watchdog.off(), module)
    assert [found.module.usb_read(path) for path in (BREAK, WATCH)] == [0, 0]
    assert told == [f"{BREAK} = 0 (was 500)", f"{WATCH} = false (was true)"]


def test_present_values_are_shown():
    assert list(shown(PlainParameters(Module(5)), PATHS["limits"])) == [f"{VEL} = 30", f"{CUR} = 45"]


def test_the_changes_of_a_setting_are_also_printed_as_steps_over_usb():
    steps = termination(on=False).over_usb
    assert f"odrv0.{R120} = False" in steps
    assert steps[-1].startswith("odrv0.save_configuration()")
    assert [step for step in watchdog.wanted(0.5, None).over_usb if BREAK in step] == [f"odrv0.{BREAK} = 500"]


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: limits(None, None), ArgumentError),
        (lambda: limits(0.0, None), ArgumentError),
        (lambda: limits(-1.0, 10.0), ArgumentError),
        (lambda: limits(math.nan, None), ArgumentError),
        (lambda: limits(math.inf, None), ArgumentError),
        (lambda: limits(1.0, 50.001), LimitError),
        (lambda: limits(1.0, 0.0), ArgumentError),
        (lambda: watchdog.wanted(None, None), ArgumentError),
        (lambda: watchdog.wanted(0.0, None), ArgumentError),
        (lambda: watchdog.wanted(0.0004, None), ArgumentError),
        (lambda: watchdog.wanted(0.0015, None), ArgumentError),
        (lambda: watchdog.wanted(65.536, None), ArgumentError),
        (lambda: watchdog.wanted(math.nan, None), ArgumentError),
        (lambda: watchdog.wanted(None, 0.0), ArgumentError),
        (lambda: watchdog.wanted(None, math.inf), ArgumentError),
        (lambda: bit_rate(300_000), ArgumentError),
        (lambda: bit_rate(0), ArgumentError),
    ],
)
def test_no_missing_setting_is_guessed(make, error):
    with pytest.raises(error) as caught:
        make()
    assert caught.value.remedy


def test_no_setting_is_written_if_one_of_several_is_invalid():
    found = PlainParameters(Module(5))
    with pytest.raises(ArgumentError):
        apply(found, ParameterBatch(((VEL, 12.0), ("vbus_voltage", 3.0))), lambda _: None)
    assert found.acts == 0
    with pytest.raises(LimitError):
        apply(found, ParameterBatch(((VEL, 12.0), (BREAK, 70000))), lambda _: None)
    assert found.acts == 0


def test_a_setting_that_the_module_does_not_accept_is_reported():
    with pytest.raises(NodeError):
        applied(termination(on=False), stubborn=[R120])


def test_an_enabled_module_is_left_alone():
    bench = Bench(Module(5))
    bench.enable()
    for wanted in (
        termination(on=False),
        limits(1.0, 1.0),
        watchdog.off(),
        bit_rate(1_000_000),
    ):
        with pytest.raises(StateError):
            applied(wanted, bench.module)
    assert bench.module.usb_read(VEL) == 30


def test_a_resistor_on_another_pin_is_not_switched():
    check(PlainParameters(Module(5)), termination(on=False))
    with pytest.raises(StateError, match="r120_gpio_num is 6"):
        check(PlainParameters(Module(5, r120_gpio_num=6)), termination(on=False))


def test_rates_that_the_manual_does_not_name_are_reported():
    assert all(bit_rate(rate).notes == () for rate in (500_000, 1_000_000))
    assert "over USB only" in bit_rate(250_000).notes[0]


# -- another bit rate ----------------------------------------------------------------------------------------------------------


def surveyed(*modules, **more):
    found = search(*modules, ask=ProbeScope.ALL, **more)
    return found.finder, findings(found.finder)


def test_a_module_that_is_alone_gets_another_rate():
    require_no_other_master(*surveyed(Module(5)), 5)


@pytest.mark.parametrize(
    "others",
    [
        [Module(6)],
        [Module(33, eds=gim_eds(), protocol=2)],
        [Module(7, heartbeat_rate_ms=0, encoder_rate_ms=0)],
    ],
    ids=["can simple", "canopen", "silent"],
)
def test_the_bit_rate_is_not_changed_if_the_module_is_not_alone(others):
    with pytest.raises(StateError, match="not alone"):
        require_no_other_master(*surveyed(Module(16), *others), 16)


def test_foreign_traffic_counts_as_another_node():
    found = surveyed(Module(16), strangers=lambda _: [(0x7E9, b"1")])
    with pytest.raises(StateError, match="7E9h"):
        require_no_other_master(*found, 16)


def found_at_rate(module, rate):
    """The node IDs that ``find`` reports on a wire of this rate."""
    module.dials.line_bitrate = rate
    return [key[1] for key in search(module, ask=ProbeScope.ALL).found]


@pytest.mark.parametrize(("cut", "at"), [(0, 500_000), (1, 500_000), (None, 1_000_000)])
def test_cut_off_at_each_step_it_is_found_at_one_rate(cut, at):
    """Before the write and before the save it is at the old one, after a start too; after the save at the new one."""
    module = Module(5, dials=ModuleFaults(line_bitrate=500_000))
    found = PlainParameters(module, cut=cut)
    try:
        apply(found, bit_rate(1_000_000), lambda _: None)
        found.save()
    except Cut:
        assert cut is not None
        module.restart()
    assert found_at_rate(module, at) == [5]
    assert found_at_rate(module, 1_500_000 - at) == []


# -- zero ------------------------------------------------------------------------------------------------------------------------


def turned(bench, turns):
    """Turn the shaft of an idle module by hand."""
    bench.module.motor.position += turns * 16384
    bench.run(0.1)


def zeroed(bench, cut=None):
    found = PlainParameters(bench.module, cut=cut)
    wanted = zero.wanted(zero.look(found), zero.look(found))
    apply(found, wanted, lambda _: None)
    found.save()
    bench.run(2.0)
    zero.verify(5, wanted.values[0][1], zero.look(found))
    return wanted


@pytest.mark.parametrize("turns", [0.0, 0.3, 0.999, 1.25, -0.4, 7.6])
@pytest.mark.parametrize("old", [{}, {"index_offset": 0.7, "use_index_offset": 1}, {"index_offset": 0.7}])
def test_after_zero_and_a_restart_the_position_is_0(turns, old):
    bench = Bench(Module(5, **old))
    bench.run(0.1)
    turned(bench, turns)
    wanted = zeroed(bench)
    assert 0.0 <= wanted.values[0][1] < 1.0
    assert bench.module.usb_read("axis0.encoder.pos_estimate") == pytest.approx(0.0, abs=1e-3)
    turned(bench, 0.25)
    assert bench.module.usb_read("axis0.encoder.pos_estimate") == pytest.approx(0.25, abs=1e-3)


@pytest.mark.parametrize("cut", [0, 1, 2])
def test_cut_off_before_the_save_the_old_zero_is_back_after_a_start(cut):
    bench = Bench(Module(5, index_offset=0.7, use_index_offset=1))
    bench.run(0.1)
    turned(bench, 0.3)
    with pytest.raises(Cut):
        zeroed(bench, cut)
    bench.module.restart()
    assert [bench.module.usb_read(path) for path in (OFFSET, USED)] == [0.7, 1]


def test_a_frozen_position_estimate_is_refused_for_the_zero():
    place = zero.RotorZero(0.0, False, 0.0, 4096, 16384)
    with pytest.raises(StateError, match="does not agree"):
        zero.wanted(place, place)


@pytest.mark.parametrize(
    ("off", "good"), [(0.0099, True), (0.0101, False), (-0.0099, True), (-0.0101, False)]
)
def test_both_estimates_of_the_zero_must_agree_within_the_tolerance(off, good):
    place = zero.RotorZero(0.7, True, 0.55 + off, 4096, 16384)
    if good:
        assert zero.wanted(place, place).values[0][1] == pytest.approx((0.25 + off) % 1.0)
    else:
        with pytest.raises(StateError, match="does not agree"):
            zero.wanted(place, place)


def test_the_zero_of_a_turning_module_is_not_set():
    one, two = (zero.RotorZero(0.0, False, count / 16384, count, 16384) for count in (4096, 4136))
    with pytest.raises(StateError, match="turns"):
        zero.wanted(one, two)
    zero.wanted(one, zero.RotorZero(0.0, False, 4126 / 16384, 4126, 16384))


@pytest.mark.parametrize(
    "place",
    [
        (math.nan, True, 0.0, 0, 16384),
        (0.0, True, math.inf, 0, 16384),
        (0.0, True, 0.0, 0, 0),
        (0.0, True, 0.0, 16384, 16384),
    ],
)
def test_an_invalid_position_is_refused(place):
    offset, used, estimate, count, cpr = place
    fields = zip(("index_offset", "use_index_offset", "cpr"), (offset, used, cpr), strict=True)
    module = Module(5, **dict(fields))
    found = PlainParameters(module)
    told = {"axis0.encoder.pos_estimate": estimate, "axis0.encoder.count_in_cpr": count}
    read = found.read
    found.read = lambda path: told.get(path, read(path))
    with pytest.raises(StateError, match="an invalid position"):
        zero.look(found)


def test_a_wrong_zero_after_the_restart_is_reported():
    with pytest.raises(NodeError, match="turned meanwhile"):
        zero.verify(5, 0.25, zero.RotorZero(0.25, True, 0.0, 4500, 16384))
    with pytest.raises(NodeError, match="0\\.1425 turns"):
        zero.verify(5, 0.25, zero.RotorZero(0.25, True, 0.1425, 4096, 16384))
    zero.verify(5, 0.999, zero.RotorZero(0.999, True, 0.001, 2, 16384))
