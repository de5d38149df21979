"""CiA 402 drive over a module: controlword and mode in, frames out; the statusword shows the result."""

from __future__ import annotations

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import PowerState
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.orders import TRAPEZOID, Orders
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback
from axisbus.drives.gim6010.can_simple.port.modes import Means, ModuleMode, ModuleProfile, Targets, modes_of
from axisbus.drives.gim6010.can_simple.port.power_stage import (
    WORDS,
    ModulePowerAction,
    ModulePowerStage,
    Power,
)
from axisbus.drives.gim6010.can_simple.port.setpoints import BY_LINE, ModuleSetPoints
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings

_ALWAYS = sw.VOLTAGE_ENABLED | sw.REMOTE
_LETTING_GO = frozenset({Power.OFF, Power.FOUND})


class ModuleDrive:
    """Power stage, the active mode in closed loop, the targets, and the frames to be sent."""

    def __init__(self, settings: ModuleSettings, hearing: ModuleFeedback) -> None:
        self.targets = Targets()
        self.profile = ModuleProfile(settings)
        self.mode = 0  # 6060h
        self.frames: list[Outgoing] = []
        self._settings = settings
        self._hearing = hearing
        self._orders = Orders(settings.node)
        self._stage = ModulePowerStage(hearing)
        self._lead = ModuleSetPoints(settings, self._orders, hearing)
        self._means = Means(settings, hearing, self._lead, self.profile, self.targets)
        self._kinds = modes_of(settings)
        self._leads: ModuleMode | None = None
        self._word = 0
        self._halted = False
        self._took_over = False  # the module was found enabled
        self._now = 0.0

    def look(self, now: float) -> None:
        """Begin a cycle at ``now`` (s): evaluate the frames received so far."""
        self._now = now
        self._stage.look()
        self._lead.look(now)
        if not self._stage.is_on:
            self._leads, self._took_over = None, False
        if self._stage.power in _LETTING_GO:
            self._lead.forget()

    @property
    def statusword(self) -> int:
        """6041h."""
        state = self._stage.shown
        word = WORDS[state] | _ALWAYS
        if state is PowerState.OPERATION_ENABLED and self._leads is not None:
            return word | self._leads.bits(self._halted)
        stands = state is PowerState.QUICK_STOP_ACTIVE and self._lead.stands
        return word | (sw.TARGET_REACHED if stands else 0)

    @property
    def shown_mode(self) -> int:
        """6061h: velocity control after a torque that was braked on a serial line, until the module has been in idle."""
        braked = self.mode == ModeOfOperation.PROFILE_TORQUE and self._lead.is_braked and self._lead.stands
        return ModeOfOperation.PROFILE_VELOCITY if braked else self.mode

    # Requests.

    def choose(self, mode: int) -> None:
        """Take 6060h; an unsupported mode is ignored, as 6061h then shows."""
        if mode == self.mode or mode not in self._kinds or self._lead.is_braked:
            return
        self.mode = mode
        if self._stage.is_on and self._stage.shown is PowerState.OPERATION_ENABLED:
            self._begin()

    def obey(self, word: int) -> None:
        """Take 6040h."""
        edge, self._word = word & ~self._word, word
        _ACTS[self._stage.obey(word, self._now)](self)
        if self._stage.is_on:
            self._run(word, edge)
        if self._stage.power is not Power.FOUND:
            self._lead.feed()
        self._flush()

    def estop(self) -> None:
        """Remove the power, with a latched error: last step of the stop sequence, in which a CANopen node leaves operational."""
        self._drop()
        self._stage.lose(self._now)
        self.frames.append(self._orders.estop())

    def forget(self) -> None:
        """Note that the frames of this cycle were lost: mode, ramps, inputs and a halt are sent again."""
        self._lead.lose()
        self._halted = False

    def feed_within(self, timeout: float) -> None:
        self._lead.feed_within(timeout)

    def stop_frames(self) -> list[Outgoing]:
        """Return the frames that stop the module without a further cycle; none if this program does not control it."""
        if self._stage.power is Power.COMING:
            return [self._orders.idle()]
        return self._orders.brake() if self._stage.is_on else []

    # Execution.

    def _run(self, word: int, edge: int) -> None:
        """Execute a cycle in closed loop that this program has requested."""
        if self._stage.shown is PowerState.QUICK_STOP_ACTIVE or self._must_let_go:
            self._run_quick_stop()
            return
        if self._leads is None:
            self._begin()
        if self._leads is None:
            return  # no mode was ever selected: the module holds
        halted, before = bool(word & cw.HALT), self._halted
        self._halted = halted
        if halted:
            self._leads.halt(word, edge, not before)
        else:
            self._leads.step(word, edge)

    @property
    def _must_let_go(self) -> bool:
        """Whether the module, on a serial line, brakes by velocity 0 and goes to idle at standstill."""
        return self._took_over or (
            self._lead.is_braked and self._settings.line_mode is ModeOfOperation.PROFILE_POSITION
        )

    def _run_quick_stop(self) -> None:
        """Command velocity 0 on the module's own ramp; at standstill hold the position, or remove the power."""
        if not self._lead.stands:
            self._lead.turn(0.0)
        elif self._settings.quick_stop_holds:
            self._lead.rest(self.profile.down)
        else:
            self._let_go()
            self._stage.lose(self._now)

    def _begin(self) -> None:
        kind = self._kinds.get(self.mode)
        self._leads, self._halted = None if kind is None else kind(self._means), False
        if self._leads is not None:
            self._leads.begin()

    def _nothing(self) -> None:
        pass

    def _limits(self) -> Outgoing:
        return self._orders.limits(self._settings.velocity_limit, self._settings.current_limit)

    def _start(self) -> None:
        """Send limits, inputs that cause no motion and a mode that holds; then request closed loop."""
        self._hearing.trust()
        self._lead.forget()
        if self._settings.relayed:
            self._prepare_by_line()
        else:
            self.frames += [self._limits(), self._orders.velocity(0.0)]
            self._lead.use(TRAPEZOID)
            self._flush()
        self.frames.append(self._orders.closed_loop())

    def _prepare_by_line(self) -> None:
        """Send the mode first: a relay takes the frame of velocity control for a stop, and discards all frames before a stop."""
        self._lead.use(BY_LINE[self._settings.line_mode])
        self._flush()
        self.frames += [self._limits(), self._orders.velocity(0.0), self._orders.torque(0.0)]

    def _take_over(self) -> None:
        """Take control of a module that is in closed loop already."""
        self._hearing.trust()
        self.frames.append(self._limits())
        if self._settings.relayed:  # its modes are unknown, and they are not changed under power
            self._took_over = True
            self._lead.turn(0.0)
        else:
            self._begin()

    def _quick_stop(self) -> None:
        self._hearing.trust()
        self._leads = None

    def _let_go(self) -> None:
        self._drop()
        self.frames.append(self._orders.idle())

    def _drop(self) -> None:
        self._hearing.let_go()
        self._leads = None
        self._lead.forget()

    def _clear(self) -> None:
        """Clear the errors; an armed time-out that has expired is fed first, because it would trip again at once."""
        self._lead.feed(at_once=True)
        self._flush()
        self.frames.append(self._orders.clear())

    def _flush(self) -> None:
        self.frames += self._lead.frames
        self._lead.frames.clear()


_ACTS = {
    ModulePowerAction.NOTHING: ModuleDrive._nothing,
    ModulePowerAction.START: ModuleDrive._start,
    ModulePowerAction.TAKE_OVER: ModuleDrive._take_over,
    ModulePowerAction.QUICK_STOP: ModuleDrive._quick_stop,
    ModulePowerAction.LET_GO: ModuleDrive._let_go,
    ModulePowerAction.CLEAR: ModuleDrive._clear,
}
