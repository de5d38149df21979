"""The contents of a cell file as frozen values: as written, with times in seconds and the line of each entry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

from axisbus.cia301.cob import SYNC, TIME
from axisbus.drives.plugin import DrivePlugin
from axisbus.errors import StateError, UnknownNameError
from axisbus.toml.tables import SourceLocation as SourceLocation
from axisbus.units import INCREMENTS as INCREMENTS

SIMULATED = "sim"  # the interface of a cell with simulated drives
CANOPEN = "canopen"  # the protocol of a node that names no other


@dataclass(frozen=True, slots=True)
class ObjectSetting:
    """A value to write into an object at boot; ``key`` as written: an index with or without sub-index, or a name."""

    key: str
    value: int | float | str
    line: int
    table: str


@dataclass(frozen=True, slots=True)
class PdoConfig:
    """One configured PDO; ``number`` from 1, times in seconds, None to keep the drive's own value.

    ``rtr`` is the period in seconds in which the master asks for a TPDO by remote frames, None to ask never.
    """

    receive: bool
    number: int
    map: tuple[str, ...] | None = None
    transmission: int | None = None
    event_timer: float | None = None
    inhibit_time: float | None = None
    cob_id: int | None = None
    sync_start: int | None = None
    rtr: float | None = None
    at: SourceLocation = SourceLocation()

    @property
    def name(self) -> str:
        """``RPDO1`` and so on."""
        return f"{'RPDO' if self.receive else 'TPDO'}{self.number}"


@dataclass(frozen=True, slots=True)
class ProgramConfig:
    """``[nodes.N.program]``: the program that a node must have.

    The program is identified by its ``date_time`` (1F52h: days and milliseconds), its ``identification`` (1F56h:01), or both. Only
    with ``download`` does boot replace another program by ``file``, a path relative to the cell file. ``deadline`` is in seconds
    and applies to each part of the download (None: by the size of the file).
    """

    date_time: tuple[int, int] | None = None
    identification: int | None = None
    file: str | None = None
    download: bool = False
    deadline: float | None = None
    at: SourceLocation = SourceLocation()


@dataclass(frozen=True, slots=True)
class BusConfig:
    """``[bus]``; ``bitrate`` in bit/s, times in seconds (``heartbeat`` and ``time``, the period of TIME, None: off).

    ``sync_producer`` is "master" or "external": then another device's SYNC starts each scan, and is missing after ``sync_timeout``
    (None: 1.5 scan periods). ``sync_counter`` is 1019h, 0 for SYNC without counter. ``on_lost_node`` says what else stops when a
    node is lost: its ``group``, the ``cell``, or nothing (``report``). ``beside``: open the bus even if another master is heard on
    it. ``process``: the core of the machine runs in a ``thread`` of the program, or in its ``own`` process ("": if that is
    possible).
    """

    interface: str = ""
    channel: str | int | None = None
    bitrate: int | None = None
    master_id: int = 127
    scan_period: float = 0.01
    sync: bool = True
    sync_producer: str = "master"
    sync_cob_id: int = SYNC
    sync_counter: int = 0
    sync_timeout: float | None = None
    time: float | None = None
    time_cob_id: int = TIME
    heartbeat: float | None = 0.1
    on_lost_node: str = "group"
    beside: bool = False
    process: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    at: SourceLocation = SourceLocation()

    @property
    def hears_sync(self) -> bool:
        """Whether another device's SYNC starts each scan."""
        return self.sync and self.sync_producer == "external"


AUTOMATIC = "automatic"


class ProtocolSettings(Protocol):
    """The table ``[nodes.N.PROTOCOL]`` of a node that uses a protocol other than CANopen, read by a drive plug-in."""

    @property
    def protocol(self) -> str:
        """The word of the protocol."""

    @property
    def at(self) -> SourceLocation:
        """The location of the table."""


