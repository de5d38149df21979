"""A simulated node as a dialogue of frames, typed by hand."""

from __future__ import annotations

import pytest

from axisbus.cia301.datatypes import DataType
from axisbus.sim.device import Device
from axisbus.sim.motor import MotorParams
from axisbus.sim.node.slave import Slave
from kit.sim.eds import DRIVE, drive_eds, make_eds
from kit.sim.eds import NODE as NODE_ROWS
from kit.sim.rig import state

NODE = 5


class Wire:
    """One slave in virtual time; frames as hexadecimal text."""

    def __init__(self, **changes: int) -> None:
        self.device = Device(drive_eds(**changes), NODE)
        self.slave = Slave(self.device)
        self.now = 0.0
        self.log: list[tuple[float, int, str]] = []

    def run(self, seconds: float, dt: float = 0.001) -> Wire:
        for _ in range(round(seconds / dt)):
            self.now += dt
            self.slave.step(self.now)
            self._collect()
        return self

    def send(self, can_id: int, data: str, *, remote: bool = False) -> list[tuple[int, str]]:
        """Send a frame and return the immediate answers."""
        seen = len(self.log)
        self.slave.on_frame(can_id, bytes.fromhex(data), self.now, remote=remote)
        self._collect()
        return [(can, text) for _, can, text in self.log[seen:]]

    def sdo(self, request: str) -> str:
        answers = [text for can, text in self.send(0x600 + NODE, request) if can == 0x580 + NODE]
        assert len(answers) == 1
        return answers[0]

    def write(self, index: int, sub: int, value: int, size: int) -> None:
        header = bytes([0x23 | (4 - size) << 2, index & 0xFF, index >> 8, sub])
        answer = self.sdo((header + (value % (1 << 8 * size)).to_bytes(4, "little")).hex())
        assert answer.startswith("60"), answer

    def start(self) -> Wire:
        self.run(0.1)
        self.send(0, "0100")
        return self

    def of(self, can_id: int) -> list[str]:
        return [text for _, can, text in self.log if can == can_id]

    def times(self, can_id: int) -> list[float]:
        return [time for time, can, _ in self.log if can == can_id]

    def forget(self) -> None:
        self.log.clear()

    def _collect(self) -> None:
        self.log += [(self.now, can, data.hex()) for can, data in self.slave.take_frames()]


# NMT, boot-up, heartbeat.


def test_boot_up_after_power_on_and_after_each_reset():
    wire = Wire().run(0.1)
    assert wire.of(0x705) == ["00"]
    wire.forget()
    wire.send(0, "8105")  # reset node
    wire.run(0.04)
    assert wire.of(0x705) == []  # it is away
    wire.run(0.02)
    assert wire.of(0x705) == ["00"]
    wire.send(0, "8206")  # for another node
    wire.run(0.1)
    assert wire.of(0x705) == ["00"]
    wire.send(0, "8200")  # reset communication, all nodes
    wire.run(0.1)
    assert wire.of(0x705) == ["00", "00"]


def test_heartbeats_report_the_state_at_their_period():
    wire = Wire(x1017=50).run(0.2)
    assert wire.of(0x705) == ["00", "7f", "7f", "7f"]
    wire.forget()
    wire.send(0, "0105")
    wire.run(0.2)
    wire.send(0, "0205")
    wire.run(0.2)
    assert wire.of(0x705) == ["05"] * 4 + ["04"] * 4
    wire.device.dials.heartbeat_stops = True
    wire.forget()
    wire.run(0.2)
    assert wire.of(0x705) == []


@pytest.mark.parametrize("before", [0, 2000])
def test_a_new_heartbeat_time_holds_at_once(before):
    """A producer begins immediately (CiA 301 7.2.8.3.2.2): the old period is not waited out first."""
    wire = Wire(x1017=before).run(0.3)
    wire.write(0x1017, 0, 100, 2)
    wrote = wire.now
    wire.run(0.35)
    beats = [time - wrote for time in wire.times(0x705) if time > wrote]
    assert beats == [pytest.approx(expected, abs=0.0015) for expected in (0.001, 0.101, 0.201, 0.301)]


