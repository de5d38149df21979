"""One simulated node without its frames: axes, dictionary, errors, NMT state, watchdogs, storing and restarting."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from axisbus.cia301.datatypes import Value
from axisbus.cia301.nmt import RESULT, NmtCommand, NmtState
from axisbus.eds.model import Eds
from axisbus.sim.boot_loader import ProgramLoader, has_loader
from axisbus.sim.dictionary import CANNOT_STORE, DEVICE_STATE, INVALID_VALUE, Dictionary, Refused
from axisbus.sim.drive import Drive
from axisbus.sim.fault_injection import NodeFaults
from axisbus.sim.io import IoModule, is_module
from axisbus.sim.modes.catalogue import IMPLEMENTED
from axisbus.sim.motor import MotorParams
from axisbus.sim.node.history import ErrorHistory
from axisbus.sim.node.lss import NO_NODE_ID, LssSlave
from axisbus.sim.node.pdo import PdoTable
from axisbus.sim.node.watchdogs import HeartbeatConsumer, LifeGuard
from axisbus.sim.power import Effort
from axisbus.sim.settings import AXIS_SPAN

HEARTBEAT_LOST = 0x8130
RPDO_LATE = 0x8250
NMT_LEFT = 0x8100
_OPERATIONAL, _INITIALISING = NmtState.OPERATIONAL, NmtState.INITIALISING  # used in every step
SAVE, LOAD = 0x6576_6173, 0x6461_6F6C
_COMMUNICATION = -1  # owner of errors that belong to no axis
_MAX_AXES = 8
_MAX_STEP = 0.02
# Range of objects for a sub-index of 1010h and 1011h (CiA 301 7.5.2.13).
_SCOPE = {1: (0x0000, 0xFFFF), 2: (0x1000, 0x1FFF), 3: (0x6000, 0x9FFF)}
_MAKER_SCOPE = (0x2000, 0x5FFF)
_SERIAL = 0x1018_04
_SPECIMEN_OBJECTS = (
    0x1018_02,
    0x1018_03,
    _SERIAL,
    0x100A_00,
)  # product code, revision, serial number, software version


class Device:
    """A node with one or more axes; holds the state that a restart resets, and the stored parameters, which it keeps."""

    def __init__(
        self,
        eds: Eds,
        node_id: int = 1,
        *,
        axes: int | None = None,
        params: MotorParams | Sequence[MotorParams] | None = None,
        modes: frozenset[int] = IMPLEMENTED,
        dials: NodeFaults | None = None,
        seed: int = 0,
        serial: int | None = None,
    ) -> None:
        """Make a node from its EDS; ``axes`` (up to 8; 0: an I/O module) are counted by their controlwords if None.

        ``params`` is one motor for all axes or one for each. A ``node_id`` of 255 is a node that waits for one by LSS. ``serial``
        replaces the file's 1018h:4, so that several nodes made from one file can be distinguished.
        """
        self.eds = eds
        self.node_id = node_id
        self.dials = dials or NodeFaults()
        self.dictionary = Dictionary(eds, node_id)
        self._eds_values = {
            key: self.dictionary.defaults[key] for key in _SPECIMEN_OBJECTS if key in self.dictionary
        }
        # in place of the values of the EDS
        self._specimen_values: dict[int, Value] = {} if serial is None else {_SERIAL: serial}
        self._apply_specimen_values()
        self.errors = ErrorHistory(_history_length(self.dictionary))
        self.drives = [
            Drive(
                eds,
                node_id,
                number,
                motor,
                dictionary=self.dictionary,
                errors=self.errors,
                modes=modes,
                seed=seed + number,
            )
            for number, motor in enumerate(_motors(params, count_axes(eds) if axes is None else axes))
        ]
        self.io = IoModule(self.dictionary)
        self.pdos = PdoTable(self.dictionary, self.dials)
        self.consumer = HeartbeatConsumer()
        self.life_guard = LifeGuard()
        self.lss = LssSlave(self._address, node_id, self.dials.lss, seed)
        self.loader: ProgramLoader | None = None
        if has_loader(self.dictionary):
            restart = partial(self._reset, whole=True)
            self.loader = ProgramLoader(self.dictionary, self.dials.program, restart)
        self.nmt = NmtState.INITIALISING
        self.time = 0.0
        self.step_hooks: list[
            Callable[[], None]
        ] = []  # called before each step: forces of couplings on its motors
        self.boot_ups = 0  # boot-up messages due since power-on
        self._stored: dict[int, int | float | str | bytes] = {}
        self._restore = False
        self._boot_timer = 0.0
        self._unpowered = False
        self._connect()

    @property
    def drive(self) -> Drive:
        """The first axis; raises IndexError for an I/O module, which has none."""
        return self.drives[0]

    @property
    def operational(self) -> bool:
        """Whether PDOs are exchanged."""
        return self.nmt is _OPERATIONAL

    def step(self, dt: float) -> None:
        """Advance by ``dt`` seconds; a long time is divided into steps."""
        while dt > _MAX_STEP * 1.001:
            self._step(_MAX_STEP)
            dt -= _MAX_STEP
        self._step(dt)

    @property
    def silent(self) -> bool:
        """Whether no frame reaches or leaves the node."""
        return self.dials.dead or self.dials.unpowered

    def _step(self, dt: float) -> None:
        self.time += dt
        if self.dials.unpowered is not self._unpowered:
            self._unpowered = self.dials.unpowered
            self._reset(whole=True)
        for hook in self.step_hooks:
            hook()
        if dt > 0.0:
            for drive in self.drives:
                drive.step(dt)
        if self.node_id == NO_NODE_ID or self._unpowered:
            return  # it stays initialising until it gets a node-ID by LSS
        if self.nmt is _INITIALISING:
            self._boot_timer -= dt
            if self._boot_timer <= 1e-9:
                self.nmt = NmtState.PRE_OPERATIONAL
                self.boot_ups += 1
            return
        if self.loader is not None:
            self.loader.step(dt)
        if self.consumer.overdue(self.time) or self.life_guard.overdue(self.time):
            self.communication_error(HEARTBEAT_LOST)

    def sync(self) -> None:
        """Process a SYNC: every axis latches its cyclic targets."""
        for drive in self.drives:
            drive.sync()

    def power_on(self) -> None:
        """Skip the boot time: pre-operational at once, and every axis out of *not ready to switch on*."""
        self._boot_timer = 0.0
        self.step(0.02)

    def swap(
        self,
        serial: int,
        node_id: int | None = None,
        revision: int | None = None,
        software_version: str | None = None,
        product_code: int | None = None,
    ) -> None:
        """Replace this drive by another one of the same type with factory parameters; it boots if there is a supply.

        ``node_id``: its stored one; 255: it waits for one by LSS; None: as set by switches, that of the present one. Other numbers
        and texts that are None are those of the EDS.
        """
        stored = self.node_id if node_id is None else node_id
        own = zip(_SPECIMEN_OBJECTS, (product_code, revision, serial, software_version), strict=True)
        self._specimen_values = self._eds_values | {key: value for key, value in own if value is not None}
        self._stored, self._restore = {}, False
        self.lss.stored = stored
        self.lss.bit_rate = self.lss.pending_bit_rate = 0
        self.dictionary.renumber(self.eds, stored)
        self._apply_specimen_values()
        self._reset(whole=True)

    def read(self, index: int, subindex: int = 0) -> int:
        """Read an integer as SDO does, without frames; no time passes.

        Raises:
            SdoAbort: the dictionary or a fault setting rejects it.
        """
        self._refuse(index, subindex, writing=False)
        return self.dictionary.read(index, subindex)

    def write(self, index: int, subindex: int, value: int) -> None:
        """Write an integer as SDO does, without frames; no time passes.

        Raises:
            SdoAbort: the dictionary or a fault setting rejects it.
        """
        self._refuse(index, subindex, writing=True)
        self.dictionary.write(index, subindex, value)

    def upload(self, index: int, subindex: int) -> bytes:
        """Read an object's bytes as SDO does, without frames; raises as ``read``."""
        self._refuse(index, subindex, writing=False)
        return self.dictionary.upload(index, subindex)

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object's bytes as SDO does, without frames; raises as ``write``."""
        self._refuse(index, subindex, writing=True)
        self.dictionary.download(index, subindex, data)

    @property
    def answers_sdo(self) -> bool:
        """Whether SDO requests are answered: not while dead, silent, initialising or stopped."""
        dials = self.dials
        silent = self.silent or dials.sdo_silent or self.deaf
        return not silent and self.nmt in (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL)

    @property
    def deaf(self) -> bool:
        """Whether SDO requests are ignored because the boot loader is working."""
        return self.loader is not None and self.loader.deaf

    def _refuse(self, index: int, subindex: int, *, writing: bool) -> None:
        code = self.dials.refusal(index, subindex, writing=writing)
        if code is not None:
            raise self.dictionary.abort("written" if writing else "read", index, subindex, code)

    @property
    def accepts_lss(self) -> bool:
        """Whether it processes LSS requests: always, except while it boots."""
        return self.node_id == NO_NODE_ID or self.nmt is not NmtState.INITIALISING

    def lss_request(self, data: bytes, now: float) -> None:
        """Take an LSS frame received at ``now``; a node without a node-ID boots when it gets one."""
        self.lss.on_frame(data, now)
        if self.node_id == NO_NODE_ID and self.lss.ready:
            self._reset(whole=False)

    def _apply_specimen_values(self) -> None:
        for key, value in self._specimen_values.items():
            if key in self.dictionary:
                self.dictionary.values[key] = self.dictionary.defaults[key] = value

    def _address(self) -> tuple[int, int, int, int]:
        vendor, product, revision, serial = (self.dictionary.get_int(0x1018, part) for part in (1, 2, 3, 4))
        return vendor, product, revision, serial

    def receive_heartbeat(self, node: int) -> None:
        """Process a heartbeat of another node."""
        if self.consumer.beat(node, self.time):
            self.errors.settle(_COMMUNICATION)

    def communication_error(self, code: int) -> None:
        """React to a watchdog: emergency message, NMT state by 1029h, drives by 6007h."""
        self.errors.report(_COMMUNICATION, code)
        reaction = self.dictionary.get_int(0x1029, 1)
        if reaction == 0 and self.operational:
            self.nmt = NmtState.PRE_OPERATIONAL
        elif reaction == 2:
            self.nmt = NmtState.STOPPED
        self.io.fail()
        for drive in self.drives:
            drive.connection_lost(code)

    def communication_restored(self) -> None:
        """Note that the lost heartbeat or RPDO is back."""
        self.errors.settle(_COMMUNICATION)

    def nmt_command(self, command: int) -> None:
        """Execute an NMT command; an unknown one, or one while booting, is ignored."""
        if self.nmt is NmtState.INITIALISING or command not in list(NmtCommand):
            return
        if command in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
            self._reset(whole=command == NmtCommand.RESET_NODE)
            return
        if command == NmtCommand.START and self.dials.start_error:
            self.errors.report(_COMMUNICATION, self.dials.start_error)
            return
        before, self.nmt = self.nmt, RESULT[NmtCommand(command)]
        if self.nmt is NmtState.STOPPED and before is not NmtState.STOPPED:
            self.io.fail()
            for drive in self.drives:
                drive.connection_lost(NMT_LEFT)

    def _reset(self, *, whole: bool) -> None:
        """Restart: stored (or factory) parameters, NMT state *initialising* for a while."""
        if self._restore:
            self._stored, self._restore = {}, False
        node_id = self.lss.restart(whole=whole)
        if node_id != self.node_id:
            self.node_id = node_id
            self.dictionary.renumber(self.eds, node_id)
            self._apply_specimen_values()
        if self.loader is not None and whole:
            self.loader.restarted()
        self.nmt = NmtState.INITIALISING
        self._boot_timer = self.dials.reboot_time
        self.consumer.reset()
        self.life_guard.reset()
        self.errors.clear()
        if whole:
            self.dictionary.load(self._stored)
            for drive in self.drives:
                drive.restart()
            return
        self.dictionary.load(self._stored, 0x1000, 0x1FFF)
        for drive in self.drives:
            drive.connection_lost(NMT_LEFT)

    # Objects of the communication profile.

    def _connect(self) -> None:
        dictionary = self.dictionary
        if dictionary.has(0x1001):
            dictionary.live[0x1001 << 8] = lambda: self.errors.register
        self._connect_history()
        self._connect_watchdogs()
        for subindex in range(1, 128):
            if dictionary.has(0x1010, subindex):
                self._connect_storing(0x1010, subindex)
            if dictionary.has(0x1011, subindex):
                self._connect_storing(0x1011, subindex)

    def _connect_history(self) -> None:
        dictionary, entries = self.dictionary, self.errors
        if not dictionary.has(0x1003):
            return
        dictionary.live[0x1003 << 8] = lambda: len(entries.entries)
        dictionary.check_write(0x1003 << 8, _only_zero)
        dictionary.on_write(0x1003 << 8, lambda _: entries.entries.clear())
        for number in range(entries.capacity):
            dictionary.live[0x1003 << 8 | number + 1] = partial(entries.entry, number)

    def _connect_watchdogs(self) -> None:
        dictionary = self.dictionary
        for subindex in range(1, 128):
            if dictionary.has(0x1016, subindex):
                dictionary.on_write(0x1016 << 8 | subindex, lambda _: self._arm())
        for index in (0x100C, 0x100D):
            dictionary.on_write(index << 8, lambda _: self._arm())
        self._arm()

    def _arm(self) -> None:
        get = self.dictionary.get_int
        self.consumer.configure([get(0x1016, subindex) for subindex in range(1, 128)])
        self.life_guard.configure(get(0x100C), get(0x100D))

    def _connect_storing(self, index: int, subindex: int) -> None:
        key = index << 8 | subindex
        self.dictionary.live[key] = lambda: 1  # stores or restores on command
        self.dictionary.check_write(key, self._check_save if index == 0x1010 else self._check_load)
        if index == 0x1010:
            self.dictionary.on_write(key, lambda value: self._save(value, subindex))
        else:
            self.dictionary.on_write(key, lambda value: self._load(value, key))

    def _check_save(self, value: int) -> None:
        if value != SAVE:
            raise Refused(CANNOT_STORE)
        if any(drive.power.effort is not Effort.OFF for drive in self.drives):
            raise Refused(DEVICE_STATE)

    def _check_load(self, value: int) -> None:
        if value != LOAD:
            raise Refused(CANNOT_STORE)

    def _save(self, value: int, subindex: int) -> None:
        if value != SAVE:
            return  # the value after power-up, not a command
        self.dictionary.values[0x1010 << 8 | subindex] = 1
        low, high = _SCOPE.get(subindex, _MAKER_SCOPE)
        stored = {key: item for key, item in self.dictionary.snapshot().items() if low <= key >> 8 <= high}
        self._stored |= stored
        if self.dials.reboot_on_store:
            self._reset(whole=True)

    def _load(self, value: int, key: int) -> None:
        if value == LOAD:
            self.dictionary.values[key] = 1
            self._restore = True  # valid after the next reset


def count_axes(eds: Eds) -> int:
    """Return the number of axes in a file, by the controlwords at 6040h + n · 800h; at least one, but none of an I/O module."""
    count = 0
    while count < _MAX_AXES and 0x6040 + count * AXIS_SPAN in eds:
        count += 1
    return count or int(not is_module(eds))


def _motors(params: MotorParams | Sequence[MotorParams] | None, axes: int) -> list[MotorParams]:
    if params is None or isinstance(params, MotorParams):
        return [params or MotorParams()] * axes
    return list(params)


def _history_length(dictionary: Dictionary) -> int:
    return sum(dictionary.has(0x1003, subindex) for subindex in range(1, 255)) or 8


def _only_zero(value: int) -> None:
    if value != 0:
        raise Refused(INVALID_VALUE)
