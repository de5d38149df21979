"""Benchmarks: each figure beside a baseline measured in the same run, because machines differ. ``make bench``.

Fails (exit code 1) where a figure that the project promises is missed.
"""

from __future__ import annotations

import configparser
import io
import logging
import math
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import canopen

from axisbus import eds
from axisbus.bus.link.channel import Channel
from axisbus.bus.lss import LssMaster
from axisbus.bus.node import remote
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.pdo import MappedObject, PdoCodec
from axisbus.cia301.sdo import SdoTransferType
from axisbus.eds import fix
from axisbus.eds.builtin import resolve
from axisbus.eds.io import reader
from axisbus.eds.model import Eds, Object, ObjectType, Variable
from axisbus.machine.machine import Machine
from axisbus.motion.group.path import CycleVelocity, build_path
from axisbus.motion.group.path_builder import polyline
from axisbus.motion.group.path_motion import AxisPathShare, PathPosition
from axisbus.motion.group.path_speed import PathSpeed
from axisbus.motion.parameters import AxisLimits
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.node.network import SimulatedNetwork
from kit.bus.node_threads import on_each
from kit.corpus import CORPUS
from kit.motion.rig import PERIOD, rig

ROOT = Path(__file__).parents[1]
missed: list[str] = []


def best(work: Callable[[], object], repeat: int = 5) -> float:
    """Return the least seconds of several runs."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def row(what: str, figure: str, baseline: str, ratio: float, promise: bool | None = None) -> None:
    """Print one line; ``promise`` False marks a miss."""
    mark = "" if promise is None else "ok" if promise else "MISSED"
    print(f"{what:<58}{figure:>14}   {baseline:<44}{ratio:>8.1f}x  {mark}", flush=True)
    if promise is False:
        missed.append(what)


def generators() -> None:
    """CPU per cycle of a path of 32 axes with 50 rounded corners, against that of their 32 steps without one."""
    places = [tuple(30.0 * math.sin(0.7 * point + axis) for axis in range(32)) for point in range(52)]
    pieces, stops = polyline(places, 0.5)
    cycle = CycleVelocity(500.0, 0.004)
    way = build_path(pieces, [AxisLimits(velocity=300.0, acceleration=3000.0)] * 32, 3000.0, stops, cycle)

    def work() -> int:
        travel, along, cycles = PathSpeed(), PathPosition(way, 0.0, places[0]), 0
        shares = [AxisPathShare(along, number, 750.0) for number in range(32)]
        travel.begin(way, 500.0)
        while travel.t < way.length:
            travel.advance(cycle.period)
            for share in shares:
                share.position(travel.t)
            cycles += 1
        return cycles

    taken, steps = best(work) / work(), 32 * one_step()
    row("a path of 32 axes, in a cycle", f"{taken * 1e6:.1f} µs", f"their 32 steps {steps * 1e6:.0f} µs",
        steps / taken, taken <= steps)  # fmt: skip


def couplings() -> None:
    """CPU per cycle of 31 gears synchronised with one master, against that of the steps of their 32 axes in the same cycles."""
    names = "abcdefghijklmnopqrstuvwxyzABCDEF"
    test = rig(names).enabled()
    master, *slaves = (test.axes[name] for name in names)
    master.follow(TrapezoidalTrajectory(master.position, master.position + 1000.0, 10.0, 100.0))
    for slave in slaves:
        slave.gear_in(master, 0.5)
    test.run(3.0)
    assert all(slave.state is AxisState.SYNCHRONIZED_MOTION for slave in slaves)
    generated, stepped = [0.0], [0.0]
    for slave in slaves:
        _timed(test.scan.groups[master.name, slave.name], generated)
    for name in names:
        _timed(test.scan.axes[name], stepped)
    parts = []
    for _ in range(10):
        generated[0] = stepped[0] = 0.0
        test.run(1.0)
        parts.append((generated[0] * PERIOD, stepped[0] * PERIOD))
    taken, steps = (min(each) for each in zip(*parts, strict=True))
    row("31 axes geared to another, in a cycle", f"{taken * 1e6:.1f} µs", f"their 32 steps {steps * 1e6:.0f} µs",
        steps / taken, taken <= steps)  # fmt: skip


def _timed(stepped: Any, spent: list[float]) -> None:
    """Let each ``step`` of it add its CPU to ``spent``."""
    step = stepped.step

    def timed(*given: object) -> object:
        start = time.thread_time()
        found = step(*given)
        spent[0] += time.thread_time() - start
        return found

    stepped.step = timed


def axis_step() -> None:
    """CPU of one axis per cycle during a move, on the direct port, against canopen's decode and encode of its two PDOs."""
    step, baseline = one_step(), canopen_pdo()
    row("one axis stepped during a move", f"{step * 1e6:.1f} µs", f"canopen: its PDOs decoded, encoded {baseline * 1e6:.1f} µs",
        baseline / step, step <= 15e-6)  # fmt: skip