def test_a_heartbeat_time_that_is_written_again_changes_nothing():
    wire = Wire(x1017=50).start()
    for _ in range(20):
        wire.write(0x1017, 0, 50, 2)
        wire.run(0.01)
    assert len([time for time in wire.times(0x705) if time > 0.1]) == 4


ENABLING = ("0600", "0700", "0f00")


def quick_stopped(transmission: int, event_timer: int = 0) -> list[str]:
    """The states that a TPDO shows of a quick stop at standstill, SYNC every 20 ms."""
    wire = Wire(x605A=2, x1800_2=transmission, x1800_5=event_timer).start()
    for word in (*ENABLING, "0200"):
        wire.send(0x205, word + "00000000")
        for _ in range(10):
            wire.send(0x080, "")
            wire.run(0.02)
    words = [int.from_bytes(bytes.fromhex(text)[:2], "little") for text in wire.of(0x185)]
    return [state(word) for word in words]


@pytest.mark.parametrize(
    ("transmission", "event_timer"), [(255, 0), (254, 0), (255, 50), (1, 0), (3, 0), (0, 0)]
)
def test_a_quick_stop_at_standstill_is_seen_in_a_tpdo(transmission, event_timer):
    shown = quick_stopped(transmission, event_timer)
    assert "quick stop active" in shown
    assert shown[-1] == "switch on disabled"


def test_a_repeated_tpdo_shows_it_twice():
    """A master that sends the command and then waits for the next TPDO has missed the first."""
    for transmission, timer in ((255, 50), (1, 0), (3, 0)):
        assert quick_stopped(transmission, timer).count("quick stop active") >= 2


def test_disable_voltage_takes_effect_at_once():
    wire = Wire(x605A=2, x1800_2=10).start()
    for word in (*ENABLING, "0200"):
        wire.send(0x205, word + "00000000")
        wire.run(0.01)
    assert state(wire.device.drive.statusword) == "quick stop active"
    wire.send(0x205, "000000000000")
    wire.run(0.002)
    assert state(wire.device.drive.statusword) == "switch on disabled"


def test_a_tpdo_that_is_never_sent_delays_a_drive_for_a_limited_time():
    wire = Wire(x605A=2, x1800_2=10).start()  # no SYNC comes
    for word in (*ENABLING, "0200"):
        wire.send(0x205, word + "00000000")
        wire.run(0.01)
    wire.run(0.9)
    assert state(wire.device.drive.statusword) == "quick stop active"
    wire.run(0.15)
    assert state(wire.device.drive.statusword) == "switch on disabled"


def test_sdo_is_answered_in_pre_operational_and_operational_only():
    wire = Wire().run(0.1)
    request = "4000100000000000"
    assert wire.sdo(request) == "4300100092010200"
    wire.send(0, "0100")
    assert wire.sdo(request) == "4300100092010200"
    wire.send(0, "0200")
    assert wire.send(0x605, request) == []
    wire.send(0, "8000")
    assert wire.sdo(request) == "4300100092010200"
    wire.send(0, "8100")
    assert wire.send(0x605, request) == []  # initialising


def test_node_guarding_answers_with_a_toggling_bit():
    wire = Wire().run(0.1)
    assert wire.send(0x705, "", remote=True) == [(0x705, "7f")]
    assert wire.send(0x705, "", remote=True) == [(0x705, "ff")]


# SDO on the wire.


def test_sdo_expedited_in_both_directions():
    wire = Wire().run(0.1)
    assert wire.sdo("2b40600006000000") == "6040600000000000"
    wire.run(0.01)
    assert wire.sdo("4041600000000000") == "4b41600031020000"
    assert wire.sdo("22816000e8030000") == "6081600000000000"  # size not said: four bytes
    assert wire.sdo("4081600000000000") == "43816000e8030000"


