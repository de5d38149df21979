"""The promises for an axis's limits, by its files and by its drive, and a drive in another unit is refused."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import pytest

from axisbus import Machine
from axisbus.cell import scale_proposal
from axisbus.check.run import check, promised
from axisbus.cia402.si_units import by_dimension, decoded
from axisbus.eds.builtin import resolve
from axisbus.errors import AxisbusError, BootError, ConfigError, LimitError, StateError
from axisbus.motion.stop.promises import LimitEnforcement

AHEAD, AT, REFUSED, WATCHED, CHECKED = (
    LimitEnforcement.AHEAD,
    LimitEnforcement.AT,
    LimitEnforcement.REFUSED,
    LimitEnforcement.WATCHED,
    LimitEnforcement.CHECKED,
)
CELL = """[bus]
interface = "sim"
scan_period = "10ms"
[nodes.1]
eds = "drive.eds"
[axes.a]
node = 1
{axis}
position_limits = [-30000.0, 10000.0]
max_velocity = 20000.0
[axes.a.defaults]
velocity = 2000.0
acceleration = 26000.0
deceleration = 26000.0
[axes.a.homing]
method = 35
[axes.a.stop]
quick_stop = "ramp"
halt = "slow-ramp"
disable = "slow-ramp"
fault = "ramp"
deceleration = 36400.0
halt_time = "60s"
"""
SCALED, RAW = 'unit = "deg"\nscale = 1.0', 'unit = "increments"'
RPM, RPM_S, INC_S, INC_S2 = 0x00B44700, 0x00C00300, 0x00B50300, 0x00B55700


def added(index: int, value: int, sub: int | None = None, access: str = "rw", kind: str = "0x0007") -> str:
    section = f"{index:04X}" if sub is None else f"{index:04X}sub{sub}"
    return (
        f"\n[{section}]\nParameterName=Added {section}\nObjectType=0x7\nDataType={kind}\nAccessType={access}\n"
        f"DefaultValue={value}\nPDOMapping=0\n"
    )


def entry(text: str, section: str, **values: str) -> str:
    head, mark, tail = text.partition(f"[{section}]\n")
    block, rest = tail.split("\n[", 1)
    for key, value in values.items():
        block = re.sub(rf"(?m)^{key}=.*$", f"{key}={value}", block)
    return head + mark + block + "\n[" + rest


def write(
    folder: Path, axis: str = SCALED, *, units: dict[int, int] | None = None, change=str, turn: int = 0
) -> Path:
    """Write a cell and its drive, which has these unit objects, and so many increments of a motor turn (608Fh)."""
    text = resolve("builtin:generic-cia402", folder).read_text(encoding="ascii")
    text = entry(entry(text, "608Fsub1", DefaultValue=str(turn)), "608Fsub2", DefaultValue="1")
    text = entry(text, "60A9", DefaultValue="0")  # the tests set the unit of this drive
    text = change(text)
    for index, value in (units or {}).items():
        listed = f"[{index:04X}]" in text
        text = entry(text, f"{index:04X}", DefaultValue=str(value)) if listed else text + added(index, value)
    (folder / "drive.eds").write_text(text, encoding="ascii")
    path = folder / "cell.toml"
    path.write_text(CELL.format(axis=axis), encoding="utf-8")
    return path


def errors(path: Path) -> list[str]:
    return [f"{each.message} | {each.remedy}" for each in check(path) if each.severity.value == "error"]


def kept(promises, limit: str = "position_limits") -> dict[str, LimitEnforcement]:
    return {each.mode: each.kept for each in promises if each.limit == limit}


# -- units -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        (0x00B50000, ("inc", 1, "inc")),
        (RPM, ("rev", Fraction(1, 60), "rev/min")),
        (0xFDB44700, ("rev", Fraction(1, 60_000), "0.001rev/min")),
        (RPM_S, ("rev", Fraction(1, 60), "rev/min/s")),
        (INC_S2, ("inc", 1, "inc/s²")),
        (0xFF410000, ("rev", Fraction(1, 3600), "0.1deg")),
        (0x02B50300, ("inc", 100, "100inc/s")),
        (0x00410300, ("rev", Fraction(1, 360), "deg/s")),
        (0xFD010300, ("m", Fraction(1, 1000), "0.001m/s")),
        (0x00B44800, ("rev", Fraction(1, 3600), "rev/h")),
        (0, None),
        (None, None),
        (0x00777700, None),
    ],
)
def test_an_si_unit_is_a_number_of_increments_turns_or_metres(code, expected):
    found = decoded(code)
    assert found == expected or (found is not None and tuple(found) == expected)


def test_the_old_dimension_index_of_revolutions_per_minute():
    assert by_dimension(0, 0xA4) == ("rev", Fraction(1, 60), "rev/min")
    assert by_dimension(0xFD, 0xA4) == by_dimension(-3, 0xA4) == ("rev", Fraction(1, 60_000), "0.001rev/min")
    assert by_dimension(0, 0) is None
    assert by_dimension(None, None) is None


@pytest.mark.parametrize(
    ("values", "ratios", "certain"),
    [
        ({(0x60A9, 0): INC_S}, (1,), True),
        ({(0x60A9, 0): 0xFFB50300}, (Fraction(1, 10),), True),
        ({(0x60A9, 0): RPM}, (), False),
        ({(0x60A9, 0): RPM, (0x608F, 1): 6000, (0x608F, 2): 1}, (100,), False),
        ({(0x60A9, 0): RPM, (0x608F, 1): 1, (0x608F, 2): 1}, (), False),
        (
            {(0x60A9, 0): RPM, (0x608F, 1): 6000, (0x608F, 2): 1, (0x6091, 1): 2, (0x6091, 2): 1},
            (50, 100, 200),
            False,
        ),
        ({(0x60A9, 0): RPM, (0x60A8, 0): 0xFF410000}, (60,), True),
        ({(0x608C, 0): 0xA4, (0x608F, 1): 6000, (0x608F, 2): 1}, (100,), False),
        ({(0x60A9, 0): 0xFD010300}, (), False),
    ],
)
def test_the_ratio_of_velocity_to_position_increments(values, ratios, certain):
    [rate] = scale_proposal.rates(values)
    assert (rate.ratios, rate.is_certain) == (ratios, certain)


@pytest.mark.parametrize(
    ("axis", "units", "turn", "told"),
    [
        (SCALED, {}, 1, []),
        (SCALED, {0x60A9: INC_S, 0x60AA: INC_S2}, 1, []),
        (SCALED, {0x60A9: RPM, 0x60AA: RPM_S}, 1, ["velocity_scale = 60 / N", "acceleration_scale = 60 / N"]),
        (
            SCALED,
            {0x60A9: RPM, 0x60AA: RPM_S},
            6000,
            ["velocity_scale = 0.01 ", "acceleration_scale = 0.01 "],
        ),
        (SCALED, {0x60A9: 0xFFB50300}, 1, ["velocity_scale = 10 ", "write acceleration_scale"]),
        (SCALED, {0x608B: 0, 0x608C: 0xA4}, 6000, ["velocity_scale = 0.01 ", "write acceleration_scale"]),
        (
            SCALED + "\nvelocity_scale = 0.01\nacceleration_scale = 0.01",
            {0x60A9: RPM, 0x60AA: RPM_S},
            6000,
            [],
        ),
        (SCALED + "\nvelocity_scale = 0.01\nacceleration_scale = 0.01", {0x60A9: RPM, 0x60AA: RPM_S}, 1, []),
        (
            SCALED + "\nvelocity_scale = 5\nacceleration_scale = 1",
            {0x60A9: INC_S},
            0,
            ["velocity_scale = 1 "],
        ),
        (RAW, {0x60A9: RPM, 0x60AA: RPM_S}, 6000, []),
        (
            RAW + "\nvelocity_scale = 1",
            {0x60A9: RPM, 0x60AA: RPM_S},
            6000,
            ["acceleration_scale = 0.01 "],
        ),
    ],
)
def test_a_scale_that_the_drives_units_contradict_is_refused(tmp_path, axis, units, turn, told):
    path = write(tmp_path, axis, units=units, turn=turn)
    found = errors(path)
    assert len(found) == len(told), found
    for text, expected in zip(found, told, strict=True):
        assert expected in text
    if told:
        with pytest.raises(ConfigError, match="axis a"), Machine.simulated(path):
            pass


def test_a_written_scale_against_an_encoder_of_the_eds_alone_is_a_warning(tmp_path):
    """The EDS's 608Fh is often not that of the motor which is connected: boot has the last word."""
    axis = SCALED + "\nvelocity_scale = 0.7\nacceleration_scale = 0.01"
    path = write(tmp_path, axis, units={0x60A9: RPM, 0x60AA: RPM_S}, turn=6000)
    assert errors(path) == []
    assert any("velocity_scale does not match" in each.message for each in check(path))


