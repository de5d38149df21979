"""The report of ``axisbus config restore``, for people and as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from axisbus.cia301.datatypes import decode
from axisbus.cli.shared.common import say, say_json, say_next
from axisbus.configuration import report_text

if TYPE_CHECKING:
    from axisbus.configuration.restore import RestoreReport, Result
    from axisbus.eds.model import Variable


def tell(report: RestoreReport, found: dict[str, Any], as_json: bool) -> None:
    """Print a report; ``found`` has node, file, and the storing (``stored``, ``in_ram_only``, ``cannot_store``)."""
    if as_json:
        say_json(_plain(report, found))
    else:
        _show(report, found)


def _show(report: RestoreReport, found: dict[str, Any]) -> None:
    from axisbus.configuration.restore import ValueEnd

    for each in report.of(ValueEnd.RESTORED):
        say(f"restored  {_change(each)}")
    for each in report.of(ValueEnd.UNVERIFIED, ValueEnd.DIFFERS):
        why = f" ({each.reason})" if each.reason else ""
        say(f"{each.outcome.value}: {report_text.place(each.item.variable)}{why}")
    for each in report.of(ValueEnd.FAILED):
        say(f"FAILED    {_change(each)}: {each.reason}")
    _show_skipped(report)
    say(f"node {found['node']}: {report_text.restored(report)}")
    _show_memory(found, report)


def _show_skipped(report: RestoreReport) -> None:
    for line in report_text.skipped(report.skipped):
        say(f"skipped   {line}")


def _show_memory(found: dict[str, Any], report: RestoreReport) -> None:
    stored = found.get("stored")
    if stored is not None:
        restart = "it restarted, and " if stored["restarted"] else ""
        say(f"stored by 1010h in {stored['seconds']:.1f} s; {restart}all was read again")
    elif found["in_ram_only"] and found.get("cannot_store"):
        say(f"the written values are in RAM: {found['cannot_store']}")
    elif found["in_ram_only"]:
        say("the written values are in RAM only, and are lost at the next power-off")
        say_next(f"store it: axisbus config restore {found['file']} {found['node']} ... --store")
    if not report.ok and stored is None and "cut_off" not in found:
        say_next("correct the failed objects in the file, or leave them out with --exclude, and run it again")


def _change(each: Result) -> str:
    variable = each.item.variable
    wanted = report_text.data_shown(variable, each.item.data)
    before = report_text.data_shown(variable, each.before)
    now = "" if each.after == each.item.data else f", it is {report_text.data_shown(variable, each.after)}"
    return f"{report_text.place(variable)}: {before} -> {wanted}{now}"


def entry(variable: Variable) -> dict[str, object]:
    """Return the identification of an object, for JSON."""
    return {"index": variable.index, "subindex": variable.subindex, "name": variable.name}


def _plain(report: RestoreReport, found: dict[str, Any]) -> dict[str, Any]:
    def value(each: Result, data: bytes | None) -> object:
        return None if data is None else report_text.plain(decode(data, each.item.variable.data_type))

    return {
        **found,
        "ok": report.ok and "cut_off" not in found,
        "writes": report.writes,
        "objects": [
            {
                **entry(each.item.variable),
                "outcome": each.outcome.name.lower(),
                "wanted": value(each, each.item.data),
                "before": value(each, each.before),
                "after": value(each, each.after),
                "reason": each.reason,
            }
            for each in report.results
        ],
        "skipped": [{**entry(each.variable), "reason": each.text} for each in report.skipped],
    }
