"""A program of its own with machines that end in odd ways: several of them, forked children, worker processes.

``python -m kit.scenarios.program_ends FOLDER SCENE``: the cell file is FOLDER/cell.toml. It appends lines of JSON to
FOLDER/seen.jsonl: the observations of each process, with its ``who``.
"""

from __future__ import annotations

import atexit
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from axisbus.cia301.nmt import NmtCommand
from axisbus.core.process.client import RemoteCore
from axisbus.machine.machine import Machine

FOLDER = Path(sys.argv[1])
PARENT = os.getpid()
LONG = 30.0


def note(who: str, **seen: object) -> None:
    """Write a line."""
    with (FOLDER / "seen.jsonl").open("a", encoding="utf-8") as file:
        file.write(json.dumps({"who": who, **seen}) + "\n")


def turning() -> Machine:
    """Open a machine and let its axis turn."""
    machine = Machine.open(FOLDER / "cell.toml")
    for _ in range(10):
        try:
            machine["x"].enable().wait(10)
            break
        except Exception:  # noqa: BLE001  # a busy computer
            time.sleep(0.2)
            machine["x"].reset().wait(10)
    machine["x"].move_velocity(90.0, acceleration=900.0).wait(10)
    return machine


def plant(machine: Machine) -> dict[str, object]:
    """The motor behind x, and the drive's watch over this program."""
    device = machine.simulated_node(1).device
    drive = device.drives[0]
    return {
        "velocity": drive.axis.motor.velocity / 100,
        "stage": int(drive.power.stage),
        "watch": device.read(0x1016, 1),
    }


def watch_sends(machine: Machine) -> None:
    """Write down every frame that a child sends; nothing to watch where the bus is in another process."""
    if isinstance(machine._core, RemoteCore):
        return
    bus = machine._core.scan.cycle._channel.bus
    send = bus.send

    def watched(message: object, timeout: float | None = None) -> None:
        if os.getpid() != PARENT:
            note("sent", frame=f"{message.arbitration_id:03X}")
        send(message, timeout)

    bus.send = watched


def tried(what: Callable[[], object]) -> str:
    """Try a forbidden action of a child; return its result."""
    try:
        what()
    except Exception as error:  # noqa: BLE001
        return f"{type(error).__name__}: {error}"
    return "nothing"


def in_fork(child: Callable[[], None]) -> int:
    """Run ``child`` in a forked child, which then ends as a program does; return its exit status."""
    began = time.monotonic()
    pid = os.fork()
    if pid == 0:
        child()
        sys.exit(0)
    _, status = os.waitpid(pid, 0)
    note("child gone", after=time.monotonic() - began)
    return os.waitstatus_to_exitcode(status)


# -- scenes ----------------------------------------------------------------------------------------------------------


def first_closed_first() -> None:
    """Two machines; the one that was opened first is closed first, then SIGTERM comes."""
    first, second = Machine.open(FOLDER / "cell.toml"), turning()
    first.close()
    try:
        with second:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(LONG)
    finally:
        note("end", **plant(second))


def both_closed() -> None:
    """Two machines, closed in both orders: afterwards the process is as before."""
    before = _settings()
    for order in (1, -1):
        machines = [Machine.open(FOLDER / "cell.toml") for _ in range(2)]
        for machine in machines[::order]:
            machine.close()
        note("end", same=_settings() == before, seen=repr(_settings()))


def _settings() -> tuple[object, ...]:
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    wakeup = signal.set_wakeup_fd(-1)
    signal.set_wakeup_fd(wakeup)
    return (*handlers, wakeup, sys.getswitchinterval())


def signal_stops_both() -> None:
    """Two machines, one of them not in the block that the signal ends."""
    first, second = turning(), turning()
    try:
        with second:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(LONG)
    except KeyboardInterrupt:
        time.sleep(2.0)  # the program continues: the first is stopped although it is not closed
        note("end", first=plant(first), second=plant(second))
    first.close()


def child_exits() -> None:
    """A forked child tries everything, leaves the block, and ends with atexit."""
    with turning() as machine:
        watch_sends(machine)
        handle = machine["x"].move_velocity(80.0)

        def child() -> None:
            x, node = machine["x"], machine.node(1)
            note(
                "child",
                command=tried(x.halt),
                position=tried(lambda: x.position),
                state=tried(lambda: x.state),
                error=str(x.error),
                wait=tried(lambda: handle.wait(5.0)),
                sdo=tried(lambda: node.sdo.__setitem__((0x1016, 1), 0)),
                nmt=tried(lambda: node.command(NmtCommand.STOP)),
                close=tried(machine.close),
                leave=tried(lambda: machine.__exit__(None, None, None)),
                terminated=repr(signal.getsignal(signal.SIGTERM)),
                interval=sys.getswitchinterval(),
            )

        code = in_fork(child)
        time.sleep(0.5)
        note("end", code=code, state=machine["x"].state.value, **plant(machine))


def child_leaves_by_exception() -> None:
    """The child leaves the parent's block by an exception."""
    try:
        with turning() as machine:
            watch_sends(machine)
            pid = os.fork()
            if pid == 0:
                raise ZeroDivisionError
            os.waitpid(pid, 0)
            time.sleep(0.3)
            note("end", **plant(machine))
    except ZeroDivisionError:
        os._exit(0)


def _sleep() -> None:
    time.sleep(LONG)


def worker_terminated() -> None:
    """``terminate()`` of a worker process that was forked, and Ctrl-C to it."""
    with turning() as machine:
        codes = []
        for number in (signal.SIGTERM, signal.SIGINT):
            worker = multiprocessing.get_context("fork").Process(target=_sleep)
            worker.start()
            time.sleep(0.2)
            os.kill(worker.pid, number)
            worker.join(10.0)
            codes.append(worker.exitcode)
        time.sleep(0.5)
        note("end", codes=codes, state=machine["x"].state.value, **plant(machine))


def other_processes() -> None:
    """Workers that are spawned, and programs that are started, leave the machine alone."""
    with turning() as machine:
        watch_sends(machine)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            squares = pool.map(abs, [-1, -2])
        code = subprocess.run([sys.executable, "-c", "pass"], check=False).returncode
        with multiprocessing.get_context("fork").Pool(1) as pool:
            squares += pool.map(abs, [-3])
        time.sleep(0.3)
        note("end", squares=squares, code=code, **plant(machine))


def machine_in_child() -> None:
    """A forked child opens a machine of its own, and SIGTERM stops that."""
    with turning() as machine:

        def child() -> None:
            own = turning()
            try:
                with own:
                    os.kill(os.getpid(), signal.SIGTERM)
                    time.sleep(LONG)
            finally:
                note("child", **plant(own))

        code = in_fork(child)
        note("end", code=code, **plant(machine))


SCENES = {
    scene.__name__: scene
    for scene in (
        first_closed_first,
        both_closed,
        signal_stops_both,
        child_exits,
        child_leaves_by_exception,
        worker_terminated,
        other_processes,
        machine_in_child,
    )
}

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # whatever the shell had made of it
    atexit.register(lambda: note("ended", pid=os.getpid() == PARENT))
    SCENES[sys.argv[2]]()
