"""Check the conditions for writing a configuration: the right device, at rest, pre-operational, and no other master."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.bus.node.node import CanopenNode, NodeIdentity
from axisbus.bus.sdo.access import ByObjects
from axisbus.cia301 import objects as o
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo import number_if_served
from axisbus.clock import poll_until
from axisbus.configuration import guarded_write
from axisbus.eds.model import Eds
from axisbus.errors import StateError, UserError

LISTEN = 1.2  # seconds: longer than the usual heartbeat period of 1 s
_SLICE = 0.02


@dataclass(frozen=True, slots=True)
class FileIdentity:
    """The identity of the device of a DCF; None if the file does not contain it."""

    device_type: int | None
    vendor_id: int | None
    product_code: int | None
    revision: int | None
    serial: int | None
    node_id: int | None


def identity_of(eds: Eds) -> FileIdentity:
    """Return the identity in a file: the values of 1000h and 1018h, and LSS_SerialNumber."""

    def number(index: int, subindex: int = 0) -> int | None:
        variable = eds.get(index, subindex)
        value = variable.initial(eds.node_id) if variable is not None else None
        return value if isinstance(value, int) else None

    commissioning = eds.info.get("devicecomissioning", {})
    written = commissioning.get("lss_serialnumber", "")
    serial = number(o.IDENTITY, o.SERIAL_NUMBER)
    if serial is None and written.isdecimal():
        serial = int(written)
    return FileIdentity(
        number(o.DEVICE_TYPE),
        eds.identity.vendor_id if (found := number(o.IDENTITY, o.VENDOR_ID)) is None else found,
        eds.identity.product_code if (found := number(o.IDENTITY, o.PRODUCT_CODE)) is None else found,
        number(o.IDENTITY, o.REVISION_NUMBER),
        serial,
        eds.node_id,
    )


def require_same_device(eds: Eds, found: NodeIdentity, node_id: int, *, replacement: bool) -> None:
    """Check that a file belongs to this device; a value that is missing or 0 in the file or the device is not compared.

    With ``replacement``, another drive of the same type is accepted: revision, serial number and node-ID may differ.

    Raises:
        UserError: the file belongs to another device.
    """
    expected = identity_of(eds)
    kinds = (
        ("device type (1000h)", expected.device_type, found.device_type),
        ("vendor ID", expected.vendor_id, found.vendor_id),
        ("product code", expected.product_code, found.product_code),
    )
    specimens = (
        ("revision", expected.revision, found.revision),
        ("serial number", expected.serial, found.serial),
        ("node-ID", expected.node_id, node_id),
    )
    other = _differing(kinds)
    if other:
        raise UserError(
            f"{eds.source} is not for a device of the type of node {node_id}; nothing was written",
            observed="; ".join(other),
            remedy="give the file of this device (axisbus scan lists the nodes)",
        )
    other = [] if replacement else _differing(specimens)
    if other:
        raise UserError(
            f"{eds.source} was not taken from node {node_id}; nothing was written",
            observed="; ".join(other),
            remedy="give the file of this device; if this device replaces the one of the file, add --replacement",
        )


def _differing(pairs: tuple[tuple[str, int | None, int | None], ...]) -> list[str]:
    return [
        f"{what}: the file has 0x{expected:X}, the device 0x{found:X}"
        for what, expected, found in pairs
        if expected and found and expected != found
    ]


def require_at_rest(node: CanopenNode) -> None:
    """Check that the node may be configured: no drive energised, not operational, no other master; blocks for about 2 s.

    A node without a heartbeat does not show its NMT state. It is commanded to pre-operational, which energises nothing.

    Raises:
        StateError: it may not be configured; nothing was written.
        SdoError, AdapterError: the node does not answer.
    """
    require_not_energised(node)
    guarded_write.require_no_other_master(node, heartbeats=False)
    state = _state(node)
    if state is None:
        node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
    else:
        require_pre_operational(node.node_id, state)


def require_not_energised(node: ByObjects) -> None:
    """Check that no drive of a node is energised; blocks for a transfer for each axis.

    Raises:
        StateError: a drive is energised.
        SdoError, AdapterError: the node does not answer.
    """
    guarded_write.require_not_energised(node, ": it is not configured; nothing was written")


def require_pre_operational(node_id: int, state: NmtState) -> None:
    """Check that a node is pre-operational, the state for configuring it.

    Raises:
        StateError: it is in another state.
    """
    if state is not NmtState.PRE_OPERATIONAL:
        raise StateError(
            f"node {node_id} is {state.text}: it is configured in pre-operational only; nothing was written",
            remedy=f"end the program that runs it, then: axisbus nmt pre-operational {node_id} ...",
        )


def _state(node: CanopenNode) -> NmtState | None:
    """Return the NMT state from the node's heartbeat; None if the node sends none."""
    period = (number_if_served(node.sdo.upload, o.PRODUCER_HEARTBEAT) or 0) / 1000
    if period:
        clock = node.channel.clock
        poll_until(clock, lambda: node.nmt.reports > 0, clock.now() + max(LISTEN, 2.5 * period), _SLICE)
    return node.nmt.state if node.nmt.reports else None
