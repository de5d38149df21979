"""A drive with two axes: the EDS of the generic drive with every object of its profile a second time at +800h, and its cell."""

from __future__ import annotations

import re

from axisbus.eds.builtin import resolve
from kit.cell import cell_text

_SECTION = re.compile(r"^\[(6[0-7][0-9A-F]{2})(sub[0-9A-F]+)?\]$", re.MULTILINE | re.IGNORECASE)
_OFFSET = 0x800


def two_axis_cell(folder, **changes: str) -> str:
    """Write the EDS, and return a cell in which x and y are the two axes of node 1; ``changes``: see ``cell_text``."""
    (folder / "two.eds").write_text(two_axis_eds(folder), encoding="ascii")
    text = cell_text("xy", eds="two.eds", **changes)
    text = re.sub(r'\[nodes\.2\]\neds = "two\.eds"\n', "", text)
    return text.replace("node = 2\n", "node = 1\ndrive_axis = 2\n")


def two_axis_eds(folder) -> str:
    """Return its text."""
    text = resolve("builtin:generic-cia402", folder).read_text(encoding="ascii")
    blocks = re.split(r"\n(?=\[)", text)
    second = [_moved(block) for block in blocks if _SECTION.match(block)]
    numbers = sorted({int(match[1], 16) + _OFFSET for match in _SECTION.finditer(text) if not match[2]})
    return "\n".join([*(_listed(block, numbers) for block in blocks), *second])


def _moved(block: str) -> str:
    return _SECTION.sub(lambda match: f"[{int(match[1], 16) + _OFFSET:04X}{match[2] or ''}]", block, count=1)


def _listed(block: str, numbers: list[int]) -> str:
    """Add objects to the list of the optional ones; other blocks stay."""
    if not block.startswith("[OptionalObjects]"):
        return block
    count = int(re.search(r"SupportedObjects=(\d+)", block)[1])
    lines = [f"{place}=0x{number:04X}" for place, number in enumerate(numbers, start=count + 1)]
    block = block.replace(f"SupportedObjects={count}", f"SupportedObjects={count + len(numbers)}")
    return block.rstrip("\n") + "\n" + "\n".join(lines) + "\n"
