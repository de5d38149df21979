"""The notebooks of examples/ run as they are, and the stop button of a notebook halts moving axes and leaves the machine open.

The plant is read from a history that the simulated drives write, or by a second program.
"""

from __future__ import annotations

import csv
import shutil
import sys
import time

import nbformat
import pytest
from nbclient import NotebookClient

from axisbus import AxisState, Machine
from kit.cell import SCALE, cell_text
from kit.notebook import kernel
from kit.pages import ROOT

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="signals, and a core that others can join"),
    pytest.mark.timeout(120),
]
SPEED = 40.0  # deg/s
SLOW = SPEED**2 / 2 / 500.0  # degrees: the distance of the ramp of a halt
STANDS_WITHIN = 1.5  # seconds on a busy computer; the ramp takes 0.08


# -- the examples -------------------------------------------------------------------------------------------------------


def read(path):
    return nbformat.read(path, as_version=4)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Run notebooks in a copy of their files, each once; return the outputs of its cells of code."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("examples", "eds"):
        shutil.copytree(ROOT / name, folder / name)
    done = {}

    def run(name):
        if name not in done:
            notebook = read(folder / "examples" / f"{name}.ipynb")
            NotebookClient(
                notebook, timeout=60, resources={"metadata": {"path": str(folder / "examples")}}
            ).execute()
            done[name] = [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]
        return done[name]

    return run


def shown(outputs, kind):
    """The outputs of cells of a kind, such as text/html."""
    return [one.data[kind] for each in outputs for one in each if "data" in one and kind in one.data]


def printed(outputs):
    return "".join(one.text for each in outputs for one in each if one.output_type == "stream")


def is_picture(png):
    return len(png) > 20_000 and png.startswith("iVBORw0KGgo")


def test_the_first_steps_arrive_and_are_drawn(ran):
    outputs = ran("first_steps")
    assert "x is at 45.00 deg, y at -30.00 deg" in printed(outputs)
    tables = shown(outputs, "text/html")
    assert "Standstill" in tables[1]
    assert "was asked for" in tables[3]  # the move that a halt ended
    assert "the machine is closed" in tables[-1]
    pictures = shown(outputs, "image/png")
    assert len(pictures) == 2
    assert all(map(is_picture, pictures))


def test_the_inspection_reports_of_the_drive(ran):
    outputs = ran("eds_inspection")
    assert "GIM6010-8" in shown(outputs, "text/html")[0]
    text = printed(outputs)
    assert "COB-ID of RPDO1 for node 5: 205h" in text
    assert "1600h: 6040h:00 Controlword" in text


def test_the_tuning_finds_an_acceleration_and_draws_it(ran):
    outputs = ran("tuning_by_capture")
    assert "acceleration = 1440.0" in printed(outputs)
    assert "did not come" not in printed(outputs)
    pictures = shown(outputs, "image/png")
    assert len(pictures) == 2
    assert all(map(is_picture, pictures))


# -- the stop button ----------------------------------------------------------------------------------------------------


class Bench:
    """A kernel that has a machine open; ``x`` is enabled before each test."""

    def __init__(self, folder, of):
        self.folder = folder
        self.of = of

    def open(self):
        self.of.run(
            "import time\nfrom axisbus import Machine, wait\ncell = Machine.open('cell.toml')\nx = cell['x']"
        )

    def plant(self):
        """Times, velocities in deg/s and power stages of x so far."""
        with (self.folder / "plant.csv").open(encoding="utf-8") as file:
            rows = [row for row in csv.DictReader(file) if row["stage"] and row["node"] == "1"]
        return [
            (float(row["time"]), float(row["position"]) / SCALE, float(row["velocity"]) / SCALE)
            for row in rows
        ]

    def distance_after(self, at):
        """Return how many degrees x moved after a time, once it is at standstill; None if it is not in time."""
        until = time.monotonic() + STANDS_WITHIN + 0.3
        while time.monotonic() < until:
            time.sleep(0.1)
            rows = self.plant()
            if rows[-1][0] > at + 0.2 and all(
                abs(speed) < 0.05 for when, _, speed in rows if when > rows[-1][0] - 0.1
            ):
                before = [position for when, position, _ in rows if when <= at]
                return abs(rows[-1][1] - before[-1])
        return None

    def turns(self):
        return abs(self.plant()[-1][2]) > SPEED / 2


