"""The plan of a replacement: which drive is the new one, what is refused with which difference, and the steps."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus.configuration.nameplate import Nameplate
from axisbus.configuration.replacement_order import FoundDrive, ReplacementStep
from axisbus.configuration.replacement_plan import (
    NodeToReplace,
    UnfinishedReplacement,
    parse_note,
    plan,
)
from axisbus.errors import ArgumentError, StateError

WAS = Nameplate(1, "ACME", 0x123, 7, 0x10001, 4711, "servo", "A", "1.2", None, None, "x.dcf", "ab" * 32)
NODE = NodeToReplace(1, "cell.toml", 0x123, 7, 0x10001, was=WAS, configuration="x.dcf")
AT = FoundDrive(1, 0x123, 7, 0x10001, 4712, "servo", "A", "2.0")
ELSEWHERE = replace(AT, node_id=9)
BARE = FoundDrive(None, 0x123, 7, 0x10001, 4712)
OTHER_PRODUCT = replace(BARE, product=8)
NOTE = UnfinishedReplacement(1, 4712, sets_node_id=True)

_ALL = list(ReplacementStep)
_AT_DEVICE = [step for step in _ALL if step is not ReplacementStep.BOOT]
_CONFIGURED = _AT_DEVICE[1:]


@pytest.mark.parametrize(
    ("node", "found", "drive", "steps"),
    [
        (NODE, [AT], AT, _CONFIGURED),
        (NODE, [ELSEWHERE], ELSEWHERE, _AT_DEVICE),
        (NODE, [BARE], BARE, _AT_DEVICE),
        (replace(NODE, running=True), [BARE], BARE, _ALL),
        (replace(NODE, configuration=None), [BARE], BARE, [ReplacementStep.NODE_ID, ReplacementStep.RECORD]),
        (replace(NODE, was=None), [AT], AT, _CONFIGURED[:-1]),
        # another drive that does not fit is not the new one
        (NODE, [OTHER_PRODUCT, ELSEWHERE], ELSEWHERE, _AT_DEVICE),
        # a drive at the node's own ID is the new one, whatever else was found
        (NODE, [BARE, AT], AT, _CONFIGURED),
        # interrupted: it stores its node-ID again, because it may not have done that
        (replace(NODE, unfinished=NOTE), [AT], AT, _AT_DEVICE),
        (replace(NODE, unfinished=replace(NOTE, serial=1)), [AT], AT, _CONFIGURED),
        # interrupted after the record was written
        (replace(NODE, was=replace(WAS, serial=4712), unfinished=NOTE), [AT], AT, _AT_DEVICE),
        # serial numbers of 0 do not say that it is the same drive
        (replace(NODE, was=replace(WAS, serial=0)), [replace(AT, serial=0)], replace(AT, serial=0), _CONFIGURED),
        # what a drive does not report is not compared, as at boot-up
        (NODE, [replace(AT, vendor=0, product=None)], replace(AT, vendor=0, product=None), _CONFIGURED),
        # the revision of the EDS, of the old drive, or of the cell file
        (replace(NODE, eds_revision=0x20001), [replace(AT, revision=0x20001)], replace(AT, revision=0x20001), _CONFIGURED),
        (replace(NODE, eds_revision=0x20001), [AT], AT, _CONFIGURED),
        (replace(NODE, revision=0x30001), [replace(AT, revision=0x30001)], replace(AT, revision=0x30001), _CONFIGURED),
        (replace(NODE, eds_revision=0, was=None), [replace(AT, revision=5)], replace(AT, revision=5), _CONFIGURED[:-1]),
        (replace(NODE, serial=4712), [AT], AT, _CONFIGURED),
    ],
)  # fmt: skip
def test_the_new_drive_and_the_steps(
    node: NodeToReplace, found: list[FoundDrive], drive: FoundDrive, steps: list[ReplacementStep]
) -> None:
    made = plan(node, found)
    assert made.drive == drive
    assert list(made.steps) == steps


@pytest.mark.parametrize(
    ("node", "found", "observed", "remedy"),
    [
        (NODE, [], "node 1 does not answer", "bit rate"),
        (NODE, [replace(AT, serial=4711)], "serial number of the record: 0x1267 (4711)", "config restore"),
        (NODE, [OTHER_PRODUCT], "product code (1018h:02) is 0x8 (8), expected is 0x7 (7)", "same type"),
        (NODE, [replace(AT, vendor=5)], "vendor (1018h:01) is 0x5 (5), expected is 0x123 (291)", "same type"),
        (
            replace(NODE, vendor=0, product=None),
            [replace(AT, product=8)],
            "product code (1018h:02) is 0x8 (8), expected is 0x7 (7)",
            "same type",
        ),
        (
            NODE,
            [replace(AT, revision=0x20001)],
            "revision (1018h:03) is 0x20001 (131073), expected is 0x10001 (65537)",
            "write revision = 0x20001 there",
        ),
        (
            replace(NODE, eds_revision=0x10002),
            [replace(AT, revision=None)],
            "revision (1018h:03) is unknown, expected is 0x10001 (65537) or 0x10002 (65538)",
            "revision = 0x0",
        ),
        (replace(NODE, revision=0x30001), [AT], "expected is 0x30001 (196609)", "revision"),
        (
            replace(NODE, serial=4711),
            [AT],
            "serial number (1018h:04) is 0x1268 (4712), expected is 0x1267 (4711)",
            "write serial = 4712 in [nodes.1] of cell.toml",
        ),
        (
            NODE,
            [ELSEWHERE, replace(BARE, serial=4713)],
            "at node-ID 9: serial number (1018h:04) is 0x1268 (4712); without a node-ID: serial number (1018h:04) is 0x1269",
            "only the new drive",
        ),
        (
            NODE,
            [replace(ELSEWHERE, product=8), OTHER_PRODUCT],
            "at node-ID 9: product code (1018h:02) is 0x8 (8), expected is 0x7 (7); without a node-ID",
            "only the new drive",
        ),
    ],
)
def test_what_is_refused_with_the_difference(
    node: NodeToReplace, found: list[FoundDrive], observed: str, remedy: str
) -> None:
    with pytest.raises(StateError, match="nothing was written") as caught:
        plan(node, found)
    assert observed in caught.value.observed
    assert remedy in caught.value.remedy


def test_the_plan_shows_what_was_there_and_what_is_there():
    assert plan(NODE, [AT]).rows() == [
        ("device name (1008h)", "servo", "servo"),
        ("vendor (1018h:01)", "0x123 (291)", "0x123 (291)"),
        ("product code (1018h:02)", "0x7 (7)", "0x7 (7)"),
        ("revision (1018h:03)", "0x10001 (65537)", "0x10001 (65537)"),
        ("serial number (1018h:04)", "0x1267 (4711)", "0x1268 (4712)"),
        ("hardware version (1009h)", "A", "A"),
        ("software version (100Ah)", "1.2", "2.0"),
    ]


@pytest.mark.parametrize(
    ("was", "serial", "swapped"),
    [(WAS, 4712, True), (None, 4712, False), (replace(WAS, serial=0), 4712, False)],
)
def test_a_drive_is_known_to_be_another_one_only_by_two_serial_numbers(was, serial, swapped):
    assert plan(replace(NODE, was=was), [replace(AT, serial=serial)]).order.swapped is swapped


@pytest.mark.parametrize("was", [None, replace(WAS, serial=4712)])
def test_a_drive_whose_replacement_has_begun_is_known_to_be_another_one(was):
    node = replace(NODE, was=was, unfinished=NOTE, running=True)
    assert plan(node, [AT]).order.swapped
    assert not plan(replace(node, unfinished=replace(NOTE, serial=1), was=None), [AT]).order.swapped


def test_a_note_is_read_again():
    made = plan(NODE, [BARE])
    assert made.note == NOTE
    assert parse_note(made.note.as_json(), "file") == NOTE
    assert not plan(NODE, [AT]).note.sets_node_id


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "not the note of a replacement"),
        ('{"kind": "axisbus nameplates", "format": 1}', "not the note of a replacement"),
        ('{"kind": "axisbus replacement", "format": 2}', "its format 2 is not supported"),
    ],
)
def test_another_file_is_no_note(text: str, why: str):
    with pytest.raises(ArgumentError, match=f"file: {why}") as caught:
        parse_note(text, "file")
    assert "delete it" in caught.value.remedy
