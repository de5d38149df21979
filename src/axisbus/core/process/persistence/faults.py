"""Recordings of the axes around a fault, made by the core itself: the newest of them, whatever the program does.

Theory of operation
-------------------
In each cycle the image is put into a ring buffer, nothing else. After an axis has entered ErrorStop, ``_AFTER`` s pass, or the
machine is closed. Then a thread writes the ring buffer to a file, with the events of that time, and deletes the oldest file.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path

from axisbus.bus.pdo.tpdo_timeout import PdoEvent
from axisbus.cell.model import SIMULATED, CellConfig
from axisbus.cia301.incident import Incident
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.process.persistence.journal import FAULT, faults_of, folder_of
from axisbus.core.process.publisher import Publisher
from axisbus.drives.emcy_text import incident_words
from axisbus.ipc.image import ImageReader
from axisbus.motion.snapshot import Snapshot
from axisbus.record import fault_file
from axisbus.record.columns import AxisForm
from axisbus.record.events import RecordingEventSource
from axisbus.record.output_file import facts_of
from axisbus.record.sample_packing import RowForm
from axisbus.session import MachineSession

log = logging.getLogger("axisbus")
_BEFORE, _AFTER = 1.5, 1.0  # seconds
_MAX_FILES = 20  # files of a cell
_PATIENCE = 3.0  # seconds that leaving waits for the last of them
_NANO = 1_000_000_000

Images = list[tuple[float, bytes]]


class Faults:
    """Holds the last images, the axes in ErrorStop, and the time until which the recording continues."""

    def __init__(
        self,
        cell: CellConfig,
        session: MachineSession,
        nodes: Mapping[int, NodeParts],
        publisher: Publisher,
        reader: ImageReader,
        real_time_status: str,
    ) -> None:
        """``reader`` reads the images of ``publisher``; ``real_time_status`` as ``Machine.real_time_status``."""
        self.cell = cell
        self.session = session
        self._nodes = nodes
        self._publisher = publisher
        self._reader = reader
        self._real_time_status = real_time_status
        self._ring: deque[tuple[float, bytes]] = deque(
            maxlen=int((_BEFORE + _AFTER) / cell.bus.scan_period) + 1
        )
        self._faulty: frozenset[str] = frozenset()
        self._until: float | None = None
        self._work: queue.Queue[Images | None] = queue.Queue()
        self._thread = threading.Thread(target=self._run, name="axisbus faults", daemon=True)
        self._thread.start()

    def after_cycle(self, now: float, _: Mapping[str, Snapshot]) -> None:
        """Store the image of this cycle, and check whether an axis has entered ErrorStop; does not block."""
        publisher = self._publisher
        self._ring.append((now, publisher.newest))
        faulty = publisher.faulty
        if faulty != self._faulty:
            if self._until is None and faulty - self._faulty:
                self._until = now + _AFTER
            self._faulty = frozenset(faulty)
        if self._until is not None and now >= self._until:
            self._hand_over()

    def close(self) -> None:
        """Write the last recording; there will be no further cycle. Blocks, at most 3 s."""
        if self._until is not None:
            self._hand_over()
        self._work.put(None)
        self._thread.join(_PATIENCE)

    def node(self, node_id: int) -> _Node:
        """Return the events of a node."""
        return _Node(self._nodes[node_id])

    def _hand_over(self) -> None:
        self._until = None
        self._work.put(list(self._ring))

    def _run(self) -> None:
        while (images := self._work.get()) is not None:
            try:
                self._store(images)
            except Exception as error:  # noqa: BLE001  # usually a full disk: the next recording is tried again
                log.warning("the motion of the axes around a fault was not stored: %s", error)

    def _store(self, images: Images) -> None:
        axis_facts = self.session.axes
        forms = {name: AxisForm.of(facts.parameters) for name, facts in axis_facts.items()}
        row = RowForm(len(forms))
        rows = bytearray()
        for now, data in images:
            image = self._reader.image(data)
            if all(name in image for name in forms):  # omits the axes of a node that came up later
                rows += row.struct.pack(*row.values(now, [image[name] for name in forms]))
        began = images[0][0]
        offset = time.time_ns() - round(time.monotonic() * _NANO)
        clocks = {
            "began_monotonic_ns": str(round(began * _NANO)),
            "began_ns": str(round(began * _NANO) + offset),
        }
        facts = facts_of(
            self.cell, simulated=self.cell.bus.interface == SIMULATED, real_time_status=self._real_time_status
        )
        path = self._free_path()
        fault_file.write(
            path, forms, bytes(rows), RecordingEventSource(self).take(began), {**facts, **clocks}
        )
        log.info("the motion of the axes around a fault is in %s", path)
        for old in faults_of(self.cell_path)[:-_MAX_FILES]:
            old.unlink(missing_ok=True)

    @property
    def cell_path(self) -> str:
        """The absolute path of the cell's file."""
        return str(Path(self.cell.file).absolute())

    def _free_path(self) -> Path:
        folder = folder_of(self.cell_path)
        folder.mkdir(parents=True, exist_ok=True)
        now = time.time()
        stamp = time.strftime("%Y-%m-%dT%H-%M-%S", time.localtime(now)) + f".{int(now * 1000) % 1000:03d}"
        return folder / f"{stamp}{FAULT}"


class _Node:
    """The events of a node (``record.events.NodeEventAccess``)."""

    def __init__(self, parts: NodeParts) -> None:
        self._parts = parts

    @property
    def incidents(self) -> list[Incident]:
        """Its incidents, oldest first."""
        return list(self._parts.node.emcy.incidents)

    @property
    def pdo_events(self) -> list[PdoEvent]:
        """The events of its TPDOs."""
        return list(self._parts.node.pdo_events)

    def format_incident(self, incident: Incident) -> list[str]:
        """Return an incident as lines."""
        return incident_words(incident, self._parts.make)
