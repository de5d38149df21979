"""Write readings to the nodes: changed values at once, all others once per second, so that their time stamps advance."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta

from asyncua import Node, Server, ua

from axisbus.gateway.opcua.address_space import TYPES, CellVariables
from axisbus.gateway.opcua.axis_readings import GONE, AxisReadings, Key, OpcuaValue, Quality
from axisbus.gateway.opcua.variables import ROWS

_FULL_PERIOD = 1.0  # seconds between two writes of an unchanged value
_OLD = 0.02  # seconds after which the last update is too old for a read request
_STATUS = {quality: ua.StatusCode(getattr(ua.StatusCodes, quality.value)) for quality in Quality}
_ROWS = {row.name: row for row in ROWS}


class Updater:
    """Write the readings of the machine; holds the last written ones, and their times."""

    def __init__(self, server: Server, nodes: CellVariables, readings_source: AxisReadings) -> None:
        self._server, self._nodes, self._source = server, nodes, readings_source
        self._written: dict[Key, OpcuaValue] = {}
        self._running: bool | None = None
        self._lock = asyncio.Lock()  # keeps the order of the readings
        self._last_update = self._last_full = float("-inf")

    @property
    def is_old(self) -> bool:
        """Whether the last update is too old for a read request, for example after a pause of the process."""
        return time.monotonic() - self._last_update > _OLD

    async def update(self) -> None:
        """Read the machine, and write the changed values; if it cannot be read, no value stays good.

        Raises:
            Exception: the reason why it cannot be read.
        """
        async with self._lock:
            try:
                await self._write_readings(self._source.poll())
            except Exception:
                await self._write_readings(dict.fromkeys(self._nodes.values, GONE))
                raise

    async def _write_readings(self, readings: Mapping[Key, OpcuaValue]) -> None:
        now = self._last_update = time.monotonic()
        full = now - self._last_full >= _FULL_PERIOD
        if full:
            self._last_full = now
        clock, utc = self._source.now(), datetime.now(UTC)
        for key, reading in readings.items():
            if full or _differ(self._written.get(key), reading):
                await self._write(key, reading, clock, utc)
        await self._write_running()

    async def _write(self, key: Key, reading: OpcuaValue, clock: float, utc: datetime) -> None:
        before, self._written[key] = self._written.get(key), reading
        row = _ROWS[key[1]]
        when = utc if reading.stamp is None else utc - timedelta(seconds=max(0.0, clock - reading.stamp))
        variant = ua.Variant(reading.value, TYPES[row.type]) if reading.value is not None else None
        await self._put(self._nodes.values[key], ua.DataValue(variant, _STATUS[reading.quality], when, utc))
        if row.states is not None and (before is None or before.value != reading.value):
            text = "" if reading.value is None else row.states[int(reading.value)]
            await self._put(self._nodes.texts[key], ua.DataValue(ua.Variant(ua.LocalizedText(text))))

    async def _write_running(self) -> None:
        running = self._source.machine is not None
        if running is not self._running:
            self._running = running
            await self._put(self._nodes.running, ua.DataValue(ua.Variant(running, ua.VariantType.Boolean)))

    async def write_devices(self, devices: tuple[str, ...]) -> None:
        """Write the identity of each node."""
        variant = ua.Variant(list(devices), ua.VariantType.String, is_array=True)
        await self._put(self._nodes.devices, ua.DataValue(variant))

    async def _put(self, node: Node, value: ua.DataValue) -> None:
        # thousands of items may monitor a value: the methods of users are called between two values
        await asyncio.sleep(0)
        await self._server.write_attribute_value(node.nodeid, value)


def _differ(before: OpcuaValue | None, reading: OpcuaValue) -> bool:
    return before is None or (before.value, before.quality) != (reading.value, reading.quality)
