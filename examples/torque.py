"""Profile torque: a torque with a slope. The master monitors the velocity limit of the axis meanwhile."""

from pathlib import Path

from axisbus import AxisState, Machine

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    z = cell["z"]
    z.enable().wait()
    z.torque_control(0.4, slope=4.0).wait()  # N·m and N·m/s; rated_torque in cell.toml gives the scale
    print(f"torque: {z.torque:.2f} N·m")
    cell.sleep(0.3)
    if z.state is AxisState.ERRORSTOP:
        print(f"stopped at its limit: {z.error}")
    else:
        z.halt().wait()  # torque 0; if the axis does not come to rest in time, the drive's quick stop
        print(f"halted: {z.state.value}")
