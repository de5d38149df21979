"""Files of faults for served drives, and access to their plant: valid files, refusals, and private attributes."""

from __future__ import annotations

import os
import socket
import stat
import struct
import threading
from contextlib import suppress

import pytest

from axisbus import SimulationControl
from axisbus.cell import reader
from axisbus.core.files import load_dictionaries
from axisbus.core.sim_faults_file import AXIS_KEYS, NODE_KEYS, PARTS, load_faults
from axisbus.core.sim_server import ControlSocket, FaultPlayer
from axisbus.core.simulated_nodes import SimulatedNode, devices
from axisbus.errors import AdapterError, ArgumentError, AxisbusError, ConfigError, StateError, UserError
from axisbus.sim.fault_injection import NEVER
from axisbus.sim.fault_plan import FaultSetting
from kit.cell import cell_text


@pytest.fixture
def cell(tmp_path):
    (tmp_path / "cell.toml").write_text(cell_text("xy"), encoding="utf-8")
    return reader.load(tmp_path / "cell.toml")


@pytest.fixture
def read(cell, tmp_path):
    def text(text: str):
        (tmp_path / "faults.toml").write_text(text, encoding="utf-8")
        return load_faults(tmp_path / "faults.toml", cell)

    return text


# -- the file --------------------------------------------------------------------------------------------------------------------


def test_a_fault_is_read_with_all_its_keys(read):
    (fault,) = read(
        '[a-b]\naxis = "y"\nwhen = "|x.velocity| > 10"\nafter = "20ms"\nevery = "2s"\nfor = "1.5s"\n'
        "fault = 0x2310\nmaker_bits = 4\nrestart = true\nblocked = true\n"
    )
    assert (fault.name, fault.node, fault.axis, fault.code, fault.maker_bits, fault.restart) == (
        "a-b", 2, 1, 0x2310, 4, True,
    )  # fmt: skip
    moment = fault.timing
    assert (moment.begin, moment.after, moment.every, moment.duration) == (None, 0.02, 2.0, 1.5)
    assert moment.when({"x": {"velocity": -11.0}})
    assert not moment.when({"x": {"velocity": 9.0}})
    assert fault.description == "axis = y, fault = 2310h, maker_bits = 4, restart = true, blocked = true"


DIALS = """
[all]
axis = "x"
begin = "0ms"
transition_delay = { 4 = "2s", 2 = "never" }
ignore_halt = true
modes_refused = [1, 3]
mode_delay = "300ms"
acknowledge_delay = "never"
drift_velocity = 20.5
spontaneous_mode = -1
encoder_jump = -500
sdo_lost = [3, 4]
sdo_aborts = { "6060:00" = 0x08000022, "607A" = 1 }
tpdos_stop = [1]
lss = { loss = 0.5, refused_rates = [125000] }
program = { control_refused = { 1 = 0x06090030 } }
"""


def test_every_kind_of_dial_is_read(read):
    (fault,) = read(DIALS)
    assert {setting.name: setting.value for setting in fault.settings} == {
        "transition_delay": {4: 2.0, 2: NEVER},
        "ignore_halt": True,
        "modes_refused": frozenset({1, 3}),
        "mode_delay": 0.3,
        "acknowledge_delay": NEVER,
        "drift_velocity": 20.5,
        "spontaneous_mode": -1,
        "encoder_jump": -500,
        "sdo_lost": {3, 4},
        "sdo_aborts": {(0x6060, 0): 0x08000022, (0x607A, 0): 1},
        "tpdos_stop": frozenset({1}),
        "loss": 0.5,
        "refused_rates": frozenset({125000}),
        "control_refused": {1: 0x06090030},
    }
    assert FaultSetting("ignore_halt", True, True) in fault.settings
    assert FaultSetting("loss", 0.5, False, "lss") in fault.settings


def test_another_specimen_is_read_with_its_identity(read):
    (fault,) = read(
        '[new]\nnode = 2\nbegin = "1s"\nswap = { serial = 4712, node_id = 255, revision = 2, software_version = "2.0" }\n'
    )
    assert fault.swap == {"serial": 4712, "node_id": 255, "revision": 2, "software_version": "2.0"}
    assert fault.settings == ()


