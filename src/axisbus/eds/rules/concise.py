"""Rules for concise DCFs in 1F22h: complete, and in an order that devices accept (CiA 302-3 4.3)."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.eds.concise import take_apart
from axisbus.eds.rules.context import Described, Hit, Looks, RuleContext
from axisbus.eds.rules.objects import is_mapping
from axisbus.wording import counted

CONCISE_DCF, VERIFY = 0x1F22, 0x1020


def wrong_count(sheet: RuleContext) -> Iterator[Hit]:
    """K010."""
    for entry, key, data in _streams(sheet):
        taken = take_apart(data)
        if taken.rest or taken.said != len(taken.writes):
            rest = f" and {counted(taken.rest, 'octet')} beyond the last whole entry" if taken.rest else ""
            yield sheet.on(
                entry,
                key,
                f"says {counted(taken.said, 'entry', 'entries')}, but holds {len(taken.writes)}{rest}",
            )


def order_of_mapping(sheet: RuleContext) -> Iterator[Hit]:
    """K011."""
    for entry, key, data in _streams(sheet):
        cleared: set[int] = set()
        for write in take_apart(data).writes:
            if not is_mapping(write.index):
                continue
            if write.subindex == 0:
                if any(write.data):
                    cleared.discard(write.index)
                else:
                    cleared.add(write.index)
            elif write.index not in cleared:
                text = (
                    f"writes {write.index:04X}:{write.subindex:02X} before {write.index:04X}:00 is set to 0"
                )
                yield sheet.on(entry, key, text)
                break


def verification_last(sheet: RuleContext) -> Iterator[Hit]:
    """K012."""
    for entry, key, data in _streams(sheet):
        indices = [write.index for write in take_apart(data).writes]
        if VERIFY in indices and any(index != VERIFY for index in indices[indices.index(VERIFY) :]):
            yield sheet.on(entry, key, "writes other objects after 1020 (Verify configuration)")


def _streams(sheet: RuleContext) -> Iterator[tuple[Described, str, bytes]]:
    """Yield each concise DCF in the file, with its entry and key."""
    for entry in sheet.described:
        variable = entry.variable
        if variable.index == CONCISE_DCF and variable.subindex:
            for key, value in (
                ("defaultvalue", variable.default),
                ("parametervalue", variable.parameter_value),
            ):
                if isinstance(value, bytes) and value:
                    yield entry, key, value


LOOKS: Looks = {
    "K010": wrong_count,
    "K011": order_of_mapping,
    "K012": verification_last,
}
