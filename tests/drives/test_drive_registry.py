"""Drive plug-ins of other packages, found by their entry points: a make is added without a change of axisbus."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from axisbus.cell import reader
from axisbus.cell.parameters import axis_parameters
from axisbus.core.files import load_dictionaries
from axisbus.drives import DrivePlugin, registry
from axisbus.drives.plugin import GENERIC
from axisbus.motion.parameters import Handshake
from axisbus.scaffold.match import collect, match
from kit import command_line
from kit.cell import cell_file, with_identity

VENDOR, PRODUCT = 0x00ABCDE, 0x77
CODE = """\
from pathlib import Path

from axisbus.drives import Behaviour, DrivePlugin, FaultTexts

SERVO = DrivePlugin(
    name="Stranger servo",
    vendor_id=0xABCDE,
    eds_files=(str(Path(__file__).parent / "stranger.eds"),),
    behaviour=Behaviour(handshake="on-change", store_restarts=True),
    explain=FaultTexts({0xFF42: "the flux capacitor is empty"}),
)
"""
TOML = """\
name = "Stranger stepper"
vendor_id = 0xABCDE
product_codes = [0x99]
[errors]
FF43h = "lost steps"
"""


Install = Callable[..., Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Return a function that installs a package of a stranger with these entry points, as pip would leave it."""
    site = tmp_path / "site-packages"

    def installed(entry_points: str, code: str = CODE, package: str = "stranger_drives") -> Path:
        home = site / package
        (home / "makes").mkdir(parents=True)
        (home / "__init__.py").write_text(code, encoding="utf-8")
        (home / "stranger.eds").write_text(with_identity(VENDOR, PRODUCT), encoding="utf-8")
        (home / "makes" / "__init__.py").write_text("", encoding="utf-8")
        (home / "makes" / "stepper.toml").write_text(TOML, encoding="utf-8")
        info = site / f"{package}-1.2.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n")
        (info / "entry_points.txt").write_text(f"[axisbus.drives]\n{entry_points}\n")
        monkeypatch.syspath_prepend(site)
        registry.installed.cache_clear()
        return site

    yield installed
    registry.installed.cache_clear()
    for name in [name for name in sys.modules if name.startswith("stranger_drives")]:
        del sys.modules[name]


BOTH = "servo = stranger_drives:SERVO\nsteppers = stranger_drives.makes"


def cell_of(site: Path) -> Path:
    return cell_file(site.parent, eds=str(site / "stranger_drives" / "stranger.eds"))


def test_a_package_adds_a_make_with_behaviour_and_fault_texts(install: Install) -> None:
    cell = reader.load(cell_of(install(BOTH)))
    found = axis_parameters(cell, "x", load_dictionaries(cell)[1])
    assert found.handshake is Handshake.ON_CHANGE
    assert found.explain_fault(0xFF42, {}) == ["the flux capacitor is empty"]
    assert registry.find(VENDOR, PRODUCT).behaviour.store_restarts


def test_a_package_may_contain_drive_files(install: Install) -> None:
    install(BOTH)
    assert registry.find(VENDOR, 0x99).name == "Stranger stepper"
    assert registry.find(VENDOR, 0x99).explain(0xFF43, {}) == ["lost steps"]
    assert registry.find(VENDOR, PRODUCT).name == "Stranger servo"


def test_an_eds_of_a_plug_in_is_proposed_for_its_drives(install: Install) -> None:
    site = install(BOTH)
    known, unreadable = collect(())
    assert unreadable == []
    chosen = match(known, 1, VENDOR, PRODUCT, None).chosen
    assert chosen is not None
    assert chosen.spec == str(site / "stranger_drives" / "stranger.eds")


def test_the_plug_in_of_a_package_precedes_that_of_axisbus(install: Install) -> None:
    install("servo = stranger_drives:SERVO", CODE.replace("0xABCDE", "0x0C0B00"))
    assert registry.find(0x0C0B00, 1).name == "Stranger servo"


@pytest.mark.parametrize(
    ("code", "entry", "error"),
    [
        ("import nothing_like_this\n", "stranger_drives:SERVO", "ModuleNotFoundError: No module named"),
        (CODE, "stranger_drives:WRONG", "has no attribute 'WRONG'"),
        ("SERVO = 5\n", "stranger_drives:SERVO", "TypeError: this is not a DrivePlugin"),
        ("1 / 0\n", "stranger_drives:SERVO", "ZeroDivisionError"),
    ],
)
def test_a_plug_in_that_fails_is_named_and_stops_no_other(
    install: Install, code: str, entry: str, error: str
) -> None:
    install(f"broken = {entry}", code)
    (broken,) = [each for each in registry.installed() if each.error]
    assert (broken.name, broken.origin, broken.plugins) == ("broken", "stranger_drives 1.2", ())
    assert error in broken.error
    assert broken.remedy == "update or uninstall the package stranger_drives"
    assert registry.find(0x9A, 0x30923).name == "Elmo Gold"


def test_a_drive_file_with_an_error_in_a_package_is_named_with_its_line(install: Install) -> None:
    site = install("steppers = stranger_drives.makes")
    (site / "stranger_drives" / "makes" / "stepper.toml").write_text(TOML + "x = 1\n", encoding="utf-8")
    (broken,) = [each for each in registry.installed() if each.error]
    assert "stepper.toml:6: x in [errors] cannot be used" in broken.error


