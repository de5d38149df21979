"""axisbus as on Windows and macOS, as far as Linux can play them (``kit.other_system``)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from kit.other_system import OF_EXTRAS, SYSTEMS, played
from kit.pages import ROOT

EDS = ROOT / "eds" / "gim6010-8.eds"
CELL = str(ROOT / "examples" / "cell.toml")
PLATFORM_PAGE = "more:     axisbus explain not-on-this-system"

each_system = pytest.mark.parametrize("system", SYSTEMS)


def prints(system: str, *words: str, folder: Path, code: int = 0) -> str:
    """What axisbus prints on a system, with the line ends of Linux."""
    ran = played(system, *words, folder=folder)
    text = (ran.stdout + ran.stderr).decode("cp1252" if system == "win32" else "utf-8")
    assert ran.returncode == code, text
    assert "Traceback" not in text
    return text.replace("\r\n", "\n")


def answer(system: str, program: str, folder: Path, *, others: str = "") -> str:
    ran = played(system, code=program, folder=folder, others=others)
    assert ran.returncode == 0, ran.stderr.decode()
    return ran.stdout.decode().replace("\r\n", "\n").strip()


# -- imports -------------------------------------------------------------------------------------------------------------

IMPORTS = """
import importlib, pkgutil, axisbus
names = [each.name for each in pkgutil.walk_packages(axisbus.__path__, "axisbus.") if not each.name.endswith("__main__")]
for name in names:
    importlib.import_module(name)
print(len(names))
"""


@each_system
def test_every_module_can_be_imported(system, tmp_path):
    assert int(answer(system, IMPORTS, tmp_path, others=OF_EXTRAS)) > 900


@each_system
def test_a_played_system_lacks_what_the_real_one_lacks(system, tmp_path):
    program = """
import importlib, os, signal, socket, sys
def lacks(name):
    try:
        importlib.import_module(name)
    except ImportError:
        return True
print(sys.platform, lacks("fcntl"), lacks("termios"), *(hasattr(*each) for each in (
    (os, "fork"), (os, "memfd_create"), (signal, "SIGHUP"), (socket, "AF_UNIX"), (socket, "AF_CAN"), (os, "pidfd_open"))))
"""
    missing = "True True False False False False" if system == "win32" else "None None True False True True"
    assert answer(system, program, tmp_path) == f"{system} {missing} False False"


# -- the EDS workbench, the checks, recordings, motion in virtual time ---------------------------------------------------------


@each_system
@pytest.mark.parametrize("end", [b"\n", b"\r\n"], ids=["LF", "CRLF"])
def test_an_eds_file_is_shown_checked_fixed_and_compared_and_keeps_its_line_ends(system, end, tmp_path):
    text = EDS.read_text("utf-8").replace("\nSupportedObjects=", "\nSupportedObjects=9").encode()
    text = text.replace(b"\n", end)
    (tmp_path / "drive.eds").write_bytes(text)
    assert "GIM6010-8 by CyberBeast" in prints(system, "eds", "show", "drive.eds", folder=tmp_path)
    assert "SupportedObjects" in prints(system, "eds", "check", "drive.eds", folder=tmp_path, code=1)
    assert "+SupportedObjects=" in prints(
        system, "eds", "fix", "drive.eds", "-o", "fixed.eds", folder=tmp_path
    )
    fixed = (tmp_path / "fixed.eds").read_bytes()
    assert b"SupportedObjects=9" not in fixed
    assert fixed.count(b"\n") == fixed.count(end) == text.count(end)
    told = prints(system, "eds", "diff", "drive.eds", "fixed.eds", folder=tmp_path)
    assert "no difference in meaning" in told
    prints(system, "eds", "doc", "drive.eds", "-o", "drive.html", folder=tmp_path)
    assert b"GIM6010-8" in (tmp_path / "drive.html").read_bytes()


def test_a_letter_that_a_terminal_of_windows_lacks_ends_no_command(tmp_path):
    text = EDS.read_text("utf-8").replace("ProductName=GIM6010-8", "ProductName=电机 λ")
    (tmp_path / "drive.eds").write_text(text, encoding="utf-8", newline="")
    assert "?? ? by CyberBeast" in prints("win32", "eds", "show", "drive.eds", folder=tmp_path)


@each_system
def test_a_cell_file_with_the_line_ends_of_windows_is_checked(system, tmp_path):
    text = Path(CELL).read_text("utf-8").replace("../eds/gim6010-8.eds", "builtin:gim6010-8")
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8", newline="\r\n")
    assert "0 errors, 0 warnings" in prints(system, "check", "cell.toml", folder=tmp_path)


@each_system
@pytest.mark.parametrize("process", ["thread", "own"])
def test_a_core_in_its_own_process_is_refused_by_a_check_that_names_the_other_way(system, process, tmp_path):
    text = Path(CELL).read_text("utf-8").replace("../eds/gim6010-8.eds", "builtin:gim6010-8")
    text = text.replace("[bus]", f'[bus]\nprocess = "{process}"')
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8", newline="")
    found = prints(system, "check", "cell.toml", folder=tmp_path, code=int(process == "own"))
    assert (found.count('write process = "thread", or leave it out') == 1) == (process == "own")


@each_system
def test_a_log_of_candump_with_the_line_ends_of_windows_is_decoded(system, tmp_path):
    (tmp_path / "bus.log").write_bytes(b"(1.000000) can0 000#8101\r\n(1.010000) can0 701#00\r\n")
    text = prints(system, "trace", "bus.log", folder=tmp_path)
    assert "reset node" in text
    assert "boot-up" in text


MOTION = f"""
from axisbus import Machine
with Machine.simulated({CELL!r}) as cell:
    x = cell["x"]
    x.enable().wait()
    x.home().wait()
    x.move_absolute(45.0, velocity=90.0).wait()
    print(round(x.position), x.unit)
