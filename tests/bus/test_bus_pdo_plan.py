"""The PDO planner: drive configurations typed by hand, and the plan that each must get."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from axisbus.bus.pdo import setpoint_edge_order
from axisbus.bus.pdo.mapping import DevicePdos, MapEntry, axis_objects
from axisbus.bus.pdo.plan import PdoChange, PdoPlan, PdoRequirements, Policy, make_plan, spare_cob_ids
from axisbus.bus.pdo.plantext import describe
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.pdo import MappedObject
from axisbus.cia402.port import ValueTransport
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds, Object, ObjectType, Variable
from kit.bus.pdo_configurations import EMPTY, GENERIC, NO_TORQUE, NODE, objects, rpdo, tpdo


def lines(plan: PdoPlan) -> dict[str, str]:
    """The plan as ``{"RPDO1": "205 1 6040/16 … remapped"}``."""
    return {
        pdo.name: f"{pdo.target.cob_id:03X} {pdo.target.transmission_type} "
        + " ".join(f"{m.index:04X}/{m.bits}" for m in pdo.target.mapping)
        + f" {pdo.change.name}"
        for pdo in plan.pdos
    }


@dataclass
class Case:
    device: DevicePdos
    plan: dict[str, str]
    by_sdo: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    objects: dict[int, MapEntry] | None = None
    wanted: PdoRequirements | None = None
    policy: Policy | None = None
    axis: int = 1


CASES = {
    "an empty drive gets the standard layout with SYNC": Case(
        EMPTY,
        {
            "RPDO1": "205 1 6060/8 607A/32 6040/16 MAPPING",
            "RPDO2": "305 1 60FF/32 6071/16 MAPPING",
            "TPDO1": "185 1 6041/16 6061/8 6064/32 MAPPING",
            "TPDO2": "285 1 606C/32 6077/16 MAPPING",
            "TPDO3": "385 1 6062/32 MAPPING",
        },
    ),
    "without SYNC it is event-driven": Case(
        EMPTY,
        {
            "RPDO1": "205 255 6060/8 607A/32 6040/16 MAPPING",
            "RPDO2": "305 255 60FF/32 6071/16 MAPPING",
            "TPDO1": "185 255 6041/16 6061/8 6064/32 MAPPING",
            "TPDO2": "285 255 606C/32 6077/16 MAPPING",
            "TPDO3": "385 255 6062/32 MAPPING",
        },
        policy=Policy(sync=False),
    ),
    "a mapping that covers what is wanted is kept, its repetitions are switched off": Case(
        GENERIC,
        {
            "RPDO2": "305 1 6040/16 6060/8 COMMUNICATION",
            "RPDO3": "405 1 6040/16 607A/32 COMMUNICATION",
            "RPDO4": "505 1 6040/16 60FF/32 COMMUNICATION",
            "TPDO2": "285 1 6041/16 6061/8 COMMUNICATION",
            "TPDO3": "385 1 6041/16 6064/32 COMMUNICATION",
            "TPDO4": "485 1 6041/16 606C/32 COMMUNICATION",
            "TPDO1": "185 255 6041/16 DISABLE",
        },
        wanted=NO_TORQUE,
    ),
    "it is remapped when torque is wanted too": Case(
        GENERIC,
        {
            "RPDO1": "205 1 6060/8 607A/32 6040/16 MAPPING",
            "RPDO2": "305 1 60FF/32 6071/16 MAPPING",
            "TPDO1": "185 1 6041/16 6061/8 6064/32 MAPPING",
            "TPDO2": "285 1 606C/32 6077/16 MAPPING",
            "TPDO3": "385 1 6062/32 MAPPING",
            "TPDO4": "485 255 6041/16 606C/32 DISABLE",
        },
    ),
    "a fixed mapping sends torque by SDO": Case(
        GENERIC,
        {
            "RPDO2": "305 1 6040/16 6060/8 COMMUNICATION",
            "RPDO3": "405 1 6040/16 607A/32 COMMUNICATION",
            "RPDO4": "505 1 6040/16 60FF/32 COMMUNICATION",
            "TPDO2": "285 1 6041/16 6061/8 COMMUNICATION",
            "TPDO3": "385 1 6041/16 6064/32 COMMUNICATION",
            "TPDO4": "485 1 6041/16 606C/32 COMMUNICATION",
            "TPDO1": "185 255 6041/16 DISABLE",
        },
        by_sdo=("target_torque", "torque", "demand"),
        policy=Policy(remap=False),
    ),
    "nothing may be changed at all": Case(
        GENERIC,
        {
            "RPDO2": "305 255 6040/16 6060/8 KEEP",
            "RPDO3": "405 255 6040/16 607A/32 KEEP",
            "RPDO4": "505 255 6040/16 60FF/32 KEEP",
            "TPDO2": "285 255 6041/16 6061/8 KEEP",
            "TPDO3": "385 255 6041/16 6064/32 KEEP",
            "TPDO4": "485 255 6041/16 606C/32 KEEP",
        },
        wanted=NO_TORQUE,
        policy=Policy(remap=False, communication=False),
    ),
    "a PDO that is off but mapped is only switched on": Case(
        DevicePdos(
            (rpdo(1, "6040/16 6060/8 607A/32", 1, valid=False),),
            (tpdo(1, "6041/16 6061/8 6064/32", 1, valid=False),),
        ),
        {
            "RPDO1": "205 1 6040/16 6060/8 607A/32 COMMUNICATION",
            "TPDO1": "185 1 6041/16 6061/8 6064/32 COMMUNICATION",
        },
        wanted=PdoRequirements(
            ("statusword", "mode", "position"), ("controlword", "mode", "target_position")
        ),
    ),
    "a drive that is as it should be is left alone": Case(
        DevicePdos(
            (rpdo(1, "6040/16 6060/8 607A/32", 0), rpdo(2, "60FF/32 6071/16", 240)),
            (tpdo(1, "6041/16 6061/8 6064/32", 1), tpdo(2, "606C/32 6077/16", 1), tpdo(3, "6062/32", 1)),
        ),
        {
            "RPDO1": "205 0 6040/16 6060/8 607A/32 KEEP",
            "RPDO2": "305 240 60FF/32 6071/16 KEEP",
            "TPDO1": "185 1 6041/16 6061/8 6064/32 KEEP",
            "TPDO2": "285 1 606C/32 6077/16 KEEP",
            "TPDO3": "385 1 6062/32 KEEP",
        },
    ),
    "one RPDO and one TPDO are filled by order of importance": Case(
        DevicePdos(EMPTY.rpdos[:1], EMPTY.tpdos[:1]),
        {
            "RPDO1": "205 1 6060/8 607A/32 6040/16 MAPPING",
            "TPDO1": "185 1 6041/16 6061/8 6064/32 MAPPING",
        },
        by_sdo=("target_velocity", "target_torque", "velocity", "torque", "demand"),
    ),
    "room that is left is used": Case(
        DevicePdos(EMPTY.rpdos[:1], EMPTY.tpdos[:1]),
        {
            "RPDO1": "205 1 6060/8 60FF/32 6040/16 MAPPING",
            "TPDO1": "185 1 6041/16 6061/8 606C/32 MAPPING",
        },
        wanted=PdoRequirements(
            ("statusword", "mode", "velocity"), ("controlword", "mode", "target_velocity")
        ),
    ),
    "a mode that cannot be mapped travels by SDO": Case(
        EMPTY,
        {
            "RPDO1": "205 1 607A/32 6040/16 MAPPING",
            "RPDO2": "305 1 60FF/32 MAPPING",
            "TPDO1": "185 1 6041/16 6061/8 6064/32 MAPPING",
            "TPDO2": "285 1 606C/32 MAPPING",
        },
        by_sdo=("mode",),
        objects=objects(unmappable=(0x6060,)),
        wanted=NO_TORQUE,
    ),
    "objects that the drive does not have are missing and not mapped": Case(
        EMPTY,
        {
            "RPDO1": "205 1 6060/8 607A/32 6040/16 MAPPING",
            "TPDO1": "185 1 6041/16 6061/8 6064/32 MAPPING",
        },
        missing=("target_velocity", "velocity"),
        objects=objects(0x60FF, 0x606C),
        wanted=NO_TORQUE,
    ),
    "what the drive refused to map is left out": Case(
        EMPTY,
        {
            "RPDO1": "205 1 607A/32 6040/16 MAPPING",
            "RPDO2": "305 1 60FF/32 MAPPING",
            "TPDO1": "185 1 6041/16 6061/8 6064/32 MAPPING",
            "TPDO2": "285 1 606C/32 MAPPING",
        },
        by_sdo=("mode",),
        wanted=NO_TORQUE,
        policy=Policy(refused=frozenset({0x6060})),
    ),
    "a target position mapped with half its bits carries nothing": Case(
        DevicePdos((rpdo(1, "6040/16 607A/16"),), (tpdo(1, "6041/16 6064/16"),)),
        {"RPDO1": "205 1 6040/16 607A/16 COMMUNICATION", "TPDO1": "185 1 6041/16 6064/16 COMMUNICATION"},
        by_sdo=("target_position", "position"),
        wanted=PdoRequirements(("statusword", "position"), ("controlword", "target_position")),
        policy=Policy(remap=False),
    ),
    "COB-IDs without node ID are everybody's and are replaced": Case(
        DevicePdos(
            (rpdo(1, "6040/16 607A/32", 1, cob_id=0x200),), (tpdo(1, "6041/16 6064/32", 1, cob_id=0x180),)
        ),
        {"RPDO1": "205 1 6040/16 607A/32 COMMUNICATION", "TPDO1": "185 1 6041/16 6064/32 COMMUNICATION"},
        wanted=PdoRequirements(("statusword", "position"), ("controlword", "target_position")),
    ),
    "another node's COB-ID is replaced by the predefined one": Case(
        DevicePdos(
            (rpdo(1, "6040/16 607A/32", 1, cob_id=0x201),), (tpdo(1, "6041/16 6064/32", 1, cob_id=0x181),)
        ),
        {"RPDO1": "205 1 6040/16 607A/32 COMMUNICATION", "TPDO1": "185 1 6041/16 6064/32 COMMUNICATION"},
        wanted=PdoRequirements(("statusword", "position"), ("controlword", "target_position")),
    ),
    "a predefined COB-ID that another node took is not used": Case(
        DevicePdos(
            (rpdo(1, "6040/16 607A/32", 1, cob_id=0x27E),), (tpdo(1, "6041/16 6064/32", 1, cob_id=0x185),)
        ),
        {"RPDO1": "27E 1 6040/16 607A/32 KEEP", "TPDO1": "1FF 1 6041/16 6064/32 COMMUNICATION"},
        wanted=PdoRequirements(("statusword", "position"), ("controlword", "target_position")),
        policy=Policy(taken=frozenset({0x205, 0x185}), spare=(0x1FF,)),
    ),
    "the second axis takes PDOs 5 to 8 and spare COB-IDs": Case(
        DevicePdos(
            (*GENERIC.rpdos, *(rpdo(n, "", valid=False) for n in (5, 6))),
            (*GENERIC.tpdos, *(tpdo(n, "", valid=False) for n in (5, 6, 7))),
        ),
        {
            "RPDO5": "27F 1 6860/8 687A/32 6840/16 MAPPING",
            "RPDO6": "37F 1 68FF/32 6871/16 MAPPING",
            "TPDO5": "47F 1 6841/16 6861/8 6864/32 MAPPING",
            "TPDO6": "57F 1 686C/32 6877/16 MAPPING",
            "TPDO7": "1FF 1 6862/32 MAPPING",
        },
        objects=objects() | objects(axis=2),
        policy=Policy(spare=spare_cob_ids(frozenset({NODE}))),
        axis=2,
    ),
    "the second axis takes the block of 64 where the device has one": Case(
        DevicePdos(
            (*GENERIC.rpdos, rpdo(65, "6840/16 687A/32", 1, cob_id=0x245)),
            (*GENERIC.tpdos, tpdo(65, "6841/16 6864/32", 1, cob_id=0x1C5)),
        ),
        {
            "RPDO65": "245 1 6860/8 687A/32 6840/16 MAPPING",
            "TPDO65": "1C5 1 6841/16 6861/8 6864/32 MAPPING",
        },
        objects=objects(axis=2),
        wanted=PdoRequirements(
            ("statusword", "mode", "position"), ("controlword", "mode", "target_position")
        ),
        axis=2,
    ),
    "a second axis without PDOs of its own travels by SDO": Case(
        GENERIC,
        {},
        by_sdo=("controlword", "target_position", "statusword", "position"),
        objects=objects(axis=2),
        wanted=PdoRequirements(("statusword", "position"), ("controlword", "target_position")),
        axis=2,
    ),
    "a layout that carries no more than what is mapped changes nothing": Case(
        DevicePdos(
            (rpdo(1, "6040/16", 1),),
            (tpdo(1, "6041/16 6061/8 606C/32", 1),),  # 606Ch could not be mapped again, 6064h could
        ),
        {"RPDO1": "205 1 6040/16 KEEP", "TPDO1": "185 1 6041/16 6061/8 606C/32 KEEP"},
        by_sdo=("position",),
        objects=objects(unmappable=(0x606C,)),
        wanted=PdoRequirements(("statusword", "mode", "position", "velocity"), ("controlword",)),
    ),
    "a PDO that no COB-ID is left for stays off, and its values travel by SDO": Case(
        DevicePdos((rpdo(1, "6040/16", 1), rpdo(2, "607A/32", 1, cob_id=0x206)), ()),
        {"RPDO1": "205 1 6040/16 KEEP"},
        by_sdo=("target_position",),
        wanted=PdoRequirements((), ("controlword", "target_position")),
        policy=Policy(remap=False, taken=frozenset({0x206, 0x305})),
    ),
    "a TPDO that is off or carries nothing and an RPDO that is not needed are left as they are": Case(
        DevicePdos(
            (rpdo(1, "6040/16", 1), rpdo(2, "6040/16 607A/32", 1)),
            (
                tpdo(1, "6041/16 6064/32", 1),
                tpdo(2, "6041/16", 1),
                tpdo(3, "", 1),
                tpdo(4, "6041/16", 1, valid=False),
            ),
        ),
        {
            "RPDO2": "305 1 6040/16 607A/32 KEEP",
            "TPDO1": "185 1 6041/16 6064/32 KEEP",
            "TPDO2": "285 1 6041/16 DISABLE",
        },
        wanted=PdoRequirements(("statusword", "position"), ("controlword", "target_position")),
    ),
    "an object of the maker's beside those of the second axis is of no other axis": Case(
        DevicePdos((*GENERIC.rpdos, rpdo(5, "6840/16 2000/16", 1, cob_id=0x245)), ()),
        {"RPDO5": "245 1 6840/16 2000/16 KEEP"},
        objects=objects(axis=2),
        wanted=PdoRequirements((), ("controlword",)),
        policy=Policy(remap=False),
        axis=2,
    ),
    "without SYNC what came with it is event-driven, what is so already stays": Case(
        DevicePdos((rpdo(1, "6040/16", 1), rpdo(2, "607A/32", 254)), (tpdo(1, "6041/16", 1),)),
        {
            "RPDO1": "205 255 6040/16 COMMUNICATION",
            "RPDO2": "305 254 607A/32 KEEP",
            "TPDO1": "185 255 6041/16 COMMUNICATION",
        },
        wanted=PdoRequirements(("statusword",), ("controlword", "target_position")),
        policy=Policy(sync=False),
    ),
    "an RPDO of a reserved type serves nothing, whatever TPDO is asked for": Case(
        DevicePdos((rpdo(1, "6040/16", 253),), (tpdo(1, "6041/16", 253),)),
        {"TPDO1": "185 253 6041/16 KEEP"},
        by_sdo=("controlword",),
        wanted=PdoRequirements(("statusword",), ("controlword",)),
        policy=Policy(communication=False, requests={1: 0.1}),
    ),
    "an RPDO that commands both axes serves neither": Case(
        DevicePdos((rpdo(1, "6040/16 6840/16", 1),), (tpdo(1, "6041/16 6841/16", 1),)),
        {"TPDO1": "185 1 6041/16 6841/16 KEEP"},
        by_sdo=("controlword",),
        objects=objects() | objects(axis=2),
        wanted=PdoRequirements(("statusword",), ("controlword",)),
        policy=Policy(remap=False),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_drive_gets_its_plan(name: str) -> None:
    case = CASES[name]
    plan = make_plan(NODE, case.device, case.objects or objects(), case.wanted, case.policy, axis=case.axis)
    assert lines(plan) == case.plan
    assert len(plan.pdos) == len(case.plan)
    assert all(pdo.target.valid is (pdo.change is not PdoChange.DISABLE) for pdo in plan.pdos)
    sources = {**plan.inputs, **{f"{key}": value for key, value in plan.outputs.items()}}
    by_sdo = {
        name
        for side in (plan.inputs, plan.outputs)
        for name, how in side.items()
        if how is ValueTransport.SDO
    }
    missing = {name for name, how in sources.items() if how is ValueTransport.NONE}
    assert by_sdo == set(case.by_sdo)
    assert missing == set(case.missing)
    assert all(pdo.target.bits <= 64 for pdo in plan.pdos)
    assert len(plan.notes) >= len(by_sdo) + len(missing)


MAPPED = PdoRequirements((), ("controlword", "mode", "target_position"))


@pytest.mark.parametrize(
    ("rpdos", "after"),
    [
        ("607A/32 6040/16", False),
        ("6060/8 607A/32 6040/16", False),
        ("607A/32 6040/16 6060/8", False),
        ("6040/16 607A/32", True),
        ("6040/16 6060/8 607A/32", True),
        ("6060/8 6040/16 607A/32", True),
        ("6040/16 6060/8, 607A/32", True),  # apart, in whichever order they are taken
        ("607A/32, 6060/8 6040/16", True),
        ("607A/32 6040/16, 6060/8 6040/16", True),  # two controlwords: the edge may come with the other one
        ("6060/8 607A/32", True),  # the controlword travels by SDO, which waits for no SYNC
        ("6060/8 6040/16", False),  # the target travels by SDO: the port waits for its answer
        ("6040/16 607A/16 6060/8", False),  # half a target is not used: by SDO as well
    ],
)
def test_the_edge_has_the_cycle_of_its_target_unless_the_mapping_delays_the_target(
    rpdos: str, after: bool
) -> None:
    device = DevicePdos(tuple(rpdo(number, text, 1) for number, text in enumerate(rpdos.split(", "), 1)), ())
    plan = make_plan(NODE, device, objects(), MAPPED, Policy(remap=False))
    assert plan.edge_after_target is after


@pytest.mark.parametrize(
    ("after_target", "foreign_sync", "cycles"),
    [(False, False, 0), (False, True, 0), (True, False, 1), (True, True, 2)],
)
def test_with_an_external_sync_the_edge_waits_for_one_more_cycle(
    after_target: bool, foreign_sync: bool, cycles: int
) -> None:
    """A cycle that took too long sends its frames together with those of the next, before the same SYNC."""
    assert setpoint_edge_order.delay(after_target, foreign_sync) == cycles


def test_a_layout_of_the_master_needs_no_wait() -> None:
    for rpdos in (1, 2, 4):
        plan = make_plan(NODE, DevicePdos(EMPTY.rpdos[:rpdos], EMPTY.tpdos), objects())
        first = next(pdo for pdo in plan.pdos if "controlword" in pdo.values)
        assert first.values[-1] == "controlword"
        assert not plan.edge_after_target


def test_event_timer_and_inhibit_time_are_set_if_they_are_off() -> None:
    device = DevicePdos((), (tpdo(1, "6041/16", event=0, inhibit=0), tpdo(2, "6064/32")))
    wanted = PdoRequirements(("statusword", "position"), ())
    plan = make_plan(NODE, device, objects(), wanted, Policy(sync=False, event_timer=20, inhibit_time=50))
    first, second = (pdo.target for pdo in plan.pdos)
    assert (first.event_timer, first.inhibit_time) == (20, 50)
    assert (second.event_timer, second.inhibit_time) == (None, None)  # the drive has no such entries


@pytest.mark.parametrize(("has", "gets"), [(0, 20), (5, 5), (20, 20), (1000, 20)])
def test_a_tighter_event_timer_stays(has: int, gets: int) -> None:
    device = DevicePdos((), (tpdo(1, "6041/16", event=has),))
    plan = make_plan(NODE, device, objects(), PdoRequirements(("statusword",), ()), Policy(sync=False))
    assert plan.pdos[0].target.event_timer == gets


OWN_TYPE = {"fixed": frozenset({(False, 1)})}  # the user has set the transmission type
KEPT = {"communication": False, "remap": False}  # the drive refuses everything else


@pytest.mark.parametrize(
    ("policy", "has", "gets", "change"),
    [
        ({"sync": False}, 1000, 20, "COMMUNICATION"),
        ({"sync": False, "timed": frozenset({1})}, 1000, 1000, "KEEP"),
        ({"sync": False, "timed": frozenset({1})}, 0, 0, "KEEP"),
        (OWN_TYPE, 1000, 20, "COMMUNICATION"),
        (OWN_TYPE, 21, 20, "COMMUNICATION"),
        (OWN_TYPE, 20, 20, "KEEP"),
        (OWN_TYPE, 5, 5, "KEEP"),
        (OWN_TYPE, 0, 0, "KEEP"),  # on change only, as the user has it
        (OWN_TYPE, None, None, "KEEP"),
        (OWN_TYPE | {"timed": frozenset({1})}, 1000, 1000, "KEEP"),
        (KEPT, 1000, 20, "TIMER"),
        (KEPT, 0, 0, "KEEP"),
        (KEPT | {"timers": False}, 1000, 1000, "KEEP"),  # a drive found enabled: nothing is written
    ],
)
def test_a_slow_event_timer_of_the_statusword_is_shortened(
    policy: dict[str, object], has: int | None, gets: int | None, change: str
) -> None:
    device = DevicePdos((), (tpdo(1, "6041/16", event=has),))
    plan = make_plan(NODE, device, objects(), PdoRequirements(("statusword",), ()), Policy(**policy))  # type: ignore[arg-type]
    (pdo,) = plan.pdos
    assert (pdo.target.event_timer, pdo.change.name) == (gets, change)
    assert [(timer.was, timer.wanted) for timer in plan.event_timers] == (
        [(has, gets)] if has != gets else []
    )


def test_the_event_timer_of_another_value_stays_as_the_user_has_its_tpdo() -> None:
    device = DevicePdos((), (tpdo(1, "6041/16", 1), tpdo(2, "6064/32", event=1000)))
    wanted = PdoRequirements(("statusword", "position"), ())
    plan = make_plan(NODE, device, objects(), wanted, Policy(fixed=frozenset({(False, 2)})))
    assert [pdo.target.event_timer for pdo in plan.pdos] == [None, 1000]


def test_with_sync_the_event_timer_does_not_matter() -> None:
    device = DevicePdos((), (tpdo(1, "6041/16", event=1000),))
    plan = make_plan(NODE, device, objects(), PdoRequirements(("statusword",), ()), Policy())
    assert (plan.pdos[0].target.transmission_type, plan.pdos[0].target.event_timer) == (1, 1000)
    kept = DevicePdos((), (tpdo(1, "6041/16", transmission=1, event=1000),))
    plan = make_plan(NODE, kept, objects(), PdoRequirements(("statusword",), ()), Policy(communication=False))
    assert (plan.pdos[0].change, plan.pdos[0].target.event_timer) == (PdoChange.KEEP, 1000)


def test_a_synchronous_value_without_a_synchronous_pdo_is_impossible() -> None:
    wanted = PdoRequirements(
        synchronous_inputs=frozenset({"position"}), synchronous_outputs=frozenset({"target_torque"})
    )
    assert make_plan(NODE, EMPTY, objects(), wanted).impossible == ()
    no_sync = make_plan(NODE, EMPTY, objects(), wanted, Policy(sync=False))
    assert len(no_sync.impossible) == 2
    assert "sync = false" in no_sync.impossible[0]
    fixed = make_plan(NODE, GENERIC, objects(), wanted, Policy(remap=False))
    assert fixed.impossible == (
        "target torque must be transmitted in a synchronous PDO, but is transmitted by SDO",
    )


def test_a_tpdo_sent_at_sync_only_on_change_does_not_count_as_periodic() -> None:
    device = DevicePdos((), (tpdo(1, "6041/16", transmission=0),))
    plan = make_plan(
        NODE,
        device,
        objects(),
        PdoRequirements(("statusword",), ()),
        Policy(remap=False, communication=False),
    )
    assert plan.inputs == {"statusword": ValueTransport.EVENT_PDO}


def test_a_tpdo_sent_only_on_request_is_no_source() -> None:
    device = DevicePdos((), (tpdo(1, "6041/16", transmission=253),))
    plan = make_plan(
        NODE,
        device,
        objects(),
        PdoRequirements(("statusword",), ()),
        Policy(remap=False, communication=False),
    )
    assert plan.inputs == {"statusword": ValueTransport.SDO}


@pytest.mark.parametrize(("transmission", "period"), [(253, 0.1), (255, 0.0), (1, 0.0)])
def test_only_a_tpdo_that_waits_for_a_remote_frame_is_requested(transmission: int, period: float) -> None:
    device = DevicePdos((), (tpdo(1, "6041/16", transmission=transmission),))
    policy = Policy(communication=False, requests={1: 0.1})
    (pdo,) = make_plan(NODE, device, objects(), PdoRequirements(("statusword",), ()), policy).pdos
    assert pdo.request == period


def test_no_two_nodes_share_a_spare_cob_id() -> None:
    nodes = frozenset({1, 2, 5})
    shares = [set(spare_cob_ids(nodes, node)) for node in sorted(nodes)]
    assert all(len(share) >= 8 * 41 for share in shares)
    assert set().union(*shares) == set(spare_cob_ids(nodes))
    assert sum(map(len, shares)) == len(set().union(*shares))
    assert not {0x200 + node for node in nodes} & set().union(*shares)


def test_the_sign_of_every_entry_is_known() -> None:
    plan = make_plan(NODE, EMPTY, objects())
    signs = {(m.index, s) for pdo in plan.pdos for m, s in zip(pdo.target.mapping, pdo.signed, strict=True)}
    assert (0x6040, False) in signs
    assert (0x6041, False) in signs
    assert {i for i, s in signs if s} == {
        0x6060, 0x607A, 0x60FF, 0x6071, 0x6061, 0x6064, 0x606C, 0x6077, 0x6062,
    }  # fmt: skip


def test_the_plan_gives_the_position_of_an_object_in_its_pdo() -> None:
    plan = make_plan(NODE, EMPTY, objects(0x6062))
    carried = [
        plan.carrier(entry.index, entry.subindex) for pdo in plan.active for entry in pdo.target.mapping
    ]
    assert all(place is not None for place in carried)
    statusword, display = plan.carrier(0x6041, 0), plan.carrier(0x6061, 0)
    assert statusword is not None
    assert display is not None
    assert (statusword.pdo, statusword.shift, statusword.bits) == ("TPDO1", 0, 16)
    assert (display.can_id, display.shift, display.bits) == (statusword.can_id, 16, 8)
    assert plan.carrier(0x6041, 1) is None
    assert plan.carrier(0x1018, 1) is None


def test_why_a_value_travels_by_sdo_is_reported() -> None:
    wanted = PdoRequirements((), ("target_position", "target_torque"))
    for plan, why in (
        (
            make_plan(NODE, EMPTY, objects(), wanted, Policy(refused=frozenset({0x6071}))),
            "the drive refuses to map it into an RPDO",
        ),
        (
            make_plan(NODE, EMPTY, objects(unmappable=(0x6071,)), wanted),
            "its dictionary does not allow it to be mapped into an RPDO, and no present mapping has it",
        ),
        (
            make_plan(
                NODE, DevicePdos((rpdo(1, "607A/32"),), ()), objects(), wanted, Policy(communication=False)
            ),
            "the mapping is fixed and does not contain it",
        ),
        (
            make_plan(
                NODE,
                DevicePdos(EMPTY.rpdos[:1], ()),
                objects() | {0x607A: replace(objects()[0x607A], bits=64)},
                wanted,
            ),
            "an RPDO with room for it does not exist",
        ),
    ):
        (note,) = plan.notes
        assert note.startswith("6071h ")
        assert note.endswith(f" is transmitted by SDO: {why}")


def test_the_plan_can_be_read() -> None:
    text = describe(make_plan(NODE, GENERIC, objects(0x6062), policy=Policy(remap=False)))
    assert "RPDO3 405h with SYNC (type 1): 6040:00/16 controlword, 607A:00/32 target position" in text
    assert "TPDO1 185h switched off, others contain the same" in text
    assert "6071h (Target torque) is transmitted by SDO: the mapping is fixed and does not contain it" in text
    assert "6062h (Position demand value) is not in the drive's dictionary" in text


# -- mapping according to a drive's dictionary ----


def eds(*entries: tuple[int, DataType, str, bool]) -> Eds:
    return Eds(
        "test.eds",
        {
            index: Object(
                index,
                "x",
                ObjectType.VAR,
                {0: Variable(index, 0, "x", data_type, access, pdo_mapping=mappable)},
            )
            for index, data_type, access, mappable in entries
        },
        {},
    )


def test_the_dictionary_lists_the_mappable_objects() -> None:
    file = eds(
        (0x6040, DataType.UNSIGNED16, "rww", True),
        (0x6041, DataType.UNSIGNED16, "ro", True),
        (0x6060, DataType.INTEGER8, "rw", False),
        (0x60FF, DataType.UNSIGNED32, "rw", True),  # mistyped as in some files
        (0x6071, DataType.INTEGER32, "rw", True),  # 32 bits in this drive
    )
    found = axis_objects(Dictionary(file), DevicePdos((), ()))
    assert found == {
        0x6040: MapEntry(0x6040, 0, 16, False, True, False),
        0x6041: MapEntry(0x6041, 0, 16, False, False, True),
        0x6060: MapEntry(0x6060, 0, 8, True, False, False),
        0x60FF: MapEntry(0x60FF, 0, 32, True, True, True),
        0x6071: MapEntry(0x6071, 0, 32, True, True, True),
    }


def test_an_object_that_the_file_forgot_but_the_drive_maps_exists() -> None:
    device = DevicePdos((), (tpdo(1, "6041/16 6064/32"),))
    found = axis_objects(Dictionary(eds((0x6041, DataType.UNSIGNED16, "ro", True))), device)
    assert found[0x6064] == MapEntry(0x6064, 0, 32, True, False, False)


def test_without_a_file_the_standards_objects_are_taken() -> None:
    found = axis_objects(Dictionary(), DevicePdos((), ()), axis=2)
    expected = objects(axis=2)
    assert {index: (e.bits, e.signed) for index, e in found.items()} == {
        index: (e.bits, e.signed) for index, e in expected.items()
    }
    assert found[0x6840].receive
    assert found[0x6841].transmit
    assert found[0x6841].mapped == MappedObject(0x6841, 0, 16)


def test_an_object_without_a_size_cannot_be_mapped() -> None:
    file = eds((0x6041, DataType.UNSIGNED16, "ro", True), (0x6064, DataType.DOMAIN, "ro", True))
    assert list(axis_objects(Dictionary(file), DevicePdos((), ()))) == [0x6041]


def test_planning_twice_changes_nothing_more() -> None:
    """Once a plan holds, the next boot finds the drive as it wants it."""
    first = make_plan(NODE, EMPTY, objects())
    after = DevicePdos(
        tuple(pdo.target for pdo in first.pdos if pdo.receive),
        tuple(pdo.target for pdo in first.pdos if not pdo.receive),
    )
    second = make_plan(NODE, after, objects())
    assert {pdo.change for pdo in second.pdos} == {PdoChange.KEEP}
    assert not second.remapped
    assert replace(second, pdos=()) == replace(first, pdos=())


# -- a full wire ----------------------------------------------------------------------------------------------------------


def types_of(device, **changes) -> dict[str, int]:
    plan = make_plan(NODE, device, objects(), policy=Policy(slow=12, **changes))
    return {pdo.name: pdo.target.transmission_type for pdo in plan.active}


def test_on_a_full_bus_only_values_for_cyclic_modes_are_sent_with_every_sync():
    assert types_of(EMPTY) == {"RPDO1": 1, "RPDO2": 1, "TPDO1": 1, "TPDO2": 12, "TPDO3": 12}
    with_word = types_of(DevicePdos(GENERIC.rpdos, GENERIC.tpdos), remap=False)
    assert set(with_word.values()) == {1}  # each of its TPDOs has the statusword
    assert types_of(EMPTY, fixed=frozenset({(False, 2)}))["TPDO3"] == 12


def test_on_a_full_wire_without_sync_nothing_has_a_pace():
    assert set(types_of(EMPTY, sync=False).values()) == {255}
