"""The queue of transfers: one after the other for all pages, fairly, and the results that each page gets."""

from __future__ import annotations

import itertools
from collections import Counter

from axisbus.web.objects.transfer_queue import (
    PERIOD,
    QUIET,
    WAITING,
    ObjectJob,
    ObjectKey,
    TransferQueue,
    TransferRequest,
    TransferResult,
    WriteConfirmation,
)

X = [ObjectKey(1, 0x6000 + number, 0) for number in range(100)]
Y = ObjectKey(2, 0x6064, 0)
STEP = 0.04  # seconds


def run(turns, now, seconds, silent=()):
    """Let transfers be done for a time, one in each step; return which they were, with their times."""
    done = []
    for number in range(round(seconds / STEP)):
        at = now + number * STEP
        if (job := turns.next(at)) is not None:
            done.append((at, job))
            turns.store_result(TransferResult(job, at, "7", silent=job.key.node in silent), at)
    return done


def test_repeated_objects_are_read_twice_a_second_once_for_all_pages():
    turns = TransferQueue()
    for page in range(1, 51):
        turns.set_cyclic(page, X[:8])
    done = run(turns, 100.0, 10.0)
    counts = Counter(job.key for _, job in done)
    assert set(counts) == set(X[:8])
    assert all(18 <= count <= 20 for count in counts.values())
    for key in X[:8]:
        times = [at for at, job in done if job.key == key]
        assert min(after - before for before, after in itertools.pairwise(times)) >= PERIOD - 1e-9
    assert {len(turns.unread(page)) for page in range(1, 51)} == {8}
    assert turns.unread(1) == []


def test_if_more_objects_are_repeated_than_time_allows_each_has_its_turn():
    turns = TransferQueue()
    for page in range(10):
        turns.set_cyclic(page + 1, X[8 * page : 8 * page + 8])
    counts = Counter(job.key for _, job in run(turns, 0.0, 32.0))
    assert set(counts) == set(X[:80])
    assert max(counts.values()) - min(counts.values()) <= 1


def test_a_page_with_many_requests_does_not_delay_the_others():
    turns = TransferQueue()
    assert turns.request(1, [ObjectJob(key, 1) for key in X[:60]])
    assert turns.request(2, [ObjectJob(Y, 2)])
    turns.set_cyclic(3, [X[99]])
    first = [job.page for _, job in run(turns, 0.0, 4 * STEP)]
    assert set(first[:3]) == {0, 1, 2}


def test_a_page_may_wait_for_so_much_and_no_more():
    turns = TransferQueue()
    assert turns.request(1, [ObjectJob(X[0], 1)] * WAITING)
    assert not turns.request(1, [ObjectJob(X[0], 1)])
    assert turns.request(2, [ObjectJob(X[0], 2)])


def test_reads_of_a_silent_node_are_dropped_and_repeated_objects_wait():
    turns = TransferQueue()
    turns.set_cyclic(1, [X[0], Y])
    assert turns.request(2, [ObjectJob(key, 2) for key in X[:30]])
    done = run(turns, 0.0, QUIET - 1.0, silent={1})
    assert Counter(job.key.node for _, job in done)[1] <= 2
    assert Counter(job.key.node for _, job in done)[2] >= 7
    assert {seen.job.key for seen in turns.unread(2)} == set(X[:30])
    assert any(job.key == X[0] for _, job in run(turns, QUIET, 1.0))


def test_a_write_is_not_given_up_with_the_reads_of_a_silent_node():
    turns, wish = TransferQueue(), ObjectJob(X[5], 1, TransferRequest("1"))
    assert turns.request(1, [ObjectJob(X[0], 1), ObjectJob(X[1], 1), wish])
    done = run(turns, 0.0, 1.0, silent={1})
    assert [job for _, job in done] == [ObjectJob(X[0], 1), wish]


def test_without_the_controls_waiting_writes_are_dropped_and_reported():
    turns, wish = TransferQueue(), ObjectJob(X[5], 1, TransferRequest("1"))
    assert turns.request(1, [wish, ObjectJob(X[1], 1)])
    turns.drop_writes(1, 7.0)
    turns.drop_writes(9, 7.0)
    (told,) = turns.unread(1)
    assert told.job == wish
    assert "no longer has the controls" in told.error["message"]
    assert [job for _, job in run(turns, 7.0, 1.0)] == [ObjectJob(X[1], 1)]


def test_nothing_is_read_for_a_page_that_left():
    turns = TransferQueue()
    turns.set_cyclic(1, X[:3])
    assert turns.request(1, [ObjectJob(X[7], 1)])
    turns.remove_page(1)
    turns.remove_page(1)
    assert run(turns, 0.0, 2.0) == []
    turns.store_result(TransferResult(ObjectJob(X[7], 1), 0.0, "7"), 0.0)
    assert turns.unread(1) == []


def test_a_page_gets_the_reads_and_writes_of_others_for_its_objects_but_not_their_questions():
    turns = TransferQueue()
    turns.set_cyclic(1, [Y])
    turns.store_result(
        TransferResult(
            ObjectJob(Y, 2, TransferRequest("1")),
            5.0,
            question=WriteConfirmation("sure?", frozenset({"order"})),
        ),
        5.0,
    )
    assert turns.unread(1) == []
    turns.store_result(
        TransferResult(ObjectJob(Y, 2, TransferRequest("1")), 5.0, "1", note="0 -> 1, read back"), 5.0
    )
    assert [seen.value for seen in turns.unread(1)] == ["1"]


def test_the_result_of_a_write_is_not_hidden_by_a_read_after_it():
    turns, wish = TransferQueue(), ObjectJob(Y, 1, TransferRequest("1"))
    turns.set_cyclic(1, [Y])
    turns.store_result(TransferResult(wish, 5.0, "1", note="0 -> 1, read back"), 5.0)
    turns.store_result(TransferResult(ObjectJob(Y), 5.1, "1"), 5.1)
    assert [seen.note for seen in turns.unread(1)] == ["0 -> 1, read back", ""]


def test_a_page_that_reads_nothing_fills_no_memory():
    turns = TransferQueue()
    turns.set_cyclic(1, X[:8])
    run(turns, 0.0, 100.0)
    assert len(turns.unread(1)) == 8
