"""The port that presents ip as csp, frame by frame: when bit 4 rises and falls, and which mode it reports."""

from __future__ import annotations

from axisbus.cia402.ip_as_csp import InterpolatedPort, as_csp_capable
from axisbus.cia402.port import Capabilities, Inputs, Outputs, Sample, ValueTransport

ENABLED, ACTIVE = 0x0237, 0x1237
ON, BIT_4, HALT = 0x0F, 0x10, 0x100
PP, HM, IP, CSP = 1, 6, 7, 8


class Drive:
    """The port below: its feedback is set, its outputs are stored."""

    def __init__(self, source: ValueTransport = ValueTransport.SYNC_PDO) -> None:
        outputs = {"controlword": ValueTransport.SYNC_PDO, "target_position": ValueTransport.SYNC_PDO}
        self.capabilities = Capabilities({}, {**outputs, "interpolation_target": source}, True, {})
        self.word, self.mode = ENABLED, IP
        self.got = Outputs()

    def read(self, now: float) -> Inputs:
        word, mode = Sample(self.word, now), Sample(self.mode, now)
        return Inputs(now, True, word, mode, None, None, None, None)

    def write(self, outputs: Outputs) -> None:
        self.got = outputs


class Bench:
    """One cycle after the other."""

    def __init__(self) -> None:
        self.drive = Drive()
        self.port = InterpolatedPort(self.drive)
        self.now = 0.0

    def cycle(
        self, word: int | None = ON, target: int | None = None, mode: int | None = None
    ) -> tuple[int, bool]:
        """Return the mode that is reported to motion, and whether bit 4 was sent."""
        self.now += 0.01
        shown = self.port.read(self.now).mode
        assert shown is not None
        self.port.write(Outputs(word, mode, target))
        got = self.drive.got
        assert got.interpolation_target == got.target_position == target
        return shown.value, bool((got.controlword or 0) & BIT_4)

    def led(self) -> Bench:
        """It interpolates, and moves."""
        self.cycle(target=0, mode=CSP)
        self.drive.word = ACTIVE
        for target in (10, 20, 30):
            assert self.cycle(target=target) == (CSP, True)
        return self


def test_csp_is_commanded_as_ip() -> None:
    bench = Bench()
    bench.cycle(target=0, mode=CSP)
    assert bench.drive.got.mode == IP
    bench.cycle(target=0, mode=PP)
    bench.drive.mode = PP
    for _ in range(5):
        bench.cycle(target=0, mode=PP)
    assert bench.drive.got.mode == PP


def test_bit_4_rises_with_a_target_in_an_enabled_drive_in_ip_alone() -> None:
    bench = Bench()
    assert bench.cycle(target=None, mode=CSP) == (CSP, False)
    bench.drive.word = 0x0233
    assert bench.cycle(target=5) == (CSP, False)
    bench.drive.word = ENABLED
    assert bench.cycle(word=0x07, target=5)[1] is False
    bench.drive.mode = PP
    assert bench.cycle(target=5) == (PP, False)
    bench.drive.mode = IP
    assert bench.cycle(target=5)[1] is True


def test_the_mode_is_csp_once_it_interpolates() -> None:
    bench = Bench()
    bench.cycle(target=5, mode=CSP)
    assert bench.cycle(target=5) == (IP, True)
    bench.drive.word = ACTIVE
    assert bench.cycle(target=5) == (CSP, True)
    assert bench.cycle(target=None) == (CSP, True)  # the last one holds
    bench.drive.word = ENABLED
    bench.cycle(target=6)
    assert bench.cycle(target=7)[0] == IP  # it has stopped on its own


def test_under_halt_a_drive_without_the_bit_is_accepted() -> None:
    bench = Bench().led()
    bench.cycle(word=ON | HALT, target=30)
    bench.drive.word = ENABLED
    assert bench.cycle(word=ON | HALT, target=30) == (CSP, True)


def test_a_drive_at_standstill_gets_the_word_without_the_bit_before_another_mode() -> None:
    for other in (PP, HM):
        bench = Bench().led()
        for _ in range(4):
            bench.cycle(target=30)
        asked = []
        for _ in range(8):
            _, bit = bench.cycle(target=30, mode=other)
            asked.append((bench.drive.got.mode, bit))
        assert asked[0] == (IP, False)
        first = [mode for mode, _ in asked].index(other)
        assert first >= 2
        assert not any(bit for _, bit in asked)


def test_a_moving_drive_keeps_getting_targets_until_it_has_left_the_mode() -> None:
    bench = Bench().led()
    for target in (40, 50, 60):
        assert bench.cycle(target=target, mode=PP) == (CSP, True)
        assert bench.drive.got.mode == PP
    bench.drive.mode = PP
    told = [bench.cycle(target=60, mode=PP) for _ in range(6)]
    assert not any(bit for _, bit in told)
    later = [mode for mode, _ in told].index(PP)
    assert later >= 2  # that many words without bit 4 have gone out before motion may set it
    assert bench.cycle(word=ON | BIT_4, target=99) == (PP, True)  # its own edge


def test_a_drive_that_leaves_the_mode_is_reported_at_once() -> None:
    bench = Bench().led()
    bench.drive.mode = PP
    assert bench.cycle(target=40) == (PP, False)


def test_a_stop_has_no_bit_4() -> None:
    for word in (0x02, 0x00, 0x06, 0x07):
        assert Bench().led().cycle(word=word, target=30)[1] is False
    bench = Bench().led()
    bench.cycle(word=None, target=30)
    assert bench.drive.got.controlword is None


def test_only_a_port_with_transmitted_set_points_is_csp_capable() -> None:
    plain = Drive()
    plain.capabilities.outputs.pop("interpolation_target")
    seen = as_csp_capable({"x": Drive(), "y": plain})
    assert isinstance(seen["x"], InterpolatedPort)
    assert seen["y"] is plain
    assert "interpolation_target" not in seen["x"].capabilities.outputs
    late = InterpolatedPort(Drive(ValueTransport.EVENT_PDO))
    assert late.capabilities.outputs["target_position"] is ValueTransport.EVENT_PDO