@dataclass(frozen=True, slots=True)
class NodeConfig:
    """``[nodes.N]``: a device; ``eds`` or ``dcf`` is a path relative to the cell file, or ``builtin:name``.

    ``optional``: the cell also opens without the node. ``on_lost``: the loss of a node without axes is a "stop" of the cell, or is
    only reported ("report"). ``rejoin``: whether a node that has returned is booted by a command only ("manual"), or automatically.
    ``serial`` and ``revision`` must match 1018h. ``configuration_date`` (days since 1984-01-01) and
    ``configuration_time`` (ms after midnight) are those of 1020h. ``module``: the settings that a node of another protocol needs
    instead of an EDS; ``firmware`` is its version. ``makes``: the drive plug-ins of the files that the cell names.
    """

    node_id: int
    eds: str | None = None
    dcf: str | None = None
    remap: str = "auto"
    optional: bool = False
    on_lost: str = "stop"
    rejoin: str = "manual"
    serial: int | None = None
    revision: int | None = None
    configuration_date: int | None = None
    configuration_time: int | None = None
    restore_defaults: bool = False
    protocol: str = CANOPEN
    firmware: str | None = None
    module: ProtocolSettings | None = None
    program: ProgramConfig | None = None
    objects: tuple[ObjectSetting, ...] = ()
    pdos: tuple[PdoConfig, ...] = ()
    makes: tuple[DrivePlugin, ...] = ()
    at: SourceLocation = SourceLocation()

    @property
    def file(self) -> str | None:
        """The EDS or DCF, None if neither is given."""
        return self.eds if self.eds is not None else self.dcf

    @property
    def file_key(self) -> str:
        """The key that names the EDS or DCF."""
        return "dcf" if self.eds is None and self.dcf is not None else "eds"

    @property
    def version(self) -> tuple[int, int] | None:
        """Date and time of the node's configuration in the format of 1020h, None if the cell file gives none."""
        if self.configuration_date is None or self.configuration_time is None:
            return None
        return self.configuration_date, self.configuration_time

    @property
    def remappable(self) -> bool:
        """Whether boot may change PDO mappings."""
        return self.remap != "never"


@dataclass(frozen=True, slots=True)
class DefaultsConfig:
    """``[axes.NAME.defaults]`` in unit/s, unit/s², N·m/s and unit/s³."""

    velocity: float | None = None
    acceleration: float | None = None
    deceleration: float | None = None
    torque_slope: float | None = None
    jerk: float | None = None
    at: SourceLocation = SourceLocation()


@dataclass(frozen=True, slots=True)
class HomingConfig:
    """``[axes.NAME.homing]``: method of 6098h, speeds in unit/s, ``timeout`` in seconds, ``offset`` (607Ch) in units.

    ``required`` None: the default, which is true if position limits are set. ``absolute``: the drive keeps its count of positions
    without power, so an axis that was homed is still homed when its node returns.
    """

    absolute: bool = False
    method: int | None = None
    speed_switch: float | None = None
    speed_zero: float | None = None
    acceleration: float | None = None
    timeout: float | None = None
    required: bool | None = None
    offset: float | None = None
    at: SourceLocation = SourceLocation()


@dataclass(frozen=True, slots=True)
class StopConfig:
    """``[axes.NAME.stop]``: words of ``cia402.options`` (None: the drive's); ``deceleration`` (6085h) in unit/s², times in s."""

    quick_stop: str | None = None
    shutdown: str | None = None
    disable: str | None = None
    halt: str | None = None
    fault: str | None = None
    connection_loss: str | None = None
    communication_error: str | None = None
    deceleration: float | None = None
    halt_time: float | None = None
    quick_stop_time: float | None = None
    disable_time: float | None = None
    at: SourceLocation = SourceLocation()

    def word(self, key: str) -> str | None:
        """Return the word of an option code by its key, such as ``quick_stop``."""
        word: str | None = getattr(self, key)
        return word


