"""The state of a CAN controller from error frames and from the driver's own state: one event for each change."""

from __future__ import annotations

import pytest

from axisbus.bus.link.controller import HISTORY, CanController, CanErrorState, ErrorCounters

OFF, WARNING, PASSIVE, ACTIVE = (
    CanErrorState.OFF,
    CanErrorState.WARNING,
    CanErrorState.PASSIVE,
    CanErrorState.ACTIVE,
)


def controller_bits(status: int, transmit: int = 0, receive: int = 0) -> bytes:
    return bytes([0, status, 0, 0, 0, 0, transmit, receive])


def test_each_change_is_one_event_with_its_time_and_counters():
    made = CanController("can0")
    assert made.condition is ACTIVE
    warned = made.error_frame(0x04, controller_bits(0x08, 96, 3), 1.0)
    assert (warned.stamp, warned.channel, warned.condition, warned.counters, warned.restarted) == (
        1.0,
        "can0",
        WARNING,
        ErrorCounters(96, 3),
        False,
    )
    assert made.error_frame(0x04, controller_bits(0x08, 100, 3), 2.0) is None
    assert made.counters == ErrorCounters(100, 3)
    assert made.error_frame(0x80, bytes(8), 2.5) is None
    assert made.error_frame(0x04, controller_bits(0x20), 3.0).condition is PASSIVE
    assert made.counters == ErrorCounters(100, 3)
    assert made.error_frame(0x40, bytes(8), 4.0).condition is OFF
    assert made.error_frame(0x40, bytes(8), 4.5) is None
    restarted = made.error_frame(0x100, bytes(8), 5.0)
    assert (restarted.condition, restarted.restarted, restarted.counters, made.counters) == (
        ACTIVE,
        True,
        None,
        None,
    )
    assert [event.stamp for event in made.events] == [1.0, 3.0, 4.0, 5.0]
    assert str(warned) == "the CAN controller of can0 is error warning (transmit errors 96, receive errors 3)"
    assert str(restarted).endswith(
        "has been restarted and takes part in the bus again: check every node again"
    )


def test_a_restart_is_reported_even_if_its_bus_off_was_not_received():
    made = CanController("can0")
    event = made.error_frame(0x100, bytes(8), 1.0)
    assert (event.condition, event.restarted) == (ACTIVE, True)


@pytest.mark.parametrize(
    ("seen", "told"),
    [
        ([True], [OFF]),
        ([False], []),
        ([True, True], [OFF]),
        ([True, False], [OFF, ACTIVE]),
        ([True, False, False, True], [OFF, ACTIVE, OFF]),
    ],
)
def test_the_driver_s_own_state_reports_bus_off(seen, told):
    made = CanController("can0")
    events = [made.state(off, float(number)) for number, off in enumerate(seen)]
    assert [event.condition for event in events if event is not None] == told
    assert [event.stamp for event in events if event is not None] == [event.stamp for event in made.events]
    assert all(event is None or event.stamp == float(number) for number, event in enumerate(events))
    assert all(event.restarted is (event.condition is ACTIVE) for event in made.events)


def test_a_bus_off_reported_by_a_frame_is_not_taken_back_by_the_state():
    made = CanController("can0")
    made.error_frame(0x40, bytes(8), 1.0)
    assert made.state(False, 2.0) is None
    assert made.condition is OFF
    assert made.state(True, 3.0) is None
    other = CanController("can0")
    other.state(True, 1.0)
    other.error_frame(0x100, bytes(8), 2.0)
    assert other.state(False, 3.0) is None
    passive = CanController("can0")
    passive.state(True, 1.0)
    passive.error_frame(0x04, controller_bits(0x20), 2.0)
    assert passive.condition is PASSIVE
    assert passive.state(False, 3.0) is None


def test_the_last_64_events_are_kept():
    made = CanController("can0")
    for number in range(100):
        made.error_frame(0x40 if number % 2 else 0x100, bytes(8), float(number))
    assert (HISTORY, len(made.events), made.events[0].stamp) == (64, 64, 36.0)
