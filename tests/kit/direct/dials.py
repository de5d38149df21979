"""Faults of a bus without frames."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class CycleFaultSettings:
    """Faults of the bus as a whole; may be changed at any time.

    read, write, commit, sync, heartbeat, wait: an exception that the call of this name raises
    send_blocks: seconds of virtual time that the next ``commit`` takes, as with a full send queue
    wait_late: seconds by which ``wait_until`` returns too late
    sync_lost: SYNC does not reach the nodes
    heartbeat_lost: the master's heartbeat does not reach the nodes
    """

    read: Exception | None = None
    write: Exception | None = None
    commit: Exception | None = None
    sync: Exception | None = None
    heartbeat: Exception | None = None
    wait: Exception | None = None
    send_blocks: float = 0.0
    wait_late: float = 0.0
    sync_lost: bool = False
    heartbeat_lost: bool = False