def test_a_drive_that_counts_differently_from_its_eds_is_refused_at_boot(tmp_path):
    path = write(tmp_path, units={0x60A9: INC_S, 0x60AA: INC_S2})
    from axisbus import eds
    from axisbus.sim.build import device_from_eds

    made = device_from_eds(eds.load(tmp_path / "drive.eds"), 1)
    made.write(0x60A9, 0, RPM)
    with (
        pytest.raises(BootError, match="velocity_scale does not match the unit of its drive") as caught,
        Machine.simulated(path, {1: made}),
    ):
        pass
    assert "velocity_scale" in caught.value.remedy
    assert "60A9h" in caught.value.observed


# -- promises --------------------------------------------------------------------------------------------------------


def test_every_promise_is_made_for_an_axis_whose_values_are_known(tmp_path):
    path = write(tmp_path)
    with Machine.simulated(path) as cell:
        booted = cell["a"].promises
        assert booted == promised(path)["a"]
        assert {kept(booted)[mode] for mode in ("pp", "pv", "tq", "csp", "csv", "cst")} == {AHEAD}
        assert kept(booted)["hm"] is LimitEnforcement.NOT
        assert set(kept(booted, "max_velocity").values()) == {WATCHED}
        report = cell.node(1).report if hasattr(cell.node(1), "report") else None
        assert report is None or "braked ahead" in report.text()
    notes = [each for each in check(path) if "is kept as follows" in each.message]
    assert [each.message for each in notes] == [
        "axis a: position_limits is kept as follows",
        "axis a: max_velocity is kept as follows",
    ]
    assert "pp, pv, tq, csp, csv, cst: braked ahead" in notes[0].observed


