"""A node that sends nonsense, at boot and in operation: the machine and the other axis continue, and all can be closed."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from axisbus.cia301.dropped_frames import DropReason
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from kit import fuzz_frames as fuzz
from kit.faulty_node import MadNode, close
from kit.scenarios.simulated_bus import Line, enable, turning, until

MAD = 2  # the node of y
APART = '[groups.one]\naxes = ["x"]\n[groups.two]\naxes = ["y"]\n'
PATIENT = {
    "period": "50ms",
    "heartbeat": "400ms",
}  # a busy computer's own delays are no silence of the drives

# Its own identifiers, some unused ones, and 29 bits; none of a master or of x.
identifiers = st.one_of(
    st.sampled_from([0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700]).map(lambda base: base + MAD),
    st.sampled_from([0x7E4, 0x6F0, 0x7FF, 0x100]),
)
heartbeats = st.sampled_from([b"\0", b"\x05", b"\x7f", b"\x04", b"\x85", b"\x33", b"", b"\x05\0\0"])
emergencies = fuzz.mutated(
    st.sampled_from([bytes.fromhex("1086210102000000"), bytes(8), bytes.fromhex("2043080000000000")])
)
statuswords = fuzz.mutated(
    st.sampled_from([bytes.fromhex("3706000000000003"), bytes.fromhex("0800"), bytes(8), b"\xff" * 8])
)


@st.composite
def mad_frames(draw: st.DrawFn) -> can.Message:
    identifier = draw(identifiers)
    data = {
        0x700: heartbeats | fuzz.any_bytes,
        0x580: fuzz.sdo_answers.map(lambda each: each[:8]),
        0x080: emergencies.map(lambda each: each[:8]),
    }.get(identifier & 0x780, statuswords.map(lambda each: each[:8]) | fuzz.any_bytes)
    kind = draw(st.sampled_from(["data"] * 6 + ["extended", "remote"]))
    return can.Message(
        arbitration_id=identifier,
        data=None if kind == "remote" else draw(data),
        is_remote_frame=kind == "remote",
        is_extended_id=kind == "extended",
    )


@contextmanager
def line(folder: Path) -> Iterator[Line]:
    with Line(folder, "xy", more=APART, bus='on_lost_node = "group"', **PATIENT) as made:
        yield made


@contextmanager
def judged(cell: Line, machine: Machine) -> Iterator[None]:
    """Leave a failure aside where the computer was too busy to move the simulated drives, or to run the scan, in time."""
    try:
        yield
    except (AssertionError, AxisbusError):
        if cell.simulated_nodes._lost > 0.0 or machine._core.scan.starvation.text(time.monotonic()):
            pytest.skip("the computer was too busy to tell")
        raise


def about_y(errors: list[BaseException]) -> bool:
    return all(
        str(error).startswith(("y:", "axis y", "node 2")) or "y" in str(error).split(":")[0]
        for error in errors
    )


SOME = settings(
    max_examples=2,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=[
        HealthCheck.function_scoped_fixture,
        HealthCheck.too_slow,
        HealthCheck.data_too_large,
    ],
)


@given(st.lists(mad_frames(), min_size=20, max_size=60))
@SOME
@pytest.mark.timeout(300)
def test_in_operation_the_other_axis_continues_and_all_is_closed(tmp_path, frames):
    with line(tmp_path) as cell:
        machine = cell.open()
        try:
            with judged(cell, machine):
                turning(machine, cell)
                with MadNode(cell.channel, frames) as mad:
                    until(lambda: mad.rounds > 3 * len(frames), 40)
                    assert machine._core.scan.failure is None
                    assert machine["x"].error is None, machine["x"].error
                    cell.must_move("x")
                    assert len(machine.events) < 60
                    errors = close(machine)
                assert about_y(errors), errors
                cell.must_be_still("x", stages=(0, 1, 2, 3))
        finally:
            close(machine)


@given(st.lists(mad_frames(), min_size=20, max_size=60))
@SOME
@pytest.mark.timeout(300)
def test_at_boot_there_is_a_machine_or_one_clear_error_and_nothing_is_left_behind(tmp_path, frames):
    with line(tmp_path) as cell, MadNode(cell.channel, frames), fuzz.within(60):
        machine, errors = None, []
        try:
            machine = cell.open()
        except* AxisbusError as group:
            errors += group.exceptions
        assert errors or machine is not None
        if machine is not None:
            failure = machine._core.scan.failure
            left = close(machine)  # before it is judged: one that stays open is reported in every later test
            assert failure is None, failure
            assert about_y(left), left
        until(lambda: not any(thread.name.startswith("axisbus") for thread in threading.enumerate()), 15)
        assert not cell.was_energised("x")


class Spoiled:
    """Has a simulated drive send some of its frames spoiled: cut, with other bits, twice, or not at all."""

    def __init__(self, cell: Line, seed: int, share: float) -> None:
        self.spoiled = 0
        self._dice = random.Random(seed)
        self._share = share
        (slave,) = [node.slave for node in cell.simulated_nodes.nodes if node.slave.device.node_id == MAD]
        self._take = slave.take_frames
        slave.take_frames = self.take  # type: ignore[method-assign]

    def take(self) -> list[tuple[int, bytes]]:
        return [each for frame in self._take() for each in self._spoil(*frame)]

    def _spoil(self, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        dice = self._dice
        if dice.random() > self._share:
            return [(can_id, data)]
        self.spoiled += 1
        if not data:
            return []
        at, value = dice.randrange(len(data)), dice.randrange(256)
        ways = {
            "lost": [],
            "twice": [(can_id, data)] * 2,
            "cut": [(can_id, data[:at])],
            "byte": [(can_id, data[:at] + bytes([value]) + data[at + 1 :])],
            "bit": [(can_id, data[:at] + bytes([data[at] ^ 1 << value % 8]) + data[at + 1 :])],
            "command": [(can_id, bytes([value]) + data[1:])],
        }
        return ways[dice.choice(sorted(ways))]


@given(st.integers(0, 1 << 30), st.sampled_from([0.02, 0.1, 0.5]))
@SOME
@pytest.mark.timeout(300)
def test_a_node_with_damaged_frames_boots_or_gives_the_reason_and_disturbs_no_other(tmp_path, seed, share):
    with line(tmp_path) as cell, fuzz.within(80):
        spoiled = Spoiled(cell, seed, share)
        machine, errors = None, []
        try:
            machine = cell.open()
        except* AxisbusError as group:
            errors += group.exceptions
        assert spoiled.spoiled
        if machine is None:
            assert errors
            assert about_y(errors), errors
            return
        try:
            with judged(cell, machine):
                enable(machine["x"])
                machine["x"].move_velocity(90.0).wait(10)
                before = spoiled.spoiled
                until(lambda: spoiled.spoiled > before + 5, 20)
                assert machine._core.scan.failure is None
                assert machine["x"].error is None, machine["x"].error
                cell.must_move("x")
                errors += close(machine)
                assert about_y(errors), errors
                cell.must_be_still("x", stages=(0, 1, 2, 3))
        finally:
            close(machine)


def test_frames_of_a_faulty_node_are_counted_and_reported_once_in_a_second(tmp_path):
    frames = [  # each state lasts longer than a scan period, in a rhythm of its own
        can.Message(arbitration_id=0x702, data=b"\x7f", is_extended_id=False),
        *[can.Message(arbitration_id=0x182, data=b"\x37", is_extended_id=False)] * 3,
        *[can.Message(arbitration_id=0x082, data=b"\x11", is_extended_id=False)] * 3,
        can.Message(arbitration_id=0x702, data=b"\x05", is_extended_id=False),
        *[can.Message(arbitration_id=0x582, data=bytes(8), is_extended_id=False)] * 6,
    ]
    with line(tmp_path) as cell:
        machine = cell.open()
        try:
            began = time.monotonic()
            with MadNode(cell.channel, frames, 0.01) as mad:
                until(lambda: mad.rounds > 140, 20)
            lasted = time.monotonic() - began
            counted = {drop.fault: drop.count for drop in machine.dropped_frames if drop.node == MAD}
            assert {DropReason.EMCY, DropReason.SDO} <= set(counted)
            assert counted[DropReason.EMCY] >= 15
            told = [event for event in machine.node(MAD).events if event.kind.name == "STATE"]
            assert 1 <= len(told) <= lasted + 2
            assert machine["x"].error is None
        finally:
            close(machine)
