"""``python -m axisbus.gateway.zenoh.recordings_worker FOLDER``: answer a query about recordings (standard input and output).

This is a process of its own with low priority, because reading a recording may take minutes, and the bridge commands a machine.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import msgspec

from axisbus.errors import AxisbusError
from axisbus.fleet.messages import HistoryAnswer, HistoryAsk
from axisbus.gateway.zenoh import samples
from axisbus.ipc.errors import to_fields
from axisbus.record import mcap_reader

_NICE = 15


def answer(folder: Path, ask: HistoryAsk) -> HistoryAnswer:
    """Return the answer to a query; an error is a possible answer. Blocks."""
    try:
        if not ask.recording:
            return HistoryAnswer(recordings=samples.recordings(folder))
        return samples.samples(mcap_reader.load(samples.chosen(folder, ask.recording)), ask)
    except AxisbusError as error:
        return HistoryAnswer(error=to_fields(error))


def main() -> int:
    """Read one query, and answer it."""
    if hasattr(os, "nice"):
        os.nice(_NICE)
    ask = msgspec.json.decode(sys.stdin.buffer.read(), type=HistoryAsk)
    sys.stdout.buffer.write(msgspec.json.encode(answer(Path(sys.argv[1]), ask)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