def folder_with(folder, names="xy", process="own"):
    bus = f'process = "{process}"\n' + ('options = { history = "plant.csv" }' if process == "own" else "")
    period = "10ms" if process == "own" else "20ms"  # beside a program it needs more time
    text = cell_text(names, period=period, heartbeat="1s", bus=bus)
    (folder / "cell.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    folder = folder_with(tmp_path_factory.mktemp("bench"))
    with kernel(folder, AXISBUS_PROCESS="own") as of:
        bench = Bench(folder, of)
        bench.open()
        yield bench


AT_REST = """
for axis in cell:
    if axis.state.value == "ErrorStop":
        axis.reset().wait()
    axis.enable().wait()
"""


@pytest.fixture
def bench(opened):
    opened.of.run(AT_REST)
    return opened


def begun(bench, code):
    """Begin a cell that moves x, and wait until that is at its velocity."""
    cell = bench.of.begin(f"print('begun', flush=True)\n{code}")
    await_turning(bench)
    return cell


def await_turning(bench):
    until = time.monotonic() + 5.0
    while not bench.turns():
        assert time.monotonic() < until
        time.sleep(0.02)
    time.sleep(0.1)


def goes_on(bench):
    """Whether the next cell can move."""
    return (
        bench.of.run("x.enable().wait(); x.move_relative(2.0).wait(); print(x.state.value)") == "Standstill"
    )


MIDST = {
    "waits": f"other = cell['y'].move_absolute(cell['y'].position + 1000.0, velocity={SPEED})\n"
    f"move = x.move_relative(1000.0, velocity={SPEED})\nmove.wait()",
    "waits for several": f"other = cell['y'].move_relative(1000.0, velocity={SPEED})\n"
    f"move = x.move_relative(1000.0, velocity={SPEED})\nwait(move, other)",
    "sleeps": f"other = cell['y'].move_relative(1000.0, velocity={SPEED})\n"
    f"move = x.move_relative(1000.0, velocity={SPEED})\ntime.sleep(30.0)",
    "computes": f"other = cell['y'].move_relative(1000.0, velocity={SPEED})\n"
    f"move = x.move_relative(1000.0, velocity={SPEED})\nwhile True: pass",
    "awaits": f"other = cell['y'].move_relative(1000.0, velocity={SPEED})\n"
    f"move = x.move_relative(1000.0, velocity={SPEED})\nawait move",
}
ENDS = "print(move.aborted, other.aborted, type(move.error).__name__, 'its program was interrupted' in str(other.error))"


@pytest.mark.parametrize("doing", MIDST)
def test_an_interrupt_in_mid_move_halts_and_the_next_cell_moves_on(bench, doing):
    cell = begun(bench, MIDST[doing])
    at = bench.of.interrupt()
    assert bench.of.end(cell).error in ("KeyboardInterrupt", "CancelledError")
    way = bench.distance_after(at)
    assert way is not None
    assert 0.7 * SLOW < way < SLOW + 0.3 * SPEED  # on the ramp of a halt, begun at once
    with Machine.attach(bench.folder / "cell.toml") as seen:
        assert [axis.state for axis in seen] == [AxisState.STANDSTILL, AxisState.STANDSTILL]
        assert [axis.velocity for axis in seen] == [0.0, 0.0]
    assert bench.of.run(ENDS) == "True True Stopped True"
    assert goes_on(bench)


def test_an_interrupt_between_two_cells_halts_moving_axes(bench):
    bench.of.run(f"x.move_velocity({SPEED}).wait()")
    await_turning(bench)
    at = bench.of.interrupt()
    assert bench.distance_after(at) is not None
    assert bench.of.run("print(x.state.value, x.error)") == "Standstill None"
    assert goes_on(bench)


def test_an_interrupt_during_a_call_that_blocks_all_threads_halts_before_its_end(bench):
    code = (
        f"x.move_velocity({SPEED}).wait()\nbegan = time.monotonic(); 3 ** 12_000_000; print(time.monotonic())"
    )
    cell = begun(bench, code)
    at = bench.of.interrupt()
    assert bench.distance_after(at) < SLOW + 0.6 * SPEED
    bench.of.end(cell)
    assert bench.of.run("print(x.error)") == "None"
    assert goes_on(bench)


def test_a_second_interrupt_while_something_moves_is_a_quick_stop(bench):
    bench.of.run("x.move_velocity(300.0).wait()")
    bench.of.interrupt()
    time.sleep(0.08)
    at = bench.of.interrupt()
    assert bench.distance_after(at) is not None
    assert bench.of.run("print(x.state.value)") == "Disabled"
    assert goes_on(bench)


def test_an_interrupt_of_a_cell_that_moves_nothing_changes_nothing(bench):
    cell = bench.of.begin("print('begun', flush=True)\ntime.sleep(30.0)")
    bench.of.interrupt()
    assert bench.of.end(cell).error == "KeyboardInterrupt"
    assert bench.of.run("print([axis.state.value for axis in cell])") == "['Standstill', 'Standstill']"
    assert goes_on(bench)


def test_an_interrupt_of_another_program_halts_only_if_it_has_control(bench):
    bench.of.run(f"x.move_velocity({SPEED}).wait()")
    await_turning(bench)
    path = bench.folder / "cell.toml"
    with Machine.attach(path) as guest:
        guest.session.request_halt("the guest was interrupted", 1)
        guest.sleep(0.5)
        assert bench.turns()
    with Machine.attach(path, force=True) as guest:
        move = guest["x"].move_velocity(SPEED)
        await_turning(bench)
        guest.session.request_halt("the guest was interrupted", 2)
        guest.sleep(1.0)
        assert guest["x"].state is AxisState.STANDSTILL
        assert move.done
        guest["x"].move_relative(2.0).wait()
    assert goes_on(bench)


# -- the end of a kernel, and other machines ---------------------------------------------------------------------------


def stands(bench, at):
    """Whether x is permanently at standstill soon after a time; its history may have ended."""
    until = time.monotonic() + STANDS_WITHIN
    while time.monotonic() < until and abs(bench.plant()[-1][2]) > 0.05:
        time.sleep(0.1)
    last = bench.plant()[-1]
    return last[0] > at and abs(last[2]) < 0.05


def turning(folder, of):
    bench = Bench(folder, of)
    bench.open()
    of.run(f"x.enable().wait(); x.move_velocity({SPEED}).wait()")
    await_turning(bench)
    return bench


@pytest.mark.parametrize("way", ["shut_down", "terminate", "kill"])
def test_the_end_of_a_kernel_stops_its_axes(tmp_path, way):
    with kernel(folder_with(tmp_path), AXISBUS_PROCESS="own") as of:
        bench = turning(tmp_path, of)
        at = getattr(of, way)()
        assert stands(bench, at)


# It prints only within the call: an interrupt before it halts, and leaves the machine open.
CLOSES = """
import sys, threading
main = threading.main_thread().ident

def called():
    frame = sys._current_frames()[main]
    while frame is not None and frame.f_code is not type(cell).close.__code__:
        frame = frame.f_back
    return frame is not None

def tell():
    while not called():
        time.sleep(0.001)
    print("begun", flush=True)

threading.Thread(target=tell, daemon=True).start()
cell.close()
"""


def test_an_interrupt_while_a_machine_is_closed_waits_for_standstill(tmp_path):
    with kernel(folder_with(tmp_path), AXISBUS_PROCESS="own") as of:
        bench = turning(tmp_path, of)
        cell = of.begin(CLOSES)
        of.interrupt()
        assert of.end(cell).error == "KeyboardInterrupt"
        assert not bench.turns()
        assert of.run(
            "import signal\nprint(cell.session.ended, signal.getsignal(signal.SIGINT).__name__)"
        ) == ("True default_int_handler")


def test_with_the_core_in_the_kernel_an_interrupt_halts_as_well(tmp_path):
    with kernel(folder_with(tmp_path, process="thread")) as of:
        of.show_a_traceback()  # for which IPython loads much, once
        Bench(tmp_path, of).open()
        of.run("wait(axis.enable() for axis in cell)")
        cell = of.begin(f"print('begun', flush=True)\n{MIDST['waits']}")
        time.sleep(0.3)
        of.interrupt()
        assert of.end(cell).error == "KeyboardInterrupt"
        told = of.run(f"cell.sleep(1.0)\n{ENDS}\nprint(x.error)\nprint(x.state.value)")
        assert told.splitlines() == ["True True Stopped True", "None", "Standstill"], told
        assert of.run("x.move_relative(2.0).wait()\nprint(x.state.value)") == "Standstill"
        of.run("cell.close()")


def test_in_virtual_time_an_interrupt_halts_when_time_passes_again(tmp_path):
    with kernel(folder_with(tmp_path)) as of:
        of.run(
            "from axisbus import Machine, wait\ncell = Machine.simulated('cell.toml')\nx = cell['x']\nx.enable().wait()"
        )
        cell = of.begin("print('begun', flush=True)\nmove = x.move_velocity(10.0).wait()\ncell.sleep(1e9)")
        time.sleep(0.3)
        of.interrupt()
        assert of.end(cell).error == "KeyboardInterrupt"
        assert (
            of.run("cell.sleep(1.0)\nprint(x.state.value, x.velocity, cell.session.failed)")
            == "Standstill 0.0 False"
        )
        assert of.run("x.move_relative(2.0).wait()\nprint(x.state.value)") == "Standstill"


def test_an_interrupt_halts_the_axes_of_two_machines(tmp_path):
    (tmp_path / "one").mkdir()
    (tmp_path / "two").mkdir()
    for folder in ("one", "two"):
        folder_with(tmp_path / folder)
    with kernel(tmp_path, AXISBUS_PROCESS="own") as of:
        of.run(
            "from axisbus import Machine, wait\n"
            "cells = [Machine.open(f'{name}/cell.toml') for name in ('one', 'two')]\n"
            f"for cell in cells: cell['x'].enable().wait(); cell['x'].move_velocity({SPEED}).wait()"
        )
        cell = of.begin("print('begun', flush=True)\ncells[0].sleep(30.0)")
        of.interrupt()
        assert of.end(cell).error == "KeyboardInterrupt"
        states = "print(*(cell['x'].state.value for cell in cells))"
        assert of.run(f"cells[0].sleep(1.0)\n{states}") == "Standstill Standstill"
        of.run("cells.pop().close()")
        cell = of.begin(
            f"cell = cells[0]\ncell['x'].move_velocity({SPEED}).wait()\nprint('begun', flush=True)\ncell.sleep(30.0)"
        )
        of.interrupt()
        assert of.end(cell).error == "KeyboardInterrupt"
        assert of.run(f"cells[0].sleep(1.0)\n{states}") == "Standstill"
