"""Build the wheel and the sdist, check them, and try the wheel in a new environment of each Python here: ``make dist``.

``python tests/dist.py [--output dist] [--no-install]``. Both are built twice: the bytes must be the same. The wheel must contain
each file of ``src/axisbus``, each built-in EDS file and each example, and nothing else. The sdist must contain the files that git
tracks, and the wheel is built from it. Then the wheel is installed for each Python of ``PYTHONS`` that is found. In an empty folder
the commands of README's first block run there, its first program, and ``MORE``. Exit code 1 if something is wrong.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

from kit.pages import README, ROOT, blocks

PYTHONS = ("3.11", "3.12", "3.13", "3.14")
# Where each tracked file of the tree lies in the wheel: prefix in the tree, prefix in the wheel.
PLACES = (
    ("src/axisbus/", "axisbus/"),
    ("eds/", "axisbus/eds/builtin/"),
    ("examples/", "axisbus/example_files/"),
)
# Tracked files that neither archive has: the checks and forms of the place where the source is kept.
LEFT_OUT = (".ci/", ".github/")
MORE = (
    "axisbus --version",
    "axisbus boot examples/cell.toml",
    "axisbus eds show builtin:gim6010-8",
    "python examples/read_eds.py",
    "python -m axisbus explain",
)


class Wrong(Exception):
    """Something is wrong with an archive, or with what it installs."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all steps; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "dist")
    parser.add_argument("--no-install", action="store_true", help="only build and check the archives")
    asked = parser.parse_args(arguments)
    try:
        wheel, sdist = built(asked.output)
        check_wheel(wheel)
        check_sdist(sdist)
        print(f"{wheel.name}, {sdist.name}: complete, and the same bytes in two builds", flush=True)
        if not asked.no_install:
            for python in found_pythons():
                try_out(wheel, python)
    except (Wrong, subprocess.CalledProcessError) as error:
        print(f"WRONG: {error}", file=sys.stderr)
        return 1
    return 0


def built(output: Path) -> tuple[Path, Path]:
    """Build twice into ``output``; return the wheel and the sdist.

    Raises:
        Wrong: the two builds differ.
    """
    with tempfile.TemporaryDirectory() as first:
        _build(Path(first))
        shutil.rmtree(output, ignore_errors=True)
        _build(output)
        for once in sorted(Path(first).iterdir()):
            if once.read_bytes() != (output / once.name).read_bytes():
                raise Wrong(f"{once.name} differs between two builds of the same tree")
    (wheel,), (sdist,) = output.glob("*.whl"), output.glob("*.tar.gz")
    return wheel, sdist


def _build(output: Path) -> None:
    # The wheel is built from the sdist, so that the sdist is proved to be complete.
    command = [sys.executable, "-m", "build", "--outdir", str(output), str(ROOT)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode:
        raise Wrong(f"the build failed:\n{ran.stdout}{ran.stderr}")


def tracked() -> list[str]:
    """Return the files that git tracks, relative to the root."""
    ran = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-z"], capture_output=True, check=True)
    return [name for name in ran.stdout.decode().split("\0") if name and (ROOT / name).exists()]


def check_wheel(wheel: Path) -> None:
    """Check that a wheel has each tracked file of the package, the built-in EDS files and the examples, and no other file.

    Raises:
        Wrong: a file is missing or superfluous.
    """
    with zipfile.ZipFile(wheel) as archive:
        there = {
            name for name in archive.namelist() if not PurePosixPath(name).parts[0].endswith(".dist-info")
        }
    wanted = {
        inside + name.removeprefix(prefix)
        for name in tracked()
        for prefix, inside in PLACES
        if name.startswith(prefix)
    }
    _compare(wheel, wanted, there)


def check_sdist(sdist: Path) -> None:
    """Check that an sdist has each tracked file, and no other one but its metadata.

    Raises:
        Wrong: a file is missing or superfluous.
    """
    with tarfile.open(sdist) as archive:
        there = {name.partition("/")[2] for name in archive.getnames()}
    _compare(sdist, {name for name in tracked() if not name.startswith(LEFT_OUT)}, there - {"PKG-INFO"})


def _compare(archive: Path, wanted: set[str], there: set[str]) -> None:
    wrong = [f"without {name}" for name in sorted(wanted - there)]
    wrong += [f"with {name}" for name in sorted(there - wanted)]
    if wrong:
        raise Wrong(f"{archive.name} is built " + ", ".join(wrong[:10]) + (" ..." if len(wrong) > 10 else ""))


def found_pythons() -> Iterator[Path]:
    """Yield an interpreter of each version of ``PYTHONS`` on this computer: in the path, or installed by pyenv."""
    for version in PYTHONS:
        candidates = [shutil.which(f"python{version}")]
        candidates += map(str, sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python")))
        found = next((each for each in candidates if each and _is_version(each, version)), None)
        if found is None:
            print(f"Python {version}: not on this computer, not tried", flush=True)
        else:
            yield Path(found)


def _is_version(python: str, version: str) -> bool:
    text = "import sys; print('%d.%d' % sys.version_info[:2])"
    ran = subprocess.run([python, "-c", text], capture_output=True, text=True, check=False)
    return ran.stdout.strip() == version


def try_out(wheel: Path, python: Path) -> None:
    """Install a wheel into a new environment, and run the commands and the program of README there, in an empty folder.

    Raises:
        Wrong: a command fails.
    """
    with tempfile.TemporaryDirectory() as place:
        environment, empty = Path(place) / "environment", Path(place) / "empty"
        empty.mkdir()
        subprocess.run([python, "-m", "venv", environment], check=True)
        folder = environment / ("Scripts" if os.name == "nt" else "bin")
        inside = folder / "python"
        _run([inside, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel], empty)
        (empty / "first.py").write_text(blocks(README, "python")[0], encoding="utf-8")
        lines = [line for line in blocks(README, "sh")[0].splitlines() if not line.startswith("pip install ")]
        lines += ["python first.py", *MORE]
        for line in lines:
            first, *rest = shlex.split(line, comments=True)
            _run([folder / first, *rest], empty)
        version = subprocess.run(
            [inside, "--version"], capture_output=True, text=True, check=True
        ).stdout.strip()
        print(f"{version}: installed in a new environment, {len(lines)} commands ran", flush=True)


def _run(command: Sequence[Path | str], folder: Path) -> None:
    # Nothing of this checkout or of its environment may help.
    clean = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
    ran = subprocess.run(command, cwd=folder, env=clean, capture_output=True, text=True, check=False)
    if ran.returncode:
        text = " ".join(map(str, command))
        raise Wrong(f"{text} ended with exit code {ran.returncode}:\n{ran.stdout}{ran.stderr}")


if __name__ == "__main__":
    sys.exit(main())
