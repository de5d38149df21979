"""The scope's MCAP files: read back by the library's own reader, with the values that the page has sent; junk makes none."""

from __future__ import annotations

import asyncio
import io
import json
import math
import struct
import time
from array import array
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.requests import Request

from axisbus.errors import ArgumentError
from axisbus.machine.machine import Machine
from axisbus.record.columns import NAMES
from axisbus.record.load import load
from axisbus.web.access.limits import SAVE_SAMPLES, max_bytes
from axisbus.web.access.middleware import SESSION
from axisbus.web.access.tokens import PageSession, Role
from axisbus.web.scope import saving
from axisbus.web.scope.saving import ScopeRoutes, mcap, read
from kit.cell import cell_file

pytest.importorskip("mcap", reason="the extra record is not installed")
SIGNALS = ("x.position", "x.velocity", "y.position")


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    path = cell_file(tmp_path, "xy")
    with Machine.simulated(path) as machine:
        yield machine


def packed(times: list[float], **values: list[float]) -> bytes:
    """The message of a page; a point of a signal's name is an underscore here."""
    names = json.dumps([name.replace("_", ".", 1) for name in values]).encode()
    columns = b"".join(array("f", each).tobytes() for each in values.values())
    return struct.pack("<II", len(times), len(names)) + names + array("d", times).tobytes() + columns


def test_a_file_is_read_back_with_the_values_that_were_shown(machine, tmp_path):
    times = [1000.0 + 0.01 * n for n in range(500)]
    position = [math.sin(n / 50) * 90 for n in range(500)]
    velocity = [math.nan if n < 100 else n / 3 for n in range(500)]
    target = tmp_path / "scope.mcap"
    target.write_bytes(
        mcap(machine, packed(times, x_position=position, x_velocity=velocity, y_position=position))
    )
    found = load(target)
    assert found.lacks == ""
    assert set(found.tracks) == {"x", "y"}
    x, y = found.tracks["x"], found.tracks["y"]
    assert list(x.times) == pytest.approx([0.01 * n for n in range(500)], abs=1e-6)
    assert list(x.columns["position"]) == list(array("f", position)) == list(y.columns["position"])
    assert list(x.columns["velocity"])[100:] == list(array("f", velocity))[100:]
    assert all(math.isnan(value) for value in list(x.columns["velocity"])[:100])
    assert all(math.isnan(value) for value in y.columns["velocity"])
    assert (x.units["position"], x.units["velocity"]) == ("deg", "deg/s")
    assert set(x.columns) == set(NAMES)
    assert found.facts["from"] == "data shown on the scope of a page"
    assert found.facts["drives"] == "simulated"


def test_an_unknown_value_is_left_out_as_the_schema_of_its_channel_requires(machine):
    from mcap.reader import make_reader

    data = mcap(machine, packed([1000.0, 1000.01], x_position=[1.0, 2.0], x_velocity=[math.nan, 3.0]))
    messages = make_reader(io.BytesIO(data)).iter_messages(topics=["axis/x"])
    assert [json.loads(message.data) for _, _, message in messages] == [
        {"position": 1.0},
        {"position": 2.0, "velocity": 3.0},
    ]


def test_the_time_of_day_is_that_of_the_samples_and_not_of_the_saving(machine, tmp_path):
    begun = time.monotonic() - 600.0
    target = tmp_path / "scope.mcap"
    target.write_bytes(mcap(machine, packed([begun, begun + 1.0], x_position=[1.0, 2.0])))
    ago = datetime.now(UTC) - load(target).began
    assert abs(ago - timedelta(seconds=600)) < timedelta(seconds=5)


def test_a_saved_scope_is_plotted_and_exported_like_a_recording(machine, tmp_path):
    from axisbus.record.export import write_csv
    from axisbus.record.plot import plot

    target = tmp_path / "scope.mcap"
    target.write_bytes(mcap(machine, packed([1.0, 1.01, 1.02], x_position=[1.0, 2.0, 3.0])))
    write_csv(load(target), tmp_path / "scope.csv")
    assert "x.position [deg]" in (tmp_path / "scope.csv").read_text("utf-8")
    assert plot(target, tmp_path / "scope.png").stat().st_size > 1000


GOOD = packed([1.0, 2.0], x_position=[1.0, 2.0])


