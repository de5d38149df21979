"""The planner over makers' files, if a folder of them exists: every drive gets a plan that follows CiA 301's rules."""

from __future__ import annotations

import pytest

from axisbus.bus.pdo.mapping import DevicePdos, axis_objects
from axisbus.bus.pdo.plan import Policy, make_plan
from axisbus.bus.pdo.plantext import describe
from axisbus.cia301.pdo import MappedObject, PdoConfiguration
from axisbus.cia402.port import ValueTransport
from axisbus.eds import Eds, load
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import EdsError
from kit.corpus import CORPUS as FOLDER

FILES = sorted(FOLDER.glob("*.eds")) if FOLDER.is_dir() else []
NODE = 5

pytestmark = pytest.mark.skipif(not FILES, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")


def number(file: Eds, index: int, subindex: int) -> int | None:
    variable = file.get(index, subindex)
    value = variable.initial(NODE) if variable is not None else None
    return value if isinstance(value, int) else None


def pdos(file: Eds, communication: int, mapping: int) -> tuple[PdoConfiguration, ...]:
    """The PDOs as the file's defaults describe them."""
    found = []
    for offset in range(8):
        cob_id = number(file, communication + offset, 1)
        if cob_id is None:
            continue
        count = number(file, mapping + offset, 0) or 0
        entries = [number(file, mapping + offset, sub) for sub in range(1, min(count, 64) + 1)]
        found.append(
            PdoConfiguration(
                offset + 1,
                cob_id & 0x7FF,
                not cob_id & 1 << 31,
                number(file, communication + offset, 2) or 255,
                tuple(MappedObject.from_entry(entry) for entry in entries if entry),
                number(file, communication + offset, 3),
                number(file, communication + offset, 5),
            )
        )
    return tuple(found)


def drives() -> list[Eds]:
    files = []
    for path in FILES:
        try:
            file = load(path)
        except EdsError:
            continue
        if 0x6040 in file and 0x6041 in file:
            files.append(file)
    return files


def test_every_drive_gets_a_plan() -> None:
    by_pdo = total = 0
    for file in drives():
        device = DevicePdos(pdos(file, 0x1400, 0x1600), pdos(file, 0x1800, 0x1A00))
        objects = axis_objects(Dictionary(file), device)
        for policy in (Policy(), Policy(sync=False), Policy(remap=False)):
            plan = make_plan(NODE, device, objects, policy=policy)
            where = f"{file.source}\n{describe(plan)}"
            for pdo in plan.active:
                assert 0 < pdo.target.bits <= 64, where
                assert 0x180 < pdo.target.cob_id < 0x580, where
                assert pdo.target.synchronous is policy.sync, where
            ids = [pdo.target.cob_id for pdo in plan.active]
            assert len(ids) == len(set(ids)), where
            sides = ((plan.inputs, False), (plan.outputs, True))
            for sources, receive in sides:
                carried = {name for pdo in plan.active if pdo.receive is receive for name in pdo.values}
                by_sources = {
                    name
                    for name, how in sources.items()
                    if how in (ValueTransport.SYNC_PDO, ValueTransport.EVENT_PDO)
                }
                assert carried - {None} == by_sources, where
            if policy.remap:
                total += 1
                how = {plan.outputs["controlword"], plan.inputs["statusword"]}
                by_pdo += ValueTransport.SDO not in how
    assert total > 100
    assert by_pdo > 0.9 * total  # the rest has no PDO at all, or none that may hold the words
