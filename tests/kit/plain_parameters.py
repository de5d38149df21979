"""The parameters of a simulated module, read and written at once and without a bus, in virtual time."""

from __future__ import annotations

import json

from axisbus.drives.gim6010.can_simple.endpoints import Firmware, parse
from axisbus.drives.gim6010.parameters import rules, values
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import NodeError, NodeTimeout, StateError


class PlainParameters:
    """A module by name; ``silent`` paths are not answered, ``stubborn`` ones keep their values, ``acts`` counts writes and saves.

    ``cut`` ends it before the act of this number, as a kill would.
    """

    widest = rules.NARROW

    def __init__(self, module: Module, *, silent=(), stubborn=(), cut: int | None = None) -> None:
        self.module = module
        self.listed = parse(json.dumps(module.json()), "a list")
        self.firmware, self.serial = Firmware(*module.firmware), 0x32323334
        self.silent, self.stubborn, self.cut = set(silent), set(stubborn), cut
        self.acts = 0
        self.written: dict[str, object] = {}

    def endpoint(self, path):
        return self.listed.endpoints[path]

    def read(self, path):
        if path in self.silent:
            raise NodeTimeout("no answer", node=5)
        value = self.module.usb_read(path)
        return bool(value) if self.listed.endpoints[path].type == "bool" else value

    def require_idle(self):
        if self.module.axis.state != 1:
            raise StateError("not idle")

    def write(self, path, value, *, by_name=False):
        rules.require_setting(self.endpoint(path), by_name=by_name)
        self.require_idle()
        self._act()
        if path not in self.stubborn:
            self.module.usb_write(path, value)
        held = self.read(path)
        if not values.same(held, value):
            raise NodeError("it holds another", node=5)
        self.written[path] = held
        return held

    def save(self):
        self.require_idle()
        self._act()
        self.module.usb_call("save_configuration")
        lost = [path for path, value in self.written.items() if not values.same(self.read(path), value)]
        if lost:
            raise NodeError("lost", node=5)

    def _act(self):
        if self.acts == self.cut:
            raise Cut
        self.acts += 1


class Cut(BaseException):
    """A kill."""
