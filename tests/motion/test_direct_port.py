"""The direct port: the seam of motion over arithmetic, in virtual time."""

from __future__ import annotations

import pickle

import pytest

from axisbus.cia301.nmt import NmtCommand
from axisbus.cia402.port import BusCycle, Outputs, Port, SdoReply, SdoRequest, ValueTransport
from axisbus.errors import AdapterError, SdoAbort, SdoTimeout
from axisbus.sim.device import Device
from kit.direct.cycle import CycleFaultSettings, DirectCycle, DirectPort
from kit.sim.eds import drive_eds, two_axes, without
from kit.sim.rig import state

PERIOD = 0.01


class Bench:
    """One axis, one port, one cycle; ``once`` is a scan cycle."""

    def __init__(self, *, options: dict | None = None, cycle: dict | None = None, **changes: int) -> None:
        self.device = Device(drive_eds(**changes), 5)
        self.port = DirectPort(self.device, **(options or {}))
        self.cycle = DirectCycle([self.port], **(cycle or {}))
        self.inputs = self.port.read(0.0)

    def once(self, outputs: Outputs | None = None, count: int = 1) -> Bench:
        for _ in range(count):
            self.cycle.wait_until(self.cycle.now() + PERIOD)
            self.inputs = self.port.read(self.cycle.now())
            if outputs is not None:
                self.port.write(outputs)
            self.cycle.commit()
            self.cycle.sync()
            self.cycle.heartbeat()
        return self

    def enable(self, mode: int = 1) -> Bench:
        for word in (6, 7, 15):
            self.once(Outputs(controlword=word, mode=mode), 4)
        assert self.state == "operation enabled"
        return self

    @property
    def state(self) -> str:
        return state(self.inputs.statusword.value)


def as_port(port: Port) -> Port:
    return port


def as_cycle(cycle: BusCycle) -> BusCycle:
    return cycle


def test_the_direct_port_implements_the_port_protocol():
    bench = Bench()
    assert as_port(bench.port).capabilities.inputs["statusword"] is ValueTransport.SYNC_PDO
    assert as_cycle(bench.cycle).now() == 0.0


def test_values_are_sampled_at_sync_and_read_one_cycle_later():
    bench = Bench()
    bench.once()
    assert bench.inputs.statusword is None
    bench.once()
    assert bench.inputs.statusword.stamp == pytest.approx(0.01)
    bench.once(Outputs(controlword=6))  # committed and latched at 0.03
    assert bench.state == "switch on disabled"
    bench.once()  # read at 0.04: the sample of 0.03, taken before the controlword took effect
    assert bench.state == "switch on disabled"
    bench.once()
    assert bench.state == "ready to switch on"


def test_a_move_over_the_port():
    bench = Bench().enable()
    bench.once(Outputs(controlword=0x1F, target_position=5_000))
    bench.once(Outputs(controlword=0x0F), 3)
    for _ in range(200):
        bench.once(Outputs(controlword=0x0F))
    assert bench.inputs.position.value == 5_000
    assert bench.inputs.statusword.value & 0x0400


def test_without_a_controlword_the_drive_stays_as_it_is():
    bench = Bench().enable()
    bench.once(Outputs(), 50)
    assert bench.state == "operation enabled"
    assert bench.device.drive.controlword == 15


def test_the_simulated_drive_moves_in_time_without_commands():
    bench = Bench().enable(3)
    bench.once(Outputs(controlword=15, target_velocity=10_000), 20)
    before = bench.device.drive.position
    bench.cycle.wait_until(bench.cycle.now() + 1.0)
    assert bench.device.drive.position - before == pytest.approx(10_000, rel=0.01)


def test_without_sync_nothing_synchronous_happens():
    bench = Bench().enable()
    bench.cycle.dials.sync_lost = True
    stamp = bench.inputs.statusword.stamp
    bench.once(Outputs(controlword=0), 10)
    assert bench.inputs.statusword.stamp <= stamp + 2 * PERIOD
    assert bench.device.drive.controlword == 15


def test_event_driven_values_are_sent_on_change_and_by_their_timer():
    bench = Bench(options={"inputs": {"statusword": ValueTransport.EVENT_PDO}})
    bench.once(count=20)
    first = bench.inputs.statusword.stamp
    bench.once(Outputs(controlword=6))
    bench.once()
    assert bench.inputs.statusword.stamp > first
    stamp = bench.inputs.statusword.stamp
    bench.once(count=50)
    assert bench.inputs.statusword.stamp == stamp
    timed = Bench(options={"inputs": {"statusword": ValueTransport.EVENT_PDO}, "event_timer": 0.05})
    timed.once(count=50)
    assert timed.inputs.now - timed.inputs.statusword.stamp <= 0.05


