"""Bringing a live drive's PDOs where the plan wants them: a dialogue with a slave that keeps CiA 301's rules."""

from __future__ import annotations

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.pdo.configure import configure, set_pdo
from axisbus.bus.pdo.plan import PdoChange, PdoPlan, PdoRequirements, Policy
from axisbus.bus.pdo.read import read_pdo, read_pdos
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301.pdo import MappedObject, PdoConfiguration
from axisbus.cia402.port import ValueTransport
from axisbus.errors import BootError
from kit.bus.fake_bus import FakeBus, Slave, pdo_objects

NODE = 5
OFF = 1 << 31
NO_RTR = 1 << 30
PAIR = PdoRequirements(("statusword", "mode", "position"), ("controlword", "mode", "target_position"))
M = MappedObject


def drive() -> dict[tuple[int, int], bytes]:
    """A drive as it comes from its maker: RPDO1 6040, TPDO1 6041, the others empty and off."""
    return {
        **pdo_objects(0x1400, 0x1600, 0x205, 255, [0x60400010]),
        **pdo_objects(0x1401, 0x1601, OFF | 0x305, 255, []),
        **pdo_objects(0x1800, 0x1A00, NO_RTR | 0x185, 255, [0x60410010], inhibit=0, event=0),
        **pdo_objects(0x1801, 0x1A01, OFF | NO_RTR | 0x285, 255, [], inhibit=0, event=0),
    }


@pytest.fixture
def slave(fake: FakeBus) -> Slave:
    slave = Slave(NODE, drive())
    fake.peers.append(slave)
    return slave


@pytest.fixture
def sdo(channel: Channel, slave: Slave) -> SdoClient:
    return SdoClient(channel, NODE)


def writes_to(slave: Slave, *indices: int) -> list[tuple[str, int]]:
    return [
        (f"{index:04X}:{sub}", int.from_bytes(data, "little"))
        for index, sub, data in slave.writes
        if index in indices
    ]


# -- reading


def test_the_parameters_are_read(sdo: SdoClient) -> None:
    pdos = read_pdos(sdo)
    assert pdos.rpdos == (
        PdoConfiguration(1, 0x205, True, 255, (M(0x6040, 0, 16),)),
        PdoConfiguration(2, 0x305, False, 255, ()),
    )
    assert pdos.tpdos == (
        PdoConfiguration(1, 0x185, True, 255, (M(0x6041, 0, 16),), 0, 0),
        PdoConfiguration(2, 0x285, False, 255, (), 0, 0),
    )


def test_a_pdo_with_fewer_entries_than_the_standard_requires_is_read(sdo: SdoClient, slave: Slave) -> None:
    """No timers, a count of three with two entries, and an ARRAY or RECORD makes no difference: it is read by number."""
    slave.objects.update(pdo_objects(0x1802, 0x1A02, 0x385, 1, [0x60640020, 0x00050008, 0x606C0010], slots=2))
    assert read_pdo(sdo, receive=False, number=3) == PdoConfiguration(
        3, 0x385, True, 1, (M(0x6064, 0, 32), M(0x0005, 0, 8)), None, None
    )


def test_a_multiplexed_pdo_has_no_mapping(sdo: SdoClient, slave: Slave) -> None:
    slave.objects[0x1A00, 0] = b"\xff"
    pdo = read_pdo(sdo, receive=False, number=1)
    assert pdo is not None
    assert pdo.mapping == ()


def test_a_communication_record_without_mapping_is_read(sdo: SdoClient, slave: Slave) -> None:
    slave.objects = {key: value for key, value in slave.objects.items() if key[0] != 0x1600}
    assert read_pdos(sdo).rpdos[0].mapping == ()


# -- applying


def test_remapping_follows_the_procedure_of_cia_301(sdo: SdoClient, slave: Slave) -> None:
    """Off, no entries, the entries, their count, the type, on: the slave refuses any other order."""
    plan = configure(sdo, PAIR)
    assert writes_to(slave, 0x1400, 0x1600) == [
        ("1400:1", OFF | 0x205),
        ("1600:0", 0),
        ("1600:1", 0x60600008),
        ("1600:2", 0x607A0020),
        ("1600:3", 0x60400010),
        ("1600:0", 3),
        ("1400:2", 1),
        ("1400:1", 0x205),
    ]
    assert writes_to(slave, 0x1800, 0x1A00)[-1] == ("1800:1", NO_RTR | 0x185)  # its own flag is kept
    assert plan.inputs["position"] is ValueTransport.SYNC_PDO
    assert [pdo.change for pdo in plan.pdos] == [PdoChange.MAPPING, PdoChange.MAPPING]
    assert slave.number(0x1A00, 0) == 3


