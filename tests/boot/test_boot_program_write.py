"""Writing the program of a node by command, against the simulated boot loader: interrupted at any frame, and run again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from axisbus import eds
from axisbus.boot.program_facts import (
    ProgramOrder,
    ProgramWritten,
    checksums,
    read_programs,
    require_writable,
    verify_program,
)
from axisbus.boot.program_write import write_program
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.clock import VirtualClock
from axisbus.errors import ArgumentError, AxisbusError, NodeError, SdoTimeout, StateError
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.virtual_can import VirtualWire
from kit.eds.loader import OLD, loader_eds, program

NEW = (15_400, 43_200_000)
IMAGE = program(NEW, 400)  # 58 segments in one block
PATIENT, IMPATIENT = 60.0, 1.0


class Rig:
    """A drive with a boot loader on a wire in virtual time, and the master's access to it."""

    def __init__(self, folder: Path, *without: int) -> None:
        self.clock = VirtualClock()
        self.device: Device = device_from_eds(eds.load(folder / loader_eds(folder, *without)), 5)
        self.wire = VirtualWire(self.clock, [self.device])
        self.channel = Channel(self.wire.connect(), "virtual time", clock=self.clock)
        self.node = CanopenNode(self.channel, 5)
        self.clock.sleep(1.0)

    def write(
        self,
        image: bytes = IMAGE,
        *,
        deadline: float = PATIENT,
        identification: int | None = None,
        progress=None,
    ) -> ProgramWritten:
        """Write a program."""
        return write_program(self.node, ProgramOrder(image, identification, deadline), progress)

    def failed(self, image: bytes = IMAGE, **options) -> NodeError:
        """Write a program, which must fail."""
        with pytest.raises(NodeError) as caught:
            self.write(image, **options)
        return caught.value

    @property
    def runs_new(self) -> bool:
        """Whether the drive runs the new program, by its own values."""
        device = self.device
        assert device.loader is not None
        return device.loader.program == IMAGE and device.read(0x1F51, 1) == 1 and device.answers_sdo

    def supply(self, *, on: bool) -> None:
        """Switch the supply of the drive."""
        self.device.dials.unpowered = not on
        self.clock.sleep(1.0)

    def close(self) -> None:
        """Release the bus."""
        self.node.close()
        self.channel.close()


@pytest.fixture
def make(tmp_path) -> Iterator[Callable[..., Rig]]:
    made: list[Rig] = []

    def rig(*without: int) -> Rig:
        made.append(Rig(tmp_path, *without))
        return made[-1]

    yield rig
    for each in made:
        each.close()


@pytest.fixture
def rig(make) -> Rig:
    return make()


class AtFrame(set[int]):
    """Acts at the SDO frame of a number, counted from the beginning of the write; in the place of ``NodeFaults.sdo_lost``."""

    def __init__(self, number: int, act: Callable[[], None]) -> None:
        super().__init__()
        self.left = number
        self._act = act

    def __contains__(self, _: object) -> bool:
        self.left -= 1
        if self.left == 0:
            self._act()
        return False


# -- success ---------------------------------------------------------------------------------------------------------------


def test_a_program_is_replaced_and_the_versions_before_and_after_are_returned(rig):
    told: list[tuple[int, int | None]] = []
    written = rig.write(progress=lambda *facts: told.append(facts))
    assert rig.runs_new
    assert rig.device.loader.orders == [0, 3, 1]
    assert (written.before.version, written.after.version) == (OLD, NEW)
    assert written.after.identity.identification == sum(IMAGE)
    assert (written.size, written.retries) == (400, 0)
    assert told[-1] == (400, 400)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_a_drive_without_block_transfers_gets_its_program_in_segments(rig):
    rig.device.dials.sdo_block = False
    rig.write()
    assert rig.runs_new


def test_a_slow_drive_that_restarts_at_every_command_and_has_few_objects_meanwhile(rig):
    dials = rig.device.dials
    dials.program.few_objects = dials.program.stop_restarts = dials.program.deaf = True
    dials.program.clear_time, dials.program.flash_time = 30.0, 12.0
    dials.program.restart_delay, dials.reboot_time = 0.6, 3.0
    rig.write()
    assert rig.runs_new
    assert rig.device.boot_ups == 3


def test_the_identification_that_is_given_must_be_that_of_the_new_program(rig):
    rig.write(identification=sum(IMAGE))
    assert rig.runs_new
    error = rig.failed(identification=sum(IMAGE) + 1, deadline=IMPATIENT)
    assert f"identification {sum(IMAGE) + 1:08X}h" in error.observed
    assert "compare the identification" in error.remedy


