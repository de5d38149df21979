"""Emergency messages, incidents and error histories as text: from CiA 301, CiA 402 and the drive plug-in's table."""

from __future__ import annotations

from axisbus.cia301 import emcy as cia301
from axisbus.cia301.emcy import Emcy, ErrorEntry
from axisbus.cia301.incident import Incident, IncidentState
from axisbus.drives.plugin import GENERIC, DrivePlugin
from axisbus.wording import counted

_ERROR_REGISTER = (0x1001, 0)


def emcy_words(emcy: Emcy, make: DrivePlugin = GENERIC) -> str:
    """Return one message as a line: code and text, error register, the manufacturer's five bytes, and the plug-in's explanation."""
    if emcy.is_reset:
        left = cia301.register_words(emcy.register)
        return f"0x{emcy.code:04X}, error reset" + (f" (still there: {', '.join(left)})" if left else "")
    texts = [cia301.describe(emcy.code)]
    if words := cia301.register_words(emcy.register):
        texts.append(f"error register: {', '.join(words)}")
    if any(emcy.data):
        texts.append(f"manufacturer-specific bytes {emcy.data.hex(' ')}")
    return "; ".join([*texts, *make.explain(emcy.code, {_ERROR_REGISTER: emcy.register})])


def incident_words(incident: Incident, make: DrivePlugin = GENERIC, now: float | None = None) -> list[str]:
    """Return an incident as lines: its outcome, then each message with its time after the fault.

    ``now`` (seconds of the messages' clock) adds the time since it began.
    """
    ago = "" if now is None else f", {now - incident.began:.1f} s ago"
    lines = [f"incident {incident.number}: {_standing(incident)}{ago}"]
    messages = (*incident.emcys, *incident.resets)
    lines += [f"  +{emcy.stamp - incident.began:.3f} s  {emcy_words(emcy, make)}" for emcy in messages]
    if incident.more:
        lines.append(f"  and {counted(incident.more, 'more message')}")
    return lines


def _standing(incident: Incident) -> str:
    if incident.outcome is IncidentState.UNRESOLVED:
        return "unresolved"
    how = "by a restart of the node" if incident.rebooted else "by an error reset"
    return f"recovered after {incident.lasted:.3f} s {how}"


def history_words(entry: ErrorEntry, make: DrivePlugin = GENERIC) -> str:
    """Return one entry of 1003h as a line, with the plug-in's explanation of its code."""
    return "; ".join([str(entry), *make.explain(entry.code, {})])
