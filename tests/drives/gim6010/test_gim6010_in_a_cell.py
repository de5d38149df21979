"""The GIM6010-8 as a node of a cell: its make is found by its identity, and frames of a module with CAN Simple are told apart."""

from __future__ import annotations

from pathlib import Path

from axisbus import eds
from axisbus.cell import reader
from axisbus.cell.parameters import axis_parameters
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.master_detection import Sign, sign_of
from axisbus.core.files import load_dictionaries
from axisbus.core.master_detection import expected_masters_of
from axisbus.eds import builtin
from kit.cell import MODULE, cell_text


def test_the_make_by_the_identity_explains_faults() -> None:
    cell, _ = reader.loads(cell_text("x", eds=MODULE))
    assert cell is not None
    module = eds.load(builtin.resolve(MODULE, cell.folder))
    made = axis_parameters(cell, "x", module)
    assert (0x203F, 0) in made.fault_objects
    assert (0x203E, 0) in made.fault_objects
    assert any(
        "OVER_TEMP" in text.upper().replace(" ", "_")
        for text in made.explain_fault(0x4310, {(0x203F, 0): 0x40000})
    )


def test_frames_of_a_module_are_no_sign_of_a_master_and_commands_to_it_are(tmp_path: Path) -> None:
    """Node 48 of CAN Simple sends its heartbeat with 601h, where CANopen has the SDO requests to node 1."""
    more = """[nodes.48]
protocol = "can_simple"
[nodes.48.can_simple]
velocity_limit = 20.0
current_limit = 10.0
velocity_ramp = 40.0
acceleration = 80.0
"""
    beat, estimates = CanFrame(0.0, 0x601, bytes(8)), CanFrame(0.0, 0x609, bytes(8))
    target, state = CanFrame(0.0, 0x60C, bytes(8)), CanFrame(0.0, 0x607, bytes(8))
    without, _ = reader.loads(cell_text("xy"), str(tmp_path / "cell.toml"))
    assert sign_of(beat, expected_masters_of(without, load_dictionaries(without))) == (Sign.SDO, 1)
    with_it, _ = reader.loads(cell_text("xy", more=more), str(tmp_path / "cell.toml"))
    cast = expected_masters_of(with_it, load_dictionaries(with_it))
    assert sign_of(beat, cast) is None
    assert sign_of(estimates, cast) is None
    assert sign_of(target, cast) == (Sign.MODULE, 48)
    assert sign_of(state, cast) == (Sign.MODULE, 48)
    assert sign_of(CanFrame(0.0, 0x609, b"", remote=True), cast) is None  # a question commands nothing
