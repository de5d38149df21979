"""The pages for users of axisbus: README.md and docs/, their blocks of code, and the cells made from their excerpts."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
PAGES = (README, *sorted((ROOT / "docs").rglob("*.md")))

# The keys that an excerpt of a cell file may leave out, by the header of its table.
_REST = {
    "[bus]": 'interface = "sim"\nscan_period = "4ms"\n',
    "[nodes.1]": 'eds = "builtin:generic-cia402"\n',
    "[nodes.2]": 'eds = "builtin:generic-cia402"\n',
    "[axes.x]": 'node = 1\nunit = "deg"\nscale = "131072/360"\n',
    "[axes.y]": 'node = 2\nunit = "deg"\nscale = "131072/360"\n',
}


def name_of(page: Path) -> str:
    """The page's path in the checkout."""
    return page.relative_to(ROOT).as_posix()


def text_of(page: Path) -> str:
    """The text of the page."""
    return page.read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of code of a page in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text_of(page), re.DOTALL | re.MULTILINE)


def blocks_of_all(language: str) -> list[tuple[Path, str]]:
    """The blocks of all pages, each with its page."""
    return [(page, block) for page in PAGES for block in blocks(page, language)]


_PLAN_OF_FAULTS = re.compile(r"^(when|begin) = ", re.MULTILINE)
_DRIVE_FILE = re.compile(r"^vendor_id = ", re.MULTILINE)


def cell_excerpts() -> list[str]:
    """The excerpts of cell files on the pages."""
    others = (_PLAN_OF_FAULTS, _DRIVE_FILE)
    return [block for _, block in blocks_of_all("toml") if not any(other.search(block) for other in others)]


def drive_files() -> list[str]:
    """The drive files that the pages and CONTRIBUTING.md show."""
    indented = re.findall(
        r"^ *```toml\n(.*?)```", text_of(ROOT / "CONTRIBUTING.md"), re.DOTALL | re.MULTILINE
    )
    shown = [*(block for _, block in blocks_of_all("toml")), *map(textwrap.dedent, indented)]
    return [block.rstrip() + "\n" for block in shown if _DRIVE_FILE.search(block)]


def fault_plans() -> list[str]:
    """The plans of faults that the pages show, for ``axisbus sim --faults``."""
    return [block for _, block in blocks_of_all("toml") if _PLAN_OF_FAULTS.search(block)]


def whole_cell(excerpt: str) -> str:
    """A cell file that an excerpt is a part of: it comes first, unchanged, and then the tables that it leaves out.

    On a serial line nothing of them can be: an excerpt of one is whole.
    """
    if 'interface = "modbus"' in excerpt:
        return excerpt
    headers = {line.partition("#")[0].strip() for line in excerpt.splitlines()}
    rest = [f"{header}\n{body}" for header, body in _REST.items() if header not in headers]
    return "\n".join([excerpt, *rest])


def rows(page: Path, header: str) -> list[list[str]]:
    """The cells of all tables of a page whose first column has this header."""
    found: list[list[str]] = []
    inside = False
    for line in text_of(page).splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if not cells:
            inside = False
        elif cells[0] == header:
            inside = True
        elif inside and not set(cells[0]) <= {"-"}:
            found.append(cells)
    return found
