"""Fakes of the CiA 402 slaves of other CANopen stacks, on a python-can channel, each with the structure of its own EDS.

Each fake is written here, after reading the public source of a stack, and reproduces how that stack's slave behaves, its faults
included. It is not that stack. Each class names the project, and whether its EDS is the project's own file, read from the corpus of
EDS files, or a file of the same structure that is generated from a table below.

Theory of operation
-------------------
``ForeignSlave`` is a CANopen node: object dictionary, SDO server, PDOs, NMT and heartbeat. It runs in one thread, which blocks in
``recv`` until the next step of its drive is due, so that it runs in virtual time too. It reads its object dictionary from the text
of its EDS with ``configparser``, not with the reader under test. A subclass has the drive: ``written`` is called after each write
by SDO or RPDO, ``step`` after each period of the drive. ``position`` (increments), ``velocity`` (increments/s) and ``energised``
are the state of the fake itself, which tests judge by.
"""

from __future__ import annotations

import configparser
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import can

from kit.corpus import CORPUS
from kit.sending_device import Talker

NODE = 1
# Data types of CiA 301 table 44: number, bytes, signed.
TYPES = {
    "I8": (2, 1, True),
    "I16": (3, 2, True),
    "I32": (4, 4, True),
    "U8": (5, 1, False),
    "U16": (6, 2, False),
    "U32": (7, 4, False),
    "STR": (9, 0, False),
    "DOM": (15, 0, False),
}
BY_NUMBER = {number: (size, signed) for number, size, signed in TYPES.values()}
ARRAY, RECORD = 8, 9

# SDO abort codes (CiA 301 table 22).
NO_OBJECT, NO_SUBINDEX, READ_ONLY = 0x0602_0000, 0x0609_0011, 0x0601_0002
LENGTH, RANGE, COMMAND, UNSUPPORTED = 0x0607_0010, 0x0609_0030, 0x0504_0001, 0x0601_0000

BOOTED, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0, 4, 5, 127
NMT_COMMANDS = {1: OPERATIONAL, 2: STOPPED, 128: PRE_OPERATIONAL}
RESETS = (129, 130)
INVALID = 1 << 31

# Bits 0 to 6 of the statusword for each state of the power stage (CiA 402-2 table 30).
OFF, READY, SWITCHED_ON, ENABLED, QUICK_STOP, FAULT = 0x40, 0x21, 0x23, 0x27, 0x07, 0x08
PP, PV, HM = 1, 3, 6
HALT, NEW_SET_POINT, AT_ONCE, RELATIVE = 0x100, 0x10, 0x20, 0x40
REACHED, BIT_12, BIT_13 = 0x400, 0x1000, 0x2000
VOLTAGE_AND_REMOTE = 0x210


class Entry(NamedTuple):
    """One sub-object of an EDS."""

    size: int  # bytes; 0: as long as its value
    signed: bool
    access: str
    default: bytes


class SdoRefusal(Exception):
    """The slave answers an SDO request with an abort code."""

    def __init__(self, code: int) -> None:
        super().__init__(hex(code))
        self.code = code


# -- EDS files ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class EdsTable:
    """The structure of an EDS as a table: one object in each line, sub-objects below it.

    A line holds index (and sub-index after a dot), type, access, default, name; ``*`` after the access allows PDO mapping.
    ``ARR`` and ``REC`` begin an array or a record.
    """

    vendor: int
    product: int
    rows: str

    def text(self) -> str:
        """Return the EDS."""
        rows = [line.split(None, 4) for line in self.rows.strip().splitlines()]
        numbers = sorted({row[0].partition(".")[0] for row in rows})
        mandatory = [number for number in numbers if number in ("1000", "1001", "1018")]
        maker = [number for number in numbers if "2000" <= number < "6000"]
        optional = [number for number in numbers if number not in (*mandatory, *maker)]
        return "\n".join(
            [
                "[FileInfo]\nFileName=slave.eds\nFileVersion=1\nFileRevision=1\nEDSVersion=4.0\n",
                f"[DeviceInfo]\nVendorNumber={self.vendor:#x}\nProductNumber={self.product:#x}\nGranularity=8",
                "BaudRate_1000=1\nSimpleBootUpMaster=0\nSimpleBootUpSlave=1\nDynamicChannelsSupported=0",
                f"GroupMessaging=0\nLSS_Supported=0\nNrOfRXPDO={_count(numbers, '14')}",
                f"NrOfTXPDO={_count(numbers, '18')}\n",
                _list("MandatoryObjects", mandatory),
                _list("OptionalObjects", optional),
                _list("ManufacturerObjects", maker),
                *(_section(row, rows) for row in rows),
            ]
        )


def _count(numbers: list[str], start: str) -> int:
    return sum(number.startswith(start) for number in numbers)


def _list(name: str, numbers: list[str]) -> str:
    lines = (f"{place}=0x{number}" for place, number in enumerate(numbers, start=1))
    return "\n".join([f"[{name}]", f"SupportedObjects={len(numbers)}", *lines, ""])


def _section(row: list[str], rows: list[list[str]]) -> str:
    number, kind, access, default, name = row
    head = f"[{number.replace('.', 'sub')}]\nParameterName={name}\n"
    if kind in ("ARR", "REC"):
        subs = sum(other[0].startswith(f"{number}.") for other in rows)
        return f"{head}ObjectType={ARRAY if kind == 'ARR' else RECORD}\nSubNumber={subs}\n"
    value = "" if default == "-" else f"DefaultValue={default}\n"
    mapped = int(access.endswith("*"))
    return (
        f"{head}ObjectType=7\nDataType={TYPES[kind][0]}\nAccessType={access.rstrip('*')}\n"
        f"{value}PDOMapping={mapped}\n"
    )


def read_eds(text: str, node: int) -> dict[tuple[int, int], Entry]:
    """Return the sub-objects of an EDS by index and sub-index."""
    parser = configparser.ConfigParser(strict=False, interpolation=None, comment_prefixes=(";",))
    parser.read_string(text)
    found = {}
    for name in parser.sections():
        number, _, sub = name.partition("sub")
        section = parser[name]
        if _is_hex(number) and len(number) == 4 and "DataType" in section:
            found[int(number, 16), int(sub or "0", 16)] = _entry(section, node)
    return found


