"""Modes, limits, stop reactions and missing keys; each cell has exactly one defect, and the numbers are calculated by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from kit import cells

NO_MODES = ('modes = ["pp", "pv", "hm", "csp"]\n', "")

# -- modes -----------------------------------------------------------------------------------------------------------


def test_check_notes_the_modes_that_each_axis_can_run(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.without("6071", "6087"))
    told = cells.note(path, "axis x can run")
    assert told.message == "axis x can run pp, pv, hm, csp"
    assert told.observed.startswith("6502h lists tq, but 6071h is missing; ")
    assert told.line == cells.line_of(path, "[axes.x]")


@pytest.mark.parametrize(
    ("change", "marker", "reason"),
    [
        (("modulo = 360.0", "modulo = 360.0\n#"), 'modes = ["pp"', "modes in [axes.y]"),
        (NO_MODES, "method = 35", "method in [axes.y.homing]"),
    ],
)
def test_the_objects_of_a_required_mode_are_reported_when_missing(
    tmp_path: Path, change: tuple[str, str], marker: str, reason: str
) -> None:
    without_x = ("method = 17\nspeed_switch = 20.0\nspeed_zero = 2.0\nacceleration = 500.0\n", "")
    path = cells.write(tmp_path, change, without_x, ('"609A" = 500000', ""), eds=cells.without("6098"))
    errors = [each for each in cells.serious(path) if each.severity.value == "error"]
    assert [each.line for each in errors] == [cells.line_of(path, marker)]
    assert f"axis y: hm (homing) is needed by {reason}, but cannot be run" in errors[0].message
    assert "lacks 6098h (homing method)" in errors[0].observed
    assert "home will not be available" in errors[0].remedy


def test_default_velocities_require_a_mode_that_moves(tmp_path: Path) -> None:
    """Where csp is left, they serve its trajectories, and only move_absolute and the like are missed."""
    for gone, severity in ((("6083",), "warning"), (("6083", "6064"), "error")):
        path = cells.write(tmp_path, NO_MODES, eds=cells.without(*gone))
        told = [each for each in cells.serious(path) if "is needed by velocity in" in each.message]
        assert [each.line for each in told] == [
            cells.line_of(path, "velocity = 100.0"),
            cells.line_of(path, "velocity = 90.0"),
        ]
        assert {each.severity.value for each in told} == {severity}
        assert "lacks 6083h (profile acceleration)" in told[0].observed


@pytest.mark.parametrize(
    ("claimed", "gone", "runs", "doubt"),
    [
        ("0xAD", (), "pp, pv, tq, hm, csp", "objects of csv, cst are present, but 6502h does not list them"),
        ("0x2D", (), "pp, pv, tq, hm", "objects of csp, csv, cst are present, but 6502h does not list them"),
        ("0xAD", ("6087",), "pp, pv, tq, hm, csp", "6502h does not list"),
        ("0xAD", ("6098",), "pp, pv, tq, csp", "6502h lists hm, but 6098h is missing"),
        ("0xED", (), "pp, pv, tq, hm, csp", "6502h lists ip, but 60C1h is missing"),
        ("", (), "pp, pv, tq, hm, csp, csv, cst", "6502h has no value: by the objects alone"),
    ],
)
def test_modes_are_those_that_objects_and_6502h_show(
    tmp_path: Path, claimed: str, gone: tuple[str, ...], runs: str, doubt: str
) -> None:
    def file(text: str) -> str:
        return cells.without(*gone)(text).replace("DefaultValue=0xAD", f"DefaultValue={claimed}")

    told = cells.note(cells.write(tmp_path, eds=file), "axis x can run")
    assert told.message == f"axis x can run {runs}"
    assert doubt in told.observed


def test_a_read_only_event_driven_rpdo_excludes_the_cyclic_mode_of_its_target(tmp_path: Path) -> None:
    """As in the EDS of Trinamic's TMCM-1276: boot cannot make the PDO synchronous, and each trajectory would be refused."""
    file = cells.both(cells.entry("1400sub2", DefaultValue="255"), cells.entry("1400sub2", AccessType="ro"))
    path = cells.write(tmp_path, eds=file)
    told = cells.note(path, "axis x can run")
    assert "csp" not in told.message
    assert (
        "not csp (csp, csv and cst need synchronous PDOs; 1400h:02 of RPDO1 is 255, and read-only"
        in told.observed
    )
    (group,) = [each for each in cells.serious(path) if "axis x cannot run csp" in each.message]
    assert "1400h:02 of RPDO1 is 255" in group.observed


