"""Where the page is served: the names that a browser may use there, and its address."""

from __future__ import annotations

import socket

import pytest

from axisbus.errors import ArgumentError, StateError
from axisbus.web.address import PageAddress, is_loopback, opened, resolved


def test_a_port_that_is_free_is_found_and_loopback_has_its_names():
    listening, place = opened("127.0.0.1", 0, tls=False)
    with listening:
        port = listening.getsockname()[1]
        assert listening.getsockname()[0] == "127.0.0.1"
    assert place.url == f"http://127.0.0.1:{port}"
    assert place.served_origin.hosts == {f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]")}
    assert place.served_origin.origins == {f"http://{host}" for host in place.served_origin.hosts}
    assert place.cookie == f"axisbus_{port}"


@pytest.mark.parametrize(
    ("tls", "port", "left_out"), [(True, 443, True), (False, 80, True), (True, 80, False)]
)
def test_a_browser_leaves_the_usual_port_out(tls, port, left_out):
    door = PageAddress("192.0.2.1", port, ("192.0.2.1",), tls).served_origin
    assert ("192.0.2.1" in door.hosts) == left_out
    assert f"192.0.2.1:{port}" in door.hosts
    assert door.scheme == ("https" if tls else "http")


@pytest.mark.parametrize("address", ["127.0.0.1", "localhost", "127.1", "::1"])
def test_loopback_addresses_are_recognised(address):
    assert is_loopback(resolved(address))


def test_an_external_address_is_no_loopback():
    assert not is_loopback(resolved("192.0.2.1"))


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "0", "", "0x0"])
def test_an_address_that_means_all_addresses_is_refused_in_any_notation(address):
    with pytest.raises(ArgumentError, match="every address"):
        opened(address, 0, tls=False)


def test_an_address_that_cannot_be_used_is_reported():
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(StateError, match="cannot be used"),
    ):
        opened("127.0.0.1", taken.getsockname()[1], tls=False)
    with pytest.raises(StateError, match="cannot be used"):
        opened("192.0.2.1", 0, tls=False)