def _is_hex(text: str) -> bool:
    return bool(text) and all(letter in "0123456789abcdefABCDEF" for letter in text)


def _entry(section: Mapping[str, str], node: int) -> Entry:
    size, signed = BY_NUMBER.get(int(section["DataType"], 0), (0, False))
    default = section.get("DefaultValue", "")
    if not size:
        return Entry(0, False, section["AccessType"], default.encode())
    value = sum(node if part == "$NODEID" else int(part, 0) for part in default.split("+") if part)
    return Entry(size, signed, section["AccessType"], (value & (1 << 8 * size) - 1).to_bytes(size, "little"))


# -- the node ----------------------------------------------------------------------------------------------------------


class ForeignSlave(Talker):
    """A CANopen node that runs while its block lasts; its subclasses are drives."""

    EDS: EdsTable | str  # a table, or the name of a file of the corpus
    PERIOD = 0.01  # seconds between two steps of the drive

    def __init__(self, channel: str, node: int = NODE) -> None:
        super().__init__(channel)
        self.node = node
        self.entries = read_eds(self.eds_text(), node)
        self.values = {key: entry.default for key, entry in self.entries.items()}
        self.nmt = PRE_OPERATIONAL
        self.position = 0.0
        self.velocity = 0.0
        self.track: list[tuple[float, float, bool]] = []  # seconds, position, energised
        self._segments: list[bytes] = []
        self._waiting: dict[int, bytes] = {}  # synchronous RPDOs, until the next SYNC
        self._sent_at: dict[int, float] = {}

    @classmethod
    def eds_text(cls) -> str:
        """Return the text of its EDS."""
        return cls.EDS.text() if isinstance(cls.EDS, EdsTable) else cls.corpus_file().read_text("latin-1")

    @classmethod
    def corpus_file(cls) -> Path:
        """The path of its EDS in the corpus."""
        assert isinstance(cls.EDS, str)
        return CORPUS / cls.EDS

    @classmethod
    def eds_is_there(cls) -> bool:
        """Whether its EDS is generated here, or the corpus has it."""
        return isinstance(cls.EDS, EdsTable) or cls.corpus_file().is_file()

    # A drive overrides these.

    @property
    def energised(self) -> bool:
        """Whether the motor has power."""
        raise NotImplementedError

    def written(self, index: int, subindex: int) -> None:
        """React to a value that was just written."""

    def check(self, index: int, subindex: int, value: int) -> None:
        """Raise ``SdoRefusal`` if the value may not be written."""

    def refresh(self) -> None:
        """Put the state of the drive into the object dictionary, before it is read."""

    def step(self, dt: float) -> None:
        """Let ``dt`` seconds of motion pass."""

    @property
    def deaf(self) -> bool:
        """Whether the node takes and sends no frames now."""
        return False

    # -- objects -------------------------------------------------------------------------------------------------------

    def get(self, index: int, subindex: int = 0, default: int = 0) -> int:
        """Return a number of the object dictionary, or ``default`` if it has no such object."""
        entry = self.entries.get((index, subindex))
        if entry is None:
            return default
        return int.from_bytes(self.values[index, subindex], "little", signed=entry.signed)

    def put(self, index: int, value: float, subindex: int = 0) -> None:
        """Set a number of the object dictionary, if it has such an object."""
        entry = self.entries.get((index, subindex))
        if entry is not None:
            cut = int(value) & (1 << 8 * entry.size) - 1
            self.values[index, subindex] = cut.to_bytes(entry.size, "little")

    def _download(self, index: int, subindex: int, data: bytes) -> None:
        entry = self._known(index, subindex)
        if entry.access in ("ro", "const"):
            raise SdoRefusal(READ_ONLY)
        if entry.size and len(data) != entry.size:
            raise SdoRefusal(LENGTH)
        if 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00:
            self._check_mapping(index)
        self.check(index, subindex, int.from_bytes(data, "little", signed=entry.signed))
        self.values[index, subindex] = data
        self.written(index, subindex)

    def _check_mapping(self, index: int) -> None:
        if not self.get(index - 0x200, 1) & INVALID:
            raise SdoRefusal(UNSUPPORTED)  # CiA 301 7.5.2.36: the PDO must be invalid

    def _known(self, index: int, subindex: int) -> Entry:
        entry = self.entries.get((index, subindex))
        if entry is None:
            raise SdoRefusal(NO_SUBINDEX if any(key[0] == index for key in self.entries) else NO_OBJECT)
        return entry

    # -- frames --------------------------------------------------------------------------------------------------------

    def _talk(self) -> None:
        self._send(0x700 + self.node, bytes([BOOTED]))
        due = time.monotonic() + self.PERIOD
        while not self._over.is_set():
            frame = None
            if self.deaf:
                time.sleep(max(0.0, due - time.monotonic()))
            else:
                frame = self._bus.recv(max(0.0, due - time.monotonic()))
            while time.monotonic() >= due:
                self._tick(due)
                due += self.PERIOD
            if frame is not None and not frame.is_extended_id:
                self._take(frame.arbitration_id, bytes(frame.data))

    def _tick(self, now: float) -> None:
        self.step(self.PERIOD)
        self.refresh()
        self.track.append((now, self.position, self.energised))
        if self.deaf:
            return
        if self._is_due(0x700, now, self.get(0x1017)):
            self._send(0x700 + self.node, bytes([self.nmt]))
        for number in self._tpdos():
            if self.get(number, 2) >= 254 and self._is_due(number, now, self.get(number, 5)):
                self._send_tpdo(number)

    def _is_due(self, what: int, now: float, milliseconds: int) -> bool:
        if not milliseconds or now - self._sent_at.get(what, 0.0) < milliseconds / 1000.0 - 1e-6:
            return False
        self._sent_at[what] = now
        return True

    def _take(self, can_id: int, data: bytes) -> None:
        if can_id == 0:
            self._nmt_command(data)
        elif can_id == self.get(0x1005, default=0x80) & 0x7FF:
            self._sync()
        elif can_id == 0x600 + self.node and self.nmt != STOPPED:
            self._sdo(data)
        elif self.nmt == OPERATIONAL:
            for number in range(0x1400, 0x1404):
                if (number, 1) in self.entries and self.get(number, 1) & ~0x4000_0000 == can_id:
                    self._receive(number, data)

    def _nmt_command(self, data: bytes) -> None:
        if data[1] not in (0, self.node):
            return
        if data[0] in RESETS:
            self.nmt = PRE_OPERATIONAL
            self._send(0x700 + self.node, bytes([BOOTED]))
        self.nmt = NMT_COMMANDS.get(data[0], self.nmt)

    def _sync(self) -> None:
        if self.nmt != OPERATIONAL:
            return
        waiting, self._waiting = self._waiting, {}
        for number, data in waiting.items():
            self.take_rpdo(number, data)
        for number in self._tpdos():
            if 1 <= self.get(number, 2) <= 240:
                self._send_tpdo(number)

    def _receive(self, number: int, data: bytes) -> None:
        if self.get(number, 2) <= 240:
            self._waiting[number] = data
        else:
            self.take_rpdo(number, data)

    def take_rpdo(self, number: int, data: bytes) -> None:
        """Write the mapped objects, then react to each; too short a PDO is ignored."""
        mapped, at = list(self._mapped(number)), 0
        if len(data) < sum(size for _, _, size in mapped):
            return
        for index, subindex, size in mapped:
            self.values[index, subindex] = data[at : at + size]
            at += size
        for index, subindex, _ in mapped:
            self.written(index, subindex)

    def _mapped(self, number: int) -> Iterator[tuple[int, int, int]]:
        for place in range(1, self.get(number + 0x200) + 1):
            mapped = self.get(number + 0x200, place)
            yield mapped >> 16, mapped >> 8 & 0xFF, (mapped & 0xFF) // 8

    def _tpdos(self) -> Iterator[int]:
        for number in range(0x1800, 0x1804):
            if self.nmt == OPERATIONAL and (number, 1) in self.entries and not self.get(number, 1) & INVALID:
                yield number

    def _send_tpdo(self, number: int) -> None:
        self.refresh()
        data = b"".join(self.values[index, subindex] for index, subindex, _ in self._mapped(number))
        if data:
            self._send(self.get(number, 1) & 0x7FF, data)

    def emcy(self, code: int, register: int) -> None:
        """Send an emergency message."""
        self._send(0x80 + self.node, code.to_bytes(2, "little") + bytes([register, 0, 0, 0, 0, 0]))

    def _send(self, can_id: int, data: bytes) -> None:
        self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    # -- SDO server ----------------------------------------------------------------------------------------------------

    def _sdo(self, data: bytes) -> None:
        index, subindex = int.from_bytes(data[1:3], "little"), data[3]
        serve = {1: self._serve_download, 2: self._serve_upload, 3: self._serve_segment}.get(data[0] >> 5)
        if data[0] >> 5 == 4:
            return  # the client aborts
        try:
            if serve is None:
                raise SdoRefusal(COMMAND)
            answer = serve(data, index, subindex)
        except SdoRefusal as refusal:
            answer = b"\x80" + data[1:4] + refusal.code.to_bytes(4, "little")
        self._send(0x580 + self.node, answer.ljust(8, b"\0"))

    def _serve_download(self, data: bytes, index: int, subindex: int) -> bytes:
        if not data[0] & 2:
            raise SdoRefusal(COMMAND)  # segmented; no object here needs it
        size = 4 - (data[0] >> 2 & 3) if data[0] & 1 else self._known(index, subindex).size
        self._download(index, subindex, data[4 : 4 + size])
        return b"\x60" + data[1:4]

    def _serve_upload(self, data: bytes, index: int, subindex: int) -> bytes:
        self.refresh()
        self._known(index, subindex)
        value = self.values[index, subindex]
        if 1 <= len(value) <= 4:
            return bytes([0x43 | 4 - len(value) << 2]) + data[1:4] + value
        self._segments = [value[at : at + 7] for at in range(0, len(value), 7)] or [b""]
        return b"\x41" + data[1:4] + len(value).to_bytes(4, "little")

    def _serve_segment(self, data: bytes, index: int, subindex: int) -> bytes:
        if not self._segments:
            raise SdoRefusal(COMMAND)
        part = self._segments.pop(0)
        return bytes([data[0] & 0x10 | 7 - len(part) << 1 | (not self._segments)]) + part


