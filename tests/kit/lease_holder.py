"""A program that takes the lease of a cell, lets x turn, and renews until it is ended: ``python -m kit.lease_holder WHERE``."""

from __future__ import annotations

import sys
import time
from pathlib import Path

from kit.zenoh_cell import Client, until


def main() -> None:
    """Take the lease, enable, turn, and report it."""
    where = sys.argv[1]  # an endpoint, or a configuration of Zenoh
    config = Path(where) if where.endswith(".json5") else None
    with Client(where, "Holder", config) as client:
        until(lambda: client.take().token)  # the previous holder may still have it for a moment
        client.must("enable", "x")
        client.must("move_velocity", "x", velocity=30.0)
        print("moves", flush=True)
        time.sleep(60)


if __name__ == "__main__":
    main()
