"""A fleet before simulated cells with their bridges, all in processes of their own: moved together, killed, stopped and cut."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest

pytest.importorskip("zenoh", reason="a fleet needs eclipse-zenoh")
if sys.platform != "linux":
    pytest.skip("a core in a process of its own is for Linux", allow_module_level=True)

from axisbus import Fleet, wait
from axisbus.errors import AxisbusError, CommandError, LimitError, OwnershipError, StaleError, Stopped
from axisbus.fleet import zenoh_client
from axisbus.motion.states import AxisState
from kit import command_line
from kit.fleet.processes import ProcessCell
from kit.pages import ROOT, blocks
from kit.served_page import until
from kit.zenoh_cell import Wire

pytestmark = pytest.mark.timeout(120)
LOST = 1.0  # seconds in which a cell that was killed is to be seen as gone


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """Two cells that all tests of this module share; each is to leave them as it found them."""
    folder = tmp_path_factory.mktemp("plant")
    with ThreadPoolExecutor() as pool:
        cells = list(pool.map(partial(ProcessCell, folder), ("press", "saw")))
    yield cells
    for cell in cells:
        cell.end()


def fleet_of(cells, **more):
    fleet = Fleet("hall", connect=[cell.endpoint for cell in cells], **more)
    fleet.wait_for(*(cell.name for cell in cells))
    return fleet


def is_in(axis, state):
    """Whether an axis is in a state now, for sure."""
    seen = axis._cell.last_state(axis.name)
    return seen is not None and seen.fresh and seen.state.state == state.value


def way(cells):
    return ["--plant", "hall", *(word for cell in cells for word in ("--connect", cell.endpoint))]


def test_the_program_of_the_page_moves_axes_of_two_cells_together(plant, capsys):
    (program,) = (text for text in blocks(ROOT / "docs" / "fleet.md", "text") if "import Fleet" in text)
    for port, cell in zip(("7447", "7448"), plant, strict=True):
        program = program.replace(f"tcp/127.0.0.1:{port}", cell.endpoint)
    exec(compile(program, "docs/fleet.md", "exec"), {})
    told = capsys.readouterr().out
    assert re.search(r"^press \[\('x', (10\.0|9\.9)", told, re.M)
    assert re.search(r"^saw \[\('x', -(10\.0|9\.9)", told, re.M)


def test_fleet_list_shows_the_states_of_the_axes(plant, monkeypatch, capsys):
    axisbus = command_line.runner(monkeypatch, capsys)
    code, out, err = axisbus("fleet", "list", *way(plant))
    assert (code, err) == (0, "")
    assert out.count(": alive, simulated") == 2
    assert re.search(r"^  x +Standstill +\S+ deg ", out, re.M)
    assert re.search(r"^  y +Disabled +0\.000 deg ", out, re.M)


def test_a_move_whose_answers_are_lost_moves_once(plant, monkeypatch):
    monkeypatch.setattr("axisbus.fleet.command_sender._TIMEOUT", 0.3)
    with fleet_of(plant) as fleet, fleet["press"].command() as press:
        press["x"].enable().wait(20)
        begin = press["x"].position
        heard, lost = zenoh_client._Query.on_reply, []

        def loses(query, reply):
            if b'"status"' in reply.ok.payload.to_bytes() and len(lost) < 4:
                lost.append(reply)
                query.end()
            else:
                heard(query, reply)

        monkeypatch.setattr(zenoh_client._Query, "on_reply", loses)
        press["x"].move_relative(7.0).wait(20)
        assert len(lost) == 4
        until(lambda: press["x"].position == pytest.approx(begin + 7.0, abs=0.1))
        time.sleep(0.3)
        assert press["x"].position == pytest.approx(begin + 7.0, abs=0.1)


def test_a_refusal_of_a_cell_is_raised_as_the_library_s_own_error(plant):
    with fleet_of(plant) as fleet, fleet["press"].command() as press:
        press["x"].enable().wait(20)
        with pytest.raises(LimitError, match="max_velocity"):
            press["x"].move_absolute(1.0, velocity=1e6).wait(10)
        assert press["x"].limits["max_velocity"] == 400.0


def test_a_jog_continues_while_it_is_renewed_and_then_ends(plant):
    with fleet_of(plant) as fleet, fleet["press"].command() as press:
        press["x"].enable().wait(20)
        begin = press["x"].position
        for _ in range(8):
            press["x"].jog(20.0).wait(5)
            time.sleep(0.08)
        until(lambda: is_in(press["x"], AxisState.STANDSTILL))
        assert 5.0 < press["x"].position - begin < 30.0


PROGRAM = """
import sys, time
from axisbus import Fleet
with Fleet("hall", connect=sys.argv[1:]) as fleet:
    fleet.wait_for("press")
    with fleet["press"].command() as press:
        press["x"].enable().wait(20)
        press["x"].move_velocity(20.0).wait(20)
        print("moves", flush=True)
        sys.stdin.readline()
        try:
            press["x"].move_relative(5.0).wait(20)
        except Exception as error:
            print(type(error).__name__, flush=True)
        # States that were queued while this program was stopped are taken first.
        end = time.monotonic() + 10.0
        while not (press.last_state("x").fresh and press["x"].state.value == "Standstill"):
            if time.monotonic() > end:
                break
            time.sleep(0.05)
        print(press["x"].state.value, flush=True)
