"""Select the values of a DCF for a device, as the bytes that SDO sends, and the reasons for skipping the others; pure."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from enum import Enum

from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType, encode
from axisbus.cia301.pdo import MAX_BITS
from axisbus.cia402.objects import order
from axisbus.configuration.write_order import by_pdo
from axisbus.drives.plugin import DrivePlugin
from axisbus.eds import assign
from axisbus.eds.concise_dcf_values import check_understood
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.model import Eds, Variable
from axisbus.errors import ArgumentError, AxisbusError, EdsError, LimitError
from axisbus.wording import counted, first_of

Key = tuple[int, int]

_REFUSES_DOWNLOAD = 1  # bit 0 of ObjFlags (DS 306 4.6.3.3)
_DEFAULT_SDO_SERVER = 0x1200  # the SDO channel that the master uses

# Limits that are wrong in many files: only the range of UNSIGNED32 limits these objects.
_UNLIMITED = frozenset((o.CONSUMER_HEARTBEAT,))
_SHOWN = 5
_MULTIPLEXED = (0xFE, 0xFF)  # marks an MPDO, instead of the number of objects


class SkipReason(Enum):
    """The reason why a value of the file is not written to the device."""

    READ_ONLY = "it can only be read"
    ORDER = "it is a command, not a setting"
    CALIBRATION = "it calibrates the drive"
    FLAGS = "its ObjFlags forbid a download"
    CHANNEL = "the SDO server that is used for this"
    UNUSED = "a mapping entry beyond the number of those in use"
    TYPE = "its type cannot be written"
    EXCLUDED = "left out on request"
    MACHINE = "the running machine has set it or uses it"

    @property
    def is_listed(self) -> bool:
        """Whether reports list these values object by object."""
        return self not in (SkipReason.READ_ONLY, SkipReason.UNUSED)


@dataclass(frozen=True, slots=True)
class Item:
    """One value for the device: ``data`` as SDO sends it; the line of the file is in ``variable``."""

    variable: Variable
    data: bytes

    @property
    def key(self) -> Key:
        """Index and sub-index."""
        return self.variable.index, self.variable.subindex


@dataclass(frozen=True, slots=True)
class SkippedValue:
    """One value that is not written; ``more`` adds details to the reason."""

    variable: Variable
    why: SkipReason
    more: str = ""

    @property
    def text(self) -> str:
        """The reason in words."""
        return f"{self.why.value}: {self.more}" if self.more else self.why.value


@dataclass(frozen=True, slots=True)
class Selection:
    """The values of a file for the device, in the file's order, and the skipped values."""

    items: tuple[Item, ...]
    skipped: tuple[SkippedValue, ...]


def select(
    eds: Eds,
    node_id: int,
    make: DrivePlugin,
    include: Collection[Key] = (),
    exclude: Collection[Key] = (),
) -> Selection:
    """Return the values that a DCF configures on node ``node_id`` (1 to 127); ``include`` adds single calibration objects.

    Objects that act when they are written (controlword, targets, modes, storing) are never included, not even by ``include``.

    Raises:
        ArgumentError: the file has no value for an entry of ``include`` or ``exclude``, or a value does not fit its type.
        EdsError: the file maps more objects than a PDO can carry.
    """
    given = {(each.index, each.subindex): each for each in _given(eds)}
    for address in (*include, *exclude):
        _require_known(eds, given.keys(), address)
    items, skipped = [], []
    for key, variable in given.items():
        reason = _skipped(eds, variable, node_id, make, key in include, key in exclude)
        if reason is None:
            items.append(Item(variable, _data(eds, variable, node_id)))
        else:
            skipped.append(reason)
    items += _dependent_items(eds, node_id, items, frozenset(given))
    for item in items:
        _check_count(eds, item)
    return Selection(tuple(items), tuple(skipped))


def _dependent_items(eds: Eds, node_id: int, items: list[Item], given: frozenset[Key]) -> Iterator[Item]:
    """Yield the additional values that the change of a PDO needs: the defaults of its COB-ID and of its whole mapping.

    A handwritten DCF may contain a single mapping entry. The additional values come from the file and not from the device. So they
    are the same in each run, even after an interrupted run that left the PDO disabled.
    """
    for pdo, keys in sorted(by_pdo(item.key for item in items).items()):
        for key in _needed(eds, node_id, pdo, set(keys)):
            variable = eds.get(*key)
            if (
                key not in given
                and variable is not None
                and variable.writable
                and variable.default is not None
            ):
                yield Item(variable, _data(eds, variable, node_id))