def test_every_dial_that_there_is_can_be_turned(cell):
    made = devices(cell, load_dictionaries(cell))[1]
    for keys, dials in (
        (AXIS_KEYS, made.drive.dials),
        (NODE_KEYS, made.dials),
        (PARTS["lss"], made.dials.lss),
    ):
        there = {name for name in type(dials).__dataclass_fields__ if name not in PARTS}
        assert set(keys) == there


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ('[a]\nbegin = "1s"\nblocked = true\n', 1, "needs an axis or a node"),
        ('[a]\naxis = "x"\nnode = 1\nbegin = "1s"\nblocked = true\n', 1, "needs an axis or a node"),
        ('[a]\naxis = "w"\nbegin = "1s"\nblocked = true\n', 2, "no axis 'w'"),
        ('[a]\nnode = 9\nbegin = "1s"\ndead = true\n', 2, "no node 9"),
        ('[a]\nnode = 1\nbegin = "1s"\nblocked = true\n', 4, "'blocked' is a key of an axis"),
        ('[a]\nnode = 1\nbegin = "1s"\nfault = 0x2310\n', 4, "'fault' is a key of an axis"),
        ('[a]\naxis = "x"\nblocked = true\n', 1, "needs either 'begin' or 'when'"),
        ('[a]\naxis = "x"\nbegin = "1s"\nwhen = "x.mode = 1"\ndead = true\n', 1, "either 'begin' or 'when'"),
        ('[a]\naxis = "x"\nbegin = "1s"\n', 1, "does not say which fault occurs"),
        ('[a]\naxis = "x"\nbegin = 1\ndead = true\n', 3, "begin in .a. cannot be used"),
        ('[a]\naxis = "x"\nbegin = "1s"\nafter = "1s"\ndead = true\n', 4, "'after' requires 'when'"),
        ('[a]\naxis = "x"\nbegin = "1s"\nfor = "1s"\nfault = 1\n', 4, "have no duration"),
        ('[a]\naxis = "x"\nbegin = "1s"\nfor = "1s"\nevery = "1s"\ndead = true\n', 5, "before it has ended"),
        ('[a]\naxis = "x"\nwhen = "x.speed > 1"\ndead = true\n', 3, "no value 'speed'"),
        ('[a]\naxis = "x"\nwhen = "soon"\ndead = true\n', 3, "is not a condition"),
        ('[a]\naxis = "x"\nbegin = "1s"\nblockd = true\n', 4, "unknown key 'blockd'"),
        ('[a]\naxis = "x"\nbegin = "1s"\nlss = { los = 1 }\n', 4, "unknown key 'los'"),
        ('[a]\naxis = "x"\nbegin = "1s"\nsdo_aborts = { zz = 1 }\n', 4, "sdo_aborts in .a. cannot be used"),
        ('[a]\naxis = "x"\nbegin = "1s"\nsdo_delay = "soon"\n', 4, "sdo_delay in .a. cannot be used"),
        ('[a]\naxis = "x"\nbegin = "1s"\nswap = { node_id = 5 }\n', 4, "swap needs a serial number"),
        ('[a]\nnode = 1\nbegin = "1s"\nswap = { serial = 1, node_id = 128 }\n', 4, "128 is not a node-ID"),
        ('[a]\nnode = 1\nbegin = "1s"\nfor = "1s"\nswap = { serial = 1 }\n', 4, "have no duration"),
        ("a = 1\n", 1, "a must be a table"),
        ("[a\n", 1, "TOML|table|bracket"),
    ],
)
def test_an_invalid_fault_is_reported_with_its_line(read, text, line, says):
    with pytest.raises(ConfigError, match=says) as told:
        read(text)
    assert told.value.line == line


