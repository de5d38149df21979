"""The EDS files of drawn cells: makers' files, and variants of the generic drive that lack objects or fix their values."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from axisbus import eds
from axisbus.eds.builtin import resolve
from axisbus.eds.model import Eds
from axisbus.sim.build import motor_from_eds
from kit.corpus import corpus_files

GENERIC = "generic-cia402"
BUILTIN = (GENERIC, "gim6010-8")
ABSENT = "none"  # replaces a corpus file if the corpus is missing
_RPM = 0x00B4_4700
TURN = 10000  # increments of the generic drive


def corpus_names() -> tuple[str, ...]:
    """The files of the EDS corpus that may be drives; none where it is absent."""
    return tuple(sorted(path.name for path in corpus_files() if path.suffix == ".eds"))


def path_of(file: str) -> Path | None:
    """Where a file is, None where it is not."""
    if file in BUILTIN:
        return resolve(f"builtin:{file}", Path())
    return next((path for path in corpus_files() if path.name == file), None)


@cache
def model_of(file: str) -> Eds:
    """Return a file as it is read."""
    path = path_of(file)
    assert path is not None, file
    return eds.load(path)


@cache
def motor_of(file: str) -> tuple[int, float]:
    """Return the increments of a turn, and the velocity units per increment/s, of the drive of a file."""
    if path_of(file) is None:
        return TURN, 1.0
    motor = motor_from_eds(model_of(file))
    return motor.increments_per_turn, motor.velocity_unit


@cache
def variant(without: tuple[int, ...], fixed: tuple[tuple[int, int], ...], modes: int, rpm: int | None) -> str:
    """Return the text of the generic drive's EDS without some objects, with others read-only, with other modes and units."""
    path = path_of(GENERIC)
    assert path is not None
    text = path.read_text(encoding="ascii")
    for index in without:
        text = _without(text, index)
    for index, value in fixed:
        text = _changed(_changed(text, index, "AccessType", "ro"), index, "DefaultValue", f"{value}")
    if modes:
        text = _changed(text, 0x6502, "DefaultValue", f"{modes:#x}")
    if rpm is not None:
        text = _changed(text, 0x60A9, "DefaultValue", f"{_RPM | (rpm & 0xFF) << 24:#x}")
    return text


def _changed(text: str, index: int | str, key: str, value: str) -> str:
    title = index if isinstance(index, str) else f"{index:04X}"
    section = re.compile(rf"(?im)(^\[{title}\]\n(?:[^\[\n].*\n|\n)*?{key}=)[^\n]*")
    changed, count = section.subn(rf"\g<1>{value}", text)
    assert count == 1, (title, key)
    return changed


def _without(text: str, index: int) -> str:
    """Take an object out of its section, its sub-indices and the list that has it."""
    text = re.sub(rf"(?im)^\[{index:04X}(?:sub[0-9A-F]+)?\]\n(?:[^\[\n].*\n|\n)*", "", text)
    for mapping in re.findall(
        rf"(?im)^\[(1[6A][0-9A-F]{{2}})sub[0-9A-F]+\]\n(?:[^\[\n].*\n)*?DefaultValue=0x{index:04X}", text
    ):
        text = _changed(
            text, f"{mapping}sub0", "DefaultValue", "0"
        )  # a drive maps nothing that it does not have
    blocks = re.split(r"(?m)^(?=\[)", text)
    return "".join(_unlisted(block, index) for block in blocks)


def _unlisted(block: str, index: int) -> str:
    entry = re.compile(rf"(?im)^\d+=0x{index:04X}\s*$")
    if "SupportedObjects=" not in block or not entry.search(block):
        return block
    listed = [value for value in re.findall(r"(?im)^\d+=(0x[0-9A-F]+)", block) if int(value, 16) != index]
    head = block.splitlines()[0]
    lines = [f"{number}={value}" for number, value in enumerate(listed, start=1)]
    return "\n".join([head, f"SupportedObjects={len(listed)}", *lines, "", ""])
