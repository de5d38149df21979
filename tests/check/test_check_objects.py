"""Objects that the cell file writes and maps into PDOs; each cell has just one defect."""

from __future__ import annotations

from pathlib import Path

import pytest

from kit import cells


def setting(written: str) -> tuple[str, str]:
    """Return a change that adds a line to ``[nodes.1.objects]``."""
    return '"6065" = 4000', f'"6065" = 4000\n{written}'


# -- objects ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "written",
    [
        '"6067" = 5',
        '"0x6067" = 5',
        '"6067h" = 5',
        '"6099:01" = 5',
        '"6099h:2" = 5',
        '"Position window" = 5',
        '"2001" = "name"',
        '"2002" = 0.5',
        '"2002" = 1',
        '"6067" = 5.0',
    ],
)
def test_objects_are_named_by_index_or_name(tmp_path: Path, written: str) -> None:
    assert cells.serious(cells.write(tmp_path, setting(written))) == []


@pytest.mark.parametrize(
    ("written", "words", "remedy"),
    [
        ('"Position windw" = 5', "there is no object 'Position windw'", "position window"),
        ('"60FE:01" = 5', "the drive has no 60FEh:01", "name the EDS of the present drive"),
        ('"607D:03" = 5', "the drive has no 607Dh:03", "delete this line"),
        ('"6064" = 5', "6064h:00 (Position actual value) cannot be written", "delete this line"),
        ('"6067" = -1', "cannot hold -1", "correct the value"),
        ('"6067" = 4294967296', "cannot hold 4294967296", "correct the value"),
        ('"6067" = 5.5', "cannot hold 5.5", "correct the value"),
        ('"6067" = "five"', "cannot hold 'five'", "correct the value"),
        ('"2001" = 5', "cannot hold 5", "correct the value"),
        ('"6040" = 15', "must not write 6040h:00 (Controlword)", "delete this line"),
        ('"Target position" = 1', "must not write 607Ah:00", "delete this line"),
        ('"60FF" = 1', "must not write 60FFh:00", "delete this line"),
        ('"1010:01" = 0x65766173', "must not write 1010h:01", "by hand"),
        ('"1800:02" = 1', "must not write 1800h:02", "[nodes.N.pdo.tpdo1]"),
        ('"1A00" = 0', "must not write 1A00h:00", "[nodes.N.pdo.tpdo1]"),
    ],
)
def test_an_object_that_cannot_or_must_not_be_written_is_reported(
    tmp_path: Path, written: str, words: str, remedy: str
) -> None:
    problem = cells.only(cells.write(tmp_path, setting(written)), "error", written)
    assert words in problem.message
    assert "[nodes.1.objects]" in problem.message
    assert remedy in problem.remedy


def test_the_line_of_the_eds_that_forbids_writing_is_reported(tmp_path: Path) -> None:
    path = cells.write(tmp_path, setting('"6064" = 5'))
    line = cells.line_of(tmp_path / "drive.eds", "[6064]")
    assert f"drive.eds:{line}: its access is ro" in cells.serious(path)[0].observed


def test_the_limits_of_the_eds_hold(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path, setting('"6067" = 50'), eds=cells.entry("6067", LowLimit="10", HighLimit="0x20")
    )
    assert "its EDS allows 10 to 32" in cells.only(path, "error", '"6067" = 50').observed


def test_an_object_that_the_master_sets_is_a_warning(tmp_path: Path) -> None:
    problem = cells.only(cells.write(tmp_path, setting('"1017" = 50')), "warning", '"1017" = 50')
    assert "overwritten by the master" in problem.message
    assert "heartbeat in [bus]" in problem.remedy


def test_an_axis_writes_its_own_objects_only(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('"609A" = 500000', '"6867" = 5'))
    problem = cells.only(path, "error", '"6867" = 5')
    assert "not an object of this axis" in problem.message
    assert "6000h to 67FFh" in problem.observed


def test_an_object_is_not_written_twice(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('"609A" = 500000', '"605A" = 6'))
    problem = cells.only(path, "error", 'quick_stop = "ramp"')
    assert (
        "is written twice: 6 by 605A in [axes.x.objects], 2 by quick_stop in [axes.x.stop]" in problem.message
    )
    assert f"line {cells.line_of(path, '605A')}" in problem.observed


def test_a_node_and_its_axis_do_not_contradict_each_other(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('"609A" = 500000', '"6065" = 1'))
    assert "6065h:00" in cells.only(path, "error", '"6065" = 1').message


