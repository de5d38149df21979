"""Use axisbus with asyncio: commands can be awaited."""

import asyncio
from pathlib import Path

from axisbus import Machine


async def main() -> None:
    """Home all axes at once, then move two of them independently."""
    async with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
        await asyncio.gather(*(axis.enable() for axis in cell))
        await asyncio.gather(*(axis.home() for axis in cell))
        await asyncio.gather(there_and_back(cell, "x"), there_and_back(cell, "y"))


async def there_and_back(cell: Machine, name: str) -> None:
    """Move an axis out and back."""
    axis = cell[name]
    await axis.move_absolute(40.0, velocity=120.0)
    print(f"{name}: {axis.position:.2f} {axis.unit}")
    await axis.move_absolute(0.0)
    print(f"{name}: {axis.position:.2f} {axis.unit}")


asyncio.run(main())