def toward(value: float, target: float, step: float) -> float:
    """Return ``value``, changed towards ``target`` by at most ``step``."""
    return min(value + step, target) if value < target else max(value - step, target)


# -- ros2_canopen: canopen_fake_slaves ---------------------------------------------------------------------------------

_SHUTDOWN, _SWITCH_ON, _ENABLE = (0x87, 0x06), (0x8F, 0x07), (0x8F, 0x0F)
_DISABLE_VOLTAGE, _QUICK_STOP = (0x82, 0x00), (0x86, 0x02)
NOT_READY = 0x00
_ENDED = object()


def matches(controlword: int, command: tuple[int, int]) -> bool:
    """Whether a controlword is a command, given as mask and value."""
    return controlword & command[0] == command[1]


class Ros2Slave(ForeignSlave):
    """Fake of the CiA 402 slave of ros2_canopen (``canopen_fake_slaves``), as read in its source.

    EDS: the project's own ``cia402_slave.eds``, from the corpus (the copy of ros_canopen, its predecessor).

    - It starts in *not ready to switch on* and leaves that only with the first controlword. It never sets bits 4 and 9 of the
      statusword.
    - One task runs in each mode. It begins with the first controlword that comes in *operation enabled* after a change of mode, so
      enabling again in the same mode begins none.
    - pp: the task moves to 607Ah whenever that is not the position, and looks at no bit of the controlword: no set-point
      acknowledge, no relative moves, no halt. 6081h and 6083h are read once, when the task begins, and each is used as the other.
      A move once begun ends at its target, whatever the power stage does. 6062h stays 0.
    - pv: the task adds a hundredth of 60FFh to the position as often as the computer can, so the axis is far too fast; 606Ch is
      60FFh and stays so after the task has ended.
    - Homing: begins by itself (the task looks at controlword bit 2), takes 0.1 s, sets 6064h to 0, and repeats. Bits 10 and 12 stay
      set until the next move.
    - A change of mode waits for the end of the running task, and no frame is taken or sent meanwhile.
    - Its tasks for csp and ip are not reproduced.
    """

    EDS = "ros-industrial__cia402vtd_cia402-slave__ros-industrial-ros-canopen.eds"
    STEPS_PER_PERIOD = 100  # of its pv task; a computer does far more
    HOMING_TIME = 0.1

    def __init__(self, channel: str, node: int = NODE) -> None:
        super().__init__(channel, node)
        self.state = NOT_READY
        self.status = 0
        self.controlword = 0
        self.mode = self.old_mode = 0
        self.task: Iterator[None] | None = None
        self.next_task: Callable[[], Iterator[None]] | None = None

    @property
    def energised(self) -> bool:
        return self.state in (ENABLED, QUICK_STOP)

    @property
    def deaf(self) -> bool:
        return self.next_task is not None

    def written(self, index: int, subindex: int) -> None:
        if index == 0x6060:
            self.mode = self.get(0x6060)
            self.put(0x6061, self.mode)
        elif index == 0x6040:
            self.controlword = self.get(0x6040)
            self._command()
            self.put(0x6041, self.status)

    def _command(self) -> None:
        was = self.state
        for command, state in self._TRANSITIONS[self.state]:
            if matches(self.controlword, command):
                self._enter(state)
        if was == ENABLED and self.mode != self.old_mode:
            self.old_mode = self.mode
            tasks = {PP: self._pp, PV: self._pv, HM: self._homing}
            begin = tasks.get(self.mode, lambda: iter(()))
            if self.task is None:
                self.task = begin()
            else:
                self.next_task = begin

    # Commands that each state obeys, in the order of the source, and the state that follows. (0, 0) is any controlword.
    _TRANSITIONS: Mapping[int, tuple[tuple[tuple[int, int], int], ...]] = {
        NOT_READY: (((0, 0), OFF),),
        OFF: ((_SHUTDOWN, READY),),
        READY: ((_DISABLE_VOLTAGE, OFF), (_SWITCH_ON, SWITCHED_ON)),
        SWITCHED_ON: ((_DISABLE_VOLTAGE, OFF), (_SHUTDOWN, READY), (_ENABLE, ENABLED)),
        ENABLED: (
            (_DISABLE_VOLTAGE, OFF),
            (_SHUTDOWN, READY),
            (_SWITCH_ON, SWITCHED_ON),
            (_QUICK_STOP, QUICK_STOP),
        ),
        QUICK_STOP: ((_ENABLE, ENABLED), (_DISABLE_VOLTAGE, OFF)),
    }

    def _enter(self, state: int) -> None:
        self.state = state
        keep = (
            0xFFFF & ~0x4F if state == OFF else 0xFFFF & ~0x6F
        )  # bit 5 stays as it was when it switches off
        self.status = self.status & keep | state

    def step(self, dt: float) -> None:
        if self.task is None or next(self.task, _ENDED) is _ENDED:
            self.task = self.next_task() if self.next_task is not None else None
            self.next_task = None
        self.position = self.get(0x6064)

    def _in(self, mode: int) -> bool:
        return self.state == ENABLED and self.mode == mode

    def _pp(self) -> Iterator[None]:
        top, hardest = self.get(0x6083), self.get(0x6081)
        actual = self.get(0x6064)
        while self._in(PP):
            yield
            target = self.get(0x607A)
            if target != actual:
                self._publish(self.status & ~(BIT_12 | REACHED))
                yield from self._move(actual, target, top, hardest)
                actual = target
                self._publish(self.status & ~BIT_12 | REACHED)

    def _move(self, start: int, target: int, top: float, hardest: float) -> Iterator[None]:
        while not (top and hardest):
            yield  # it computes without numbers and never ends
        began, way = time.monotonic(), target - start
        ramp = min(top / hardest, math.sqrt(abs(way) / hardest))
        whole = abs(way) / (ramp * hardest) + ramp
        while (now := time.monotonic() - began) < whole:
            left = max(0.0, min(ramp, whole - now))
            gone = hardest * (min(now, ramp) ** 2 / 2 + ramp * max(0.0, min(now, whole - ramp) - ramp))
            if now > whole - ramp:
                gone += hardest * (ramp**2 - left**2) / 2
            self.put(0x6064, start + math.copysign(gone, way))
            self.velocity = math.copysign(hardest * min(now, ramp, left), way)
            self.put(0x606C, self.velocity)
            yield
        self.velocity = 0.0
        self.put(0x6064, target)
        self.put(0x606C, 0)

    def _pv(self) -> Iterator[None]:
        while self._in(PV):
            speed = self.get(0x60FF)
            self.velocity = self.STEPS_PER_PERIOD * int(speed / 100) / self.PERIOD
            self.put(0x606C, speed)
            self.put(0x6064, self.get(0x6064) + self.STEPS_PER_PERIOD * int(speed / 100))
            yield
        self.velocity = 0.0

    def _homing(self) -> Iterator[None]:
        while self._in(HM):
            if not self.controlword & 4:
                yield
                continue
            self._publish(self.status | 0x4000)
            for _ in range(round(self.HOMING_TIME / self.PERIOD)):
                yield
            self._publish(self.status & ~0x4000 | REACHED | BIT_12)
            self.put(0x6064, 0)
            self.put(0x606C, 0)

    def _publish(self, status: int) -> None:
        self.status = status
        self.put(0x6041, status)