def test_sdo_segmented_in_both_directions():
    wire = Wire().run(0.1)
    wire.device.dictionary.entries[0x1008_00] = wire.device.dictionary.entries[0x1008_00]._replace(
        writable=True
    )
    assert wire.sdo("210810000a000000") == "6008100000000000"
    assert wire.sdo("00" + b"stand-i".hex()) == "2000000000000000"
    assert wire.sdo("19" + b"n 1".hex() + "00000000") == "3000000000000000"
    assert wire.sdo("4008100000000000") == "410810000a000000"
    assert wire.sdo("6000000000000000") == "00" + b"stand-i".hex()
    assert wire.sdo("7000000000000000") == "19" + b"n 1".hex() + "00000000"


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("4000500000000000", "8000500000000206"),  # no such object
        ("4041600100000000", "8041600111000906"),  # no such sub-index
        ("2b41600000000000", "8041600002000106"),  # read-only
        ("2f40600006000000", "8040600013000706"),  # too short
        ("2340600006000000", "8040600012000706"),  # too long
        ("2f60600002000000", "8060600030000906"),  # a mode that it does not have
        ("c600100000000000", "8000100002000106"),  # read-only, in blocks too
        ("6000000000000000", "8000000001000405"),  # a segment of nothing
        ("0000000000000000", "8000000001000405"),
        ("e000000000000000", "8000000001000405"),  # an unknown command
    ],
)
def test_sdo_refusals_on_the_wire(request_, answer):
    assert Wire().run(0.1).sdo(request_) == answer


def test_an_empty_string_is_a_transfer_of_no_bytes():
    wire = Wire().run(0.1)
    assert wire.sdo("4008100000000000") == "4108100000000000"
    assert wire.sdo("6000000000000000") == "0f00000000000000"


def test_sdo_toggle_and_abort_end_a_transfer():
    wire = Wire().run(0.1)
    wire.device.dictionary.values[0x1008_00] = "a long device name"
    assert wire.sdo("4008100000000000").startswith("41081000")
    assert wire.sdo("7000000000000000") == "8008100000000305"
    assert wire.sdo("4008100000000000").startswith("41081000")
    assert wire.send(0x605, "8008100000000008") == []
    assert wire.sdo("6000000000000000") == "8008100001000405"


def test_a_block_upload_of_few_bytes_is_answered_by_a_normal_one():
    """The client prefers a normal transfer for up to 4 bytes."""
    assert Wire().run(0.1).sdo("a000100010040000") == "4300100092010200"


def test_sdo_dials_delay_silence_and_abort():
    wire = Wire().run(0.1)
    wire.device.dials.sdo_delay = 0.05
    assert wire.send(0x605, "4000100000000000") == []
    wire.run(0.04)
    assert wire.of(0x585) == []
    wire.run(0.02)
    assert wire.of(0x585) == ["4300100092010200"]
    wire.device.dials.sdo_delay = 0.0
    wire.device.dials.sdo_aborts[0x1000, 0] = 0x0800_0021
    assert wire.sdo("4000100000000000") == "8000100021000008"
    wire.device.dials.sdo_silent = True
    assert wire.send(0x605, "4000100000000000") == []
    wire.device.dials.sdo_silent = False
    wire.device.dials.dead = True
    assert wire.send(0x605, "4000100000000000") == []


# PDO.


def test_event_driven_pdos_only_on_change_and_only_when_operational():
    wire = Wire().run(0.1)
    assert wire.of(0x185) == []
    wire.send(0, "0100")
    wire.run(0.5)
    assert wire.of(0x185) == ["500200000000"]  # statusword and position, once
    wire.forget()
    wire.send(0x205, "060000000000")
    wire.run(0.1)
    assert wire.of(0x185) == ["310200000000"]