@dataclass(frozen=True, slots=True)
class FeedForwardConfig:
    """``[axes.NAME.feed_forward]``: ``inertia`` in N·m per unit/s², ``torque_offset`` in N·m."""

    velocity: bool = False
    inertia: float | None = None
    torque_offset: float | None = None
    at: SourceLocation = SourceLocation()


@dataclass(frozen=True, slots=True)
class AxisConfig:
    """``[axes.NAME]``; scales in increments per unit (None: by the rule of ``parameters``), limits in units, times in seconds.

    ``limits_in_drive``: boot writes the limits into the drive as well. ``handshake`` "on-change": bit 12 of the statusword proves
    nothing on this drive; the axis's behaviour shows that the drive has taken a set-point. ``virtual``: the axis has no drive, and
    the core alone generates its motion; its node is 0, which no device has. ``encoder``: the input of ``[io]`` that reports its
    position. ``following_error`` "off" is infinite. ``demand``: "use" or "ignore" 6062h, or judge it by its behaviour ("auto").
    ``homing_reached`` false: the drive does not set bit 10 at the end of homing.
    ``ignored_objects``: objects that the drive has but does not act on. A key that is None has the value of the drive's make, else
    its default.
    """

    name: str
    node: int = 0
    virtual: bool = False
    encoder: str | None = None
    drive_axis: int = 1
    unit: str = INCREMENTS
    scale: Fraction | None = None
    velocity_scale: Fraction | None = None
    acceleration_scale: Fraction | None = None
    invert: str | None = None
    rated_torque: float | None = None
    position_limits: tuple[float, float] | None = None
    max_velocity: float | None = None
    max_acceleration: float | None = None
    max_torque: float | None = None
    limits_in_drive: bool = False
    modulo: float | None = None
    position_window: float | None = None
    standstill_velocity: float | None = None
    standstill_window: float | None = None
    following_error: float | None = None
    demand: str | None = None
    modes: tuple[str, ...] | None = None
    ignored_objects: tuple[int, ...] | None = None
    holds_load: str | None = None
    transition_time: float | None = None
    mode_time: float | None = None
    acknowledge_time: float | None = None
    handshake: str | None = None
    homing_reached: bool | None = None
    defaults: DefaultsConfig = DefaultsConfig()
    homing: HomingConfig = HomingConfig()
    stop: StopConfig = StopConfig()
    feed_forward: FeedForwardConfig = FeedForwardConfig()
    objects: tuple[ObjectSetting, ...] = ()
    at: SourceLocation = SourceLocation()

    def no_drive(self, what: str) -> StateError:
        """Return the error that the axis has no drive; ``what`` continues the sentence "it has ..."."""
        if self.encoder is not None:
            return StateError(
                f"axis {self.name} is an encoder: it has {what}",
                observed=f"it has no drive; its position is the input [io.{self.encoder}]",
                remedy="use an axis that has a drive, or read its position",
            )
        return StateError(
            f"axis {self.name} is virtual: it has {what}",
            observed="only the core moves it: there is no node and no drive",
            remedy="use an axis that has a drive, or read its position and velocity",
        )


@dataclass(frozen=True, slots=True)
class KinematicsConfig:
    """``[groups.NAME.kinematics]``: lengths in one unit, ``middle`` in degrees; None: not given (see ``cell.groups``)."""

    kind: str = ""
    upper: float | None = None
    fore: float | None = None
    base: float | None = None
    plate: float | None = None
    left: bool | None = None
    middle: float | None = None
    at: SourceLocation = SourceLocation()


@dataclass(frozen=True, slots=True)
class GroupConfig:
    """``[groups.NAME]``: its axes, in the order in which ``move_linear`` takes their positions.

    ``on_fault`` says how the failure of one axis stops the others: on their ``path``, ``each`` by its own ramp, or by ``quick``
    stop. ``kinematics``: the relation of the axes to a workspace, if ``move_linear`` takes positions in a workspace.
    """

    name: str
    axes: tuple[str, ...] = ()
    on_fault: str = "path"
    kinematics: KinematicsConfig | None = None
    at: SourceLocation = SourceLocation()