# -- espp: simulated DS402 node of the CAN bridge example --------------------------------------------------------------

_ESPP = """
1000   U32 ro     0x00020192    Device type
1001   U8  ro     0             Error register
1005   U32 rw     0x80          COB-ID SYNC
1008   STR const  simulated     Device name
1009   STR const  sim           Hardware version
100A   STR const  1.0.0         Software version
1010   ARR -      -             Store parameters
1010.0 U8  ro     1             Number of entries
1010.1 U32 rw     1             All parameters
1011   ARR -      -             Restore parameters
1011.0 U8  ro     1             Number of entries
1011.1 U32 rw     1             All parameters
1017   U16 rw     1000          Producer heartbeat time
1018   REC -      -             Identity
1018.0 U8  ro     4             Number of entries
1018.1 U32 ro     0x1209        Vendor-ID
1018.2 U32 ro     0xC0DE        Product code
1018.3 U32 ro     0x10000       Revision number
1018.4 U32 ro     1             Serial number
1021   DOM ro     -             Store EDS
1022   U16 ro     0             Store format
1200   REC -      -             SDO server
1200.0 U8  ro     2             Number of entries
1200.1 U32 ro     $NODEID+0x600 Client to server
1200.2 U32 ro     $NODEID+0x580 Server to client
1400   REC -      -             RPDO1 communication
1400.0 U8  ro     2             Number of entries
1400.1 U32 ro     $NODEID+0x200 COB-ID
1400.2 U8  ro     255           Transmission type
1600   REC -      -             RPDO1 mapping
1600.0 U8  ro     2             Number of entries
1600.1 U32 ro     0x60400010    Object 1
1600.2 U32 ro     0x60600008    Object 2
1800   REC -      -             TPDO1 communication
1800.0 U8  ro     5             Number of entries
1800.1 U32 ro     $NODEID+0x180 COB-ID
1800.2 U8  ro     255           Transmission type
1800.3 U16 ro     0             Inhibit time
1800.4 U8  ro     0             Reserved
1800.5 U16 rw     100           Event timer
1A00   REC -      -             TPDO1 mapping
1A00.0 U8  ro     2             Number of entries
1A00.1 U32 ro     0x60410010    Object 1
1A00.2 U32 ro     0x60640020    Object 2
2000   U8  rw     0             Provoke a fault
2001   U32 ro     0             Steps
603F   U16 ro*    0             Error code
6040   U16 rw*    0             Controlword
6041   U16 ro*    0             Statusword
605A   I16 rw     2             Quick stop option code
6060   I8  rw*    0             Modes of operation
6061   I8  ro*    0             Modes of operation display
6062   I32 ro*    0             Position demand value
6064   I32 ro*    0             Position actual value
606C   I32 ro*    0             Velocity actual value
6071   I16 rw*    0             Target torque
6077   I16 ro*    0             Torque actual value
607A   I32 rw*    0             Target position
607D   ARR -      -             Software position limit
607D.0 U8  ro     2             Number of entries
607D.1 I32 rw     -1000000      Minimum
607D.2 I32 rw     1000000       Maximum
6081   U32 rw*    1000          Profile velocity
6083   U32 rw*    5000          Profile acceleration
6084   U32 rw*    5000          Profile deceleration
6085   U32 rw     20000         Quick stop deceleration
6098   I8  rw     35            Homing method
60FF   I32 rw*    0             Target velocity
6502   U32 ro     0x2D          Supported drive modes
"""


