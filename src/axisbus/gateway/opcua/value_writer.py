"""Readings written to the nodes: what has changed at once, all others now and then, so that their times go on."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta

from asyncua import Node, Server, ua

from axisbus.gateway.opcua.address_space import TYPES, CellVariables
from axisbus.gateway.opcua.axis_readings import AxisReadings, Key
from axisbus.gateway.opcua.status_code import GONE, OpcuaValue, Quality
from axisbus.gateway.opcua.variables import ROWS

_ALL = 1.0  # seconds between two writings of what has not changed
_OLD = 0.02  # seconds after which a look is too old for who reads
_STATUS = {quality: ua.StatusCode(getattr(ua.StatusCodes, quality.value)) for quality in Quality}
_ROWS = {row.name: row for row in ROWS}


class Updater:
    """Writes what is read of the machine; holds what was written last, and when."""

    def __init__(self, server: Server, nodes: CellVariables, looker: AxisReadings) -> None:
        self._server, self._nodes, self._looker = server, nodes, looker
        self._written: dict[Key, OpcuaValue] = {}
        self._running: bool | None = None
        self._alone = asyncio.Lock()  # what was seen later is written later
        self._looked = self._all = float("-inf")

    @property
    def is_old(self) -> bool:
        """Whether the last look is too old for who reads now, such as after a pause of the process."""
        return time.monotonic() - self._looked > _OLD

    async def update(self) -> None:
        """Look at the machine, and write what has changed; where it cannot be looked at, nothing of it stays good.

        Raises:
            Exception: why it cannot be looked at.
        """
        async with self._alone:
            try:
                await self._take(self._looker.look())
            except Exception:
                await self._take(dict.fromkeys(self._nodes.values, GONE))
                raise

    async def _take(self, readings: Mapping[Key, OpcuaValue]) -> None:
        now = self._looked = time.monotonic()
        whole = now - self._all >= _ALL
        if whole:
            self._all = now
        clock, utc = self._looker.now(), datetime.now(UTC)
        for key, reading in readings.items():
            if whole or _differ(self._written.get(key), reading):
                await self._write(key, reading, clock, utc)
        await self._tell_running()

    async def _write(self, key: Key, reading: OpcuaValue, clock: float, utc: datetime) -> None:
        before, self._written[key] = self._written.get(key), reading
        row = _ROWS[key[1]]
        when = utc if reading.stamp is None else utc - timedelta(seconds=max(0.0, clock - reading.stamp))
        variant = ua.Variant(reading.value, TYPES[row.type]) if reading.value is not None else None
        await self._put(self._nodes.values[key], ua.DataValue(variant, _STATUS[reading.quality], when, utc))
        if row.states is not None and (before is None or before.value != reading.value):
            words = "" if reading.value is None else row.states[int(reading.value)]
            await self._put(self._nodes.texts[key], ua.DataValue(ua.Variant(ua.LocalizedText(words))))

    async def _tell_running(self) -> None:
        running = self._looker.machine is not None
        if running is not self._running:
            self._running = running
            await self._put(self._nodes.running, ua.DataValue(ua.Variant(running, ua.VariantType.Boolean)))

    async def tell_devices(self, devices: tuple[str, ...]) -> None:
        """Write what each node is."""
        variant = ua.Variant(list(devices), ua.VariantType.String, is_array=True)
        await self._put(self._nodes.devices, ua.DataValue(variant))

    async def _put(self, node: Node, value: ua.DataValue) -> None:
        await self._server.write_attribute_value(node.nodeid, value)


def _differ(before: OpcuaValue | None, reading: OpcuaValue) -> bool:
    return before is None or (before.value, before.quality) != (reading.value, reading.quality)
