"""A simulated cell in the graph of ROS 2: its joint states, trajectories that it follows, and all that moves nothing."""

from __future__ import annotations

import itertools
import math
import random
import signal
import time
from pathlib import Path

import pytest

pytest.importorskip("zenoh", reason="a Zenoh network needs eclipse-zenoh")
pytest.importorskip("rosbags", reason="ROS 2 needs rosbags")

from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.cdr import joint_trajectory
from kit.cell import SCALE
from kit.ros import STATES, TRAJECTORIES, Ros, router
from kit.scenarios.core_process import OWN_PROCESS, enabled, own_cell, turns
from kit.zenoh_cell import BridgeProcess, Client, until

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
CONFIG = Path(__file__).parents[2] / "examples" / "zenoh" / "ros.json5"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return own_cell(tmp_path_factory.mktemp("ros"), axis="rated_torque = 5.0")


@pytest.fixture(scope="module")
def machine(file):
    with Machine.open(file, shared=True) as opened:
        yield opened


@pytest.fixture(scope="module")
def endpoint():
    with router() as endpoint:
        yield endpoint


@pytest.fixture(scope="module")
def config(endpoint, tmp_path_factory):
    """The configuration to copy, with the address of the router."""
    text = CONFIG.read_text("utf-8")
    assert "tcp/127.0.0.1:7447" in text
    own = tmp_path_factory.mktemp("config") / "ros.json5"
    own.write_text(text.replace("tcp/127.0.0.1:7447", endpoint), "utf-8")
    return str(own)


@pytest.fixture(scope="module")
def bridge(file, config, machine):
    with BridgeProcess(file, "--config", config, "--ros", "--ros-command") as process:
        process.await_line("joined")
        yield process


@pytest.fixture(scope="module")
def graph(bridge, endpoint):
    with Ros(endpoint) as ros:
        until(lambda: ros.heard)
        yield ros


@pytest.fixture
def ros(graph, file, machine):
    """A node of the graph, while both axes are enabled and at standstill, and no program has control."""
    graph.send(())
    until(lambda: stands(machine) and not commander(machine))
    with Machine.attach(file, command=True) as guest:
        for axis in guest:
            enabled(axis)
    return graph


def stands(machine):
    return all(abs(turns(machine, node)) < 0.1 for node in (1, 2))


def commander(machine):
    return [one.who for one in machine.programs if one.commands]


def place(machine, node=1):
    """Where the plant is, in degrees."""
    return machine.simulated_node(node).drive().axis.motor.position / SCALE


def moves_nothing(machine, seconds=0.5):
    before = [place(machine, node) for node in (1, 2)]
    time.sleep(seconds)
    return [place(machine, node) for node in (1, 2)] == pytest.approx(before, abs=0.05)


def rad(*degrees):
    return [math.radians(each) for each in degrees]


def test_a_broadcaster_and_a_controller_are_seen_in_the_graph(graph):
    tokens = graph.tokens()
    zid = tokens[0].split("/")[2]
    assert tokens == [
        f"@ros2_lv/0/{zid}/0/0/NN/%/%/joint_state_broadcaster",
        f"@ros2_lv/0/{zid}/0/1/MP/%/%/joint_state_broadcaster/%{STATES}/::,1:,:,:,,",
        f"@ros2_lv/0/{zid}/2/2/NN/%/%/joint_trajectory_controller",
        f"@ros2_lv/0/{zid}/2/3/MS/%/%/joint_trajectory_controller/"
        f"{TRAJECTORIES.replace('/', '%', 1).replace('joint_trajectory_controller', '%joint_trajectory_controller', 1)}"
        "/::,1:,:,:,,",
    ]


