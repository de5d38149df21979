"""The options of a server: admitted clients and files, available methods, and update rate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from axisbus.gateway.opcua.access import Access
from axisbus.gateway.opcua.methods import OpcuaMethod
from axisbus.gateway.opcua.users import Users


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """The admitted clients, the server's certificate and key, the folder of trusted certificates, and the users."""

    access: Access
    certificate: Path | None = None
    key: Path | None = None
    trust: Path | None = None
    users: Users | None = None
    allow_reset: bool = False
    rate: float = 10.0  # updates per second

    @property
    def verbs(self) -> tuple[OpcuaMethod, ...]:
        """The available methods."""
        return (OpcuaMethod.HALT, OpcuaMethod.STOP, *((OpcuaMethod.RESET,) if self.allow_reset else ()))
