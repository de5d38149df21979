"""Replace the calls in an error text of the library by the buttons of the page."""

from __future__ import annotations

import re

# Longer patterns first: the shorter ones replace the rest.
_TABLE: tuple[tuple[re.Pattern[str], str], ...] = tuple(
    (re.compile(call), words)
    for call, words in (
        (r" \(axis\.error\)", ""),
        (r"; in a program: \S+\(\d+\)\.command\(NmtCommand\.START\)", ""),
        (
            r"close the machine,? and open it again",
            "end the program that runs the machine, and start it again",
        ),
        (r"; axis\.snapshot has the last known values, with their time", ""),
        (r"axis\.enable\(allow_moving=True\) catches it in motion; ", ""),
        (r"confirm its position \(axis\.set_position\(\.\.\.\)\)", "confirm its position, in a program"),
        (r"axis\.disable\(coast=True\)\.wait\(\)", "Disable"),
        (r"at axis\.position", "the position of the axis"),
        (r"axis\.(?:quick_stop|stop)\(\)", "Quick stop"),
    )
)
_BUTTON = re.compile(r"axis\.(enable|disable|reset|release|home|halt)\(\)")


def in_page_terms(text: str) -> str:
    """Return a text of the library for users of the page."""
    for call, words in _TABLE:
        text = call.sub(words, text)
    return _BUTTON.sub(lambda found: found[1].capitalize(), text)
