"""A module that still speaks CAN Simple where a new drive is expected, or beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.configuration.replacement_order import FoundDrive
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import StateError
from kit.replacement_bench import NEW, NODE, OTHER, PRODUCT, VENDOR, Bench


@pytest.mark.parametrize("node_id", [0, NODE])
def test_a_new_module_with_the_protocol_of_its_factory_is_named_with_the_remedy(tmp_path: Path, node_id: int):
    bench = Bench(tmp_path, Module(node_id))
    with pytest.raises(StateError, match=f"replace that of node {NODE}; nothing was written") as refused:
        bench.find()
    assert f"1 module speaks CAN Simple, not CANopen: node {node_id}" in str(refused.value)
    assert "axisbus gim6010 to-canopen" in str(refused.value)
    bench.swap(node_id=255)
    assert bench.find() == [FoundDrive(None, VENDOR, PRODUCT, 0, NEW)]


def test_a_module_of_the_cell_with_another_protocol_is_not_taken_for_the_new_one(tmp_path: Path):
    assert Bench(tmp_path, Module(OTHER)).find() == []