def test_event_timer_repeats_and_inhibit_time_holds_back():
    wire = Wire(x1800_5=20, x1801_3=500).start()  # 20 ms; 50 ms for TPDO 2, which shows the velocity
    wire.run(0.2)
    assert len(wire.of(0x185)) == pytest.approx(10, abs=1)
    for word in ("0600", "0700", "0f00"):
        wire.send(0x305, word + "00000000")
        wire.run(0.03)
    wire.write(0x6060, 0, 3, 1)
    wire.send(0x305, "0f0010270000")
    wire.run(0.01)
    wire.forget()
    wire.run(0.3)
    gaps = [after - before for before, after in zip(wire.times(0x285), wire.times(0x285)[1:], strict=False)]
    assert gaps
    assert min(gaps) >= 0.0499
    wire.device.dials.event_timer_ignored = True
    wire.write(0x1800, 5, 20, 2)
    wire.send(0x305, "060000000000")  # switched off, so that nothing changes any more
    wire.run(3.0)
    wire.forget()
    wire.run(0.2)
    assert wire.of(0x185) == []


def test_synchronous_pdos_travel_with_sync_and_the_answer_with_the_next():
    wire = Wire(x1400_2=1, x1800_2=1, x1801_1=0x8000_0000).start()
    wire.run(0.01)
    wire.send(0x205, "060000000000")
    wire.run(0.05)
    assert wire.of(0x185) == []
    assert state(wire.device.drive.statusword) == "switch on disabled"
    assert wire.send(0x80, "") == [(0x185, "500200000000")]
    wire.run(0.01)
    assert wire.send(0x80, "07") == [(0x185, "310200000000")]  # with a SYNC counter, which is ignored


def test_transmission_types_0_and_n():
    wire = Wire(x1800_2=0, x1801_2=3).start()
    wire.run(0.01)
    counts = [len(wire.send(0x80, "")) for _ in range(6)]
    assert counts == [1, 0, 1, 0, 0, 1]  # type 0 when changed: once; type 3 with the third and sixth
    wire.send(0x205, "060000000000")
    wire.run(0.01)
    assert [can for can, _ in wire.send(0x80, "")] == [0x185]


def test_target_and_controlword_in_one_frame_fit_together():
    wire = Wire().start()
    wire.write(0x6060, 0, 1, 1)
    for word in ("06", "07", "0f"):
        wire.send(0x205, word + "0000000000")
        wire.run(0.02)
    wire.send(0x205, "1f00" + "10270000")
    wire.send(0x205, "0f00" + "10270000")
    wire.run(2.0)
    assert wire.device.drive.position == 10_000


def test_an_rpdo_that_is_too_short_is_reported_and_not_obeyed():
    wire = Wire().start()
    assert wire.send(0x205, "0600") == [(0x85, "1082110000000000")]
    assert wire.device.drive.controlword == 0


def test_no_pdo_is_received_outside_operational():
    wire = Wire().run(0.1)
    wire.send(0x205, "060000000000")
    wire.send(0x80, "")
    wire.run(0.05)
    assert state(wire.device.drive.statusword) == "switch on disabled"


def test_a_remapped_pdo_is_received_on_its_new_identifier():
    wire = Wire().start()
    wire.write(0x1400, 1, 0x8000_0205, 4)
    wire.write(0x1600, 0, 0, 1)
    wire.write(0x1600, 1, 0x60400010, 4)
    wire.write(0x1600, 0, 1, 1)
    wire.write(0x1400, 1, 0x0000_0222, 4)
    wire.send(0x205, "0600")
    assert wire.device.drive.controlword == 0
    wire.send(0x222, "0600")
    assert wire.device.drive.controlword == 6


def test_an_edge_shorter_than_a_step_is_received():
    wire = Wire().start()
    wire.device.drive.fault(0x2310)
    wire.run(0.05)
    for word in ("00", "80", "00"):
        wire.send(0x305, word + "0000000000")
    wire.run(0.01)
    assert state(wire.device.drive.statusword) == "switch on disabled"


# Emergencies and watchdogs.


