"""``axisbus examples``: the example programs, cell files and notebooks that come with the package."""

from __future__ import annotations

import json
from pathlib import Path

import click

from axisbus.cli.shared.common import OK, say, say_json, say_next
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import write_whole
from axisbus.errors import UserError
from axisbus.wording import counted

# In an installed package the files are in the package's folder; in a checkout, in the top folder.
_FOLDERS = (Path(__file__).parents[1] / "example_files", Path(__file__).parents[3] / "examples")
_SUMMARIZED = {".py", ".toml", ".ipynb", ".service", ".network", ".rules"}


def folder() -> Path:
    """Return the folder of the examples."""
    return next(path for path in _FOLDERS if path.is_dir())


@click.group("examples", context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """List the example programs and cell files, or copy them into a folder.

    \b
    axisbus examples list
    axisbus examples copy examples
    python examples/velocity.py
    """


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print the list as JSON.")
def list_command(as_json: bool) -> int:
    """Print the name and the subject of each example."""
    found = {str(path.relative_to(folder()).as_posix()): _summary(path) for path in _files()}
    if as_json:
        say_json(found)
        return OK
    width = max(map(len, found))
    for name, text in found.items():
        say(f"{name:<{width}}  {text}".rstrip())
    say_next("axisbus examples copy examples")
    return OK


@command.command("copy")
@click.argument("target", metavar="DIR", type=PATH)
def copy_command(target: Path) -> int:
    """Copy all examples into DIR, which is made if it is missing.

    Nothing is copied if a file of an example already exists there with other contents.
    """
    copies = {path: target / path.relative_to(folder()) for path in _files()}
    for path, copy in copies.items():
        if copy.exists() and (not copy.is_file() or copy.read_bytes() != path.read_bytes()):
            raise UserError(
                f"{copy} already exists, with other contents; nothing was copied",
                remedy="give another folder, or move this file away",
            )
    for path, copy in copies.items():
        write_whole(copy, path.read_bytes())
    say(f"{counted(len(copies), 'file')} copied to {target}")
    say_next(f"axisbus check {target / 'cell.toml'}; python {target / 'velocity.py'}")
    return OK


def _files() -> list[Path]:
    found = sorted(path for path in folder().rglob("*") if path.is_file())
    return [
        path for path in found if "__pycache__" not in path.parts and ".ipynb_checkpoints" not in path.parts
    ]


def _summary(path: Path) -> str:
    """Return the first line of the text in which a file describes itself; empty if there is none."""
    if path.suffix not in _SUMMARIZED:
        return ""
    text = path.read_text("utf-8")
    if path.suffix == ".ipynb":
        text = "".join(json.loads(text)["cells"][0]["source"])
    first = text.lstrip().partition("\n")[0]
    return first.strip('"# ').rstrip(".")
