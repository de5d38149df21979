"""Object dictionary of a module as a drive: the objects that motion, boot-up and users may read and write."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.cia301 import abort
from axisbus.cia402 import objects as o
from axisbus.cia402.modes import FACTS, ModeOfOperation
from axisbus.drives.gim6010.can_simple.port import error_words
from axisbus.drives.gim6010.can_simple.port.modes import ModuleProfile, modes_of
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN

_VALUE_REFUSED = 0x0609_0030
_ERROR_REGISTER = 0x1001
Address = tuple[int, int]
Read = Callable[[], int | None]
Obey = Callable[[int], None]

# Reactions of the module, which no message can change: see docs/gim6010-8.md.
_RAMP, _RAMP_HOLD = 2, 6  # 605Ah
_COAST, _SLOW = 0, 1


def constants(settings: ModuleSettings) -> dict[Address, int]:
    """Return the constant objects: reactions, ramps, units, and the supported modes (6502h)."""
    words = sum(1 << FACTS[ModeOfOperation(mode)].supported_bit for mode in modes_of(settings))
    return {
        (o.SHUTDOWN_OPTION, 0): _COAST,
        (o.DISABLE_OPERATION_OPTION, 0): _COAST,
        (o.HALT_OPTION, 0): _SLOW,
        (o.FAULT_REACTION_OPTION, 0): _COAST,
        (o.QUICK_STOP_OPTION, 0): _RAMP_HOLD if settings.quick_stop_holds else _RAMP,
        (o.QUICK_STOP_DECELERATION, 0): round(settings.velocity_ramp * TURN),
        (o.ENCODER_RESOLUTION, 1): TURN,
        (o.ENCODER_RESOLUTION, 2): 1,
        (o.SUPPORTED_DRIVE_MODES, 0): words,
    }


class ModuleObjects:
    """Reads and writes the objects; stores only constants, and refers to the other values."""

    def __init__(
        self,
        settings: ModuleSettings,
        profile: ModuleProfile,
        live: dict[Address, Read],
        orders: dict[Address, Obey],
    ) -> None:
        """``live`` are functions that return present values, ``orders`` functions that execute a write at once."""
        self._constants = constants(settings)
        self._profile = profile
        self._live = live
        self._orders = orders

    @property
    def indices(self) -> frozenset[int]:
        return frozenset(index for index, _ in self.addresses)

    @property
    def addresses(self) -> frozenset[Address]:
        """All entries, by index and sub-index."""
        return frozenset({*self._constants, *self._live, *self._orders}) | {
            (index, 0) for index in self._profile.values
        }

    def constant(self, index: int, subindex: int = 0) -> int | None:
        """Return the value of a constant object; None for any other."""
        return self._constants.get((index, subindex))

    def read(self, index: int, subindex: int = 0) -> tuple[int | None, int | None]:
        """Return the value and None, or None and the abort code if the object does not exist or has no value."""
        address = (index, subindex)
        if address in self._live:
            value = self._live[address]()
            return value, abort.GENERAL if value is None else None
        if address in self._constants:
            return self._constants[address], None
        if index in self._profile.values and not subindex:
            return self._profile.values[index], None
        return None, self._missing(index)

    def write(self, index: int, subindex: int, value: int) -> int | None:
        """Write a value; return the abort code, or None on success."""
        address = (index, subindex)
        if address in self._orders:
            self._orders[address](value)
            return None
        if index in self._profile.values and not subindex:
            return self._set(index, value)
        if self._constants.get(address) == value:
            return None  # unchanged
        return abort.READ_ONLY if address in {*self._live, *self._constants} else self._missing(index)

    def _set(self, index: int, value: int) -> int | None:
        signed = index == o.HOME_OFFSET or index == o.HOMING_METHOD
        if (value < 0 and not signed) or (index == o.END_VELOCITY and value):
            return _VALUE_REFUSED  # the module's trapezoids end at standstill
        self._profile.values[index] = value
        return None

    def _missing(self, index: int) -> int:
        return abort.SUBINDEX_MISSING if index in self.indices else abort.OBJECT_MISSING


def error_objects(words: error_words.ModuleErrors) -> dict[Address, Read]:
    """Return the objects that report a fault."""
    found: dict[Address, Read] = {
        address: lambda subindex=address[1]: words.value(subindex)  # type: ignore[misc]
        for address in error_words.ADDRESSES
    }
    return found | {(o.ERROR_CODE, 0): lambda: words.code, (_ERROR_REGISTER, 0): lambda: words.register}
