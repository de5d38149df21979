"""EDS texts of drives with a boot loader (CiA 302-3): the shipped generic drive, and the objects by which a program is loaded."""

from __future__ import annotations

from pathlib import Path

from axisbus.eds.builtin import resolve

# 2025-11-20 08:15:00 is day 15299 after 1984-01-01 and 29700000 ms after midnight (by hand).
OLD = (15_299, 29_700_000)
DOMAIN, U8, U32 = 0xF, 0x5, 0x7

# index -> name, type, access and default of its sub-indices from 1.
OBJECTS = {
    0x1F50: [("Program 1", DOMAIN, "wo", "")],
    0x1F51: [("Program control 1", U8, "rw", "")],
    0x1F52: [("Software date", U32, "ro", str(OLD[0])), ("Software time", U32, "ro", str(OLD[1]))],
    0x1F56: [("Program identification 1", U32, "ro", "")],
    0x1F57: [("Flash status 1", U32, "ro", "")],
}


def loader_eds(folder: Path, *without: int) -> str:
    """Write the generic drive with a loader as ``drive.eds``, some of the objects left out; return the file's name."""
    text = resolve("builtin:generic-cia402", folder).read_text(encoding="ascii")
    (folder / "drive.eds").write_text(with_loader(text, *without), encoding="ascii")
    return "drive.eds"


def with_loader(text: str, *without: int) -> str:
    """Return an EDS text with the objects of a loader, some of them left out."""
    for index, rows in OBJECTS.items():
        if index in without:
            continue
        text += f"\n[{index:X}]\nParameterName=Loader {index:X}\nObjectType=0x8\nSubNumber={len(rows) + 1}\n"
        text += _entry(index, 0, "Highest sub-index supported", U8, "const", str(len(rows)))
        for subindex, row in enumerate(rows, 1):
            text += _entry(index, subindex, *row)
    return text


def _entry(index: int, subindex: int, name: str, kind: int, access: str, default: str) -> str:
    lines = [f"ParameterName={name}", "ObjectType=0x7", f"DataType=0x{kind:X}", f"AccessType={access}"]
    lines += [f"DefaultValue={default}"] if default else []
    return f"\n[{index:X}sub{subindex:X}]\n" + "\n".join(lines) + "\n"


def program(version: tuple[int, int], size: int = 3000) -> bytes:
    """Return a program for a simulated drive: its date and time, and something behind them."""
    head = b"".join(number.to_bytes(4, "little") for number in version)
    return head + bytes(number * 7 % 251 for number in range(size - len(head)))
