"""Block transfers: client and server frame by frame after CiA 301 7.2.4.3.8 to 15, typed by hand, then against each other."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia301.sdo import Garbled, NoAnswer, SdoAborted, SdoTransferType, checksum
from axisbus.cia301.sdo_download import Download
from axisbus.cia301.sdo_session import SdoSession, SdoTransferRequest
from axisbus.cia301.sdo_upload import Upload
from axisbus.sim.node.sdo import crc16
from kit.sim.sdo_wire import FILE, TIMEOUT, SdoWire

NINE = b"123456789"  # its CRC is the check value of every catalogue: 31C3h
BIG = random.Random(301).randbytes(65536)
SIZES = (1, 889, 890)
ZEROS = "00" * 8


def raw(text: str) -> bytes:
    return bytes.fromhex(text)


def hexed(frames: tuple[bytes, ...]) -> list[str]:
    return [frame.hex() for frame in frames]


# -- the checksum


@pytest.mark.parametrize("crc", [checksum, crc16])
def test_the_checksum_has_the_check_value_of_the_catalogues(crc):
    assert crc(NINE) == 0x31C3
    assert crc(b"") == 0
    assert crc(b"A") == 0x58E5


def test_both_checksums_agree():
    assert checksum(BIG) == crc16(BIG)


# -- the client, frame by frame


def test_the_client_reads_nine_bytes_in_a_block():
    upload = Upload(*FILE, TIMEOUT, SdoTransferType.BLOCK)
    assert hexed(upload.start()) == ["a40021007f000000"]  # CRC supported, 127 segments, no switching
    assert hexed(upload.receive(raw("c600210009000000"))) == ["a3" + "00" * 7]
    assert upload.receive(raw("01") + NINE[:7]) == ()
    assert upload.progress == (7, 9)
    assert hexed(upload.receive(raw("82") + NINE[7:] + bytes(5))) == ["a2027f0000000000"]
    assert hexed(upload.receive(raw("d5c3310000000000"))) == ["a1" + "00" * 7]  # n = 5, CRC 31C3h
    assert upload.done
    assert upload.data == NINE


def test_the_client_writes_nine_bytes_in_a_block():
    download = Download(*FILE, NINE, TIMEOUT, SdoTransferType.BLOCK)
    assert hexed(download.start()) == ["c600210009000000"]
    assert hexed(download.receive(raw("a40021007f000000"))) == [
        "01" + NINE[:7].hex(),
        "82" + NINE[7:].hex() + "00" * 5,
    ]
    assert hexed(download.receive(raw("a2027f0000000000"))) == ["d5c3310000000000"]
    assert not download.done
    assert download.receive(raw("a100000000000000")) == ()
    assert download.done


def test_a_server_without_checksum_gets_no_checksum():
    download = Download(*FILE, NINE, TIMEOUT, SdoTransferType.BLOCK)
    download.start()
    download.receive(raw("a00021007f000000"))
    assert hexed(download.receive(raw("a2027f0000000000"))) == ["d500000000000000"]


def test_the_client_takes_the_block_size_that_the_server_grants_each_time():
    download = Download(*FILE, bytes(range(35)), TIMEOUT, SdoTransferType.BLOCK)
    download.start()
    numbers = [frame[0] for frame in download.receive(raw("a400210002000000"))]
    assert numbers == [1, 2]
    numbers = [frame[0] for frame in download.receive(raw("a202010000000000"))]
    assert numbers == [1]
    numbers = [frame[0] for frame in download.receive(raw("a2017f0000000000"))]
    assert numbers == [1, 0x82]
    assert download.progress == (21, 35)


def test_an_unconfirmed_segment_is_sent_again_with_all_after_it():
    download = Download(*FILE, bytes(range(28)), TIMEOUT, SdoTransferType.BLOCK)
    download.start()
    assert len(download.receive(raw("a40021007f000000"))) == 4
    assert hexed(download.receive(raw("a2017f0000000000"))) == [
        "01" + bytes(range(7, 14)).hex(),
        "02" + bytes(range(14, 21)).hex(),
        "83" + bytes(range(21, 28)).hex(),
    ]


def test_the_client_confirms_only_segments_received_in_order():
    upload = Upload(*FILE, TIMEOUT, SdoTransferType.BLOCK, block_size=4)
    assert hexed(upload.start()) == ["a400210004000000"]
    upload.receive(raw("c600210020000000"))
    assert upload.receive(raw("01" + "11" * 7)) == ()
    assert upload.receive(raw("03" + "33" * 7)) == ()
    assert hexed(upload.receive(raw("04" + "44" * 7))) == ["a201040000000000"]
    assert upload.data == b"\x11" * 7


def test_a_wrong_checksum_is_an_error_and_is_sent_to_the_server():
    upload = Upload(*FILE, TIMEOUT, SdoTransferType.BLOCK)
    upload.start()
    upload.receive(raw("c600210009000000"))
    upload.receive(raw("01") + NINE[:7])
    upload.receive(raw("82") + b"88" + bytes(5))
    with pytest.raises(Garbled, match="checksum") as caught:
        upload.receive(raw("d5c3310000000000"))
    assert caught.value.code == 0x0504_0004
    assert upload.abort(caught.value.code).hex() == "8000210004000405"


def test_a_server_that_counts_the_unused_bytes_of_a_full_segment_as_seven_is_understood():
    """Seen in the wild: n = 7 where nothing is unused. Size and checksum agree, so they win."""
    upload = Upload(*FILE, TIMEOUT, SdoTransferType.BLOCK)
    upload.start()
    upload.receive(raw("c600210007000000"))
    upload.receive(raw("81") + NINE[:7])
    crc = crc16(NINE[:7]).to_bytes(2, "little").hex()
    upload.receive(raw("dd" + crc + "00" * 5))
    assert upload.data == NINE[:7]


def test_without_a_checksum_the_size_must_be_right():
    upload = Upload(*FILE, TIMEOUT, SdoTransferType.BLOCK)
    upload.start()
    upload.receive(raw("c200210007000000"))
    upload.receive(raw("81") + NINE[:7])
    with pytest.raises(Garbled, match="0 bytes came, 7 were announced"):
        upload.receive(raw("dd" + "00" * 7))


@pytest.mark.parametrize("granted", [0, 128, 255])
def test_an_invalid_block_size_is_refused(granted):
    download = Download(*FILE, NINE, TIMEOUT, SdoTransferType.BLOCK)
    download.start()
    with pytest.raises(Garbled, match=f"blocks of {granted} segments") as caught:
        download.receive(raw("a4002100") + bytes([granted, 0, 0, 0]))
    assert caught.value.code == 0x0504_0002


def test_a_confirmation_of_a_segment_that_was_never_sent_is_refused():
    download = Download(*FILE, NINE, TIMEOUT, SdoTransferType.BLOCK)
    download.start()
    download.receive(raw("a40021007f000000"))
    with pytest.raises(Garbled, match="segment 3 was confirmed, 2 were sent") as caught:
        download.receive(raw("a2037f0000000000"))
    assert caught.value.code == 0x0504_0003


def test_a_server_that_takes_no_segment_at_all_is_given_up():
    download = Download(*FILE, NINE, TIMEOUT, SdoTransferType.BLOCK)
    download.start()
    download.receive(raw("a40021007f000000"))
    for _ in range(7):
        download.receive(raw("a2007f0000000000"))
    with pytest.raises(Garbled, match="without any received segment"):
        download.receive(raw("a2007f0000000000"))


def test_more_bytes_than_announced_are_an_error():
    upload = Upload(*FILE, TIMEOUT, SdoTransferType.BLOCK)
    upload.start()
    upload.receive(raw("c600210008000000"))
    upload.receive(raw("01" + "11" * 7))
    upload.receive(raw("02" + "22" * 7))
    with pytest.raises(Garbled, match="more than the 8 bytes"):
        upload.receive(raw("03" + "33" * 7))


# -- selection of the transfer type ----


def test_many_announced_bytes_are_read_in_blocks():
    upload = Upload(*FILE, TIMEOUT, SdoTransferType.AUTO)
    assert hexed(upload.start()) == ["4000210000000000"]
    assert hexed(upload.receive(raw("4100210000010000"))) == ["8000210000000008", "a40021007f000000"]


def test_few_announced_bytes_are_fetched_in_segments():
    upload = Upload(*FILE, TIMEOUT, SdoTransferType.AUTO)
    upload.start()
    assert hexed(upload.receive(raw("41002100ff000000"))) == ["6000000000000000"]


def test_a_server_may_answer_a_block_upload_normally():
    upload = Upload(*FILE, TIMEOUT, SdoTransferType.BLOCK)
    upload.start()
    assert upload.receive(raw("4b00210034120000")) == ()
    assert upload.done
    assert upload.data == b"\x34\x12"


@pytest.mark.parametrize("answer", ["8000210001000405", None])
def test_a_refused_or_ignored_block_is_followed_by_a_normal_transfer(answer):
    for dialogue, first in (
        (Upload(*FILE, TIMEOUT, SdoTransferType.BLOCK), "4000210000000000"),
        (Download(*FILE, NINE, TIMEOUT, SdoTransferType.BLOCK), "2100210009000000"),
    ):
        dialogue.start()
        frames = dialogue.receive(raw(answer)) if answer else dialogue.elapse(TIMEOUT)
        assert hexed(frames)[-1] == first
        assert dialogue.block_refused == (0x0504_0001 if answer else 0x0504_0000)


def test_block_transfer_is_tried_only_once_with_a_node_that_does_not_support_it():
    wire = SdoWire(BIG[:1000])
    wire.dials.sdo_block = False
    first = wire.upload(SdoTransferType.AUTO)
    assert first.data == BIG[:1000]
    assert first.no_block
    second = SdoSession(SdoTransferRequest(*FILE, BIG, TIMEOUT, 3), no_block=first.no_block)
    assert hexed(second.start()) == ["2100210000000100"]


def test_a_refusal_in_the_middle_of_a_block_is_the_servers_word():
    wire = SdoWire()
    wire.dials.sdo_aborts[FILE] = 0x0800_0022  # "because of the present device state"
    session = wire.download(BIG[:1000])
    assert isinstance(session.failure, SdoAborted)
    assert session.failure.code == 0x0800_0022
    assert [frame[:2] for frame in wire.said(">")] == ["c6", "21"]  # asked twice, and not a third time


def test_the_last_attempt_uses_a_normal_transfer():
    """A server whose blocks never come to an end, but whose segments do."""
    wire = SdoWire()
    wire.fate = lambda _, frame: None if frame[0] == 0xA2 else 0.0
    session = wire.download(BIG[:300], SdoTransferType.AUTO)
    assert session.failure is None
    assert wire.content == BIG[:300]
    asked = [frame[:2] for frame in wire.said(">") if frame[2:8] == "002100"]
    assert [command for command in asked if command in ("c6", "21")] == ["c6", "c6", "21"]


# -- the server, frame by frame


def test_the_server_sends_nine_bytes_in_a_block():
    server = SdoWire(NINE).server
    assert server.request(raw("a40021007f000000")) == [raw("c600210009000000")]
    assert server.request(raw("a3" + "00" * 7)) == [
        raw("01") + NINE[:7],
        raw("82") + NINE[7:] + bytes(5),
    ]
    assert server.request(raw("a2017f0000000000")) == [raw("81") + NINE[7:] + bytes(5)]  # 2 was lost
    assert server.request(raw("a2017f0000000000")) == [raw("d5c3310000000000")]
    assert server.request(raw("a100000000000000")) == []


def test_the_server_takes_nine_bytes_in_a_block():
    wire = SdoWire()
    request = wire.server.request
    assert request(raw("c600210009000000")) == [raw("a40021007f000000")]
    assert request(raw("82") + NINE[7:] + bytes(5)) == [raw("a2007f0000000000")]  # 1 was lost
    assert request(raw("01") + NINE[:7]) == []
    assert request(raw("82") + NINE[7:] + bytes(5)) == [raw("a2027f0000000000")]
    assert request(raw("d5c3310000000000")) == [raw("a100000000000000")]
    assert wire.content == NINE


@pytest.mark.parametrize(
    ("end", "abort"),
    [
        ("d5c4310000000000", "8000210004000405"),  # checksum
        ("d100000000000000", "8000210004000405"),
        ("e000000000000000", "8000210001000405"),  # not an end
    ],
)
def test_the_server_refuses_a_block_that_does_not_hold(end, abort):
    wire = SdoWire(b"old")
    for frame in ("c600210009000000", "01" + NINE[:7].hex(), "82" + NINE[7:].hex() + "00" * 5):
        wire.server.request(raw(frame))
    assert wire.server.request(raw(end)) == [raw(abort)]
    assert wire.content == b"old"


# -- both against each other


@pytest.mark.parametrize("size", [0, 1, 4, 5, 7, 8, 14, 888, 889, 890, 65536])
@pytest.mark.parametrize("transfer_type", list(SdoTransferType))
def test_any_size_arrives_whole_in_both_directions(size, transfer_type):
    wire = SdoWire(BIG[:size])
    session = wire.upload(transfer_type)
    assert (session.failure, session.data) == (None, BIG[:size])
    wire = SdoWire()
    session = wire.download(
        BIG[:size], SdoTransferType.BLOCK if transfer_type is SdoTransferType.AUTO else transfer_type
    )
    assert session.failure is None
    assert wire.content == BIG[:size]


def frames_of(size: int, writing: bool) -> int:
    wire = SdoWire(BIG[:size])
    _transfer(wire, size, writing)
    return len(wire.frames)


def _transfer(wire: SdoWire, size: int, writing: bool) -> None:
    if not writing:
        wire.content = BIG[:size]
        session = wire.upload()
        assert session.failure is None
        assert session.data == BIG[:size]
        return
    wire.content = b"old"
    session = wire.download(BIG[:size])
    assert session.failure is None
    wire.settle()
    assert wire.content == BIG[:size]


@pytest.mark.parametrize("writing", [False, True])
@pytest.mark.parametrize("size", SIZES)
def test_each_frame_lost_once(size, writing):
    for lost in range(1, frames_of(size, writing) + 1):
        wire = SdoWire()
        wire.fate = lambda number, _, lost=lost: None if number == lost else 0.0
        _transfer(wire, size, writing)


@pytest.mark.parametrize("writing", [False, True])
def test_a_segment_lost_within_a_block_costs_no_second_transfer(writing):
    """Every sub-block loses its sixtieth segment."""
    wire = SdoWire()
    wire.fate = lambda _, frame: None if frame[0] == 60 else 0.0
    _transfer(wire, 65536, writing)
    assert sum(frame[2:8] == "002100" for frame in wire.said(">")) == 1
    assert wire.now == 0.0


def test_the_end_of_a_sub_block_lost_while_reading_costs_one_timeout_and_no_second_transfer():
    wire = SdoWire()
    wire.fate = lambda number, frame: None if number == 130 and frame[0] == 127 else 0.0
    _transfer(wire, 2000, writing=False)
    assert sum(frame[2:8] == "002100" for frame in wire.said(">")) == 1
    assert wire.now == TIMEOUT


def test_a_node_that_dies_in_a_block_is_a_time_out():
    wire = SdoWire(BIG)
    wire.fate = lambda number, _: 0.0 if number < 500 else None
    session = wire.upload()
    assert isinstance(session.failure, NoAnswer)
    assert session.data == b""
    assert wire.now <= 3 * 2 * TIMEOUT


FATES = st.dictionaries(st.integers(1, 400), st.one_of(st.none(), st.floats(0.0, 3 * TIMEOUT)), max_size=12)


@settings(max_examples=300, deadline=None)
@given(
    fates=FATES,
    size=st.integers(0, 2000),
    transfer_type=st.sampled_from(list(SdoTransferType)),
    block_size=st.integers(1, 127),
    seed=st.integers(0, 3),
)
def test_after_lost_and_late_frames_the_data_is_right_or_there_is_an_error(
    fates, size, transfer_type, block_size, seed
):
    """Four transfers one after another on a wire that loses and delays; the late frames of one meet the next."""
    wire = SdoWire()
    wire.dials.sdo_block_size = block_size
    wire.fate = lambda number, _: fates.get(number, 0.0)
    noise = random.Random(seed)
    for _ in range(2):
        data = noise.randbytes(size) if seed else bytes(size)
        before = wire.content
        written = wire.download(
            data, transfer_type if transfer_type is not SdoTransferType.AUTO else SdoTransferType.BLOCK
        )
        wire.settle()
        assert wire.content in (before, data)
        assert written.failure is not None or wire.content == data
        content = wire.content
        read = wire.upload(transfer_type)
        assert read.failure is not None or read.data == content


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 1_000_000), rate=st.sampled_from([0.001, 0.01, 0.05, 0.2]))
def test_random_loss_never_gives_wrong_data(seed, rate):
    chance = random.Random(seed)
    wire = SdoWire(BIG[:5000])
    wire.fate = lambda _number, _frame: None if chance.random() < rate else 0.0
    read = wire.upload()
    assert read.failure is not None or read.data == BIG[:5000]
    written = wire.download(BIG[5000:9000])
    wire.settle()
    assert written.failure is not None or wire.content == BIG[5000:9000]
    assert wire.content in (BIG[:5000], BIG[5000:9000])


# -- requests that were abandoned and are answered late ----


def test_the_late_answer_to_an_abandoned_barrier_does_not_pass_the_next_one():
    """A cancelled request may still be at its barrier. Its answer comes when the next request is at a barrier of its own."""
    write = SdoTransferRequest(0x6040, 0, b"\x02\x00", TIMEOUT, 1)
    first = SdoSession(write)
    first.start()
    first.elapse(TIMEOUT)
    second = SdoSession(SdoTransferRequest(0x1001, 0, None, TIMEOUT, 1), late=first.late)
    assert hexed(second.start()) == ["4000100000000000"]
    second.give_up()
    third = SdoSession(write, late=second.late)
    assert hexed(third.start()) == ["4001100000000000"]
    assert third.receive(raw("6040600000000000")) == ()
    assert third.receive(raw("4300100092010400")) == ()
    assert hexed(third.receive(raw("4f01100000000000"))) == ["2b40600002000000"]
    assert third.late == ()


def test_a_server_without_1018h_is_asked_again_for_the_barrier_abandoned_longest_ago():
    late: tuple[tuple[int, int], ...] = ((0x6040, 0),)
    barriers = []
    for _ in range(5):
        session = SdoSession(SdoTransferRequest(0x6041, 0, None, TIMEOUT, 1), late=late)
        barriers += hexed(session.start())
        session.elapse(TIMEOUT)
        late = session.late
    assert [barrier[2:8] for barrier in barriers] == ["001000", "011000", "181000", "001000", "011000"]