def test_the_same_value_twice_does_no_harm(tmp_path: Path) -> None:
    assert cells.serious(cells.write(tmp_path, ('"609A" = 500000', '"605A" = 2'))) == []


def test_a_stop_word_needs_its_object(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.without("605A"))
    problem = cells.only(path, "error", 'quick_stop = "ramp"')
    assert (
        "quick_stop in [axes.x.stop]: the drive has no 605Ah:00 (Quick stop option code)" in problem.message
    )


def test_a_stop_word_keeps_the_limits_of_the_eds(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('quick_stop = "ramp"', 'quick_stop = "voltage-limit-hold"'))
    found = [each for each in cells.serious(path) if each.severity.value == "error"]
    assert [each.line for each in found] == [cells.line_of(path, "voltage-limit-hold")]
    assert "its EDS allows 0 to 7" in found[0].observed


def test_a_direction_turned_by_the_drive_needs_its_polarity(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('invert = "master"', 'invert = "drive"'), eds=cells.without("607E"))
    assert "the drive has no 607Eh" in cells.only(path, "error", 'invert = "drive"').message


def test_a_home_offset_needs_its_object(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.without("607C"))
    assert (
        "offset in [axes.x.homing]: the drive has no 607Ch"
        in cells.only(path, "error", "offset = -5.0").message
    )


# -- PDOs ------------------------------------------------------------------------------------------------------------

MAP = 'map = ["606C", "6077:00"]'


@pytest.mark.parametrize(
    "written", ['["6041", "6064", "0005"]', '["Statusword", "606Ch:00/32"]', '["6077/16"]', "[]"]
)
def test_a_map_names_objects_as_everywhere(tmp_path: Path, written: str) -> None:
    assert cells.serious(cells.write(tmp_path, (MAP, f"map = {written}"))) == []


@pytest.mark.parametrize(
    ("written", "severity", "words", "observed"),
    [
        ('["6064", "606C", "6077"]', "error", "TPDO2 maps 80 bits", "32 (6064h) + 32 (606Ch) + 16 (6077h)"),
        ('["Torque actul value"]', "error", "there is no object 'Torque actul value'", ""),
        ('["60FD"]', "error", "the drive has no 60FDh", "drive.eds"),
        (
            '["6085"]',
            "error",
            "6085h:00 (Quick stop deceleration) cannot be transmitted in a PDO",
            "PDOMapping is not 1",
        ),
        ('["6077/32"]', "error", "has 16 bits, not 32", "'6077/32'"),
        ('["0006"]', "error", "the drive does not accept the dummy 0006h", "[DummyUsage]"),
        ('["6077", "6077"]', "warning", "maps 6077h:00 (Torque actual value) more than once", ""),
    ],
)
def test_an_object_that_cannot_be_mapped_is_reported(
    tmp_path: Path, written: str, severity: str, words: str, observed: str
) -> None:
    problem = cells.only(cells.write(tmp_path, (MAP, f"map = {written}")), severity, f"map = {written}")
    assert words in problem.message
    assert observed in problem.observed
    assert "node 1" in problem.message


def test_an_rpdo_takes_no_object_that_the_drive_only_sends(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path, ("[nodes.1.pdo.tpdo2]", '[nodes.1.pdo.rpdo1]\nmap = ["6040", "6064"]\n[nodes.1.pdo.tpdo2]')
    )
    problem = cells.only(path, "error", 'map = ["6040", "6064"]')
    assert "node 1: RPDO1: 6064h:00 (Position actual value) has the other direction" in problem.message
    assert "access ro" in problem.observed
    assert "a TPDO" in problem.remedy


@pytest.mark.parametrize(
    ("written", "behind"),
    [
        ('["6040", "607A"]', "607Ah:00 (Target position)"),
        ('["6060", "6040", "607A"]', "607Ah:00 (Target position)"),
        ('["6060", "607A", "6040"]', None),
        ('["6040"]', None),
        ('["607A", "6060"]', None),
    ],
)
def test_a_controlword_with_something_behind_it_is_noted(
    tmp_path: Path, written: str, behind: str | None
) -> None:
    path = cells.write(
        tmp_path, ("[nodes.1.pdo.tpdo2]", f"[nodes.1.pdo.rpdo1]\nmap = {written}\n[nodes.1.pdo.tpdo2]")
    )
    found = [each for each in cells.notes(path) if "does not map the controlword last" in each.message]
    if behind is None:
        assert found == []
    else:
        (note,) = found
        assert note.line == cells.line_of(path, f"map = {written}")
        assert behind in note.observed
        assert "a cycle after its target" in note.observed