@cache
def one_step() -> float:
    """Seconds that one axis takes in a cycle during a move."""
    test = rig("x").enabled()
    test.axis.move_absolute(100_000.0, velocity=1.0, timeout=1e9)
    test.run(1.0)
    parts, cycles = (
        20,
        1000,
    )  # the least of several parts, as everywhere here: the machine has other work, too
    core, port, cycle = test.core, test.ports["x"], test.cycle
    now, spent = cycle.now(), [0.0] * parts
    for part in range(parts):
        for _ in range(cycles):
            now += test.scan.period
            cycle.wait_until(now)
            start = time.thread_time()
            port.write(core.step(port.read(now)))
            core.snapshot()
            spent[part] += time.thread_time() - start
            cycle.commit()
            cycle.sync()
            cycle.heartbeat()
    return min(spent) / cycles


def canopen_pdo() -> float:
    """Seconds that canopen needs to decode one 3-variable TPDO and encode one RPDO."""
    node = canopen.LocalNode(1, str(ROOT / "eds" / "generic-cia402.eds"))
    names = ((0x6041, 0x37, 0x02), (0x6061, 1), (0x6064, 1, 2, 3, 4))
    pdo = node.tpdo[1]
    pdo.clear()
    for index in (0x6041, 0x6061, 0x6064):
        pdo.add_variable(index)
    data = bytearray(byte for _, *values in names for byte in values)

    def work() -> None:
        for _ in range(1000):
            pdo.on_message(pdo.cob_id, data, 0.0)
            for variable in pdo:
                assert variable.raw is not None
            for variable in pdo:
                variable.raw = 1

    pdo.cob_id = 0x181
    return best(work) / 1000


def codec() -> None:
    """The compiled PDO codec against canopen's."""
    mapping = [MappedObject(0x6041, 0, 16), MappedObject(0x6061, 0, 8), MappedObject(0x6064, 0, 32)]
    compiled = PdoCodec(mapping, [False, True, True])
    data = bytes.fromhex("37020101020304")

    def work() -> None:
        for _ in range(1000):
            compiled.pack(compiled.unpack(data))

    ours, theirs = best(work) / 1000, canopen_pdo()
    row(
        "PDO of three values, unpacked and packed",
        f"{ours * 1e6:.2f} µs",
        f"canopen {theirs * 1e6:.1f} µs",
        theirs / ours,
    )


def an_hour() -> None:
    """An hour of three axes at 10 ms, simulated drives included, against real time."""
    cell = (ROOT / "examples" / "cell.toml").read_text().replace('"4ms"', '"10ms"')
    path = ROOT / "tests" / ".bench-cell.toml"
    path.write_text(cell)
    try:
        with Machine.simulated(path) as machine:
            machine.group("xyz").enable().wait()
            machine["z"].move_velocity(10.0).wait()
            start = time.perf_counter()
            machine.sleep(3600.0)
            spent = time.perf_counter() - start
    finally:
        path.unlink()
    row("an hour of three axes at 10 ms, stand-ins included", f"{spent:.0f} s", "real time 3600 s", 3600 / spent,
        spent < 60)  # fmt: skip