def test_emergency_frames_of_a_fault_and_its_reset():
    wire = Wire().start()
    wire.device.drive.fault(0x8611)
    wire.run(0.05)
    wire.send(0x305, "800000000000")
    wire.run(0.01)
    assert wire.of(0x85) == ["1186210000000000", "0000000000000000"]
    wire.device.dials.emcy_short = True
    wire.device.drive.fault(0x8611)
    wire.run(0.05)
    assert wire.of(0x85)[-1] == "1186"
    wire.write(0x1014, 0, 0x8000_0085, 4)
    wire.forget()
    wire.send(0x305, "000000000000")
    wire.send(0x305, "800000000000")
    wire.run(0.05)
    assert wire.of(0x85) == []


def enabled(wire: Wire) -> Wire:
    """Operation enabled, in profile velocity mode at 10 000/s."""
    wire.start()
    wire.write(0x6060, 0, 3, 1)
    for word in ("06", "07", "0f"):
        wire.send(0x305, word + "00" + "10270000")
        wire.run(0.02)
    wire.run(0.3)
    assert wire.device.drive.velocity == 10_000
    return wire


@pytest.mark.parametrize(
    ("option", "ends_in"),
    [(0, "operation enabled"), (1, "fault"), (2, "switch on disabled"), (3, "switch on disabled")],
)
def test_a_lost_master_causes_the_reaction_of_6007h(option, ends_in):
    wire = enabled(Wire(x6007=option, x1016_1=0x7F_0064))  # node 127, 100 ms
    wire.run(0.3)
    assert (
        state(wire.device.drive.statusword) == "operation enabled"
    )  # no heartbeat was ever received: not watched yet
    for _ in range(5):
        wire.send(0x77F, "05")
        wire.run(0.05)
    wire.forget()
    wire.run(0.5)
    assert state(wire.device.drive.statusword) == ends_in
    assert wire.of(0x85)[0] == "3081110000000000"
    assert len(wire.of(0x85)) == 1
    assert wire.device.nmt == 127  # 1029h:1 = 0: pre-operational
    if option == 1:
        assert wire.device.read(0x603F) == 0x8130


@pytest.mark.parametrize(("reaction", "nmt"), [(0, 127), (1, 5), (2, 4)])
def test_1029_decides_the_nmt_state(reaction, nmt):
    wire = Wire(x1029_1=reaction, x1016_1=0x7F_0032).start()
    wire.send(0x77F, "05")
    wire.run(0.2)
    assert wire.device.nmt == nmt


def test_a_heartbeat_that_returns_ends_the_communication_error():
    wire = Wire(x1029_1=1, x6007=0, x1016_1=0x7F_0032).start()
    wire.send(0x77F, "05")
    wire.run(0.2)
    wire.send(0x77F, "05")
    wire.run(0.01)
    assert wire.of(0x85) == ["3081110000000000", "0000000000000000"]


def test_nmt_stop_counts_as_a_lost_connection():
    wire = enabled(Wire(x6007=3, x605A=6))
    wire.send(0, "0205")
    wire.run(0.5)
    assert state(wire.device.drive.statusword) == "quick stop active"
    assert wire.device.drive.velocity == 0


def test_life_guarding_is_a_watchdog_too():
    rows = [row for row in NODE_ROWS if row[0] != 0x1017]
    rows += [(0x100C, 0, DataType.UNSIGNED16, "rw", 50), (0x100D, 0, DataType.UNSIGNED8, "rw", 2)]
    wire = Wire()
    wire.device = Device(make_eds(rows + DRIVE), 5)
    wire.slave = Slave(wire.device)
    wire.start()
    for _ in range(3):
        wire.send(0x705, "", remote=True)
        wire.run(0.05)
    assert wire.of(0x85) == []
    wire.run(0.1)
    assert wire.of(0x85) == ["3081110000000000"]