"""


@pytest.fixture
def mover(plant):
    """A program that turns an axis, and means to continue."""
    command = [sys.executable, "-c", PROGRAM, plant[0].endpoint]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout.readline() == "moves\n"
        yield program
        program.kill()


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM], ids=lambda each: each.name
)
def test_a_program_that_ends_or_is_suspended_leaves_axes_at_standstill(plant, mover, number):
    with fleet_of(plant) as fleet:
        axis = fleet["press"]["x"]
        until(lambda: is_in(axis, AxisState.CONTINUOUS_MOTION))
        mover.send_signal(number)
        assert until(lambda: is_in(axis, AxisState.STANDSTILL), 5.0) < 2.0
        place = axis.position
        with fleet["press"].command() as press:  # it is free, or will be
            press["x"].halt().wait(5)
        assert axis.position == pytest.approx(place, abs=0.1)
        if number is signal.SIGSTOP:  # it sees the cell again, and finds that it has not its command any more
            mover.send_signal(signal.SIGCONT)
            mover.stdin.write("\n")
            mover.stdin.flush()
            assert [mover.stdout.readline(), mover.stdout.readline()] == ["OwnershipError\n", "Standstill\n"]
            assert axis.position == pytest.approx(place, abs=0.1)


def test_commands_that_run_at_the_end_of_the_block_are_halted_and_reported_as_stopped(plant):
    with fleet_of(plant) as fleet:
        with fleet["press"].command() as press:
            press["x"].enable().wait(20)
            move = press["x"].move_relative(1000.0)
            until(lambda: move.active)
        with pytest.raises(Stopped, match=r"released|halt|stop"):
            move.wait(5)
        until(lambda: is_in(press["x"], AxisState.STANDSTILL))


def test_a_stop_of_a_third_program_ends_the_commands_of_the_program_with_control(plant, monkeypatch, capsys):
    axisbus = command_line.runner(monkeypatch, capsys)
    with fleet_of(plant) as fleet, fleet["press"].command() as press, fleet["saw"].command() as saw:
        wait(press["x"].enable(), saw["x"].enable(), timeout=20)
        moves = [press["x"].move_relative(1000.0), saw["x"].move_relative(1000.0)]
        until(lambda: all(move.active for move in moves))
        code, out, _ = axisbus("fleet", "stop", *way(plant))
        assert (code, out.count(": stopped")) == (0, 2)
        for move in moves:
            with pytest.raises(AxisbusError, match=r"stop|Stopped") as caught:
                move.wait(5)
            assert "not known" not in str(caught.value)
        until(lambda: is_in(press["x"], AxisState.DISABLED))


def test_a_program_that_takes_over_has_control_and_the_previous_one_gets_an_error(plant):
    with fleet_of(plant, who="one") as one, fleet_of(plant, who="two") as two:
        mine = one["press"].command()
        with mine as press:
            press["x"].enable().wait(20)
            move = press["x"].move_relative(1000.0)
            until(lambda: move.active)
            with pytest.raises(OwnershipError, match="one"), two["press"].command():
                pass
            with two["press"].command(force=True) as theirs:
                until(lambda: mine.lost is not None)
                assert move.exception() or until(lambda: move.exception())
                with pytest.raises(OwnershipError):
                    press["x"].move_relative(1.0)
                theirs["x"].move_relative(1.0).wait(20)
        with one["press"].command() as press:
            press["x"].move_relative(1.0).wait(20)


def test_an_object_of_a_node_is_read(plant):
    with fleet_of(plant) as fleet:
        assert fleet["press"].read_object(1, 0x6041) & 0x6F in (0x40, 0x27)  # off, or on
        with pytest.raises(AxisbusError):
            fleet["press"].read_object(1, 0x5FFF)


def test_after_a_wire_is_cut_and_fixed_old_values_are_not_used_and_no_event_is_missed(plant):
    wire = Wire(int(plant[0].endpoint.rpartition(":")[2]))
    try:
        with Fleet("hall", connect=[wire.endpoint]) as fleet, fleet_of(plant) as beside:
            (press,) = fleet.wait_for("press")
            command = press.command()
            with command:
                press["x"].enable().wait(20)
                move = press["x"].move_relative(1000.0)
                until(lambda: move.active)
                wire.cut.set()
                assert until(lambda: not press.alive) < LOST
                with pytest.raises(CommandError, match="not known"):
                    move.wait(2)
                until(lambda: is_in(beside["press"]["x"], AxisState.STANDSTILL))
                until(lambda: command.lost is not None)
                wire.cut.clear()
                fleet.wait_for("press")
                with pytest.raises(OwnershipError):
                    press["x"].move_relative(1.0)
            until(lambda: any("not renewed" in event.text for event in press.events[-5:]))
            numbers = [event.n for event in press.events]
            assert numbers == list(range(numbers[0], numbers[-1] + 1))
            assert press.lost_events == 0
            until(lambda: press.last_state("x").fresh)
            assert press["x"].state is AxisState.STANDSTILL
    finally:
        wire.close()


def test_a_silent_cell_is_lost_within_a_second_and_returns(plant, monkeypatch, capsys):
    saw, axisbus = plant[1], command_line.runner(monkeypatch, capsys)
    with fleet_of(plant) as fleet:
        cell = fleet["saw"]
        saw.signal(saw.bridge, signal.SIGSTOP)  # as a cable that is pulled: no connection is closed
        assert until(lambda: not cell.alive or not cell.last_state("x").fresh) < LOST
        until(lambda: not cell.alive)
        code, out, _ = axisbus("fleet", "stop", *way(plant))
        assert (code, "press: stopped" in out) == (3, True)
        assert f"NOT REACHED: {saw.endpoint}" in out
        saw.signal(saw.bridge, signal.SIGCONT)
        fleet.wait_for("saw")
        until(lambda: cell.last_state("x").fresh)
        assert fleet["press"].alive


def test_a_killed_bridge_leaves_axes_at_standstill_and_the_next_one_is_found(plant):
    press = plant[0]
    with fleet_of(plant) as fleet:
        cell = fleet["press"]
        with cell.command():
            cell["x"].enable().wait(20)
            move = cell["x"].move_relative(-1000.0)
            until(lambda: move.active)
            press.signal(press.bridge, signal.SIGKILL)
            assert until(lambda: not cell.alive) < LOST
            with pytest.raises(StaleError):
                cell["x"].position  # noqa: B018
            with pytest.raises(AxisbusError, match="not known"):
                move.wait(2)
            press.bridge.wait()
        press.begin_bridge()
        fleet.wait_for("press")
        until(lambda: is_in(cell["x"], AxisState.STANDSTILL))
        with cell.command():
            cell["x"].move_relative(1.0).wait(20)


# -- the last of both cells ------------------------------------------------------------------------------------------------


def test_a_machine_that_was_begun_again_under_its_bridge_is_known_and_commanded_again(plant):
    cell = plant[1]
    with fleet_of(plant) as fleet:
        saw = fleet["saw"]
        time.sleep(0.5)
        cell.machine.send_signal(signal.SIGINT)
        cell.machine.wait(20)
        until(lambda: not saw.alive)
        limit = saw["x"].limits["max_velocity"]
        cell.file.write_text(
            cell.file.read_text("utf-8").replace("max_velocity = 400", "max_velocity = 390"), "utf-8"
        )
        cell.machine = cell._begin("run", str(cell.file), until="the machine runs")
        until(lambda: saw.alive)
        until(
            lambda: is_in(saw["x"], AxisState.DISABLED)
        )  # its states are of now, though the bridge is the same
        until(lambda: saw["x"].limits["max_velocity"] != limit)
        with saw.command():
            saw["x"].enable().wait(20)
            saw["x"].move_relative(1.0).wait(20)
        assert saw["x"].age < 1.0


def test_a_killed_cell_is_not_reachable_after_a_second_and_the_others_continue(plant):
    with fleet_of(plant) as fleet:
        with fleet["press"].command() as press, fleet["saw"].command() as saw:
            wait(press["x"].enable(), saw["x"].enable(), timeout=20)
            moves = [press["x"].move_relative(1000.0), saw["x"].move_relative(5.0)]
            until(lambda: moves[0].active)
            plant[0].kill()
            assert until(lambda: not press.alive) < LOST
            with pytest.raises(StaleError):
                press["x"].state  # noqa: B018
            with pytest.raises(ExceptionGroup, match="1 of 2 commands failed"):
                wait(*moves, timeout=20)
            assert moves[1].done
        until(lambda: "gone for" in fleet["press"].offline_reason)


def test_a_machine_that_is_killed_under_its_bridge_is_reported_within_a_second(plant):
    saw = plant[1]
    with fleet_of([saw]) as fleet:
        cell = fleet["saw"]
        saw.signal(saw.machine, signal.SIGKILL)
        assert until(lambda: not cell.last_state("x").fresh) < LOST
        until(lambda: "does not run" in cell.offline_reason)
        until(lambda: any("has ended" in event.text for event in cell.incidents))
