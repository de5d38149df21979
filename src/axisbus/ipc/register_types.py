"""Register message types with msgspec before any thread decodes one."""

from __future__ import annotations

import msgspec


def register_message_types(*kinds: type[msgspec.Struct]) -> None:
    """Let msgspec analyse these types now, at import: in one thread, and once.

    Otherwise msgspec would analyse each type at its first message. If two threads decode a first message at the same time, the
    interpreter crashes: one thread uses data that the other has not completed (msgspec 0.22).
    """
    for kind in kinds:
        msgspec.json.Decoder(kind)
