"""Names of ROS 2 as rmw_zenoh writes them: keys of topics, and the tokens by which nodes and their topics are seen.

Published in the design document of rmw_zenoh: "Topic and Service name mapping to Zenoh key expressions" and "Graph Cache".
"""

from __future__ import annotations

import hashlib
import re
from typing import NamedTuple

from axisbus.errors import ArgumentError

_ADMIN = "@ros2_lv"
_NODE, PUBLISHER, SUBSCRIPTION = "NN", "MP", "MS"
_ENCLAVE = "%"  # none
_PART = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
LAST_ONE = "::,1:,:,:,,"  # reliable, volatile, the last one kept: what is as by default is left out


class Topic(NamedTuple):
    """A topic by its fully qualified name, with its type (``sensor_msgs/msg/JointState``) and the hash of that (RIHS01)."""

    name: str
    type_name: str
    type_hash: str

    @property
    def dds_type(self) -> str:
        """Its type as DDS has it."""
        package, kind, name = self.type_name.split("/")
        return f"{package}::{kind}::dds_::{name}_"

    def key(self, domain: int) -> str:
        """Return by which key its messages go."""
        return f"{domain}/{self.name.strip('/')}/{self.dds_type}/{self.type_hash}"


class RosNode(NamedTuple):
    """A node in a session: ``zid`` is that of the session, ``number`` its own, and one of a topic counts on from there."""

    domain: int
    zid: str
    number: int
    namespace: str
    name: str

    @property
    def token(self) -> str:
        """By what it is seen."""
        return f"{self._begin(self.number, _NODE)}/{mangled(self.namespace)}/{self.name}"

    def token_of(self, kind: str, number: int, topic: Topic, qos: str = LAST_ONE) -> str:
        """Return by what a publisher or a subscription (``kind``) of it is seen."""
        whose = f"{self._begin(number, kind)}/{mangled(self.namespace)}/{self.name}"
        return f"{whose}/{mangled(topic.name)}/{topic.dds_type}/{topic.type_hash}/{qos}"

    def _begin(self, number: int, kind: str) -> str:
        return f"{_ADMIN}/{self.domain}/{self.zid}/{self.number}/{number}/{kind}/{_ENCLAVE}"


def mangled(name: str) -> str:
    """Return a name as a part of a key."""
    return name.replace("/", "%")


def namespace_of(text: str) -> str:
    """Return a namespace as ROS 2 has it: ``/``, or ``/`` before each of its parts.

    Raises:
        ArgumentError: it is none.
    """
    parts = [part for part in text.strip("/").split("/") if part]
    wrong = [part for part in parts if not _PART.fullmatch(part)]
    if wrong or "//" in text:
        raise ArgumentError(
            f"{text!r} is no namespace of ROS 2",
            remedy="write letters, digits and _, not beginning with a digit; parts are separated by /",
        )
    return "/" + "/".join(parts)


def qualified(namespace: str, name: str) -> str:
    """Return a relative name within a namespace."""
    return f"{namespace.rstrip('/')}/{name}"


def gid_of(token: str) -> bytes:
    """Return 16 octets that no other publisher has. (Those of rmw_zenoh are another hash of the same token.)"""
    return hashlib.blake2b(token.encode(), digest_size=16).digest()