class EsppSlave(ForeignSlave):
    """Fake of the simulated DS402 node of espp (``can_bridge_example``), as read in its source.

    EDS: generated from the table above, with the objects, access rights and defaults of the dictionary that the source builds.

    - One RPDO (6040h, 6060h) and one TPDO (6041h, 6064h, event-driven) are fixed; everything else goes by SDO.
    - Each RPDO sets the mode again, and that clears bit 12: set-point acknowledge and homing attained last until the next RPDO.
    - 6062h is the target of the move from its first moment on. Homing does not change the target, and neither does a quick stop:
      pp continues to it when it is enabled again. No halt option code; halt leaves bit 10 as it is.
    - Writing 2000h provokes a fault with EMCY FF00h.
    """

    EDS = EdsTable(0x1209, 0xC0DE, _ESPP)
    HOMING_TIME = 0.5
    MODES = 0x2D

    def __init__(self, channel: str, node: int = NODE) -> None:
        super().__init__(channel, node)
        self.state = OFF
        self.mode = 0
        self.target = 0
        self.reached, self.acknowledged, self.attained, self.halted = True, False, False, False
        self.homing_left: float | None = None
        self.last = 0

    @property
    def energised(self) -> bool:
        return self.state in (ENABLED, QUICK_STOP)

    def check(self, index: int, subindex: int, value: int) -> None:
        if index == 0x6060 and value and not (0 < value < 32 and self.MODES >> value - 1 & 1):
            raise SdoRefusal(RANGE)
        if index == 0x605A and not 0 <= value <= 8:
            raise SdoRefusal(RANGE)

    def written(self, index: int, subindex: int) -> None:
        if index == 0x2000 and self.get(0x2000):
            self.state, self.velocity = FAULT, 0.0
            self.emcy(0xFF00, 1)
        elif index == 0x6060:
            self.mode = self.get(0x6060)
            self.acknowledged = self.attained = False
        elif index == 0x6040:
            self._command(self.get(0x6040))

    def take_rpdo(self, number: int, data: bytes) -> None:
        """Take the mode before the controlword, as its source does."""
        self.values[0x6060, 0] = data[2:3]
        self.written(0x6060, 0)
        self.values[0x6040, 0] = data[:2]
        self.written(0x6040, 0)

    def _command(self, word: int) -> None:
        new_bits, self.last = word & ~self.last, word
        if self.state == FAULT:
            if new_bits & 0x80:
                self.state = OFF
                self.emcy(0, 0)
            return
        self.state = self._next_state(word)
        if self.state == ENABLED:
            self._mode_bits(word, bool(new_bits & NEW_SET_POINT))

    def _next_state(self, word: int) -> int:
        state = self.state
        if not word & 2:
            return OFF
        if not word & 4:
            return QUICK_STOP if state in (ENABLED, QUICK_STOP) else OFF
        if not word & 1:
            return state if state == QUICK_STOP else READY
        if not word & 8:
            return SWITCHED_ON if state in (READY, ENABLED) else state
        return state if state == OFF else ENABLED

    def _mode_bits(self, word: int, new: bool) -> None:
        if self.mode in (PP, PV):
            self.halted = bool(word & HALT)
        if self.mode == PP:
            if new:
                wanted = self.get(0x607A) + (int(self.position) if word & RELATIVE else 0)
                self.target = max(self.get(0x607D, 1), min(self.get(0x607D, 2), wanted))
                self.reached, self.acknowledged = False, True
            if not word & NEW_SET_POINT:
                self.acknowledged = False
        elif self.mode == HM and new and not self.attained:
            self.homing_left, self.reached = self.HOMING_TIME, False

    def refresh(self) -> None:
        twelve = {PP: self.acknowledged, PV: abs(self.velocity) < 0.5, HM: self.attained}.get(
            self.mode, False
        )
        self.put(0x6041, self.state | VOLTAGE_AND_REMOTE | REACHED * self.reached | BIT_12 * twelve)
        self.put(0x6061, self.mode)
        self.put(0x6062, self.target)
        self.put(0x6064, self.position)
        self.put(0x606C, self.velocity)
        self.put(0x1001, self.state == FAULT)
        self.put(0x603F, 0xFF00 if self.state == FAULT else 0)

    def step(self, dt: float) -> None:
        if self.state == QUICK_STOP:
            self._coast(toward(self.velocity, 0.0, max(1, self.get(0x6085)) * dt), dt)
            if self.velocity == 0.0 and self.get(0x605A) <= 4:
                self.state = OFF
        elif self.state != ENABLED:
            self.velocity = 0.0
        elif self.mode == PP:
            self._step_pp(dt)
        elif self.mode == PV:
            target = 0 if self.halted else self.get(0x60FF)
            self._coast(self._ramped(target, dt), dt)
            self.reached = self.velocity == target
        elif self.mode == HM:
            self._step_homing(dt)
        else:
            self._coast(self._ramped(0, dt), dt)

    def _ramped(self, target: float, dt: float) -> float:
        faster = abs(target) > abs(self.velocity)
        return toward(self.velocity, target, max(1, self.get(0x6083 if faster else 0x6084)) * dt)

    def _coast(self, velocity: float, dt: float) -> None:
        self.velocity = velocity
        self.position += velocity * dt

    def _step_pp(self, dt: float) -> None:
        left = self.target - self.position
        if self.halted or abs(left) < 0.5:
            self.velocity = self._ramped(0.0, dt)
            if self.velocity == 0.0 and not self.halted:
                self.position, self.reached = float(self.target), True
            return
        braking = self.velocity**2 / (2 * max(1, self.get(0x6084)))
        wanted = 0.0 if abs(left) <= braking else math.copysign(self.get(0x6081), left)
        self.velocity = self._ramped(wanted, dt)
        if abs(self.velocity * dt) >= abs(left):
            self.position, self.velocity, self.reached = float(self.target), 0.0, True
        else:
            self.position += self.velocity * dt

    def _step_homing(self, dt: float) -> None:
        if self.homing_left is None:
            return
        self.homing_left -= dt
        if self.homing_left <= 1e-9:
            self.homing_left = None
            self.attained = self.reached = True
            self.position = self.velocity = 0.0


