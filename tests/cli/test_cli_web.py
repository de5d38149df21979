"""``axisbus web``: refusals before a bus is opened."""

from __future__ import annotations

import importlib.util
import socket
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from axisbus.cli import web
from axisbus.web.access.tokens import Role
from kit import command_line

pytest.importorskip("nicegui", reason="the page needs nicegui")


@pytest.fixture
def axisbus(monkeypatch, capsys) -> command_line.Run:
    monkeypatch.setattr(web, "machine_of", lambda *_, **__: pytest.fail("the machine was opened"))
    return command_line.runner(monkeypatch, capsys)


def test_without_nicegui_the_error_names_the_package_to_install(axisbus, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    code, _, err = axisbus("web", command_line.CELL)
    assert code == 1
    assert 'pip install "axisbus[web]"' in err


@pytest.mark.parametrize("address", ["192.0.2.1", "192.0.2.77"])
def test_an_address_other_than_localhost_needs_tls_or_an_explicit_insecure(axisbus, address):
    code, _, err = axisbus("web", command_line.CELL, "--listen", address)
    assert code == 2
    assert "--certificate and --key" in err
    assert "--insecure" in err


@pytest.mark.parametrize("address", ["0.0.0.0", "::"])
@pytest.mark.parametrize("more", [(), ("--insecure",)])
def test_listening_at_every_address_is_refused(axisbus, address, more):
    code, _, err = axisbus("web", command_line.CELL, "--listen", address, *more)
    assert code == 2
    assert "every address" in err


@pytest.mark.parametrize("option", ["--certificate", "--key"])
def test_a_certificate_without_its_key_is_refused_and_a_key_without_its_certificate(
    axisbus, option, tmp_path
):
    (tmp_path / "file").write_text("x", "utf-8")
    code, _, err = axisbus("web", command_line.CELL, option, tmp_path / "file")
    assert code == 2
    assert "go together" in err


def test_an_invalid_certificate_is_refused_before_the_machine_is_opened(axisbus, tmp_path):
    (tmp_path / "file").write_text("x", "utf-8")
    code, _, err = axisbus(
        "web", command_line.CELL, "--certificate", tmp_path / "file", "--key", tmp_path / "file"
    )
    assert code == 1
    assert str(tmp_path / "file") in err


def test_a_port_in_use_is_reported_before_the_machine_is_opened(axisbus):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, _, err = axisbus("web", command_line.CELL, "--port", port)
    assert code == 1
    assert f"127.0.0.1:{port} cannot be used" in err
    assert "--port" in err


def test_an_invalid_cell_file_is_reported_first(axisbus, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text("[bus]\n", "utf-8")
    code, _, err = axisbus("web", path)
    assert code == 1
    assert "interface" in err


@pytest.mark.parametrize(("options", "role"), [((), Role.OPERATOR), (("--look",), Role.OBSERVER)])
def test_with_look_every_page_is_one_of_an_observer(monkeypatch, options, role):
    """Also if no machine runs, so that this command opens one."""
    given = []

    class Fake:
        def __init__(self, *_args, **_more) -> None:
            pass

        def begin(self) -> None: ...

        def end(self) -> None: ...

        def link(self, role) -> str:
            given.append(role)
            raise LookupError("enough")

    monkeypatch.setattr("axisbus.web.server.PageServer", Fake)
    monkeypatch.setattr("axisbus.cli.web.machine_of", lambda *_args, **_more: nullcontext())
    monkeypatch.setattr("axisbus.cli.web.MachineStatus", lambda _: SimpleNamespace(lines=[]))
    with pytest.raises(LookupError, match="enough"):
        web.command.main([str(command_line.CELL), "--port", "0", *options], standalone_mode=False)
    assert given == [role]