def test_the_conditions_look_at_the_drives_in_the_units_of_their_axes(cell, read):
    dictionaries = load_dictionaries(cell)
    made = devices(cell, dictionaries)
    faults = read('[a]\naxis = "y"\nwhen = "x.position > 45"\nblocked = true\n')
    player = FaultPlayer(faults, cell, dictionaries, made, threading.Lock())
    scale = float(cell.axes["x"].scale)
    for degrees in (0.0, 44.9):
        made[1].drive.position = round(degrees * scale)
        assert player.step(0.0) == []
    made[1].drive.position = round(45.1 * scale)
    assert player.step(0.1) == ["a: axis = y, blocked = true"]
    assert made[2].drive.dials.blocked


# -- the control -----------------------------------------------------------------------------------------------------------------


@pytest.fixture
def served(cell, tmp_path):
    lock = threading.RLock()
    made = devices(cell, load_dictionaries(cell))
    door = ControlSocket(
        tmp_path / "control", {node: SimulatedNode(device, lock) for node, device in made.items()}
    )
    yield tmp_path / "control", made
    door.close()
    assert not (tmp_path / "control").exists()


def test_the_plant_is_seen_and_turned_by_several_at_once(served):
    path, made = served
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with SimulationControl(path) as one, SimulationControl(path) as other:
        assert one.nodes == (1, 2)
        one.simulated_node(2).drive().dials.blocked = True
        assert other.simulated_node(2).drive().dials.blocked is True
        assert made[2].drive.dials.blocked
        other.simulated_node(1).fault(0x7500)
        assert one.simulated_node(1).drive().error_code == 0x7500
        with pytest.raises(StateError, match="no simulated node 3"):
            one.simulated_node(3)
    one.close()
    with pytest.raises(AxisbusError):
        one.simulated_node(2).drive()


def test_another_specimen_is_put_in_by_arguments_with_names(served):
    path, made = served
    with SimulationControl(path) as plant:
        plant.simulated_node(2).swap(4712, node_id=255, revision=3)
        with pytest.raises(ArgumentError, match="200 is not a node-ID"):
            plant.simulated_node(2).swap(4712, node_id=200)
    assert (made[2].node_id, made[2].read(0x1018, 3), made[2].read(0x1018, 4)) == (255, 3, 4712)


def test_private_attributes_are_refused(served):
    path, _ = served
    with SimulationControl(path) as plant:
        with pytest.raises(AttributeError):
            plant.simulated_node(1).drive()._reset_state()
        with pytest.raises(StateError, match="private"):
            plant.simulated_node(1)._access("__class__", None)  # as a client of one's own might ask


def test_invalid_requests_end_their_own_connection_only(served):
    path, _ = served
    with SimulationControl(path) as plant:
        for sent in (
            b"GET / HTTP/1.1\r\n\r\n",
            struct.pack("<I", 1 << 27),
            struct.pack("<I", 5) + b"hello",
            b"\x01",
        ):
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as mad:
                mad.connect(str(path))
                mad.sendall(sent)
                mad.shutdown(socket.SHUT_WR)
                mad.settimeout(5.0)
                with suppress(ConnectionResetError):
                    assert mad.recv(100) == b""
        assert plant.simulated_node(1).drive().error_code == 0


def test_a_socket_that_was_left_is_replaced_and_nothing_else(cell, tmp_path):
    left = tmp_path / "left"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as gone:
        gone.bind(str(left))
    door = ControlSocket(left, {})
    with pytest.raises(UserError, match="cannot be made"):
        ControlSocket(left, {})
    with SimulationControl(left) as plant:
        assert plant.nodes == ()
    door.close()
    (tmp_path / "file").write_text("mine")
    with pytest.raises(UserError, match="is not a socket"):
        ControlSocket(tmp_path / "file", {})
    assert (tmp_path / "file").read_text() == "mine"
    for path in (tmp_path / "none" / "c", tmp_path / ("n" * 120)):
        with pytest.raises(UserError, match="cannot be made"):
            ControlSocket(path, {})
    with pytest.raises(AdapterError, match="no simulated drives"):
        SimulationControl(tmp_path / "nobody")
    assert os.umask(0o022) == 0o022
