"""The modules that use names which Windows or macOS lacks, by their need; no other module may."""

from __future__ import annotations

# A core in a process of its own, with the programs that join it, is for Linux: ``core.process.launch.has_own_process``.
_OWN_PROCESS = (
    "bus.link.claims",
    "bus.link.ownership",
    "bus.link.socketpair_bus",
    "core.process.launch",
    "core.process.listener",
    "core.process.server",
    "core.process.signal_forwarding",
    "core.process.simulated_drives",
    "core.process.watchdog_process",
)
NEEDS = {
    "a core in a process of its own": _OWN_PROCESS,
    "SocketCAN": ("bus.link.raw_sockets", "bus.link.frame_batch"),
    "sending without waiting": ("bus.link.socketcand", "sim.socketcand_server"),
    "real-time priority": ("core.realtime_setup",),
    "forked children": ("bus.link.fork_guard", "machine.signal_shutdown"),
    "limits of a process": ("system.process_limits",),
    "locks": ("system.file_lock",),
    "sockets with a path": ("system.local_sockets",),
    "keys of a terminal": ("system.terminal",),
    "pseudo-terminals": ("drives.gim6010.sim.modbus.terminal",),
    "the user of a connection": ("web.access.tokens",),
}
ALLOWED = {name for names in NEEDS.values() for name in names}
