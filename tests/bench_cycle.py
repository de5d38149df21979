"""What a whole cycle costs over a real socket, ours against canopen's PDO maps, in CPU time: ``python tests/bench_cycle.py``.

Every figure is measured in a process of its own, in turn with the one that it is compared with; the drives answer in another one.
"""

from __future__ import annotations

import argparse
import json
import mmap
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import can
from can.interfaces.socketcan import socketcan

from axisbus.bus.link.cyclic import CyclicSocket
from kit.bench import echo

if TYPE_CHECKING:  # not in the process of the other side
    from kit.bench.ours import Cell

ROOT = Path(__file__).parents[1]
EDS = str(ROOT / "eds" / "generic-cia402.eds")
SPEED = 20.0  # deg/s, of 1000 increments each
TPDO_NAMES, RPDO_NAMES = (0x6041, 0x6061, 0x6064), (0x607A, 0x6060, 0x6040)


@contextmanager
def drives(count: int, *, apart: bool = False) -> Iterator[tuple[can.BusABC, CyclicSocket | None]]:
    """Start ``count`` drives in another process; yield a python-can bus whose socket leads to them.

    ``apart``: their TPDOs come by a socket of their own, as the kernel's filters do it on a CAN link.
    """
    pairs = [_pair() for _ in range(1 + apart)]
    far = [pair[1] for pair in pairs]
    numbers = [str(end.fileno()) for end in (far[0], far[-1])]
    process = subprocess.Popen(
        [sys.executable, str(Path(echo.__file__)), *numbers, str(count)],
        pass_fds=[end.fileno() for end in far],
    )
    for end in far:
        end.close()
    bus = bus_on(pairs[0][0])
    try:
        yield bus, Apart(pairs[1][0]) if apart else None
    finally:
        bus.shutdown()
        process.wait(5)


def _pair() -> tuple[socket.socket, socket.socket]:
    pair = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in pair:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
    return pair


class Apart(CyclicSocket):
    """A line on which nothing else comes."""

    def __init__(self, raw: socket.socket) -> None:
        raw.setblocking(False)
        raw.setsockopt(socket.SOL_SOCKET, socketcan.constants.SO_TIMESTAMPNS, 1)
        super().__init__(raw, None)

    def listen(self, _: object) -> bool:
        return True


def bus_on(line: socket.socket) -> can.BusABC:
    """Return python-can's own SocketCAN bus on a socket that is there already."""
    made, socketcan.create_socket = socketcan.create_socket, lambda: line
    bound, socketcan.bind_socket = socketcan.bind_socket, lambda *_: None
    option = socketcan.SocketcanBus.set_filters
    socketcan.SocketcanBus.set_filters = _all_frames  # type: ignore[method-assign,assignment]
    try:
        return socketcan.SocketcanBus("bench")
    finally:
        socketcan.create_socket, socketcan.bind_socket = made, bound
        socketcan.SocketcanBus.set_filters = option  # type: ignore[method-assign]


def _all_frames(bus: can.BusABC, _: object = None) -> None:
    bus._filters, bus._is_filtered = None, True  # type: ignore[attr-defined]


def pace(period: float, cycles: int, work: Callable[[], None]) -> float:
    """Do ``work`` once in every period; return the CPU seconds of the whole process for each."""
    began, due = time.process_time(), time.monotonic()
    for _ in range(cycles):
        left = due - time.monotonic()
        if left > 0:
            time.sleep(left)
        work()
        due += period
    return (time.process_time() - began) / cycles


def theirs(bus: can.BusABC, _: CyclicSocket | None, count: int, period: float, cycles: int) -> float:
    """One TPDO and one RPDO per axis by canopen's PDO maps, held as variables: its fastest idiom."""
    import canopen  # not in the process of the other side

    network = canopen.Network(bus)
    network.notifier = can.Notifier(bus, network.listeners, 1)
    axes = []
    for node_id in range(1, count + 1):
        node = network.add_node(canopen.RemoteNode(node_id, EDS))
        tpdo, rpdo = node.tpdo[1], node.rpdo[1]
        for pdo, names in ((tpdo, TPDO_NAMES), (rpdo, RPDO_NAMES)):
            pdo.clear()
            for index in names:
                pdo.add_variable(index)
        tpdo.cob_id, rpdo.cob_id = echo.TPDO + node_id, echo.RPDO + node_id
        network.subscribe(tpdo.cob_id, tpdo.on_message)
        axes.append((tpdo[0], tpdo[2], rpdo, *rpdo))
    step, goal = SPEED * 1000 * period, [0.0]

    def work() -> None:
        network.send_message(0x80, b"")
        goal[0] += step
        for word, position, rpdo, target, mode, controlword in axes:
            assert word.raw >= 0
            assert position.raw is not None
            target.raw, mode.raw, controlword.raw = int(goal[0]), 8, 0xF
            rpdo.transmit()

    pace(period, 50, work)
    cost = pace(period, cycles, work)
    last = axes[-1][1].raw
    assert abs(last - goal[0]) < 10 * step, (last, goal)
    network.notifier.stop()
    return cost


