"""The requests of a page: invalid messages, rights, and the texts of refusals."""

from __future__ import annotations

import itertools
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.web.access.lease import PageIdentity, PageLease, Refusal
from axisbus.web.access.tokens import Role
from axisbus.web.commands.authorize import PageAction, decide
from axisbus.web.commands.request import PageRequest, read
from axisbus.web.commands.verbs import VERBS, PageVerb
from axisbus.web.objects.transfer_queue import ObjectKey

AXES = ("x", "y")
ME, OTHER = PageIdentity(1, "page 1", Role.OPERATOR), PageIdentity(2, "page 2", Role.OPERATOR)
LOOKER = PageIdentity(3, "page 3", Role.OBSERVER)
# Typed by hand: the rights of every page, and of the page with the controls only; requests with a question.
EVERYBODY = {"beat", "take", "take_over", "give_back", "link"}
EVERYBODY |= {"quick_stop_all", "halt_all", "quick_stop", "halt", "jog_end", "read_objects", "keep_reading"}
EVERYBODY |= {"backup", "compare", "would_restore", "job_end"}
EVERYBODY |= {"trial_beat", "trial_end"}  # of a trial of their own, and they have none without the controls
CONTROLS = {
    "enable",
    "disable",
    "reset",
    "release",
    "home",
    "move_absolute",
    "move_relative",
    "move_velocity",
    "torque_control",
    "jog",
    "boot",
    "take_command",
    "write_object",
    "verify",
    "verify_end",
    "restore",
    "step_position",
    "step_velocity",
}
ASKS = {"enable", "home", "torque_control", "take_command", "restore"}
WHOLE = {
    "position": "1",
    "distance": "2",
    "velocity": "3",
    "torque": "4",
    "direction": "1",
    "acceleration": "5",
    "seconds": "6",
}


def test_every_verb_is_of_one_kind():
    assert {verb.value for verb in VERBS} == EVERYBODY | CONTROLS
    assert set(VERBS) == set(PageVerb)


@pytest.mark.parametrize("verb", PageVerb, ids=lambda verb: verb.value)
def test_the_rights_of_each_request(verb):
    leases = (PageLease(), PageLease(ME), PageLease(OTHER))
    for seat, lease, sure in itertools.product((ME, LOOKER), leases, (False, True)):
        verdict = decide(seat, lease, PageRequest(verb, "x", WHOLE, sure), AXES)
        may = verb.value in EVERYBODY or (
            seat is ME and lease.holder is ME and (sure or verb.value not in ASKS)
        )
        assert isinstance(verdict, PageAction if may else Refusal), (seat, lease, sure)


def test_a_refusal_names_the_holder_of_the_controls_and_the_remedy():
    ask = PageRequest(PageVerb.DISABLE, "x")
    assert "page 2 has the controls" in decide(ME, PageLease(OTHER), ask, AXES).text
    assert "take them first" in decide(ME, PageLease(), ask, AXES).remedy
    assert "may only halt, stop, and read objects" in decide(LOOKER, PageLease(), ask, AXES).text


@pytest.mark.parametrize("verb", ["halt", "quick_stop", "enable"])
def test_an_axis_that_is_not_there_is_reported(verb):
    refused = decide(ME, PageLease(ME), PageRequest(PageVerb(verb), "q", sure=True), AXES)
    assert refused == Refusal("there is no axis 'q'", "there are x, y")


@pytest.mark.parametrize("verb", ["quick_stop_all", "halt_all"])
def test_a_stop_of_everything_is_for_all_axes(verb):
    assert decide(LOOKER, PageLease(OTHER), PageRequest(PageVerb(verb)), AXES) == PageAction(
        PageVerb(verb), AXES
    )


@pytest.mark.parametrize(
    ("typed", "number"), [("12.5", 12.5), (" -3 ", -3.0), ("1,5", 1.5), ("1e2", 100.0), ("+4", 4.0)]
)
def test_a_number_is_taken_as_people_type_it(typed, number):
    verdict = decide(ME, PageLease(ME), PageRequest(PageVerb.MOVE_ABSOLUTE, "x", {"position": typed}), AXES)
    assert verdict == PageAction(PageVerb.MOVE_ABSOLUTE, ("x",), {"position": number})


