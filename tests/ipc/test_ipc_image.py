"""The image in shared memory is whole, of one cycle, and never keeps its writer waiting."""

from __future__ import annotations

import mmap
import sys
import threading
from collections.abc import Iterator

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


@pytest.fixture
def threads_alternate_quickly() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("threads_alternate_quickly")
def test_no_reader_ever_sees_values_of_two_cycles():
    writer, reader = ends(12)
    names = [str(number) for number in range(12)]
    over = threading.Event()

    def write() -> None:
        value = 0
        while not over.is_set():
            value += 1
            writer.write(0.0, dict.fromkeys(names, axis(value)), {})

    thread = threading.Thread(target=write)
    thread.start()
    seen: list[int] = []
    try:
        while len(seen) < 100:  # however seldom a busy computer lets both run
            values = {each.position for each in reader.read().values()}
            assert len(values) <= 1
            seen += values - set(seen[-1:])
    finally:
        over.set()
        thread.join()
    assert seen == sorted(set(seen))
