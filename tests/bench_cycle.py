"""The cost of a whole cycle over a real socket, ours against canopen's PDO maps, in CPU time: ``python tests/bench_cycle.py``.

Every figure is measured in a process of its own, alternating with the figures to which it is compared; the drives answer in
another process. The drives send an EMCY every 50 cycles; as often, an object is read by SDO and one of our axes gets a command.
canopen is measured with its fastest idiom, maps held as variables, and with its usual one: three TPDOs for each axis, whose
values are found by name. The floor is a loop over the same frames without any motion.

All sides have the scheduling of a core in a process of its own, if it is permitted: real-time priority, and processors without
deep sleep states. With ``--plain`` no side has it: then most of every figure is the cost of waking up, which differs much
between computers.
"""

from __future__ import annotations

import argparse
import json
import math
import mmap
import socket
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import can
from can.interfaces.socketcan import socketcan

from axisbus.bus.link.raw_sockets import CyclicSocket
from axisbus.core.realtime_setup import permitted, prevent_deep_sleep, set_real_time_priority
from kit.bench import echo_drives
from kit.repeating_thread import again

if TYPE_CHECKING:  # not in the process of the other side
    from kit.bench.axes_on_echo_drives import Cell

ROOT = Path(__file__).parents[1]
EDS = str(ROOT / "eds" / "generic-cia402.eds")
SPEED = 20.0  # deg/s, of 1000 increments each
TPDO_NAMES, RPDO_NAMES = (0x6041, 0x6061, 0x6064), (0x607A, 0x6060, 0x6040)
ASKED = 0x6064  # by SDO


