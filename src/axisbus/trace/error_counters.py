"""Count the frames that violate the protocol, by service and node, for the summary of a listener."""

from __future__ import annotations

from collections import Counter

from axisbus.trace.decoded import Decoded, FrameKind


class TraceErrorCounters:
    """Counts frames with a ``problem``; holds state."""

    def __init__(self) -> None:
        self._found: Counter[tuple[FrameKind, int | None]] = Counter()

    def note(self, one: Decoded) -> None:
        """Count a frame if it has a problem."""
        if one.problem:
            self._found[one.kind, one.node] += 1

    @property
    def found(self) -> list[tuple[FrameKind, int | None, int]]:
        """Return service, node (None: the bus) and count, in the order of ``FrameKind`` and of nodes."""
        order = list(FrameKind)
        keys = sorted(self._found, key=lambda key: (order.index(key[0]), key[1] or 0))
        return [(*key, self._found[key]) for key in keys]

    def words(self) -> str:
        """Return them in one line, empty if there are none: ``against the protocol: 3 TPDO (node 2), 1 EMCY (node 5)``."""
        texts = [
            f"{count} {kind.value}" + (f" (node {node})" if node is not None else "")
            for kind, node, count in self.found
        ]
        return f"against the protocol: {', '.join(texts)}" if texts else ""

    def plain(self) -> list[dict[str, object]]:
        """Return them as plain values."""
        return [{"kind": kind.value, "node": node, "count": count} for kind, node, count in self.found]