@pytest.mark.parametrize("without", [(0x1F52,), (0x1F56,), (0x1F57,), (0x1F52, 0x1F56, 0x1F57)], ids=str)
def test_a_drive_needs_only_1f50_and_1f51(make, without):
    rig = make(*without)
    written = rig.write()
    assert rig.runs_new
    assert (written.after.version is None) is (0x1F52 in without)


# -- refusals --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("without", [0x1F50, 0x1F51])
def test_a_drive_without_the_objects_is_refused_before_anything_is_written(make, without):
    rig = make(without)
    with pytest.raises(StateError) as caught:
        rig.write()
    assert "cannot be written over CANopen; nothing was sent" in caught.value.message
    assert rig.device.loader is None  # so that nothing could have been written
    with pytest.raises(StateError):
        require_writable(read_programs(5, rig.node.sdo))


def test_an_empty_program_is_refused_before_the_old_one_is_cleared(rig):
    with pytest.raises(ArgumentError, match="is empty"):
        rig.write(b"")
    assert rig.device.loader.orders == []


def test_a_node_with_an_energised_drive_keeps_its_program(rig):
    rig.device.drives[0].start_enabled(1)
    with pytest.raises(StateError, match="node 5 is energised"):
        rig.write()
    assert rig.device.loader.orders == []


def test_a_silent_drive_is_a_timeout_before_anything_is_written(rig):
    rig.device.dials.dead = True
    with pytest.raises(SdoTimeout):
        rig.write()
    assert rig.device.loader.orders == []


def test_a_program_for_a_smaller_memory_is_refused_by_the_drive_in_words(rig):
    rig.device.dials.program.capacity = 399
    error = rig.failed()
    assert "error 6: an address lies outside its memory" in error.observed
    assert "the node is useless until a download succeeds" in error.observed
    assert "check that the file is for this device" in error.remedy
    rig.device.dials.program.capacity = 400
    rig.write()
    assert rig.runs_new


def test_a_wrong_image_is_refused_by_the_drive_in_words(rig):
    rig.device.dials.program.checksum = True
    assert "error 3: the data are faulty" in rig.failed().observed


@pytest.mark.parametrize(("order", "stage"), [(0, "stopped"), (3, "cleared"), (1, "started")])
def test_a_command_that_the_drive_refuses_is_named_with_its_stage(rig, order, stage):
    rig.device.dials.program.control_refused[order] = 0x0800_0022
    error = rig.failed()
    assert f"was being {stage} (1F51h:01 = {order})" in error.message
    assert "the node refuses" in error.observed


def test_an_error_of_a_write_speaks_of_no_boot_up_and_of_no_cell_file(rig):
    for order in (0, 3, 1):
        rig.device.dials.program.control_refused = {order: 0x0800_0022}
        error = rig.failed()
        assert "boot again" not in error.remedy
        assert "[nodes" not in f"{error.message} {error.observed} {error.remedy}"
        assert "write it again" in error.remedy


# -- interruptions ---------------------------------------------------------------------------------------------------------


def frames_of_a_write(rig: Rig) -> int:
    """The number of SDO frames of a whole write, in both directions."""
    counter = AtFrame(1_000_000, lambda: None)
    rig.device.dials.sdo_lost = counter
    rig.write()
    rig.device.dials.sdo_lost = set()
    return 1_000_000 - counter.left


@pytest.mark.parametrize("block", [True, False], ids=["block", "segments"])
def test_after_a_loss_of_the_supply_at_any_frame_the_next_write_succeeds(make, block):
    first = make()
    first.device.dials.sdo_block = block
    count = frames_of_a_write(first)
    assert count > 58
    began = failures = 0
    for number in range(1, count, 3):
        rig = make()
        device = rig.device
        device.dials.sdo_block = block
        device.dials.sdo_lost = AtFrame(
            number, lambda device=device: setattr(device.dials, "unpowered", True)
        )
        error: AxisbusError | None = None
        try:
            rig.write(deadline=IMPATIENT)
        except AxisbusError as raised:
            error, failures = raised, failures + 1
        if isinstance(error, NodeError):
            assert "loss of its supply" in error.remedy or "switch the node off and on" in error.remedy
        began += bool(device.loader.orders)
        rig.supply(on=False)
        device.dials.sdo_lost = set()
        rig.supply(on=True)
        facts = read_programs(5, rig.node.sdo)
        assert facts.version in (OLD, NEW, (0, 0))
        assert facts.programs[0].runs is (device.loader.program is not None)
        rig.write()
        assert rig.runs_new, number
    assert began > 10
    assert failures > 20


