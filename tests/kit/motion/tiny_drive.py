"""A drive of few lines, typed from CiA 402-2, as an oracle for the property tests; it shares nothing with the simulated drive.

It moves without acceleration and stops at once, so that whatever moves, moves because it was asked to.
"""

from __future__ import annotations

from axisbus.cia402.port import Outputs

# Statusword of each state (table 29).
WORDS = {
    "not ready": 0x0000,
    "disabled": 0x0040,
    "ready": 0x0021,
    "switched on": 0x0023,
    "enabled": 0x0027,
    "quick stop": 0x0007,
    "reaction": 0x000F,
    "fault": 0x0008,
}
PP, PV, TQ, HM, CSP = 1, 3, 4, 6, 8


def state_of(word: int | None) -> str:
    """The state that a statusword shows, by the masks of table 29."""
    if word is None:
        return "unknown"
    for state, mask in (
        ("not ready", 0x4F),
        ("disabled", 0x4F),
        ("ready", 0x6F),
        ("switched on", 0x6F),
        ("enabled", 0x6F),
        ("quick stop", 0x6F),
        ("reaction", 0x4F),
        ("fault", 0x4F),
    ):
        if word & mask == WORDS[state]:
            return state
    return "unknown"


def asked(word: int) -> str:
    """The command of a controlword (table 27), bit 7 aside."""
    if not word & 0b0010:
        return "disable voltage"
    if not word & 0b0100:
        return "quick stop"
    if not word & 0b0001:
        return "shutdown"
    return "enable" if word & 0b1000 else "switch on"


# (state, command): (transition, next state). The figure of 7.2.
FIGURE = {
    ("disabled", "shutdown"): (2, "ready"),
    ("ready", "switch on"): (3, "switched on"),
    ("ready", "enable"): (3, "switched on"),
    ("ready", "disable voltage"): (7, "disabled"),
    ("ready", "quick stop"): (7, "disabled"),
    ("switched on", "enable"): (4, "enabled"),
    ("switched on", "shutdown"): (6, "ready"),
    ("switched on", "disable voltage"): (10, "disabled"),
    ("switched on", "quick stop"): (10, "disabled"),
    ("enabled", "switch on"): (5, "switched on"),
    ("enabled", "shutdown"): (8, "ready"),
    ("enabled", "disable voltage"): (9, "disabled"),
    ("enabled", "quick stop"): (11, "quick stop"),
    ("quick stop", "disable voltage"): (12, "disabled"),
    ("quick stop", "enable"): (16, "enabled"),
}


