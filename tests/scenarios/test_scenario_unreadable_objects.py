"""Slaves with one object that cannot be read: its answer is garbled, or missing. All other objects are served.

The slaves are fakes (kit/foreign_slaves.py) with one fault each.
"""

from __future__ import annotations

import itertools
import os
import time
from pathlib import Path

import pytest

from axisbus.machine.machine import Machine
from kit.foreign_slaves import CanworksSlave, EdsTable, SdoRefusal

_CHANNELS = itertools.count(1)
NAME, SPEED = 0x1008, 0x6081
CELL = """\
[bus]
interface = "virtual"
channel = "{channel}"
scan_period = "10ms"
heartbeat = "100ms"
[nodes.1]
eds = "{eds}"
[axes.x]
node = 1
unit = "mm"
scale = 1000
max_velocity = 20.0
max_acceleration = 50.0
"""


class Faulty(CanworksSlave):
    """Serves all objects but ``broken``."""

    broken = NAME
    text = b"A slave"

    def __init__(self, channel: str) -> None:
        super().__init__(channel)
        if (NAME, 0) in self.values:
            self.values[NAME, 0] = self.text


class AnnouncesLess(Faulty):
    """Announces 4 octets and sends 7 or more."""

    size = 4

    def _serve_upload(self, data: bytes, index: int, subindex: int) -> bytes:
        answer = super()._serve_upload(data, index, subindex)
        if index != self.broken:
            return answer
        self._segments = [b"garbled", b"garbled"]
        return b"\x41" + data[1:4] + self.size.to_bytes(4, "little")


class AnnouncesMore(AnnouncesLess):
    """Announces 64 octets and sends 14."""

    size = 64


class Mute(Faulty):
    """Does not answer for its broken object."""

    def _sdo(self, data: bytes) -> None:
        if int.from_bytes(data[1:3], "little") != self.broken:
            super()._sdo(data)


class MuteForUnknown(Faulty):
    """Does not answer for objects that it does not have."""

    def _sdo(self, data: bytes) -> None:
        try:
            if data[0] >> 5 in (1, 2):
                self._known(int.from_bytes(data[1:3], "little"), data[3])
        except SdoRefusal:
            return
        super()._sdo(data)


class Unsized(Faulty):
    """Sends up to 4 octets without their number, and has an object of its vendor."""

    EDS = EdsTable(
        CanworksSlave.EDS.vendor,
        CanworksSlave.EDS.product,
        CanworksSlave.EDS.rows + "\n2001   U16 rw     5             Gain",
    )

    def _serve_upload(self, data: bytes, index: int, subindex: int) -> bytes:
        answer = super()._serve_upload(data, index, subindex)
        return b"\x42" + answer[1:] if answer[0] & 2 else answer


class Late(Faulty):
    """Answers for its broken object when the master no longer waits."""

    def _sdo(self, data: bytes) -> None:
        late = int.from_bytes(data[1:3], "little") == self.broken
        if late and data[0] >> 5 == 2:
            self._over.wait(0.6)
        super()._sdo(data)


each_fault = pytest.mark.parametrize("kind", [AnnouncesLess, AnnouncesMore, Mute])


@pytest.fixture
def put(tmp_path, monkeypatch):
    """A function that puts a slave on a bus and returns the options that reach it and the path of its cell file."""
    with monkeypatch.context() as patch:
        running = []

        def begin(
            kind: type[Faulty], broken: int = NAME, text: bytes = b"A slave"
        ) -> tuple[tuple[str, ...], Path]:
            patch.setattr(kind, "broken", broken)
            patch.setattr(kind, "text", text)
            channel = f"axisbus-unreadable-{os.getpid()}-{next(_CHANNELS)}"
            eds, cell = tmp_path / "slave.eds", tmp_path / "cell.toml"
            eds.write_text(kind.eds_text(), encoding="latin-1")
            cell.write_text(CELL.format(channel=channel, eds=eds.name))
            running.append(kind(channel).__enter__())
            return ("-i", "virtual", "-c", channel), cell

        yield begin
        for slave in running:
            slave.__exit__()


# -- values without their size -----------------------------------------------------------------------------------------


def test_a_backup_of_a_device_that_does_not_send_sizes_does_not_differ_from_it(put, axisbus, tmp_path):
    bus, _ = put(Unsized, broken=0)
    target = tmp_path / "made.dcf"
    assert axisbus("config", "backup", *bus, "1", "--eds", tmp_path / "slave.eds", "-o", target).code == 0
    assert "ParameterValue=5\n" in target.read_text()
    code, out, _ = axisbus("config", "diff", *bus, target, "1")
    assert (code, "2001h" in out) == (0, False), out
    code, out, _ = axisbus("config", "restore", *bus, target, "1", "--dry-run")
    assert code == 0
    assert "0 have another value" in out


# -- a name that cannot be read ----------------------------------------------------------------------------------------


@each_fault
def test_a_name_that_cannot_be_read_stops_neither_boot_nor_power(put, kind):
    _, cell = put(kind)
    with Machine.open(cell) as machine:
        machine["x"].enable().wait(5)
        machine["x"].disable().wait(5)


@each_fault
def test_an_unreadable_device_name_leaves_the_other_identity_objects(put, axisbus, kind, tmp_path):
    bus, _ = put(kind)
    found = axisbus("scan", *bus)
    assert found.code == 0
    assert "402" in found.out
    for command in (
        ("eds", "from-device", *bus, "1", "-o", tmp_path / "made.eds"),
        ("config", "backup", *bus, "1", "--eds", tmp_path / "slave.eds", "-o", tmp_path / "made.dcf"),
    ):
        assert axisbus(*command).code == 0, command
    assert "[6041]" in (tmp_path / "made.eds").read_text()