def test_all_pdos_are_off_before_the_first_mapping_changes(sdo: SdoClient, slave: Slave) -> None:
    """An object may be in one RPDO only, in some drives."""
    configure(sdo, PAIR)
    names = [name for name, _ in writes_to(slave, 0x1400, 0x1600, 0x1800, 0x1A00)]
    assert names[:3] == ["1400:1", "1800:1", "1600:0"]
    assert names[-2:] == ["1400:1", "1800:1"]


def test_event_driven_pdos_get_their_timers(sdo: SdoClient, slave: Slave) -> None:
    plan = configure(sdo, PAIR, Policy(sync=False))
    assert slave.number(0x1800, 5) == 20
    assert slave.number(0x1800, 3) == 50
    assert plan.inputs["statusword"] is ValueTransport.EVENT_PDO
    assert plan.active[-1].target.event_timer == 20


def test_a_timer_that_the_drive_does_not_take_is_no_failure(sdo: SdoClient, slave: Slave) -> None:
    slave.abort_on[0x1800, 5] = 0x0601_0002
    plan = configure(sdo, PAIR, Policy(sync=False))
    assert plan.active[-1].target.event_timer == 0  # as it reads back: freshness will poll
    assert slave.number(0x1800, 1) == NO_RTR | 0x185


def test_a_fixed_mapping_is_detected_and_left_as_it_was(sdo: SdoClient, slave: Slave) -> None:
    slave.fixed_mapping = True
    seen: list[PdoPlan] = []
    plan = configure(sdo, PAIR, on_plan=seen.append)
    assert [p.remapped for p in seen] == [True, False]
    assert plan.outputs == {
        "controlword": ValueTransport.SYNC_PDO,
        "mode": ValueTransport.SDO,
        "target_position": ValueTransport.SDO,
    }
    assert slave.number(0x1600, 0) == 1
    assert slave.number(0x1600, 1) == 0x60400010
    assert slave.number(0x1400, 1) == 0x205  # on again
    assert slave.number(0x1400, 2) == 1
    assert slave.number(0x1401, 1) == OFF | 0x305  # and a PDO that was off is off
    assert any("the mapping of RPDO1 is fixed (abort code 06010002h)" in note for note in plan.notes)


def test_a_pdo_that_the_next_plan_does_not_use_is_restored(sdo: SdoClient, slave: Slave) -> None:
    """TPDO1 carries a maker's object; it is switched off for remapping, and that is refused."""
    slave.objects.update(pdo_objects(0x1800, 0x1A00, 0x185, 255, [0x20000010], inhibit=7, event=70))
    slave.fixed_mapping = True
    before = {key: value for key, value in slave.objects.items() if key[0] in (0x1800, 0x1A00)}
    plan = configure(sdo, PAIR)
    assert plan.inputs["statusword"] is ValueTransport.SDO
    assert {key: slave.objects[key] for key in before} == before


def test_a_drive_that_takes_nothing_is_used_as_it_is(sdo: SdoClient, slave: Slave) -> None:
    slave.fixed_communication = True
    before = dict(slave.objects)
    plan = configure(sdo, PAIR)
    assert slave.objects == before
    assert plan.outputs["controlword"] is ValueTransport.EVENT_PDO
    assert plan.inputs["position"] is ValueTransport.SDO
    assert {pdo.change for pdo in plan.pdos} == {PdoChange.KEEP}


def takes_types(slave: Slave, *taken: int, indices: tuple[int, ...]) -> None:
    """Let the drive refuse all transmission types of these PDOs but some."""
    original = slave._write

    def write(index: int, subindex: int, value: bytes) -> int:
        refused = index in indices and subindex == 2 and value[0] not in taken
        return 0x0609_0030 if refused else original(index, subindex, value)

    slave._write = write  # type: ignore[method-assign]


