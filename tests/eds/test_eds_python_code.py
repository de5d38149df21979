"""The Python module made from an EDS: it compiles, its names are unique, it has the values of the file, and tools accept it."""

from __future__ import annotations

import ast
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import pytest

from axisbus.eds import Eds, Number, load, loads
from axisbus.eds.report import codegen, naming
from kit.eds.samples import BUILTIN, CORPUS, EVERY_TENTH, builtin, small
from kit.eds.texts import record, variable

ROOT = Path(__file__).parents[2]


def run(eds: Eds, node_id: int | None = None) -> Any:
    """Return the module that the text makes."""
    module = types.ModuleType("made")
    sys.modules["made"] = module  # dataclasses look their module up
    try:
        exec(compile(codegen.module(eds, node_id), "made.py", "exec"), module.__dict__)
    finally:
        del sys.modules["made"]
    return module


def assigned(text: str) -> list[str]:
    """Return every name that the module binds at its top."""
    names: list[str] = []
    for node in ast.parse(text).body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.append(node.target.id)
        elif isinstance(node, ast.Assign):
            names += [target.id for target in node.targets if isinstance(target, ast.Name)]
        elif isinstance(node, ast.ClassDef):
            names.append(node.name)
    return names


@pytest.mark.parametrize("path", BUILTIN, ids=lambda path: path.stem)
def test_every_entry_is_in_the_module_as_the_file_has_it(path: Path) -> None:
    eds = load(path)
    made = run(eds)
    assert [(each.index, each.subindex) for each in made.ENTRIES] == [
        (entry.index, subindex) for entry in eds for subindex in entry.subs
    ]
    for entry in eds:
        for sub in entry.subs.values():
            found = made.BY_ADDRESS[sub.index, sub.subindex]
            assert (int(found.data_type), found.access) == (int(sub.data_type), sub.access)
            assert bool(found.pdo) == sub.pdo_mapping
            assert found.initial(5) == sub.initial(5)
            assert found.low == (sub.low.value if isinstance(sub.low, Number) else sub.low)
    assert {int(each) for each in made.Index} == set(eds.objects)


def test_constants_and_enumerations_of_a_drive() -> None:
    made = run(builtin("gim6010-8"))
    assert (made.STATUSWORD.index, made.STATUSWORD.subindex, made.STATUSWORD.access) == (0x6041, 0, "ro")
    assert made.Index.TARGET_POSITION == 0x607A
    assert made.IDENTITY_OBJECT_VENDOR_ID.default == made.DEVICE_VENDOR_ID == 0xC0B00
    assert made.ModeOfOperation(8).name == "CYCLIC_SYNC_POSITION"
    assert {int(mode) for mode in made.SUPPORTED_MODES} == {1, 6, 7, 9, 10, 11}  # bits 0, 5, 6, 8, 9, 10
    assert made.Command.ENABLE_OPERATION == 0x0F
    assert made.StatuswordBit.TARGET_REACHED == 1 << 10
    assert made.ControlwordBit.FAULT_RESET == 0x80
    assert made.QuickStopOption.RAMP_HOLD == 6
    assert made.COB_ID_EMCY.default == 0x80
    assert made.COB_ID_EMCY.initial(5) == 0x85


def test_for_a_node_the_defaults_are_resolved() -> None:
    made = run(builtin("gim6010-8"), 5)
    assert made.MADE_FOR_NODE == 5
    assert (made.COB_ID_EMCY.default, made.COB_ID_EMCY.plus_node_id) == (0x85, False)


def test_a_device_without_a_drive_gets_no_drive_enumerations() -> None:
    bare = codegen.module(load_text("[DeviceInfo]\n" + variable("1000") + variable("2000", DataType="0x6")))
    assert "IntFlag" not in bare
    assert assigned(bare)[-5:] == ["Entry", "THING_1000", "THING_2000", "ENTRIES", "BY_ADDRESS"]


def load_text(text: str) -> Eds:
    return loads(text.encode(), "bare.eds")


NASTY = "".join(
    variable(f"20{at:02X}", ParameterName=name)
    for at, name in enumerate(
        (
            'He said """x""" \\',
            "import",
            "class",
            "Entry",
            "ENTRIES",
            "BY_ADDRESS",
            "SOURCE",
            "2nd value",
            "°C µ Ω",
            "Größe",
            "日本",
            "Value",
            "value",
            "VALUE!",
            "Value 200B",
            "Value_200B",
            "'single' \"double\"",
            "{braces} %s",
            "a" * 241,
            "a" * 241,
        )
    )
)