@dataclass(frozen=True, slots=True)
class GantryHomingConfig:
    """``[gantries.NAME.homing]``: by touch probe ``input`` and ``edge``; unit/s, units; ``skew`` None: as ``max_skew``.

    ``switches``: "each" axis has a switch, or only the "first". ``positions``: the position of each axis at its own switch.
    """

    switches: str = "each"
    input: int = 1
    edge: str = "rising"
    velocity: float = 0.0
    distance: float = 0.0
    positions: tuple[float, ...] = ()
    skew: float | None = None
    at: SourceLocation = SourceLocation()


@dataclass(frozen=True, slots=True)
class GantryConfig:
    """``[gantries.NAME]``: two axes that carry one beam; the position of the first is the beam's.

    The beam is square when the second axis is ``offset`` units farther than the first. ``max_skew`` (units) is the allowed
    deviation.
    """

    name: str
    axes: tuple[str, ...] = ()
    max_skew: float = 0.0
    offset: float = 0.0
    homing: GantryHomingConfig | None = None
    at: SourceLocation = SourceLocation()


@dataclass(frozen=True, slots=True)
class IoConfig:
    """``[io.NAME]``: an input or an output of a node, depending on its ``object`` (a key as in ``[nodes.N.objects]``).

    ``bit`` selects one bit; if it is None, the whole object is a number: ``raw / scale + offset`` in ``unit``. ``safe``: the state
    of an output after the node, the program or the master is lost; None for an input.
    """

    name: str
    node: int = 0
    object: str = ""
    bit: int | None = None
    safe: float | None = None
    scale: Fraction | None = None
    offset: float = 0.0
    unit: str = ""
    at: SourceLocation = SourceLocation()


@dataclass(frozen=True, slots=True)
class CellConfig:
    """A whole cell file; ``source`` is its text, ``drive_files`` are the paths of the drive files that it names."""

    file: str
    bus: BusConfig
    nodes: Mapping[int, NodeConfig]
    axes: Mapping[str, AxisConfig]
    groups: Mapping[str, GroupConfig]
    source: str = ""
    io: Mapping[str, IoConfig] = field(default_factory=dict)
    gantries: Mapping[str, GantryConfig] = field(default_factory=dict)
    drive_files: tuple[Path, ...] = ()

    @property
    def folder(self) -> Path:
        """The folder that paths in the file are relative to."""
        return Path(self.file).parent

    @property
    def driven(self) -> Mapping[str, AxisConfig]:
        """The axes that have a drive, by name: all but the virtual ones."""
        return {name: axis for name, axis in self.axes.items() if not axis.virtual}

    def beside(self, another: bool) -> CellConfig:
        """Return the cell with ``beside = true`` if ``another`` master is expected on its bus, else unchanged."""
        return replace(self, bus=replace(self.bus, beside=True)) if another else self

    def no_axis(self, name: str, *, groups: bool = False, pairs: bool = False) -> StateError:
        """Return the error that the cell has no axis of this name; ``groups``, ``pairs``: the name could also be one of these."""
        others = f"; its groups are {', '.join(self.groups)}" if groups and self.groups else ""
        others += f"; its pairs are {', '.join(self.gantries)}" if pairs and self.gantries else ""
        return UnknownNameError(
            f"the cell has no axis {name!r}", observed=f"it has {', '.join(self.axes) or 'none'}{others}"
        )

    def axes_of(self, node_id: int) -> Iterator[AxisConfig]:
        """The axes of a node."""
        return (axis for axis in self.axes.values() if axis.node == node_id)

    def io_of(self, node_id: int) -> Iterator[IoConfig]:
        """The inputs and outputs of a node."""
        return (each for each in self.io.values() if each.node == node_id)

    def groups_of(self, axis: str) -> Iterator[GroupConfig]:
        """The groups that contain an axis."""
        return (group for group in self.groups.values() if axis in group.axes)
