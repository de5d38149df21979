"""Makes of drive: which make a drive belongs to."""

from __future__ import annotations

import pickle

import pytest

from axisbus.drives import DrivePlugin, registry
from axisbus.drives.plugin import GENERIC
from axisbus.drives.registry import find


@pytest.mark.parametrize("vendor_id", [None, 0, 0xFB])
def test_an_unknown_drive_is_generic(vendor_id: int | None) -> None:
    make = find(vendor_id, 1)
    assert make is GENERIC
    assert make.explain(0x8611, {}) == []
    assert (make.behaviour.store_restarts, make.fault_objects, make.calibration_objects) == (False, (), ())


def test_product_codes_narrow_a_make_if_they_are_given() -> None:
    make = DrivePlugin("one product", vendor_id=1, product_codes=frozenset((5,)))
    assert make.matches(1, 5)
    assert not make.matches(1, 6)
    assert not make.matches(2, 5)
    assert not make.matches(1, None)


def test_makes_travel_to_another_process() -> None:
    for make in (*registry.plugins(), GENERIC):
        assert pickle.loads(pickle.dumps(make)) == make