@pytest.mark.parametrize(
    ("method", "is_error"), [(35, False), (37, False), (-1, False), (-128, False), (17, True), (1, True)]
)
def test_a_drive_without_6099h_can_home_by_methods_without_a_speed(
    tmp_path: Path, method: int, is_error: bool
) -> None:
    change = ("method = 17\nspeed_switch = 20.0\nspeed_zero = 2.0", f"method = {method}")
    path = cells.write(tmp_path, change, eds=cells.without("6099"))
    errors = [each for each in cells.serious(path) if each.severity.value == "error"]
    assert any("6099h (homing speeds)" in each.observed for each in errors) is is_error
    assert bool(errors) is is_error


@pytest.mark.parametrize(
    ("gone", "hint"),
    [((), "still pulls to its old target"), (("6064",), "without 6064h only bit 10 is available")],
)
def test_a_handshake_by_sight_needs_something_to_be_seen(
    tmp_path: Path, gone: tuple[str, ...], hint: str
) -> None:
    """The bench's drive has no 6062h."""
    change = ('unit = "deg"', 'unit = "deg"\nhandshake = "on-change"')
    path = cells.write(tmp_path, change, eds=cells.without(*gone))
    told = [each for each in cells.serious(path) if "on-change" in each.message]
    assert [each.line for each in told] == [cells.line_of(path, "handshake =")]
    assert hint in told[0].observed


def test_a_handshake_by_bit_12_needs_nothing_to_be_seen(tmp_path: Path) -> None:
    assert not [each for each in cells.serious(cells.write(tmp_path)) if "on-change" in each.message]


def test_a_group_without_csp_is_warned_that_move_linear_will_be_refused(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('"hm", "csp"]', '"hm"]'))
    problem = cells.only(path, "warning", 'axes = ["x", "y"]')
    assert "group xy: move_linear will be refused, because axis y cannot run csp" in problem.message
    assert f"modes at line {cells.line_of(path, 'modes =')} leaves it out" in problem.observed


def test_a_group_without_sync_is_warned_that_move_linear_will_be_refused(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path, NO_MODES, ("sync = true", "sync = false"), ("transmission = 1", "transmission = 255")
    )
    problem = cells.only(path, "warning", 'axes = ["x", "y"]')
    assert "because the bus has no SYNC" in problem.message
    assert "line 8" in problem.observed


def test_cyclic_modes_are_refused_without_sync(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path,
        ("sync = true", "sync = false"),
        ("transmission = 1", "transmission = 255"),
        ('\n[groups.xy]\naxes = ["x", "y"]', ""),
    )
    problem = cells.only(path, "error", "modes =")
    assert "axis y: csp take their targets at SYNC, and the bus has none" in problem.message


def test_homing_that_the_modes_leave_out_is_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('"hm", "csp"]', '"csp"]'))
    assert 'add "hm"' in cells.only(path, "warning", "modes =").remedy


def test_a_mode_that_6502_does_not_claim_is_only_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.entry("6502", DefaultValue="0x8D"))  # hm's bit 5 left out
    assert cells.serious(path) == []
    found = [each for each in cells.notes(path) if "is not listed by the drive" in each.message]
    assert {each.line for each in found} == {
        cells.line_of(path, "method = 17"),
        cells.line_of(path, "modes ="),
    }
    assert "claims pp, pv, tq, csp" in found[0].observed


