"""One writer: the controls are taken, given back, taken over only by an act of its own, and free when their page is gone."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.web.access.lease import PageIdentity, PageLease, Refusal
from axisbus.web.access.tokens import Role

ONE, TWO = PageIdentity(1, "page 1 at here", Role.OPERATOR), PageIdentity(2, "page 2 at there", Role.OPERATOR)
LOOKER = PageIdentity(3, "page 3", Role.OBSERVER)


def test_a_second_page_is_refused_with_the_name_of_the_first():
    lease = PageLease().granted_to(ONE, over=False)
    refusal = lease.granted_to(TWO, over=False)
    assert isinstance(refusal, Refusal)
    assert "page 1 at here has the controls" in refusal.text


def test_the_holder_may_take_them_again():
    assert PageLease(ONE).granted_to(ONE, over=False) == PageLease(ONE)


def test_the_controls_can_be_taken_over():
    lease = PageLease().granted_to(ONE, over=False).granted_to(TWO, over=True)
    assert lease.held_by(TWO)
    assert not lease.held_by(ONE)


@pytest.mark.parametrize("lease", [PageLease(), PageLease(ONE)])
@pytest.mark.parametrize("over", [False, True])
def test_an_observer_never_has_them(lease, over):
    assert isinstance(lease.granted_to(LOOKER, over=over), Refusal)


def test_the_controls_are_free_when_their_page_leaves_and_only_then():
    assert PageLease(ONE).after_release_by(TWO) == PageLease(ONE)
    assert PageLease(ONE).after_release_by(ONE) == PageLease()


@given(st.lists(st.tuples(st.sampled_from("tog"), st.sampled_from([ONE, TWO, LOOKER])), max_size=30))
def test_at_most_one_page_has_the_controls_and_it_may_command(acts):
    lease, model = PageLease(), None
    for act, seat in acts:
        if act == "g":
            lease, model = lease.after_release_by(seat), None if model is seat else model
        elif not isinstance(after := lease.granted_to(seat, over=act == "o"), Refusal):
            assert model in (None, seat) or act == "o"
            lease, model = after, seat
        assert lease.holder is model
        assert model is None or model.role is Role.OPERATOR
