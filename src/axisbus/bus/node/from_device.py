"""Get an EDS from the device: the stored one (1021h), or else a skeleton of the objects that it has."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from datetime import datetime

from axisbus.bus.sdo.access import SdoObjectAccess, require_answering, try_upload
from axisbus.bus.sdo.client import SdoClient
from axisbus.bus.sdo.transfer import Progress
from axisbus.cia301 import abort
from axisbus.cia301 import objects as c301
from axisbus.cia301.datatypes import DataType, Value, decode
from axisbus.cia402 import dictionary as catalogue
from axisbus.cia402.dictionary import StandardObject
from axisbus.eds.dcf import BAUD_RATES
from axisbus.eds.device_to_dcf import printable
from axisbus.eds.model import Eds, Number, Object, ObjectType, Variable
from axisbus.errors import EdsError, SdoAbort, SdoError, SdoTimeout
from axisbus.wording import counted

STORED_EDS, STORE_FORMAT = 0x1021, 0x1022
_PLAIN, _ZIPPED = 0, 1
_LONGEST = 1 << 25  # bytes of an unpacked EDS; real ones have some hundred thousand
_MISSING = frozenset({abort.OBJECT_MISSING, abort.SUBINDEX_MISSING})
# Number of PDO parameters of each kind to try.
_PROBED_PDOS = dict.fromkeys(
    (c301.RPDO_COMMUNICATION, c301.RPDO_MAPPING, c301.TPDO_COMMUNICATION, c301.TPDO_MAPPING), 16
)
_KNOWN_ACCESS = ("const", "ro", "wo", "rw")
_BY_SIZE = {1: DataType.UNSIGNED8, 2: DataType.UNSIGNED16, 4: DataType.UNSIGNED32, 8: DataType.UNSIGNED64}
_LARGEST_RECORD = 64
_IDENTITY = {"vendornumber": 1, "productnumber": 2, "revisionnumber": 3}  # sub-indices of 1018h
_CONSTANT = frozenset((0x6502, 0x67FF))  # objects of the profile area whose value never changes
# objects without an answer, after which a device that answers at all gets less time for the others
_SILENT_IN_A_ROW = 3
_SHORT, _SHORT_TRIES = 0.1, 2  # seconds for an answer then, at least, and attempts
_MANDATORY = (c301.DEVICE_TYPE, c301.ERROR_REGISTER)
_NOT_FOR_A_DOWNLOAD = frozenset((c301.STORE_PARAMETERS, c301.RESTORE_DEFAULTS))


def stored_eds(sdo: SdoObjectAccess, progress: Progress | None = None) -> bytes | None:
    """Return the EDS that the device stores in 1021h, None if it has none; blocks for a long transfer.

    ``progress(done, all)`` counts its bytes.

    Raises:
        EdsError: the storage format (1022h) is not known, or the EDS is damaged.
        SdoTimeout, SdoError, AdapterError: as ``SdoClient.upload``.
    """
    try:
        data = sdo.upload(STORED_EDS, progress=progress)
    except SdoAbort:
        return None
    except SdoTimeout as silence:
        require_answering(sdo, silence)  # some devices do not answer for an object that they do not have
        return None
    kind = _format(sdo)
    if kind == _PLAIN:
        return data
    if kind == _ZIPPED:
        return _unpacked(sdo.node_id, data)
    raise EdsError(
        f"node {sdo.node_id} stores its EDS in a manufacturer-specific format",
        observed=f"1022h (store format) is {kind}; 0 is plain text",
        remedy="get the EDS from the manufacturer, or make a skeleton with --skeleton",
    )


def _unpacked(node_id: int, data: bytes) -> bytes:
    reader = zlib.decompressobj()
    try:
        text = reader.decompress(data, _LONGEST)
    except zlib.error as error:
        raise _damaged(node_id, len(data), str(error)) from error
    if reader.eof:
        return text
    seen = f"more than {_LONGEST} bytes of text" if reader.unconsumed_tail else "its end is missing"
    raise _damaged(node_id, len(data), seen)


def _damaged(node_id: int, size: int, observed: str) -> EdsError:
    return EdsError(
        f"node {node_id} stores an EDS that cannot be unpacked",
        observed=f"{counted(size, 'byte')} in 1021h, compressed by its 1022h: {observed}",
        remedy="get the EDS from the manufacturer, or make a skeleton with --skeleton",
    )


def _format(sdo: SdoObjectAccess) -> int:
    try:
        return int.from_bytes(sdo.upload(STORE_FORMAT), "little")
    except SdoAbort:
        return _PLAIN


def skeleton(
    sdo: SdoObjectAccess,
    progress: Callable[[int, int], None] | None = None,
    on_note: Callable[[str], None] | None = None,
) -> Eds:
    """Read every object of CiA 301 and CiA 402 and describe those that the device has; blocks, writes nothing.

    Names and types are those of the standard. If the device sends another size, the type is an unsigned type of that size. Access
    is also that of the standard, because reading cannot show it. Manufacturer-specific objects are not found. ``progress(done,
    all)``.

    An object without an answer is left out. After several in a row, if the device still answers for 1000h, the other objects get a
    shorter time limit: two attempts of 0.1 s, or of four times its slowest answer if that is longer. ``on_note`` gets a sentence
    about that.

    Raises:
        SdoTimeout: the device answers for no object, or no longer does. AdapterError: the channel failed.
    """
    candidates = _candidates()
    prober = _Prober(sdo, on_note)
    objects: dict[int, Object] = {}
    for number, (index, row) in enumerate(candidates.items(), start=1):
        found = _object(prober, index, _name(index, row), row)
        if found is not None:
            objects[index] = found
        if progress is not None:
            progress(number, len(candidates))
    description = f"skeleton read from node {sdo.node_id}, types and access by the standard"
    info = {"fileinfo": {"description": description}, "deviceinfo": _device(objects)}
    return Eds(f"node {sdo.node_id}", objects, info)


def _device(objects: Mapping[int, Object]) -> dict[str, str]:
    """Return the entries of [DeviceInfo] that follow from the objects; bit rates and names cannot be read."""
    identity = objects[c301.IDENTITY].subs if c301.IDENTITY in objects else {}
    found = {}
    for key, subindex in _IDENTITY.items():
        value = identity[subindex].default if subindex in identity else None
        if isinstance(value, Number):
            found[key] = str(value.value)
    for key, first in (("nrofrxpdo", c301.RPDO_COMMUNICATION), ("nroftxpdo", c301.TPDO_COMMUNICATION)):
        found[key] = str(sum(first <= index < first + 0x200 for index in objects))
    return found


def as_file(eds: Eds, name: str, now: datetime, bitrate: int | None = None) -> Eds:
    """Return the model with the file information of a new file ``name``, made ``now`` over a bus of ``bitrate`` (bit/s)."""
    date, clock = now.strftime("%m-%d-%Y"), now.strftime("%I:%M%p")
    entries = {
        "filename": name,
        "fileversion": "1",
        "filerevision": "0",
        "edsversion": "4.0",
        **eds.info.get("fileinfo", {}),
        "creationtime": clock,
        "creationdate": date,
        "createdby": "axisbus",
    }
    rate = {f"baudrate_{each}": "1" for each in BAUD_RATES if bitrate == each * 1000}
    device = {**eds.info.get("deviceinfo", {}), **rate}
    return replace(eds, info={**eds.info, "fileinfo": entries, "deviceinfo": device})


def _candidates() -> dict[int, StandardObject]:
    """Return the standard's row of every index to try."""
    candidates: dict[int, StandardObject] = {}
    for row in catalogue.ROWS:
        for index in row.indices if row.single else row.indices[: _PROBED_PDOS.get(row.index, 0)]:
            candidates.setdefault(index, row)
    return candidates


