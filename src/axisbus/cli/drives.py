"""``axisbus drives``: the drive plug-ins, and the check of a drive file."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.shared.common import OK, STYLES, WRONG, say, say_json, say_next, say_styled
from axisbus.cli.shared.options import PATH
from axisbus.errors import UserError
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.drives.plugin import DrivePlugin, FaultTexts
    from axisbus.drives.registry import PluginSource


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """List the drive plug-ins, show what one knows about its make, and check a drive file.

    A plug-in comes with axisbus, or with an installed package that has an entry point in the group axisbus.drives. A drive file
    describes a make without code; the cell file names it (drives = ["acme.toml"]).

    Exit codes: 0 all well, 1 something was found wrong, 2 wrong use.
    """


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print the plug-ins as JSON.")
def list_command(as_json: bool) -> int:
    """List the drive plug-ins with their identities and origins. Exit code 1 when one cannot be loaded."""
    from axisbus.drives import registry

    sources = registry.installed()
    failed = [each for each in sources if each.error]
    if as_json:
        say_json([_plain(each) for each in sources])
        return WRONG if failed else OK
    rows = [(plugin, source) for source in sources for plugin in source.plugins]
    width = max((len(plugin.name) for plugin, _ in rows), default=0)
    for plugin, source in rows:
        say(f"{plugin.name:<{width}}  {_identity(plugin)}  ({source.origin})")
    for each in failed:
        say_styled(f"FAILED: {each.name} ({each.origin}): {each.error}", "FAILED:", STYLES["error"])
        if each.remedy:
            say(f"  remedy:   {each.remedy}")
    say_next("axisbus drives show NAME")
    return WRONG if failed else OK


@command.command("show")
@click.argument("name")
@click.option("--json", "as_json", is_flag=True, help="Print the facts as JSON.")
def show_command(name: str, as_json: bool) -> int:
    """Show what the plug-in NAME knows: identity, behaviour, error texts, objects, notes and sources.

    NAME is a name of axisbus drives list, or its beginning.
    """
    plugin, source = _named(name)
    if as_json:
        say_json(_facts(plugin))
        return OK
    say(f"{plugin.name}: {_identity(plugin)}, from {source.origin}")
    for title, lines in _sections(plugin):
        if lines:
            say(f"{title}:")
            for line in lines:
                say(f"  {line}")
    return OK


@command.command("check")
@click.argument("file", type=PATH, required=False)
@click.option("--json", "as_json", is_flag=True, help="Print the errors as JSON.")
@click.option(
    "--schema", is_flag=True, help="Print a JSON Schema of drive files, for an editor's completion."
)
def check_command(file: Path | None, as_json: bool, schema: bool) -> int:
    """Find the errors in a drive file: each with its line and its remedy. Exit code 1 when there is one."""
    if (file is None) is not schema:
        raise click.UsageError("give a drive file, or --schema (for all drive files)")
    if file is None:
        from axisbus.drives.drive_file_schema import schema_of_drive_files

        say_json(schema_of_drive_files())
        return OK
    from axisbus.drives import drive_file

    plugin, problems = drive_file.read(file)
    if as_json:
        findings = [{**asdict(each), "severity": each.severity.value} for each in problems]
        say_json({"file": str(file), "ok": plugin is not None, "findings": findings})
    else:
        for problem in problems:
            say_styled(str(problem), "error:", STYLES["error"])
        say(
            f"{file}: {counted(len(problems), 'error')}"
            if plugin is None
            else f"{file}: {plugin.name}, no error"
        )
        if plugin is not None:
            say_next(f'name it in the cell file, before its first table: drives = ["{file.name}"]')
    return WRONG if plugin is None else OK


def _named(name: str) -> tuple[DrivePlugin, PluginSource]:
    from axisbus.drives import registry

    known = {plugin.name: (plugin, source) for source in registry.installed() for plugin in source.plugins}
    exact = [each for each in known if each.lower() == name.lower()]
    found = exact or [each for each in known if each.lower().startswith(name.lower())]
    if len(found) == 1:
        return known[found[0]]
    similar = found or difflib.get_close_matches(name, known, n=3)
    suggestion = f"did you mean {' or '.join(similar)}? " if similar else ""
    raise UserError(
        f"{'several drive plug-ins begin with' if found else 'there is no drive plug-in'} {name!r}",
        remedy=f"{suggestion}axisbus drives list shows all",
    )


def _identity(plugin: DrivePlugin) -> str:
    parts = ["any vendor" if plugin.vendor_id is None else f"vendor 0x{plugin.vendor_id:X}"]
    for title, numbers in (("product", plugin.product_codes), ("revision", plugin.revisions)):
        if numbers is not None:
            parts.append(f"{title} {', '.join(f'0x{number:X}' for number in sorted(numbers))}")
    return ", ".join(parts)


def _sections(plugin: DrivePlugin) -> Iterator[tuple[str, list[str]]]:
    yield "behaviour", list(plugin.behaviour.lines())
    yield (
        "measured",
        [f"{name}: {_object(each.index, each.subindex)}" for name, each in plugin.measured.items()],
    )
    yield "protected objects", [_object(*each) for each in plugin.calibration_objects]
    if plugin.node_id is not None:
        yield "node-ID", [f"{_object(*plugin.node_id.address)}, stored by {_object(*plugin.node_id.store)}"]
    yield "EDS files", list(plugin.eds_files)
    yield "objects that describe a fault", [_object(*each) for each in plugin.fault_objects]
    texts = _texts(plugin)
    if texts is not None:
        yield "error codes", [f"{code:04X}h  {text}" for code, text in texts.codes.items()]
        for each in texts.objects:
            where = _object(*each.address)
            yield f"bits of {where}", [f"{bit:>2}  {text}" for bit, text in each.bits.items()]
            yield f"numbers in {where}", [f"{number:>3}  {text}" for number, text in each.values.items()]
    yield "notes", [*plugin.notes, *filter(None, (plugin.scale_proposal, plugin.unread_watchdog))]
    yield "sources", list(plugin.sources)


def _texts(plugin: DrivePlugin) -> FaultTexts | None:
    from axisbus.drives.plugin import FaultTexts

    return plugin.explain if isinstance(plugin.explain, FaultTexts) else None


def _object(index: int, subindex: int | None) -> str:
    return f"{index:04X}h" + (f":{subindex:02X}" if subindex else "")


def _plain(source: PluginSource) -> dict[str, Any]:
    return {
        "name": source.name,
        "origin": source.origin,
        "error": source.error,
        "remedy": source.remedy,
        "plugins": [
            {
                "name": plugin.name,
                "vendor_id": plugin.vendor_id,
                "product_codes": None if plugin.product_codes is None else sorted(plugin.product_codes),
                "revisions": None if plugin.revisions is None else sorted(plugin.revisions),
            }
            for plugin in source.plugins
        ],
    }


def _facts(plugin: DrivePlugin) -> dict[str, Any]:
    return {
        "name": plugin.name,
        "identity": _identity(plugin),
        **{title.replace(" ", "_"): lines for title, lines in _sections(plugin)},
    }
