"""The SDO client against servers that answer anything: no exception, an end, and no value of bytes that did not come."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia301.sdo import LONGEST, SdoTransferType
from axisbus.cia301.sdo_session import SdoSession, SdoTransferRequest
from axisbus.cia301.sdo_upload import Upload
from kit import fuzz_frames as fuzz

TIMEOUT, TRIES = 0.5, 3
MOST = 500  # bytes that are asked for at most
# Frames after which a session must have ended, whatever they are: each attempt takes the bytes one by one, if it must.
BOUND = 4 * TRIES * (MOST + 2000)

ways = st.sampled_from(list(SdoTransferType))
uploads = st.builds(
    lambda where, transfer_type: SdoTransferRequest(*where, None, TIMEOUT, TRIES, transfer_type, MOST),
    st.sampled_from(fuzz.OBJECTS),
    ways,
)
downloads = st.builds(
    lambda where, size, transfer_type: SdoTransferRequest(*where, bytes(size), TIMEOUT, TRIES, transfer_type),
    st.sampled_from(fuzz.OBJECTS),
    st.sampled_from([0, 1, 4, 5, 7, 8, 100, 300, 900]),
    st.sampled_from([SdoTransferType.NORMAL, SdoTransferType.BLOCK, SdoTransferType.AUTO]),
)
requests = uploads | downloads
delays = st.sampled_from([0.0, 0.001, 0.3, 0.6])
late = st.lists(st.sampled_from([(0x1000, 0), (0x1001, 0), (0x6041, 0)]), unique=True).map(tuple)


def feed(session: SdoSession, frame: bytes, dt: float) -> tuple[bytes, ...]:
    sent = session.receive(frame, dt)
    assert all(len(each) == 8 for each in sent)
    assert len(session.strays) <= 64
    return sent


def follow(frame: bytes, asked: bytes) -> bytes:
    """A frame that names the requested object, if it names one, so that the deep states are reached."""
    return frame[:1] + asked[1:4] + frame[4:] if len(frame) >= 4 and frame[0] >= 0x40 else frame


@given(requests, late, st.lists(st.tuples(fuzz.sdo_answers, delays, st.booleans()), max_size=40))
@settings(max_examples=250)
def test_any_dialogue_is_taken_and_ends_in_silence(request_, late, frames):
    session = SdoSession(request_, late=late)
    sent = session.start()
    for frame, dt, fitting in frames:
        if session.done:
            break
        asked = sent[-1] if sent else bytes(8)
        sent = feed(session, follow(frame, asked) if fitting else frame, dt)
    silences = 0
    while not session.done:
        session.elapse(session.remaining)
        silences += 1
        assert silences < 60, "it goes on asking"
    assert (session.failure is None) or request_.data is not None or session.failure
    assert len(session.data) <= MOST


@given(requests, late, st.lists(st.tuples(fuzz.sdo_answers, delays, st.booleans()), min_size=1, max_size=4))
@settings(max_examples=250)
def test_a_server_that_repeats_its_answer_for_ever_is_given_up(request_, late, frames):
    session, count = SdoSession(request_, late=late), 0
    sent = session.start()
    while not session.done:
        frame, dt, fitting = frames[count % len(frames)]
        asked = sent[-1] if sent else bytes(8)
        sent = feed(session, follow(frame, asked) if fitting else frame, max(dt, 0.0005))
        count += 1
        assert count < BOUND, "there is no end to it"


def endless(
    session: SdoSession, first: list[bytes], frame: bytes, dt: float = 0.0005, toggles: bool = False
) -> int:
    """Have the server say ``first`` and then ``frame`` again and again; return how often until the session gave up."""
    session.start()
    toggle, count = 0, 0
    for each in first:
        session.receive(each, dt)
    while not session.done:
        session.receive(bytes([frame[0] | toggle]) + frame[1:], dt)
        toggle ^= 0x10 if toggles else 0
        count += 1
        assert count < 100_000, "there is no end to it"
    return count


def upload(transfer_type: SdoTransferType = SdoTransferType.NORMAL, most: int = LONGEST) -> SdoSession:
    return SdoSession(SdoTransferRequest(0x1008, 0, None, TIMEOUT, 1, transfer_type, most))


def test_segments_without_a_byte_do_not_continue_for_ever():
    session = upload()
    assert endless(session, [bytes.fromhex("4008100000000000")], b"\x0e" + bytes(7), toggles=True) < 20
    assert "no data" in str(session.failure)


def test_segments_without_an_announced_size_end_at_the_most_that_is_taken():
    session = upload(most=700)
    assert endless(session, [bytes.fromhex("4008100000000000")], bytes(8), toggles=True) == 101
    assert "more than 700 bytes" in str(session.failure)
    assert len(session.data) == 0


def test_a_size_beyond_the_maximum_is_refused_at_once_and_the_server_is_informed():
    session = upload(most=64)
    session.start()
    (abort,) = session.receive(bytes.fromhex("41081000ffffff7f"))
    assert session.done
    assert abort == bytes.fromhex("8008100005000405")
    assert "2147483647 bytes" in str(session.failure)


def test_a_repeated_segment_of_a_block_is_no_progress():
    session = upload(SdoTransferType.BLOCK)
    count = endless(session, [bytes.fromhex("c208100000040000")], b"\x05" + bytes(7), dt=0.01)
    assert count < 60  # 0.5 s: the first segment is a step, its repetition is none
    assert session.failure is not None


@pytest.mark.parametrize(
    "answer",
    [
        "",
        "43 00 10 00",  # says four bytes, and has none
        "43 00 10 00 01 02",
        "42 00 10 00 01",
        "41 00 10 00 05",  # a size cut short
    ],
)
def test_a_frame_shorter_than_it_announces_is_no_answer(answer):
    session = SdoSession(SdoTransferRequest(0x1000, 0, None, TIMEOUT, 1))
    session.start()
    assert session.receive(bytes.fromhex(answer)) == ()
    assert not session.done
    session.receive(bytes.fromhex("43 00 10 00 92 01 02 00"))
    assert (session.done, session.data) == (True, bytes.fromhex("92 01 02 00"))


def test_a_short_frame_that_has_all_its_bytes_is_taken():
    """Seen on real drives: an answer without the bytes that mean nothing."""
    session = SdoSession(SdoTransferRequest(0x1001, 0, None, TIMEOUT, 1))
    session.start()
    session.receive(bytes.fromhex("4f 01 10 00 07"))
    assert session.data == b"\x07"
    writing = SdoSession(SdoTransferRequest(0x1017, 0, b"\x64\0", TIMEOUT, 1))
    writing.start()
    writing.receive(bytes.fromhex("60 17 10 00"))
    assert writing.done
    assert writing.failure is None


def test_a_segment_shorter_than_it_announces_is_not_filled_with_zeros():
    session = upload()
    session.start()
    session.receive(bytes.fromhex("4008100000000000"))
    session.receive(bytes.fromhex("00 41 42"))
    session.receive(bytes.fromhex("0b 41 42"))  # two bytes, the last
    assert (session.done, session.data) == (True, b"AB")


@pytest.mark.parametrize("answer", ["80", "80 00 10 00", "80 00 10 00 00 00 02"])
def test_an_abort_without_its_code_is_ignored(answer):
    session = SdoSession(SdoTransferRequest(0x1000, 0, None, TIMEOUT, 1))
    session.start()
    assert session.receive(bytes.fromhex(answer)) == ()
    assert not session.done


def test_of_a_flood_of_frames_that_fit_nothing_the_newest_are_kept_and_all_are_counted():
    dialogue = Upload(0x1000, 0, TIMEOUT)
    dialogue.start()
    for number in range(1000):
        assert dialogue.receive(bytes([0x60]) + number.to_bytes(2, "little") + bytes(5)) == ()
    assert dialogue.astray == 1000
    assert len(dialogue.strays) == 64
    assert dialogue.strays[-1][1:3] == (999).to_bytes(2, "little")