class TinyDrive:
    """One axis; ``transitions`` holds every transition that it took."""

    def __init__(self, *, holds: bool, mode: int, position: int, stale: tuple[int, int, int]) -> None:
        """``holds``: it stays in quick stop active; ``stale``: the values of 607Ah, 60FFh and 6071h before the first master."""
        self.holds = holds
        self.state = "disabled"
        self.transitions: list[int] = []
        self.mode = self.mode_display = mode
        self.position = position
        self.velocity = 0
        self.torque = 0
        self.target_position, self.target_velocity, self.target_torque = stale
        self.objects: dict[tuple[int, int], int] = {(0x6081, 0): 0}
        self.refuses_mode = False
        self.ignores_set_points = False
        self.keeps_acknowledge = False
        self.blocked = False
        self.lazy = 0  # cycles until bit 12 follows bit 4
        self._word = 0
        self._countdown = 0
        self._set_point: int | None = None
        self._acknowledge = False
        self._reached = True
        self._homing: int | None = None
        self._home_found = False

    # Frames of the master.

    def take(self, outputs: Outputs) -> None:
        """One cycle's outputs arrive: targets and mode first, then the controlword."""
        for name in ("target_position", "target_velocity", "target_torque"):
            value = getattr(outputs, name)
            if value is not None:
                setattr(self, name, value)
        if outputs.mode is not None:
            self.mode = int(outputs.mode)
        if outputs.controlword is not None:
            self._hear(outputs.controlword)

    def serve(self, index: int, subindex: int, value: int | None) -> int | None:
        """Answer an SDO request: ``value`` None reads."""
        if index == 0x6040 and value is not None:
            self._hear(value)
        elif index == 0x6041:
            return self.statusword
        elif value is not None:
            self.objects[index, subindex] = value
        return self.objects.get((index, subindex), 0) if value is None else None

    def _hear(self, word: int) -> None:
        old, self._word = self._word, word
        if self.state == "fault":
            if word & 0x80 and not old & 0x80:
                self._go(15, "disabled")
            return
        step = FIGURE.get((self.state, asked(word)))
        if step is not None and not word & 0x80 and not (step[0] == 16 and not self.holds):
            self._go(*step)
        if self.state == "enabled":
            self._edge(old, word)

    def _edge(self, old: int, word: int) -> None:
        rising, falling = word & 0x10 and not old & 0x10, old & 0x10 and not word & 0x10
        if self.mode_display == PP:
            if rising and not self.ignores_set_points:
                self._set_point, self._reached = self.target_position, False
            if rising or falling:
                self._countdown = self.lazy
        elif self.mode_display == HM:
            if rising:
                self._homing, self._home_found = 5, False
            elif falling:
                self._homing = None

    def _go(self, number: int, state: str) -> None:
        self.transitions.append(number)
        self.state = state
        if state != "enabled":
            self._rest()
        else:
            self._enter()

    def _rest(self) -> None:
        self.velocity = self.torque = 0
        self._set_point = self._homing = None
        self._acknowledge = False

    def _enter(self) -> None:
        self._rest()
        self._reached = True

    # Events.

    def fail(self) -> None:
        """A fault."""
        if self.state != "fault":
            self._go(13, "reaction")

    def drop(self) -> None:
        """Safe torque off, or the supply is gone."""
        if self.state in ("enabled", "quick stop", "switched on", "ready"):
            self._go(9, "disabled")

    # Time.

    def step(self, dt: float) -> None:
        """Let one cycle pass."""
        if self.state == "reaction":
            self._go(14, "fault")
        if self.state == "quick stop" and not self.holds:
            self._go(12, "disabled")
        if self.mode != self.mode_display and not self.refuses_mode:
            self.mode_display = self.mode
            self._enter()
        self.velocity = 0
        if self.state == "enabled":
            self._acknowledge_edge()
            self._move(dt)
        if self.blocked:
            self.velocity = 0
        self.position += round(self.velocity * dt)

    def _acknowledge_edge(self) -> None:
        if self._countdown:
            self._countdown -= 1
        elif self.mode_display == PP and not (self._acknowledge and self.keeps_acknowledge):
            self._acknowledge = bool(self._word & 0x10) and not self.ignores_set_points

    def _move(self, dt: float) -> None:
        halted = self._word & 0x100
        self.torque = self.target_torque if self.mode_display == TQ and not halted else 0
        if halted:
            self._homing = None
            if self.mode_display == PP:
                self._set_point = None
            return
        if self.mode_display == PP:
            self._move_to_set_point(dt)
        elif self.mode_display == PV:
            self.velocity = self.target_velocity
        elif self.mode_display == TQ:
            self.velocity = self.target_torque
        elif self.mode_display == CSP:
            self.velocity = round((self.target_position - self.position) / dt)
        elif self.mode_display == HM and self._homing is not None:
            self._homing -= 1
            if self._homing == 0:
                self._homing, self._home_found, self.position = None, True, 0

    def _move_to_set_point(self, dt: float) -> None:
        if self._set_point is None:
            return
        way, reach = self._set_point - self.position, round(self.objects.get((0x6081, 0), 0) * dt)
        if abs(way) <= reach and not self.blocked:
            self.velocity = round(way / dt)
            self._set_point, self._reached = None, True
        else:
            self.velocity = round((reach if way > 0 else -reach) / dt)

    @property
    def statusword(self) -> int:
        """6041h."""
        word = WORDS[self.state] | 0x0210
        if self.state != "enabled":
            return word
        at_standstill = self.velocity == 0
        if self._word & 0x100:
            return word | 0x0400 if at_standstill else word
        if self.mode_display == PP:
            return word | 0x0400 * self._reached | 0x1000 * self._acknowledge
        if self.mode_display == HM:
            return word | 0x0400 * (self._homing is None) | 0x1000 * self._home_found
        if self.mode_display in (PV, TQ):
            return word | 0x0400
        return word | 0x1000