def test_event_driven_outputs_act_at_commit():
    bench = Bench(options={"outputs": {"controlword": ValueTransport.EVENT_PDO}})
    bench.cycle.dials.sync_lost = True
    bench.once(Outputs(controlword=6), 3)
    assert bench.device.drive.controlword == 6


def test_absent_and_polled_values():
    bench = Bench(
        options={"inputs": {"torque": ValueTransport.NONE, "position": ValueTransport.SDO}, "sdo_poll": 0.1}
    )
    bench.once(count=30)
    assert bench.inputs.torque is None
    assert 0.0 <= bench.inputs.now - bench.inputs.position.stamp <= 0.11
    lacking = DirectPort(Device(without(0x6062), 5))
    assert lacking.capabilities.inputs["demand"] is ValueTransport.NONE


def test_outputs_by_sdo_arrive_later():
    bench = Bench(options={"outputs": {"controlword": ValueTransport.SDO}, "sdo_time": 0.025})
    bench.once(Outputs(controlword=6))
    assert bench.device.drive.controlword == 0
    bench.once(count=3)
    assert bench.device.drive.controlword == 6


def test_sdo_requests_are_answered_by_id_one_after_the_other():
    bench = Bench(options={"sdo_time": 0.006})
    requests = (
        SdoRequest(7, 0x6081, 0, 1234),
        SdoRequest(8, 0x6081, 0, None),
        SdoRequest(9, 0x5000, 0, None),
    )
    bench.once(Outputs(sdo=requests))
    replies = []
    for _ in range(3):
        bench.once()
        replies.append(bench.inputs.sdo)
    assert replies == [
        (SdoReply(7, None, None),),
        (SdoReply(8, 1234, None), SdoReply(9, None, 0x06020000)),
        (),
    ]


def test_cancelled_requests_are_neither_answered_nor_carried_out():
    bench = Bench(options={"sdo_time": 0.015})
    bench.once(Outputs(sdo=(SdoRequest(1, 0x6081, 0, 11), SdoRequest(2, 0x6083, 0, 22))))
    bench.once(Outputs(cancel=(2,)))
    answered = []
    for _ in range(10):
        bench.once()
        answered += bench.inputs.sdo
    assert answered == [SdoReply(1, None, None)]
    assert bench.port.upload(0x6083) == 100_000


def test_a_silent_node_times_out_and_a_late_answer_still_writes():
    bench = Bench(options={"sdo_timeout": 0.1})
    bench.device.dials.sdo_silent = True
    bench.once(Outputs(sdo=(SdoRequest(1, 0x6081, 0, 11),)))
    answered = []
    for _ in range(12):
        bench.once()
        answered += bench.inputs.sdo
    assert answered == [SdoReply(1, None, 0x05040000)]
    bench.device.dials.sdo_silent = False
    bench.device.dials.sdo_delay = 0.3
    bench.once(Outputs(sdo=(SdoRequest(2, 0x6081, 0, 22),)))
    for _ in range(12):
        bench.once()
        answered += bench.inputs.sdo
    assert answered[-1] == SdoReply(2, None, 0x05040000)
    assert bench.device.dictionary.read(0x6081) == 20_000
    bench.once(count=20)
    assert bench.device.dictionary.read(0x6081) == 22


def test_a_refused_60c2_is_one_dial():
    bench = Bench()
    bench.device.dials.sdo_write_aborts[0x60C2, 1] = 0x06010002
    bench.once(Outputs(sdo=(SdoRequest(1, 0x60C2, 1, 4), SdoRequest(2, 0x60C2, 1, None))))
    bench.once()
    assert bench.inputs.sdo == (SdoReply(1, None, 0x06010002), SdoReply(2, 10, None))


def test_direct_access_for_a_boot_up_and_its_errors():
    bench = Bench()
    bench.port.download(0x6081, 0, 77)
    assert bench.port.upload(0x6081) == 77
    with pytest.raises(SdoAbort) as refused:
        bench.port.download(0x6041, 0, 1)
    assert refused.value.code == 0x06010002
    bench.cycle.nmt(NmtCommand.STOP, 5)
    with pytest.raises(SdoTimeout):
        bench.port.upload(0x6081)


def test_the_second_axis_answers_at_its_own_objects():
    device = Device(two_axes(), 5)
    ports = [DirectPort(device, 0), DirectPort(device, 1)]
    cycle = DirectCycle(ports)
    for word in (6, 7, 15):
        for _ in range(4):
            cycle.wait_until(cycle.now() + PERIOD)
            ports[1].write(Outputs(controlword=word, sdo=(SdoRequest(1, 0x6081, 0, 99),)))
            cycle.commit()
            cycle.sync()
    cycle.wait_until(cycle.now() + PERIOD)
    assert device.read(0x6881) == 99
    assert device.read(0x6081) == 20_000
    assert state(ports[1].read(cycle.now()).statusword.value) == "operation enabled"
    assert state(ports[0].read(cycle.now()).statusword.value) == "switch on disabled"
    device.drives[1].fault(0x2310)
    cycle.wait_until(cycle.now() + PERIOD)
    assert [emcy.code for emcy in ports[0].read(cycle.now()).emcy] == [0x2310]