def canopen_import(text: str) -> Callable[[], object]:
    """Return a function that reads a text with canopen."""

    def work() -> object:
        stream = io.StringIO(text)
        stream.name = "bench.eds"
        return canopen.import_od(stream, 1)

    return work


def many_objects(size: int) -> str:
    """Return an EDS of about ``size`` bytes: the generic one, its objects repeated in 2000h to 5FFFh."""
    text = (ROOT / "eds" / "generic-cia402.eds").read_text()
    sections = re.split(r"(?m)^(?=\[)", text)
    objects = [part for part in sections if re.match(r"\[[0-9A-F]{4}", part)]
    free = iter(range(0x2000, 0x6000))
    made = [*sections]
    while sum(map(len, made)) < size:
        places: dict[str, str] = {}
        for part in objects:
            index = part[1:5]
            if index not in places:
                places[index] = f"{next(free):04X}"
            made.append(f"[{places[index]}{part[5:]}")
    return "".join(made)


def reading() -> None:
    """Reading and modelling an EDS against canopen.import_od; values are parsed when they are read."""
    for what, text in (("EDS", many_objects(0)), ("EDS of 770 kB", many_objects(770_000))):
        data = text.encode()
        mine, other = best(lambda data=data: reader.read(data, "bench")), best(canopen_import(text), 3)
        row(f"{what} read and modelled", f"{mine * 1000:.1f} ms", f"canopen.import_od {other * 1000:.1f} ms", other / mine,
            other / mine >= 8)  # fmt: skip
        mine = best(lambda data=data: [entry.subs for entry in reader.read(data, "bench").eds], 9)
        row(f"{what} read, and every object looked at", f"{mine * 1000:.1f} ms", f"canopen.import_od {other * 1000:.1f} ms",
            other / mine, other / mine >= 8)  # fmt: skip


def corpus() -> None:
    """Reading and modelling of real files against canopen.import_od: the median of the ratios, and the least of a file of 20 kB."""
    logging.getLogger("canopen").setLevel(logging.CRITICAL)
    ratios, looked, least = [], [], math.inf
    for path in sorted(CORPUS.glob("*.[ed][dc][sf]")):
        data = path.read_bytes()
        try:
            theirs = best(canopen_import(data.decode("latin-1").replace("\r\n", "\n")), 2)
        except (configparser.Error, ValueError, LookupError, TypeError):
            continue  # it does not read them all
        ratios.append(theirs / best(lambda data=data: reader.read(data, "bench"), 3))
        looked.append(
            theirs / best(lambda data=data: [entry.subs for entry in reader.read(data, "bench").eds], 3)
        )
        least = min(least, ratios[-1]) if len(data) > 20_000 else least
    if ratios:
        median = statistics.median(ratios)
        row(f"{len(ratios)} real EDS files read and modelled", f"median {median:.0f}x",
            f"canopen.import_od; from 20 kB at least {least:.1f}x", median, median >= 8)  # fmt: skip
        median = statistics.median(looked)
        row(f"{len(looked)} real EDS files, every object looked at", f"median {median:.1f}x",
            "canopen.import_od", median, median >= 7.5)  # fmt: skip


def nodes_of_one_type() -> None:
    """Sixteen nodes of one EDS against one: our model, and canopen's dictionary of each node."""
    data = (ROOT / "eds" / "generic-cia402.eds").read_bytes()

    def nodes(count: int, mark: bytes) -> Callable[[], object]:
        fresh = iter(range(1000))

        def work() -> None:
            content = data.replace(
                b"ProductName=", b"ProductName=%s%d" % (mark, next(fresh))
            )  # not in the cache
            for node_id in range(1, count + 1):
                remote.canopen_dictionary(eds.loads(content, "bench"), node_id)

        return work

    one, sixteen = best(nodes(1, b"one")), best(nodes(16, b"sixteen"))
    row("16 nodes of one EDS, canopen's dictionary each", f"{sixteen * 1000:.0f} ms", f"one node {one * 1000:.0f} ms",
        one / sixteen, sixteen / one <= 3)  # fmt: skip


