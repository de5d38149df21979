"""Configurations in words, for the command line and the web page: values, backups, differences, restores."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from axisbus.bus.node.node import NodeIdentity
from axisbus.cia301.datatypes import Value, decode
from axisbus.cia402.device_type import device_kind
from axisbus.configuration.compare import Comparison, ConfigurationDifference
from axisbus.configuration.dcf_backup import DcfBackup
from axisbus.configuration.dcf_values import Item, Selection, SkippedValue, SkipReason
from axisbus.configuration.restore import RestoreReport, ValueEnd
from axisbus.eds.device_to_dcf import LeftOut
from axisbus.eds.model import Number, Variable
from axisbus.eds.report import wording
from axisbus.wording import counted

# Reasons that apply to many values; these values are listed in one line.
_TOGETHER = {
    SkipReason.ORDER: "are commands, not settings (controlword, targets, storing ...)",
    SkipReason.MACHINE: "the running machine has set or uses",
}


def address(variable: Variable | LeftOut) -> str:
    """Return index, sub-index and name of an entry."""
    return f"{variable.index:04X}h:{variable.subindex:02X} {variable.name}"


def identified(variable: Variable | LeftOut) -> dict[str, object]:
    """Return index, sub-index and name of an entry, for JSON."""
    return {"index": variable.index, "subindex": variable.subindex, "name": variable.name}


def shown(variable: Variable, value: Value | None) -> str:
    """Return a value as text for display."""
    if value is None:
        return "nothing"
    if isinstance(value, bytes):
        return value.hex(" ") or "nothing"
    return wording.value(Number(value) if isinstance(value, int) else value, variable, None)


def data_shown(variable: Variable, data: bytes | None) -> str:
    """Return the bytes from a device as text for display."""
    return shown(variable, None if data is None else decode(data, variable.data_type))


def plain(value: Value | None) -> object:
    """Return a value for JSON; bytes as hexadecimal digits."""
    return value.hex() if isinstance(value, bytes) else value


def device(identity: NodeIdentity, origin: str, node_id: int) -> list[str]:
    """Return the device of a backup, and the source of its description."""
    kind = device_kind(identity.device_type)
    name = identity.device_name or (f"no device name, {kind}" if kind else "no device name")
    return [f"node {node_id}: {name}, {_identity(identity)}", f"  described by {origin}"]


def _identity(identity: NodeIdentity) -> str:
    numbers = (
        ("vendor", identity.vendor_id),
        ("product", identity.product_code),
        ("revision", identity.revision),
        ("serial", identity.serial),
    )
    known = [f"{title} 0x{value:X}" for title, value in numbers if value is not None]
    return ", ".join(known) or "no identity (1018h)"


def read(saved: DcfBackup) -> str:
    """Return the numbers of read and left-out objects of a backup."""
    return f"{counted(saved.values, 'object')} read, {len(saved.left_out)} left out"


def short(name: str) -> str:
    """Return the name of a side of a comparison; the name of a file without its folder."""
    return Path(name).name if "/" in name else name


def sides(each: ConfigurationDifference) -> tuple[str, str]:
    """Return the values of both sides of a difference."""
    return shown(each.variable, each.left), shown(each.variable, each.right)


def compared(comparison: Comparison) -> str:
    """Return the numbers of compared and different objects."""
    return f"{counted(comparison.compared, 'object')} compared, {len(comparison.differences)} differ"


def would(differing: Sequence[Item], selection: Selection) -> str:
    """Return the number of values that a restore would write."""
    return (
        f"the file has {counted(len(selection.items), 'object')} for it; "
        f"{counted(len(differing), 'has another value', 'have another value')}; nothing was written"
    )


def restored(report: RestoreReport) -> str:
    """Return the numbers of restored and skipped values."""
    silent = sum(not each.why.is_listed for each in report.skipped)
    counts = {outcome: len(report.of(outcome)) for outcome in ValueEnd}
    return (
        f"{counts[ValueEnd.RESTORED]} restored, {counts[ValueEnd.SAME]} had it already, {counts[ValueEnd.FAILED]} failed, "
        f"{len(report.skipped)} skipped ({silent} of them can only be read or are not in use)"
    )


def skipped(found: Sequence[SkippedValue]) -> list[str]:
    """Return the skipped values with their reasons, without those that are not worth a line."""
    lines = []
    for why, title in _TOGETHER.items():
        addresses = [
            f"{each.variable.index:04X}h:{each.variable.subindex:02X}" for each in found if each.why is why
        ]
        lines += [f"{len(addresses)} that {title}: {', '.join(addresses)}"] if addresses else []
    listed = [each for each in found if each.why.is_listed and each.why not in _TOGETHER]
    return lines + [f"{address(each.variable)}: {each.text}" for each in listed]
