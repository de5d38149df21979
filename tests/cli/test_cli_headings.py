"""The heading of a device in the outputs: a device that is no drive is nowhere headed as one."""

from __future__ import annotations

import itertools
import os
import re
from pathlib import Path

import pytest

from axisbus.eds import builtin, load
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from kit import command_line

_channels = (f"cli-heads-{os.getpid()}-{number}" for number in itertools.count())
KINDS = {0x0003_0191: "I/O module (CiA 401)", 0: "no standard profile"}
WRONG = re.compile("402|drive", re.IGNORECASE)


@pytest.fixture(params=KINDS, ids=["401", "none"])
def device(request, tmp_path):
    """A device that is no drive and has no name (1008h): the words for it, its EDS, its cell, and the options of its bus."""
    text = builtin.resolve(command_line.GENERIC, Path()).read_text(encoding="ascii")
    for section in (*(f"{index:04X}" for index in range(0x6000, 0x6800)), "1008"):
        text = re.sub(rf"\[{section}(?:sub[0-9A-F]+)?\]\n(?:(?!\[).*\n)*", "", text)
    text = re.sub(r"(\[1[6A]0\dsub0\]\n(?:(?!\[).*\n)*?DefaultValue=)\S+", r"\g<1>0", text)
    text = re.sub(r"(\[1000\]\n(?:.*\n)*?DefaultValue=)\S+", rf"\g<1>0x{request.param:08X}", text)
    text = re.sub(r"(?m)^(ProductName|Description)=.*$", r"\1=Box", text)
    path = tmp_path / "box.eds"
    path.write_text(text, encoding="ascii")
    channel = next(_channels)
    cell = tmp_path / "cell.toml"
    bus = f'interface = "virtual"\nchannel = "{channel}"\nscan_period = "10ms"\n'
    cell.write_text(f'[bus]\n{bus}[nodes.5]\neds = "box.eds"\n', encoding="ascii")
    with SimulatedNetwork(channel, [device_from_eds(load(path), 5)]):
        yield KINDS[request.param], path, cell, ("-i", "virtual", "-c", channel)


def headings(out: str) -> list[str]:
    """The lines that begin with a node, or with the title of a page."""
    return [
        line
        for line in out.splitlines()
        if re.match(r"node 5\b|   5  |# |  device |\| Device type|node 5:", line)
    ]


def test_on_the_bus_it_is_called_by_its_device_type(axisbus, device, tmp_path):
    kind, _, cell, bus = device
    for arguments in (
        ("scan", *bus),
        ("init", *bus, "-o", tmp_path / "new.toml", "--eds", tmp_path),
        ("boot", cell),
        ("config", "backup", "5", *bus, "--output", tmp_path / "box.dcf"),
    ):
        out = axisbus(*arguments).out
        heads = headings(out)
        assert heads, arguments
        assert kind in heads[0], (arguments, heads)
        assert not [line for line in heads if WRONG.search(line)], arguments
    assert f"# {kind}:" in (tmp_path / "new.toml").read_text("utf-8")


def test_a_device_is_named_by_the_device_type_of_its_file(axisbus, device, tmp_path):
    kind, path, _, _ = device
    code, out, _ = axisbus("eds", "show", path)
    assert (code, out.splitlines()[0].startswith("Box")) == (0, True)
    assert f"  device      {kind}" in out
    axisbus("eds", "doc", path, "-o", tmp_path / "box.md")
    page = (tmp_path / "box.md").read_text("utf-8")
    assert kind in page
    for text in (out, page):
        assert not [line for line in headings(text) if WRONG.search(line)]


def test_without_an_axis_homing_is_not_the_next_command(axisbus, device):
    out = axisbus("boot", device[2]).out
    assert "axisbus monitor" in out
    assert "axisbus home" not in out
