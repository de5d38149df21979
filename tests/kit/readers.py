"""Every reader of files from outside, with valid files for it, and what an input may cost it: for fuzzing."""

from __future__ import annotations

import random
import time
import tracemalloc
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import can

from axisbus import Cam, Machine, eds
from axisbus.bus.link import frame_files
from axisbus.cell import reader as cells
from axisbus.core.sim_server.faults_file import load_faults
from axisbus.eds import concise
from axisbus.eds.concise_dcf_values import Configuration, configuration
from axisbus.eds.io import reader as dictionaries
from axisbus.errors import UserError
from axisbus.record.load import load as load_recording
from kit.commands import ROOT
from kit.mutated import mutated

MB = 1 << 20
SECONDS, PER_KB = 2.0, 0.02  # that an input may take: at least, and for each kB of it
MEMORY, PER_OCTET = 64 * MB, 1024  # octets that it may take: at least, and for each octet of it
FEW = 25  # of so many inputs the memory of one is measured, which takes its time
FRAMES = [
    can.Message(
        timestamp=1.0 + 0.01 * n,
        arbitration_id=0x180 + n % 4,
        data=bytes([n % 256] * (n % 9)),
        is_extended_id=False,
    )
    for n in range(40)
]
FAULTS = """\
[jam]
axis = "x"
begin = "2s"
for = "500ms"
blocked = true

[loss]
axis = "y"
when = "|x.velocity| > 10"
every = "2s"
fault = 0x2310
restart = true
"""


class Reader(NamedTuple):
    """One reader: the ending of its files, valid ones of them, and a function that reads a file as users of it do."""

    suffix: str
    valid: Callable[[Path], list[bytes]]
    read: Callable[[Path], object]


def _files(*names: str) -> Callable[[Path], list[bytes]]:
    return lambda _: [(ROOT / name).read_bytes() for name in names]


def _dcf(_: Path) -> list[bytes]:
    """Return an EDS with two values and what a DCF has beside it."""
    text = (ROOT / "eds" / "generic-cia402.eds").read_text(encoding="utf-8")
    for section, value in (("6065", 500), ("6081", 2000)):
        text = text.replace(f"[{section}]\n", f"[{section}]\nParameterValue={value}\n")
    return [(text + "\n[DeviceComissioning]\nNodeID=3\nNodeName=x\nBaudrate=500\nNetNumber=0\n").encode()]


def _configured(data: bytes, source: str) -> Configuration:
    return configuration(dictionaries.read(data, source), 3)


def _concise(folder: Path) -> list[bytes]:
    return [concise.encode(_configured(_dcf(folder)[0], "x.dcf").writes)]


def _logged(suffix: str) -> Callable[[Path], list[bytes]]:
    def write(folder: Path) -> list[bytes]:
        path = folder / f"frames{suffix}"
        with can.Logger(path) as log:
            for frame in FRAMES:
                log.on_message_received(frame)
        return [path.read_bytes()]

    return write


def _recorded(suffix: str) -> Callable[[Path], list[bytes]]:
    def write(folder: Path) -> list[bytes]:
        path = folder / "run.mcap"
        with Machine.simulated(ROOT / "examples" / "cell.toml") as machine, machine.recording(path):
            machine["x"].enable().wait()
            machine["x"].move_relative(1.0).wait()
        if suffix == ".csv":
            from axisbus.record.export import write_csv

            write_csv(load_recording(path), folder / "run.csv")
            path = folder / "run.csv"
        return [path.read_bytes()]

    return write


def _frames(path: Path) -> object:
    return sum(1 for _ in frame_files.read(path, frame_files.SkippedLines()))


def _faults(path: Path) -> object:
    return load_faults(path, cells.load(ROOT / "examples" / "cell.toml"))


READERS: dict[str, Reader] = {
    "EDS": Reader(
        ".eds", _files("eds/generic-cia402.eds", "eds/gim6010-8.eds", "eds/generic-cia401.eds"), eds.load
    ),
    "DCF": Reader(".dcf", _dcf, lambda path: _configured(path.read_bytes(), str(path))),
    "concise DCF": Reader(".bin", _concise, lambda path: concise.decode(path.read_bytes(), str(path))),
    "cell file": Reader(
        ".toml", _files("examples/cell.toml", "examples/gantry.toml", "examples/io.toml"), cells.load
    ),
    "faults file": Reader(".toml", lambda _: [FAULTS.encode()], _faults),
    "cam": Reader(".csv", lambda _: [b"0,0\n10,5\n20,0\n"], Cam.read),
    "candump": Reader(".log", _logged(".log"), _frames),
    "ASC": Reader(".asc", _logged(".asc"), _frames),
    "TRC": Reader(".trc", _logged(".trc"), _frames),
    "BLF": Reader(".blf", _logged(".blf"), _frames),
    "MCAP": Reader(".mcap", _recorded(".mcap"), load_recording),
    "CSV": Reader(".csv", _recorded(".csv"), load_recording),
}


class Fuzzed(NamedTuple):
    """The result of one input: the reason if it is a finding, else an empty text; and whether it was read."""

    finding: str
    taken: bool = False


def fuzzed(reader: Reader, path: Path, data: bytes, *, measured: bool = False) -> Fuzzed:
    """Let an input be read from ``path``; ``measured``: look at its memory, too, for which all is slower."""
    path.write_bytes(data)
    kilobytes, found, taken = len(data) / 1024, "", False
    if measured:
        tracemalloc.start()
    began = time.perf_counter()
    try:
        reader.read(path)
        taken = True
    except UserError as error:
        if str(path) not in str(error):
            found = f"names no file: {str(error)[:300]}"
    except (
        OSError
    ) as error:  # a user is told of these by the command line; here nothing is wrong with the disk
        found = f"{type(error).__name__}: {error}"
    except Exception as error:  # noqa: BLE001 - whatever else it is, it is a finding
        found = f"{type(error).__name__}: {str(error)[:300]}"
    took = time.perf_counter() - began
    if measured:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        if peak > MEMORY + PER_OCTET * len(data):
            found = found or f"takes {peak / MB:.0f} MB for {kilobytes:.0f} kB"
    elif took > SECONDS + PER_KB * kilobytes:
        found = found or f"takes {took:.1f} s for {kilobytes:.0f} kB"
    return Fuzzed(found, taken)


def inputs(valid: Sequence[bytes], seed: int) -> Callable[[int], bytes]:
    """Return a function that mutates one of the ``valid`` files; each number of a ``seed`` always makes the same input."""

    def made(number: int) -> bytes:
        drawn = random.Random(f"{seed}:{number}")
        return mutated(drawn.choice(valid), drawn)

    return made
