"""The C header of a cell: it compiles without a warning, and reads and makes the very frames that master and drives exchange."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from axisbus.cia301.pdo import PdoCodec
from axisbus.machine.machine import Machine
from kit import command_line
from kit.cell import GENERIC, MODULE, SCALE, cell_text
from kit.pages import blocks
from kit.two_axis_drive import two_axis_cell
from kit.virtual_axis import virtual

CC = shutil.which("cc")
needs_compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler (cc)")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Werror")
C, CPP = ("-std=c99",), ("-x", "c++")
EXAMPLES = command_line.ROOT / "examples"
CELLS = ("cell", "io", "probe", "gantry", "encoder")
WITH_POINTS = """
[nodes.9]
eds = "builtin:generic-cia401"
[io.lamp]
node = 9
object = "6200h:01"
bit = 3
safe = 0
[io.pressure]
node = 9
object = "6401h:01"
"""
MAIN = """
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include "cell.h"

int main(void)
{
    unsigned id, octet, n;
    char text[17];
    while (scanf("%x %16s", &id, text) == 2) {
        uint8_t data[8] = {0}, again[8] = {0};
        n = (unsigned)strlen(text) / 2u;
        for (octet = 0; octet < n; octet++) {
            unsigned value;
            if (sscanf(text + 2u * octet, "%2x", &value) != 1) return 2;
            data[octet] = (uint8_t)value;
        }
        switch (id) {
@CASES@
        default: return 3;
        }
        for (octet = 0; octet < n; octet++) printf("%02x", (unsigned)again[octet]);
        printf("\\n");
    }
    return 0;
}
"""
CASE = """
        case @MACRO@_COB_ID: {
            struct @LOWER@ it;
            if (n != @MACRO@_LENGTH) return 4;
            @LOWER@_unpack(data, &it);
            @LOWER@_pack(again, &it);
            @PRINTS@
            break;
        }
"""


@pytest.fixture
def run(monkeypatch, capsys):
    return command_line.runner(monkeypatch, capsys)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A cell of two nodes of one kind, a third of another, one with inputs and outputs, and a virtual axis."""
    path = tmp_path / "cell.toml"
    text = cell_text("xyz").replace(f'[nodes.3]\neds = "{GENERIC}"', f'[nodes.3]\neds = "{MODULE}"')
    path.write_text(f"{text}{virtual()}{WITH_POINTS}", "utf-8")
    return path