def test_a_missing_rpdo_is_noticed_by_its_deadline():
    wire = Wire(x1401_5=40, x6007=1, x1029_1=1).start()
    wire.run(0.2)
    assert wire.of(0x85) == []  # never received: not watched
    for _ in range(5):
        wire.send(0x305, "060000000000")
        wire.run(0.03)
    wire.run(0.1)
    assert wire.of(0x85) == ["5082110000000000"]
    assert state(wire.device.drive.statusword) == "fault"


def test_reset_node_switches_the_motor_off_and_forgets_the_reference():
    wire = enabled(Wire())
    wire.device.drive.axis.offset = 500.0
    wire.send(0, "8105")
    wire.run(2.0)
    drive = wire.device.drive
    assert state(drive.statusword) == "switch on disabled"
    assert drive.position == round(drive.axis.motor.position)
    assert wire.device.read(0x6060) == 0


def test_two_slaves_of_one_master_keep_apart():
    first, second = (
        Slave(Device(drive_eds(), 1)),
        Slave(Device(drive_eds(), 2, params=MotorParams(start_position=7))),
    )
    for slave in (first, second):
        slave.step(0.0)
        slave.step(0.05)
    assert not second.listens_to(0x601)
    second.on_frame(0x602, bytes.fromhex("4064600000000000"), 0.05)
    assert second.take_frames()[-1] == (0x582, bytes.fromhex("4364600007000000"))


# How PDOs travel: requests, SYNC counter, start value; SYNC and TIME as services.

NO_RTR = 0x4000_0000


def served(**dials):
    """A node with 1006h, 1012h, 1019h and a SYNC start value in TPDO 1, not yet started."""
    u8, u32 = DataType.UNSIGNED8, DataType.UNSIGNED32
    extra = [
        (0x1006, 0, u32, "rw", 0),
        (0x1012, 0, u32, "rw", 0x100),
        (0x1019, 0, u8, "rw", 0),
        (0x1800, 6, u8, "rw", 0),
    ]
    wire = Wire()
    wire.device = Device(make_eds(NODE_ROWS + DRIVE + extra), NODE)
    for name, value in dials.items():
        setattr(wire.device.dials, name, value)
    wire.slave = Slave(wire.device)
    return wire.run(0.1)


def set_tpdo(wire, number, kind, **entries):
    index, cob_id = 0x1800 + number - 1, 0x85 + 0x100 * number
    wire.write(index, 1, 0x8000_0000 | cob_id, 4)
    wire.write(index, 2, kind, 1)
    if "start" in entries:
        wire.write(index, 6, entries["start"], 1)
    wire.write(index, 1, cob_id | entries.get("flags", 0), 4)


def test_a_tpdo_on_request_is_sent_only_when_it_is_requested():
    wire = served(rtr=True)
    set_tpdo(wire, 1, 253)
    wire.send(0, "0100")
    wire.send(0x205, "060000000000")
    wire.run(0.2)
    assert wire.send(0x80, "") == []
    assert wire.send(0x185, "", remote=True) == [(0x185, "310200000000")]


def test_type_252_sends_the_values_sampled_at_the_last_sync():
    wire = served(rtr=True)
    set_tpdo(wire, 1, 252)
    wire.send(0, "0100")
    wire.run(0.05)
    assert wire.send(0x185, "", remote=True) == []  # no SYNC yet, so nothing was sampled
    assert wire.send(0x80, "") == []
    wire.send(0x205, "060000000000")
    wire.run(0.05)
    assert wire.send(0x185, "", remote=True) == [(0x185, "500200000000")]
    wire.send(0x80, "")
    assert wire.send(0x185, "", remote=True) == [(0x185, "310200000000")]


def test_a_tpdo_that_allows_no_remote_frames_does_not_answer_them():
    wire = served(rtr=True)
    set_tpdo(wire, 1, 1, flags=NO_RTR)
    wire.send(0, "0100")
    wire.run(0.05)
    assert wire.send(0x185, "", remote=True) == []


def test_a_device_without_remote_frames_refuses_the_types_that_need_them():
    wire = served().start()
    for kind in (252, 253, 241, 251):
        assert wire.sdo(f"2f001802{kind:02x}000000") == "8000180230000906"


