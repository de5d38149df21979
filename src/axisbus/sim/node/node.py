"""A simulated node as a ``canopen.LocalNode``: its objects are the device's, its frames pass through the slave.

``LocalNode`` itself would answer SDO while stopped, start its own heartbeat thread, and support neither SYNC nor boot-up. Therefore
it subscribes to nothing here, and is only used for local access by ``node.sdo[...]`` and as a member of the network.
"""

from __future__ import annotations

from threading import RLock

import canopen
from canopen import objectdictionary as od
from canopen.sdo.exceptions import SdoAbortedError

from axisbus.cia301.datatypes import decode
from axisbus.eds.model import Eds, Object, Variable
from axisbus.errors import SdoAbort
from axisbus.sim.device import Device
from axisbus.sim.node.slave import Slave


class StandInNode(canopen.LocalNode):
    """One device on a ``canopen.Network``; ``lock`` protects the device against the thread that steps it."""

    def __init__(self, device: Device, lock: RLock) -> None:
        super().__init__(device.node_id, object_dictionary(device.eds, device.node_id))
        self.device = device
        self.slave = Slave(device)
        self._lock = lock

    def associate_network(self, network: canopen.Network) -> None:
        """Join the network without the subscriptions of LocalNode: the slave receives and answers."""
        self.network = network

    def remove_network(self) -> None:
        """Leave the network."""

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """Return an entry's bytes, with the present value of the drive.

        Raises:
            canopen.SdoAbortedError: it does not exist, or (``check_readable``) cannot be read.
        """
        dictionary = self.device.dictionary
        with self._lock:
            try:
                if check_readable:
                    return dictionary.upload(index, subindex)
                return dictionary.raw(index, subindex)
            except SdoAbort as abort:
                raise SdoAbortedError(abort.code) from None

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        """Write an entry; without ``check_writable`` like the drive's own firmware, also read-only ones.

        Raises:
            canopen.SdoAbortedError: it does not exist, or (``check_writable``) the value is rejected.
        """
        dictionary = self.device.dictionary
        with self._lock:
            try:
                if check_writable:
                    dictionary.download(index, subindex, bytes(data))
                    return
                dictionary.raw(index, subindex)  # raises if the entry does not exist
            except SdoAbort as abort:
                raise SdoAbortedError(abort.code) from None
            key = index << 8 | subindex
            dictionary.set(key, decode(bytes(data), dictionary.entries[key].data_type))


def object_dictionary(eds: Eds, node_id: int) -> od.ObjectDictionary:
    """Return the same objects as a ``canopen`` dictionary (names, types, access; the values are those of the device)."""
    dictionary = od.ObjectDictionary()  # type: ignore[no-untyped-call]
    dictionary.node_id = node_id
    for entry in eds:
        dictionary.add_object(_entry(entry))
    return dictionary


def _entry(entry: Object) -> od.ODVariable | od.ODRecord | od.ODArray:
    if not entry.is_record:
        return _variable(entry.subs[0])
    kind = od.ODArray if entry.object_type.name == "ARRAY" else od.ODRecord
    group = kind(entry.name, entry.index)
    for variable in entry.subs.values():
        group.add_member(_variable(variable))
    return group


def _variable(variable: Variable) -> od.ODVariable:
    made = od.ODVariable(variable.name, variable.index, variable.subindex)
    made.data_type = int(variable.data_type)
    made.access_type = variable.access
    made.pdo_mappable = variable.pdo_mapping
    return made
