"""How a server is kept: who may come in and by which files, which methods are there, and how often it looks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from axisbus.gateway.opcua.access import Access
from axisbus.gateway.opcua.methods import OpcuaMethod
from axisbus.gateway.opcua.users import Users


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """Who may come in, the files of the server's certificate and key, the folder of those that it trusts, and its users."""

    access: Access
    certificate: Path | None = None
    key: Path | None = None
    trust: Path | None = None
    users: Users | None = None
    allow_reset: bool = False
    rate: float = 10.0  # looks at the machine in a second

    @property
    def verbs(self) -> tuple[OpcuaMethod, ...]:
        """The methods that are there."""
        return (OpcuaMethod.HALT, OpcuaMethod.STOP, *((OpcuaMethod.RESET,) if self.allow_reset else ()))