def test_a_failed_plug_in_is_reported_by_the_check_of_a_cell_with_an_unknown_drive(
    install: Install, axisbus: command_line.Run
) -> None:
    path = cell_of(install("broken = stranger_drives:SERVO", "1 / 0\n"))
    result = axisbus("check", path)
    assert "drive plug-in broken" in result.out
    assert "ZeroDivisionError" in result.out


def test_the_command_lists_and_shows_plug_ins(install: Install, axisbus: command_line.Run) -> None:
    install(BOTH)
    listed = axisbus("drives", "list")
    assert listed.code == 0
    assert "Stranger servo    " in listed.out
    assert "(stranger_drives 1.2)" in listed.out
    assert "Elmo Gold" in listed.out
    shown = axisbus("drives", "show", "stranger servo").out
    assert 'handshake = "on-change"' in shown
    assert "FF42h  the flux capacitor is empty" in shown
    assert "stranger.eds" in shown


def test_the_command_lists_a_plug_in_that_failed(install: Install, axisbus: command_line.Run) -> None:
    install("broken = stranger_drives:SERVO", "1 / 0\n")
    result = axisbus("drives", "list")
    assert result.code == 1
    assert "FAILED: broken (stranger_drives 1.2): stranger_drives:SERVO: ZeroDivisionError" in result.out
    assert "Elmo Gold" in result.out


def test_explain_has_the_texts_of_the_makes(install: Install, axisbus: command_line.Run) -> None:
    install(BOTH)
    assert "Stranger servo: the flux capacitor is empty" in axisbus("explain", "FF42h").out
    assert "Stranger" not in axisbus("explain", "FF44h").out


COMMANDS = (
    CODE
    + """
import click


@click.group("stranger")
def tools() -> None:
    \"\"\"Set up a stranger's servo.\"\"\"


@tools.command("tune")
@click.option("--gain", type=float, required=True, help="In 1/s.")
def tune(gain: float) -> None:
    \"\"\"Set the gain of a stranger's servo.\"\"\"
    click.echo(f"gain {gain:g}")


NOTHING = 5
"""
)


def test_a_package_adds_a_group_of_commands_with_its_help(
    install: Install, axisbus: command_line.Run
) -> None:
    install(f"{BOTH}\n[axisbus_commands]\nstranger = stranger_drives:tools", COMMANDS)
    assert re.search(r"\n  stranger +A command of the package stranger_drives 1\.2\.\n", axisbus("-h").out)
    for option in ("-h", "--help"):
        group, command = axisbus("stranger", option).out, axisbus("stranger", "tune", option).out
        assert "Usage: axisbus stranger [OPTIONS] COMMAND" in group
        assert "Set up a stranger's servo." in group
        assert "  tune  Set the gain of a stranger's servo." in group
        assert "Usage: axisbus stranger tune [OPTIONS]" in command
        assert "In 1/s.  [required]" in command
    assert axisbus("stranger", "tune", "--gain", "2.5")[:2] == (0, "gain 2.5\n")


@pytest.mark.parametrize(
    ("code", "entry", "error"),
    [
        ("1 / 0\n", "stranger_drives:tools", "ZeroDivisionError: division by zero"),
        (COMMANDS, "stranger_drives.cli:tools", "ModuleNotFoundError"),
        (COMMANDS, "stranger_drives:wrong", "AttributeError"),
        (COMMANDS, "stranger_drives:NOTHING", "stranger_drives:NOTHING is not a command of click"),
    ],
)
@pytest.mark.parametrize("words", [(), ("-h",), ("tune", "--gain", "1")])
def test_a_command_of_a_package_that_fails_is_named_and_stops_no_other(
    install: Install, axisbus: command_line.Run, code: str, entry: str, error: str, words: tuple[str, ...]
) -> None:
    install(f"[axisbus_commands]\nstranger = {entry}", code)
    result = axisbus("stranger", *words)
    assert result.code == 1
    assert "the command stranger of the package stranger_drives 1.2 cannot be loaded" in result.err
    assert error in result.err
    assert "update or uninstall the package stranger_drives 1.2" in result.err
    assert "A command of the package stranger_drives" in axisbus("-h").out
    assert axisbus("no-such-command").code == 2
    assert axisbus("drives", "list").code == 0


def test_a_command_of_axisbus_is_not_replaced_by_a_package(
    install: Install, axisbus: command_line.Run
) -> None:
    install("[axisbus_commands]\nmove = stranger_drives:tools", COMMANDS)
    assert "stranger" not in axisbus("-h").out
    assert "Usage: axisbus move" in axisbus("move", "-h").out


def test_nothing_is_loaded_before_a_plug_in_is_needed() -> None:
    code = (
        "import sys, axisbus.cell.parameters, axisbus.drives.registry\n"
        "print(sorted(name for name in sys.modules if name.startswith('axisbus.drives.gim6010.make')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_drive_without_a_vendor_is_generic() -> None:
    plugin: DrivePlugin = registry.find(None, None)
    assert plugin is GENERIC
