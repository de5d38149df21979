"""States of the axis, and those that can be requested (manual v2.2, 4.1.2; the other names are from owners' reports)."""

from __future__ import annotations

IDLE = 1
CLOSED_LOOP = 8

STATES = {
    1: "idle",
    2: "start-up",
    3: "full calibration",
    4: "motor calibration",
    5: "sensorless control",
    6: "encoder index search",
    7: "encoder calibration",
    8: "closed loop",
    9: "lock-in spin",
    10: "encoder direction search",
    11: "homing",
    12: "Hall polarity calibration",
    13: "Hall phase calibration",
    14: "anticogging or inertia calibration",
    15: "encoder linearisation",
    16: "motor dead-time calibration",
}
# The manual also lists 0 (undefined), for which there is no use.
REQUESTED_STATES = {state: STATES[state] for state in (IDLE, 3, 4, 7, CLOSED_LOOP)}


def state_words(state: int) -> str:
    """Return the name of a state; for an unknown state, its number."""
    return STATES.get(state, f"state {state}, which the manual does not name")