def test_a_tpdo_takes_no_object_that_the_drive_only_takes(tmp_path: Path) -> None:
    path = cells.write(tmp_path, (MAP, 'map = ["6065"]'), eds=cells.entry("6065", AccessType="rww"))
    assert "an RPDO" in cells.only(path, "error", 'map = ["6065"]').remedy


def test_an_object_of_no_fixed_size_cannot_be_mapped(tmp_path: Path) -> None:
    path = cells.write(tmp_path, (MAP, 'map = ["2001"]'), eds=cells.entry("2001", PDOMapping="1"))
    assert "VISIBLE_STRING has no fixed size" in cells.only(path, "error", 'map = ["2001"]').observed


def test_a_pdo_is_one_that_the_drive_has(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("[nodes.1.pdo.tpdo2]", "[nodes.1.pdo.tpdo3]"))
    problem = cells.only(path, "error", "[nodes.1.pdo.tpdo3]")
    assert "node 1 has no TPDO3" in problem.message
    assert "does not have 1802h; it has TPDO1, TPDO2" in problem.observed


def test_a_fixed_mapping_is_not_configured(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.entry("1A01sub0", AccessType="const"))
    problem = cells.only(path, "error", "map = ")
    assert "the mapping of TPDO2 is fixed" in problem.message
    assert "1A01h:00" in problem.observed
    assert 'remap = "never"' in problem.remedy


def test_a_node_that_is_not_to_be_remapped_has_no_map(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path, ('[nodes.1]\neds = "drive.eds"', '[nodes.1]\neds = "drive.eds"\nremap = "never"')
    )
    assert "must not be remapped" in cells.only(path, "error", "map = [").message


def test_communication_parameters_are_there_and_can_be_written(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path,
        ("transmission = 1", 'transmission = 255\nevent_timer = "20ms"'),
        eds=cells.without_sub("1801", 5),
    )
    problem = cells.only(path, "error", 'event_timer = "20ms"')
    assert "node 1: TPDO2 does not accept event_timer" in problem.message
    assert "does not have 1801h:05" in problem.observed


def test_a_fixed_cob_id_is_reported(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path, ("transmission = 1", "cob_id = 0x3F1"), eds=cells.entry("1801sub1", AccessType="const")
    )
    assert "does not allow writing 1801h:01" in cells.only(path, "error", "cob_id = 0x3F1").observed


@pytest.mark.parametrize(
    ("kind", "words"), [(245, "reserved"), (252, "remote frames"), (253, "remote frames")]
)
def test_transmission_types_that_cannot_serve_are_refused(tmp_path: Path, kind: int, words: str) -> None:
    path = cells.write(tmp_path, ("transmission = 1", f"transmission = {kind}"))
    assert words in cells.only(path, "error", f"transmission = {kind}").message


@pytest.mark.parametrize("kind", [0, 1, 240])
def test_synchronous_types_are_refused_without_sync(tmp_path: Path, kind: int) -> None:
    path = cells.write(
        tmp_path,
        ("sync = true", "sync = false"),
        ("transmission = 1", f"transmission = {kind}"),
        ("[groups.xy]", "[spare]"),
        ('axes = ["x", "y"]', ""),
        ('modes = ["pp", "pv", "hm", "csp"]\n', ""),
        ("[spare]", ""),
    )
    problem = cells.only(path, "error", f"transmission = {kind}")
    assert "waits for SYNC, and the bus has none" in problem.message
    assert "transmission = 255" in problem.remedy


def test_times_that_the_object_rounds_are_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("transmission = 1", 'transmission = 255\nevent_timer = "2.5ms"'))
    assert "rounded to 2 ms" in cells.only(path, "warning", "2.5ms").message


def test_timers_of_a_synchronous_pdo_have_no_effect(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("transmission = 1", 'transmission = 1\ninhibit_time = "1ms"'))
    assert "inhibit_time has no effect" in cells.only(path, "warning", "inhibit_time").message


def test_an_rpdo_has_no_inhibit_time(tmp_path: Path) -> None:
    table = '[nodes.1.pdo.rpdo1]\ntransmission = 255\ninhibit_time = "1ms"\n'
    path = cells.write(
        tmp_path, ("[nodes.2]", f"{table}[nodes.2]"), eds=cells.with_sub("1400", 3, "0x0006", "rw", "0")
    )
    assert "an RPDO has no inhibit time" in cells.only(path, "warning", "inhibit_time").message