# -- canworks: the drive model of its simulator ------------------------------------------------------------------------

_CANWORKS = """
1000   U32 ro     0x00020192    Device type
1001   U8  ro     0             Error register
1005   U32 rw     0x80          COB-ID SYNC
1008   STR const  SD-402        Device name
1014   U32 rw     $NODEID+0x80  COB-ID EMCY
1017   U16 rw     0             Producer heartbeat time
1018   REC -      -             Identity
1018.0 U8  ro     4             Number of entries
1018.1 U32 ro     0x00F0F402    Vendor-ID
1018.2 U32 ro     0x402         Product code
1018.3 U32 ro     0x10000       Revision number
1018.4 U32 ro     0             Serial number
1200   REC -      -             SDO server
1200.0 U8  ro     2             Number of entries
1200.1 U32 ro     $NODEID+0x600 Client to server
1200.2 U32 ro     $NODEID+0x580 Server to client
603F   U16 ro*    0             Error code
6040   U16 rww*   0             Controlword
6041   U16 ro*    0             Statusword
6060   I8  rww*   0             Modes of operation
6061   I8  ro*    0             Modes of operation display
6064   I32 ro*    0             Position actual value
606C   I32 ro*    0             Velocity actual value
6071   I16 rww*   0             Target torque
6077   I16 ro*    0             Torque actual value
607A   I32 rww*   0             Target position
6081   U32 rww*   1000          Profile velocity
6083   U32 rw     10000         Profile acceleration
6084   U32 rw     10000         Profile deceleration
6098   I8  rw     35            Homing method
6099   ARR -      -             Homing speeds
6099.0 U8  ro     2             Number of entries
6099.1 U32 rw     500           To the switch
6099.2 U32 rw     100           To zero
609A   U32 rw     10000         Homing acceleration
60FF   I32 rww*   0             Target velocity
6502   U32 ro     0x25          Supported drive modes
"""
_CANWORKS_RPDOS = ((0x60400010, 0x60600008), (0x607A0020, 0x60810020), (0x60FF0020,), (0x60710010,))
_CANWORKS_TPDOS = ((0x60410010, 0x60610008), (0x60640020,), (0x606C0020,), (0x60770010,))


def _canworks_pdos() -> str:
    """Return the rows of four RPDOs and four TPDOs, all of them free to map."""
    rows = []
    for first, cob_id, pdos in ((0x1400, 0x200, _CANWORKS_RPDOS), (0x1800, 0x180, _CANWORKS_TPDOS)):
        for number, mapped in enumerate(pdos):
            communication, mapping = first + number, first + 0x200 + number
            sends = first == 0x1800
            rows += [
                f"{communication:04X} REC - - Communication",
                f"{communication:04X}.0 U8 ro {5 if sends else 2} Number of entries",
                f"{communication:04X}.1 U32 rw $NODEID+{cob_id + 0x100 * number:#x} COB-ID",
                f"{communication:04X}.2 U8 rw 255 Transmission type",
                *(
                    [
                        f"{communication:04X}.3 U16 rw 0 Inhibit time",
                        f"{communication:04X}.5 U16 rw 50 Event timer",
                    ]
                    * sends
                ),
                f"{mapping:04X} REC - - Mapping",
                f"{mapping:04X}.0 U8 rw {len(mapped)} Number of entries",
                *(
                    f"{mapping:04X}.{place + 1} U32 rw {(*mapped, *[0] * 8)[place]:#010x} Object"
                    for place in range(8)
                ),
            ]
    return "\n".join(rows)


