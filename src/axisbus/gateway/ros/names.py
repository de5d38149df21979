"""Names of ROS 2 in the form of rmw_zenoh: keys of topics, and the liveliness tokens of nodes and their topics.

Published in the design document of rmw_zenoh: "Topic and Service name mapping to Zenoh key expressions" and "Graph Cache".
"""

from __future__ import annotations

import hashlib
import re
from typing import NamedTuple

from axisbus.errors import ArgumentError

_ADMIN = "@ros2_lv"
_NODE, PUBLISHER, SUBSCRIPTION = "NN", "MP", "MS"
_ENCLAVE = "%"  # no enclave
_PART = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
LAST_ONE = "::,1:,:,:,,"  # reliable, volatile, keep last 1: defaults are left out


class Topic(NamedTuple):
    """A topic by its fully qualified name, with its type (``sensor_msgs/msg/JointState``) and the hash of that (RIHS01)."""

    name: str
    type_name: str
    type_hash: str

    @property
    def dds_type(self) -> str:
        """Its type in the notation of DDS."""
        package, kind, name = self.type_name.split("/")
        return f"{package}::{kind}::dds_::{name}_"

    def key(self, domain: int) -> str:
        """Return the key of its messages."""
        return f"{domain}/{self.name.strip('/')}/{self.dds_type}/{self.type_hash}"


class RosNode(NamedTuple):
    """A node in a session: ``zid`` is the ID of the session, ``number`` that of the node; its topics take the next numbers."""

    domain: int
    zid: str
    number: int
    namespace: str
    name: str

    @property
    def token(self) -> str:
        """The liveliness token of the node."""
        return f"{self._begin(self.number, _NODE)}/{mangled(self.namespace)}/{self.name}"

    def token_of(self, kind: str, number: int, topic: Topic, qos: str = LAST_ONE) -> str:
        """Return the liveliness token of one of its publishers or subscriptions (``kind``)."""
        whose = f"{self._begin(number, kind)}/{mangled(self.namespace)}/{self.name}"
        return f"{whose}/{mangled(topic.name)}/{topic.dds_type}/{topic.type_hash}/{qos}"

    def _begin(self, number: int, kind: str) -> str:
        return f"{_ADMIN}/{self.domain}/{self.zid}/{self.number}/{number}/{kind}/{_ENCLAVE}"


def mangled(name: str) -> str:
    """Return a name as part of a key."""
    return name.replace("/", "%")


def namespace_of(text: str) -> str:
    """Return a namespace in the form of ROS 2: ``/``, or ``/`` before each of its parts.

    Raises:
        ArgumentError: the text is not a valid namespace.
    """
    parts = [part for part in text.strip("/").split("/") if part]
    wrong = [part for part in parts if not _PART.fullmatch(part)]
    if wrong or "//" in text:
        raise ArgumentError(
            f"{text!r} is not a namespace of ROS 2",
            remedy="write letters, digits and _, not beginning with a digit; parts are separated by /",
        )
    return "/" + "/".join(parts)


def qualified(namespace: str, name: str) -> str:
    """Return a relative name within a namespace."""
    return f"{namespace.rstrip('/')}/{name}"


def gid_of(token: str) -> bytes:
    """Return 16 octets that are unique to a publisher. (rmw_zenoh uses another hash of the same token.)"""
    return hashlib.blake2b(token.encode(), digest_size=16).digest()
