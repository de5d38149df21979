"""asyncua's own client, as a function that a test calls: it comes in, does something, and goes."""

from __future__ import annotations

import asyncio
import datetime
import logging
import socket
import warnings
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from asyncua import Client, Node, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

URI = "urn:axisbus:opcua"
T = TypeVar("T")
logging.getLogger("asyncua").setLevel(logging.CRITICAL + 1)


@dataclass(frozen=True)
class KeyPair:
    """A certificate and its key, as files."""

    certificate: Path
    key: Path
    uri: str


@dataclass(frozen=True)
class ClientIdentity:
    """The identity of a client: name and password, its certificate, and the expected certificate of the server."""

    name: str = ""
    password: str = ""
    key_pair: KeyPair | None = None
    server: Path | None = None


class Visit:
    """A session; ``cell`` is the name of the cell."""

    def __init__(self, client: Client, index: int, cell: str) -> None:
        self.client, self.index, self.cell = client, index, cell

    def node(self, path: str) -> Node:
        """A node by its path below the cell."""
        return self.client.get_node(ua.NodeId(f"Machines/{self.cell}{path}", self.index))

    async def value(self, path: str) -> tuple[Any, str]:
        """The value of a variable, and its status by name."""
        found = await self.node(path).read_data_value(raise_on_bad_status=False)
        return None if found.Value is None else found.Value.Value, found.StatusCode.name

    async def call(self, path: str, method: str) -> Any:
        """The result of a method; a bad status is raised."""
        return await self.node(path).call_method(f"{self.index}:{method}")


async def connected_client(url: str, who: ClientIdentity, timeout: float = 10.0) -> Client:
    """Return a client that has come in."""
    client = Client(url, timeout=timeout)
    client.session_timeout = 60_000
    if who.name:
        client.set_user(who.name)
        client.set_password(who.password)
    if who.key_pair is not None:
        client.application_uri = who.key_pair.uri
        await client.set_security(
            SecurityPolicyBasic256Sha256,
            who.key_pair.certificate,
            who.key_pair.key,
            server_certificate=who.server,
        )
    await client.connect()
    return client


def visit(
    url: str,
    do: Callable[[Visit], Awaitable[T]],
    who: ClientIdentity = ClientIdentity(),  # anonymous
    cell: str = "cell",
) -> T:
    """Connect, do something, and disconnect; return the result."""

    async def main() -> T:
        client = await connected_client(url, who)
        try:
            index = await client.get_namespace_index(URI)
            return await do(Visit(client, index, cell))
        finally:
            await client.disconnect()

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the client's own
        return asyncio.run(main())


def key_pair(folder: Path, name: str, *, server: bool = False, days: int = 10, names: bool = True) -> KeyPair:
    """Make a certificate that has signed itself, and its key; without ``names`` it has no application URI."""
    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    uri = f"urn:{name}:axisbus-test"
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    now = datetime.datetime.now(datetime.UTC)
    called = [x509.DNSName("localhost"), x509.DNSName(socket.gethostname())]
    if names:
        called.insert(0, x509.UniformResourceIdentifier(uri))
    use = ExtendedKeyUsageOID.SERVER_AUTH if server else ExtendedKeyUsageOID.CLIENT_AUTH
    usage = x509.KeyUsage(True, True, True, True, False, True, False, False, False)
    made = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=abs(days) + 1))
        .not_valid_after(now + datetime.timedelta(days=days))
        .add_extension(x509.SubjectAlternativeName(called), critical=False)
        .add_extension(usage, critical=False)
        .add_extension(x509.ExtendedKeyUsage([use]), critical=False)
        .sign(key, hashes.SHA256())
    )
    found = KeyPair(folder / f"{name}.pem", folder / f"{name}-key.pem", uri)
    found.certificate.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    found.key.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return found
