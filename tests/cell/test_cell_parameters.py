"""From a cell file's axis and an EDS to the parameters of motion; the numbers are computed by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus import eds
from axisbus.boot.demand import demand_text
from axisbus.cell import reader
from axisbus.cell.axis_description import Drive
from axisbus.cell.parameters import axis_parameters
from axisbus.cell.writes import axis_writes, node_writes
from axisbus.cia402.modes import ModeOfOperation as Mode
from axisbus.cia402.port import ValueTransport
from axisbus.drives.plugin import DrivePlugin
from axisbus.motion.parameters import AxisParameters, DemandUse, Handshake, HoldsLoad, standstill_time
from kit import cells

BENCH = eds.loads(cells.DRIVE.encode(), "drive.eds")


def cell_with(*changes: tuple[str, str]) -> reader.CellConfig:
    cell, problems = reader.loads(cells.changed(cells.CLEAN, *changes))
    assert cell is not None
    assert problems == []
    return cell


def parameters(
    name: str, *changes: tuple[str, str], file: eds.Eds = BENCH, make: DrivePlugin | None = None
) -> AxisParameters:
    return axis_parameters(cell_with(*changes), name, file, make)


# -- units -----------------------------------------------------------------------------------------------------------


def test_velocity_and_acceleration_take_the_scale_of_position() -> None:
    units = parameters("x").units
    assert units.position.to_increments(12.5) == 12_500
    assert units.velocity.to_increments(-200.0) == -200_000
    assert units.acceleration.to_increments(2000.0) == 2_000_000
    assert (units.ratio_known, units.rated_torque, units.modulo) == (True, 2.0, None)
    assert (units.position.unit, units.velocity.unit) == ("mm", "mm/s")


def test_velocity_and_acceleration_may_have_scales_of_their_own() -> None:
    units = parameters(
        "x", ("scale = 1000", 'scale = 1000\nvelocity_scale = "60/4"\nacceleration_scale = 0.25')
    ).units
    assert units.velocity.to_increments(100.0) == 1500
    assert units.acceleration.to_increments(1000.0) == 250


def test_an_axis_turned_by_the_master_counts_backwards_everywhere() -> None:
    units = parameters("y").units
    assert units.position.to_increments(360.0) == -131_072
    assert units.position.to_units(-131_072) == 360.0
    assert units.velocity.to_increments(-360.0) == 131_072
    assert units.acceleration.to_increments(360.0) == 131_072  # a magnitude
    assert units.rated_torque == -2.0  # 1 N·m becomes -500 in 6071h, and 500 in 6077h becomes -1 N·m


def test_an_axis_turned_by_the_drive_is_not_turned_twice() -> None:
    units = parameters("y", ('invert = "master"', 'invert = "drive"')).units
    assert units.position.to_increments(360.0) == 131_072
    assert units.rated_torque == 2.0


def test_an_axis_in_increments_has_no_known_ratio_of_velocity_to_position() -> None:
    units = parameters("x", ('unit = "mm"\nscale = 1000', 'unit = "increments"')).units
    assert units.position.to_increments(7) == 7
    assert units.velocity.to_increments(7) == 7
    assert not units.ratio_known


def test_an_axis_in_increments_knows_the_ratio_when_it_is_written() -> None:
    units = parameters("x", ('unit = "mm"\nscale = 1000', 'unit = "increments"\nvelocity_scale = 0.1')).units
    assert units.velocity.to_increments(1000) == 100
    assert units.ratio_known


# -- limits, homing, times -------------------------------------------------------------------------------------------


def test_limits_defaults_and_homing_are_read_as_written() -> None:
    x = parameters("x")
    assert (x.limits.position, x.limits.velocity, x.limits.acceleration) == ((0.0, 500.0), 200.0, 2000.0)
    assert x.limits.torque == 4.0
    assert (x.defaults.velocity, x.defaults.acceleration, x.defaults.torque_slope) == (100.0, 1000.0, 10.0)
    assert (x.homing.method, x.homing.speed_switch, x.homing.timeout) == (17, 20.0, 30.0)
    assert (x.node, x.scan_period) == (1, 0.004)


def test_homing_is_required_if_position_limits_are_set() -> None:
    assert parameters("x").homing.required is True
    assert parameters("y").homing.required is False


def test_homing_required_can_be_overridden() -> None:
    assert parameters("x", ("method = 17", "method = 17\nrequired = false")).homing.required is False
    assert parameters("y", ("method = 35", "method = 35\nrequired = true")).homing.required is True


def test_standstill_is_one_percent_of_the_default_velocity_in_position_increments() -> None:
    assert parameters("x").standstill_speed == pytest.approx(1000.0)  # 1 mm/s of 100 mm/s
    assert parameters("y").standstill_speed == pytest.approx(0.9 * 131_072 / 360)  # positive, though turned


def test_standstill_as_written_wins() -> None:
    assert (
        parameters("x", ("scale = 1000", "scale = 1000\nstandstill_velocity = 0.5")).standstill_speed == 500.0
    )


def test_standstill_is_unknown_without_a_velocity_or_a_ratio() -> None:
    assert parameters("y", ("velocity = 90.0\n", "")).standstill_speed is None
    increments = ('unit = "mm"\nscale = 1000', 'unit = "increments"')
    assert parameters("x", increments).standstill_speed is None


@pytest.mark.parametrize(
    ("speed", "seconds"),
    [(0.0, 0.05), (40000.0, 0.05), (1200.0, 0.05), (600.0, 0.1), (332.0, 0.181), (24.0, 0.3)],
)
def test_an_axis_with_few_increments_is_compared_for_longer(speed: float, seconds: float) -> None:
    # 3 increments, the first motion that is not noise, at a twentieth of the highest speed
    assert standstill_time(speed) == pytest.approx(seconds, abs=0.001)


def test_the_position_window_is_in_increments() -> None:
    assert parameters("x").position_window is None
    assert parameters("y", ("modulo = 360.0", "modulo = 360.0\nposition_window = 0.1")).position_window == 36
    assert parameters("x", ("scale = 1000", "scale = 1000\nposition_window = 1e-9")).position_window == 1


def test_times_as_written_replace_the_usual_ones() -> None:
    changed = parameters(
        "x",
        ('halt_time = "2s"', 'halt_time = "0.5s"\nquick_stop_time = "250ms"'),
        (
            "scale = 1000",
            'scale = 1000\nmode_time = "3s"\ntransition_time = "5s"\nacknowledge_time = "200ms"',
        ),
    )
    assert (changed.stop_times.halt, changed.stop_times.quick_stop) == (0.5, 0.25)
    assert (changed.timing.mode, changed.timing.transition, changed.timing.acknowledge) == (3.0, 5.0, 0.2)
    usual = parameters("y")
    assert changed.stop_times.disable == usual.stop_times.disable
    assert changed.timing.settle == usual.timing.settle


def test_the_handshake_is_by_bit_12_unless_written_otherwise() -> None:
    changed = parameters("x", ("scale = 1000", 'scale = 1000\nhandshake = "on-change"'))
    assert changed.handshake is Handshake.ON_CHANGE
    assert parameters("y").handshake is Handshake.ACKNOWLEDGE


@pytest.mark.parametrize(
    ("written", "holds"),
    [('"brake"', HoldsLoad.BRAKE), ('"torque"', HoldsLoad.TORQUE), ("false", HoldsLoad.NO)],
)
def test_the_key_for_the_holder_of_a_load_is_read(written: str, holds: HoldsLoad) -> None:
    assert parameters("x", ("scale = 1000", f"scale = 1000\nholds_load = {written}")).holds_load is holds


# -- the drive -------------------------------------------------------------------------------------------------------


def test_modes_are_those_that_6502_claims() -> None:
    # 6502h = ADh: bits 0, 2, 3, 5, 7; csv and cst have their objects, but are not claimed
    assert parameters("x").modes == {
        Mode.PROFILE_POSITION,
        Mode.PROFILE_VELOCITY,
        Mode.PROFILE_TORQUE,
        Mode.HOMING,
        Mode.CYCLIC_SYNC_POSITION,
    }


def test_a_mode_that_is_claimed_is_kept_though_an_object_is_missing() -> None:
    file = eds.loads(cells.without("6087")(cells.DRIVE).encode(), "drive.eds")
    assert Mode.PROFILE_TORQUE in parameters("x", file=file).modes


def test_modes_as_written_win() -> None:
    assert parameters("y").modes == {
        Mode.PROFILE_POSITION,
        Mode.PROFILE_VELOCITY,
        Mode.HOMING,
        Mode.CYCLIC_SYNC_POSITION,
    }


def test_objects_of_the_first_axis_are_its_own_and_the_devices() -> None:
    x = parameters("x")
    assert x.has(0x6040)
    assert x.has(0x1018)
    assert x.has(0x2001)
    assert not x.has(0x6062)


def two_axes() -> eds.Eds:
    """The bench drive with a second axis that has a controlword, a statusword and a quick stop option code."""
    more = "".join(
        f"[{index}]\nParameterName={name}\nDataType={kind}\nAccessType={access}\nDefaultValue={value}\nPDOMapping=0\n"
        for index, name, kind, access, value in (
            ("6840", "Controlword 2", "0x6", "rw", "0"),
            ("6841", "Statusword 2", "0x6", "ro", "0"),
            ("685A", "Quick stop option code 2", "0x3", "rw", "6"),
            ("6D02", "Supported drive modes 2", "0x7", "ro", "1"),
        )
    )
    return eds.loads((cells.DRIVE + more).encode(), "two.eds")


def test_objects_of_the_second_axis_lie_800h_further() -> None:
    y = parameters(
        "y",
        ("[axes.y]\nnode = 2", "[axes.y]\nnode = 1\ndrive_axis = 2"),
        ('modes = ["pp", "pv", "hm", "csp"]\n', ""),
        file=two_axes(),
    )
    assert [index for index in (0x6040, 0x6041, 0x605A, 0x6502, 0x6064, 0x6840, 0x1018) if y.has(index)] == [
        0x6040,
        0x6041,
        0x605A,
        0x6502,
        0x1018,
    ]
    assert y.modes == {Mode.PROFILE_POSITION}
    assert y.quick_stop_holds  # 685Ah = 6


def test_the_first_axis_does_not_see_the_second() -> None:
    x = parameters("x", file=two_axes())
    assert not x.has(0x6840)
    assert not x.quick_stop_holds


def test_whether_a_quick_stop_holds_follows_the_word_else_the_objects_else_the_eds() -> None:
    assert not parameters("x").quick_stop_holds
    assert parameters("x", ('quick_stop = "ramp"', 'quick_stop = "ramp-hold"')).quick_stop_holds
    assert not parameters("y").quick_stop_holds  # 2 in the EDS
    assert parameters("y", ("[groups.xy]", '[axes.y.objects]\n"605A" = 5\n[groups.xy]')).quick_stop_holds
    node = ('[nodes.2]\neds = "drive.eds"\n', '[nodes.2]\neds = "drive.eds"\nobjects."605Ah" = 7\n')
    assert parameters("y", node).quick_stop_holds


def test_a_drive_of_an_unknown_make_explains_nothing() -> None:
    x = parameters("x")
    assert x.fault_objects == ()
    assert x.explain_fault(0x4310, {}) == []


def test_a_make_found_on_the_bus_wins() -> None:
    make = DrivePlugin("other", fault_objects=((0x2010, 1),), explain=lambda code, _: [f"code {code}"])
    x = parameters("x", make=make)
    assert x.fault_objects == ((0x2010, 1),)
    assert x.explain_fault(5, {}) == ["code 5"]


# -- writes ----------------------------------------------------------------------------------------------------------


def test_values_written_at_boot_are_resolved_and_scaled() -> None:
    cell = cell_with(
        ("halt_time", 'communication_error = "stopped"\nhalt_time'),
        ('"609A" = 500000', '"Position window" = 25\n"6099h:02" = 7'),
    )
    drive = Drive.of(cell.axes["x"], cell.nodes[1], BENCH)
    assert [
        (write.index, write.subindex, write.value) for write in node_writes(cell.nodes[1], drive.dictionary)
    ] == [(0x6065, 0, 4000)]
    writes = axis_writes(cell.axes["x"], drive.dictionary)
    assert {(write.index, write.subindex): write.value for write in writes} == {
        (0x6067, 0): 25,
        (0x6099, 2): 7,
        (0x605A, 0): 2,
        (0x605D, 0): 1,
        (0x1029, 1): 2,
        (0x6085, 0): 4_000_000,  # 4000 mm/s² x 1000
        (0x607C, 0): -5000,
    }
    assert [write.source for write in writes][-2:] == [
        "deceleration in [axes.x.stop]",
        "offset in [axes.x.homing]",
    ]


def test_the_option_objects_of_a_second_axis_are_800h_higher() -> None:
    cell = cell_with(
        ("[axes.y]\nnode = 2", "[axes.y]\nnode = 1\ndrive_axis = 2"),
        (
            "[groups.xy]",
            '[axes.y.stop]\nquick_stop = "ramp"\n[axes.y.objects]\n"6067" = 3\n"2002" = 1.5\n[groups.xy]',
        ),
    )
    drive = Drive.of(cell.axes["y"], cell.nodes[1], two_axes())
    assert [(write.index, write.value) for write in axis_writes(drive.axis, drive.dictionary)] == [
        (0x6867, 3),
        (0x2002, 1.5),
        (0x685A, 2),
    ]


def test_a_direction_turned_by_the_drive_is_written_into_its_polarity() -> None:
    cell = cell_with(('invert = "master"', 'invert = "drive"'))
    drive = Drive.of(cell.axes["y"], cell.nodes[2], BENCH)
    assert [(write.index, write.value) for write in axis_writes(drive.axis, drive.dictionary)] == [
        (0x607E, 0xC0)
    ]


def test_a_polarity_written_by_hand_is_left_alone() -> None:
    cell = cell_with(
        ('invert = "master"', 'invert = "drive"'),
        ("[groups.xy]", '[axes.y.objects]\n"607E" = 128\n[groups.xy]'),
    )
    drive = Drive.of(cell.axes["y"], cell.nodes[2], BENCH)
    assert [write.value for write in axis_writes(drive.axis, drive.dictionary)] == [128]
    assert drive.value(0x607E) == 128


def test_6062h_is_judged_by_the_behaviour_of_the_drive_unless_the_cell_file_decides() -> None:
    """Left out and chosen are not the same."""
    assert parameters("y").demand is DemandUse.AUTO
    for word, use in (("use", DemandUse.USE), ("ignore", DemandUse.IGNORE)):
        assert parameters("x", ("scale = 1000", f'scale = 1000\ndemand = "{word}"')).demand is use


def test_a_following_error_that_is_off_ends_the_comparison_with_6062h_and_allows_no_other_lag() -> None:
    changed = parameters("x", ("scale = 1000", 'scale = 1000\nfollowing_error = "off"'))
    usual = parameters("x")
    assert (changed.compares_demand, changed.following_error) == (False, None)
    assert usual.compares_demand
    assert changed.lag_allowed(1000.0) == usual.lag_allowed(1000.0)


def test_boot_reports_the_use_of_6062h() -> None:
    """One line for each use, and one where 6062h does not travel."""
    by_pdo = ValueTransport.SYNC_PDO
    usual = replace(parameters("x"), objects=frozenset({0x6062}))
    assert demand_text(usual, by_pdo).startswith(
        "6062h is used after it was seen to follow the set-points; until then in csp"
    )
    assert demand_text(usual, ValueTransport.NONE).startswith("6062h is not transmitted: in csp")
    ignored = replace(usual, demand=DemandUse.IGNORE, compares_demand=False, drive_following_error=2000)
    told = demand_text(ignored, by_pdo)
    assert told.startswith('6062h is not used (demand = "ignore")')
    assert 'not compared in motion (following_error = "off")' in told
    window = 2000 / abs(usual.units.position.factor)
    assert f"{window:g} {usual.units.position.unit} (6065h) for 0 s (6066h)" in told
    assert 'demand = "use"' in demand_text(replace(usual, demand=DemandUse.USE), by_pdo)