def test_names_that_are_no_identifiers_or_not_unique_become_ones() -> None:
    text = codegen.module(small(NASTY))
    names = assigned(text)
    assert len(names) == len(set(names))
    made = run(small(NASTY))
    assert [made.BY_ADDRESS[0x2000 + at, 0].name for at in (0, 4, 10, 16)] == [
        'He said """x""" \\',
        "ENTRIES",
        "日本",
        "'single' \"double\"",
    ]
    assert made.VALUE_200B.index == 0x200B
    assert made.VALUE_200C.index == 0x200C
    assert made.ENTRIES_2004.index == 0x2004
    assert made.OBJECT_2007_2ND_VALUE.index == 0x2007
    assert made.GROSSE.index == 0x2009
    assert made.OBJECT_200A.index == 0x200A
    assert text.isascii()


def test_a_nasty_product_name_stays_inside_the_docstring() -> None:
    eds = load_text('[DeviceInfo]\nProductName=X"""\\\nVendorName=end\\"\n' + variable("1000"))
    assert ast.get_docstring(ast.parse(codegen.module(eds))) is not None


def test_sub_indices_are_named_after_their_object() -> None:
    subs = [
        variable(f"2100sub{at}", ParameterName="Gain", DataType="0x6", DefaultValue=str(at)) for at in (1, 2)
    ]
    made = run(small(record("2100", *subs)))
    assert (made.RECORD_GAIN_2100_01.default, made.RECORD_GAIN_2100_02.default) == (1, 2)


def test_values_of_every_kind_are_literals() -> None:
    eds = small(
        variable("2000", DataType="0x8", DefaultValue="1.5")
        + variable("2001", DataType="0x9", DefaultValue='tab\t"quote" ü \\')
        + variable("2002", DataType="0xA", DefaultValue="00FF10")
        + variable("2003", DataType="0x3", DefaultValue="-5", LowLimit="-10", HighLimit="10")
        + variable("2004", DataType="0x7", DefaultValue="$NODEID+0x600")
    )
    made = run(eds)
    values = [made.BY_ADDRESS[0x2000 + at, 0].default for at in range(5)]
    assert values == [eds.objects[0x2000 + at].subs[0].initial(None) for at in range(5)]
    assert values[0] == 1.5
    assert values[2] == b"\x00\xff\x10"
    assert (made.BY_ADDRESS[0x2003, 0].low, made.BY_ADDRESS[0x2003, 0].high) == (-10, 10)
    assert made.BY_ADDRESS[0x2004, 0].initial(3) == 0x603


def test_the_same_file_gives_the_same_text() -> None:
    first, second = (codegen.module(load_text(NASTY_FILE)) for _ in range(2))
    assert first == second
    assert first.encode() == codegen.module(load_text(NASTY_FILE)).encode()


NASTY_FILE = "[DeviceInfo]\n" + NASTY


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Target position", "TARGET_POSITION"),
        ("2nd", "X_2ND"),
        ("", "X"),
        ("+/-", "PLUS"),
        ("a  b--c", "A_B_C"),
    ],
)
def test_constant_names(text: str, name: str) -> None:
    assert naming.constant(text, "X") == name


def test_a_suffixed_name_never_takes_one_that_is_there() -> None:
    wanted = {1: "A", 2: "A", 3: "A_1"}
    names = naming.unique(wanted, str)
    assert names == {1: "A_1_", 2: "A_2", 3: "A_1"}


@pytest.mark.skipif(not CORPUS, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
def test_every_real_file_gives_a_module_with_unique_names() -> None:
    for path in CORPUS:
        text = codegen.module(load(path))
        compile(text, path.name, "exec")
        names = assigned(text)
        assert len(names) == len(set(names)), path.name
        assert "axisbus" not in text.replace("``axisbus eds code``", ""), path.name


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the modules of some files."""
    folder = tmp_path_factory.mktemp("made")
    for at, path in enumerate(EVERY_TENTH[:8]):
        (folder / f"drive_{at}.py").write_text(codegen.module(load(path)), newline="\n")
    (folder / "nasty.py").write_text(codegen.module(small(NASTY)), newline="\n")
    return folder


@pytest.mark.timeout(240)
def test_mypy_strict_accepts_the_modules(written: Path) -> None:
    files = [str(path) for path in sorted(written.glob("*.py"))]
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--config-file=",
        f"--cache-dir={written / 'cache'}",
        *files,
    ]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, cwd=written)
    assert ran.returncode == 0, ran.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ["check", "--isolated"],
        ["check", "--config", str(ROOT / "pyproject.toml")],
        ["format", "--check", "--isolated"],
    ],
)
def test_ruff_accepts_the_modules(written: Path, arguments: list[str]) -> None:
    command = [sys.executable, "-m", "ruff", *arguments, "--no-cache", str(written)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