def test_a_drive_whose_mode_cannot_be_switched_gets_a_warning(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.without("6060"))
    found = cells.serious(path)
    assert [each.severity.value for each in found] == ["warning", "warning"]
    assert "lacks 6060h (modes of operation)" in found[0].observed


# -- limits ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words", "observed"),
    [
        (
            "velocity = 100.0",
            "velocity = 250.0",
            "velocity in [axes.x.defaults] is beyond max_velocity",
            "250 mm/s against 200 at line 29",
        ),
        (
            "speed_switch = 20.0",
            "speed_switch = 201.0",
            "speed_switch in [axes.x.homing] is beyond max_velocity",
            "201 mm/s",
        ),
        (
            "acceleration = 1000.0",
            "acceleration = 2001.0",
            "acceleration in [axes.x.defaults] is beyond max_acceleration",
            "2001 mm/s² against 2000 at line 30",
        ),
        (
            "deceleration = 1000.0",
            "deceleration = 2500.0",
            "deceleration in [axes.x.defaults] is beyond max_acceleration",
            "2500",
        ),
        (
            "acceleration = 500.0",
            "acceleration = 2500.0",
            "acceleration in [axes.x.homing] is beyond max_acceleration",
            "2500",
        ),
        (
            "modulo = 360.0",
            "modulo = 360.0\nposition_limits = [0, 90]",
            "an endless axis (modulo) has no position limits",
            "position_limits",
        ),
        ("rated_torque = 2.0\nposition", "position", "max_torque in [axes.x] needs rated_torque", "0.1 %"),
        (
            "max_torque = 4.0",
            "max_torque = 70.0",
            "max_torque in [axes.x] is beyond the range of the drive's object",
            "70 is 35000 in 0.1 %",
        ),
        (
            "speed_switch = 20.0\n",
            "",
            "homing method 17 moves, and speed_switch is missing",
            "negative limit switch",
        ),
        (
            "velocity = 100.0",
            "velocity = 4300000",
            "velocity = 4300000 in [axes.x.defaults] does not fit 6081h",
            "4300000000 increments; UNSIGNED32 holds 0 to 4294967295",
        ),
        (
            "max_velocity = 200.0",
            "max_velocity = 2200000",
            "max_velocity = 2200000 in [axes.x] does not fit 60FFh",
            "INTEGER32",
        ),
        (
            "[0.0, 500.0]",
            "[0.0, 2147484.0]",
            "position_limits = 2147484 in [axes.x] does not fit 607Ah",
            "2147484000 increments; INTEGER32 holds -2147483648 to 2147483647",
        ),
        (
            "offset = -5.0",
            "offset = -2147484.0",
            "offset = -2147484 in [axes.x.homing] does not fit 607Ch",
            "-2147484000",
        ),
    ],
)
def test_numbers_agree_with_each_other_and_with_their_objects(
    tmp_path: Path, old: str, new: str, words: str, observed: str
) -> None:
    path = cells.write(tmp_path, (old, new))
    found = [each for each in cells.serious(path) if words in each.message]
    assert len(found) == 1, list(map(str, cells.serious(path)))
    assert found[0].severity.value == ("warning" if "max_velocity =" in words else "error")
    assert observed in found[0].observed
    assert found[0].remedy
    changed = cells.changed(cells.CLEAN, (old, new)).split("\n")
    line = changed[found[0].line - 1]
    assert line.split(" = ")[0] in words or line.startswith("method"), line


def test_the_limits_of_the_eds_hold_in_increments(tmp_path: Path) -> None:
    path = cells.write(tmp_path, NO_MODES, eds=cells.entry("6081", LowLimit="0", HighLimit="99999"))
    problems = [each for each in cells.serious(path) if each.line == cells.line_of(path, "velocity = 100.0")]
    assert [each.severity.value for each in problems] == ["error"]
    assert "is outside the drive's own limits of 6081h" in problems[0].message
    assert "it is 100000 increments" in problems[0].observed
    assert "allows 0 to 99999" in problems[0].observed


