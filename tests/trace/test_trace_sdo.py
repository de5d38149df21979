"""SDO dialogues typed by hand after CiA 301 7.2.4.3: expedited, segmented, in blocks, refused, broken."""

from __future__ import annotations

from axisbus.trace.frame_formats import what
from kit.typed_frames import Wire, crc16


def test_an_expedited_read_has_name_value_words_and_the_time_it_took():
    wire = Wire()
    assert wire.says(0x605, "40 41 60 00 00 00 00 00") == "read 6041h Statusword"
    said = wire.says(0x585, "4B 41 60 00 37 06 00 00")
    assert (
        said
        == "read 6041h Statusword = 0x0637 (operation enabled; voltage enabled, remote, target reached)  [1 ms]"
    )


def test_an_expedited_write_and_its_confirmation():
    wire = Wire()
    assert (
        wire.says(0x605, "2B 40 60 00 0F 00 00 00") == "write 6040h Controlword = 0x000F (enable operation)"
    )
    done = wire(0x585, "60 40 60 00 00 00 00 00")
    assert what(done).startswith("written 6040h Controlword = 0x000F (enable operation)")
    assert done.sdo.write


def test_a_negative_position():
    wire = Wire()
    wire(0x605, "40 64 60 00 00 00 00 00")
    assert wire(0x585, "43 64 60 00 9C FF FF FF").values[0].value == -100


def test_an_answer_that_does_not_give_its_size_is_cut_to_the_type():
    wire = Wire()
    wire(0x605, "40 41 60 00 00 00 00 00")
    one = wire(0x585, "42 41 60 00 50 02 00 00")
    assert (one.values[0].value, one.problem) == (0x0250, "")


def test_a_value_of_another_size_than_its_type_is_named():
    wire = Wire()
    wire(0x605, "40 41 60 00 00 00 00 00")
    assert wire(0x585, "43 41 60 00 50 02 00 00").problem == "4 bytes for UNSIGNED16, which has 2"


def test_a_refusal_is_trouble_with_its_text():
    wire = Wire()
    wire(0x605, "40 07 60 00 00 00 00 00")
    one = wire(0x585, "80 07 60 00 00 00 02 06")
    assert one.error
    assert not one.problem
    assert one.sdo.abort == 0x06020000
    assert "aborted 6007h Abort connection option code: 0x06020000, Object does not exist" in what(one)


def test_an_unknown_abort_code_is_a_value():
    wire = Wire()
    wire(0x605, "40 07 60 00 00 00 00 00")
    assert "0x12345678, not in CiA 301" in what(wire(0x585, "80 07 60 00 78 56 34 12"))


def test_a_segmented_read_is_followed_as_one_transfer():
    """The device name "GIM6010-8": nine bytes, seven and two."""
    wire = Wire()
    wire(0x605, "40 08 10 00 00 00 00 00")
    assert wire.says(0x585, "41 08 10 00 09 00 00 00").startswith(
        "read in segments 1008h Manufacturer device name, 0 of 9 bytes"
    )
    wire.says(0x605, "60 00 00 00 00 00 00 00")
    assert "segment 1008h Manufacturer device name, 7 of 9 bytes" in wire.says(
        0x585, "00 47 49 4D 36 30 31 30"
    )
    wire.says(0x605, "70 00 00 00 00 00 00 00")
    last = wire(0x585, "1B 2D 38 00 00 00 00 00")
    assert (last.values[0].value, last.problem) == ("GIM6010-8", "")


def test_a_segmented_write_is_followed_as_one_transfer():
    wire = Wire()
    wire.says(0x605, "21 08 10 00 09 00 00 00")
    wire.says(0x585, "60 08 10 00 00 00 00 00")
    wire.says(0x605, "00 47 49 4D 36 30 31 30")
    wire.says(0x585, "20 00 00 00 00 00 00 00")
    assert wire(0x605, "1B 2D 38 00 00 00 00 00").values[0].value == "GIM6010-8"
    done = wire(0x585, "30 00 00 00 00 00 00 00")
    assert (done.sdo.step, done.values[0].value, done.problem) == ("written", "GIM6010-8", "")


def test_a_segment_with_the_wrong_toggle_bit_is_named():
    wire = Wire()
    wire(0x605, "40 08 10 00 00 00 00 00")
    wire(0x585, "41 08 10 00 09 00 00 00")
    wire(0x605, "60 00 00 00 00 00 00 00")
    assert wire(0x585, "10 47 49 4D 36 30 31 30").problem == "toggle bit 1 where 0 was due"


def test_fewer_bytes_than_announced_are_named():
    wire = Wire()
    wire(0x605, "40 08 10 00 00 00 00 00")
    wire(0x585, "41 08 10 00 09 00 00 00")
    wire(0x605, "60 00 00 00 00 00 00 00")
    assert wire(0x585, "0B 47 49 00 00 00 00 00").problem == "2 bytes came, announced were 9"


CONTENT = bytes(range(65, 65 + 17))  # 17 bytes: two whole segments and three bytes


def _segments(content: bytes) -> list[str]:
    parts = [content[at : at + 7].ljust(7, b"\0") for at in range(0, len(content), 7)]
    return [
        (bytes([number | (0x80 if number == len(parts) else 0)]) + part).hex()
        for number, part in enumerate(parts, start=1)
    ]


