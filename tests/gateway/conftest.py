"""The machine of most tests of this folder: two simulated axes in virtual time; and the OPC UA server of several files."""

from __future__ import annotations

import pytest

from axisbus.machine.machine import Machine
from kit.cell import cell_file


@pytest.fixture
def machine(tmp_path):
    file = cell_file(tmp_path, "xy")
    with Machine.simulated(file) as opened:
        yield opened


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("opcua")


@pytest.fixture(scope="module")
def file(folder):
    return cell_file(folder, "xy")


@pytest.fixture(scope="module")
def known(folder):
    """The users of the OPC UA server."""
    from axisbus.gateway.opcua import users  # needs asyncua, as do the other imports in functions

    (folder / "users").write_text(users.line_of("anna", "right"), "utf-8")
    return users.read(folder / "users")


@pytest.fixture(scope="module")
def server(file, known):
    """An OPC UA server on loopback, without certificates."""
    from axisbus.gateway.opcua.server_options import Given, ServerOptions, decide
    from kit.opcua.server import served

    with served(file, ServerOptions(decide(Given(True, users=True)), users=known)) as found:
        yield found
