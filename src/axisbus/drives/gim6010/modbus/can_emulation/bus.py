"""All modules of a serial line behind a relay: CAN Simple frames in, one step of work at a time, frames out."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from itertools import cycle

from axisbus.drives.gim6010.can_simple.codec import decode
from axisbus.drives.gim6010.can_simple.decoded_message import DecodedMessage, MessageRequest
from axisbus.drives.gim6010.can_simple.endpoints import EndpointList
from axisbus.drives.gim6010.can_simple.verified_endpoints import Firmware
from axisbus.drives.gim6010.modbus.can_emulation.module import RelayedModule
from axisbus.drives.gim6010.modbus.can_emulation.status_frames import Told
from axisbus.drives.gim6010.modbus.wire import Wire

_NOTHING_DUE = 0.01  # s
_MOST = 1000  # waiting frames; more only arise if the line does not work


class Relay:
    """The modules of a line; ``take`` may be called from any thread, all other methods from one thread only."""

    def __init__(self, wire: Wire, modules: Mapping[int, tuple[EndpointList, Firmware]]) -> None:
        """``modules``: by node ID (1 to 63) the endpoint list of its firmware, and the firmware version of that list."""
        self._wire = wire
        self._modules = {node: RelayedModule(wire, node, *listed) for node, listed in modules.items()}
        self._turns = cycle(list(self._modules.values()))
        self._came: deque[tuple[int, bytes, bool]] = deque(maxlen=_MOST)

    def take(self, can_id: int, data: bytes, remote: bool) -> None:
        """Take a frame; frames for other nodes are ignored. Does not block."""
        self._came.append((can_id, data, remote))

    def work(self) -> list[Told]:
        """Do one step of work, and return the resulting messages; blocks as ``RelayedModule.work``, and raises the same errors."""
        self._sort()
        module = self._next()
        if module is None:
            self._wire.sleep(_NOTHING_DUE)
            return []
        return module.work()

    @property
    def is_idle(self) -> bool:
        """Whether every command was carried out."""
        return not self._came and not any(each.has_orders for each in self._modules.values())

    def _sort(self) -> None:
        while self._came:
            can_id, data, remote = self._came.popleft()
            told = decode(can_id, data, from_module=False, remote=remote)
            if isinstance(told, DecodedMessage | MessageRequest) and told.node in self._modules:
                self._modules[told.node].hear(told)

    def _next(self) -> RelayedModule | None:
        """Return the next module: one with a stop first, then one with commands, then the modules in turn."""
        modules = list(self._modules.values())
        for ahead in (
            [each for each in modules if each.is_stopped],
            [each for each in modules if each.has_orders],
        ):
            if ahead:
                return ahead[0]
        return next((each for _ in modules if (each := next(self._turns)).is_due), None)
