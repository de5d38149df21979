"""Whether 6062h is the demand of the axis: judged by its behaviour, and compared with the position of the same time."""

from __future__ import annotations

import pytest

from axisbus.cia402.port import Capabilities, Inputs, Sample, ValueTransport
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.axis.reference import OWN, DemandTrust, ReferenceTracker
from axisbus.motion.parameters import DemandUse

PP, PV, TQ, HM, CSP = 1, 3, 4, 6, 8
ENABLED = 0x0237
T = 0.01
WINDOW = 500.0


def judged(
    *samples: tuple[int, float], mode: int = PP, set_points: tuple[int, ...] = (10_000,)
) -> DemandTrust:
    """Look at (demand, how far it is ahead of the axis), one after the other."""
    trust = DemandTrust(DemandUse.AUTO, WINDOW)
    for target in set_points:
        trust.add_set_point(target)
    for demand, lead in samples:
        trust.look(demand, lead, 0.0, mode)
    return trust


def test_a_demand_ahead_of_the_axis_towards_its_target_is_trusted_after_three_samples():
    ahead = [(0, 0), (100, 90), (200, 180), (300, 270)]
    assert not judged(*ahead[:3]).trusts(PP)
    assert judged(*ahead).trusts(PP)
    assert judged(*((-demand, -lead) for demand, lead in ahead)).trusts(PP)


@pytest.mark.parametrize(
    ("what", "samples"),
    [
        ("stays 0", [(0, -100 * number) for number in range(40)]),
        ("stays 0 at an axis that comes nearer", [(0, 4000 - 100 * number) for number in range(60)]),
        ("is the target at once", [(0, 0), *((10_000, 10_000 - 100 * number) for number in range(60))]),
        ("is 6064h", [(100 * number, 0.0) for number in range(60)]),
        ("is 6064h, late", [(100 * number, -100.0) for number in range(60)]),
        ("was far off before it moved", [(5000 + 100 * number, 5000.0) for number in range(20)]),
        ("goes back to the axis", [(0, 0), (400, 400), (300, 300), (200, 200), (100, 100)]),
        ("moves less than a quiet value wanders", [(number % 5, OWN * (number % 2)) for number in range(40)]),
    ],
)
def test_a_demand_that_does_not_run_ahead_is_not_trusted(what, samples):
    assert not judged(*samples).trusts(PP), what


def test_set_points_in_quick_succession_are_no_demand_of_the_drives_own():
    """Polled, 6062h is one of the set-points before."""
    targets = tuple(range(1000, 9000, 1000))
    samples = [(0, 0.0), *((target, 400.0) for target in targets[:-1])]
    assert not judged(*samples, set_points=targets).trusts(PP)


def test_a_6062h_seen_in_pp_counts_in_every_mode_and_otherwise_in_its_mode_only():
    ahead = [(100 * number, 90.0 * number) for number in range(5)]
    assert all(judged(*ahead).trusts(mode) for mode in (PP, PV, CSP))
    in_csp = judged(*ahead, mode=CSP)
    assert (in_csp.trusts(CSP), in_csp.trusts(PP)) == (True, False)
    assert not any(judged(*ahead, mode=mode).trusts(mode) for mode in (HM, TQ))


def test_the_cell_file_may_decide_whether_6062h_counts():
    assert DemandTrust(DemandUse.USE, WINDOW).trusts(PP)
    ignored = DemandTrust(DemandUse.IGNORE, WINDOW)
    for number in range(5):
        ignored.look(100 * number, 90.0 * number, 0.0, PP)
    assert not ignored.trusts(PP)


def test_a_drive_that_leaves_its_state_or_mode_is_judged_from_the_beginning():
    trust = judged((0, 0), (100, 90), (200, 180))
    trust.begin()
    trust.look(300, 270.0, 0.0, PP)
    assert not trust.trusts(PP)
    reference_tracker = ReferenceTracker(DemandUse.AUTO, WINDOW)
    reference_tracker.note(1.0, PP, None, 10_000, True)
    for demand, lead in ((0, 0.0), (100, 90.0), (200, 180.0)):
        reference_tracker.trust.look(demand, lead, 0.0, PP)
    reference_tracker.note(2.0, CSP, None, None, False)
    reference_tracker.note(3.0, PP, None, None, False)
    reference_tracker.trust.look(300, 270.0, 0.0, PP)
    assert not reference_tracker.trust.trusts(PP)


# Two values are compared as of one time.