print(cell["x"].state)
"""


@each_system
def test_an_axis_moves_in_virtual_time_and_is_stopped_at_the_end(system, tmp_path):
    assert answer(system, MOTION, tmp_path) == "45 deg\nAxisState.DISABLED"


# -- simulated drives in real time: the core in a thread -----------------------------------------------------------------------


@each_system
def test_the_demo_moves_the_simulated_cell_at_real_speed(system, tmp_path):
    text = prints(system, "demo", folder=tmp_path)
    assert "every axis has been halted and disabled" in text
    assert (tmp_path / "demo-output" / "recording.csv").exists()


BUSY = f"""
import hashlib, signal, threading, time
from axisbus import Machine
moment = {{}}

def interrupt(session):
    signal.raise_signal(signal.SIGINT)
    while session.leaving_because is None:
        time.sleep(0.01)
    moment["heard"] = time.monotonic()

try:
    with Machine.open({CELL!r}) as cell:
        x = cell["x"]
        x.enable().wait()
        x.home().wait()
        x.move_velocity(20.0)
        threading.Timer(0.2, interrupt, (cell.session,)).start()
        hashlib.pbkdf2_hmac("sha256", b"", b"", ROUNDS)  # one call, in which no handler of a signal can run
        moment["done"] = time.monotonic()
        time.sleep(60)
except KeyboardInterrupt:
    print(cell["x"].state, moment.get("done", time.monotonic()) - moment["heard"] > 0.5)
"""


@each_system
def test_ctrl_c_stops_an_axis_while_the_program_is_in_a_long_call(system, tmp_path):
    program = BUSY.replace("ROUNDS", str(rounds(3.0)))
    assert answer(system, program, tmp_path) == "AxisState.DISABLED True"


def rounds(seconds: float) -> int:
    """How many rounds of the call take at least this long on this computer."""
    import hashlib
    import time

    began = time.perf_counter()
    hashlib.pbkdf2_hmac("sha256", b"", b"", 1_000_000)
    return int(seconds / (time.perf_counter() - began) * 1_000_000)


def test_another_receiver_of_the_numbers_of_signals_gets_them_on_windows(tmp_path):
    program = f"""
import signal, socket, time
from axisbus import Machine
near, far = socket.socketpair()
far.setblocking(False)
signal.set_wakeup_fd(far.fileno())
try:
    with Machine.open({CELL!r}) as cell:
        signal.raise_signal(signal.SIGINT)
        time.sleep(10)
except KeyboardInterrupt:
    near.settimeout(5)
    print(near.recv(1))
"""
    assert answer("win32", program, tmp_path) == repr(b"\x02")


# -- refusals ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("system", "words", "message"),
    [
        *(
            (system, ("run", CELL), "no other program can join a machine on this system")
            for system in SYSTEMS
        ),
        *(
            (system, ("bridge", "metrics", CELL, "--port", "0"), "no other program can join a machine")
            for system in SYSTEMS
        ),
        *((system, ("boot", "socketcan.toml"), "SocketCAN is a part of Linux") for system in SYSTEMS),
        ("win32", ("jog", CELL, "x"), "a Windows terminal cannot be read key by key"),
        ("win32", ("sim", CELL, "--control", "drives"), "sockets with a path are not available on Windows"),
        ("win32", ("sim", "--modbus", "1"), "there are no pseudo-terminals on Windows"),
    ],
)
def test_what_a_system_lacks_is_refused_with_what_works_instead(system, words, message, tmp_path):
    text = Path(CELL).read_text("utf-8").replace("../eds/gim6010-8.eds", "builtin:gim6010-8")
    text = text.replace('interface = "sim"', 'interface = "socketcan"\nchannel = "can0"')
    (tmp_path / "socketcan.toml").write_text(text, encoding="utf-8", newline="")
    found = prints(system, *words, folder=tmp_path, code=1)
    assert message in found
    assert "remedy:" in found
    assert PLATFORM_PAGE in found


# -- one owner of a channel ----------------------------------------------------------------------------------------------


@each_system
def test_a_second_program_does_not_get_the_channel_until_the_first_has_ended(system, tmp_path):
    take = """
from axisbus.bus.link import ownership
from axisbus.errors import SecondMasterError
try:
    with ownership.take("pcan", "PCAN_USBBUS1"), ownership.take("pcan", "PCAN_USBBUS2"):
        WHILE
        print("taken")
except SecondMasterError as error:
    print("refused", error.heard[0].startswith("process "), error.message)
"""
    environment = {"TMPDIR": str(tmp_path)}
    second = repr(take.replace("WHILE", "pass"))
    first = take.replace(
        "WHILE",
        f"subprocess.run([sys.executable, '-c', {HEADER.format(system=system)!r} + {second}], check=True)",
    )
    assert held(system, first, tmp_path, environment) == [
        "refused True another program has the CAN channel pcan:PCAN_USBBUS1; nothing was sent",
        "taken",
    ]
    assert held(system, take.replace("WHILE", "os._exit(0)"), tmp_path, environment) == []
    assert held(system, take.replace("WHILE", "pass"), tmp_path, environment) == ["taken"]


HEADER = "import os, subprocess, sys; from kit.other_system import play; play({system!r})\n"


def held(system: str, program: str, folder: Path, environment: dict[str, str]) -> list[str]:
    path = os.pathsep.join([str(ROOT / "src"), str(ROOT / "tests")])
    ran = subprocess.run(
        [sys.executable, "-u", "-c", HEADER.format(system=system) + program],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return ran.stdout.splitlines()