def test_joint_states_are_those_of_the_plant_each_image_once(ros, machine):
    del ros.heard[:]
    time.sleep(1.0)
    heard = list(ros.heard)
    assert 20 < len(heard) <= 52  # a cycle of 20 ms
    states, attached, _ = zip(*heard, strict=True)
    assert [each.names for each in states] == [["x", "y"]] * len(states)
    numbers = [each[0] for each in attached]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    stamps = [each.sec + each.nanosec / 1e9 for each in states]
    assert all(b > a for a, b in itertools.pairwise(stamps))
    assert abs(time.time() - stamps[-1]) < 3.0
    assert states[-1].position == pytest.approx(rad(place(machine), place(machine, 2)), abs=1e-3)
    assert not any(map(math.isnan, states[-1].velocity + states[-1].effort))


def test_the_plant_follows_a_trajectory_with_velocities_in_its_time(ros, machine):
    x, y = place(machine), place(machine, 2)
    rows = [(0.5, rad(x + 10, y - 5), rad(30, -15)), (1.0, rad(x + 20, y - 10), [0.0, 0.0])]
    ros.send(["x", "y"], *rows)
    until(lambda: not stands(machine), 3.0)
    begun = time.monotonic()
    until(lambda: place(machine) > x + 10)
    assert place(machine, 2) == pytest.approx(y - 5, abs=1.5)  # both move together
    assert turns(machine) == pytest.approx(30, abs=5)
    assert 0.2 < time.monotonic() - begun < 3.0
    until(lambda: stands(machine))
    assert [place(machine), place(machine, 2)] == pytest.approx([x + 20, y - 10], abs=0.1)
    until(lambda: ros.newest.position == pytest.approx(rad(x + 20, y - 10), abs=2e-3))
    until(lambda: not commander(machine))  # it returns control


def test_the_lease_is_refused_while_a_trajectory_has_control(ros, machine, endpoint):
    with Client(endpoint) as client:
        until(lambda: client.lease("look").holder is None)
        ros.send(["x"], (1.0, rad(place(machine) + 5)))
        until(lambda: not stands(machine), 3.0)
        refused = client.lease("take")
        assert (refused.holder, bool(refused.token)) == ("a trajectory of ROS 2", False)
        until(lambda: client.lease("look").holder is None)
    assert all(axis.state is AxisState.STANDSTILL for axis in machine)


def test_a_trajectory_of_one_later_point_moves_one_axis_there(ros, machine):
    x, y = place(machine), place(machine, 2)
    ros.send(["y"], (0.5, rad(y + 8)))
    until(lambda: abs(place(machine, 2) - y - 8) < 0.05 and stands(machine))
    assert place(machine) == pytest.approx(x, abs=0.05)


def test_a_trajectory_without_points_halts_and_during_one_no_other_begins(ros, machine):
    x = place(machine)
    ros.send(["x"], (5.0, rad(x + 100)))
    until(lambda: turns(machine) > 5)
    ros.send(["x"], (1.0, rad(x - 20)))
    time.sleep(0.3)
    assert turns(machine) > 5
    ros.send(["x"])
    until(lambda: stands(machine), 2.0)
    until(lambda: machine["x"].state is AxisState.STANDSTILL)
    assert x < place(machine) < x + 90
    assert moves_nothing(machine)


def test_of_two_simultaneous_trajectories_the_first_is_followed_to_its_end(ros, machine):
    x = place(machine)
    ros.send(["x"], (1.4, rad(x - 9)))
    ros.send(["x"], (0.5, rad(x + 9)))
    until(lambda: turns(machine) < -5)
    until(lambda: stands(machine))
    assert place(machine) == pytest.approx(x - 9, abs=0.1)