# -- COB-IDs ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cob_id", "other"),
    [
        ("0x182", "TPDO1 of node 2"),
        ("0x282", "TPDO2 of node 2"),
        ("0x181", "TPDO1 of node 1"),
        ("0x201", "RPDO1 to node 1"),
        ("0x302", "RPDO2 to node 2"),
        ("0x082", "EMCY of node 2"),
    ],
)
def test_two_producers_of_one_cob_id_are_reported(tmp_path: Path, cob_id: str, other: str) -> None:
    path = cells.write(tmp_path, ("transmission = 1", f"cob_id = {cob_id}"))
    found = cells.serious(path)
    assert [each.severity.value for each in found] == ["error"]
    assert f"COB-ID {cob_id[2:].upper()}h is produced twice" in found[0].message
    assert "TPDO2 of node 1" in found[0].message
    assert other in found[0].message
    assert found[0].remedy == "another cob_id in [nodes.1.pdo.tpdo2]"


@pytest.mark.parametrize(
    ("cob_id", "why"),
    [
        ("0x001", "restricted"),
        ("0x07F", "restricted"),
        ("0x101", "restricted"),
        ("0x180", "restricted"),
        ("0x100", "that of TIME"),
        ("0x5FF", "that of SDO answers"),
        ("0x67F", "that of SDO requests"),
        ("0x6E0", "restricted"),
        ("0x770", "that of heartbeats"),
        ("0x7FF", "restricted"),
    ],
)
def test_pdos_stay_off_the_cob_ids_of_other_services(tmp_path: Path, cob_id: str, why: str) -> None:
    path = cells.write(tmp_path, ("transmission = 1", f"cob_id = {cob_id}"))
    problem = cells.only(path, "error", f"cob_id = {cob_id}")
    assert f"node 1: TPDO2 cannot have the COB-ID {cob_id[2:]}h" in problem.message
    assert why in problem.observed
    assert "281h" in problem.remedy


@pytest.mark.parametrize("cob_id", ["0x1F1", "0x57F", "0x6DF", "0x600", "0x700", "0x580"])
def test_free_cob_ids_may_be_taken(tmp_path: Path, cob_id: str) -> None:
    assert cells.serious(cells.write(tmp_path, ("transmission = 1", f"cob_id = {cob_id}"))) == []


def test_a_pdo_does_not_travel_on_the_cob_id_of_sync(tmp_path: Path) -> None:
    problem = cells.only(
        cells.write(tmp_path, ("transmission = 1", "cob_id = 0x80")), "error", "cob_id = 0x80"
    )
    assert "that of SYNC" in problem.observed


def test_cob_ids_without_node_id_in_an_eds_are_warned_of_once_for_each_node(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.entry("1800sub1", DefaultValue="0x181"))
    problem = cells.only(path, "warning", "[nodes.2]")
    assert "COB-ID 181h is produced twice: TPDO1 of node 1 and TPDO1 of node 2" in problem.message
    assert "boot gives them separate COB-IDs" in problem.observed
    assert problem.remedy == "another cob_id in [nodes.2.pdo.tpdo1]"


def test_an_emcy_without_node_id_in_an_eds_is_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.entry("1014", DefaultValue="0xA0"))
    problem = cells.only(path, "warning", "[nodes.2]")
    assert "COB-ID 0A0h is produced twice: EMCY of node 1 and EMCY of node 2" in problem.message
    assert problem.remedy == '"1014" = 0x82 in [nodes.2.objects]'
    mended = ("[nodes.2]\n", '[nodes.2]\nobjects."1014" = 0x82\n')
    assert cells.serious(cells.write(tmp_path, mended, eds=cells.entry("1014", DefaultValue="0xA0"))) == []


@pytest.mark.parametrize(
    ("value", "words"),
    [("0x81", "waits for SYNC on the COB-ID 081h"), ("0x40000080", "produces SYNC, and so does the master")],
)
def test_each_node_takes_the_masters_sync(tmp_path: Path, value: str, words: str) -> None:
    path = cells.write(tmp_path, eds=cells.entry("1005", DefaultValue=value))
    assert cells.serious(path) == []
    note = cells.note(path, f"node 1 {words}")
    assert note.remedy == "boot sets 1005h to 80h"
    fixed = cells.write(tmp_path, eds=cells.entry("1005", DefaultValue=value, AccessType="ro"))
    found = cells.serious(fixed)
    assert [each.severity.value for each in found] == ["error", "error"]
    assert words in found[0].message
    assert "sync = false" in found[0].remedy
