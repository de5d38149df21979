"""Stop a cell through its machine, otherwise its drives on the bus next to any master: no boot, no reset, a lasting stop.

Theory of operation
-------------------
Every machine that runs the cell file is asked to stop, and so is the holder of the CAN channel (``core.process.listener``). An axis
that such a machine has seen at standstill has stopped. All other axes are stopped on the bus itself, next to the master. Simulated
drives exist only within their machine: if no machine is reached, no drive is reached, and the result says so. An axis is reported
as stopped only if its standstill was observed.

On the bus, a node gets NMT stop only when all of its axes are at standstill or off; a live master has to treat that as a fault. A
module that uses CAN Simple has no such state. It is left without power, or holds its position if its quick stop does so.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from axisbus.bus.link.claims import CellFileId, ChannelClaim
from axisbus.bus.link.ownership import described
from axisbus.bus.node import nmt
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.parallel import in_parallel
from axisbus.cell.model import SIMULATED, CellConfig
from axisbus.cia301.nmt import NmtCommand
from axisbus.core.canlink import open_channel
from axisbus.core.files import load_dictionaries
from axisbus.core.node_stop import NodeStop, axes_to_stop
from axisbus.core.other_protocols import holding, stops_of
from axisbus.core.process.listener import (
    StopAnswer,
    StopRequest,
    ask_to_stop,
    claims_of,
    is_trusted,
    machines_of,
    text_of,
    why_not_joinable,
)
from axisbus.errors import BusError, ScanError, one_line
from axisbus.link import StopResult

_SHORT_TIMEOUT = 1.0  # seconds for the answer of a machine if its drives can be stopped on the bus
_LONG_TIMEOUT = 5.0  # seconds if they cannot
_NOWHERE = (
    "NOT REACHED: no machine of this cell was found here, and simulated drives exist only in their machine"
)


def stop_cell(cell: CellConfig, report: Callable[[str], None]) -> tuple[list[StopResult], bool]:
    """Stop every axis of a cell; return the result of each axis, and whether drives were stopped on the bus. Blocks.

    ``report`` is called with texts about machines that were found and not reached. Blocks and raises as ``stop_on_bus``.
    """
    simulated, claims = cell.bus.interface == SIMULATED, claims_of(cell)
    contacted = _contact(
        cell.file, claims, StopRequest(), _LONG_TIMEOUT if simulated else _SHORT_TIMEOUT, report
    )
    if simulated:
        return _answers(cell.axes, contacted) or [
            StopResult(name, False, _NOWHERE) for name in cell.axes
        ], False
    answered = [(claim, answer) for claim, answer in contacted if answer is not None]
    own = [answer for claim, answer in answered if _is_of(cell, claim, answer)]
    if len(answered) < len(contacted):
        own = []  # a master that was not reached can move its axes again
    seen = {each.axis: each for answer in own for each in answer.axes if each.ok}
    if own and seen.keys() >= cell.axes.keys():
        return list(seen.values()), False
    remaining = cell.driven.keys() - seen.keys()
    for answer in own:
        for each in answer.axes:
            if not each.ok:
                report(f"{each.axis}: {each.text}; so this program stops its drive directly")
    results = [*seen.values(), *stop_on_bus(cell, remaining)]
    reached = [claim for claim, _ in answered]
    for claim in claims:
        if claim not in reached:
            report(
                f"the machine that {described(claim.process)} runs did not get the stop: it can boot its nodes and move its axes "
                "again; end that program"
            )
    return results, True


def stop_in_machine(
    file: str, names: Sequence[str], report: Callable[[str], None], *, quick: bool
) -> list[StopResult]:
    """Halt or quick-stop axes in the running machine of a cell file; return the result of each axis. Blocks.

    If ``names`` is empty, all axes are stopped. If no machine was reached, the result is empty. The present text of the file is not
    checked. ``report`` is called with texts about machines that were not reached.
    """
    contacted = _contact(file, machines_of(file), StopRequest(tuple(names), quick), _LONG_TIMEOUT, report)
    return _answers(names, contacted) if any(answer for _, answer in contacted) else []


def _contact(
    file: str,
    found: Sequence[ChannelClaim],
    request: StopRequest,
    timeout: float,
    report: Callable[[str], None],
) -> list[tuple[ChannelClaim, StopAnswer | None]]:
    """Ask machines to stop axes; return the answer of each, None if it was not reached.

    Machines of another user are only reported.
    """
    contacted: list[tuple[ChannelClaim, StopAnswer | None]] = []
    for claim in found:
        why, answer = why_not_joinable(claim, file), None
        if why:
            report(f"no stop request was sent: {described(claim.process)} runs the machine {why}")
        else:
            try:
                answer = ask_to_stop(claim, request, timeout)
            except ScanError as error:
                report(one_line(error))
        if is_trusted(claim, file):
            contacted.append((claim, answer))
    return contacted


def _answers(
    names: Iterable[str], contacted: Sequence[tuple[ChannelClaim, StopAnswer | None]]
) -> list[StopResult]:
    """Return the results of all machines that were asked. The axes of a machine that was not reached count as not stopped."""
    results = list[StopResult]()
    for claim, answer in contacted:
        text = f"NOT REACHED in the machine that {described(claim.process)} runs"
        results += [StopResult(name, False, text) for name in names] if answer is None else answer.axes
    return results


def _is_of(cell: CellConfig, claim: ChannelClaim, answer: StopAnswer) -> bool:
    """Whether a machine runs this cell, with the present text of its file."""
    return claim.cell.match(CellFileId.of(cell.file)) and answer.text == text_of(cell.file)


def stop_on_bus(cell: CellConfig, names: Collection[str] | None = None) -> list[StopResult]:
    """Stop every axis of a cell on its bus, or those of ``names``; blocks until all are at standstill, at most about 12 s.

    Energises and configures nothing.

    Raises:
        EdsError, AdapterError: an EDS or the bus cannot be opened.
    """
    dictionaries = load_dictionaries(cell)
    wanted = cell.driven.keys() if names is None else names
    with ExitStack() as stack:
        channel, _ = open_channel(cell, dictionaries, stack)
        nodes = [
            stack.enter_context(CanopenNode(channel, node_id, eds)) for node_id, eds in dictionaries.items()
        ]
        stops = [
            partial(_stop, cell, node, wanted) for node in nodes if names is None or _has(cell, node, wanted)
        ]
        results = in_parallel(channel.clock, lambda stop: stop(), [*stops, *stops_of(cell, channel, wanted)])
    locked = holding(cell)
    return [
        replace(result, text=f"{result.text}; a running master can move it again")
        if result.ok and result.axis in locked
        else result
        for each in results
        for result in each
    ]


def _has(cell: CellConfig, node: CanopenNode, names: Collection[str]) -> bool:
    return any(axis.name in names for axis in cell.axes_of(node.node_id))


def _stop(cell: CellConfig, node: CanopenNode, names: Collection[str]) -> list[StopResult]:
    axes = axes_to_stop(cell, node, names)
    results = NodeStop(node, axes).run()
    if not all(result.ok for result in results):
        return results
    try:
        nmt.send(node.channel, NmtCommand.STOP, node.node_id)
    except BusError as error:
        return [
            StopResult(
                axis.name, False, f"is at standstill, but its node could not be stopped: {error.message}"
            )
            for axis in axes
        ]
    return results
