"""``python -m axisbus.gateway.zenoh.recordings_worker FOLDER``: answers a question about recordings (standard input and output).

A process of its own, of little weight with the operating system: a recording is minutes of work for one that commands a machine.
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
    """Return what is asked for; an error is one of the things that it may come to. Blocks."""
    try:
        if not ask.recording:
            return HistoryAnswer(recordings=samples.recordings(folder))
        return samples.samples(mcap_reader.load(samples.chosen(folder, ask.recording)), ask)
    except AxisbusError as error:
        return HistoryAnswer(error=to_fields(error))


def main() -> int:
    """Read one question, and answer it."""
    if hasattr(os, "nice"):
        os.nice(_NICE)
    ask = msgspec.json.decode(sys.stdin.buffer.read(), type=HistoryAsk)
    sys.stdout.buffer.write(msgspec.json.encode(answer(Path(sys.argv[1]), ask)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
