"""Whether two axes can carry one beam; each cell has just one defect."""

from __future__ import annotations

import pytest

from axisbus.cell.problem import CellProblem
from axisbus.check.run import check
from kit.cell import cell_file, cell_text
from kit.gantry.pair import AXIS, HOMING

GANTRY = '[gantries.b]\naxes = ["x", "y"]\nmax_skew = 9.0\n'


def found(
    tmp_path, *changes: tuple[str, str], more: str = GANTRY + HOMING, names: str = "xyz"
) -> list[CellProblem]:
    """The errors and warnings of a cell with these changes that it has not without a pair; each change must hit something."""
    text = cell_text(names, axis=AXIS, more=more)
    for before, after in changes:
        assert before in text
        text = text.replace(before, after, 1)
    path = cell_file(tmp_path, names, axis=AXIS)
    usual = {problem.message for problem in check(path)}
    path.write_text(text, encoding="utf-8")
    serious = [problem for problem in check(path) if problem.severity.value in ("error", "warning")]
    return [problem for problem in serious if problem.message not in usual]


def one(tmp_path, severity: str, *changes: tuple[str, str], **how: str) -> CellProblem:
    """The only problem of that cell."""
    (problem,) = found(tmp_path, *changes, **how)
    assert problem.severity.value == severity
    assert problem.remedy
    return problem


def test_a_pair_that_fits_has_neither_error_nor_warning(tmp_path):
    assert found(tmp_path) == []
    must = ("method = 35\nrequired = false", "required = true")
    assert found(tmp_path, must, must) == []  # the pair is homed by its switches
    assert [each.severity.value for each in found(tmp_path, must, more="")] == ["warning"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('["x", "y"]', '["x"]'), "must name two axes, not 1"),
        (('["x", "y"]', '["x", "y", "z"]'), "must name two axes, not 3"),
        (('["x", "y"]', '["x", "x"]'), "has the axis 'x' twice"),
        (('["x", "y"]', '["x", "w"]'), "has the axis 'w', which the cell does not have"),
        (("max_skew = 9.0\n", ""), "max_skew is missing in [gantries.b]"),
        (("max_skew = 9.0", "max_skew = 0"), "max_skew in [gantries.b] cannot be used"),
        (("max_skew", "max_screw = 1\nmax_skew"), "unknown key 'max_screw'"),
        (("[gantries.b]", "[gantries.x]"), "'x' names two things"),
        (("distance = -90.0", "distance = 0.0"), "distance in [gantries.b.homing] must not be 0"),
        (("[5.0, 7.0]", "[5.0]"), "positions in [gantries.b.homing] must be two numbers"),
        (("[5.0, 7.0]", '[5.0, 7.0]\nswitches = "first"'), "must be one number"),
        (("velocity = 20.0\n", ""), "velocity is missing in [gantries.b.homing]"),
        (('edge = "rising"', 'edge = "up"'), "edge in [gantries.b.homing] cannot be used"),
        (("velocity = 20.0", "velocity = 401.0"), "is homed faster than axis x allows"),
        (("max_velocity = 400.0", "max_velocity = 400.0\nmodulo = 360.0"), "axis x of gantry b is endless"),
        (('unit = "deg"', 'unit = "mdeg"'), "have different units"),
        (('modes = ["pp"]', ""), "cannot run csp"),
        (("generic-cia402", "gim6010-8"), "the drive of x has no touch probe"),
    ],
)
def test_an_impossible_gantry_is_an_error(tmp_path, change, message):
    if change[0].startswith("modes"):
        change = ("max_velocity = 400.0", 'max_velocity = 400.0\nmodes = ["pp", "hm"]')
    problems = [each for each in found(tmp_path, change) if each.severity.value == "error"]
    assert any(message in problem.message for problem in problems), [each.message for each in problems]
    assert all(problem.remedy for problem in problems)


def test_a_virtual_axis_carries_no_beam(tmp_path):
    virtual = (
        '[axes.v]\nvirtual = true\nunit = "deg"\n[axes.v.defaults]\nvelocity = 1.0\nacceleration = 1.0\n'
    )
    problem = one(tmp_path, "error", ('["x", "y"]', '["x", "v"]'), more=virtual + GANTRY)
    assert "axis v of gantry b is virtual" in problem.message


def test_an_axis_carries_one_beam(tmp_path):
    other = '[gantries.c]\naxes = ["y", "z"]\nmax_skew = 9.0\n'
    assert "axis y is in two pairs" in one(tmp_path, "error", more=GANTRY + other).message


def test_without_sync_a_pair_cannot_be_moved(tmp_path):
    problems = found(tmp_path, ('scan_period = "10ms"', 'scan_period = "10ms"\nsync = false'))
    assert any("gantry b cannot be moved: the bus has no SYNC" in problem.message for problem in problems)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("deceleration = 1000.0", "deceleration = 500.0"), "different values of deceleration"),
        (('quick_stop = "ramp"', 'quick_stop = "current-limit"'), "different values of quick_stop"),
        (("scale = 100", "scale = 200"), "different values of scale"),
        (("max_skew = 9.0", "max_skew = 7.9"), "less than its axes move in two cycles"),
        (
            ("[axes.x]", "[nodes.1.pdo.tpdo1]\ntransmission = 3\n[axes.x]"),
            "send their TPDOs at different rates",
        ),
    ],
)
def test_settings_that_can_bend_the_beam_are_warnings(tmp_path, change, message):
    problems = found(tmp_path, change)
    assert any(each.severity.value == "warning" and message in each.message for each in problems)


@pytest.mark.parametrize(("axes", "many"), [('["x", "z"]', 1), ('["x", "y", "z"]', 0), ('["z"]', 0)])
def test_a_group_contains_both_axes_of_a_pair_or_neither(tmp_path, axes, many):
    problems = found(tmp_path, more=GANTRY + HOMING + f"[groups.g]\naxes = {axes}\n")
    messages = [each.message for each in problems if "group g contains one axis of gantry b" in each.message]
    assert len(messages) == many
