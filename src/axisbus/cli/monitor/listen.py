"""``axisbus monitor --listen``: show the traffic of a bus, updated periodically; sends nothing."""

from __future__ import annotations

import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from axisbus.bus.link.adapter import listening_text
from axisbus.bus.link.listen import Listener
from axisbus.cell import reader
from axisbus.cia301.master_detection import words
from axisbus.cli.shared.common import OK, rounds, say, say_json, say_next
from axisbus.core.files import load_dictionaries
from axisbus.core.listen_only import listen_to
from axisbus.machine.bus_monitor import Beat, BusMonitor, NodeHeard
from axisbus.trace import frame_formats
from axisbus.wording import counted

_NO_TRAFFIC = "nothing was heard: no node sends, or not on this channel or at this bit rate"


def run(path: Path, every: float, count: int | None, as_json: bool) -> int:
    """Show the received traffic every ``every`` seconds, ``count`` times (None: until Ctrl-C)."""
    cell = reader.load(path)
    overview = BusMonitor(cell, load_dictionaries(cell))
    with ExitStack() as stack, suppress(KeyboardInterrupt):  # the normal end of listening
        listener = listen_to(cell, stack, silent=True)
        if not as_json:
            say(
                f"listening on {cell.bus.interface}:{cell.bus.channel or ''}; {listening_text(cell.bus.interface)}"
            )
        _watch(listener, overview, every, count, as_json)
    if not as_json:
        if against := overview.tally.words():
            say(against)
        for line in overview.foreign.lines():
            say(line)
        say_next(
            f"every frame decoded: axisbus trace {path}; nodes that answer (this sends): axisbus scan {path}"
        )
    return OK


def _watch(listener: Listener, overview: BusMonitor, every: float, count: int | None, as_json: bool) -> None:
    for _ in rounds(count, lambda: None):
        before = overview.frames
        for frame in listener.frames(every):
            overview.feed(frame, time.monotonic())
        rate, now = (overview.frames - before) / every, time.monotonic()
        if as_json:
            say_json(_plain(overview, rate, now))
        else:
            for line in lines(overview, rate, now):
                say(line)


def lines(overview: BusMonitor, rate: float, now: float) -> list[str]:
    """Return the present state and the news, which are consumed; ``rate`` in frames per second."""
    found = [f"bus        {'; '.join(_of_bus(overview, rate, now))}"]
    for node_id in sorted(overview.nodes):
        found += _of_node(overview.nodes[node_id], now)
    for one in overview.take_news():
        found.append(f"           !! {frame_formats.who(one)} {one.kind.value}: {frame_formats.what(one)}")
    if overview.missed:
        found.append(f"           !! {overview.missed} more are not shown (axisbus trace shows all)")
    overview.missed = 0
    return found


def _of_bus(overview: BusMonitor, rate: float, now: float) -> list[str]:
    if not overview.frames:
        return [_NO_TRAFFIC]
    found = [f"{rate:.0f} frames/s", f"SYNC {_pace(overview.sync, now)}"]
    if overview.unknown:
        found.append(f"{counted(overview.unknown, 'frame')} of no known service")
    signs = [line.rpartition(": ")[0] for line in words(overview.signs.heard)]
    return [*found, f"a master sends {', '.join(signs)}" if signs else "no master was heard"]


def _of_node(node: NodeHeard, now: float) -> list[str]:
    who = f"{node.node_id} {node.name}".rstrip()
    state = "NMT state not reported" if node.state is None else node.state.text
    heartbeat = "nothing heard" if not node.frames else f"{state}; heartbeat {_pace(node.beat, now)}"
    return [
        f"{who:<10} {heartbeat}",
        *(
            f"           {_before(newest.taken, now):>10}  {'' if newest.one.from_node else '> '}{frame_formats.what(newest.one)}"
            for _, newest in sorted(node.newest.items())
        ),
    ]


def _pace(beat: Beat, now: float) -> str:
    if not beat.times:
        return "not heard"
    found = beat.intervals
    if found is None:
        return f"once, {_before(beat.taken, now)}"
    mean, shortest, longest = (each * 1000 for each in found)
    return f"every {mean:.1f} ms ({shortest:.1f} to {longest:.1f}), the last {_before(beat.taken, now)}"


def _before(then: float, now: float) -> str:
    return f"{max(0.0, now - then):.2f} s ago"


# -- as JSON -----------------------------------------------------------------------------------------------------------


def _plain(overview: BusMonitor, rate: float, now: float) -> dict[str, Any]:
    missed, overview.missed = overview.missed, 0
    return {
        "frames": overview.frames,
        "frames_per_second": rate,
        "unknown": overview.unknown,
        "sync": _plain_beat(overview.sync, now),
        "master": words(overview.signs.heard),
        "nodes": [_plain_node(node, now) for _, node in sorted(overview.nodes.items())],
        "news": [frame_formats.plain(one) for one in overview.take_news()],
        "news_missed": missed,
        "against_the_protocol": overview.tally.plain(),
        "other_protocols": [each.plain for each in overview.foreign.speakers],
    }


def _plain_node(node: NodeHeard, now: float) -> dict[str, Any]:
    return {
        "node": node.node_id,
        "name": node.name,
        "frames": node.frames,
        "state": None if node.state is None else node.state.text,
        "heartbeat": _plain_beat(node.beat, now),
        "newest": {
            name: {"age": now - newest.taken, "count": newest.count, **frame_formats.plain(newest.one)}
            for name, newest in sorted(node.newest.items())
        },
    }


def _plain_beat(beat: Beat, now: float) -> dict[str, float] | None:
    if not beat.times:
        return None
    age = {"age": now - beat.taken}
    found = beat.intervals
    if found is None:
        return age
    return {**age, **dict(zip(("period", "shortest", "longest"), found, strict=True))}