@pytest.mark.parametrize("typed", ["", "  ", "ten", "1.000,5", "1 2", "0x10", "--1", "1_0", "٣", "１"])
def test_a_value_that_is_not_a_number_is_refused_and_never_zero(typed):
    verdict = decide(ME, PageLease(ME), PageRequest(PageVerb.MOVE_RELATIVE, "x", {"distance": typed}), AXES)
    assert isinstance(verdict, Refusal)
    assert "distance" in verdict.text


def test_empty_optional_values_are_left_out_and_unknown_ones_ignored():
    values = {"position": "1", "velocity": " ", "acceleration": "7", "jerk": "9"}
    verdict = decide(ME, PageLease(ME), PageRequest(PageVerb.MOVE_ABSOLUTE, "x", values), AXES)
    assert verdict.values == {"position": 1.0, "acceleration": 7.0}


# -- messages -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "",
        "null",
        "[]",
        '{"do": "explode"}',
        '{"do": ["halt"]}',
        '{"do": "jog", "axis": 1}',
        '{"do": "jog", "values": []}',
        '{"do": "jog", "values": {"velocity": 1}}',
        '{"do": "jog", "values": {"velocity": "' + "1" * 201 + '"}}',
        '{"do": "jog", "press": true}',
        '{"do": "jog", "press": 1.5}',
        '{"do": "jog", "sent": "1"}',
        '{"do": "jog", "sent": NaN}',
        '{"do": "jog", "sent": Infinity}',
        '{"do": "jog", "axis": "' + "x" * 65 + '"}',
        "[" * 4000,
        '{"do": "read_objects"}',
        '{"do": "read_objects", "objects": []}',
        '{"do": "read_objects", "objects": "1:6064:00"}',
        '{"do": "read_objects", "objects": [7]}',
        '{"do": "read_objects", "objects": ["1:6064"]}',
        '{"do": "read_objects", "objects": ["1:60g4:00"]}',
        '{"do": "read_objects", "objects": ["1:6064:00\\n"]}',
        '{"do": "read_objects", "objects": ["١:6064:00"]}',
        json.dumps({"do": "read_objects", "objects": ["1:6064:00"] * 33}),
        json.dumps({"do": "keep_reading", "objects": ["1:6064:00"] * 9}),
        '{"do": "write_object", "text": "1"}',
        '{"do": "write_object", "text": "1", "objects": ["1:6081:00", "1:6083:00"]}',
        '{"do": "write_object", "text": 1, "objects": ["1:6081:00"]}',
        json.dumps({"do": "write_object", "text": "1" * 1025, "objects": ["1:6081:00"]}),
        '{"do": "verify", "node": "1"}',
        '{"do": "verify", "node": -1}',
        '{"do": "verify", "node": 128}',
        '{"do": "verify", "node": true}',
        '{"do": "beat", "more": "' + "x" * 5000 + '"}',
    ],
)
def test_an_invalid_message_is_refused(text):
    assert isinstance(read(text), Refusal)


@given(
    st.text(max_size=200) | st.dictionaries(st.text(max_size=5), st.integers() | st.text()).map(json.dumps)
)
def test_no_text_raises(text):
    assert isinstance(read(text), PageRequest | Refusal)


@pytest.mark.parametrize("more", [{}, {"sent": None}, {"values": 7}, {"press": "x", "sure": 1}])
def test_extra_keys_do_not_invalidate_a_stop(more):
    assert read(json.dumps({"do": "quick_stop", "axis": "x", **more})) == PageRequest(
        PageVerb.QUICK_STOP, "x"
    )


def test_only_yes_is_yes():
    for sure in (1, "true", [1], None):
        assert read(json.dumps({"do": "enable", "axis": "x", "sure": sure})) == PageRequest(
            PageVerb.ENABLE, "x"
        )
    assert read('{"do": "enable", "axis": "x", "sure": true}').sure


def test_objects_are_named_by_node_index_and_sub_index():
    asked = read('{"do": "read_objects", "objects": ["1:6064:00", "127:1018:0A"]}')
    assert asked == PageRequest(
        PageVerb.READ_OBJECTS, objects=(ObjectKey(1, 0x6064, 0), ObjectKey(127, 0x1018, 10))
    )
    assert [str(each) for each in asked.objects] == ["1:6064:00", "127:1018:0A"]
    assert read('{"do": "keep_reading", "objects": []}') == PageRequest(PageVerb.KEEP_READING)
    wish = read(
        '{"do": "write_object", "objects": ["1:6081:00"], "text": " 90 deg/s", "values": {"agreed": "order"}}'
    )
    assert (wish.text, wish.values) == (" 90 deg/s", {"agreed": "order"})