def test_an_rpdo_that_does_not_take_every_sync_is_synchronous_by_type_0(sdo: SdoClient, slave: Slave) -> None:
    takes_types(slave, 0, 254, 255, indices=(0x1400, 0x1401))
    plan = configure(sdo, PAIR)
    assert set(plan.outputs.values()) | set(plan.inputs.values()) == {ValueTransport.SYNC_PDO}
    assert [slave.number(index, 2) for index in (0x1400, 0x1800)] == [0, 1]
    assert any("RPDO1 does not accept transmission type 1" in note for note in plan.notes)


@pytest.mark.parametrize(
    ("indices", "outputs", "inputs"),
    [
        ((0x1400, 0x1401), ValueTransport.EVENT_PDO, ValueTransport.SYNC_PDO),
        ((0x1800, 0x1801), ValueTransport.SYNC_PDO, ValueTransport.EVENT_PDO),
    ],
)
def test_refused_transmission_types_of_one_direction_do_not_cost_the_other_its_sync(
    sdo: SdoClient,
    slave: Slave,
    indices: tuple[int, ...],
    outputs: ValueTransport,
    inputs: ValueTransport,
) -> None:
    takes_types(slave, 255, indices=indices)
    plan = configure(sdo, PAIR)
    assert set(plan.outputs.values()) == {outputs}
    assert set(plan.inputs.values()) == {inputs}
    assert all(pdo.target.mapping for pdo in plan.active)


def keeps_its_pdos(slave: Slave, *, timer: bool) -> None:
    """Let the drive refuse every change of its PDOs but that of TPDO1's event timer (or that too), which is slow."""
    slave.objects[0x1800, 5] = (1000).to_bytes(2, "little")
    for index in (0x1400, 0x1401, 0x1800, 0x1801):
        for sub in (1, 2, 3, 5):
            slave.abort_on[index, sub] = 0x0601_0002
    if timer:
        del slave.abort_on[0x1800, 5]


def test_a_slow_event_timer_is_shortened_if_the_drive_takes_nothing_else(
    sdo: SdoClient, slave: Slave
) -> None:
    """It is written while the PDO is on: such a drive does not accept switching it off."""
    keeps_its_pdos(slave, timer=True)
    plan = configure(sdo, PAIR)
    assert slave.number(0x1800, 5) == 20
    assert writes_to(slave, 0x1800)[-1] == ("1800:5", 20)
    assert [str(timer) for timer in plan.event_timers] == ["TPDO1 (statusword) was 1000 ms, is now 20 ms"]
    slave.writes.clear()
    again = configure(sdo, PAIR)
    assert again.event_timers == ()
    assert "1800:5" not in dict(writes_to(slave, 0x1800))


def test_a_pdo_parameter_that_cannot_be_written_is_reported(sdo: SdoClient, slave: Slave) -> None:
    keeps_its_pdos(slave, timer=False)
    plan = configure(sdo, PAIR)
    assert slave.number(0x1800, 5) == 1000
    assert [pdo.target.event_timer for pdo in plan.pdos if not pdo.receive] == [1000]
    assert [str(timer) for timer in plan.event_timers] == [
        "TPDO1 (statusword) stays 1000 ms: the drive does not accept 20 ms"
    ]


def test_one_object_that_cannot_be_mapped_does_not_cost_the_others(sdo: SdoClient, slave: Slave) -> None:
    """By the EDS 6060h may be mapped, but the drive refuses it as the second entry."""
    original = slave._write

    def write(index: int, subindex: int, value: bytes) -> int:
        if index in (0x1600, 0x1601) and subindex and value[2:4] == b"\x60\x60":
            return 0x0604_0041
        return original(index, subindex, value)

    slave._write = write  # type: ignore[method-assign]
    plan = configure(sdo, PAIR)
    assert plan.outputs == {
        "controlword": ValueTransport.SYNC_PDO,
        "mode": ValueTransport.SDO,
        "target_position": ValueTransport.SYNC_PDO,
    }
    assert slave.number(0x1600, 0) == 2
    assert any("6060h cannot be mapped into RPDO1" in note for note in plan.notes)