class CanworksSlave(ForeignSlave):
    """Fake of the simulated CiA 402 drive of canworks with its example ``servo402.eds``, as read in its source.

    EDS: generated from the table above, with the objects, access rights and defaults of that example: no 6062h, no option codes, no
    6085h, no 6065h.

    - The controlword is looked at every 10 ms. A relative set-point counts from the last target.
    - A set-point without bit 5 waits while a move is not at its end, under halt too, and bit 12 stays set while it waits.
    - The axis follows its demand with a lag. Only transitions of CiA 402 count; fault reset outside of a fault is no command.
    """

    EDS = EdsTable(0xF0F402, 0x402, _CANWORKS.rstrip() + "\n" + _canworks_pdos())
    TOP_SPEED, TOP_ACCELERATION = 100_000.0, 1_000_000.0
    LAG = 0.005  # seconds
    STOPPED_BELOW = 1.0  # increments/s

    def __init__(self, channel: str, node: int = NODE) -> None:
        super().__init__(channel, node)
        self.state = OFF
        self.mode = 0
        self.last = 0
        self.demand = self.demand_speed = self.target = 0.0
        self.moving, self.acknowledged, self.homed, self.homing_failed = False, False, False, False
        self.waiting: float | None = None

    @property
    def energised(self) -> bool:
        return self.state in (ENABLED, QUICK_STOP)

    @property
    def stopped(self) -> bool:
        """Whether the axis and its demand are at standstill."""
        return self.demand_speed == 0.0 and abs(self.velocity) < self.STOPPED_BELOW

    def step(self, dt: float) -> None:
        word = self.get(0x6040)
        new_bits, self.last = word & ~self.last, word
        self._command(word)
        self._take_mode()
        if self.state == ENABLED:
            {PP: self._pp, PV: self._pv, HM: self._homing}.get(self.mode, self._no_mode)(word, new_bits, dt)
        elif self.state == QUICK_STOP:
            self._brake(self._limit(0x6085), dt)
        self._follow(dt)
        self.put(0x6041, self._status(word))

    def refresh(self) -> None:
        self.put(0x6061, self.mode)
        self.put(0x6064, round(self.position))
        self.put(0x606C, round(self.velocity))

    # Commands that each state obeys, and the state that follows; the first match counts.
    _TRANSITIONS: Mapping[int, tuple[tuple[tuple[int, int], int], ...]] = {
        OFF: (((0x07, 0x06), READY),),
        READY: (((0x02, 0), OFF), ((0x06, 2), OFF), ((0x0F, 7), SWITCHED_ON), ((0x0F, 0xF), ENABLED)),
        SWITCHED_ON: (((0x02, 0), OFF), ((0x06, 2), OFF), ((0x07, 6), READY), ((0x0F, 0xF), ENABLED)),
        ENABLED: (((0x02, 0), OFF), ((0x06, 2), QUICK_STOP), ((0x07, 6), READY), ((0x0F, 7), SWITCHED_ON)),
        QUICK_STOP: (((0x02, 0), OFF),),
    }

    def _command(self, word: int) -> None:
        if word & 0x80:
            return
        was = self.state
        for command, state in self._TRANSITIONS[was]:
            if matches(word, command):
                self.state = state
                break
        if was == QUICK_STOP == self.state and self.stopped:
            self.state = OFF
        if was != self.state == ENABLED:
            self._forget_moves()
            self.demand, self.demand_speed = self.position, 0.0
        if self.state == QUICK_STOP:
            self._forget_moves(self.target)

    def _forget_moves(self, target: float | None = None) -> None:
        self.target = self.position if target is None else target
        self.moving, self.acknowledged, self.waiting = False, False, None

    def _take_mode(self) -> None:
        mode = self.get(0x6060)
        if mode == self.mode or mode not in (PP, PV, HM):
            return
        if PV in (mode, self.mode):
            self.demand_speed = self.velocity
        self.mode = mode
        self.demand = self.position
        self._forget_moves()

    def _limit(self, index: int) -> float:
        wanted = self.get(index)
        return min(wanted, self.TOP_ACCELERATION) if wanted > 0 else self.TOP_ACCELERATION

    def _pp(self, word: int, new_bits: int, dt: float) -> None:
        if new_bits & NEW_SET_POINT:
            wanted = self.get(0x607A) + (self.target if word & RELATIVE else 0)
            if word & AT_ONCE or not self.moving:
                self.target, self.moving, self.waiting = wanted, True, None
            else:
                self.waiting = wanted
            self.acknowledged = True
        if not word & NEW_SET_POINT:
            self.acknowledged = False
        if word & HALT or not self.moving:
            self._brake(self._limit(0x6084), dt)
        elif self._arrived(dt):
            self.moving = self.waiting is not None
            if self.waiting is not None:
                self.target, self.waiting = self.waiting, None

    def _arrived(self, dt: float) -> bool:
        left = self.target - self.demand
        if abs(left) < 1e-9 and abs(self.demand_speed) < 1e-9:
            self.demand, self.demand_speed = self.target, 0.0
            return True
        top = min(self.get(0x6081) or self.TOP_SPEED, self.TOP_SPEED)
        speed = math.copysign(min(top, math.sqrt(2 * self._limit(0x6084) * abs(left))), left)
        self._ramp(speed, self._limit(0x6083), self._limit(0x6084), dt)
        following = self.demand + self.demand_speed * dt
        if (self.target - following) * left <= 0 and self.demand_speed * left >= 0:
            self.demand, self.demand_speed = self.target, 0.0
            return True
        self.demand = following
        return False

    def _ramp(self, target: float, faster: float, slower: float, dt: float) -> None:
        speeds_up = abs(target) > abs(self.demand_speed) and target * self.demand_speed >= 0
        self.demand_speed = toward(self.demand_speed, target, (faster if speeds_up else slower) * dt)

    def _brake(self, deceleration: float, dt: float) -> None:
        self._ramp(0.0, deceleration, deceleration, dt)
        self.demand = self.position if self.mode == PV else self.demand + self.demand_speed * dt

    def _pv(self, word: int, new_bits: int, dt: float) -> None:
        target = 0.0 if word & HALT else self._wanted_speed()
        self._ramp(target, self._limit(0x6083), self._limit(0x6084), dt)
        self.demand = self.position

    def _wanted_speed(self) -> float:
        return max(-self.TOP_SPEED, min(self.TOP_SPEED, float(self.get(0x60FF))))

    def _homing(self, word: int, new_bits: int, dt: float) -> None:
        if new_bits & NEW_SET_POINT and not word & HALT:
            self.homed = self.get(0x6098) in (33, 34, 35, 37)
            self.homing_failed = not self.homed  # its searches for switches are not reproduced here
            if self.homed:
                self.position = self.demand = self.target = self.velocity = self.demand_speed = 0.0
        else:
            self._brake(self._limit(0x609A), dt)

    def _no_mode(self, word: int, new_bits: int, dt: float) -> None:
        self._brake(self._limit(0x6085), dt)

    def _follow(self, dt: float) -> None:
        share, hardest = 1 - math.exp(-dt / self.LAG), self.TOP_ACCELERATION * dt
        if not self.energised:
            speed = toward(self.velocity, 0.0, hardest)
        elif self.mode == PV:
            speed = self.velocity + (self.demand_speed - self.velocity) * share
        else:
            speed = (self.demand - self.position) * share / dt
        self.velocity += max(-hardest, min(hardest, speed - self.velocity))
        self.position += self.velocity * dt
        if not self.energised or self.mode == PV:
            self.demand = self.position
            self.demand_speed *= self.energised
        elif abs(self.demand - self.position) < 1e-3 and self.demand_speed == 0.0:
            self.position, self.velocity = self.demand, 0.0

    def _status(self, word: int) -> int:
        status = self.state | VOLTAGE_AND_REMOTE
        if self.state == QUICK_STOP:
            return status | REACHED * self.stopped
        if self.state != ENABLED:
            return status
        halted = bool(word & HALT)
        if self.mode == PP:
            there = not self.moving and self.waiting is None and abs(self.target - self.position) <= 0.5
            reached, twelve = (
                self.stopped if halted else there,
                self.acknowledged or self.waiting is not None,
            )
        elif self.mode == PV:
            reached = self.stopped if halted else abs(self.velocity - self._wanted_speed()) <= 10
            twelve = abs(self.velocity) <= 10
        else:
            reached, twelve = self.stopped, self.homed
        thirteen = self.mode == HM and self.homing_failed
        return status | REACHED * reached | BIT_12 * twelve | BIT_13 * thirteen


