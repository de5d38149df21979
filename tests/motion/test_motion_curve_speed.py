"""The speed of a curve at its samples: 0 where the path rests, that of the parabola everywhere else."""

from __future__ import annotations

import pytest

from axisbus.motion.moves.remote_trajectory import Curve

STEP, SMALL = 0.5, 1e-6


def speed_before_and_after(positions, index):
    """The speed just before and just after a sample."""
    curve = Curve(
        STEP, 0, tuple(STEP * number for number in range(len(positions))), tuple(map(float, positions))
    )
    t = STEP * index
    return (
        (curve.at(t) - curve.at(t - SMALL)) / SMALL,
        (curve.at(t + SMALL) - curve.at(t)) / SMALL,
    )


@pytest.mark.parametrize(
    ("positions", "index", "expected"),
    [
        ((0, 1, 2, 3), 1, 2.0),
        ((0, 1, 2, 3), 2, 2.0),
        ((0, 1, 3, 6), 1, 3.0),  # the mean of both slopes
        ((0, 1, 1, 3, 5), 1, 1.0),  # one interval without motion is no standstill
        ((0, 1, 1, 3, 5), 2, 2.0),
        ((0, 0, 0, 1, 2), 2, 0.0),  # two are one
        ((0, 1, 2, 2, 2), 2, 0.0),
        ((-1, 0, 0, 0, 5, 9), 1, 0.0),
        ((-1, 0, 0, 0, 5, 9), 3, 0.0),
    ],
)
def test_the_speed_at_a_sample(positions, index, expected):
    before, after = speed_before_and_after(positions, index)
    assert before == pytest.approx(expected, abs=1e-4)
    assert after == pytest.approx(expected, abs=1e-4)


def test_a_path_is_at_standstill_at_its_ends():
    times, positions = (0.0, 0.5, 1.0), (0.0, 3.0, 1.0)
    curve = Curve(STEP, 0, times, positions)
    assert (curve.at(SMALL) - curve.at(0.0)) / SMALL == pytest.approx(0.0, abs=1e-3)
    assert (curve.at(1.0) - curve.at(1.0 - SMALL)) / SMALL == pytest.approx(0.0, abs=1e-3)
    assert [curve.at(t) for t in times] == list(positions)
