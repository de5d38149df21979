"""The dead-man check: a held command continues from message to message; a late message never revives it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.client_support.dead_man import DeadMan

OFFSET = 1000.0  # by which the clock of the server is ahead of that of the page


def beaten(
    dead: DeadMan, sent: float, *, lag: float = 0.01, press: int = 1, axis: str = "x", way: float = 1.0
) -> DeadMan:
    return dead.beaten(press, axis, way, sent, sent + OFFSET + lag)


def test_a_jog_continues_for_as_long_as_the_heartbeat_of_the_button_arrives():
    dead = DeadMan()
    for beat in range(200):
        dead = beaten(dead, beat * 0.05)
        assert (dead.held, dead.axis, dead.direction) == (True, "x", 1.0)
        assert not dead.silent(beat * 0.05 + OFFSET + 0.19)
        assert dead.silent(beat * 0.05 + OFFSET + 0.25)


def test_after_a_silence_no_message_of_that_press_revives_it():
    dead = beaten(DeadMan(), 0.0)
    for sent in (0.25, 0.3, 0.35):
        dead = beaten(dead, sent)
        assert not dead.held
    assert beaten(dead, 0.4, press=2).held


def test_an_ended_jog_needs_another_press():
    dead = beaten(DeadMan(), 0.0).ended()
    assert not beaten(dead, 0.05).held
    assert not beaten(dead, 0.05, press=0).held
    assert beaten(dead, 0.1, press=2).held


def test_a_burst_of_delayed_beats_moves_nothing():
    dead = DeadMan().updated(0.0, OFFSET + 0.01)
    dead = beaten(dead, 1.0)
    late = 3.0 + OFFSET  # all at once
    for beat in range(1, 40):
        dead = dead.beaten(1, "x", 1.0, 1.0 + beat * 0.05, late)
        assert not dead.held


def test_a_stream_that_is_even_but_late_moves_nothing():
    dead = DeadMan().updated(0.0, OFFSET + 0.01)
    for beat in range(20):
        dead = beaten(dead, 1.0 + beat * 0.05, lag=0.3)
        assert not dead.held
    assert beaten(dead, 3.0, press=2, lag=0.15).held


def test_a_press_that_began_too_late_stays_ended():
    dead = beaten(DeadMan().updated(0.0, OFFSET + 0.01), 1.0, lag=0.5)
    assert not dead.held
    assert not beaten(dead, 1.6).held


def test_another_axis_or_direction_is_another_press():
    dead = beaten(DeadMan(), 0.0)
    assert not beaten(dead, 0.05, axis="y").held
    assert not beaten(dead, 0.05, way=-1.0).held


@pytest.mark.parametrize("rate", [0.9995, 1.0005])
def test_clocks_that_run_apart_do_not_stop_a_jog_after_hours(rate):
    dead = DeadMan()
    for beat in range(4 * 3600):
        dead = dead.updated(float(beat), OFFSET + beat * rate + 0.01)
    now = 4 * 3600.0
    assert dead.beaten(1, "x", 1.0, now, OFFSET + now * rate + 0.01).held


@given(
    st.lists(
        st.tuples(
            st.floats(0.0, 0.5), st.floats(0.0, 0.6), st.integers(1, 3), st.sampled_from(["beat", "end"])
        ),
        max_size=60,
    )
)
def test_for_any_messages_a_held_press_was_renewed_in_time(events):
    """An oracle of its own: of a held press a message came in time within 0.2 s, and since it began there was no end or gap."""
    dead, now, sent, best = DeadMan(), OFFSET, 0.0, None
    alive, last, highest = 0, 0.0, 0
    for pause, lag, press, what in events:
        now, sent = max(now, sent + OFFSET) + pause, sent + pause
        now = max(now, sent + OFFSET + lag)
        if what == "end":
            dead, alive = dead.ended(), 0
            continue
        dead = dead.beaten(press, "x", 1.0, sent, now)
        best = now - sent if best is None else min(best, now - sent)
        fresh = press > highest
        broken = not fresh and (press != alive or now - last > 0.2)
        if broken or now - sent - best > 0.2 + 0.001 * 60 * 0.6:
            alive = 0
        else:
            alive, last = press, now
        highest = max(highest, press)
        if dead.held:
            assert dead.press == alive
            assert now - dead.last_signal == 0.0
