"""The watchdog process of a core: a small process that forks the core, detects its end or hang, and then stops the drives.

Theory of operation
-------------------
A program that is busy in a long call notices a dead core only when the call returns; the watchdog process has no other task. It
imports and reads the data that the core, the simulated drives and a rescue need, once for all of them, and then forks: it has one
thread and no data of the program. So the data for a rescue is available before a drive is enabled; the core also waits for the
watchdog process's first byte.

The process's state shows the end of the core, and the number of its images shows whether it hangs. If the number does not change
for ``patience`` while the watchdog process itself ran on time (if both sleep, the computer is suspended), the core is stuck as a
whole, its own supervisor included. It is killed, and seen to be dead, before anything is sent: two masters must never send at the
same time.

The core in turn detects the end of the connection to its watchdog process, or that no bytes arrive any more (``rescue_record``),
and stops the axes: after its own death nothing would stop them.
"""

from __future__ import annotations

import gc
import json
import logging
import os
import signal
import socket
import time
from contextlib import suppress

from axisbus.core.files import read_once
from axisbus.core.process import server, simulated_drives
from axisbus.core.process.persistence.journal import journal
from axisbus.core.process.rescue import BEAT_PERIOD, CrashStop
from axisbus.core.process.startup_args import StartupArgs
from axisbus.core.realtime_setup import set_process_name, set_real_time_priority
from axisbus.errors import AxisbusError
from axisbus.ipc.rescue_memory import CoreStage

log = logging.getLogger("axisbus")
_POLL_PERIOD = 0.02  # seconds
_ON_TIME = 0.1  # seconds; a longer round shows that this computer did not run
_BEAT = b"r"
_PATIENCE = 5.0  # seconds; drives that are absent by then are reported by the boot


def main(text: str) -> None:
    """Run a ``StartupArgs`` (as JSON), as the watchdog process or as one of the processes that it forks; blocks until the end."""
    startup_args = StartupArgs(**json.loads(text))
    with suppress(AxisbusError):  # the process that needs it reports the error
        read_once(startup_args.cell)
    gc.freeze()  # the present objects stay for ever, shared by all processes
    drives_line, ready = socket.socketpair()
    if startup_args.simulates and not os.fork():
        drives_line.close()
        _become_process("axisbus drives", startup_args, startup_args.of_drives)
        simulated_drives.serve(startup_args, ready)
        return
    ready.close()
    near, far = socket.socketpair()
    core = os.fork()
    if core:
        far.close()
        _become_process(
            "axisbus wdog", startup_args, startup_args.of_watchdog
        )  # the system cuts a name after 15 characters
        _run_watchdog(core, near, startup_args, drives_line)
    else:
        near.close()
        drives_line.close()
        _become_process("axisbus core", startup_args, startup_args.of_core)
        server.serve(startup_args, far)


def _become_process(name: str, startup_args: StartupArgs, own_descriptors: set[int]) -> None:
    """Keep only this process's own descriptors, so that the others see its end, and set its name."""
    for number in startup_args.all - own_descriptors:
        os.close(number)
    set_process_name(name)


def _run_watchdog(
    core: int, line: socket.socket, startup_args: StartupArgs, drives_line: socket.socket
) -> None:
    """Watch the core, a child, to its end; ``line`` leads to it. ``drives_line`` ends when simulated drives listen on their bus."""
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)  # handled by the core
    with line:  # its end shows the core that it is no longer watched
        crash_stop = CrashStop(startup_args)
        set_real_time_priority()  # an overloaded computer is where a core may hang
        _await_end(drives_line)
        with suppress(OSError):  # it has already ended
            line.sendall(_BEAT)
        line.setblocking(False)
        _watch(core, crash_stop, startup_args.cell, line)


def _await_end(line: socket.socket) -> None:
    with line, suppress(OSError):
        line.settimeout(_PATIENCE)
        line.recv(1)


def _exit_code(core: int) -> int | None:
    """Return the exit code of the core, negative for a signal, when it has ended, and reap it; None before."""
    ended, status = os.waitpid(core, os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if ended else None


def _kill(core: int) -> None:
    """Kill the core, and wait for its death; blocks."""
    os.kill(core, signal.SIGKILL)
    os.waitpid(core, 0)


def _watch(core: int, crash_stop: CrashStop, cell: str, line: socket.socket) -> None:
    """Wait for the end of the core, or kill it; stop its drives, if it has left any moving; report and log the results."""
    why = _end_of(core, crash_stop, line)
    if crash_stop.is_needed:
        rescued = crash_stop.rescue(why)
        with journal(cell):  # a disk may be slow
            log.error("the core had ended: %s; so its drives were stopped", why)
            for each in rescued.stopped:
                log.error("%s: %s", each.axis, each.text)
            for output in rescued.unsafe:
                log.error("%s NOT CONFIRMED as safe: %s", output.output, output.text)
    else:
        crash_stop.report(why)


def _end_of(core: int, crash_stop: CrashStop, line: socket.socket) -> str:
    seen, idle, before = None, 0.0, time.monotonic()
    due = before
    while (code := _exit_code(core)) is None:
        time.sleep(_POLL_PERIOD)
        now = time.monotonic()
        idle += now - before if now - before < _ON_TIME else 0.0
        before = now
        if now >= due:
            due = now + BEAT_PERIOD
            with suppress(OSError):  # a core that hangs accepts no bytes
                line.send(_BEAT)
        stage = crash_stop.stage
        if (crash_stop.number, stage) != seen:
            seen, idle = (crash_stop.number, stage), 0.0
        if crash_stop.is_hung(stage, idle):
            _kill(core)
            return _killed(stage, idle)
    return _ended(code)


def _killed(stage: CoreStage, idle: float) -> str:
    if stage in (CoreStage.RELEASING, CoreStage.LEFT):  # it has ended its scan
        return f"it did not end within {idle:.0f} s, and was killed"
    return f"it ran no cycle for {idle:.2f} s, and was killed"


def _ended(code: int) -> str:
    if code < 0:
        return f"it was ended by {signal.Signals(-code).name}"
    return f"it ended with exit code {code}"
