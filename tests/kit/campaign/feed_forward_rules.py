"""Rules of feed-forward: no offset without power, none but that of the targets, and none when the machine has been left."""

from __future__ import annotations

from collections.abc import Iterator

from kit.cell import Cell
from kit.plant_probe import ENABLED
from kit.sim.sync_values import CSP, CSV, Held, Witness

TOML = "".join(
    f"[axes.{name}.feed_forward]\nvelocity = true\ninertia = 0.001\ntorque_offset = {torque}\n"
    for name, torque in (("x", 0.5), ("y", -1.0))
)
MOST = 1000  # ‰: 6072h of the drive
HALT = 0x0100
KNOWN = 8  # SYNCs after which the master knows the state of the drive, and has set the offsets
RAMP = 25  # SYNCs in which the constant torque has gone


class Offsets:
    """Holds the values of each drive at each SYNC; ``wrong`` lists the violations without an excuse."""

    def __init__(self, cell: Cell, names: str, period: float) -> None:
        """The cell has ``TOML`` in it; ``period``: seconds of its scan."""
        self._witnesses = {name: Witness(cell.drive(name)) for name in names}
        self._seen = dict.fromkeys(names, 0)
        self._period = period

    def look(self, name: str, *, clean: bool) -> Iterator[str]:
        """Yield the violations at the SYNCs since the last look; ``clean``: the drive receives all frames."""
        held = self._witnesses[name].held
        first, self._seen[name] = self._seen[name], len(held)
        for number in range(max(first, RAMP), len(held)):
            recent = held[number - RAMP : number + 1]
            if clean and self._even(recent):
                yield from self._judged(recent)

    def left(self, name: str) -> bool:
        """Whether nothing of it is left in the drive."""
        held = self._witnesses[name].held
        return not held or not (held[-1].velocity_offset or held[-1].torque_offset)

    def _even(self, held: list[Held]) -> bool:
        return held[-1].time - held[0].time < (len(held) - 0.5) * self._period

    def _judged(self, held: list[Held]) -> Iterator[str]:
        now, before, known = held[-1], held[-2], held[-KNOWN:]
        if abs(now.torque_offset) > MOST:
            yield f"more torque than there is: {now}"
        if all(one.stage != ENABLED for one in known) and (now.velocity_offset or now.torque_offset):
            yield f"an offset without power: {now}"
        if all(one.mode != CSP for one in known) and now.velocity_offset:
            yield f"a velocity offset outside csp: {now}"
        if all(one.mode not in (CSP, CSV) for one in known) and now.torque_offset:
            yield f"a torque offset outside csp and csv: {now}"
        led = all(one.stage == ENABLED and one.mode == CSP and not one.word & HALT for one in known)
        velocity = (now.position - before.position) / self._period
        if led and now.velocity_offset and abs(now.velocity_offset - velocity) > 1.0 / self._period + 1.0:
            yield f"it is not the velocity of the target, {velocity:g}: {now}"