@pytest.mark.parametrize(
    ("kind", "start", "sent_at"),
    [
        (1, 0, [1, 2, 3, 4, 1, 2, 3, 4]),
        (1, 3, [3, 4, 1, 2, 3, 4]),  # the SYNC with counter 3 is the first that counts
        (2, 3, [4, 2, 4]),
        (4, 1, [4, 4]),
        (3, 4, [2]),  # 4, 1, 2; and 3, 4 of the next three
    ],
)
def test_a_sync_start_value_sets_the_begin_of_counting(kind, start, sent_at):
    wire = served()
    wire.write(0x1019, 0, 4, 1)
    set_tpdo(wire, 1, kind, start=start)
    wire.send(0, "0100")
    wire.run(0.01)
    seen = [
        count for count in (1, 2, 3, 4) * 2 if any(can == 0x185 for can, _ in wire.send(0x80, f"{count:02x}"))
    ]
    assert seen == sent_at


def test_a_start_value_without_a_counter_is_ignored():
    wire = served()
    set_tpdo(wire, 1, 1, start=3)
    wire.send(0, "0100")
    wire.run(0.01)
    assert [can for can, _ in wire.send(0x80, "")] == [0x185]


@pytest.mark.parametrize(("overflow", "right", "wrong"), [(0, "", "05"), (10, "05", "")])
def test_a_sync_of_another_length_than_1019h_is_reported_once(overflow, right, wrong):
    wire = served()
    wire.write(0x1019, 0, overflow, 1)
    wire.send(0, "0100")
    assert 0x85 not in [can for can, _ in wire.send(0x80, right)]
    assert (0x85, "4082110000000000") in wire.send(0x80, wrong)  # 8240h, unexpected SYNC data length
    assert 0x85 not in [can for can, _ in wire.send(0x80, wrong)]


def test_a_node_sends_sync_if_1005h_requires_it():
    wire = served()
    wire.write(0x1006, 0, 20_000, 4)
    wire.run(0.1)
    assert wire.of(0x80) == []
    wire.write(0x1005, 0, 0x4000_0080, 4)
    wire.run(0.2)
    assert set(wire.of(0x80)) == {""}
    gaps = [after - before for before, after in zip(wire.times(0x80), wire.times(0x80)[1:], strict=False)]
    assert gaps == pytest.approx([0.02] * len(gaps), abs=0.0011)
    assert len(gaps) >= 9
    wire.write(0x1005, 0, 0x80, 4)
    wire.write(0x1019, 0, 3, 1)
    wire.write(0x1005, 0, 0x4000_0080, 4)
    wire.forget()
    wire.run(0.1)
    assert wire.of(0x80)[:5] == ["01", "02", "03", "01", "02"]


def test_a_node_receives_sync_on_the_identifier_of_1005h():
    wire = served()
    set_tpdo(wire, 1, 1)
    wire.write(0x1005, 0, 0x90, 4)
    wire.send(0, "0100")
    wire.run(0.01)
    assert wire.send(0x80, "") == []
    assert [can for can, _ in wire.send(0x90, "")] == [0x185]


def test_time_is_received_if_1012h_requires_it():
    """One hour after midnight of the day 15000: 3600000 ms is 0036EE80h, 15000 is 3A98h."""
    wire = served().start()
    wire.send(0x100, "80ee3600983a")
    assert wire.slave.time_of_day is None
    wire.write(0x1012, 0, 0x8000_0100, 4)
    wire.send(0x100, "80ee")
    assert wire.slave.time_of_day is None
    wire.send(0x100, "80ee3600983a")
    assert wire.slave.time_of_day == (3_600_000, 15_000)


def test_a_tpdo_can_be_made_to_stop():
    wire = Wire(x1800_2=1).start()
    wire.device.dials.tpdos_stop = frozenset({1})
    assert wire.send(0x80, "") == []