def _needed(eds: Eds, node_id: int, pdo: int, touched: set[Key]) -> Iterator[Key]:
    """Yield the entries that are needed to change the touched entries of a PDO (CiA 301 7.5.2.35 to 7.5.2.38)."""
    mapping = pdo + o.RPDO_MAPPING - o.RPDO_COMMUNICATION
    remapped = any(index == mapping for index, _ in touched)
    if remapped or touched & {(pdo, o.PDO_INHIBIT_TIME), (pdo, o.PDO_SYNC_START)}:
        yield pdo, o.PDO_COB_ID
    count = eds.get(mapping, 0)
    number = count.initial(node_id) if count is not None and remapped else None
    if isinstance(number, int):
        yield from ((mapping, subindex) for subindex in eds.objects[mapping].subs if subindex <= number)


def require_within_limits(items: Collection[Item], eds: Eds, node_id: int) -> None:
    """Check the values to be written against the limits of the file.

    Raises:
        LimitError: some values exceed their limits; the error names them.
    """
    found = []
    for item in items:
        if item.variable.index in _UNLIMITED:
            continue
        try:
            assign.check_limits(item.variable, item.variable.parameter_value, node_id)
        except LimitError as error:
            found.append(f"{error.message} ({error.observed})")
    if found:
        raise LimitError(
            f"{eds.source} has values beyond its own limits; nothing was written",
            observed=first_of(found, _SHOWN),
            remedy="correct the value or the limit in the file, leave the object out with --exclude, or give --ignore-limits",
        )


def require_values(reading: EdsParseResult) -> None:
    """Check that a file is a DCF whose values can be written.

    Raises:
        EdsError: it has no values, or a value that does not fit the type of its entry.
    """
    check_understood(reading)
    if next(_given(reading.eds), None) is None:
        raise EdsError(
            "the file has no parameter values, so nothing can be restored",
            file=reading.eds.source,
            remedy="give a DCF: axisbus config backup makes one of a node, axisbus eds dcf one of an EDS",
        )


def _given(eds: Eds) -> Iterator[Variable]:
    for entry in eds:
        for variable in entry.subs.values():
            if variable.parameter_value is not None:
                yield variable


def _require_known(eds: Eds, given: Collection[Key], address: Key) -> None:
    where = f"{address[0]:04X}h:{address[1]:02X}"
    if address not in given:
        raise ArgumentError(
            f"{eds.source} gives no value for {where}",
            remedy="list its values: axisbus eds dcf FILE --values",
        )


def _skipped(
    eds: Eds, variable: Variable, node_id: int, make: DrivePlugin, included: bool, excluded: bool
) -> SkippedValue | None:
    key = variable.index, variable.subindex
    reasons = (
        (not variable.writable, SkipReason.READ_ONLY, ""),
        (excluded, SkipReason.EXCLUDED, ""),
        (order(variable.index) != "", SkipReason.ORDER, order(variable.index)),
        (
            make.calibrates(*key) and not included,
            SkipReason.CALIBRATION,
            f"--include {_short(key)} writes it",
        ),
        (bool(variable.object_flags & _REFUSES_DOWNLOAD), SkipReason.FLAGS, ""),
        (variable.index == _DEFAULT_SDO_SERVER, SkipReason.CHANNEL, ""),
        (variable.data_type is DataType.DOMAIN, SkipReason.TYPE, "a DOMAIN is a separate file"),
        (_unused(eds, variable, node_id), SkipReason.UNUSED, ""),
    )
    return next((SkippedValue(variable, why, more) for applies, why, more in reasons if applies), None)


def _short(key: Key) -> str:
    return f"{key[0]:04X}:{key[1]:X}"


def _unused(eds: Eds, variable: Variable, node_id: int) -> bool:
    if not o.is_pdo_mapping(variable.index):
        return False
    count = eds.get(variable.index, 0)
    number = count.initial(node_id) if count is not None else None
    return isinstance(number, int) and variable.subindex > number


def _check_count(eds: Eds, item: Item) -> None:
    """Check the number of objects that a PDO carries (CiA 301 7.5.2.36, 7.5.2.38).

    Raises:
        EdsError: the number is too large.
    """
    if item.key[1] or not o.is_pdo_mapping(item.key[0]):
        return
    number = int.from_bytes(item.data, "little")
    if number > MAX_BITS and number not in _MULTIPLEXED:
        raise EdsError(
            f"a PDO cannot contain {counted(number, 'object')} ({item.key[0]:04X}h:00); nothing was written",
            file=eds.source,
            line=item.variable.line,
            observed=f"a CAN frame holds {MAX_BITS} bits",
            remedy="correct the number, or leave it out with --exclude",
        )


def _data(eds: Eds, variable: Variable, node_id: int) -> bytes:
    plain = variable.initial(node_id)
    where = f"{eds.source}:{variable.line}: {variable.index:04X}h:{variable.subindex:02X} ({variable.name})"
    assert plain is not None  # only variables with a parameter value get here
    try:
        return encode(plain, variable.data_type, where)
    except AxisbusError as error:
        raise ArgumentError(
            f"{error.message}; nothing was written",
            observed=error.observed,
            remedy="correct the value: axisbus eds check",
        ) from error