def test_a_number_below_one_increment_is_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("speed_zero = 2.0", "speed_zero = 0.0004"))
    problem = cells.only(path, "warning", "speed_zero = 0.0004")
    assert "less than one increment of 6099h:02" in problem.message
    assert "0.0004 mm/s x 1000 = 0.4; the drive gets 1" in problem.observed


def test_the_drives_own_position_limits_are_compared(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path,
        eds=cells.both(
            cells.entry("607Dsub1", DefaultValue="0"), cells.entry("607Dsub2", DefaultValue="400000")
        ),
    )
    problem = cells.only(path, "warning", "position_limits")
    assert "607Dh is 0 to 400000 increments, 0 to 400 mm" in problem.observed


def test_limits_that_the_cell_writes_itself_are_the_ones_compared(tmp_path: Path) -> None:
    wide = ('"609A" = 500000', '"607D:01" = -1000\n"607D:02" = 600000')
    eds = cells.both(
        cells.entry("607Dsub1", DefaultValue="0"), cells.entry("607Dsub2", DefaultValue="400000")
    )
    assert cells.serious(cells.write(tmp_path, wide, eds=eds)) == []


def test_the_drives_own_maximum_velocity_is_compared(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.entry("607F", DefaultValue="50000"))
    problem = cells.only(path, "warning", "velocity = 100.0")
    assert "607Fh (max profile velocity) is 50000 after boot, 50 mm/s" in problem.observed
    assert '"607F" in [axes.x.objects]' in problem.remedy


def test_a_direction_is_not_turned_twice(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.entry("607E", DefaultValue="0x80"))
    problem = cells.only(path, "error", 'invert = "master"')
    assert "inverted twice" in problem.message
    assert "607Eh (polarity) is 80h after boot" in problem.observed


def test_whether_the_drive_turns_torque_is_noted_as_uncertain(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('invert = "master"', 'invert = "drive"'))
    assert cells.serious(path) == []
    assert (
        "small torque" in cells.note(path, "axis y: it is not certain whether the drive also inverts").remedy
    )


def test_a_reserved_homing_method_is_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("method = 17", "method = 15"))
    assert "homing method 15 is reserved" in cells.only(path, "warning", "method = 15").message


def test_homing_method_0_is_no_method(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("method = 17", "method = 0"))
    assert "homing method 0 means" in cells.only(path, "error", "method = 0").message


@pytest.mark.parametrize("mode", ["vl", "cstca"])
def test_a_mode_that_no_command_uses_is_warned_of(tmp_path: Path, mode: str) -> None:
    path = cells.write(tmp_path, ('"pp", "pv", "hm", "csp"]', f'"pp", "pv", "hm", "csp", "{mode}"]'))
    found = [each for each in cells.serious(path) if each.rule == "C125"]
    assert [each.severity.value for each in found] == ["warning"]
    assert f"axis y: no command uses {mode} (" in found[0].message
    assert found[0].line == cells.line_of(path, f'"{mode}"]')


def test_a_makers_homing_method_is_taken(tmp_path: Path) -> None:
    assert cells.serious(cells.write(tmp_path, ("method = 17", "method = -3"))) == []


def test_the_search_for_the_zero_is_the_slow_one(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("speed_zero = 2.0", "speed_zero = 30.0"))
    assert "30 against 20 mm/s" in cells.only(path, "warning", "speed_zero = 30.0").observed


# -- stopping --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("index", "option", "plain", "word"),
    [
        ("605C", "disable operation", "the motor coasts", 'disable = "slow-ramp"'),
        ("605E", "fault", "the motor coasts", 'fault = "ramp"'),
        (
            "6007",
            "connection loss",
            "no action: the drive continues with the last command",
            'connection_loss = "quick-stop"',
        ),
    ],
)
def test_a_reaction_of_0_is_reported_in_plain_words(
    tmp_path: Path, index: str, option: str, plain: str, word: str
) -> None:
    path = cells.write(tmp_path, eds=cells.entry(index, DefaultValue="0"))
    found = cells.serious(path)
    assert [each.severity.value for each in found] == ["warning", "warning"]
    assert [each.line for each in found] == [
        cells.line_of(path, "[axes.x.stop]"),
        cells.line_of(path, "[axes.y]"),
    ]
    assert f"axis x: {option}: {plain}" in found[0].message
    assert f"{index}h" in found[0].observed
    assert "is 0 by default in" in found[0].observed
    assert f"{word} in [axes.x.stop]" in found[0].remedy