@pytest.mark.parametrize(
    ("code", "speaks_of"),
    [
        (0x0602_0000, "the object"),  # does not exist
        (0x0604_0041, "the object"),  # cannot be mapped
        (0x0604_0043, "the object"),  # incompatible parameter
        (0x0609_0011, "the object"),  # no such sub-index
        (0x0609_0030, "the object"),  # value out of range
        (0x0601_0002, "the mapping"),  # read only
        (0x0604_0042, "the mapping"),  # too long
        (0x0800_0022, "the mapping"),  # not in this state
    ],
)
def test_a_refused_entry_costs_its_object_or_the_mapping_depending_on_its_abort_code(
    sdo: SdoClient, slave: Slave, code: int, speaks_of: str
) -> None:
    original = slave._write

    def write(index: int, subindex: int, value: bytes) -> int:
        if index == 0x1600 and value[2:] == b"\x60\x60":
            return code
        return original(index, subindex, value)

    slave._write = write  # type: ignore[method-assign]
    plan = configure(sdo, PAIR)
    assert (plan.outputs["target_position"] is ValueTransport.SYNC_PDO) is (speaks_of == "the object")
    assert plan.outputs["mode"] is ValueTransport.SDO


def test_a_drive_that_accepts_a_mapping_and_does_not_store_it_is_reported(
    sdo: SdoClient, slave: Slave
) -> None:
    original = slave._write

    def write(index: int, subindex: int, value: bytes) -> int:
        code = original(index, subindex, value)
        if (index, subindex) == (0x1600, 0) and value == b"\x03":
            slave.objects[0x1600, 3] = (0x60FF0020).to_bytes(4, "little")
        return code

    slave._write = write  # type: ignore[method-assign]
    with pytest.raises(
        BootError, match="RPDO1 accepted its mapping without an error but reads back another value"
    ) as caught:
        configure(sdo, PAIR)
    error = caught.value
    assert (error.node, error.step, error.index) == (NODE, "PDO configuration", 0x1600)
    assert "607A:00/32" in error.observed
    assert "60FF:00/32" in error.observed
    assert "remap" in error.remedy


def test_a_drive_that_accepts_a_transmission_type_and_does_not_store_it_keeps_its_own(
    sdo: SdoClient, slave: Slave
) -> None:
    original = slave._write
    before = {key: bytes(value) for key, value in slave.objects.items()}

    def write(index: int, subindex: int, value: bytes) -> int:
        kept = index in (0x1400, 0x1401, 0x1800, 0x1801) and subindex == 2
        return 0 if kept else original(index, subindex, value)

    slave.objects[0x1400, 2] = slave.objects[0x1800, 2] = b"\xff"
    slave._write = write  # type: ignore[method-assign]
    plan = configure(sdo, PAIR)
    assert {pdo.target.transmission_type for pdo in plan.active if pdo.before.number == 1} == {255}
    assert any("transmission type" in note and "FFh" in note for note in plan.notes)
    assert slave.objects[0x1600, 1] == before[0x1600, 1]  # the mapping is the drive's own again


def test_a_requested_transmission_type_that_the_drive_does_not_store_is_an_error_with_the_key_to_write(
    sdo: SdoClient, slave: Slave
) -> None:
    original = slave._write
    slave.objects[0x1400, 2] = b"\xff"

    def write(index: int, subindex: int, value: bytes) -> int:
        return 0 if (index, subindex) == (0x1400, 2) else original(index, subindex, value)

    slave._write = write  # type: ignore[method-assign]
    with pytest.raises(BootError, match="RPDO1 accepted its transmission type") as caught:
        set_pdo(sdo, True, 1, transmission_type=1)
    assert "transmission = 255 in [nodes.5.pdo.rpdo1]" in caught.value.remedy


def test_a_second_boot_writes_nothing(sdo: SdoClient, slave: Slave) -> None:
    configure(sdo, PAIR)
    slave.writes.clear()
    plan = configure(sdo, PAIR)
    assert slave.writes == []
    assert {pdo.change for pdo in plan.pdos} == {PdoChange.KEEP}


def test_a_mapping_of_bits_and_dummies_is_kept_and_understood(sdo: SdoClient, slave: Slave) -> None:
    """4 bits of a maker's object and a dummy between the values: canopen decodes such frames wrongly."""
    slave.objects.update(
        pdo_objects(
            0x1800, 0x1A00, 0x185, 1, [0x20000104, 0x60410010, 0x00050004, 0x60640020], inhibit=0, event=0
        )
    )
    wanted = PdoRequirements(("statusword", "position"), ())
    plan = configure(sdo, wanted, Policy(remap=False))
    (pdo,) = plan.active
    assert pdo.values == (None, "statusword", None, "position")
    assert slave.writes == []
