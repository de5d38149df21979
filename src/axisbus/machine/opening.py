"""Open a cell: in a process of its own, in this process, in virtual time, or only to boot it.

Each function imports only the modules that it needs. A program whose core is another process needs no CAN modules, and continues
while that process imports them.
"""

from __future__ import annotations

import gc
import itertools
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cell.problem import CellProblem, errors
from axisbus.core.process.launch import Processes, expected, has_own_process, path_of, require_joinable_system
from axisbus.errors import StateError
from axisbus.machine.signal_shutdown import EXIT
from axisbus.toml.problem import as_exception
from axisbus.version import __version__

if TYPE_CHECKING:
    from axisbus.boot.report import Booted, NodeReport
    from axisbus.core.core import Core, CoreInterface
    from axisbus.core.runtime import Runtime
    from axisbus.sim.device import Device


def opened(path: str | Path, beside: bool, shared: bool) -> tuple[CellConfig, CoreInterface]:
    """Return a cell and its core, booted and ready to begin; as ``Machine.open``."""
    cell, problems = reader.read(path)
    if cell is None:
        raise as_exception(errors(problems))
    cell = cell.beside(beside)
    if has_own_process(cell.bus) and not errors(problems):
        return cell, _apart(cell, problems, shared)
    _check(cell, problems)
    if shared:
        require_joinable_system()
        raise StateError(
            "the machine cannot be shared: its core runs in this program",
            observed=expected(cell.bus),
            remedy='a core that others can join has a process of its own: process = "own" in [bus]',
        )
    return cell, _here(cell)


def attached(path: str | Path, *, command: bool, take: bool) -> tuple[CellConfig, CoreInterface] | None:
    """Return a cell and its running core; as ``Machine.attach``, but None if there is none."""
    cell = reader.load(path)
    if sys.platform != "linux":
        return None
    from axisbus.core.process.client import RemoteCore
    from axisbus.core.process.listener import ClientConnection, connect, text_of
    from axisbus.ipc import messages as m

    admitted = connect(path_of(cell))
    if admitted is None:
        return None
    wanted = m.Attach(__version__, text_of(path_of(cell)), command or take, take)
    return cell, RemoteCore(cell, ClientConnection(*admitted), wanted)


def runs(path: str | Path, *, joinable: bool = False) -> bool:
    """Whether this user has a running machine of this cell file on this computer; ``joinable``: one that can be joined."""
    from axisbus.core.process.listener import is_trusted, machines_of

    cell = str(path)
    return any(
        is_trusted(each, cell) and (each.accepts_clients or not joinable) for each in machines_of(cell)
    )


def out_of_reach(path: str | Path) -> str:
    """Return, as text, the programs that run this cell file or hold its channel but cannot be joined; empty if none."""
    if sys.platform != "linux":
        return ""
    from axisbus.bus.link import ownership
    from axisbus.bus.link.claims import CellFileId
    from axisbus.core.process.listener import claims_of, why_not_joinable

    cell, texts = reader.load(path), list[str]()
    for claim in claims_of(cell):
        program, why = ownership.described(claim.process), why_not_joinable(claim, cell.file)
        if not claim.cell.match(CellFileId.of(cell.file)):
            user = ownership.user_name(claim.user)
            texts.append(
                f"its CAN channel is held by {program} of user {user}, which runs no machine of this file"
            )
        elif why:
            texts.append(f"{program} runs one {why}")
    return "; ".join(texts)


def simulated(
    path: str | Path, devices: Mapping[int, Device] | None, *, at_real_speed: bool
) -> tuple[CellConfig, Core]:
    """Return a cell and its core in virtual time; as ``Machine.simulated``."""
    from axisbus.cell.other_protocols import require_virtual_time
    from axisbus.check.run import checked
    from axisbus.clock import RealSpeed, VirtualClock
    from axisbus.core.canlink import CanLink, simulated_channel
    from axisbus.core.files import load_dictionaries
    from axisbus.core.runtime import Runtime

    cell = checked(path)
    require_virtual_time(cell)
    dictionaries = load_dictionaries(cell)
    clock = VirtualClock()
    if at_real_speed:
        clock.add(RealSpeed())
    with ExitStack() as on_failure:
        on_failure.callback(clock.close)
        channel, simulated_nodes, wire = simulated_channel(cell, dictionaries, clock, devices)
        link = CanLink(cell, dictionaries, channel=channel, simulated_nodes=simulated_nodes, wire=wire)
        core = _core(cell, Runtime(link, sorted(cell.nodes), link.simulated_nodes))
        on_failure.pop_all()
    return cell, core


def boot(
    path: str | Path,
    progress: Callable[[int, int], None] | None = None,
    on_program: Callable[[int, int, int | None], None] | None = None,
    *,
    beside: bool = False,
) -> list[NodeReport]:
    """Boot the nodes of a cell, release them again, and return the report of each; energises nothing. Blocks.

    A node that did not come up has its ``error`` in the report. ``progress`` is called with the number of finished nodes and that
    of all nodes. ``on_program`` is called in the thread of a node with its ID, and the received and the total bytes of its new
    program. ``beside``: boot even if another master is heard.

    Raises:
        ConfigError, EdsError, AdapterError, SecondMasterError: as ``Machine.open``.
    """
    from axisbus.check.run import checked
    from axisbus.core.canlink import CanLink
    from axisbus.core.files import load_dictionaries
    from axisbus.core.runtime import Runtime

    cell = checked(path, beside)
    lock, through = threading.Lock(), itertools.count(1)

    def on_booted(_: Booted) -> None:
        if progress is not None:
            with lock:  # nodes boot in parallel
                progress(next(through), len(cell.nodes))

    link = CanLink(cell, load_dictionaries(cell), on_program)
    runtime = Runtime(link, sorted(cell.nodes), link.simulated_nodes, on_booted)
    try:
        return [booted.report for booted in runtime.booted.values()]
    finally:
        runtime.leave()


def _check(cell: CellConfig, problems: list[CellProblem]) -> None:
    from axisbus.check.run import require_no_errors

    require_no_errors(cell, problems)


def _apart(cell: CellConfig, problems: list[CellProblem], shared: bool) -> CoreInterface:
    process = Processes(cell, EXIT.ends[0].fileno())
    try:
        _check(cell, problems)
        from axisbus.core.process.client import RemoteCore
        from axisbus.ipc import messages as m
    except BaseException:
        process.abandon()
        raise
    return RemoteCore(
        cell, process, m.OpenCell(__version__, path_of(cell), cell.bus.beside, shared, EXIT.in_cells)
    )


def _here(cell: CellConfig) -> Core:
    from axisbus.core.canlink import CanLink
    from axisbus.core.files import load_dictionaries
    from axisbus.core.runtime import Runtime

    dictionaries = load_dictionaries(cell)
    gc.collect()  # now, because after boot-up the drives and the master monitor each other's heartbeats
    link = CanLink(cell, dictionaries)
    return _core(cell, Runtime(link, sorted(cell.nodes), link.simulated_nodes))


def _core(cell: CellConfig, runtime: Runtime) -> Core:
    from axisbus.core.core import Core

    return runtime.use(lambda booted: Core(cell, booted))
