"""The image in shared memory is whole, of one cycle, and never keeps its writer waiting."""

from __future__ import annotations

import itertools
import mmap
import sys
from collections.abc import Callable
from contextlib import suppress
from types import FrameType

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.cia402.state import PowerState
from axisbus.errors import DriveError
from axisbus.ipc import image
from axisbus.ipc.image import ImageReader, ImageWriter
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState

NAMES = ("x", "y", "z")
ERROR = DriveError("x: something", axis="x")
NUMBER = st.integers(-(2**62), 2**62)
MAYBE = st.none() | NUMBER
OVERRIDE = st.floats(0.0, 1.5)
TIME = st.floats(allow_nan=False)
AXIS = st.builds(
    Snapshot,
    TIME,
    st.sampled_from(AxisState),
    st.sampled_from(PowerState),
    st.none() | st.integers(0, 0xFFFF),
    st.none() | st.integers(-128, 127),
    MAYBE,
    TIME,
    MAYBE,
    MAYBE,
    MAYBE,
    MAYBE,
    NUMBER,
    st.booleans(),
    st.booleans(),
    st.none(),
    OVERRIDE,
    OVERRIDE,
    st.integers(0, 2**40),
)


def ends(axes: int = len(NAMES)) -> tuple[ImageWriter, ImageReader]:
    memory = mmap.mmap(-1, image.size_of(axes))
    names = NAMES[:axes] if axes <= len(NAMES) else tuple(map(str, range(axes)))
    return ImageWriter(memory, names), ImageReader(memory, names, {3: ERROR}.get)


def axis(value: int) -> Snapshot:
    """An axis all of whose numbers are the same."""
    return Snapshot(
        float(value), AxisState.STANDSTILL, PowerState.OPERATION_ENABLED, value & 0xFFFF, 8, value, float(value), value, value,
        value, value, value, True, True, None,
    )  # fmt: skip


@given(st.dictionaries(st.sampled_from(NAMES), AXIS))
def test_every_image_is_read_as_it_was_written(axes):
    writer, reader = ends()
    writer.write(1.5, axes, {})
    assert dict(reader.read()) == axes
    assert reader.read().keys() == axes.keys()
    assert reader.read().time == 1.5


def test_before_the_first_image_there_is_no_axis():
    _, reader = ends()
    assert dict(reader.read()) == {}
    assert reader.number == 0
    with pytest.raises(KeyError):
        reader.read()["x"]
    assert reader.read().time == 0.0


def test_an_image_stays_as_it_was_when_the_next_ones_are_written():
    writer, reader = ends()
    writer.write(7.5, {"x": axis(1)}, {})
    first = reader.read()
    for value in range(2, 40):
        writer.write(value / 2, {"x": axis(value)}, {})
    assert first["x"] == axis(1)
    assert reader.read()["x"] == axis(39)
    assert reader.number == 39
    assert reader.read().time == 19.5


def test_an_error_is_found_by_its_number():
    writer, reader = ends()
    writer.write(7.5, {"x": axis(1), "y": axis(1)}, {"x": 3})
    assert reader.read()["x"].error is ERROR
    assert reader.read()["y"].error is None


def test_an_image_stored_as_bytes_is_unchanged():
    writer, reader = ends()
    writer.write(7.5, {"z": axis(5)}, {})
    kept = writer.newest
    writer.write(7.5, {"z": axis(6)}, {})
    assert dict(reader.image(kept)) == {"z": axis(5)}


def test_a_torn_image_is_not_taken():
    """The writer has filled all slots while the reader was between its two looks: the last valid image is kept."""
    memory = mmap.mmap(-1, image.size_of(1))
    writer, reader = ImageWriter(memory, ("x",)), ImageReader(memory, ("x",), {}.get)
    writer.write(7.5, {"x": axis(1)}, {})
    assert reader.read()["x"] == axis(1)
    writer.write(7.5, {"x": axis(2)}, {})
    at = 64 + 2 * len(writer.newest)
    memory[at : at + 8] = bytes(8)  # it has begun to write there again
    assert reader.read()["x"] == axis(1)
    memory[at : at + 8] = (2).to_bytes(8, "little")
    assert reader.read()["x"] == axis(2)


def before_each_line(run: Callable[[], object], then: Callable[[int], object]) -> int:
    """Run a function, and ``then`` with a count before each line of it in the module of the image; return how often."""
    count, tracer_before = itertools.count(), sys.gettrace()

    def trace(frame: FrameType, event: str, _: object) -> Callable[..., object] | None:
        if frame.f_code.co_filename != image.__file__:
            return None
        if event == "line":  # while ``then`` runs, nothing is traced
            then(next(count))
        return trace

    sys.settrace(trace)
    try:
        run()
    finally:
        sys.settrace(tracer_before)
    return next(count)


def position_of(reader: ImageReader) -> int:
    """Read an image, and return the position that its first and its last axis have."""
    read = reader.read()
    (position,) = {read[MANY[0]].position, read[MANY[-1]].position}
    assert position is not None
    return position


MANY = tuple(map(str, range(12)))


def test_a_reader_gets_a_whole_image_whatever_line_of_a_write_has_been_reached():
    writer, reader = ends(len(MANY))
    seen: list[int] = []
    for value in range(1, 10):
        writer.write(0.0, dict.fromkeys(MANY, axis(2 * value)), {})
        after = dict.fromkeys(MANY, axis(2 * value + 1))
        lines = before_each_line(
            lambda after=after: writer.write(0.0, after, {}), lambda _: seen.append(position_of(reader))
        )
        assert lines > len(MANY)
        assert {2 * value, 2 * value + 1} >= set(seen[-lines:])
        assert position_of(reader) == 2 * value + 1
    assert seen == sorted(seen)


class BrokenOff(Exception):
    """Ends a write at an axis."""


class FirstAxes(dict[str, Snapshot]):
    """Axes of which only some are found before the write ends."""

    def __init__(self, value: int, count: int) -> None:
        super().__init__(dict.fromkeys(MANY[:count], axis(value)))

    def get(self, name: str, _: object = None) -> Snapshot:  # type: ignore[override]  # raises
        if name not in self:
            raise BrokenOff
        return self[name]


@pytest.mark.parametrize("axes", [0, 1, 6, 11])
@pytest.mark.parametrize("writes", [0, 1, 6, 7, 8, 9])
def test_a_reader_gets_a_whole_image_whatever_is_written_before_a_line_of_it(writes, axes):
    writer, reader = ends(len(MANY))
    values, seen = itertools.count(1), list[int]()

    def write() -> None:
        writer.write(0.0, dict.fromkeys(MANY, axis(next(values))), {})

    def write_at(line: int) -> None:
        """Write images, and leave the writer in the middle of the next one."""
        if line == chosen:
            for _ in range(writes):
                write()
            with suppress(BrokenOff):
                writer.write(0.0, FirstAxes(next(values), axes), {})

    chosen, lines = 0, 1
    while chosen < lines:
        write()
        lines = before_each_line(lambda: seen.append(position_of(reader)), write_at)
        chosen += 1
    assert lines > len(MANY)
    assert seen == sorted(seen)
