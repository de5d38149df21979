"""Back up the configuration of a device as a DCF: each readable object, with identity and serial number."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from axisbus.bus.sdo.access import SdoUploads, try_upload, why_unread
from axisbus.cia301 import objects as o
from axisbus.eds import dcf
from axisbus.eds.device_to_dcf import LeftOut, left, readable, text_of
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.model import Variable
from axisbus.errors import NodeError

Key = tuple[int, int]
OnProgress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class DcfBackup:
    """A DCF of a device: the number of values in it, and the entries of the EDS without a value."""

    reading: EdsParseResult
    values: int
    left_out: tuple[LeftOut, ...]


def backup(
    device: SdoUploads,
    reading: EdsParseResult,
    settings: dcf.Settings,
    on_progress: OnProgress | None = None,
    restarts: Callable[[], object] = lambda: None,
) -> DcfBackup:
    """Read each object of ``reading`` (an EDS or DCF, whose own values are dropped) and return the DCF; blocks, writes nothing.

    An object that cannot be read is left out; ``on_progress(done, all)`` is called after each object. ``restarts`` returns a value
    that changes if the node restarts.

    Raises:
        SdoTimeout, AdapterError: the node does not answer, or the channel failed.
        NodeError: the node has restarted meanwhile, so its values do not belong together.
        ArgumentError, EdsError: the EDS cannot be converted to a DCF with these settings.
    """
    before, reading = restarts(), dcf.to_eds(reading)
    variables, left_out = readable(reading)
    texts: dict[Key, str] = {}
    serial = None
    for number, variable in enumerate(variables, start=1):
        found = _read(device, variable)
        text = text_of(variable, found, settings.node_id) if isinstance(found, bytes) else found
        if isinstance(text, LeftOut):
            left_out.append(text)
        elif text:
            texts[variable.index, variable.subindex] = text
        if isinstance(found, bytes) and (variable.index, variable.subindex) == (o.IDENTITY, o.SERIAL_NUMBER):
            serial = int.from_bytes(found, "little") or None  # 0 means no serial number
        if on_progress is not None:
            on_progress(number, len(variables))
    if restarts() != before:
        raise _restarted(settings.node_id)
    written = dcf.record(reading, replace(settings, serial=serial), texts)
    return DcfBackup(written, len(texts), tuple(left_out))


def _restarted(node_id: int) -> NodeError:
    return NodeError(
        f"node {node_id} has restarted while its objects were read; there is no backup",
        node=node_id,
        observed="it sent a boot-up message: values from before that may have been lost, or it may be another device",
        remedy="check its supply, and that it is configured; then make the backup again",
    )


def file_name(node_id: int, serial: int | None) -> str:
    """Return the usual name of a device's DCF."""
    return f"node-{node_id}.dcf" if not serial else f"node-{node_id}-serial-{serial:X}.dcf"


def known_rate(reading: EdsParseResult, bitrate: int | None) -> int | None:
    """Return a bus's bit rate (bit/s) in kbit/s for a DCF; None if it is unknown, or if the EDS does not support it."""
    rate = (bitrate or 0) // 1000
    known = reading.eds.info.get("deviceinfo", {}).get(f"baudrate_{rate}", "1")
    return rate if rate in dcf.BAUD_RATES and known.strip() not in ("0", "0x0") else None


def _read(device: SdoUploads, variable: Variable) -> bytes | LeftOut:
    found = try_upload(device, variable.index, variable.subindex)
    return found if isinstance(found, bytes) else left(variable, why_unread(found))
