"""Additional SDO channels of a node (1201h to 127Fh as server, 1280h to 12FFh as client): read, configure, and use them."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType
from axisbus.errors import ArgumentError, SdoError, StateError

SERVERS = range(1, 128)  # 1200h + number; 0 is the predefined channel
CLIENTS = range(128)  # 1280h + number
_REQUEST, _ANSWER, _PARTNER = 1, 2, 3  # sub-indices of both records (CiA 301 7.5.2.33 and 34)


@dataclass(frozen=True, slots=True)
class SdoChannel:
    """One SDO parameter record: ``request_id`` from client to server, ``answer_id`` back.

    ``partner`` is the node-ID of the other end, None if the node does not store it. A channel exists only if ``valid``.
    """

    request_id: int
    answer_id: int
    partner: int | None = None
    valid: bool = True


def read_server(sdo: SdoClient, number: int) -> SdoChannel:
    """Read the server channel ``number`` (1 to 127, that is 1200h + number) of a node; blocks for three transfers.

    Raises:
        ArgumentError: no such number.
        SdoAbort: the node has no such channel.
        others as ``SdoClient.upload``.
    """
    return _read(sdo, _index(o.SDO_SERVER, number, SERVERS))


def read_client(sdo: SdoClient, number: int) -> SdoChannel:
    """Read the client channel ``number`` (0 to 127, that is 1280h + number), by which a node accesses others.

    As ``read_server``.
    """
    return _read(sdo, _index(o.SDO_CLIENT, number, CLIENTS))


def set_server(sdo: SdoClient, number: int, channel: SdoChannel) -> SdoChannel:
    """Configure a server channel, read it back and return it; blocks for about seven transfers.

    Both identifiers are made invalid before they change, as CiA 301 7.5.2.33 requires.

    Raises:
        ArgumentError: no such number, or invalid identifiers.
        SdoError: the values read back are different.
        others as ``SdoClient.upload``.
    """
    return _write(sdo, _index(o.SDO_SERVER, number, SERVERS), channel)


def set_client(sdo: SdoClient, number: int, channel: SdoChannel) -> SdoChannel:
    """Configure a client channel (see ``set_server``)."""
    return _write(sdo, _index(o.SDO_CLIENT, number, CLIENTS), channel)


def open_channel(sdo: SdoClient, number: int) -> SdoClient:
    """Return a client of the same node over its additional channel ``number``; blocks as ``read_server``.

    Both clients may be used at once, each from its own threads. The caller closes the returned client.

    Raises:
        StateError: the channel is not valid; ``set_server`` makes it valid.
        others as ``read_server``.
    """
    channel = read_server(sdo, number)
    if not channel.valid:
        raise StateError(
            f"node {sdo.node_id}: its SDO channel {o.SDO_SERVER + number:04X}h is not in use",
            observed=f"identifiers {channel.request_id:03X}h and {channel.answer_id:03X}h, marked invalid or 0",
            remedy="give it a pair of free identifiers first (set_server)",
        )
    return sdo.beside((channel.request_id, channel.answer_id))


def _index(base: int, number: int, allowed: range) -> int:
    if number not in allowed:
        raise ArgumentError(
            f"{number} is not an SDO channel", remedy=f"they are counted from {allowed[0]} to {allowed[-1]}"
        )
    return base + number


def _read(sdo: SdoClient, index: int) -> SdoChannel:
    request, answer = (_number(sdo, index, sub) for sub in (_REQUEST, _ANSWER))
    valid = not (request | answer) & cob.INVALID and bool(
        request & cob.ID_MASK_11 and answer & cob.ID_MASK_11
    )
    return SdoChannel(request & cob.ID_MASK_11, answer & cob.ID_MASK_11, _partner(sdo, index), valid)


def _number(sdo: SdoClient, index: int, subindex: int) -> int:
    return int.from_bytes(sdo.upload(index, subindex)[:4], "little")


def _partner(sdo: SdoClient, index: int) -> int | None:
    return _number(sdo, index, _PARTNER) if _has_partner(sdo, index) else None


def _has_partner(sdo: SdoClient, index: int) -> bool:
    return _number(sdo, index, 0) & 0xFF >= _PARTNER


def _write(sdo: SdoClient, index: int, channel: SdoChannel) -> SdoChannel:
    for identifier in (channel.request_id, channel.answer_id):
        if not 0 < identifier <= cob.ID_MASK_11 or channel.request_id == channel.answer_id:
            raise ArgumentError(
                f"{identifier:X}h cannot be an identifier of an SDO channel",
                observed=f"the pair is {channel.request_id:X}h and {channel.answer_id:X}h",
                remedy="give two different identifiers of 1h to 7FFh that no other device uses",
            )
    pair = ((_REQUEST, channel.request_id), (_ANSWER, channel.answer_id))
    for subindex, identifier in pair:
        _put(sdo, index, subindex, identifier | cob.INVALID)
    if channel.partner is not None and _has_partner(sdo, index):
        sdo.write(index, _PARTNER, channel.partner, data_type=DataType.UNSIGNED8)
    if channel.valid:
        for subindex, identifier in pair:
            _put(sdo, index, subindex, identifier)
    return _checked(sdo, index, channel)


def _put(sdo: SdoClient, index: int, subindex: int, value: int) -> None:
    sdo.download(index, subindex, value.to_bytes(4, "little"))


def _checked(sdo: SdoClient, index: int, wanted: SdoChannel) -> SdoChannel:
    got = _read(sdo, index)
    same = (got.request_id, got.answer_id, got.valid) == (wanted.request_id, wanted.answer_id, wanted.valid)
    if same:
        return got
    raise SdoError(
        f"node {sdo.node_id}: the SDO channel {index:04X}h reads back something else",
        node=sdo.node_id,
        index=index,
        subindex=_REQUEST,
        observed=f"wanted {wanted}, got {got}",
        remedy="see the drive's manual for which of its SDO channels may be changed",
    )