def fast_scan() -> None:
    """LSS fast scan of one slave on the virtual bus, until it is known that no other is left, against canopen's."""
    made = eds.load(resolve("builtin:gim6010-8", ROOT))
    name, serial = "bench-lss", 0x1234_5678
    with (
        SimulatedNetwork(name, [device_from_eds(made, 255, serial=serial)]),
        Channel.open("virtual", name) as channel,
    ):
        master = LssMaster(channel, beside_operation=True)

        def ours() -> None:
            (found,) = master.find().slaves
            assert found.address.serial_number == serial

        mine = best(ours, 3)
        network = canopen.Network()
        network.connect(interface="virtual", channel=name)
        start = time.perf_counter()
        found, numbers = network.lss.fast_scan()
        other = time.perf_counter() - start
        network.disconnect()
        assert found, numbers
        assert numbers[3] == serial
    row(
        "LSS fast scan of one slave",
        f"{mine:.2f} s",
        f"canopen's fast_scan {other:.1f} s",
        other / mine,
        mine < 3.0,
    )


def grown(size: int) -> str:
    """Return the generic drive's EDS with as many objects of a maker added as make it this large."""
    text = (ROOT / "eds" / "generic-cia402.eds").read_text()
    index = 0x3000
    while len(text) < size:
        text += (
            f"\n[{index:04X}]\nParameterName=Parameter {index:X}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\n"
            "DefaultValue=5\nLowLimit=0\nHighLimit=100\nPDOMapping=1\n"
        )
        index += 1
    return text


def checking() -> None:
    """All rules over a file of 130 kB, reading included, and ``axisbus eds check`` as a process."""
    text = grown(130_000)
    data = text.encode()

    def theirs() -> None:
        stream = io.StringIO(text)
        stream.name = "bench.eds"
        canopen.import_od(stream, 1)

    mine, other = best(lambda: eds.check(reader.read(data, "bench.eds"))), best(theirs)
    row("EDS of 130 kB read and checked by all rules", f"{mine * 1000:.0f} ms",
        f"canopen.import_od, no checks {other * 1000:.0f} ms", other / mine, mine < 0.15)  # fmt: skip
    command = [sys.executable, "-m", "axisbus", "eds", "check", str(ROOT / "eds" / "gim6010-8.eds")]
    bare = best(lambda: subprocess.run([sys.executable, "-c", "pass"], check=True))
    process = best(lambda: subprocess.run(command, check=True, capture_output=True))
    row("axisbus eds check gim6010-8.eds, as a process", f"{process * 1000:.0f} ms",
        f"python -c pass {bare * 1000:.0f} ms", bare / process, process < 0.4)  # fmt: skip


def compact(sub_indices: str) -> bytes:
    """Return an EDS of 1.3 MB of arrays."""
    body = "ParameterName=P\nObjectType=0x8\nDataType=0x0007\nAccessType=rw\nPDOMapping=0\n" + sub_indices
    text = (ROOT / "eds" / "generic-cia402.eds").read_text() + "\n"
    return (text + "".join(f"[{index:04X}]\n{body}" for index in range(0x2000, 0x5400))).encode()


