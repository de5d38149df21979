"""The configurations of examples/zenoh as they are copied: a right, a wrong and an expired certificate, and the rights of each."""

from __future__ import annotations

import shutil
import subprocess
import time
from pathlib import Path

import pytest

pytest.importorskip("zenoh", reason="a Zenoh network needs eclipse-zenoh")

from axisbus.fleet import messages as m
from axisbus.fleet.network import ZenohNetwork, connected, opened
from axisbus.machine.machine import Machine
from kit.scenarios.core_process import OWN_PROCESS, own_cell, turns
from kit.zenoh_cell import KEYS, BridgeProcess, Client, free_port, holder, until

EXAMPLES = Path(__file__).parents[2] / "examples" / "zenoh"
pytestmark = [
    OWN_PROCESS,
    pytest.mark.skipif(shutil.which("openssl") is None, reason="the certificates are made by openssl"),
    pytest.mark.timeout(120),
]


def certificates(folder, *names, days=365):
    """Make certificates as the example does."""
    command = ["sh", str(EXAMPLES / "certificates.sh"), str(folder), *names]
    subprocess.run(command, check=True, capture_output=True, env={"DAYS": str(days), "PATH": "/usr/bin:/bin"})


class Place:
    """A cell that listens with TLS, by the example's configuration; and those of its clients."""

    def __init__(self, folder):
        self.folder = folder
        self.port = free_port()
        certificates(folder / "ours", "cell-one=127.0.0.1", "operator-anna", "viewer-hall", "somebody")
        certificates(folder / "ours", "operator-ben", days=-1)
        certificates(folder / "theirs", "operator-anna")

    def cell(self):
        """Return the cell's configuration."""
        text = (EXAMPLES / "cell.json5").read_text("utf-8")
        text = text.replace("tls/0.0.0.0:7447", f"tls/127.0.0.1:{self.port}")
        return self._written("cell", text.replace("/etc/axisbus", str(self.folder / "ours")))

    def client(self, name, folder="ours", change=str):
        """Return the configuration of a client."""
        text = (EXAMPLES / "client.json5").read_text("utf-8")
        text = text.replace("tls/cell-one.example:7447", f"tls/127.0.0.1:{self.port}")
        text = text.replace(', "tls/cell-two.example:7447"', "").replace("operator-anna", name)
        text = text.replace("/etc/axisbus/ca.pem", str(self.folder / "ours" / "ca.pem"))
        return self._written(
            f"{folder}-{name}", change(text.replace("/etc/axisbus", str(self.folder / folder)))
        )

    def _written(self, name, text):
        path = self.folder / f"{name}.json5"
        path.write_text(text, "utf-8")
        return path


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return Place(tmp_path_factory.mktemp("tls"))


@pytest.fixture(scope="module")
def machine(place):
    file = own_cell(place.folder)
    with (
        Machine.open(file, shared=True) as machine,
        BridgeProcess(file, "--config", str(place.cell())) as bridge,
    ):
        bridge.await_line("joined")
        yield machine


def test_an_operator_commands_and_a_viewer_looks_on(place, machine):
    with (
        holder(str(place.client("operator-anna"))),
        Client("", "Hall", place.client("viewer-hall")) as viewer,
    ):
        until(viewer.alive)
        assert viewer.ask(KEYS.info, None, m.CellInfo).cell == "one"
        assert viewer.ask(KEYS.state("x"), None, m.AxisStateMessage).state == "ContinuousMotion"
        heard = []
        viewer.session.declare_subscriber(KEYS.state("x"), heard.append)
        viewer.session.declare_subscriber(KEYS.events, heard.append)
        events = viewer.ask(KEYS.events, m.EventsAsk(), m.EventsAnswer).events
        assert "Holder has the lease" in [event.text for event in events]
        until(lambda: len(heard) > 10)
        for key in (
            KEYS.lease,
            KEYS.command("halt"),
            KEYS.command("quick_stop_all"),
            KEYS.object(1, 0x1000, 0),
        ):
            assert viewer.ask(key, m.LeaseAsk("look", "hall"), timeout=0.3) is None
        assert turns(machine) == pytest.approx(30.0, abs=1.0)
    until(lambda: abs(turns(machine)) < 0.1)


@pytest.mark.parametrize(
    ("name", "folder", "change"),
    [
        ("operator-anna", "theirs", str),
        ("operator-ben", "ours", str),
        (
            "none",
            "ours",
            lambda text: "".join(line for line in text.splitlines(True) if "connect_" not in line),
        ),
    ],
    ids=["of another authority", "expired", "without any"],
)
def test_a_wrong_certificate_is_rejected(place, machine, name, folder, change):
    session = opened(ZenohNetwork(config=place.client(name, folder, change)))
    try:
        time.sleep(0.6)
        found = session.liveliness().get(KEYS.alive, timeout=0.5)
        assert not [reply for reply in found if reply.ok is not None]
        assert not list(session.get(KEYS.info, timeout=0.5))
        assert not connected(session, 0.1)
    finally:
        session.close()


def test_a_certificate_that_no_rule_names_may_do_nothing(place, machine):
    with Client("", "Somebody", place.client("somebody")) as nobody:
        assert connected(nobody.session, 5.0)
        time.sleep(0.3)
        assert not nobody.alive()
        assert nobody.ask(KEYS.info, timeout=0.5) is None
        assert nobody.ask(KEYS.command("halt"), timeout=0.5) is None


def test_an_unencrypted_connection_is_rejected(place, machine):
    session = opened(ZenohNetwork((f"tcp/127.0.0.1:{place.port}",)))
    try:
        assert not connected(session, 1.0)
    finally:
        session.close()
