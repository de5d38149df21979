"""A simulated module on a simulated USB port: the objects are those of the package odrive, their source is the module."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import odrive
from odrive.runtime_device import RuntimeDevice
from odrive.sync_tree import SyncObject

from axisbus.drives.gim6010.sim.module import Module

_LOOK = 0.01  # s


class Port:
    """Where modules are plugged in; stands for odrive's ``find_sync``, and holds the loop in which odrive's objects work."""

    def __init__(self, *modules: Module) -> None:
        self.modules = {f"{module.usb_read('serial_number'):012X}": module for module in modules}
        self.loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self.loop.run_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join()
        self.loop.close()

    def find(self, serial_number: str | None = None, timeout: float = 0.0, count: int | None = None):
        end = time.monotonic() + timeout
        while True:
            found = [
                self._seen(name, each) for name, each in self.modules.items() if serial_number in (None, name)
            ]
            there = [each for each in found if each is not None]
            if len(there) >= (count or 1):
                return there[0] if count is None else there[:count]
            if time.monotonic() >= end:
                raise TimeoutError
            time.sleep(_LOOK)

    def _seen(self, name: str, module: Module) -> SyncObject | None:
        module.step(time.monotonic())
        return (
            SyncObject.from_json(Runtime(name, module), self.loop, module.json()) if module.is_awake else None
        )


class Runtime:
    """The source of odrive's objects: one connection, which is over when the module restarts."""

    def __init__(self, name: str, module: Module) -> None:
        self.serial_number = name
        self.flat_json: dict = {}
        RuntimeDevice._flatten_json([], module.json(), self.flat_json)
        self._paths = {each["id"]: path for path, each in self.flat_json.items()}
        self._module, self._restarts = module, module.restarts

    async def read(self, info):
        self._require()
        return info.codec.to_wire(self._module.usb_read(self._paths[info.endpoint_id]))

    async def write(self, info, value):
        self._require()
        if not info.writable:
            raise AttributeError("This property cannot be written to.")
        self._module.usb_write(self._paths[info.endpoint_id], info.codec.to_wire(value))

    async def call_function(self, info, *_):
        self._require()
        self._module.usb_call(self._paths[info.endpoint_id])
        self._require()

    def _require(self) -> None:
        self._module.step(time.monotonic())
        if self._module.restarts != self._restarts or not self._module.is_awake:
            raise odrive.DeviceLostException(
                SimpleNamespace(info=SimpleNamespace(serial_number=self.serial_number))
            )


@contextmanager
def plugged_in(monkeypatch, *modules: Module) -> Iterator[Port]:
    """Have these modules on USB while the block runs."""
    port = Port(*modules)
    monkeypatch.setattr(odrive, "find_sync", port.find)
    try:
        yield port
    finally:
        port.close()