def test_a_word_that_is_set_silences_the_warning(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path,
        ("halt_time", 'fault = "ramp"\nhalt_time'),
        ("[groups.xy]", '[axes.y.stop]\nfault = "ramp"\n[groups.xy]'),
        eds=cells.entry("605E", DefaultValue="0"),
    )
    assert cells.serious(path) == []


def test_configured_coasting_is_a_warning_at_its_line(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('halt = "slow-ramp"', 'halt = "slow-ramp"\nfault = "coast"'))
    problem = cells.only(path, "warning", 'fault = "coast"')
    assert "605Eh (fault reaction option code) is 0 by fault in [axes.x.stop]" in problem.observed


def test_an_axis_that_holds_a_load_must_not_coast(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path,
        ("scale = 1000", 'scale = 1000\nholds_load = "brake"'),
        ('halt = "slow-ramp"', 'fault = "coast"'),
    )
    problem = cells.only(path, "error", 'fault = "coast"')
    assert "axis x: fault: the motor coasts" in problem.message
    assert "and the axis holds a load" in problem.message


def test_an_axis_held_by_its_motor_stays_energised_after_a_quick_stop(tmp_path: Path) -> None:
    holds = ("scale = 1000", 'scale = 1000\nholds_load = "torque"')
    path = cells.write(tmp_path, holds)
    problem = cells.only(path, "error", 'quick_stop = "ramp"')
    assert "after a quick stop nothing holds the load" in problem.message
    assert 'quick_stop = "ramp-hold" in [axes.x.stop]' in problem.remedy
    assert (
        cells.serious(cells.write(tmp_path, holds, ('quick_stop = "ramp"', 'quick_stop = "ramp-hold"'))) == []
    )


def test_a_quick_stop_ramp_needs_a_slope(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("deceleration = 4000.0\n", ""), eds=cells.entry("6085", DefaultValue="0"))
    found = cells.serious(path)
    assert [each.severity.value for each in found] == ["warning", "warning", "warning"]
    assert (
        "axis x: position_limits is not kept in every mode" in found.pop(0).message
    )  # a torque could not be stopped
    assert found[0].line == cells.line_of(path, 'quick_stop = "ramp"')
    assert "axis x: quick stop, fault: the quick-stop ramp has a deceleration of 0" in found[0].message
    assert "6085h (quick stop deceleration) is 0 after boot" in found[0].observed
    assert "deceleration = ... (mm/s²) in [axes.x.stop]" in found[0].remedy


def test_a_quick_stop_that_brakes_less_than_the_axis_usually_does_is_warned_of(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path, ("deceleration = 4000.0\n", 'deceleration = 200.0\nquick_stop_time = "9s"\n')
    )
    problem = cells.only(path, "warning", "deceleration = 200.0")
    assert "may end beyond its position limits" in problem.message
    assert "with 200 mm/s²; the default deceleration is" in problem.observed


def test_a_quick_stop_deceleration_that_nothing_uses_is_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('quick_stop = "ramp"', 'quick_stop = "slow-ramp"\nfault = "slow-ramp"'))
    assert "has no effect" in cells.only(path, "warning", "deceleration = 4000.0").message


def test_reactions_that_cannot_be_set_are_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.without("605E"))
    assert cells.serious(path) == []
    told = [
        each
        for each in cells.notes(path)
        if "the reaction of the drive to fault cannot be set" in each.message
    ]
    assert [each.line for each in told] == [
        cells.line_of(path, "[axes.x.stop]"),
        cells.line_of(path, "[axes.y]"),
    ]