def test_after_ctrl_c_at_any_moment_the_next_write_succeeds(make):
    interrupted = 0
    for number in range(0, 400, 50):
        rig = make()
        rig.device.dials.sdo_block = False

        def stop(done: int, _all: int | None, number: int = number) -> None:
            if done >= number:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            rig.write(progress=stop)
        interrupted += rig.device.loader.program is None
        rig.write()
        assert rig.runs_new
    assert interrupted == 8


def test_a_drive_that_restarts_in_mid_transfer_gets_its_program_in_the_same_write(rig):
    rig.device.dials.sdo_lost = AtFrame(60, lambda: rig.device.nmt_command(0x81))
    written = rig.write(deadline=5.0)
    assert rig.runs_new
    assert written.retries > 0


def test_a_drive_that_stays_silent_ends_the_write_with_the_state_of_the_node(rig):
    def die(done: int, _all: int | None) -> None:
        rig.device.dials.dead = True

    began = rig.clock.now()
    error = rig.failed(deadline=2.0, progress=die)
    assert "the new program was being transferred (1F50h:01)" in error.message
    assert "the old program is cleared, the new one incomplete" in error.observed
    assert rig.clock.now() - began < 30.0


# -- reading and comparing -------------------------------------------------------------------------------------------------


def test_a_node_reports_its_program_and_its_state(rig):
    facts = read_programs(5, rig.node.sdo)
    assert (facts.version, facts.can_write, len(facts.programs)) == (OLD, True, 1)
    assert facts.programs[0].runs
    assert facts.programs[0].control_text == "runs"
    rig.device.write(0x1F51, 1, 0)
    rig.device.write(0x1F51, 1, 3)
    facts = read_programs(5, rig.node.sdo)
    assert not facts.programs[0].runs
    assert facts.programs[0].control_text == "cleared: the node has no program"
    assert str(facts.programs[0].flash) == "error 1: it has no valid program"


def verified(rig: Rig, data: bytes) -> tuple[bool | None, str]:
    objects = rig.node.sdo
    result = verify_program(objects, read_programs(5, objects), data)
    return result.same, result.reason


def test_a_program_is_verified_by_the_checksum_that_the_node_reports(rig):
    rig.write()
    same, reason = verified(rig, IMAGE)
    assert same is True
    assert "sum of its bytes" in reason
    same, reason = verified(rig, IMAGE + b"\1")
    assert same is None
    assert "none of the usual checksums" in reason


@pytest.mark.parametrize("name", ["CRC-32", "CRC-16 of CiA 301"])
def test_other_usual_checksums_are_known(rig, name):
    value = checksums(IMAGE)[name]
    rig.device.dictionary.live[0x1F5601] = lambda: value
    same, reason = verified(rig, IMAGE)
    assert same is True
    assert name in reason


def test_the_checksums_have_the_check_values_of_their_definitions():
    """The check values over "123456789": of CRC-32 (ISO-HDLC), and of the CRC-16 with the polynomial 1021h from 0 (XMODEM)."""
    found = checksums(b"123456789")
    assert (found["CRC-32"], found["CRC-16 of CiA 301"]) == (0xCBF4_3926, 0x31C3)


@pytest.mark.parametrize(
    ("present", "same", "words"),
    [
        (IMAGE, True, "are the 400 bytes"),
        (IMAGE + b"\xff" * 100, True, "are the 400 bytes"),
        (IMAGE[:100] + b"\0" + IMAGE[101:], False, "from byte 100 on"),
        (IMAGE[:300], False, "it has 300 bytes, the file 400"),
        (IMAGE + b"\1", False, "it has 401 bytes, the file 400"),
    ],
    ids=["same", "erased behind", "one byte", "shorter", "longer"],
)
def test_a_program_that_can_be_read_is_compared_byte_by_byte(rig, present, same, words):
    entry = rig.device.dictionary.entries[0x1F5001]
    rig.device.dictionary.entries[0x1F5001] = entry._replace(readable=True)
    rig.device.dictionary.values[0x1F5001] = present
    found, reason = verified(rig, IMAGE)
    assert found is same
    assert words in reason


def test_a_program_that_does_not_run_is_not_verified(rig):
    rig.device.write(0x1F51, 1, 0)
    assert verified(rig, IMAGE)[0] is False


def test_a_node_that_reports_nothing_cannot_be_verified(make):
    rig = make(0x1F56)
    assert verified(rig, IMAGE) == (
        None,
        "the node returns neither its program (1F50h) nor its identification (1F56h)",
    )