def test_an_axis_in_increments_is_promised_only_limits_that_can_be_kept(tmp_path):
    path = write(tmp_path, RAW)
    found = promised(path)["a"]
    assert kept(found) == {
        "pp": AT, "pv": REFUSED, "tq": REFUSED, "hm": LimitEnforcement.NOT, "csp": AHEAD, "csv": REFUSED, "cst": REFUSED,
    }  # fmt: skip
    assert kept(found, "max_velocity")["pv"] is CHECKED
    [warning] = [each for each in check(path) if each.message.startswith("axis a: position_limits")]
    assert warning.severity.value == "warning"
    assert "pv, tq, csv, cst: the motion is refused: the units of its velocities" in warning.observed
    assert "velocity_scale" in warning.remedy
    with Machine.simulated(path) as cell:
        a = cell["a"]
        assert a.promises == found
        a.enable().wait()
        a.home().wait()
        with pytest.raises(StateError, match="within its position limits in pv"):
            a.move_velocity(2000.0).wait()
        a.move_absolute(9000.0).wait()


@pytest.mark.parametrize(
    ("axis", "units"),
    [
        (RAW, {0x60A9: INC_S, 0x60AA: INC_S2}),
        (RAW, {0x60A9: INC_S}),
        (RAW + "\nvelocity_scale = 1", {}),
        (SCALED, {}),
    ],
)
def test_if_the_drive_or_the_cell_file_gives_the_ratio_limits_are_braked_for(tmp_path, axis, units):
    path = write(tmp_path, axis, units=units)
    assert kept(promised(path)["a"])["pv"] is AHEAD
    with Machine.simulated(path) as cell:
        assert farthest(cell, 10_000.0) <= 10_000
        assert isinstance(cell["a"].error, LimitError)


def farthest(cell, velocity: float, seconds: float = 15.0) -> float:
    """Home an axis and let it turn; return how far it came, in increments."""
    a = cell["a"]
    a.enable().wait()
    a.home().wait()
    a.move_velocity(velocity)
    motor, top = cell.simulated_node(1).drive().axis.motor, 0.0
    for _ in range(round(seconds / 0.01)):
        cell.sleep(0.01)
        top = max(top, motor.position)
    return top


@pytest.mark.parametrize(
    "change",
    [
        lambda text: entry(text, "6084", AccessType="ro", DefaultValue="5000"),
        lambda text: entry(text, "6084", AccessType="const", DefaultValue="5000"),
        lambda text: text + added(0x60C6, 5000),
        lambda text: entry(
            entry(text, "6084", AccessType="ro", DefaultValue="9000"), "6085", DefaultValue="100"
        ),
    ],
)
def test_limits_are_braked_for_with_the_objects_that_the_drive_has(tmp_path, change):
    path = write(tmp_path, change=change)
    with Machine.simulated(path) as cell:
        assert kept(cell["a"].promises)["pv"] is AHEAD
        assert 5000 < farthest(cell, 8000.0) <= 10_000
        assert cell["a"].error is not None


def test_a_drive_that_shows_no_deceleration_is_not_promised_for(tmp_path):
    path = write(tmp_path, change=lambda text: entry(text, "6084", AccessType="ro", DefaultValue="0"))
    found = promised(path)["a"]
    assert kept(found)["pv"] is REFUSED
    assert kept(found)["csp"] is AHEAD
    with Machine.simulated(path) as cell:
        assert kept(cell["a"].promises)["pv"] is REFUSED
        assert farthest(cell, 8000.0, 2.0) == 0.0
        assert isinstance(cell["a"].error, AxisbusError | None)


def test_boot_reports_the_promises(tmp_path):
    from axisbus.machine.opening import boot

    [report] = boot(write(tmp_path, RAW), lambda *_: None, lambda *_: None)
    lines = [
        line for line in report.text().splitlines() if "position_limits" in line or "max_velocity" in line
    ]
    assert any("pv, tq, csv, cst: the motion is refused" in line for line in lines)
    assert any("csp: braked ahead" in line for line in lines)
    told = report.as_json()["axes"][0]["promises"]
    assert {"limit", "mode", "kept", "why", "remedy"} == set(told[0])