def _name(index: int, row: StandardObject) -> str:
    """Return an object's name, with a number if the standard has one name for a range of PDO parameters."""
    return row.name if row.single else f"{row.name} {index - row.index + 1}"


class _Prober:
    """Uploads for a skeleton; holds the number of objects in a row without an answer, and the resulting time limit."""

    def __init__(self, sdo: SdoObjectAccess, on_note: Callable[[str], None] | None) -> None:
        self.sdo = sdo
        self._on_note = on_note
        self._silent = 0
        self._slowest = 0.0  # seconds, of all answers
        self._limit: float | None = None  # seconds for an answer; None: the usual limit
        self._answered = False

    def upload(self, index: int, subindex: int = 0) -> bytes:
        """As ``SdoObjectAccess.upload``.

        1000h and 1001h have the usual time limit, because ``try_upload`` checks the device with them.
        """
        sdo = self.sdo
        if not isinstance(sdo, SdoClient):
            return sdo.upload(index, subindex)
        begun = sdo.clock.now()
        if self._limit is not None and index not in _MANDATORY:
            data = sdo.upload(index, subindex, timeout=self._limit, tries=_SHORT_TRIES)
        else:
            data = sdo.upload(index, subindex)
        self._slowest = max(self._slowest, sdo.clock.now() - begun)
        return data

    def find(self, index: int, subindex: int) -> bytes | SdoError:
        """As ``try_upload``.

        Raises:
            SdoTimeout: the device answers for no object, or no longer does. AdapterError: the channel failed.
        """
        try:
            found = try_upload(self, index, subindex)
        except SdoTimeout as error:
            if not self._answered:
                raise
            raise _node_lost(self.sdo.node_id, error) from error
        if isinstance(found, SdoTimeout):
            self._silent += 1
            if self._silent >= _SILENT_IN_A_ROW and self._limit is None and isinstance(self.sdo, SdoClient):
                self._shorten(self.sdo.timeout)
        else:
            self._silent, self._answered = 0, True
        return found

    def _shorten(self, usual: float) -> None:
        self._limit = min(usual, max(_SHORT, 4 * self._slowest))
        if self._on_note is not None:
            self._on_note(
                f"node {self.sdo.node_id} gives no answer for objects that it does not have, and answers for 1000h: each further "
                f"object was given {_SHORT_TRIES} attempts of {self._limit:.2g} s"
            )