@pytest.mark.parametrize(
    "data",
    [
        b"",
        GOOD[:-1],
        GOOD + b"\0",
        GOOD[:8],
        packed([], x_position=[]),
        packed([2.0, 1.0], x_position=[1.0, 2.0]),
        packed([math.nan], x_position=[1.0]),
        packed([math.inf], x_position=[1.0]),
        packed([1.0], z_position=[1.0]),
        packed([1.0], x_state=[1.0]),
        GOOD.replace(b'["x.position"]', b'["x.pos","."]'),
        GOOD.replace(b'["x.position"]', b"[[[[[[[[[[[[[["),
        GOOD.replace(b'["x.position"]', b"[        100]"),
        struct.pack("<II", 0xFFFF_FFFF, 0xFFFF_FFFF) + b"x" * 100,
    ],
)
def test_an_invalid_message_is_refused(machine, data):
    assert read(data, SIGNALS) is None
    with pytest.raises(ArgumentError, match="do not belong to this page"):
        mcap(machine, data)


@given(st.binary(max_size=300))
def test_no_bytes_are_a_mistake(data):
    read(data, SIGNALS)


def test_a_signal_twice_or_more_samples_than_a_browser_keeps_are_refused(monkeypatch):
    twice = json.dumps(["x.position"] * 2).encode()
    data = (
        struct.pack("<II", 1, len(twice))
        + twice
        + array("d", [1.0]).tobytes()
        + array("f", [1.0, 1.0]).tobytes()
    )
    assert read(data, SIGNALS) is None
    monkeypatch.setattr(saving, "MAX_SAMPLES", 1)
    assert read(GOOD, SIGNALS) is None


# -- the request ----------------------------------------------------------------------------------------------------------


def answered(routes: ScopeRoutes, *bodies: bytes, browsers: tuple[int, ...] = ()) -> Any:
    """Send requests of browsers, of the first one if none is given, at once; return their answers."""

    def request(body: bytes, browser: int) -> Request:
        coming = [{"type": "http.request", "body": body}]

        async def receive() -> dict[str, Any]:
            await asyncio.sleep(0.01)
            return coming.pop()

        session = PageSession(browser, Role.OBSERVER)
        shown = {"type": "http", "method": "POST", "query_string": b"", "headers": [], SESSION: session}
        return Request(shown, receive)

    async def all_of() -> Any:
        given = zip(bodies, browsers or [1] * len(bodies), strict=True)
        return await asyncio.gather(*(routes.save(request(*each)) for each in given))

    return asyncio.run(all_of())


def test_one_file_of_a_browser_is_made_at_a_time_and_errors_are_reported(machine, monkeypatch):
    routes = ScopeRoutes(machine)
    made, busy, other = answered(routes, GOOD, GOOD, GOOD, browsers=(1, 1, 2))
    assert made.body.startswith(b"\x89MCAP")
    assert other.body.startswith(b"\x89MCAP")
    assert "another file of this browser" in json.loads(busy.body)["error"]["message"]
    (junk,) = answered(routes, b"junk")
    assert "do not belong to this page" in json.loads(junk.body)["error"]["message"]

    def full(*_: object) -> bytes:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("axisbus.web.scope.saving.mcap", full)
    (told,) = answered(routes, GOOD)
    assert "No space left" in json.loads(told.body)["error"]["observed"]


def test_as_much_as_a_browser_keeps_of_ten_signals_may_be_sent():
    assert max_bytes(SAVE_SAMPLES) > 10 * 4 * saving.MAX_SAMPLES + 8 * saving.MAX_SAMPLES + 4096


@pytest.mark.parametrize("there", [True, False])
def test_without_the_package_the_button_names_it(monkeypatch, there):
    pytest.importorskip("nicegui", reason="the page needs nicegui")
    from nicegui import Client, ui

    from axisbus.web.page.page import scope_view

    monkeypatch.setattr(saving, "find_spec", lambda _: there or None)
    with Client(ui.page("/")) as client:
        scope_view("cell")
    (button,) = [
        each for each in client.elements.values() if getattr(each, "text", "").startswith("Save MCAP")
    ]
    assert button.text == ("Save MCAP" if there else "Save MCAP: needs axisbus[record]")
    assert ("disabled" in button.props) is not there
