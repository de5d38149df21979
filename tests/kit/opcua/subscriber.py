"""Subscribes to all of a cell: ``python -m kit.opcua.subscriber URL CELL SECONDS`` counts all notifications, and the good ones."""

from __future__ import annotations

import asyncio
import sys
from typing import Any

from asyncua import ua

from kit.opcua.client import Visit, visit


class Counting:
    """Counts notifications, and the good ones."""

    def __init__(self) -> None:
        self.changes = self.good = 0

    def datachange_notification(self, node: object, value: object, data: Any) -> None:
        self.changes += 1
        self.good += data.monitored_item.Value.StatusCode.is_good()


async def follow(seen: Visit, seconds: float) -> Counting:
    """Subscribe for a while."""
    counting = Counting()
    axes = await seen.node("/Axes").get_children()
    variables = [
        variable for axis in axes for variable in await axis.get_children(nodeclassmask=ua.NodeClass.Variable)
    ]
    subscription = await seen.client.create_subscription(100, counting)
    await subscription.subscribe_data_change(variables)
    await asyncio.sleep(seconds)
    return counting


def main(url: str, cell: str, seconds: str) -> None:
    """Follow, and print."""
    found = visit(url, lambda seen: follow(seen, float(seconds)), cell=cell)
    print(found.changes, found.good)


if __name__ == "__main__":
    main(*sys.argv[1:])