def noise() -> None:
    """Files that are small and say much, or large and say nothing, against less of the same."""
    few, many = compact("CompactSubObj=1\n"), compact("CompactSubObj=254\n")
    one, all_of_them = (
        best(lambda data=data: eds.check(reader.read(data, "bench.eds")), 2) for data in (few, many)
    )
    row(f"check of {len(many) / 1e6:.1f} MB of CompactSubObj=254", f"{all_of_them:.2f} s", f"of CompactSubObj=1 {one:.2f} s",
        one / all_of_them, all_of_them <= 2 * one and all_of_them < 3)  # fmt: skip
    head = (ROOT / "eds" / "generic-cia402.eds").read_bytes() + b"\n"
    line, comment = b"hello world, this is no entry\n", b";" + b"a" * 80 + b"\n"
    for what, work, part, size in (
        ("fix", lambda data: fix.fix(reader.read(data, "bench.eds")), line, 16_000_000),
        ("check", lambda data: eds.check(reader.read(data, "bench.eds")), comment, 14_000_000),
        (
            "check",
            lambda data: eds.check(reader.read(data, "bench.eds")),
            b";" + b"a" * 1_000_000 + b"\n",
            14_000_000,
        ),
    ):
        half, whole = (head + part * (length // len(part)) for length in (size // 2, size))
        small, large = (best(lambda data=data, work=work: work(data), 2) for data in (half, whole))
        row(f"{what} of {size // 1_000_000} MB of lines of {len(part)} bytes", f"{large:.2f} s", f"half of it {small:.2f} s",
            small / large, large < 3)  # fmt: skip


def sixteen_nodes() -> None:
    """The same 100 objects of 16 nodes, each of which takes 2 ms to answer, against one node."""
    file = eds.load(ROOT / "eds" / "generic-cia402.eds")
    devices = [device_from_eds(file, node_id) for node_id in range(1, 17)]
    for device in devices:
        device.dials.sdo_delay = 0.002
    keys = [(item.index, sub) for item in file for sub, variable in item.subs.items() if variable.readable][
        :100
    ]

    def read_all(client: SdoClient) -> list[bytes]:
        return [client.upload(*key) for key in keys]

    with Channel.open("virtual", "bench") as channel, SimulatedNetwork("bench", devices):
        time.sleep(0.5)
        clients = [SdoClient(channel, device.node_id) for device in devices]
        one = best(lambda: read_all(clients[0]), 3)
        many = best(lambda: on_each(clients, read_all), 3)
    row("100 objects of each of 16 nodes that take 2 ms", f"{many * 1000:.0f} ms", f"of one node {one * 1000:.0f} ms",
        many / one, many <= 2.5 * one)  # fmt: skip


def block_transfer() -> None:
    """16 KiB in blocks against the same in segments, to a node that takes 1 ms to answer."""
    file = Variable(0x2100, 0, "file", DataType.DOMAIN, "rw", None)
    device = Device(Eds("bench", {0x2100: Object(0x2100, "file", ObjectType.VAR, {0: file})}, {}), 5)
    device.dials.sdo_delay = 0.001
    data = bytes(range(256)) * 64
    with Channel.open("virtual", "bench-blocks") as channel, SimulatedNetwork("bench-blocks", [device]):
        time.sleep(0.5)
        client = SdoClient(channel, 5)
        blocks = best(lambda: client.download(0x2100, 0, data, transfer_type=SdoTransferType.BLOCK), 2)
        segments = best(lambda: client.download(0x2100, 0, data, transfer_type=SdoTransferType.NORMAL), 2)
        client.close()
    row("16 KiB written in blocks, 1 ms per answer", f"{blocks:.2f} s", f"in segments {segments:.2f} s",
        segments / blocks)  # fmt: skip


def start_up() -> None:
    """``axisbus --help`` against a bare interpreter."""

    def run(*arguments: str) -> float:
        return best(lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True))

    bare, ours = run("-c", "pass"), run("-m", "axisbus", "--help")
    row(
        "axisbus --help",
        f"{ours * 1000:.0f} ms",
        f"python -c pass {bare * 1000:.0f} ms",
        bare / ours,
        ours - bare < 0.15,
    )


def main() -> int:
    """Run all and return the exit code."""
    assert eds is not None
    print(f"{'what':<58}{'figure':>14}   {'baseline in the same run':<44}{'ratio':>9}")
    motion = (axis_step, generators, couplings, codec, an_hour)
    files = (reading, corpus, nodes_of_one_type, checking, noise)
    bus = (sixteen_nodes, block_transfer, fast_scan)
    for bench in (*motion, *files, *bus, start_up):
        bench()
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