def compiled(
    folder: Path,
    main: str = '#include "cell.h"\n#include "cell.h"\nint main(void) { return 0; }\n',
    language=C,
):
    """Compile a program that has the header, and return it."""
    (folder / "main.c").write_text(main)
    made = subprocess.run(
        [CC, *language, *WARNINGS, "-o", folder / "made", folder / "main.c"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stderr[:2000]
    return folder / "made"


def reader(header: str) -> str:
    """A program that reads frames, and prints the content of each, and the frame encoded from it again."""
    cases = []
    for lower, body in re.findall(r"^struct (cell_node\d+_[rt]pdo\d+) {\n(.*?)^};", header, re.M | re.S):
        members = re.findall(r"^    \w+ (\w+);", body, re.M)
        prints = "\n            ".join(f'printf("%" PRId64 " ", (int64_t)it.{member});' for member in members)
        cases.append(
            CASE.replace("@MACRO@", lower.upper()).replace("@LOWER@", lower).replace("@PRINTS@", prints)
        )
    return MAIN.replace("@CASES@", "".join(cases))


@needs_compiler
@pytest.mark.parametrize("language", [C, CPP], ids=["C99", "C++"])
@pytest.mark.parametrize("name", CELLS)
def test_the_header_of_each_example_compiles_without_a_warning(run, tmp_path, name, language):
    source = EXAMPLES / f"{name}.toml"
    code, _, err = run("eds", "code", "--c", "--cell", source, "-o", tmp_path / "cell.h")
    assert (code, err) == (0, "")
    compiled(tmp_path, language=language)


@needs_compiler
@pytest.mark.parametrize("language", [C, CPP], ids=["C99", "C++"])
def test_two_cells_and_a_file_that_both_use_are_included_by_one_source(run, tmp_path, language):
    sources = (
        ["--cell", EXAMPLES / "cell.toml"],
        ["--cell", EXAMPLES / "can_simple.toml"],
        ["builtin:gim6010-8"],
    )
    for number, source in enumerate(sources):
        assert run("eds", "code", "--c", *source, "-o", tmp_path / f"of{number}.h").code == 0
    both = '#include "of0.h"\n#include "of1.h"\n#include "of2.h"\n#include "of0.h"\n'
    compiled(tmp_path, f"{both}int main(void) {{ return (int)GIM6010_8_RPDO1_LENGTH - 7; }}\n", language)


@needs_compiler
def test_the_generated_code_reads_and_makes_the_frames_that_master_and_drives_exchange(run, tmp_path, file):
    assert run("eds", "code", "--c", "--cell", file, "-o", tmp_path / "cell.h").code == 0
    made = compiled(tmp_path, reader((tmp_path / "cell.h").read_text("ascii")))
    with Machine.open(file) as machine:
        planned = {
            pdo.target.cob_id: pdo
            for node in (1, 2, 3, 9)
            for plan in machine.node(node).plans
            for pdo in plan.active
        }
        heard: list[tuple[int, bytes]] = []
        machine.session.tap(
            lambda frames: heard.extend((each.can_id, each.data) for each in frames), tuple(planned)
        )
        for name, target in (("x", 5.0), ("y", -7.5), ("z", -1.25)):
            machine[name].enable().wait(10)
            machine[name].move_absolute(target).wait(20)
        time.sleep(0.2)
        frames = list(heard)  # before the machine is left
        positions = [machine.session.snapshots[name].position for name in "xyz"]
    told = subprocess.run(
        [made],
        input="".join(f"{can_id:x} {data.hex()}\n" for can_id, data in frames),
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    last = {}
    for (can_id, data), line in zip(frames, told, strict=True):
        *values, again = line.split()
        pdo = planned[can_id]
        last[can_id] = tuple(map(int, values))
        assert last[can_id] == PdoCodec(pdo.target.mapping, pdo.signed).unpack(data)
        assert bytes.fromhex(again) == data
    assert last.keys() >= {0x181, 0x182, 0x183, 0x201, 0x202, 0x203}
    assert len(set(frames)) > 50
    for node, position in enumerate(positions, 1):
        assert last[0x180 + node][-1] == position
        assert last[0x180 + node][0] & 0x6F == 0x27  # operation enabled
    assert [round(position / SCALE, 1) for position in positions] == [5.0, -7.5, -1.2]


@needs_compiler
def test_the_program_on_the_page_compiles_with_the_header_that_it_names(run, tmp_path):
    assert run("eds", "code", "--c", "--cell", EXAMPLES / "cell.toml", "-o", tmp_path / "cell.h").code == 0
    (shown,) = blocks(command_line.ROOT / "docs" / "eds-workbench.md", "c")
    prototype = "void on_frame(unsigned id, const uint8_t *data, unsigned length);\n"
    main = "int main(void) { on_frame(0u, 0, 0u); return 0; }\n"
    use = shown.replace(
        "/* seen.statusword, seen.position_actual_value, ... */",
        "(void)seen.statusword, (void)seen.position_actual_value;",
    )
    assert use != shown
    compiled(tmp_path, f'#include "cell.h"\n{prototype}{use}{main}')


def test_one_node_is_named_by_its_number_or_by_an_axis(run, file):
    whole, third = (
        run("eds", "code", "--c", "--cell", file),
        run("eds", "code", "--c", "--cell", file, "--node", 3),
    )
    assert run("eds", "code", "--c", "--cell", file, "--axis", "z") == third
    assert (whole.code, third.code) == (0, 0)
    assert re.findall(r"#define CELL_NODE(\d+)_ID", whole.out) == ["1", "2", "3", "9"]
    assert re.findall(r"#define CELL_NODE(\d+)_ID", third.out) == ["3"]
    assert "/* Node 3: axis z */" in third.out
    assert "/* Node 9: inputs and outputs lamp, pressure */" in whole.out
    assert whole.out.count("#define GENERIC_CIA402_STATUSWORD_INDEX") == 1  # of two nodes
    assert "GENERIC_CIA402_" not in third.out
    assert "#define CELL_NODE3_TPDO1_COB_ID 0x183u" in third.out
    assert "#define CELL_NODE3_TPDO1_TRANSMISSION_TYPE 1u" in third.out


@needs_compiler
def test_files_with_similar_names_have_different_prefixes(run, tmp_path):
    for name in ("a/drive.eds", "b/drive.eds", "drive_controlword.eds"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        shutil.copy(command_line.ROOT / "eds" / "generic-cia402.eds", path)
    text = cell_text("xyz")
    for node, name in enumerate(("a/drive.eds", "b/drive.eds", "drive_controlword.eds"), 1):
        text = text.replace(f'[nodes.{node}]\neds = "{GENERIC}"', f'[nodes.{node}]\neds = "{name}"')
    (tmp_path / "cell.toml").write_text(text, "utf-8")
    assert run("eds", "code", "--c", "--cell", tmp_path / "cell.toml", "-o", tmp_path / "cell.h").code == 0
    compiled(tmp_path)
    header = (tmp_path / "cell.h").read_text("ascii")
    assert {"FILE1_DRIVE", "FILE2_DRIVE", "FILE3_DRIVE_CONTROLWORD"} <= set(
        re.findall(r"#define (\w+)_STATUSWORD_INDEX", header)
    )


@needs_compiler
def test_a_two_axis_drive_has_the_objects_of_both_and_the_pdos_that_there_are(run, tmp_path):
    (tmp_path / "cell.toml").write_text(two_axis_cell(tmp_path), "utf-8")
    assert run("eds", "code", "--c", "--cell", tmp_path / "cell.toml", "-o", tmp_path / "cell.h").code == 0
    compiled(tmp_path)
    header = (tmp_path / "cell.h").read_text("ascii")
    assert "/* Node 1: axes x, y */" in header
    assert {"0x6041u", "0x6841u"} <= set(re.findall(r"#define TWO_STATUSWORD\w*_INDEX (\w+)", header))
    assert (
        "/* 6840h (Controlword) is transmitted by SDO: an RPDO with room for it does not exist */" in header
    )
    assert "6040h (Controlword) travels" not in header
    # The file has no PDOs for the second axis.
    mapped = re.findall(r"; /\* ([0-9A-F]{4}), ", header)
    assert mapped
    assert not [index for index in mapped if index.startswith("68")]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--node", "7"), "the cell has no node 7"),
        (("--axis", "q"), "the cell has no axis 'q'"),
        (("--axis", "v"), "axis v is virtual: it has no PDOs"),
        (("--axis", "x", "--node", "1"), "--axis needs --cell, and excludes --node"),
        (("builtin:generic-cia402",), "both a file and --cell are given"),
    ],
)
def test_a_device_without_pdos_is_refused_with_the_reason(run, file, arguments, said):
    code, out, err = run("eds", "code", "--c", "--cell", file, *arguments)
    assert code in (1, 2)
    assert out == ""
    assert said in err


@pytest.mark.parametrize("which", [("--node", "16"), ("--axis", "m")])
def test_code_for_a_can_simple_module_is_refused_and_the_other_nodes_are_named(run, which):
    cell = EXAMPLES / "can_simple.toml"
    code, _, err = run("eds", "code", "--c", "--cell", cell, *which)
    assert code == 1
    assert "node 16 speaks CAN Simple or Modbus, and not CANopen: it has no PDOs" in err
    assert "--node 40" in err
    whole = run("eds", "code", "--c", "--cell", cell)
    assert re.findall(r"#define CAN_SIMPLE_NODE(\d+)_ID", whole.out) == ["40"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "no input is given"),
        (("--axis", "x", "builtin:generic-cia402"), "--axis needs --cell, and excludes --node"),
        (
            ("--cell", EXAMPLES / "cell.toml", "-o", "x.h"),
            "a Python module cannot contain the PDOs of a cell",
        ),
        (("--c", "--cell", EXAMPLES / "cell.toml", "-o", "x.py"), "not the name of a C header"),
        (("--c", "--cell", "none.toml"), "none.toml"),
    ],
)
def test_invalid_arguments_of_eds_code_are_refused_with_the_reason(run, arguments, said):
    code, out, err = run("eds", "code", *arguments)
    assert code in (1, 2)
    assert out == ""
    assert said in err