def test_emergencies_arrive_once_with_their_stamp():
    bench = Bench().enable()
    bench.device.drive.fault(0x8611, maker_bits=1)
    bench.once()
    assert [(emcy.code, emcy.register, emcy.data) for emcy in bench.inputs.emcy] == [
        (0x8611, 0x21, b"\1\0\0\0\0")
    ]
    assert bench.inputs.emcy[0].stamp == pytest.approx(bench.inputs.now)
    bench.once()
    assert bench.inputs.emcy == ()


def test_a_dead_node_ages_and_its_drive_notices_our_silence():
    bench = Bench(x1016_1=0x7F_0064, x6007=1)  # our heartbeat, within 100 ms
    bench.port.device.nmt_command(NmtCommand.START)
    bench.cycle = DirectCycle([bench.port], heartbeat=0.03)
    bench.enable(3)
    assert bench.inputs.operational
    bench.device.dials.dead = True
    stamp = bench.inputs.statusword.stamp
    bench.once(Outputs(controlword=15), 40)
    assert bench.inputs.statusword.stamp <= stamp + PERIOD + 1e-9
    assert not bench.inputs.operational
    assert state(bench.device.drive.statusword) == "fault"


def test_a_scan_that_dies_is_noticed_by_the_armed_consumer():
    bench = Bench(x1016_1=0x7F_0064, x6007=3, cycle={"heartbeat": 0.03}).enable(3)
    bench.once(Outputs(controlword=15, target_velocity=10_000), 30)
    assert bench.inputs.velocity.value == 10_000
    bench.cycle.wait_until(bench.cycle.now() + 1.0)
    assert state(bench.device.drive.statusword) == "switch on disabled"
    assert bench.device.drive.velocity == 0


def test_nmt_stop_is_obeyed_and_reported():
    bench = Bench(x6007=2).enable()
    bench.once(Outputs(nmt_stop=True))
    bench.once(count=15)
    assert bench.inputs.nmt == 4
    assert not bench.inputs.operational
    assert state(bench.device.drive.statusword) == "switch on disabled"


def test_nodes_may_have_to_be_booted_first():
    device = Device(drive_eds(), 5)
    port = DirectPort(device)
    cycle = DirectCycle([port], operational=False)
    assert port.read(0.0).nmt == -1
    cycle.run(0.3)
    assert port.read(cycle.now()).nmt == 127
    cycle.nmt(NmtCommand.START)
    cycle.run(0.3)
    assert port.read(cycle.now()).operational


def test_quick_stop_all_changes_the_last_controlword_sent():
    bench = Bench(x605A=6).enable(3)
    bench.once(Outputs(controlword=0x0F, target_velocity=20_000), 50)
    bench.cycle.quick_stop_all()
    assert bench.device.drive.controlword == 0x000B
    bench.cycle.wait_until(bench.cycle.now() + 0.5)
    assert state(bench.device.drive.statusword) == "quick stop active"
    assert bench.device.drive.velocity == 0
    untouched = Bench()
    untouched.cycle.quick_stop_all()
    assert untouched.device.drive.controlword == 0  # never commanded: left alone


@pytest.mark.parametrize("call", ["read", "write", "commit", "sync", "heartbeat", "wait"])
def test_each_call_can_be_made_to_fail(call):
    bench = Bench().enable()
    setattr(bench.cycle.dials, call, AdapterError("the adapter is gone"))
    with pytest.raises(AdapterError):
        bench.once(Outputs(controlword=15))
    bench.cycle.quick_stop_all()  # this one never raises


def test_a_closed_bus_sends_nothing_more():
    bench = Bench().enable(3)
    bench.once(Outputs(controlword=15, target_velocity=10_000), 30)
    bench.cycle.close()
    with pytest.raises(AdapterError):
        bench.cycle.commit()
    bench.cycle.wait_until(bench.cycle.now() + 1.0)
    assert bench.device.drive.velocity == 10_000


def test_a_send_that_blocks_and_a_wait_that_is_late_cost_virtual_time():
    bench = Bench(cycle={"dials": CycleFaultSettings(send_blocks=0.5, wait_late=0.2)})
    bench.once()
    assert bench.cycle.now() == pytest.approx(0.01 + 0.2 + 0.5)
    assert bench.cycle.dials.send_blocks == 0.0


def test_inputs_outputs_and_capabilities_can_be_pickled():
    bench = Bench().enable()
    bench.device.drive.fault(0x2310)
    bench.once(Outputs(sdo=(SdoRequest(1, 0x6081, 0, None),)))
    bench.once()
    for value in (bench.inputs, Outputs(controlword=1), bench.port.capabilities):
        assert pickle.loads(pickle.dumps(value)) == value