def test_a_block_write_is_followed_and_its_crc_checked():
    wire = Wire()
    crc = crc16(CONTENT).to_bytes(2, "little").hex()
    wire.says(0x605, "C6 21 10 00 11 00 00 00")
    wire.says(0x585, "A4 21 10 00 7F 00 00 00")
    said = [wire.says(0x605, segment) for segment in _segments(CONTENT)]
    assert said[0] == "block segment 1 1021h Store EDS, 7 of 17 bytes"
    assert "acknowledged up to segment 3" in wire.says(0x585, "A2 03 7F 00 00 00 00 00")
    ended = wire(0x605, f"D1 {crc} 00 00 00 00 00")  # four bytes of the last segment do not count
    assert (ended.values[0].value, ended.problem) == (CONTENT, "")
    assert wire(0x585, "A1 00 00 00 00 00 00 00").sdo.step == "written"


def test_a_wrong_crc_is_named():
    wire = Wire()
    wire(0x605, "C6 21 10 00 11 00 00 00")
    wire(0x585, "A4 21 10 00 7F 00 00 00")
    for segment in _segments(CONTENT):
        wire(0x605, segment)
    wire(0x585, "A2 03 7F 00 00 00 00 00")
    assert "CRC 0x0000" in wire(0x605, "D1 00 00 00 00 00 00 00").problem


def test_a_block_upload_in_which_a_segment_is_repeated_is_decoded():
    wire = Wire()
    first, second, third = _segments(CONTENT)
    crc = crc16(CONTENT).to_bytes(2, "little").hex()
    wire.says(0x605, "A4 21 10 00 7F 00 00 00")
    wire.says(0x585, "C6 21 10 00 11 00 00 00")
    wire.says(0x605, "A3 00 00 00 00 00 00 00")
    for segment in (first, second, third):
        wire.says(0x585, segment)
    # The reader has lost the second one: from there on it is repeated, numbered from 1.
    assert "of 3, the rest is asked for again" in wire.says(0x605, "A2 01 7F 00 00 00 00 00")
    wire.says(0x585, "01" + second[2:])
    wire.says(0x585, "82" + third[2:])
    wire.says(0x605, "A2 02 7F 00 00 00 00 00")
    ended = wire(0x585, f"D1 {crc} 00 00 00 00 00")
    assert (ended.values[0].value, ended.problem) == (CONTENT, "")
    assert wire(0x605, "A1 00 00 00 00 00 00 00").problem == ""


def test_a_segment_that_is_missing_on_the_wire_is_named():
    wire = Wire()
    first, _, third = _segments(CONTENT)
    wire(0x605, "C6 21 10 00 11 00 00 00")
    wire(0x585, "A4 21 10 00 7F 00 00 00")
    wire(0x605, first)
    assert wire(0x605, third).problem == "segment 3 came where 2 was due"


def test_a_block_read_that_the_server_answers_in_segments():
    """CiA 301 7.2.4.3.13: the server may change the protocol."""
    wire = Wire()
    wire.says(0x605, "A4 08 10 00 7F 15 00 00")
    wire.says(0x585, "41 08 10 00 03 00 00 00")
    wire.says(0x605, "60 00 00 00 00 00 00 00")
    assert wire(0x585, "09 41 42 43 00 00 00 00").values[0].value == "ABC"


def test_an_answer_to_another_question_is_named():
    wire = Wire()
    wire(0x605, "40 41 60 00 00 00 00 00")
    assert "its object is not the requested one, 6041h:00" in wire(0x585, "4B 64 60 00 00 00 00 00").problem
    assert wire(0x585, "4B 41 60 00 50 02 00 00").problem == ""


def test_an_answer_without_a_request_is_reported():
    wire = Wire()
    wire(0x605, "40 41 60 00 00 00 00 00")
    wire(0x585, "4B 41 60 00 50 02 00 00")
    assert wire(0x585, "4B 41 60 00 50 02 00 00").problem == "nothing was asked"


def test_a_request_without_an_answer_is_reported_with_the_next_one():
    wire = Wire()
    wire(0x605, "40 41 60 00 00 00 00 00")
    one = wire(0x605, "40 41 60 00 00 00 00 00")
    assert one.error
    assert not one.problem
    assert "read of 6041h:00 0.001 s before got no answer" in what(one)


def test_a_recording_that_begins_within_a_transfer_makes_no_complaint():
    wire = Wire()
    assert "whose beginning was not seen" in wire.says(0x585, "00 47 49 4D 36 30 31 30")


def test_two_nodes_do_not_mix():
    wire = Wire()
    wire(0x605, "40 41 60 00 00 00 00 00")
    wire(0x606, "40 64 60 00 00 00 00 00")
    assert wire(0x585, "4B 41 60 00 50 02 00 00").problem == ""
    assert wire(0x586, "43 64 60 00 01 00 00 00").problem == ""


def test_an_additional_channel_is_learned_from_its_parameters():
    """1201h of node 5: from the client on 641h, to it on 5C1h."""
    wire = Wire()
    for sub, identifier in (("01", "41 06 00 00"), ("02", "C1 05 00 00")):
        wire(0x605, f"23 01 12 {sub} {identifier}")
        wire(0x585, f"60 01 12 {sub} 00 00 00 00")
    asked = wire(0x641, "40 41 60 00 00 00 00 00")
    assert (asked.node, asked.from_node) == (5, False)
    answer = wire(0x5C1, "4B 41 60 00 50 02 00 00")
    assert (answer.node, answer.from_node, answer.problem) == (5, True, "")