def ours(bus: can.BusABC, cyclic: CyclicSocket | None, count: int, period: float, cycles: int) -> float:
    """The same frames by the scan, every axis on a trajectory."""
    from kit.bench.ours import Cell

    cell = Cell(bus, cyclic, count, period)
    with following(cell, period):
        began, first = time.process_time(), cell.scan.lateness.cycles
        time.sleep(cycles * period)
        return (time.process_time() - began) / (cell.scan.lateness.cycles - first)


@contextmanager
def following(cell: Cell, period: float) -> Iterator[None]:
    """Have every axis on its trajectory while the block runs; raises where one is not at its end."""
    thread = threading.Thread(target=cell.run)
    thread.start()
    try:
        cell.follow(SPEED)
        time.sleep(50 * period)
        yield
        cell.must_follow()
    finally:
        cell.scan.quit()
        thread.join()
        cell.close()


def core(
    bus: can.BusABC, cyclic: CyclicSocket | None, count: int, period: float, cycles: int
) -> dict[str, float]:
    """As ``ours``, but as a process of its own does it: with priority where it may, and an image of each cycle for others."""
    from axisbus.core.process.outlet import Outlet
    from axisbus.core.tuning import take_priority
    from axisbus.wire.image import size_of
    from kit.bench.ours import Cell

    cell = Cell(bus, cyclic, count, period)
    stream = SimpleNamespace(send=lambda _: None, waiting=0)
    outlet = Outlet(stream, mmap.mmap(-1, size_of(count)), tuple(cell.axes))  # type: ignore[arg-type]  # nobody is told
    cell.scan.observers = (outlet.after_cycle,)
    take_priority()
    with following(cell, period):
        late = cell.scan.lateness
        began, first, lost = time.process_time(), late.cycles, late.skipped
        time.sleep(cycles * period)
        spent, done = time.process_time() - began, late.cycles - first
    return {"cpu": spent / done, "cycles": done, "lost": late.skipped - lost, "p99": late.report().p99}


COMPARED = {"ours": ours, "theirs": theirs}
SIDES = {**COMPARED, "core": core}


def measure(side: str, count: int, period: float, seconds: float) -> Any:
    """What one side has come to, in a process of its own: CPU seconds per cycle, of ``core`` with its lateness."""
    command = [
        sys.executable,
        __file__,
        side,
        "--axes",
        str(count),
        "--period",
        str(period),
        "--seconds",
        str(seconds),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{side} with {count} axes failed:\n{done.stderr}")
    return json.loads(done.stdout)


def compare(count: int, period: float, pairs: int, seconds: float) -> dict[str, float]:
    """Return the medians of ``pairs`` runs of each side."""
    costs: dict[str, list[float]] = {side: [] for side in COMPARED}
    for _ in range(pairs):
        for side in COMPARED:
            costs[side].append(measure(side, count, period, seconds))
    mine, other = (statistics.median(costs[side]) for side in ("ours", "theirs"))
    ratio = statistics.median(b / a for a, b in zip(costs["ours"], costs["theirs"], strict=True))
    return {"axes": count, "period": period, "ours": mine, "theirs": other, "ratio": ratio}


def main() -> int:
    """Compare, or (with a side) measure one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("side", nargs="?", choices=list(SIDES))
    parser.add_argument("--axes", type=int, default=8)
    parser.add_argument("--period", type=float, default=0.01)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--pairs", type=int, default=5)
    chosen = parser.parse_args()
    if chosen.side:
        with drives(chosen.axes, apart=chosen.side != "theirs") as (bus, cyclic):
            print(
                json.dumps(
                    SIDES[chosen.side](
                        bus, cyclic, chosen.axes, chosen.period, int(chosen.seconds / chosen.period)
                    )
                )
            )
        return 0
    print(
        f"{'axes':>6}{'period':>10}{'ours':>12}{'canopen':>12}{'ratio':>8}   CPU per cycle, medians of {chosen.pairs} pairs"
    )
    for count in (1, 8, 16, 32):
        found = compare(count, chosen.period, chosen.pairs, chosen.seconds)
        print(
            f"{count:>6}{found['period'] * 1000:>7.0f} ms{found['ours'] * 1e6:>9.0f} µs{found['theirs'] * 1e6:>9.0f} µs"
            f"{found['ratio']:>7.2f}x",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
