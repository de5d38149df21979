"""The tests on each Python of this computer, with the lowest versions of the dependencies, and each extra alone: ``make matrix``.

``nox -s tests`` runs all tests that need no real time, on each Python; ``make matrix`` runs the sessions ``smoke``, ``lowest`` and
``extra``. A Python of pyenv is found without being in the path.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import nox

ROOT = Path(__file__).parent
sys.path.insert(0, str(ROOT / "tests"))

from dist import found_pythons  # noqa: E402

HIGHEST = ROOT / "tests" / "highest.txt"
PYTHONS = [str(python) for python in found_pythons()]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
QUICK = (
    "tests/eds",
    "tests/cell",
    "tests/check",
    "tests/cia301",
    "tests/cia402",
    "tests/motion",
    "tests/cli/test_cli_examples.py",
)
# For each extra the commands that need its packages, and of a server the text that it prints when it serves.
USES: dict[str, tuple[tuple[str, str], ...]] = {
    "plot": (("demo", ""), ("plot demo-output/recording.csv -o plot.png", "")),
    "record": (
        ("move examples/cell.toml x=10 --home --record run.mcap", ""),
        ("record export run.mcap -o run.parquet", ""),
    ),
    "dbc": (("eds export builtin:gim6010-8 --node 1 -o drive.dbc", ""),),
    "modbus": (("sim --modbus 1 --port 0", "axisbus gim6010"),),
    "usb": (("gim6010 --help", ""),),
    "web": (("web examples/cell.toml --port 0", "open this"),),
    "metrics": (("bridge metrics examples/cell.toml --port 0", "served"),),
    "program": (("program --help", ""),),
    "zenoh": (("bridge zenoh examples/cell.toml --plant hall --listen tcp/127.0.0.1:17447", "waits"),),
    "opcua": (("bridge opcua examples/cell.toml --port 0", "served"),),
    "ros": (("bridge zenoh examples/cell.toml --plant hall --listen tcp/127.0.0.1:17447 --ros", "waits"),),
}


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """Run all tests that need no real time."""
    session.install("-e", ".[dev,plot,record]")
    session.run(
        "python", "-m", "pytest", "-m", "not real_time", "-n", "2", "--dist", "loadfile", *session.posargs
    )


@nox.session(python=PYTHONS[1:])
def smoke(session: nox.Session) -> None:
    """Run the quick tests of some packages on each Python but the first (``make test`` has that), with the versions of HIGHEST."""
    session.install("-e", ".[dev,plot,record]", "-c", str(HIGHEST))
    session.run("python", "-m", "pytest", "-m", "not slow", "-n", "2", "--dist", "loadfile", *QUICK)


@nox.session(python=PYTHONS[:1])
def lowest(session: nox.Session) -> None:
    """Run the tests of ``make test`` with the lowest version of each dependency that pyproject.toml allows."""
    # Not in ``session.create_tmp``: its path would be that of the tests' sockets too, for which it is too long.
    constraints = Path(session.virtualenv.location) / "lowest.txt"
    constraints.write_text("\n".join(lowest_versions()) + "\n", encoding="utf-8")
    session.install("-e", ".[dev,plot,record]", "-c", str(constraints))
    chosen = session.posargs or ["-m", "not real_time and not sweep"]
    session.run("python", "-m", "pytest", "-n", "2", "--dist", "loadfile", *chosen)


def lowest_versions() -> list[str]:
    """Return a constraint for each dependency of the package and of its extras for users; those of the tests may be newer.

    The lowest matplotlib warns of functions that a newer pyparsing has renamed, and a warning fails a test.
    """
    extras = PROJECT["optional-dependencies"]
    wanted = [*PROJECT["dependencies"], *(text for name in USES for text in extras[name])]
    found = (re.match(r"([\w.-]+)>=([\w.]+)", text) for text in wanted)
    return [*sorted({f"{each[1]}=={each[2]}" for each in found if each is not None}), "pyparsing<3.3"]


@nox.session(python=PYTHONS[:1])
@nox.parametrize("name", list(USES))
def extra(session: nox.Session, name: str) -> None:
    """Install one extra alone, and run the commands that it is for: nothing may need a package of another extra."""
    session.install(f".[{name}]")
    folder = Path(session.create_tmp()).resolve()
    binary = Path(session.bin).resolve() / "axisbus"
    session.chdir(folder)
    session.run(str(binary), "examples", "copy", "examples", external=True)
    for line, text in USES[name]:
        if not text:
            session.run(str(binary), *line.split(), external=True)
        elif not serves([str(binary), *line.split()], folder, text):
            session.error(f"axisbus {line} did not print {text!r}, or did not end well on Ctrl-C")


def serves(command: list[str], folder: Path, text: str) -> bool:
    """Start a server, wait until it prints ``text``, and end it by Ctrl-C; return whether both went well."""
    running = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert running.stdout is not None
    there = any(text in line for line in running.stdout)
    running.send_signal(signal.SIGINT)
    running.stdout.read()
    return there and running.wait(30) in (0, 130)  # 130: ended by Ctrl-C
