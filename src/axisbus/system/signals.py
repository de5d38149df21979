"""The signals of this system: Windows has no SIGHUP, and has Ctrl-Break (SIGBREAK) instead of SIGQUIT."""

from __future__ import annotations

import signal
import subprocess

_TEXTS = {"SIGINT": "Ctrl-C", "SIGBREAK": "Ctrl-Break"}

# The flags of a process that Ctrl-C in the terminal does not reach on Windows; elsewhere ``start_new_session`` has this effect.
OWN_GROUP: int = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)


def present(*names: str) -> dict[int, str]:
    """Return the signals of these names that this system has, by number, with their texts for messages."""
    return {int(getattr(signal, name)): _TEXTS.get(name, name) for name in names if hasattr(signal, name)}