@contextmanager
def drives(
    count: int, *, apart: bool = False, split: bool = False
) -> Iterator[tuple[can.BusABC, CyclicSocket | None]]:
    """Start ``count`` drives in another process; yield a python-can bus whose socket leads to them.

    ``apart``: their TPDOs come by a socket of their own, as the kernel's filters do it on a CAN link. ``split``: they have three.
    """
    pairs = [_pair() for _ in range(1 + apart)]
    far = [pair[1] for pair in pairs]
    numbers = [str(end.fileno()) for end in (far[0], far[-1])]
    process = subprocess.Popen(
        [
            sys.executable,
            str(Path(echo_drives.__file__)),
            *numbers,
            str(count),
            *(["split"] if split else []),
        ],
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


@contextmanager
def asking(ask: Callable[[], Any], period: float) -> Iterator[None]:
    """Have an object read by SDO every 50 cycles, in another thread, while the block runs; raises where none was."""
    asked: list[Any] = []
    with again(lambda: asked.append(ask()), echo_drives.EVENT * period):
        yield
    assert asked


def theirs(bus: can.BusABC, _: CyclicSocket | None, count: int, period: float, cycles: int) -> float:
    """One TPDO and one RPDO per axis by canopen's PDO maps, held as variables: its fastest idiom."""
    network, nodes = _network(bus, count, [TPDO_NAMES])
    axes = [(node.tpdo[1][0], node.tpdo[1][2], node.rpdo[1], *node.rpdo[1]) for node in nodes]
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
    with asking(lambda: nodes[0].sdo[ASKED].raw, period):
        cost = pace(period, cycles, work)
    last = axes[-1][1].raw
    assert abs(last - goal[0]) < 10 * step, (last, goal)
    network.notifier.stop()
    return cost


def usual(bus: can.BusABC, _: CyclicSocket | None, count: int, period: float, cycles: int) -> float:
    """Three TPDOs per axis, and values by name: as canopen's users write it."""
    network, nodes = _network(bus, count, [(index,) for index in TPDO_NAMES])
    step, goal = SPEED * 1000 * period, [0.0]

    def work() -> None:
        network.send_message(0x80, b"")
        goal[0] += step
        for node in nodes:
            assert node.tpdo[0x6041].raw >= 0
            assert node.tpdo[0x6064].raw is not None
            node.rpdo[0x607A].raw, node.rpdo[0x6060].raw, node.rpdo[0x6040].raw = int(goal[0]), 8, 0xF
            node.rpdo[1].transmit()

    pace(period, 50, work)
    with asking(lambda: nodes[0].sdo[ASKED].raw, period):
        cost = pace(period, cycles, work)
    last = nodes[-1].tpdo[0x6064].raw
    assert abs(last - goal[0]) < 10 * step, (last, goal)
    network.notifier.stop()
    return cost


def _network(bus: can.BusABC, count: int, tpdos: list[tuple[int, ...]]) -> tuple[Any, list[Any]]:
    """A network of canopen's with so many nodes, each with these TPDOs."""
    import canopen  # not in the process of the other side

    network = canopen.Network(bus)
    network.notifier = can.Notifier(bus, network.listeners, 1)
    nodes = []
    for node_id in range(1, count + 1):
        node = network.add_node(canopen.RemoteNode(node_id, EDS))
        _map(node.rpdo[1], RPDO_NAMES, echo_drives.RPDO + node_id)
        for number, names in enumerate(tpdos):
            tpdo = node.tpdo[number + 1]
            _map(tpdo, names, echo_drives.TPDOS[number] + node_id)
            network.subscribe(tpdo.cob_id, tpdo.on_message)
        nodes.append(node)
    return network, nodes


def _map(pdo: Any, names: tuple[int, ...], cob_id: int) -> None:
    pdo.clear()
    for index in names:
        pdo.add_variable(index)
    pdo.cob_id, pdo.enabled = cob_id, True


def floor(bus: can.BusABC, _: CyclicSocket | None, count: int, period: float, cycles: int) -> float:
    """The same frames by a loop that only packs and unpacks them."""
    line = bus.socket  # type: ignore[attr-defined]
    line.setblocking(False)
    seen = dict.fromkeys(range(1, count + 1), (0, 0, 0))
    step, goal = SPEED * 1000 * period, [0.0]
    read, write = struct.Struct("<Hbi"), struct.Struct("<ibH")

    def work() -> None:
        line.send(echo_drives.FRAME.pack(0x80, 0, b""))
        with suppress(BlockingIOError):
            while True:
                can_id, _, data = echo_drives.FRAME.unpack(line.recv(echo_drives.FRAME.size))
                if can_id & 0x780 == echo_drives.TPDO:
                    seen[can_id & 0x7F] = read.unpack_from(data)
        goal[0] += step
        for node_id in seen:
            line.send(echo_drives.FRAME.pack(echo_drives.RPDO + node_id, 7, write.pack(int(goal[0]), 8, 0xF)))

    pace(period, 50, work)
    cost = pace(period, cycles, work)
    assert abs(seen[count][2] - goal[0]) < 10 * step, (seen, goal)
    return cost


def ours(bus: can.BusABC, cyclic: CyclicSocket | None, count: int, period: float, cycles: int) -> float:
    """The same frames by the scan, every axis on a trajectory, and an image of each cycle for others, as a core does it."""
    cell = _cell(bus, cyclic, count, period)
    with following(cell, period), asking(lambda: (cell.nodes[0].sdo.upload(ASKED), cell.command()), period):
        return _of_cell(cell, cycles, period)["cpu"]


def core(
    bus: can.BusABC, cyclic: CyclicSocket | None, count: int, period: float, cycles: int
) -> dict[str, float]:
    """As ``ours``, but nothing else happens on the wire; with the lateness of its cycles."""
    cell = _cell(bus, cyclic, count, period)
    with following(cell, period):
        return _of_cell(cell, cycles, period)


def _cell(bus: can.BusABC, cyclic: CyclicSocket | None, count: int, period: float) -> Cell:
    from axisbus.core.process.publisher import Publisher
    from axisbus.ipc.image import size_of
    from kit.bench.axes_on_echo_drives import Cell

    cell = Cell(bus, cyclic, count, period)
    stream = SimpleNamespace(send=lambda _: None, waiting=0)
    publisher = Publisher(mmap.mmap(-1, size_of(count)), tuple(cell.axes))
    publisher.admit(stream)  # type: ignore[arg-type]  # no receiver
    cell.scan.observers = [publisher.after_cycle]
    return cell


def _of_cell(cell: Cell, cycles: int, period: float) -> dict[str, float]:
    late = cell.scan.lateness
    began, first, lost = time.process_time(), late.cycles, late.skipped
    time.sleep(cycles * period)
    spent, done = time.process_time() - began, late.cycles - first
    return {"cpu": spent / done, "cycles": done, "lost": late.skipped - lost, "p99": late.report().p99}


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


COMPARED = {"ours": ours, "theirs": theirs, "usual": usual, "floor": floor}
MOST_OF_USUAL = 32  # axes: with more, canopen's usual idiom is not done within the cycle
SIDES = {**COMPARED, "core": core}


def measure(side: str, count: int, period: float, seconds: float, plain: bool = False) -> Any:
    """The result of one side, in a process of its own: CPU seconds per cycle, of ``core`` with its lateness."""
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
        *(["--plain"] if plain else []),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{side} with {count} axes failed:\n{done.stderr}")
    return json.loads(done.stdout)


def compare(count: int, period: float, pairs: int, seconds: float, plain: bool = False) -> dict[str, float]:
    """Return the medians of ``pairs`` runs of each side; ``ratio`` to ``theirs``, ``to_usual``."""
    sides = [side for side in COMPARED if side != "usual" or count <= MOST_OF_USUAL]
    costs: dict[str, list[float]] = {side: [] for side in sides}
    for _ in range(pairs):
        for side in sides:
            costs[side].append(measure(side, count, period, seconds, plain))

    def ratio(other: str) -> float:
        if other not in costs:
            return math.nan
        return statistics.median(b / a for a, b in zip(costs["ours"], costs[other], strict=True))

    medians = {side: statistics.median(costs[side]) if side in costs else math.nan for side in COMPARED}
    return {"axes": count, "period": period, **medians, "ratio": ratio("theirs"), "to_usual": ratio("usual")}


def _each_more(before: tuple[int, float] | None, found: dict[str, float]) -> str:
    """The cost of each axis that ``found`` has more than the run ``before``, of that many axes and CPU seconds."""
    if before is None:
        return ""
    axes, seconds = before
    return f"{(found['ours'] - seconds) / (found['axes'] - axes) * 1e6:.1f} µs"


def main() -> int:
    """Compare, or (with a side) measure one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("side", nargs="?", choices=list(SIDES))
    parser.add_argument("--axes", type=int, default=8)
    parser.add_argument("--period", type=float, default=0.01)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument(
        "--plain", action="store_true", help="at usual priority, the processors sleep as they like"
    )
    chosen = parser.parse_args()
    if chosen.side:
        ours_too = chosen.side in ("ours", "core")
        with drives(chosen.axes, apart=ours_too, split=chosen.side == "usual") as (bus, cyclic):
            if not chosen.plain:
                set_real_time_priority()
                prevent_deep_sleep()
            print(
                json.dumps(
                    SIDES[chosen.side](
                        bus, cyclic, chosen.axes, chosen.period, int(chosen.seconds / chosen.period)
                    )
                )
            )
        return 0
    degree = "as it comes" if chosen.plain else ", ".join(permitted())
    print(
        f"CPU per cycle of {chosen.period * 1000:g} ms, medians of {chosen.pairs} runs of each in turn; all of them: {degree}"
    )
    titles = f"{'axes':>6}{'ours':>12}{'canopen':>12}{'ratio':>8}{'its usual':>14}{'ratio':>8}{'floor':>12}"
    print(f"{titles}{'of ours, each axis more':>26}")
    before: tuple[int, float] | None = None
    for count in (1, 8, 16, 32, 64):
        found = compare(count, chosen.period, chosen.pairs, chosen.seconds, chosen.plain)
        cost = {side: f"{found[side] * 1e6:.0f} µs" for side in COMPARED}
        print(
            f"{count:>6}{cost['ours']:>12}{cost['theirs']:>12}{found['ratio']:>7.2f}x"
            f"{cost['usual']:>14}{found['to_usual']:>7.2f}x{cost['floor']:>12}{_each_more(before, found):>26}",
            flush=True,
        )
        before = count, found["ours"]
    return 0


if __name__ == "__main__":
    sys.exit(main())
