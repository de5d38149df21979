"""Kinds of messages that are known to msgspec before any thread reads one."""

from __future__ import annotations

import msgspec


def register_message_types(*kinds: type[msgspec.Struct]) -> None:
    """Let msgspec look at what is in these kinds now, where they are imported: by one thread, and once.

    It would look at the first message of each otherwise, and two threads that read a first one at the same time end the
    interpreter: the one uses what the other has not finished (msgspec 0.22).
    """
    for kind in kinds:
        msgspec.json.Decoder(kind)
