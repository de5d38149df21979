"""Every reader of bytes from outside, those of files with valid files for them: for fuzzing.

Parsers of other packages are left out: HTTP and WebSocket (uvicorn), TLS, Zenoh's protocol, USB (odrive), and CAN frames in the
kernel and in drivers. Memory and pipes between this package's own processes are left out too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import can

from axisbus import Cam, Machine, eds
from axisbus.bus.link import frame_files
from axisbus.cell import reader as cells
from axisbus.configuration import nameplate
from axisbus.configuration.nameplate import Nameplate
from axisbus.configuration.replacement_plan import UnfinishedReplacement, parse_note
from axisbus.core.sim_faults_file import load_faults
from axisbus.drives import drive_file
from axisbus.eds import concise
from axisbus.eds.concise_dcf_values import Configuration, configuration
from axisbus.eds.io import reader as dictionaries
from axisbus.gateway.opcua import users
from axisbus.record import fault_file
from axisbus.record.columns import AxisForm
from axisbus.record.load import load as load_recording
from axisbus.record.recording_data import RecordedEvent
from axisbus.record.sample_packing import RowForm
from kit.bridge_readers import OF_BRIDGES
from kit.command_line import ROOT
from kit.connection_readers import OF_CONNECTIONS
from kit.frame_readers import OF_FRAMES
from kit.reader_limits import Reader

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

[spare]
node = 1
begin = "3s"
swap = { serial = 4712, node_id = 255, revision = 2, software_version = "2.0" }
"""


def _files(*names: str) -> Callable[[Path], list[bytes]]:
    return lambda _: [(ROOT / name).read_bytes() for name in names]


def _dcf(_: Path) -> list[bytes]:
    """Return an EDS with two values and the further parts of a DCF."""
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


def _fault(folder: Path) -> list[bytes]:
    """Return a fault that a core has kept, of two axes."""
    form = AxisForm(100.0, 100.0, 0.001, {"position": "deg", "velocity": "deg/s", "torque": "N·m", "": ""})
    row = RowForm(2).struct
    rows = b"".join(row.pack(now, *[1, 2, 3, 4, 5, 0, 8, 0x1237, 3, 2, 255] * 2) for now in range(20))
    facts = {"began_ns": "1000000000", "began_monotonic_ns": "0"}
    path = folder / "one.fault"
    fault_file.write(path, {"x": form, "y": form}, rows, [RecordedEvent(1.0, "nmt", "node 1", "lost")], facts)
    return [path.read_bytes()]


def _users(_: Path) -> list[bytes]:
    return [f"# who may call\n{users.line_of('anna', 'right', b's' * 16)}\n".encode()]


def _nameplates(_: Path) -> list[bytes]:
    plate = Nameplate(1, "ACME", 0x123, 7, 0x10001, 4711, "servo", None, "1.2", 15_430, 0, "x.eds", "ab" * 32)
    return [nameplate.as_json([plate, replace(plate, node=2)], "cell.toml", "2026-11-29 12:00:00").encode()]


def _compared_nameplates(path: Path) -> object:
    _, plates = nameplate.parse(path.read_bytes().decode("utf-8", "replace"), str(path))
    return nameplate.changes(plates, plates[::-1]), nameplate.as_markdown(plates, "cell.toml", "")


def _notes(_: Path) -> list[bytes]:
    return [UnfinishedReplacement(1, 4712, sets_node_id=True).as_json().encode()]


def _note(path: Path) -> object:
    return parse_note(path.read_bytes().decode("utf-8", "replace"), str(path))


def _frames(path: Path) -> object:
    return sum(1 for _ in frame_files.read(path, frame_files.SkippedLines()))


def _faults(path: Path) -> object:
    return load_faults(path, cells.load(ROOT / "examples" / "cell.toml"))


OF_FILES: dict[str, Reader] = {
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
    "kept fault": Reader(".fault", _fault, load_recording),
    "users": Reader(".txt", _users, users.read),
    "drive file": Reader(
        ".toml",
        _files("src/axisbus/drives/vendors/maxon_epos4.toml", "src/axisbus/drives/vendors/nanotec.toml"),
        drive_file.load,
    ),
    "nameplates": Reader(".json", _nameplates, _compared_nameplates),
    "notes of replacements": Reader(".json", _notes, _note),
}
READERS: dict[str, Reader] = {**OF_FILES, **OF_FRAMES, **OF_CONNECTIONS, **OF_BRIDGES}