def test_reactions_without_a_default_are_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.entry("605E", DefaultValue=""))
    assert cells.serious(path) == []
    assert (
        "no default" in cells.note(path, "axis x: the reaction of the drive to fault is not known").observed
    )


def test_a_step_of_the_stop_sequence_is_long_enough_to_brake(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('halt_time = "2s"', 'halt_time = "150ms"'))
    problem = cells.only(path, "warning", 'halt_time = "150ms"')
    assert "200 mm/s with the default deceleration, 1000 mm/s², takes 0.2 s; after 0.15 s" in problem.observed
    assert 'halt_time = "0.3s"' in problem.remedy


def test_the_deceleration_of_a_halt_is_that_of_a_drive_which_does_not_let_it_be_written(
    tmp_path: Path,
) -> None:
    path = cells.write(tmp_path, eds=cells.entry("6084", AccessType="ro", DefaultValue="50000"))
    observed = next(problem.observed for problem in cells.serious(path) if "halt_time" in problem.message)
    assert "200 mm/s with the read-only deceleration of its drive (6084h), 50 mm/s², takes 4 s" in observed


def test_a_quick_stop_is_as_slow_as_a_read_only_6085h(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path,
        ("deceleration = 4000.0\n", ""),
        eds=cells.entry("6085", AccessType="ro", DefaultValue="50000"),
    )
    slow = [problem for problem in cells.serious(path) if "too short to brake" in problem.message]
    assert [problem.message.split()[2] for problem in slow] == ["quick_stop_time"]
    assert "with the read-only deceleration of its drive (6085h), 50 mm/s²" in slow[0].observed


# -- left out --------------------------------------------------------------------------------------------------------


def test_missing_defaults_are_reported_with_the_commands_that_need_them(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("velocity = 90.0\nacceleration = 720.0\n", ""))
    problem = cells.only(path, "warning", "[axes.y.defaults]")
    assert "axis y has no default velocity and acceleration" in problem.message
    assert "every call of moves must give them" in problem.observed
    assert "add velocity = ..., acceleration = ... to [axes.y.defaults]" in problem.remedy


def test_a_missing_acceleration_alone_is_reported(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("acceleration = 720.0\n", ""))
    problem = cells.only(path, "warning", "[axes.y.defaults]")
    assert "axis y has no default acceleration" in problem.message
    assert "every call of moves, move_velocity and jog must give it" in problem.observed


def test_torque_without_rated_torque_is_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, NO_MODES, ("rated_torque = 2.0\nmodulo", "modulo"))
    assert cells.serious(path) == []
    assert cells.note(path, "axis y: torque_control needs rated_torque").line == cells.line_of(
        path, "[axes.y]"
    )


def test_an_axis_that_must_be_homed_has_a_method(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("method = 17\n", ""))
    problem = cells.only(path, "warning", "[axes.x.homing]")
    assert "axis x must be homed before absolute moves, and has no homing method" in problem.message
    assert "position_limits are set" in problem.observed
    assert "required = false" in problem.remedy
    assert cells.serious(cells.write(tmp_path, ("method = 17\n", "required = false\n"))) == []


def test_a_velocity_scale_alone_is_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("scale = 1000", "scale = 1000\nvelocity_scale = 60"))
    problem = cells.only(path, "error", "velocity_scale = 60")  # position_limits are reckoned with it
    assert "velocity_scale is 60, acceleration is converted by 1000 increments per mm" in problem.observed


def test_the_deadlines_of_an_axis_in_increments_are_explained(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('unit = "mm"\nscale = 1000', 'unit = "increments"'))
    limits, speed = cells.serious(path)
    assert limits.message == "axis x: position_limits is not kept in every mode"
    assert limits.line == cells.line_of(path, "position_limits")
    assert "pv" in limits.observed.split("the motion is refused")[0]
    assert "velocity_scale" in limits.remedy
    assert speed.message == "axis x: max_velocity is not kept in every mode"
    assert cells.note(path, "axis x: without velocity_scale").line == cells.line_of(path, '"increments"')