# -- modm-canopen: the CiA 402 device of its example -------------------------------------------------------------------


class ModmSlave(ForeignSlave):
    """Fake of the CiA 402 device of modm-canopen (``cia402-test``), as read in its source.

    EDS: the project's own ``test.eds``, from the corpus.

    - It is a power stage and a check of the mode, without a motor: the position stays 0. 6502h claims pp, vl, pv, tq, hm and ip,
      but the EDS has neither 6081h nor 6098h.
    - It ignores a controlword that skips a state. Only *enable operation* leaves *quick stop active*.
    - SYNC is at 80h, whatever 1005h says at first.
    """

    EDS = "generic__test__javask-modm-canopen.eds"
    MODES = 0xE000_006F
    _COMMANDS = (  # mask and value of the controlword, the states that obey it, the state that follows
        (_SHUTDOWN, (OFF, SWITCHED_ON, ENABLED), READY),
        (_SWITCH_ON, (READY, ENABLED), SWITCHED_ON),
        (_DISABLE_VOLTAGE, (READY, SWITCHED_ON, ENABLED), OFF),
        (_ENABLE, (SWITCHED_ON, QUICK_STOP), ENABLED),
        (_QUICK_STOP, (ENABLED,), QUICK_STOP),
    )

    def __init__(self, channel: str, node: int = NODE) -> None:
        super().__init__(channel, node)
        self.state = OFF
        self.put(0x1000, 0x20192)
        self.put(0x1005, 0x80)
        self.put(0x6502, self.MODES)

    @property
    def energised(self) -> bool:
        return self.state in (ENABLED, QUICK_STOP)

    def check(self, index: int, subindex: int, value: int) -> None:
        if index == 0x6060 and value and not (value > 0 and self.MODES >> value - 1 & 1):
            raise SdoRefusal(RANGE)

    def written(self, index: int, subindex: int) -> None:
        if index == 0x6040:
            word = self.get(0x6040)
            for command, sources, state in self._COMMANDS:
                if matches(word, command) and self.state in sources:
                    self.state = state
                    break
        self.put(0x6061, self.get(0x6060))
        self.put(0x6041, self.state)


# -- ZLAC8015D simulator ----------------------------------------------------------------------------------------------


class Zlac8015dSlave(ForeignSlave):
    """Fake of the simulator of the motor controller ZLAC8015D (kaver06), as read in its source.

    EDS: the project's own ``zlac8015d.eds``, from the corpus. It has two motors, each in a sub-index of 6064h, 607Ah and others,
    and neither RPDOs nor 6061h. The master refuses such an EDS, so the motors are not reproduced: this fake only counts the frames
    that it hears.
    """

    EDS = "zltech__zlac8015d__kaver06-zlac8015d-canopen-.eds"
    energised = False

    def __init__(self, channel: str, node: int = NODE) -> None:
        super().__init__(channel, node)
        self.heard = 0

    def _take(self, can_id: int, data: bytes) -> None:
        self.heard += 1
        super()._take(can_id, data)


SLAVES: Mapping[str, type[ForeignSlave]] = {
    "ros2_canopen": Ros2Slave,
    "espp": EsppSlave,
    "canworks": CanworksSlave,
    "modm-canopen": ModmSlave,
    "ZLAC8015D": Zlac8015dSlave,
}
DRIVES = ("ros2_canopen", "espp", "canworks", "modm-canopen")  # a master of CiA 402 drives can use these