def _node_lost(node_id: int, error: SdoTimeout) -> SdoTimeout:
    return SdoTimeout(
        f"node {node_id} is lost: it answered before, and no longer answers for any object; no EDS was made",
        node=node_id,
        index=error.index,
        subindex=error.subindex,
        observed=f"no answer for {error.index:04X}h:{error.subindex:02X}, nor for 1000h",
        remedy="check its supply, its cable and the bus (axisbus scan), then try again",
    )


def _object(prober: _Prober, index: int, name: str, row: StandardObject) -> Object | None:
    first = _upload(prober, index, 0)
    if first is None:
        return None
    kind = ObjectType[row.object_type]
    if kind is ObjectType.VAR:
        return Object(index, name, kind, {0: _variable(prober.sdo, index, 0, name, first)})
    subs = {
        0: Variable(
            index, 0, "Highest sub-index supported", DataType.UNSIGNED8, "const", Number(_count(first))
        )
    }
    subs.update(_subs(prober, index, name, _count(first)))
    return Object(index, name, kind, subs)


def _subs(prober: _Prober, index: int, name: str, count: int) -> Iterator[tuple[int, Variable]]:
    for subindex in range(1, count + 1):
        data = _upload(prober, index, subindex)
        if data is not None:
            yield subindex, _variable(prober.sdo, index, subindex, f"{name} {subindex}", data)


def _upload(prober: _Prober, index: int, subindex: int) -> bytes | None:
    """Return an entry's bytes, empty if it exists but cannot be read, None if it does not exist.

    An object without an answer counts as missing: some devices do not answer for missing objects.
    """
    found = prober.find(index, subindex)
    if isinstance(found, bytes):
        return found
    missing = isinstance(found, SdoTimeout) or (isinstance(found, SdoAbort) and found.code in _MISSING)
    return None if missing else b""


def _count(data: bytes) -> int:
    return min(data[0] if data else 0, _LARGEST_RECORD)


def _variable(sdo: SdoObjectAccess, index: int, subindex: int, name: str, data: bytes) -> Variable:
    entry = sdo.dictionary.entry(index, subindex)
    known = entry.data_type
    bits = known.bits if known is not None else None
    if known is None or (bits is not None and data and (bits + 7) // 8 != len(data)):
        known = _BY_SIZE.get(len(data), DataType.OCTET_STRING)
    access, mappable = _attributes(index, subindex)
    fixed = access in ("const", "ro") and (index < 0x2000 or index in _CONSTANT)
    return Variable(
        index,
        subindex,
        name,
        known,
        access,
        _default(data, known) if fixed else None,
        pdo_mapping=mappable,
        object_flags=int(index in _NOT_FOR_A_DOWNLOAD),
    )


def _default(data: bytes, data_type: DataType) -> Number | float | str | bytes | None:
    value: Value = decode(data, data_type)
    if isinstance(value, int):
        return Number(value)
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None  # an EDS cannot express it
    return value if data else None


def _attributes(index: int, subindex: int) -> tuple[str, bool]:
    """Return the standard's access and PDO mapping, those of the object's last row if it has none for the sub-index."""
    rows = catalogue.of(index)
    own = next(
        (number for number, row in enumerate(rows, 1) if row.subindices == range(subindex, subindex + 1)),
        None,
    )
    for row in reversed(rows[:own]):
        access = row.access_text.partition("/")[0]
        if access in _KNOWN_ACCESS:
            return access, bool(row.mapping)
    return "rw", False
