"""All modules of a serial line behind a relay: frames of CAN Simple go in, one piece of work at a time is done, frames come out."""

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
_MOST = 1000  # frames that wait; more are of a line that carries nothing


class Relay:
    """Holds the modules of a line; ``take`` may be called from any thread, all else belongs to one."""

    def __init__(self, wire: Wire, modules: Mapping[int, tuple[EndpointList, Firmware]]) -> None:
        """``modules``: by node ID (1 to 63) the list of endpoints of its firmware, and the firmware that it is for."""
        self._wire = wire
        self._modules = {node: RelayedModule(wire, node, *listed) for node, listed in modules.items()}
        self._turns = cycle(list(self._modules.values()))
        self._came: deque[tuple[int, bytes, bool]] = deque(maxlen=_MOST)

    def take(self, can_id: int, data: bytes, remote: bool) -> None:
        """Take a frame; what is for none of the modules is passed over. Does not block."""
        self._came.append((can_id, data, remote))

    def work(self) -> list[Told]:
        """Do one piece of work, and return what is told by it; blocks as ``RelayedModule.work``, and raises as that."""
        self._sort()
        module = self._next()
        if module is None:
            self._wire.sleep(_NOTHING_DUE)
            return []
        return module.work()

    @property
    def is_idle(self) -> bool:
        """Whether every order has been carried out."""
        return not self._came and not any(each.has_orders for each in self._modules.values())

    def _sort(self) -> None:
        while self._came:
            can_id, data, remote = self._came.popleft()
            told = decode(can_id, data, from_module=False, remote=remote)
            if isinstance(told, DecodedMessage | MessageRequest) and told.node in self._modules:
                self._modules[told.node].hear(told)

    def _next(self) -> RelayedModule | None:
        """Return whose turn it is: who is stopped, then who has orders, then the next one."""
        modules = list(self._modules.values())
        for ahead in (
            [each for each in modules if each.is_stopped],
            [each for each in modules if each.has_orders],
        ):
            if ahead:
                return ahead[0]
        return next((each for _ in modules if (each := next(self._turns)).is_due), None)