@pytest.mark.parametrize(
    ("text", "written"),
    [
        (b"SERVO 50/5      ", "SERVO 50/5"),
        ("F\xf6rderband".encode("latin-1"), "F?rderband"),
        (b"V1.2\r\n", "V1.2"),
        (b"\x1b[31mred", "?[31mred"),
        (b"\xff" * 8, "????????"),
    ],
)
def test_an_eds_is_made_of_a_device_with_any_name(put, axisbus, tmp_path, text, written):
    bus, _ = put(Faulty, broken=0, text=text)
    target = tmp_path / "made.eds"
    assert axisbus("eds", "from-device", *bus, "1", "-o", target).code == 0
    assert f"DefaultValue={written}\n" in target.read_text("ascii")
    assert axisbus("eds", "check", target).code == 0


# -- objects that the drive does not have ------------------------------------------------------------------------------


def test_a_drive_that_is_silent_for_objects_that_it_does_not_have_is_booted_and_enabled(put):
    _, cell = put(MuteForUnknown, broken=0)
    began = time.monotonic()
    with Machine.open(cell) as machine:
        assert time.monotonic() - began < 60.0
        text = machine.reports[0].text()
        assert "605Dh missing" in text
        assert "heartbeat" in text
        machine["x"].enable().wait(5)
        machine["x"].move_absolute(0.5, velocity=1.0, acceleration=5.0).wait(10)
        machine["x"].disable().wait(5)


# -- any other object --------------------------------------------------------------------------------------------------


@each_fault
def test_all_objects_but_the_broken_one_are_dumped(put, axisbus, kind, tmp_path):
    bus, _ = put(kind, broken=SPEED)
    code, out, _ = axisbus("od", "dump", *bus, "1", "--eds", tmp_path / "slave.eds")
    assert code == 0
    (broken,) = [line for line in out.splitlines() if line.startswith("6081h")]
    assert "does not answer for it" in broken if kind is Mute else "not a value" in broken
    assert any(line.startswith("6083h") and "=" in line for line in out.splitlines())


@each_fault
def test_an_eds_is_verified_but_for_the_broken_object(put, axisbus, kind, tmp_path):
    bus, _ = put(kind, broken=SPEED)
    code, out, _ = axisbus("eds", "verify", *bus, tmp_path / "slave.eds", "1")
    assert code == 1  # an entry that was not read does not agree
    assert "6081h" in out
    assert "could not be read" in out
    assert "6083h" not in out


@each_fault
def test_a_backup_without_the_broken_object_does_not_differ_from_its_device(put, axisbus, kind, tmp_path):
    bus, _ = put(kind, broken=SPEED)
    target = tmp_path / "made.dcf"
    code, out, _ = axisbus("config", "backup", *bus, "1", "--eds", tmp_path / "slave.eds", "-o", target)
    assert code == 0
    assert "left out: 6081h" in out
    assert axisbus("config", "diff", *bus, target, "1").code == 0
    text = target.read_text()
    begin = text.index("[6083]")
    target.write_text(text[:begin] + text[begin:].replace("ParameterValue=", "ParameterValue=1", 1))
    assert axisbus("config", "diff", *bus, target, "1").code == 1  # a value of the backup still counts


@each_fault
def test_a_restore_writes_the_others_and_names_the_broken_object(put, axisbus, kind, tmp_path):
    bus, _ = put(Faulty, broken=0)
    target = tmp_path / "made.dcf"
    eds = ("--eds", tmp_path / "slave.eds")
    assert axisbus("config", "backup", *bus, "1", *eds, "-o", target).code == 0
    text = target.read_text()
    for section in ("[6081]", "[6083]"):
        begin = text.index(section)
        text = text[:begin] + text[begin:].replace("ParameterValue=", "ParameterValue=1", 1)
    target.write_text(text)  # 110000 instead of 10000
    bus, _ = put(kind, broken=SPEED)
    code, out, _ = axisbus("config", "restore", *bus, target, "1")
    assert "6081h" in out
    assert "restored  6083h" in out
    assert axisbus("od", "read", *bus, "1:6083", *eds).out.split("=")[1].split()[0] == "110000"
    assert (code == 0) is (kind is not Mute)  # a write that gets no answer has failed


# -- silence that says something ---------------------------------------------------------------------------------------


def test_an_eds_is_made_of_a_device_that_is_silent_for_objects_that_it_does_not_have(put, axisbus, tmp_path):
    bus, _ = put(MuteForUnknown)
    target = tmp_path / "made.eds"
    assert axisbus("eds", "from-device", *bus, "1", "-o", target).code == 0
    text = target.read_text()
    assert "[6041]" in text
    assert "[60B8]" not in text


def test_silence_about_one_object_is_not_blamed_on_the_wiring(put, axisbus):
    bus, _ = put(MuteForUnknown)
    code, _, err = axisbus("od", "read", *bus, "1:2FFF", "--type", "U16")
    assert code != 0
    assert "but not for this one" in err
    assert "wiring" not in err


def test_a_node_that_answers_for_no_object_is_still_an_error(put, axisbus, tmp_path):
    bus, _ = put(Faulty, broken=0)
    other = ("eds", "from-device", *bus, "2", "-o", tmp_path / "none.eds")
    assert axisbus(*other).code != 0
    assert not (tmp_path / "none.eds").exists()


def test_a_late_answer_is_reported_as_late(put, axisbus):
    bus, _ = put(Late, broken=SPEED)
    code, _, err = axisbus("od", "read", *bus, "1:6081", "--type", "U32")
    assert code != 0
    assert "for this object came after 0.5 s" in err
    assert "another request" not in err
