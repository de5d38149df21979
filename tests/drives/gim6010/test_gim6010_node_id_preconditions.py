"""The preconditions for another node ID or protocol of a module, judged by the nodes found on wires in virtual time."""

from __future__ import annotations

import pytest

from axisbus.drives.gim6010 import node_id_preconditions
from axisbus.drives.gim6010.discovery.finder import ProbeScope
from axisbus.drives.gim6010.discovery.results import findings
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import ArgumentError, StateError
from kit.module_search import search
from kit.sim.can_simple_module import gim_eds

EDS = gim_eds()


def surveyed(*modules, **more):
    found = search(*modules, ask=ProbeScope.ALL, **more)
    return found.finder, findings(found.finder)


def enabled(node):
    module = Module(node)
    module.on_frame(node << 5 | 7, (8).to_bytes(8, "little"), 0.0)
    return module


def test_one_module_that_is_idle_is_changed():
    finder, found = surveyed(Module(5))
    assert node_id_preconditions.require_one(finder, found, 5).node == 5


@pytest.mark.parametrize(
    ("modules", "words"),
    [
        ([], "no module"),
        ([Module(6)], "no module"),
        ([enabled(5)], "closed loop"),
        ([Module(5, heartbeat_rate_ms=0, encoder_rate_ms=0)], "no heartbeat"),
        ([Module(5), Module(5, heartbeat_rate_ms=90)], "several modules"),
        ([Module(5, eds=EDS, protocol=2)], "no module"),
    ],
    ids=["nobody", "another", "enabled", "silent", "two", "canopen"],
)
def test_anything_else_is_not(modules, words):
    finder, found = surveyed(*modules)
    with pytest.raises(StateError, match=words):
        node_id_preconditions.require_one(finder, found, 5)


def test_if_no_node_acknowledges_nothing_is_changed():
    finder, found = surveyed(Module(5))
    finder.unacknowledged = "no acknowledge"
    with pytest.raises(StateError, match="no node acknowledges"):
        node_id_preconditions.require_one(finder, found, 5)


def test_a_node_id_that_is_free_is_given():
    finder, found = surveyed(Module(5), Module(6))
    for new in (0, 7, 63):
        node_id_preconditions.require_free(finder, found, new)


@pytest.mark.parametrize("quiet", [{}, {"heartbeat_rate_ms": 0, "encoder_rate_ms": 0}])
def test_a_node_id_that_another_module_has_is_refused(quiet):
    finder, found = surveyed(Module(5), Module(6, **quiet))
    with pytest.raises(StateError, match="another module has the node ID 6"):
        node_id_preconditions.require_free(finder, found, 6)
    with pytest.raises(ArgumentError):
        node_id_preconditions.require_free(finder, found, 64)


def test_a_node_id_whose_identifiers_belong_to_another_node_is_refused():
    finder, found = surveyed(Module(16), strangers=lambda _: [(7 << 5 | 9, b"1")])
    with pytest.raises(StateError, match="identifiers of node ID 7 are in use"):
        node_id_preconditions.require_free(finder, found, 7)
    finder, found = surveyed(Module(16), Module(33, eds=EDS, protocol=2))
    with pytest.raises(StateError, match="cannot be on one bus"):
        node_id_preconditions.require_free(finder, found, 5)  # 0A1h is the EMCY of CANopen node 33
    node_id_preconditions.require_free(finder, found, 24)


def test_nodes_that_cannot_be_changed_to_canopen():
    _, found = surveyed(Module(0))
    with pytest.raises(StateError, match="set-id"):
        node_id_preconditions.require_canopen(found, 0)
    _, found = surveyed(Module(16), Module(33, eds=EDS, protocol=2))
    with pytest.raises(StateError, match="CANopen node 33 already"):
        node_id_preconditions.require_canopen(found, 33)
    _, found = surveyed(Module(5), Module(33))
    with pytest.raises(StateError, match="cannot be on one bus: node 5"):
        node_id_preconditions.require_canopen(found, 33)
    node_id_preconditions.require_canopen(surveyed(Module(33))[1], 33)
