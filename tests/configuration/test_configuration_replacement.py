"""The replacement of a drive on a bus without a machine: however it is found, and killed anywhere and run again."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.cia305.services import LssAddress
from axisbus.configuration.replacement_order import FoundDrive, ReplacementStep
from axisbus.errors import BusError, NodeError, StateError
from axisbus.sim.power import Effort
from kit.replacement_bench import CONFIGURED, NEW, NODE, PRODUCT, VENDOR, Bench
from kit.virtual_channel import Killed

NMT, SDO, LSS = 0, 0x600, 0x7E5
CONFIGURE, STORE, FAST_SCAN = 0x11, 0x17, 0x51
WAYS = {"same node-ID": {}, "another node-ID": {"node_id": 9}, "no node-ID": {"node_id": 255}}


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


@pytest.mark.parametrize("way", WAYS.values(), ids=list(WAYS))
def test_a_new_drive_gets_node_id_and_configuration_and_keeps_them(bench: Bench, way: dict[str, int]):
    bench.swap(**way)
    assert {key: bench.device.read(key >> 8, key & 0xFF) for key in CONFIGURED} == bench.factory
    made, outcome, _ = bench.replace()
    assert made.drive.node_id == {9: 9, 255: None}.get(way.get("node_id", 0), NODE)
    assert made.drive.address == LssAddress(VENDOR, PRODUCT, 0, NEW)
    assert outcome.written >= len(CONFIGURED)
    assert outcome.values > outcome.written
    assert outcome.not_stored == ""
    bench.assert_replaced()


def test_nothing_is_written_to_find_a_drive(bench: Bench):
    assert bench.find() == []
    bench.swap(node_id=255)
    assert bench.find() == [FoundDrive(None, VENDOR, PRODUCT, 0, NEW)]
    bench.swap(node_id=9)
    assert [(each.node_id, each.serial) for each in bench.find()] == [(9, NEW)]
    bench.swap(node_id=NODE)
    assert [(each.node_id, each.serial) for each in bench.find()] == [(NODE, NEW)]
    assert bench.downloads == []


class Stop(Exception):
    """The end of a program before a step."""


STEPS = [step for step in ReplacementStep if step not in (ReplacementStep.BOOT, ReplacementStep.RECORD)]


@pytest.mark.parametrize("power_cycle", [False, True], ids=["", "and switched off"])
@pytest.mark.parametrize("last", STEPS, ids=lambda step: step.name)
@pytest.mark.parametrize("way", WAYS.values(), ids=list(WAYS))
def test_stopped_before_each_step_and_run_again(
    bench: Bench, way: dict[str, int], last: ReplacementStep, power_cycle: bool
):
    def tell(step: ReplacementStep) -> None:
        if step is last:
            raise Stop

    bench.swap(**way)
    if last is ReplacementStep.NODE_ID and not way:
        bench.replace(tell)  # this step is not needed
    else:
        with pytest.raises(Stop):
            bench.replace(tell)
    if power_cycle:
        bench.device.dials.unpowered = True
        bench.clock.sleep(0.5)
        bench.device.dials.unpowered = False
        bench.clock.sleep(0.5)
    bench.replace()
    bench.assert_replaced()


@pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnhandledThreadExceptionWarning"
)  # its threads are killed, too
@pytest.mark.parametrize("node_id", [9, 255])
def test_killed_before_any_frame_and_run_again(tmp_path: Path, node_id: int):
    """Each frame that changes a state is among them: LSS except fast scan, and NMT."""
    bench = Bench(tmp_path)
    bench.swap(node_id=node_id)
    sent = bench.replace()[2]
    changing = {
        number
        for number, (can_id, data) in enumerate(sent)
        if can_id == NMT or (can_id == LSS and data[0] != FAST_SCAN)
    }
    assert len(changing) > 20
    for frame in sorted(changing | set(range(3, len(sent), 41))):
        bench.swap(node_id=node_id)
        with pytest.raises(Killed):
            bench.replace(killed_at=frame)
        bench.clock.sleep(5.0)  # a user needs longer to run it again
        bench.replace()
        bench.assert_replaced()


# -- refusals ----------------------------------------------------------------------------------------------------------------


def test_another_product_or_revision_is_refused_without_a_write(bench: Bench):
    bench.swap(product_code=8)
    with pytest.raises(StateError, match="cannot replace that of node 1") as caught:
        bench.replace()
    assert "product code (1018h:02) is 0x8 (8), expected is 0x7 (7)" in caught.value.observed
    bench.swap(revision=2)
    bench.revision = 1
    with pytest.raises(StateError, match="cannot replace") as caught:
        bench.replace()
    assert "revision (1018h:03) is 0x2 (2), expected is 0x1 (1)" in caught.value.observed
    assert bench.downloads == []


def test_a_drive_without_some_objects_is_refused_without_a_write(bench: Bench):
    bench.swap()
    bench.device.dials.sdo_aborts[0x6083, 0] = 0x0602_0000
    with pytest.raises(StateError, match="nothing was written") as caught:
        bench.replace()
    assert "6083h:00" in caught.value.observed
    assert "the device does not have it" in caught.value.observed
    assert bench.downloads == []


def enable(bench: Bench) -> None:
    """Somebody else has enabled the drive."""
    for word in (6, 7, 15):
        bench.device.write(0x6040, 0, word)
        bench.clock.sleep(0.3)
    assert bench.device.drive.power.effort is not Effort.OFF
    bench.downloads.clear()


def test_a_drive_with_power_is_refused_without_a_write(bench: Bench):
    bench.swap()
    enable(bench)
    with pytest.raises(StateError, match="is energised"):
        bench.replace()
    assert bench.downloads == []


def test_a_drive_elsewhere_with_power_keeps_its_node_id(bench: Bench):
    bench.swap(node_id=9)
    enable(bench)
    with pytest.raises(StateError, match="is energised"):
        bench.replace()
    assert (bench.device.node_id, bench.device.lss.pending, bench.downloads) == (9, 9, [])


# -- a make whose drives have an object for the node-ID ----------------------------------------------------------------------


def test_a_make_with_an_object_for_the_node_id_needs_no_lss(tmp_path: Path):
    bench = Bench(tmp_path, own_node_id=True)
    bench.swap(node_id=9)
    _, outcome, sent = bench.replace()
    assert not [data for can_id, data in sent if can_id == LSS and data[0] in (CONFIGURE, STORE)]
    assert outcome.calibration == 1  # the node-ID in the file is not written
    bench.assert_replaced()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_node_id_set_by_an_object_is_set_again_after_a_kill_at_any_frame(tmp_path: Path):
    bench = Bench(tmp_path, own_node_id=True)
    bench.swap(node_id=9)
    sent = bench.replace()[2]
    to_drive = [number for number, (can_id, _) in enumerate(sent) if can_id == SDO + 9]
    assert len(to_drive) > 4
    for frame in (*to_drive, to_drive[-1] + 1, to_drive[-1] + 2):
        bench.swap(node_id=9)
        with pytest.raises(Killed):
            bench.replace(killed_at=frame)
        bench.clock.sleep(5.0)
        bench.replace()
        bench.assert_replaced()


def test_a_node_id_that_switches_set_is_named(tmp_path: Path):
    bench = Bench(tmp_path, own_node_id=True)
    bench.swap(node_id=9)
    bench.device.lss.restart = lambda **_: 9  # type: ignore[method-assign]
    with pytest.raises(NodeError, match="has not answered since it got its node-ID") as error:
        bench.replace()
    assert "its switches set the node-ID: set them" in error.value.remedy
    assert set(bench.downloads) == {(0x2009, 0), (0x1010, 1)}
    assert not bench.energised


def test_a_drive_with_power_keeps_its_node_id(tmp_path: Path):
    bench = Bench(tmp_path, own_node_id=True)
    bench.swap(node_id=9)
    enable(bench)
    with pytest.raises(StateError, match="is energised"):
        bench.replace()
    assert (bench.device.node_id, bench.downloads) == (9, [])


# -- drives that do not do everything ------------------------------------------------------------------------------------------


def test_a_value_that_is_rejected_leaves_the_replacement_unfinished(bench: Bench):
    bench.swap()
    bench.device.dials.sdo_write_aborts[0x6083, 0] = 0x0609_0030
    with pytest.raises(NodeError, match=r"rejects 1 value .* the replacement is unfinished") as caught:
        bench.replace()
    assert "6083h:00" in caught.value.observed
    assert bench.note is not None
    bench.device.dials.sdo_write_aborts.clear()
    bench.replace()
    bench.assert_replaced()


def test_a_drive_that_cannot_store_on_command_is_not_restarted_and_the_outcome_says_so(bench: Bench):
    bench.swap()
    bench.device.dictionary.live[0x1010_01] = lambda: 0
    boots = bench.device.boot_ups
    _, outcome, _ = bench.replace()
    assert "it does not store" in outcome.not_stored
    assert bench.device.boot_ups == boots
    assert {key: bench.device.read(key >> 8, key & 0xFF) for key in CONFIGURED} == CONFIGURED


def test_a_drive_that_restarts_by_itself_when_it_stores_is_not_restarted_again(bench: Bench):
    bench.swap()
    bench.device.dials.reboot_on_store = True
    boots = bench.device.boot_ups
    bench.replace()
    assert bench.device.boot_ups == boots + 1
    bench.assert_replaced()


def test_a_drive_that_does_not_store_its_node_id_is_reported(bench: Bench):
    bench.swap(node_id=255)
    bench.device.lss.dials.store_error = 1
    with pytest.raises(BusError, match="store"):
        bench.replace()
    assert bench.downloads == []


def test_another_drive_that_takes_the_place_meanwhile_is_not_configured(bench: Bench):
    bench.swap()

    def tell(_: ReplacementStep) -> None:
        bench.device.swap(NEW + 1)
        bench.clock.sleep(0.5)

    with pytest.raises(NodeError, match="is not the drive that was found"):
        bench.replace(tell)
    assert bench.downloads == []
