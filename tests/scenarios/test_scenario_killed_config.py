"""``axisbus config`` killed with SIGKILL at any point: the next run names the differences, and completes."""

from __future__ import annotations

import itertools
import json
import os
import signal
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from axisbus.eds import builtin, dcf, load, writer
from axisbus.eds.assign import entry
from axisbus.eds.io import reader
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from kit.scenarios.program import Program
from kit.scenarios.simulated_bus import until
from kit.scenarios.socket_bridge import Bridge

EDS = "builtin:generic-cia402"
PATH = builtin.resolve(EDS, Path())
NODE = 5
CHANNELS = (f"killed-{os.getpid()}-{number}" for number in itertools.count())
KILLED = -signal.SIGKILL

# The values of the DCF of this scenario, by hand: settings, and TPDO 1 with another mapping, event-driven, on its usual COB-ID.
SETTINGS = {(0x6081, 0): 123_456, (0x6083, 0): 7_654_321, (0x607D, 1): -50_000, (0x607D, 2): 50_000}
PDO = {
    (0x1800, 1): 0x4000_0185,
    (0x1800, 2): 254,
    (0x1A00, 0): 2,
    (0x1A00, 1): 0x6064_0020,
    (0x1A00, 2): 0x6077_0010,
}
WANTED = {**SETTINGS, **PDO}

pytestmark = pytest.mark.timeout(300)


class Drive:
    """A drive in this process, on a cable that programs can be plugged to."""

    def __init__(self, simulated_nodes: SimulatedNetwork, channel: str, folder: Path) -> None:
        self.simulated_nodes = simulated_nodes
        self.device = simulated_nodes.devices[0]
        self.channel = channel
        self.folder = folder

    def held(self) -> dict[tuple[int, int], int]:
        """Its values of the objects of the DCF."""
        with self.simulated_nodes.lock:
            return {key: self.device.read(*key) for key in WANTED}

    @contextmanager
    def plugged(self, *arguments: str, die_in: str = "-") -> Iterator[subprocess.Popen[str]]:
        """Start ``axisbus ARGUMENTS`` at the other end."""
        here, there = socket.socketpair()
        options = ("-i", "virtual", "-c", "there")
        with closing(Bridge(self.channel, here)):
            command = (str(there.fileno()), "there", die_in, *arguments, *options)
            with Program("command_process", *command, pass_fds=(there.fileno(),)) as program:
                there.close()
                yield program.process

    def axisbus(self, *arguments: str, die_in: str = "-") -> tuple[int, str]:
        """Run a command to its end; return its exit code and its output."""
        with self.plugged(*arguments, die_in=die_in) as process:
            out, errors = process.communicate()
            assert process.returncode in (0, 1, KILLED), errors
            return process.returncode, out

    def killed_after(self, happens: Callable[[Callable[[], None]], None], *arguments: str) -> None:
        """Run a command and kill it at the drive's signal; the drive has executed the request, and the answer is lost."""
        with self.plugged(*arguments) as process:
            with self.simulated_nodes.lock:
                happens(process.kill)
            out, errors = process.communicate()
            assert process.returncode == KILLED, (out, errors)

    def written(self, key: tuple[int, int]) -> Callable[[Callable[[], None]], None]:
        """Signal when this object is written."""

        def arm(kill: Callable[[], None]) -> None:
            armed = [kill]
            self.device.dictionary.on_write(key[0] << 8 | key[1], lambda _: armed.pop()() if armed else None)

        return arm

    def read_times(self, number: int) -> Callable[[Callable[[], None]], None]:
        """Signal when that many objects have been read."""
        dictionary = self.device.dictionary
        upload = dictionary.upload
        count = itertools.count(1)

        def counted(index: int, subindex: int) -> bytes:
            data = upload(index, subindex)
            if next(count) == number:
                dictionary.upload = upload  # type: ignore[method-assign]
                kill()
            return data

        kill: Callable[[], None]

        def arm(wanted: Callable[[], None]) -> None:
            nonlocal kill
            kill = wanted
            dictionary.upload = counted  # type: ignore[method-assign]

        return arm