@pytest.mark.parametrize("scale", ["0.15", "0.3", "0.299"])
def test_an_axis_with_few_increments_is_warned_of_the_slow_motions_that_its_positions_cannot_show(
    tmp_path: Path, scale: str
) -> None:
    """At 200 mm/s; 0.3 makes exactly 60 increments per second."""
    path = cells.write(tmp_path, ("scale = 1000", f"scale = {scale}"))
    found = [each for each in cells.serious(path) if "cannot show a slow motion" in each.message]
    assert len(found) == (float(scale) < 0.3)
    if scale == "0.15":
        # 3 increments, 20 mm, in 0.3 s
        assert found[0].line == cells.line_of(path, "max_velocity = 200.0")
        assert found[0].severity.value == "warning"
        assert "at 200 mm/s its position changes by 30 increments per second" in found[0].observed
        assert "up to 66.7 mm/s look like standstill" in found[0].observed


def test_without_max_velocity_the_default_velocity_gives_the_slowest_visible_motion(
    tmp_path: Path,
) -> None:
    path = cells.write(tmp_path, ("scale = 1000", "scale = 0.1"), ("max_velocity = 200.0\n", ""))
    found = [each for each in cells.serious(path) if "cannot show a slow motion" in each.message]
    assert [each.line for each in found] == [cells.line_of(path, "velocity = 100.0")]


def test_limits_in_drive_reports_limits_that_the_drive_cannot_hold(tmp_path: Path) -> None:
    given = "max_torque = 4.0", "max_torque = 4.0\nlimits_in_drive = true"
    path = cells.write(tmp_path, given, eds=cells.without("607F"))
    told = [each for each in cells.serious(path) if "cannot be left in the drive" in each.message]
    assert [each.message.rpartition(" as ")[2][:5] for each in told] == ["607Fh", "6080h", "6072h"]
    assert {each.observed for each in told} == {"the drive has no such object"}
    assert [each.line for each in told][1:] == [
        cells.line_of(path, "max_velocity"),
        cells.line_of(path, "max_torque"),
    ]
    assert cells.note(path, "607Dh is relative to the drive's own zero").line == cells.line_of(
        path, "limits_in_drive"
    )


@pytest.mark.parametrize(
    ("offset", "warned"),
    [("offset = 20.0", True), ("offset = 0.0", False), ("", False)],
)
def test_a_home_offset_that_may_shift_the_limits_in_the_drive_is_a_warning(
    tmp_path: Path, offset: str, warned: bool
) -> None:
    """CiA 402-2, 607Dh; Trinamic: PD42-1270 CANopen Firmware Manual V3.19, section 7.1.8."""
    given = "max_torque = 4.0", "max_torque = 4.0\nlimits_in_drive = true"
    path = cells.write(tmp_path, given, ("offset = -5.0\n", f"{offset}\n"))
    found = [each for each in cells.serious(path) if "home offset" in each.message]
    assert [each.line for each in found] == [cells.line_of(path, "limits_in_drive")] * warned
    if warned:
        assert "607Ch (home offset) is 20000 increments" in found[0].observed
        assert "offset in [axes.x.homing]" in found[0].remedy


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('demand = "ignore"', '6062h is not used (demand = "ignore")'),
        ('following_error = "off"', 'not compared with 6062h (following_error = "off")'),
        ('demand = "use"', "its drive has no 6062h"),
        ("following_error = 2.0", ""),
    ],
)
def test_a_note_lists_the_checks_that_need_6062h(tmp_path: Path, line: str, told: str) -> None:
    """The bench's drive has no 6062h."""
    path = cells.write(tmp_path, ('unit = "deg"', f'unit = "deg"\n{line}'))
    found = [each for each in (*cells.notes(path), *cells.serious(path)) if "6062h" in each.message]
    assert [each.line for each in found] == ([cells.line_of(path, line)] if told else [])
    assert not told or told in found[0].message
