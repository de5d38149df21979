"""The C header made from an EDS: it compiles without a warning as C and C++, and its functions agree with the file's mapping."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from axisbus.eds import load
from axisbus.eds.report.header import header
from kit import command_line
from kit.eds.samples import BUILTIN, CORPUS, builtin
from kit.eds.texts import read, record, variable

CC = shutil.which("cc")
needs_compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler (cc)")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror")
EVERY_FIFTH = CORPUS[::5]


def compiled(text: str, folder: Path, main: str = "int main(void) { return 0; }", cpp: bool = False) -> Path:
    """Compile a program that has the header, and return it."""
    (folder / "drive.h").write_text(text, "ascii")
    source = folder / f"main.{'cpp' if cpp else 'c'}"
    source.write_text(f'#include <stdio.h>\n#include "drive.h"\n#include "drive.h"\n{main}\n')
    made = folder / "made"
    language = ("-x", "c++") if cpp else ("-std=c99",)
    found = subprocess.run(
        [CC, *language, *WARNINGS, "-o", made, source], capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr[:2000]
    return made


@needs_compiler
@pytest.mark.parametrize("path", [*BUILTIN, *EVERY_FIFTH], ids=lambda path: path.stem)
def test_the_header_compiles_without_a_warning(path: Path, tmp_path: Path) -> None:
    text = header(load(path))
    assert text == header(load(path))
    compiled(text, tmp_path)


@needs_compiler
def test_the_header_compiles_as_cpp_if_there_is_a_compiler(tmp_path: Path) -> None:
    compiled(header(builtin("gim6010-8"), 5), tmp_path, cpp=True)


@needs_compiler
def test_two_different_headers_of_the_same_name_are_a_compile_error(tmp_path: Path) -> None:
    (tmp_path / "other.h").write_text(header(builtin("gim6010-8"), 6), "ascii")
    (tmp_path / "drive.h").write_text(header(builtin("gim6010-8"), 5), "ascii")
    (tmp_path / "main.c").write_text('#include "drive.h"\n#include "other.h"\nint main(void) { return 0; }\n')
    found = subprocess.run(
        [CC, "-std=c99", "-fsyntax-only", tmp_path / "main.c"], capture_output=True, text=True, check=False
    )
    assert found.returncode != 0
    assert "names that begin with GIM6010_8_ to different things" in found.stderr


@needs_compiler
def test_words_of_compilers_are_no_members(tmp_path: Path) -> None:
    words = ("typeof", "Linux", "char16_t", "get", "put", "??/", "int")
    mapped = pdo(1, *(0x2000_0008 + (number << 16) for number in range(len(words))))
    objects = (
        variable(f"200{number}", ParameterName=word, DataType="0x5", PDOMapping="1")
        for number, word in enumerate(words)
    )
    text = header(read(mapped + "".join(objects)))
    compiled(text, tmp_path, cpp=True)
    made = ["-std=gnu99", *WARNINGS, "-fsyntax-only", tmp_path / "main.cpp", "-x", "c", tmp_path / "drive.h"]
    assert subprocess.run([CC, "-x", "c", *made], capture_output=True, check=False).returncode == 0


def pdo(number: int, *mapped: int) -> str:
    """An RPDO of the file: its COB-ID is 200h, 300h, ... and the node ID."""
    offset = number - 1
    return record(
        f"{0x1400 + offset:X}",
        variable(f"{0x1400 + offset:X}sub0", DataType="0x5", DefaultValue="1"),
        variable(f"{0x1400 + offset:X}sub1", DefaultValue=f"$NODEID+0x{0x200 + 0x100 * offset:X}"),
    ) + record(
        f"{0x1600 + offset:X}",
        variable(f"{0x1600 + offset:X}sub0", DataType="0x5", DefaultValue=str(len(mapped))),
        *(
            variable(f"{0x1600 + offset:X}sub{number + 1}", DefaultValue=f"0x{entry:08X}")
            for number, entry in enumerate(mapped)
        ),
    )


MAPPED = "".join(
    (
        pdo(1, 0x2000_0008, 0x2001_0001, 0x2002_0009, 0x0005_0008, 0x2003_0018),
        pdo(2, 0x2004_0020, 0x2005_0010),
        variable("2000", ParameterName="switch", DataType="0x2", PDOMapping="1"),
        variable("2001", ParameterName="Flag", DataType="0x1", PDOMapping="1"),
        variable("2002", ParameterName="Wide", DataType="0x6", PDOMapping="1"),
        variable("2003", ParameterName="Signed */ 24", DataType="0x10", PDOMapping="1"),
        variable("2004", ParameterName="Real", DataType="0x8", PDOMapping="1"),
        variable("2005", ParameterName="Low", DataType="0x3", PDOMapping="1"),
    )
)
MAIN = """
int main(void)
{
    struct test_rpdo1 to, from = {-5, 1u, 0x155u, -3};
    struct test_rpdo2 other = {0.0f, 0}, second = {1.5f, -32768};
    uint8_t data[8] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};
    unsigned at;
    test_rpdo1_pack(data, &from);
    for (at = 0; at < TEST_RPDO1_LENGTH; at++) printf("%02X", (unsigned)data[at]);
    test_rpdo1_unpack(data, &to);
    printf(" %d %u %u %d", to.switch_0, (unsigned)to.flag, (unsigned)to.wide, (int)to.signed_24);
    test_rpdo2_pack(data, &second);
    test_rpdo2_unpack(data, &other);
    printf(" %.1f %d", (double)other.real, other.low);
    printf(" %X %X %X\\n", TEST_RPDO1_COB_ID(5u), TEST_RPDO2_COB_ID(127u), TEST_FLAG_INDEX);
    return 0;
}
"""


@needs_compiler
def test_packed_data_matches_the_mapping_and_unpacks_to_the_same_values(tmp_path: Path) -> None:
    made = compiled(header(read(MAPPED)), tmp_path, MAIN)
    found = subprocess.run([made], capture_output=True, text=True, check=True).stdout.split()
    space = 0xFF << 18  # 8 bits that are not written
    bits = (-5 & 0xFF) | 1 << 8 | 0x155 << 9 | space | (-3 & 0xFF_FFFF) << 26 | 0x3F << 50
    assert found[0] == bits.to_bytes(7, "little").hex().upper()
    assert found[1:5] == ["-5", "1", "341", "-3"]
    assert found[5:7] == ["1.5", "-32768"]
    assert found[7:] == ["205", "37F", "2001"]


def test_the_command_writes_the_header(tmp_path: Path, monkeypatch, capsys) -> None:
    run = command_line.runner(monkeypatch, capsys)
    target = tmp_path / "drive.h"
    code, out, err = run("eds", "code", "--c", "builtin:gim6010-8", "-o", target, "--node", 5)
    assert (code, '#include "drive.h"' in out) == (0, True), err
    text = target.read_text("ascii")
    assert "#define GIM6010_8_STATUSWORD_INDEX 0x6041u" in text
    assert "#define GIM6010_8_TPDO1_COB_ID 0x185u" in text
    assert run("eds", "code", "--c", "builtin:gim6010-8").out.startswith("/* The object dictionary of")
    assert run("eds", "code", "--c", "builtin:gim6010-8", "-o", tmp_path / "drive.py").code == 2
    assert run("eds", "code", "builtin:gim6010-8", "-o", tmp_path / "drive.hpp").code == 2
