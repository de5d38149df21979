"""The outcome of a failed boot-up as an error."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.boot import program_text
from axisbus.boot.objects import NodeObjects
from axisbus.cell.model import NodeConfig
from axisbus.cia301 import abort
from axisbus.cia301 import objects as o
from axisbus.cia302.types import IDENTITY, Address, BootOutcome, Expected, Letter
from axisbus.cia402.device_type import device_kind
from axisbus.cia402.objects import PROFILE_NUMBER
from axisbus.drives.plugin import GENERIC, DrivePlugin
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, BootError, SdoAbort, SdoError
from axisbus.wording import counted

OTHER_DEVICE = {letter for _, _, letter in IDENTITY}
# Letters of failures that the node's own errors do not explain: the node does not answer, or is another device.
SILENT_OR_STRANGE = {Letter.A, Letter.B, *OTHER_DEVICE}


_OTHER_VALUE = "give a value that the drive accepts (its manual lists them), or leave the line out"
_OTHER_PERIOD = (
    'write a period that the drive accepts (its manual lists them), such as heartbeat = "1s" in [bus]; heartbeat = "off" does '
    "without error control"
)
NAMES_NO_ERROR = (
    "it reports no error: see its manual for reasons not to start (a PDO mapping that it does not accept, a missing "
    "signal); check whether another NMT master is on the bus"
)
# Letter -> message after "node N", and the first remedy.
_ERROR_CONTROL = {
    Letter.E: (
        "it sends no heartbeat, although its 1017h is not 0",
        "check the bus load and the path from the node: its SDO answers come, its heartbeats do not",
    ),
    Letter.F: (
        "it does not answer node guarding, and has no heartbeat",
        "check that the CAN adapter passes remote frames on; without error control a lost node is detected by its PDOs only "
        '(heartbeat = "off" in [bus] switches error control off)',
    ),
    Letter.K: (
        "it sends no heartbeat after 1017h was set",
        "check the bus load and the path from the node: its SDO answers come, its heartbeats do not",
    ),
}


def as_error(outcome: BootOutcome, node: NodeConfig, cause: AxisbusError | None) -> AxisbusError:
    """Return the error of a failed boot-up; ``cause`` is the error of its last request that failed, None if there is none."""
    if outcome.letter in OTHER_DEVICE:
        error = another_device(outcome, node)
    elif outcome.letter is Letter.J:
        error = _configuration(outcome, cause)
    elif outcome.letter in program_text.LETTERS:
        error = program_text.as_error(outcome, node, cause)
    elif outcome.letter in _ERROR_CONTROL:
        error = _error_control(outcome)
    elif cause is not None:
        error = at_step(node.node_id, outcome.step, cause)
    else:
        error = BootError(
            f"node {node.node_id}, step {outcome.step}: {outcome.sentence}",
            node=node.node_id,
            step=outcome.step,
        )
    return with_facts(error, outcome)


def with_facts(error: BootError, outcome: BootOutcome) -> BootError:
    """Add the letter, tries and time of the failed boot-up to its error."""
    error.letter = outcome.letter.name if outcome.letter is not None else ""
    if error.index is None and outcome.address is not None:
        error.index, error.subindex = outcome.address
    error.abort, error.tries, error.elapsed = outcome.abort, outcome.tries, outcome.elapsed
    return error


def at_step(node_id: int, step: str, error: AxisbusError) -> BootError:
    """Return the error of a step as a BootError that names node and step."""
    if isinstance(error, BootError):
        return error
    failed = BootError(
        f"node {node_id}, step {step}: {error.message}",
        node=node_id,
        step=step,
        index=getattr(error, "index", None),
        subindex=getattr(error, "subindex", 0),
        observed=error.observed,
        remedy=error.remedy,
    )
    failed.__cause__ = error
    return failed


def _configuration(outcome: BootOutcome, cause: AxisbusError | None) -> BootError:
    what, observed, remedy = _what_went_wrong(outcome, cause)
    index, subindex = outcome.address or (o.VERIFY_CONFIGURATION, 0)
    setting = outcome.setting
    setting_text = f"cannot be set to {setting.value!r} ({setting.source})" if setting else "cannot be set"
    error = BootError(
        f"node {outcome.node}: {index:04X}h:{subindex:02X} {setting_text}: {what}",
        node=outcome.node,
        step=outcome.step,
        index=index,
        subindex=subindex,
        observed=observed,
        remedy=_OTHER_PERIOD if index == o.PRODUCER_HEARTBEAT else remedy or _OTHER_VALUE,
    )
    error.__cause__ = cause
    return error


def _what_went_wrong(outcome: BootOutcome, cause: AxisbusError | None) -> tuple[str, str, str]:
    if outcome.expected is not None and outcome.setting is not None and outcome.setting.fixed:
        return (
            "the EDS has it read-only, and the drive has another value",
            f"expected {outcome.expected!r}, got {outcome.got!r}",
            f"command the behaviour that {outcome.got!r} means, set it with the manufacturer's tool, or correct its access in the "
            "EDS",
        )
    if outcome.expected is not None:
        return (
            "reads back another value",
            f"expected {outcome.expected!r}, got {outcome.got!r}",
            "the drive limits or rounds this value: write one that it accepts (its manual lists the range)",
        )
    if isinstance(cause, SdoAbort):
        refused = cause.code in abort.VALUE_REFUSED
        return (
            "the drive refuses it",
            cause.observed,
            _OTHER_VALUE if refused else cause.remedy or abort.explain(cause.code).hint,
        )
    if cause is None:
        return "no answer", "", ""
    return cause.message, cause.observed, cause.remedy


def _error_control(outcome: BootOutcome) -> BootError:
    assert outcome.letter is not None
    what, remedy = _ERROR_CONTROL[outcome.letter]
    return BootError(
        f"node {outcome.node}, step {outcome.step}: {what}",
        node=outcome.node,
        step=outcome.step,
        index=None if outcome.address is None else outcome.address[0],
        observed=f"no answer in {counted(outcome.tries, 'attempt')}; {outcome.elapsed:.1f} s since its boot-up began",
        remedy=remedy,
    )


# -- The expected identity of a node, and the error if another device is found -----------------------------------------


_PROFILE = 0xFFFF  # mask of the low word of 1000h; the high word holds the device's options
_VENDOR = (o.IDENTITY, o.VENDOR_ID)
_PRODUCT = (o.IDENTITY, o.PRODUCT_CODE)
_REVISION = (o.IDENTITY, o.REVISION_NUMBER)
SERIAL = (o.IDENTITY, o.SERIAL_NUMBER)
_NAMES = {address: name for address, name, _ in IDENTITY} | {(o.DEVICE_TYPE, 0): "device profile"}
_SHORT = {_VENDOR: "vendor", _PRODUCT: "product", _REVISION: "revision", SERIAL: "serial"}


def expected(node: NodeConfig, eds: Eds) -> dict[Address, Expected]:
    """Return the expected identity of a node: the cell file's values, and the EDS's values, checked only if the node has them."""
    found: dict[Address, Expected] = {}
    if eds.device_type and eds.device_type & _PROFILE:
        found[o.DEVICE_TYPE, 0] = Expected(eds.device_type & _PROFILE, _PROFILE, lenient=True)
    for address, value in ((_VENDOR, eds.identity.vendor_id), (_PRODUCT, eds.identity.product_code)):
        if value:
            found[address] = Expected(value, lenient=True)
    for address, value in ((_REVISION, node.revision), (SERIAL, node.serial)):
        if value is not None:
            found[address] = Expected(value)
    return found


def unspecified(before: Mapping[Address, int], wanted: Mapping[Address, Expected]) -> dict[Address, int]:
    """Return the reported parts of the identity ``before`` (1018h) that cell file and EDS leave open; 0 counts as not reported."""
    return {
        address: value for address, value in before.items() if value and address in _SHORT.keys() - wanted
    }


def as_before(before: Mapping[Address, int]) -> dict[Address, Expected]:
    """Return these parts of an identity as expected ones. A device that does not report a part cannot be told apart by it."""
    return {address: Expected(value, lenient=True) for address, value in before.items()}


def text(found: Mapping[Address, int]) -> str:
    """Return an identity in one line."""
    return ", ".join(f"{title} 0x{found[address]:X}" for address, title in _SHORT.items() if address in found)


def differences(found: Mapping[Address, int], eds: Eds) -> list[str]:
    """Return the differences from the EDS that may be harmless: the revision."""
    wanted, got = eds.identity.revision, found.get(_REVISION)
    if wanted and got and wanted != got:
        return [f"revision 0x{got:X}, the EDS is for 0x{wanted:X}: objects may differ"]
    return []


def another_device(outcome: BootOutcome, node: NodeConfig) -> BootError:
    """Return the error of a node that is not the expected device."""
    index, subindex = outcome.address or (o.DEVICE_TYPE, 0)
    address = (index, subindex)
    by_cell = address in (_REVISION, SERIAL)
    says = "cell.toml says" if by_cell else "the EDS says"
    seen = "not there" if outcome.got is None else _number(address, outcome.got)
    return BootError(
        f"node {outcome.node} is not the device that {'cell.toml specifies' if by_cell else f'{node.file} describes'}: its "
        f"{_NAMES[address]} differs",
        node=outcome.node,
        step="identity",
        index=index,
        subindex=subindex,
        observed=f"{index:04X}h:{subindex:02X} is {seen}, {says} {_number(address, outcome.expected)}",
        remedy=_remedy(address, by_cell),
    )


def swapped(outcome: BootOutcome, before: Mapping[Address, int], serial: int | None) -> BootError:
    """Return the error of a node that has returned as another device; ``serial`` is the number of that device, if it has one."""
    assert outcome.address is not None
    node, (index, subindex) = outcome.node, outcome.address
    found = {outcome.address: outcome.got, SERIAL: serial}
    return BootError(
        f"node {node} has returned as another device, and is not booted automatically: its {_NAMES[outcome.address]} differs",
        node=node,
        step="identity",
        index=index,
        subindex=subindex,
        observed="; ".join(
            f"its {_NAMES[address]} is {_seen(value)}, it was {_seen(before.get(address))}"
            for address, value in found.items()
        ),
        remedy=f"configure the new drive: axisbus replace CELL {node}; or boot it with its present parameters: "
        f"axisbus boot CELL --node {node}",
    )


def _seen(value: object) -> str:
    return f"0x{value:X} ({value})" if isinstance(value, int) else "not reported"


def name(objects: NodeObjects) -> str:
    """Return the device's name (1008h), empty if it cannot be read; the name is only shown. Blocks.

    Raises:
        BusError: the channel failed.
    """
    try:
        return str(objects.read(o.DEVICE_NAME)).strip("\0 ")
    except SdoError:
        return ""


def heading(objects: NodeObjects, found: Mapping[Address, int], make: DrivePlugin) -> str:
    """Return the title of a device: its name (1008h), else its make, else its device type (1000h); blocks, raises as ``name``."""
    own = name(objects) or (make.name if make is not GENERIC else "")
    return own or device_kind(found.get((o.DEVICE_TYPE, 0))) or "a device without a name"


def _remedy(address: Address, by_cell: bool) -> str:
    if by_cell:
        key = _SHORT[address]
        return f"correct {key} in [nodes.N] of cell.toml, or connect the intended device (axisbus scan lists the nodes)"
    return "give the EDS of this device in cell.toml, or correct the node ID (axisbus scan lists the nodes)"


def _number(address: Address, value: object) -> str:
    assert isinstance(value, int)
    if address != (o.DEVICE_TYPE, 0):
        return f"0x{value:X}"
    profile = value & _PROFILE
    return f"{profile} (CiA {profile})" if profile != PROFILE_NUMBER else "402 (a drive)"