def test_wrong_stale_huge_or_random_messages_move_nothing(ros, machine):
    x, y = place(machine), place(machine, 2)
    chance = random.Random(2)
    good = joint_trajectory(["x", "y"], [(1.0, rad(x + 5, y + 5), (), (), ())])
    for data in (b"", good[:-8], good + bytes(64), bytes(3_000_000), b"\xff" * 1000, b"{}"):
        ros.put(data, ros.attachment())
    for _ in range(200):
        ros.put(chance.randbytes(chance.randrange(300)), ros.attachment())
    for attachment in (None, b"", bytes(32), bytes(34), b"\xff" * 33):
        ros.put(good, attachment)
    ros.put(good, ros.attachment(number=1))  # it was there
    ros.put(good, ros.attachment(sent=time.time_ns() - 5 * 10**9))  # it took longer than those before
    ros.put(
        good, ros.attachment(sent=time.time_ns() - 5 * 10**9, gid=b"N" * 16)
    )  # the first one of its publisher
    time.sleep(0.3)
    now, there = time.time_ns(), (1.0, rad(x + 5, y + 5))
    for joints, *rows, stamp in (
        *((["x", "y"], there, stamp) for stamp in (now - 10**10, now + 10**10, 1)),
        (["x", "q"], there, 0),
        (["x", "y"], (1.0, rad(x + 5, 1e9)), 0),
        (["x", "y"], (1.0, [math.nan, 0.0]), 0),
        (["x", "y"], (0.0, rad(x + 5, y)), (1.0, rad(x + 6, y)), 0),  # a jump
        (["x", "y"], (0.01, rad(x + 90, y)), 0),  # too fast
        (["x", "y"], (1.0, rad(x + 5, y)), (0.5, rad(x + 6, y)), 0),
        (["x", "y"], (1.0, rad(x + 5, y), rad(30, 0)), 0),  # it does not end at standstill
    ):
        ros.send(joints, *rows, stamp=stamp)
        time.sleep(0.1)  # none is refused for others that wait
    assert moves_nothing(machine, 0.7)
    assert [place(machine), place(machine, 2)] == pytest.approx([x, y], abs=0.05)
    ros.send(["x", "y"], (0.5, rad(x + 5, y + 5)))
    until(lambda: place(machine) > x + 4.9 and stands(machine))


def test_a_disabled_axis_stays_disabled(ros, file, machine):
    with Machine.attach(file, command=True) as guest:
        guest["x"].disable().wait(10)
    x, y = place(machine), place(machine, 2)
    ros.send(["x", "y"], (0.5, rad(x + 5, y + 5)))
    assert moves_nothing(machine, 0.6)
    assert machine["x"].state is AxisState.DISABLED


def test_another_program_keeps_control_or_takes_it(ros, file, machine):
    x, y = place(machine), place(machine, 2)
    with Machine.attach(file, command=True) as guest:
        ros.send(["x"], (0.5, rad(x + 5)))
        assert moves_nothing(machine, 0.7)
        guest["y"].move_absolute(y + 2, velocity=20.0).wait(10)
    ros.send(["x"], (5.0, rad(x + 90)))
    until(lambda: turns(machine) > 5)
    with Machine.attach(file, force=True):
        until(lambda: stands(machine), 2.0)
        assert moves_nothing(machine)


def test_a_suspended_or_killed_bridge_halts_its_axes(ros, file, machine, endpoint, config):
    words = ("--config", config, "--cell", "two", "--ros", "--ros-command", "--ros-namespace", "arm")
    with BridgeProcess(file, *words) as own, Ros(endpoint, "0/arm") as arm:
        own.await_line("joined")
        until(lambda: arm.heard)
        for number in (signal.SIGSTOP, signal.SIGKILL):
            x = place(machine)
            arm.send(["x"], (10.0, rad(x + 100)))
            until(lambda: turns(machine) > 5)
            own.process.send_signal(number)
            took = until(lambda: stands(machine), 3.0)
            assert took < 2.0
            until(lambda: machine["x"].state is AxisState.STANDSTILL)
            if number is signal.SIGSTOP:
                arm.send(["x"], (0.5, rad(place(machine) + 5)))  # it waits for the bridge
                own.process.send_signal(signal.SIGCONT)
                assert moves_nothing(machine, 1.5)
                until(lambda: not commander(machine))