@pytest.fixture
def drive(tmp_path: Path) -> Iterator[Drive]:
    channel = next(CHANNELS)
    with SimulatedNetwork(channel, [device_from_eds(load(PATH), NODE)]) as simulated_nodes:
        drive = Drive(simulated_nodes, channel, tmp_path)
        until(lambda: drive.device.drives[0].statusword & 0x6F == 0x40)
        yield drive


@pytest.fixture
def file(tmp_path: Path) -> str:
    """A DCF as a user makes it: the drive's EDS with these values."""
    reading = reader.read(PATH.read_bytes(), str(PATH))
    values = [
        (entry(reading.eds, f"{index:04X}:{sub}"), str(value)) for (index, sub), value in WANTED.items()
    ]
    path = tmp_path / "x.dcf"
    path.write_bytes(writer.dumps(dcf.make(reading, dcf.Settings(NODE, 1000), values)))
    return str(path)


def test_a_restore_that_is_killed_repeatedly_continues_with_the_values_that_differ(
    drive: Drive, file: str
) -> None:
    """In the reading; with the PDO switched off; between settings; with it half filled; whole but off; before the last look."""
    factory = drive.held()
    restore = ("config", "restore", file, str(NODE))
    drive.killed_after(drive.read_times(8), *restore)
    assert drive.held() == factory
    for key in ((0x1800, 1), (0x607D, 2), (0x1A00, 1), (0x1A00, 0), (0x1800, 1)):
        drive.killed_after(drive.written(key), *restore)
        assert _reported_differences(drive, file) == _differing(drive)
    code, out = drive.axisbus(*restore, "--json")
    assert (code, json.loads(out)["ok"]) == (0, True)
    assert drive.held() == WANTED
    assert _reported_differences(drive, file) == set()


def _differing(drive: Drive) -> set[tuple[int, int]]:
    held = drive.held()
    return {key for key, value in WANTED.items() if held[key] != value}


def _reported_differences(drive: Drive, file: str) -> set[tuple[int, int]]:
    code, out = drive.axisbus("config", "diff", file, str(NODE), "--json")
    differences = json.loads(out)["differences"]
    assert code == bool(differences)
    return {(each["index"], each["subindex"]) for each in differences}


@pytest.mark.parametrize("die_in", ["before fsync", "after fsync", "before replace", "after replace"])
def test_a_backup_that_is_killed_while_it_writes_leaves_a_whole_file(
    drive: Drive, file: str, die_in: str
) -> None:
    old = Path(file).read_bytes()
    code, _ = drive.axisbus(*_backup(file), die_in=die_in)
    assert code == KILLED
    _require_whole(Path(file), old, new=die_in == "after replace")
    assert drive.axisbus(*_backup(file))[0] == 0
    _require_whole(Path(file), old, new=True)


def test_a_backup_that_is_killed_while_it_reads_leaves_the_file_that_was_there(
    drive: Drive, file: str
) -> None:
    old = Path(file).read_bytes()
    drive.killed_after(drive.read_times(100), *_backup(file))
    assert [each.name for each in Path(file).parent.iterdir()] == ["x.dcf"]
    _require_whole(Path(file), old, new=False)
    assert drive.axisbus(*_backup(file))[0] == 0
    _require_whole(Path(file), old, new=True)


def _backup(file: str) -> tuple[str, ...]:
    return ("config", "backup", str(NODE), "--eds", EDS, "--force", "-o", file)


def _require_whole(path: Path, old: bytes, *, new: bool) -> None:
    """The old file byte by byte; or the new one to its last object, with the values of the drive: its factory setting."""
    if not new:
        assert path.read_bytes() == old
        return
    saved = load(path)
    assert saved.objects.keys() == load(PATH).objects.keys()
    assert saved.objects[0x6081].subs[0].initial(NODE) == 100_000
