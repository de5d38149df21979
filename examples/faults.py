"""A drive fault during a move: which axes stop, what their errors say, and how to continue. The fault is simulated."""

from pathlib import Path

from axisbus import AxisbusError, Machine, wait

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    wait(axis.enable() for axis in cell)
    wait(axis.home() for axis in cell)
    moves = [cell["x"].move_absolute(60.0), cell["z"].move_absolute(60.0)]
    cell.sleep(0.3)
    cell.simulated_node(1).fault(0x4310)  # excess temperature in the drive of x
    try:
        wait(moves)
    except* AxisbusError as group:
        for error in group.exceptions:
            print(error)
    cell.sleep(0.3)
    print({axis.name: axis.state.value for axis in cell})
    cell["x"].reset().wait()  # a reset never enables
    cell["x"].enable().wait()
    cell["x"].move_absolute(0.0).wait()
    print(f"x moves again: {cell['x'].position:.2f} deg")