class Drive:
    """Positions by one transport and demands by another, each with its stamp."""

    def __init__(self, position: ValueTransport, demand: ValueTransport, age: float = 0.8) -> None:
        sources = {"statusword": ValueTransport.SYNC_PDO, "position": position, "demand": demand}
        self.image = AxisImage(
            Capabilities(sources, {}, True, {"demand": age}), T, 2.0, 0.05, DemandUse.USE, WINDOW
        )
        self.now = 10.0
        self._position: Sample | None = None
        self._demand: Sample | None = None

    def cycle(self, position: int | None = None, demand: int | None = None, mode: int = PP, ago: float = 0.0):
        """One cycle with these values new, the demand received ``ago`` s before its end."""
        self.now += T
        if position is not None:
            self._position = Sample(position, self.now)
        if demand is not None:
            self._demand = Sample(demand, self.now - ago)
        word, shown = Sample(ENABLED, self.now), Sample(mode, self.now)
        self.image.update(Inputs(self.now, True, word, shown, self._position, None, None, self._demand))
        self.image.reference_tracker.note(self.now, mode, self.image.demand, None, False)
        return self.image


def test_a_polled_demand_keeps_its_distance_from_the_position_at_receipt():
    """The axis continues at 100 increments per cycle; its demand is 50 ahead of it all the time."""
    drive = Drive(ValueTransport.SYNC_PDO, ValueTransport.SDO)
    drive.cycle(0, 0)
    for number in range(1, 60):
        demand = {"demand": 100 * number + 50} if number % 25 == 0 else {}
        image = drive.cycle(100 * number, **demand)
        if number > 25:
            assert image.pull == 50


@pytest.mark.parametrize(
    ("ago", "demand", "lead"),
    [
        (T, 900, 0),  # when the position before the last one came
        (T / 2, 950, 0),  # in between it moved evenly
        (T / 2, 1000, 50),
        (0.0, 1000, 0),
    ],
)
def test_between_two_positions_the_axis_moved_evenly(ago, demand, lead):
    drive = Drive(ValueTransport.SYNC_PDO, ValueTransport.SDO)
    for number in range(10):
        drive.cycle(100 * number)
    assert drive.cycle(1000, demand, ago=ago).lead == pytest.approx(lead, abs=1e-6)


@pytest.mark.parametrize(("demand", "lead"), [(1000, 0), (1060, 0), (1200, 100), (900, -100)])
def test_after_the_last_position_the_axis_may_have_continued_or_not(demand, lead):
    """One period after the last position it may be anywhere between that and a way of 100 farther."""
    drive = Drive(ValueTransport.EVENT_PDO, ValueTransport.SDO)
    for number in range(11):
        drive.cycle(100 * number)
    assert drive.cycle(demand=demand).lead == pytest.approx(lead, abs=1e-6)


def test_a_position_overdue_for_longer_than_usual_has_not_changed():
    drive = Drive(ValueTransport.EVENT_PDO, ValueTransport.SDO)
    for number in range(11):
        drive.cycle(100 * number)
    drive.cycle()
    assert drive.cycle(demand=1060).lead == 60


def test_values_received_in_one_cycle_by_synchronous_pdos_belong_to_one_sync():
    drive = Drive(ValueTransport.SYNC_PDO, ValueTransport.SYNC_PDO)
    for number in range(10):
        drive.cycle(100 * number, 100 * number + 20, ago=-0.0004)
    assert drive.image.lead == 20


def test_a_demand_that_is_silent_has_not_changed_while_the_axis_moves():
    drive = Drive(ValueTransport.SYNC_PDO, ValueTransport.EVENT_PDO, age=float("inf"))
    drive.cycle(0, 0)
    drive.cycle(0, 0)
    drive.cycle(0)
    assert drive.cycle(-700).pull == 700


def test_a_demand_that_moves_is_silent_for_its_inhibit_time():
    drive = Drive(ValueTransport.SYNC_PDO, ValueTransport.EVENT_PDO, age=float("inf"))
    for number in range(60):
        demand = {"demand": 100 * number + 50} if number % 20 == 0 else {}
        image = drive.cycle(100 * number, **demand)
        assert number < 20 or image.pull == 50


@pytest.mark.parametrize("change", ["mode", "power", "count"])
def test_a_demand_from_before_a_change_of_mode_power_or_count_is_not_used(change):
    drive = Drive(ValueTransport.SYNC_PDO, ValueTransport.SDO)
    drive.cycle(0, 5000)
    assert drive.cycle(0, 5000).pull == 5000
    mode = PP
    if change == "mode":
        drive.cycle(0, mode=PV)
        drive.cycle(0)
    elif change == "power":
        drive.image.update(
            Inputs(
                drive.now, True, Sample(0x0250, drive.now), None, drive._position, None, None, drive._demand
            )
        )
    else:
        drive.image.rebase()
    assert drive.cycle(0, mode=mode).pull is None
    assert drive.cycle(0, 0, mode=mode).pull == 0


def test_the_old_demand_is_not_shown_after_the_count_restarted():
    drive = Drive(ValueTransport.SYNC_PDO, ValueTransport.SDO)
    drive.cycle(9000, 9000)
    drive.image.rebase()
    drive.image.restart()
    image = drive.cycle(0)
    assert (image.shown_demand, image.demand, image.reference) == (None, None, 0)
