"""The text of a first cell file; pure.

Theory of operation
-------------------
Lines without a comment sign contain values that were read (adapter, nodes, files, number of axes) or that are the master's own
(periods). Settings that only the user knows, such as units, scales, speeds and stop reactions, are comments. Each comment shows the
drive's value, so that the user can confirm it by deleting the comment sign. Until then an axis counts in increments.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from axisbus.bus.node.discover import DiscoveredNode
from axisbus.cell import scale_proposal
from axisbus.cell.model import SIMULATED, BusConfig
from axisbus.cia402 import homing, options
from axisbus.cia402 import objects as o
from axisbus.drives.plugin import DrivePlugin
from axisbus.scaffold.device_probe import ProbedAxis
from axisbus.scaffold.match import FileMatch
from axisbus.wording import counted

_DEGREES = "deg"
_CONTROL = re.compile(r"[^\x20-\x7e]")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_WIDTH = 30


@dataclass(frozen=True, slots=True)
class BusFound:
    """The scanned bus; ``bitrate`` in bit/s, None if it is unknown."""

    interface: str
    channel: str | None
    bitrate: int | None
    options: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class NodeFound:
    """One device that answered: its identity, its files (``specs`` as the cell file names them), its axes and its make."""

    found: DiscoveredNode
    match: FileMatch
    specs: tuple[str, ...]
    axes: tuple[ProbedAxis, ...]
    make: DrivePlugin


@dataclass(frozen=True, slots=True)
class Draft:
    """A first cell file, and the missing and unconfirmed settings in sentences."""

    text: str
    missing: tuple[str, ...]
    confirm: tuple[str, ...]


def draft(bus: BusFound, nodes: list[NodeFound]) -> Draft:
    """Return a first cell file of the scanned bus and its nodes."""
    missing = [text for node in nodes for text in _missing(node)]
    if bus.bitrate is None and bus.interface != SIMULATED:
        missing.append("the bit rate of the bus is not known: write bitrate in [bus] (or give it with -b)")
    confirm = [
        f"axis {name(node, axis)}: unit, scale, defaults and stop are comments"
        for node in nodes
        for axis in node.axes
    ]
    lines = [*_head(bus), *_bus(bus, nodes)]
    for node in nodes:
        lines += ["", *_node(node)]
    for node in nodes:
        for axis in node.axes:
            lines += ["", *_axis(node, axis)]
    return Draft("\n".join(lines) + "\n", tuple(missing), tuple(confirm))


def name(node: NodeFound, axis: ProbedAxis) -> str:
    """Return the name of an axis in the file."""
    node_id = node.found.node_id
    return f"axis{node_id}" if len(node.axes) == 1 else f"axis{node_id}_{axis.number}"


def _missing(node: NodeFound) -> Iterator[str]:
    node_id = node.found.node_id
    if not node.found.answers_sdo:
        yield f"node {node_id} does not answer SDO ({_state(node.found)}): it is left out"
    elif not node.specs:
        yield f"node {node_id}: no EDS ({node.match.note}): give its folder with --eds, or: axisbus eds from-device {node_id} ..."
    elif len(node.specs) > 1:
        yield f"node {node_id}: {counted(len(node.specs), 'EDS file')} match, choose one: {', '.join(node.specs)}"
    for axis in node.axes:
        if axis.energised:
            yield f"node {node_id}, axis {axis.number} is energised ({axis.power}): another program may be running it"


def _head(bus: BusFound) -> list[str]:
    where = f"{bus.interface} {bus.channel}" if bus.channel is not None else bus.interface
    return [
        f"# A first cell file, made from the nodes on {_plain(where)}. Lines with CONFIRM are proposals: they take effect "
        "only when you",
        "# have checked them and removed the # before them. Then: axisbus check, axisbus boot.",
        "",
    ]


def _bus(bus: BusFound, nodes: list[NodeFound]) -> Iterator[str]:
    yield "[bus]"
    yield f"interface = {_text(bus.interface)}"
    if bus.channel is not None:
        yield f"channel = {_text(bus.channel)}"
    if bus.bitrate is not None:
        yield f"bitrate = {bus.bitrate}"
    elif bus.interface != SIMULATED:
        yield _noted("# bitrate = 1_000_000", "MISSING: bit/s")
    yield _noted('scan_period = "10ms"', "period of SYNC, commands and feedback")
    yield _noted(
        'heartbeat = "100ms"',
        "the master's, which the drives monitor, and the drives', which the master monitors",
    )
    taken = {node.found.node_id for node in nodes}
    if BusConfig().master_id in taken:
        free = max(set(range(1, 128)) - taken, default=0)
        yield _noted(f"master_id = {free}", f"the master's node-ID; {BusConfig().master_id} is taken")
    if bus.options:
        yield "[bus.options]"
        yield from (
            f"{key if _BARE.fullmatch(key) else _text(key)} = {_value(value)}"
            for key, value in bus.options.items()
        )


def _node(node: NodeFound) -> Iterator[str]:
    found, who = node.found, node.found.identity
    numbers = (
        ("vendor", who.vendor_id), ("product", who.product_code), ("revision", who.revision), ("serial", who.serial),
    )  # fmt: skip
    identity = ", ".join(f"{title} 0x{value:X}" for title, value in numbers if value is not None)
    if not found.answers_sdo:
        yield f"# Node {found.node_id}: {_state(found)}, does not answer SDO. LEFT OUT."
        return
    yield f"# {_plain(who.device_name or found.kind or 'a device without a name')}: {identity or 'no identity (1018h)'}"
    yield from (f"# {_plain(note)}" for note in node.make.notes)
    yield f"[nodes.{found.node_id}]"
    if len(node.specs) == 1:
        line = f"eds = {_text(node.specs[0])}"
        yield (
            _noted(line, f"CONFIRM: it is for another revision; {node.match.note}")
            if node.match.note
            else line
        )
        return
    if not node.specs:
        yield _noted('# eds = "..."', f"MISSING: {node.match.note}")
    for spec in node.specs:
        yield _noted(f"# eds = {_text(spec)}", "CONFIRM: several files match, choose one")


def _axis(node: NodeFound, axis: ProbedAxis) -> Iterator[str]:
    own = name(node, axis)
    if axis.modes:
        yield f"# It reports the modes {', '.join(axis.modes)} (6502h). It was found {axis.power}."
    yield f"[axes.{own}]"
    yield f"node = {node.found.node_id}"
    if axis.number > 1:
        yield _noted(f"drive_axis = {axis.number}", "its objects are 800h above those of the previous axis")
    yield _noted('unit = "increments"', "until unit and scale are confirmed:")
    yield from _scales(node, axis)
    yield from _limits(axis)
    if not axis.modes or "pp" in axis.modes:
        yield '# (Where moves fail with a SetPointError although the axis moves, bit 12 is not usable: handshake = "on-change".)'
    yield f"[axes.{own}.defaults]"
    yield from _defaults(axis)
    yield f"[axes.{own}.homing]"
    yield from _homing(axis)
    yield f"[axes.{own}.stop]"
    yield from _stops(axis)


def _scales(node: NodeFound, axis: ProbedAxis) -> Iterator[str]:
    found = scale_proposal.candidates(_DEGREES, axis.values)
    if found:
        yield _noted(f'# unit = "{_DEGREES}"', "CONFIRM: or mm, rev, ... (and remove the line above)")
    for side, scale in found:
        yield _noted(f'# scale = "{scale}"', f"CONFIRM: increments per degree {side}, by 608Fh and 6091h")
    if not found:
        yield _noted('# unit = "..."', "CONFIRM: deg, mm, rev, ... (and remove the line above)")
        yield _noted(
            "# scale = ...",
            "CONFIRM: position increments per unit; the drive's objects suggest nothing (608Fh)",
        )
    if node.make.scale_proposal:
        yield f"# {_plain(node.make.scale_proposal)}"
    yield _noted("# velocity_scale = ...", "CONFIRM: only if 6081h is not in position increments/s")
    if axis.get(o.RATED_TORQUE):
        yield _noted(
            "# rated_torque = ...", f"CONFIRM: N·m; 6076h is {axis.get(o.RATED_TORQUE)}, in the standard mN·m"
        )


def _limits(axis: ProbedAxis) -> Iterator[str]:
    low, high = (axis.get(o.SOFTWARE_POSITION_LIMIT, subindex) for subindex in (1, 2))
    now = (
        f"607Dh is {low} to {counted(high, 'increment')}"
        if low is not None and high is not None
        else "the drive has no 607Dh"
    )
    yield _noted("# position_limits = [..., ...]", f"CONFIRM: in units; {now}")
    yield _noted(
        "# max_velocity = ...", f"CONFIRM: in units/s; {_says(axis, '607Fh', o.MAX_PROFILE_VELOCITY)}"
    )
    if low is not None and high is not None:
        yield _noted(
            "# limits_in_drive = true",
            "CONFIRM: boot writes them into 607Dh, 607Fh, 6080h and 6072h, so that they also apply without a master",
        )
        yield _noted(
            "#",
            "(607Dh is relative to the drive's zero: home the axis first, and check that 607Dh does not obstruct homing)",
        )


def _defaults(axis: ProbedAxis) -> Iterator[str]:
    for key, title, index in (
        ("velocity", "6081h", o.PROFILE_VELOCITY),
        ("acceleration", "6083h", o.PROFILE_ACCELERATION),
        ("deceleration", "6084h", o.PROFILE_DECELERATION),
    ):
        yield _noted(
            f"# {key} = ...",
            f"CONFIRM: in units/s{'' if key == 'velocity' else '²'}; {_says(axis, title, index)}",
        )


def _homing(axis: ProbedAxis) -> Iterator[str]:
    method = axis.get(o.HOMING_METHOD)
    if method is None:
        yield _noted("# method = ...", "CONFIRM: the drive has no 6098h")
    else:
        yield _noted(f"# method = {method}", f"CONFIRM: 6098h is {method}: {homing.describe(method)}")


def _stops(axis: ProbedAxis) -> Iterator[str]:
    for option in options.ALL:
        value = axis.get(option.index, option.subindex)
        where = f"{option.index:04X}h"
        yield f"# {option.key}: the drive has no {where}" if value is None else _stop(option, where, value)
    yield _noted(
        "# deceleration = ...",
        f"CONFIRM: in units/s², of the quick stop; {_says(axis, '6085h', o.QUICK_STOP_DECELERATION)}",
    )


def _stop(option: options.OptionCode, where: str, value: int) -> str:
    """Return the line of one option code; a word that lets the motor coast is not proposed."""
    word = next((word for word, number in option.words.items() if number == value and word != "coast"), None)
    note = f"CONFIRM: {where} is {value}: {option.meaning(value)}"
    if word is None:
        return _noted(f"# {option.key} = ...", f"{note}; choose of {', '.join(option.words)}")
    return _noted(f'# {option.key} = "{word}"', note)


def _says(axis: ProbedAxis, title: str, index: int) -> str:
    value = axis.get(index)
    return f"the drive has no {title}" if value is None else f"{title} is {value} in the drive's own unit"


def _state(found: DiscoveredNode) -> str:
    return f"it reports {found.nmt.text}" if found.nmt is not None else "no heartbeat"


def _noted(line: str, note: str) -> str:
    return f"{line:<{_WIDTH}} # {note}"


def _plain(text: str) -> str:
    return _CONTROL.sub("?", text)


def _text(text: str) -> str:
    """Return a text in the syntax of TOML; its escapes are the same as JSON's."""
    return json.dumps(text, ensure_ascii=True)


def _value(value: object) -> str:
    return (
        str(value).lower()
        if isinstance(value, bool)
        else str(value)
        if isinstance(value, int)
        else _text(str(value))
    )
