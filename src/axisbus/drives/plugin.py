"""Definition of a drive plug-in: the properties of a vendor's drive family that the library uses."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

Details = Mapping[tuple[int, int], int]
Explain = Callable[[int, Details], list[str]]


def no_explanation(code: int, details: Details) -> list[str]:  # noqa: ARG001  the shape of every ``explain``
    """Return no explanation beyond those of CiA 301 and CiA 402 for an error code."""
    return []


@dataclass(frozen=True, slots=True)
class MeasuredObject:
    """A measured value of a drive: its object and factor; ``of`` is the index of the reference value of a relative value."""

    index: int
    subindex: int
    factor: float
    of: int | None = None


# Defined by CiA 402-2; objects of temperatures are manufacturer-specific.
STANDARD_MEASURED: Mapping[str, MeasuredObject] = {
    "voltage": MeasuredObject(0x6079, 0, 0.001),  # mV
    "current": MeasuredObject(0x6078, 0, 0.001 * 0.001, of=0x6075),  # ‰ of rated current, which is in mA
}


@dataclass(frozen=True, slots=True)
class FaultObject:
    """An object of a make that describes a fault: the meaning of its bits, and of a number of ``width`` bits from ``from_bit``."""

    index: int
    subindex: int = 0
    bits: Mapping[int, str] = field(default_factory=dict)
    values: Mapping[int, str] = field(default_factory=dict)
    from_bit: int = 0
    width: int = 32

    @property
    def address(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.subindex

    def texts(self, raw: int) -> Iterator[str]:
        """Yield the meanings of a value of the object, each with its bit or number."""
        where = f"{self.index:04X}h" + (f":{self.subindex:02X}" if self.subindex else "")
        yield from (f"{text} [{where} bit {bit}]" for bit, text in self.bits.items() if raw >> bit & 1)
        number = raw >> self.from_bit & (1 << self.width) - 1
        if number in self.values:
            yield f"{self.values[number]} [{where} number {number}]"


STORE_ALL = (0x1010, 1)  # Save all parameters (CiA 301 7.5.2.13)


@dataclass(frozen=True, slots=True)
class NodeIdObject:
    """The object that holds the node-ID of a drive after its next restart, and the object that stores it by ``save``."""

    address: tuple[int, int]
    store: tuple[int, int] = STORE_ALL


@dataclass(frozen=True, slots=True)
class FaultTexts:
    """An ``Explain`` made of tables: texts by code (603Fh, EMCY), and by the objects that describe a fault."""

    codes: Mapping[int, str] = field(default_factory=dict)
    objects: tuple[FaultObject, ...] = ()

    def __call__(self, code: int, details: Details) -> list[str]:
        """Return the sentences for a code (0: none) and the values of the objects that were read."""
        found = [self.codes[code]] if code in self.codes else []
        for each in self.objects:
            if each.address in details:
                found += each.texts(details[each.address])
        return found


@dataclass(frozen=True, slots=True)
class Behaviour:
    """Deviations of a make from CiA 402; a key of a cell file's axis with the same name overrides it. None: as the standard says.

    The keys of ``AXIS_KEYS`` are those of ``[axes.NAME]``, with times in seconds. ``homing_reached``: bit 10 rises at the end of
    homing. ``ignored_objects`` are objects of the profile (numbers of the first axis) that the drive has but does not act on: the
    master treats them as missing. ``lists_modes``: its 6502h is correct. ``store_restarts``: storing parameters (1010h) reboots the
    drive.
    """

    handshake: str | None = None
    homing_reached: bool | None = None
    demand: str | None = None
    modes: tuple[str, ...] | None = None
    ignored_objects: tuple[int, ...] | None = None
    transition_time: float | None = None
    mode_time: float | None = None
    acknowledge_time: float | None = None
    lists_modes: bool = True
    store_restarts: bool = False

    def of_axis(self) -> Iterator[tuple[str, object]]:
        """Yield the keys of an axis that this make sets, each with its value."""
        for name in AXIS_KEYS:
            value = getattr(self, name)
            if value is not None:
                yield name, value

    def lines(self) -> Iterator[str]:
        """Yield the deviations, as a drive file gives them."""
        for key, value in self.of_axis():
            if isinstance(value, float):
                yield f'{key} = "{value:g}s"'
            elif key == "ignored_objects":
                yield f"{key} = {json.dumps([f'{index:04X}h' for index in self.ignored_objects or ()])}"
            else:
                yield f"{key} = {json.dumps(value)}"
        if not self.lists_modes:
            yield "lists_modes = false"
        if self.store_restarts:
            yield "store_restarts = true"


AXIS_KEYS = (
    "handshake",
    "homing_reached",
    "demand",
    "modes",
    "ignored_objects",
    "transition_time",
    "mode_time",
    "acknowledge_time",
)


@dataclass(frozen=True, slots=True)
class Extension:
    """The parts that the code of a make adds to axisbus, in addition to facts; code is named ``module:name``, and loaded when it is
    needed.

    ``protocols`` are those other than CANopen: the word for each in ``[nodes.N]``, and its name in messages. ``interfaces`` are
    words of ``[bus]``, each with its class of a bus of python-can. ``parts`` extend a package of axisbus, by its name: ``cell``
    (``cell.other_protocols.CellPart``), ``check`` (checks of a cell), ``check_ids`` (their table, as in ``check.ids.table``),
    ``core`` (``core.other_protocols.CorePart``), ``trace`` (``trace.other_protocols.TracePart``) and ``symptoms``
    (``symptoms.symptom.SymptomNote`` by the names of pages); ``detector`` recognises devices
    (``foreign_protocols.ProtocolDetector``), ``trace_options`` and ``sim_options`` are options of commands
    (``cli.shared.plugin_options``).
    """

    protocols: Mapping[str, str] = field(default_factory=dict)
    interfaces: Mapping[str, str] = field(default_factory=dict)
    parts: Mapping[str, str] = field(default_factory=dict)


NO_EXTENSION = Extension()


@dataclass(frozen=True, slots=True)
class DrivePlugin:
    """All that is particular to a vendor's drive family; the defaults are for an unknown drive.

    ``vendor_id`` is 1018h:01; ``product_codes`` are values of 1018h:02 and ``revisions`` of 1018h:03 (None: any). ``eds_files`` are
    paths of EDS files of the family, for ``axisbus init``. ``fault_objects`` are the objects to read when the drive is in fault, if
    it has them; ``explain(code, details)`` turns 603Fh and their values into sentences. ``calibration_objects`` are objects that
    belong to one individual drive, or whose writing moves the motor for a calibration (sub-index None: the whole object); they are
    written only if the user names them one by one. ``node_id``: how an SDO sets the node-ID (protected, too); None: only LSS or
    switches do. ``scale_proposal`` is a text for the user: the position scale is a setting, never taken from here. ``measured``
    maps *temperature* and the like to the manufacturer's objects. ``unread_watchdog`` is a sentence about a watchdog of the make
    that no object reads, for the report of boot-up. ``sources`` are the documents that the facts come from. ``extension``: its
    other protocols.
    """

    name: str
    vendor_id: int | None = None
    product_codes: frozenset[int] | None = None
    revisions: frozenset[int] | None = None
    eds_files: tuple[str, ...] = ()
    fault_objects: tuple[tuple[int, int], ...] = ()
    explain: Explain = no_explanation
    calibration_objects: tuple[tuple[int, int | None], ...] = ()
    node_id: NodeIdObject | None = None
    scale_proposal: str = ""
    measured: Mapping[str, MeasuredObject] = field(default_factory=dict)
    behaviour: Behaviour = Behaviour()
    notes: tuple[str, ...] = ()
    unread_watchdog: str = ""
    sources: tuple[str, ...] = ()
    extension: Extension = NO_EXTENSION

    def matches(self, vendor_id: int | None, product_code: int | None, revision: int | None = None) -> bool:
        """Whether a drive with this identity (None: unknown) belongs to this plug-in."""
        if self.vendor_id is None or vendor_id != self.vendor_id:
            return False
        if self.product_codes is not None and product_code not in self.product_codes:
            return False
        return self.revisions is None or revision in self.revisions

    def same_drives(self, other: DrivePlugin) -> bool:
        """Whether both are for the same identities, so that neither precedes the other."""
        own_identity = self.vendor_id, self.product_codes, self.revisions
        return own_identity == (other.vendor_id, other.product_codes, other.revisions)

    @property
    def detail(self) -> int:
        """How closely the identity is given: of several plug-ins that match a drive, the highest is used."""
        return 2 * (self.revisions is not None) + (self.product_codes is not None)

    def calibrates(self, index: int, subindex: int) -> bool:
        """Whether an object is one of ``calibration_objects``, or sets the node-ID."""
        if self.node_id is not None and (index, subindex) == self.node_id.address:
            return True
        return (index, subindex) in self.calibration_objects or (index, None) in self.calibration_objects


GENERIC = DrivePlugin("CiA 402 drive")
