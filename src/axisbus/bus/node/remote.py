"""A node as ``canopen.RemoteNode``, for users of that library: dictionary from axisbus's EDS, SDO through axisbus's client.

It subscribes to nothing. canopen's receivers would raise on a short emergency message and collect SDO answers without end.
"""

from __future__ import annotations

import io
import pickle
from functools import lru_cache

import canopen
from canopen.objectdictionary import ODVariable
from canopen.objectdictionary.eds import import_eds
from canopen.sdo.client import SdoClient as CanopenClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from axisbus.bus.node.node import CanopenNode
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301 import cob
from axisbus.eds import Eds, canopen_text
from axisbus.errors import SdoAbort, SdoError, StateError

_NODE_ID = "$NODEID"


class SharedSdo(CanopenClient):
    """canopen's SDO client with the transfers of axisbus's client, so that both may be used together and from any thread."""

    def __init__(self, client: SdoClient, dictionary: canopen.ObjectDictionary) -> None:
        node_id = client.node_id
        super().__init__(cob.SDO_RX + node_id, cob.SDO_TX + node_id, dictionary)  # type: ignore[no-untyped-call]
        self._client = client

    def upload(self, index: int, subindex: int) -> bytes:
        """Read an object's bytes; blocks. Raises canopen's exceptions."""
        try:
            return self._client.upload(index, subindex)
        except SdoAbort as error:
            raise SdoAbortedError(error.code) from error
        except SdoError as error:
            raise SdoCommunicationError(str(error)) from error

    def download(self, index: int, subindex: int, data: bytes, force_segment: bool = False) -> None:  # noqa: ARG002
        """Write an object's bytes; blocks. Raises canopen's exceptions; ``force_segment`` has no effect."""
        try:
            self._client.download(index, subindex, data)
        except SdoAbort as error:
            raise SdoAbortedError(error.code) from error
        except SdoError as error:
            raise SdoCommunicationError(str(error)) from error

    def open(self, *_: object, **__: object) -> io.RawIOBase:
        """Refuse to open a stream: canopen's streams would run in parallel to axisbus's client on the same COB-IDs.

        Raises:
            StateError: always.
        """
        raise StateError(
            f"node {self._client.node_id}: SDO streams are not supported here",
            remedy="use upload() and download(), which transfer segments too",
        )


def remote_node(node: CanopenNode) -> canopen.RemoteNode:
    """Return the node as an object of canopen; reading the EDS may take a second, once per file.

    Use it for objects by name (``remote.sdo["Profile velocity"].raw``) and NMT commands. It receives no PDO, EMCY or heartbeats:
    see ``CanopenNode`` for these.
    """
    dictionary = _empty() if node.eds is None else canopen_dictionary(node.eds, node.node_id)
    remote = canopen.RemoteNode(node.node_id, dictionary)
    remote.sdo = SharedSdo(node.sdo, dictionary)
    remote.sdo_channels = [remote.sdo]
    remote.nmt.network = node.channel.network
    return remote


def _empty() -> canopen.ObjectDictionary:
    return canopen.ObjectDictionary()  # type: ignore[no-untyped-call]


def canopen_dictionary(eds: Eds, node_id: int) -> canopen.ObjectDictionary:
    """Return a node's own dictionary: the file's, read once for all nodes of a type, with the node-ID added where it belongs."""
    dictionary: canopen.ObjectDictionary = pickle.loads(_imported(canopen_text(eds)))
    if dictionary.node_id is not None:  # from a DCF
        dictionary.node_id = node_id
    for entry in dictionary.values():
        for variable in (entry,) if isinstance(entry, ODVariable) else entry.subindices.values():
            _add_node_id(variable, node_id)
    return dictionary


def _add_node_id(variable: ODVariable, node_id: int) -> None:
    for attribute in ("default", "value"):
        number = getattr(variable, attribute)
        if isinstance(number, int) and _NODE_ID in getattr(variable, f"{attribute}_raw", ""):
            setattr(variable, attribute, number + node_id)


@lru_cache(maxsize=32)
def _imported(text: str) -> bytes:
    """Return canopen's reading of a text for node 0, pickled: a copy costs a tenth of reading it again."""
    return pickle.dumps(import_eds(io.StringIO(text), 0), pickle.HIGHEST_PROTOCOL)  # type: ignore[no-untyped-call]
