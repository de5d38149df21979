"""Cams and the curves into step, as functions: their smoothness is seen by differences."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus import Cam
from axisbus.errors import ArgumentError
from axisbus.ipc.messages import CODEC
from axisbus.motion.commands import PhaseBy
from axisbus.motion.coupling.definition import CamLaw, Gear, SlaveReference
from axisbus.motion.coupling.engagement import SyncCurve
from axisbus.motion.coupling.slave_axis import PhaseShift

SAME = settings(deadline=None, derandomize=True)
PLACES = st.floats(-50.0, 50.0)
POINTS = st.lists(st.tuples(st.floats(0.5, 20.0), PLACES), min_size=2, max_size=12).map(
    lambda steps: [
        (sum(step for step, _ in steps[: n + 1]), position) for n, (_, position) in enumerate(steps)
    ]
)


def slope(curve, at: float, h: float = 1e-5) -> float:
    return (curve(at + h) - curve(at - h)) / (2.0 * h)


@SAME
@given(POINTS, st.booleans())
def test_a_cam_passes_through_its_points_without_a_jump_in_slope_or_curvature(points, periodic):
    cam = Cam(points, periodic=periodic)
    law = cam._transfer_function()
    scale = 1.0 + max(abs(position) for _, position in points)
    for master, position in points[:-1]:
        assert cam.at(master) == pytest.approx(position, abs=1e-9 * scale)
    assert cam.at(points[-1][0] - 1e-12) == pytest.approx(points[-1][1], abs=1e-6 * scale)
    inner = [master for master, _ in points[1:-1]] + ([points[0][0], points[-1][0]] if periodic else [])
    for master in inner:
        before, after = law.at(master - 1e-9), law.at(master + 1e-9)
        steep = 1.0 + abs(before.slope) + abs(before.bend)
        assert before.slope == pytest.approx(after.slope, abs=1e-6 * scale * steep)
        assert before.bend == pytest.approx(after.bend, abs=1e-6 * scale * steep)


@SAME
@given(POINTS, st.booleans(), st.floats(-3.0, 3.0))
def test_slope_and_span_of_a_cam_agree_with_its_positions(points, periodic, where):
    cam = Cam(points, periodic=periodic)
    law, at = cam._transfer_function(), points[0][0] + where * (points[-1][0] - points[0][0])
    beside = [(at - master) % law.period for master, _ in points]
    if any(min(distance, law.period - distance) < 1e-3 for distance in beside):
        return
    due = law.at(at)
    assert due.slope == pytest.approx(slope(lambda m: law.at(m).position, at), rel=1e-3, abs=1e-3)
    assert due.bend == pytest.approx(slope(lambda m: law.at(m).slope, at), rel=1e-3, abs=1e-3)
    assert cam.span[0] - 1e-9 <= due.position - law.accumulated_lift(at) <= cam.span[1] + 1e-9


def test_a_periodic_cam_is_a_sine_through_few_points_of_one():
    points = [(n * 30.0, math.sin(math.radians(n * 30.0))) for n in range(13)]
    cam = Cam(points, periodic=True)
    far = max(abs(cam.at(m) - math.sin(math.radians(m))) for m in range(-720, 720))
    assert far < 1e-3


def test_a_cam_is_stretched_and_shifted():
    cam = Cam([(0.0, 0.0), (10.0, 4.0), (30.0, 6.0)], periodic=True)
    law = cam._transfer_function(phase=5.0, master_scale=2.0, scale=-0.5)
    for m in range(-100, 100, 7):
        assert law.at(m).position == pytest.approx(-0.5 * cam.at((m + 5.0) / 2.0))
        assert law.at(m).slope == pytest.approx(slope(lambda at: law.at(at).position, m), rel=1e-4, abs=1e-6)


def test_laws_cross_to_the_core_as_they_are():
    cam = Cam([(0.0, 0.0), (10.0, 4.0), (30.0, 0.0)], periodic=True)._transfer_function()
    for law in (Gear(0.5), cam):
        assert CODEC.unpack(CODEC.pack(law)) == law
    assert isinstance(cam, CamLaw)


@SAME
@given(PLACES, st.floats(0.1, 50.0), st.booleans(), *[st.floats(-20.0, 20.0)] * 5)
def test_a_blend_joins_position_slope_and_curvature(begin, length, back, p, s, q, u, b):
    end = begin - length if back else begin + length
    blend = SyncCurve(begin, end, SlaveReference(p, s, 0.0), SlaveReference(q, u, b))
    large = 1.0 + max(map(abs, (p, q))) + length * max(map(abs, (s, u))) + length**2 * abs(b)
    assert blend.at(begin) == pytest.approx(p, abs=1e-9 * large)
    assert blend.at(end) == pytest.approx(q, abs=1e-9 * large)
    h = 1e-4 * (end - begin)
    assert (blend.at(begin + h) - p) / h == pytest.approx(s, abs=1e-2 * large / length)
    last = (q - blend.at(end - h)) / h
    assert last == pytest.approx(u, abs=1e-2 * large / length)
    assert blend.at(begin - h) == pytest.approx(p - s * h, abs=1e-9 * large)
    ahead = [blend.at(begin + share * (end - begin)) for share in (0.0, 1e-3, 2e-3)]
    assert abs(ahead[2] - 2 * ahead[1] + ahead[0]) < 1e-5 * large * 20


def test_a_blend_from_standstill_to_standstill_never_reverses():
    blend = SyncCurve(0.0, 10.0, SlaveReference(0.0, 0.0, 0.0), SlaveReference(5.0, 0.0, 0.0))
    places = [blend.at(n / 10.0) for n in range(101)]
    assert all(a <= b for a, b in pairwise(places))


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([(0.0, 1.0)], "2 to 1000 points, this one has 1"),
        ([(0.0, 1.0), (0.0, 2.0)], "must increase from point to point"),
        ([(0.0, 1.0), (1.0, math.inf)], "finite"),
        ([(0.0, 1.0), (1.0,)], "are not points of a cam"),
        (7, "are not points of a cam"),
        ([(0.0, 0.0), (10.0, 5.0), (1e308, 0.0)], "cannot be computed"),
        ([(0.0, 0.0), (1e-300, 1e300), (1.0, 0.0)], "cannot be computed"),
        ([(n, 0.0) for n in range(1001)], "has 1001"),
    ],
)
def test_an_invalid_cam_is_refused(points, words):
    with pytest.raises(ArgumentError, match=words):
        Cam(points)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("master,slave\n0,0\n90;20\n", r"cam.csv, line 3: not a point of a cam"),
        ("master,slave\n0,0\n90,twenty\n", r"line 3"),
        ("0,0\n90,20,1\n", r"line 2"),
        ("0,0\n", r"cam.csv: a cam has 2 to 1000 points"),
        ("", r"cam.csv: a cam has 2 to 1000 points, this one has 0"),
    ],
)
def test_a_file_that_holds_no_cam_is_reported_by_its_line(tmp_path, text, words):
    file = tmp_path / "cam.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ArgumentError, match=words):
        Cam.read(file)


def test_a_cam_is_read_from_a_file(tmp_path):
    file = tmp_path / "cam.csv"
    file.write_text("\ufeffmaster,slave\n0,0\n\n90,20\n360,0\n", encoding="utf-8")
    cam = Cam.read(file, periodic=True)
    assert (cam.at(90.0), cam.master_span, cam.lift) == (20.0, (0.0, 360.0), 0.0)
    with pytest.raises(ArgumentError, match="cannot be read as a cam"):
        Cam.read(tmp_path / "none.csv")


@pytest.mark.parametrize("seed", range(20))
def test_a_phase_shift_keeps_its_limits_however_often_it_is_changed(seed):
    chance, period = random.Random(seed), 0.004
    phase, places, total = PhaseShift(period), [0.0, 0.0], 0.0
    for _ in range(12):
        shift = chance.uniform(-20.0, 20.0)
        total += shift
        phase.change(PhaseBy(shift, 15.0, 60.0))
        for _ in range(chance.randint(1, 400)):
            phase.step()
            places.append(phase.value)
    while not phase.over:
        phase.step()
        places.append(phase.value)
    assert phase.value == pytest.approx(total)
    speeds = [(after - before) / period for before, after in pairwise(places)]
    assert max(map(abs, speeds)) <= 15.0 * (1.0 + 1e-9)
    assert max(abs(after - before) / period for before, after in pairwise(speeds)) <= 60.0 * (1.0 + 1e-6)
