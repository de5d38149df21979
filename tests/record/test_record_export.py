"""Recordings as tables, laid over each other, and drawn."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from axisbus.errors import UserError
from axisbus.record.columns import NAMES
from axisbus.record.compare import compare
from axisbus.record.export import table, write_csv, write_parquet
from axisbus.record.load import load
from axisbus.record.plot import _thinned, flags, lines, plot
from axisbus.record.recording_data import Recorded, RecordedEvent, RecordedSeries

UNITS = dict.fromkeys(NAMES, "") | {
    "position": "deg", "velocity": "deg/s", "torque": "N·m", "target": "deg", "demand": "deg", "following_error": "deg",
}  # fmt: skip
NAN = math.nan


def track(name: str = "x", delay: int = 0, scale: float = 1.0, unit: str = "deg") -> RecordedSeries:
    """Return an axis that rests for ``delay`` samples, then goes to 10 in ten steps, and rests."""
    places = [0.0] * delay + [scale * step for step in range(11)] + [scale * 10.0] * 5
    count = len(places)
    moving = ["Standstill"] * delay + ["DiscreteMotion"] * 11 + ["Standstill"] * 5
    columns = {
        "position": places, "velocity": [1.0] * count, "torque": [NAN] * count, "target": places,
        "demand": [NAN] * count, "following_error": [NAN] * count, "state": moving,
        "power": ["operation enabled"] * count, "mode": [None] * 3 + ["pp"] * (count - 3),
        "statusword": [0x237] * count, "homed": [True] * count,
    }  # fmt: skip
    return RecordedSeries(
        name, [0.1 * number for number in range(count)], columns, UNITS | {"position": unit}
    )


def recorded(**changes) -> Recorded:
    events = [
        RecordedEvent(0.1, "command", "x.move_absolute(10 deg)", "given"),
        RecordedEvent(0.9, "emcy", "node 1", "0x8611"),
    ]
    facts = {"cell": "cell.toml"}
    return replace(Recorded({"x": track(), "y": track("y")}, events=events, facts=facts), **changes)


# -- tables ----------------------------------------------------------------------------------------------------------------------


def test_a_table_has_a_row_for_each_sample_and_no_row_without_values():
    fields = {field.head: field.values for field in table(recorded())}
    assert list(fields)[:3] == ["time [s]", "x.position [deg]", "x.velocity [deg/s]"]
    assert len(fields) == 1 + 2 * len(NAMES)
    assert {len(values) for values in fields.values()} == {16}
    assert fields["x.torque [N·m]"] == [None] * 16
    assert fields["y.mode"][:4] == [None, None, None, "pp"]


def test_the_value_of_an_object_is_in_the_row_after_it_was_read():
    read = RecordedSeries("x:1001", [0.05, 0.2, 9.9], {"value": [1, None, 3]}, {"value": ""})
    values = {field.name: field.values for field in table(recorded(objects={"x:1001": read}))}["x:1001"]
    assert values == [None, 1, *[None] * 13, 3]
    mixed = replace(read, columns={"value": [1, "two", 3]})
    assert table(recorded(objects={"x:1001": mixed}))[-1].values[1:3] == ["1", "two"]


def test_an_empty_recording_makes_no_table(tmp_path):
    for empty in (Recorded({}), Recorded({"x": replace(track(), times=[])})):
        with pytest.raises(UserError, match="nothing was recorded"):
            write_csv(empty, tmp_path / "none.csv")
    assert not (tmp_path / "none.csv").exists()


def test_csv_is_read_by_pandas_and_polars(tmp_path):
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    path = tmp_path / "run.csv"
    write_csv(recorded(), path)
    one, other = pandas.read_csv(path), polars.read_csv(path)
    assert list(one.columns) == list(other.columns)
    assert (
        one["x.position [deg]"].tolist()
        == other["x.position [deg]"].to_list()
        == [*map(float, range(11)), *[10.0] * 5]
    )
    assert one["x.torque [N·m]"].isna().all()
    assert other["x.torque [N·m]"].null_count() == 16


def test_parquet_is_read_by_pandas_and_polars_and_its_columns_know_their_units(tmp_path):
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "run.parquet"
    write_parquet(recorded(), path)
    one, other = pandas.read_parquet(path), polars.read_parquet(path)
    assert (
        one["y.position"].tolist() == other["y.position"].to_list() == [*map(float, range(11)), *[10.0] * 5]
    )
    assert one["x.state"].iloc[0] == other["x.state"][0] == "DiscreteMotion"
    schema = parquet.read_schema(path)
    assert schema.field("x.velocity").metadata[b"unit"].decode() == "deg/s"
    assert "velocity" in schema.field("x.velocity").metadata[b"description"].decode()
    assert schema.metadata[b"cell"] == b"cell.toml"
    assert json.loads(schema.metadata[b"events"])[1]["text"] == "0x8611"


# -- compared --------------------------------------------------------------------------------------------------------------------


def test_two_runs_of_one_job_have_no_difference_for_any_delay_of_the_second():
    found = compare(recorded(), recorded(tracks={"x": track(delay=4), "y": track("y", delay=4)}))
    assert found.shift == pytest.approx(0.4)
    assert found.seconds == pytest.approx(1.5)
    assert {(one.axis, one.column) for one in found.deviations} == {
        (axis, column) for axis in "xy" for column in ("position", "velocity")
    }  # an unknown value is not compared
    assert all(one.by == pytest.approx(0.0, abs=1e-9) for one in found.deviations)


def test_the_largest_deviation_is_reported_with_its_time_and_both_values():
    found = compare(recorded(), recorded(tracks={"x": track(scale=1.5), "z": track("z")}))
    worst = next(one for one in found.deviations if one.column == "position")
    assert (worst.axis, worst.unit) == ("x", "deg")
    assert worst.by == pytest.approx(5.0)
    assert (worst.first, worst.second) == pytest.approx((10.0, 15.0))
    assert worst.time == pytest.approx(1.0)
    assert found.only == ["y", "z"]


def test_recordings_without_a_common_axis_or_unit_are_refused():
    with pytest.raises(UserError, match="no axis in common"):
        compare(recorded(), recorded(tracks={"z": track("z")}))
    with pytest.raises(UserError, match="position is in deg and mm"):
        compare(recorded(), recorded(tracks={"x": track(unit="mm")}))


def test_axes_that_never_moved_are_compared_from_their_beginning():
    still = replace(track(), columns=dict(track().columns) | {"state": ["Standstill"] * 16})
    assert compare(recorded(tracks={"x": still}), recorded(tracks={"x": still})).shift == 0.0


def test_a_csv_file_is_read_back_as_it_was_written(tmp_path):
    path = tmp_path / "recording.csv"
    write_csv(recorded(), path)
    back = load(path)
    assert list(back.tracks) == ["x", "y"]
    for name, given in recorded().tracks.items():
        found = back.tracks[name]
        assert list(found.times) == pytest.approx(given.times)
        assert found.units["position"] == "deg"
        for column, values in given.columns.items():
            assert [None if value != value else value for value in found.columns[column]] == [
                None if value != value else value for value in values
            ]


def test_a_csv_file_is_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    write_csv(recorded(), tmp_path / "recording.csv")
    assert plot(tmp_path / "recording.csv", tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("time [s],x.position [deg]\n0,1\n", "recording.csv:1: there is no column of an axis"),
        ("time [s],what\n", "recording.csv:1: there is no column of an axis"),
        (None, "recording.csv:3: this line is not a sample"),
    ],
)
def test_a_csv_file_of_another_program_is_refused_with_its_line(tmp_path, text, told):
    path = tmp_path / "recording.csv"
    if text is None:
        write_csv(recorded(), path)
        first, second, third, *_ = path.read_text("utf-8").splitlines()
        text = "\n".join((first, second, third.replace("True", "perhaps")))
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=told):
        load(path)


# -- pictures --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "begins"), [("a.png", b"\x89PNG"), ("b.SVG", b"<?xml")])
def test_the_format_of_a_picture_follows_from_its_name(tmp_path, name, begins):
    pytest.importorskip("matplotlib")
    path = plot(recorded(lacks="its end is missing"), tmp_path / "new" / name, "a title")
    assert path.read_bytes().startswith(begins)
    if name.endswith("SVG"):
        text = path.read_text(encoding="utf-8")
        for word in (
            "a title",
            "its end is missing",
            "x.move_absolute(10 deg)",
            "node 1: 0x8611",
            "Standstill",
        ):
            assert f"<!-- {word}" in text or word in text
        assert "torque" not in text  # it is unknown


def test_an_unknown_format_and_an_empty_recording_are_refused(tmp_path):
    pytest.importorskip("matplotlib")
    with pytest.raises(UserError, match=r"png or \.svg"):
        plot(recorded(), tmp_path / "a.txt")
    with pytest.raises(UserError, match="nothing to draw"):
        plot(recorded(), tmp_path / "a.png", begin=5.0)
    assert list(tmp_path.iterdir()) == []


def test_a_long_line_is_thinned_and_keeps_its_peaks():
    times = [float(number) for number in range(100_000)]
    values = [0.0] * 100_000
    values[77_777], values[12_345], values[50_000] = 9.0, -9.0, NAN
    thin_times, thin = _thinned(times, values)
    assert len(thin) < 5000
    assert (max(thin), min(thin)) == (9.0, -9.0)
    assert thin_times == sorted(thin_times)
    assert _thinned(times[:100], values[:100]) == (times[:100], values[:100])
    blank = [NAN] * 100_000
    assert all(math.isnan(value) for value in _thinned(times, blank)[1])


# -- flags -----------------------------------------------------------------------------------------------------------------------


def test_flags_that_would_overlap_are_one_and_commands_that_went_well_are_reported_once():
    events = [
        RecordedEvent(1.0, "command", "x.enable()", "given"),
        RecordedEvent(1.01, "command", "y.enable()", "given"),
        RecordedEvent(1.2, "command", "x.enable()", "done"),
        RecordedEvent(5.0, "emcy", "node 1", "0x8611"),
        RecordedEvent(5.05, "command", "x.move_absolute(1 deg)", "ended: fault"),
        RecordedEvent(9.0, "machine", "", "the with block ended"),
        RecordedEvent(20.0, "nmt", "node 1", "is lost"),
    ]
    found = flags(events, 0.0, 10.0)
    assert [(flag.number, flag.time, flag.texts) for flag in found] == [
        (1, 1.0, ["x.enable(), y.enable()"]),
        (2, 5.0, ["node 1: 0x8611", "x.move_absolute(1 deg): ended: fault"]),
        (3, 9.0, ["the with block ended"]),
    ]
    assert lines(found) == [
        "  1     1.000 s  x.enable(), y.enable()",
        "  2     5.000 s  node 1: 0x8611",
        "                 x.move_absolute(1 deg): ended: fault",
        "  3     9.000 s  the with block ended",
    ]


def test_too_many_words_are_counted_and_long_ones_cut_short():
    events = [RecordedEvent(float(number), "nmt", "node 1", "is lost " * 60) for number in range(100)]
    told = lines(flags(events, 0.0, 100.0))
    assert told[-1] == "     and 72 more lines"
    assert len(told) == 29
    assert max(map(len, told)) <= 170
