"""PDOs of two nodes with one COB-ID: an unused one is switched off, any other ends boot, and the error names both."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus import Machine, eds
from axisbus.bus.pdo.cob_id_conflicts import CobIdUses, PdoUse
from axisbus.eds.model import Eds
from axisbus.errors import BootError, ConfigError
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from kit.cell import cell_file

ROOT = Path(__file__).parents[2]
GENERIC = ROOT / "eds" / "generic-cia402.eds"
PDOS = {
    "command": PdoUse(1, True, 1, 0x220, used=True),
    "feedback": PdoUse(1, False, 1, 0x220, used=True),
    "unused RPDO": PdoUse(1, True, 1, 0x220, used=False),
    "unused TPDO": PdoUse(1, False, 1, 0x220, used=False),
}
MAY_SHARE = {  # one drive may follow the feedback of another
    frozenset({"unused RPDO"}),
    frozenset({"unused RPDO", "feedback"}),
    frozenset({"unused RPDO", "unused TPDO"}),
}


@pytest.mark.parametrize(("one", "other"), [(one, other) for one in PDOS for other in PDOS])
def test_two_pdos_conflict_unless_one_of_the_shared_pairs_of_uses(one, other):
    first, second = PDOS[one], PDOS[other]._replace(node_id=2)
    assert first.conflicts(second) is ({one, other} not in MAY_SHARE)
    assert not first.conflicts(second._replace(cob_id=0x221))
    assert not first.conflicts(second._replace(node_id=1))


def test_an_unused_pdo_is_compared_with_nodes_that_are_not_booted_yet():
    unused = PdoUse(1, True, 4, 0x203, used=False)
    assert CobIdUses([1, 3]).conflicts(1, [unused]) == [(unused, PdoUse(3, True, 1, 0x203, used=True))]
    assert not CobIdUses([1, 3]).conflicts(1, [unused._replace(used=True)])
    assert not CobIdUses([1]).conflicts(1, [unused])


@pytest.mark.parametrize("order", [(1, 3), (3, 1)])
def test_the_node_with_the_unused_pdo_yields_in_whatever_order_they_boot(order):
    pdos = {1: PdoUse(1, True, 4, 0x203, used=False), 3: PdoUse(3, True, 1, 0x203, used=True)}
    uses = CobIdUses([1, 3])
    found = [pair for node in order for pair in uses.conflicts(node, [pdos[node]])]
    assert found == [(pdos[1], pdos[3])]


def test_a_pdo_that_is_switched_off_no_longer_conflicts():
    uses = CobIdUses([1, 2])
    first, second = PdoUse(1, False, 4, 0x4A0, used=False), PdoUse(2, False, 4, 0x4A0, used=False)
    assert not uses.conflicts(1, [first])
    assert uses.conflicts(2, [second]) == [(second, first)]
    uses.drop(second)
    assert not uses.conflicts(1, [first])


def test_a_node_that_is_booted_again_has_its_new_pdos_only():
    uses = CobIdUses([1, 2])
    first, second = PdoUse(1, True, 1, 0x220, used=True), PdoUse(2, True, 1, 0x220, used=True)
    assert not uses.conflicts(1, [first])
    assert uses.conflicts(2, [second]) == [(second, first)]
    assert not uses.conflicts(1, [first._replace(cob_id=0x201)])
    assert not uses.conflicts(2, [second])


def devices() -> dict[int, Device]:
    model = eds.load(GENERIC)
    return {node: device_from_eds(model, node) for node in (1, 2)}


def opened(folder: Path, made: dict[int, Device], file: Path | str = "builtin:generic-cia402") -> Machine:
    path = cell_file(folder, "xy", eds=str(file))
    return Machine.simulated(path, made)


@pytest.mark.parametrize("node", [1, 2])
def test_an_unused_rpdo_that_listens_to_the_commands_of_another_node_is_switched_off(tmp_path, node):
    made, other = devices(), 3 - node
    made[node].write(0x1403, 1, 0x200 + other)
    with opened(tmp_path, made) as machine:
        assert made[node].read(0x1403, 1) == 0x8000_0200 + other
        warnings = machine.reports[node - 1].warnings
    text = (
        f"RPDO4 of node {node} switched off: it has the COB-ID {0x200 + other:03X}h of RPDO1 of node {other}"
    )
    assert text in warnings


def test_an_rpdo_that_consumes_the_feedback_of_another_node_keeps_its_cob_id(tmp_path):
    made = devices()
    made[2].write(0x1403, 1, 0x181)
    with opened(tmp_path, made):
        assert made[2].read(0x1403, 1) == 0x181


def test_a_conflicting_pdo_that_the_drive_does_not_allow_to_be_switched_off_is_refused(tmp_path):
    model, file = fixed(tmp_path, "1403", "$NODEID+0x80000500", "0x201")
    made = {1: device_from_eds(eds.load(GENERIC), 1), 2: device_from_eds(model, 2)}
    with pytest.raises(
        BootError, match="RPDO4 of node 2 has the COB-ID 201h, and so has RPDO1 of node 1"
    ) as error:
        opened(tmp_path, made, file)
    assert (error.value.node, error.value.index, error.value.subindex) == (2, 0x1403, 1)
    assert "also reach the other" in error.value.observed
    assert "[nodes.2.pdo.rpdo4]" in error.value.remedy


def test_a_table_of_the_cell_file_is_not_overruled(tmp_path):
    table = '[nodes.2.pdo.rpdo4]\ncob_id = 0x201\nmap = ["6060h"]\n'
    path = cell_file(tmp_path, "xy", more=table)
    with pytest.raises(ConfigError, match="COB-ID 201h is produced twice"):
        Machine.simulated(path, devices())


def test_drives_that_keep_the_same_cob_id_are_refused(tmp_path):
    model, file = fixed(tmp_path, "1400", "$NODEID+0x200", "0x220")
    made = {node: device_from_eds(model, node) for node in (1, 2)}
    with pytest.raises(BootError, match=r"RPDO1 of node . has the COB-ID 220h, and so has RPDO1 of node ."):
        opened(tmp_path, made, file)


def fixed(folder: Path, index: str, before: str, after: str) -> tuple[Eds, Path]:
    """Return an EDS with a COB-ID that cannot be changed, and its file."""
    text = GENERIC.read_text(encoding="ascii")
    old = text[text.index(f"[{index}sub1]") : text.index(f"[{index}sub2]")]
    assert before in old
    assert "AccessType=rw" in old
    file = folder / "fixed.eds"
    new = old.replace("AccessType=rw", "AccessType=ro").replace(before, after)
    file.write_text(text.replace(old, new), encoding="ascii")
    return eds.load(file), file
