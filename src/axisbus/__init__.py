"""A CANopen CiA 402 master: named axes in engineering units, with EDS tools and a simulated drive.

The names below are loaded when they are first used: ``import axisbus`` alone loads neither ``can`` nor ``canopen``.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from axisbus.version import __version__ as __version__

if TYPE_CHECKING:
    from axisbus.errors import AxisbusError
    from axisbus.fleet.axis import FleetAxis
    from axisbus.fleet.cell import FleetCell
    from axisbus.fleet.fleet import Fleet
    from axisbus.machine.axis import Axis
    from axisbus.machine.coupling import Cam
    from axisbus.machine.gantry import Gantry
    from axisbus.machine.groups import Group
    from axisbus.machine.handle import Handle, wait
    from axisbus.machine.io import InputsOutputs, Signal
    from axisbus.machine.machine import Machine
    from axisbus.machine.probing import ProbeHandle, ProbeResult
    from axisbus.machine.sim_control import SimulationControl
    from axisbus.machine.streaming.controller import AxisFeedback, Controller
    from axisbus.machine.streaming.points import PointStream
    from axisbus.machine.user_kinematics.kinematics import UserKinematics
    from axisbus.motion.group.kinematics import CoreXY, Delta, Scara
    from axisbus.motion.point_stream.timed import TrajectoryPoint
    from axisbus.motion.spline import SplineTrajectory
    from axisbus.motion.states import AxisState
    from axisbus.motion.trajectory import SampledTrajectory, Trajectory, TrapezoidalTrajectory
    from axisbus.record.plot import plot
    from axisbus.record.recorder import Recorder

_HOME = {
    "AxisbusError": "axisbus.errors",
    "Axis": "axisbus.machine.axis",
    "AxisState": "axisbus.motion.states",
    "Cam": "axisbus.machine.coupling",
    "CoreXY": "axisbus.motion.group.kinematics",
    "Delta": "axisbus.motion.group.kinematics",
    "Scara": "axisbus.motion.group.kinematics",
    "Fleet": "axisbus.fleet.fleet",
    "FleetAxis": "axisbus.fleet.axis",
    "FleetCell": "axisbus.fleet.cell",
    "Gantry": "axisbus.machine.gantry",
    "Group": "axisbus.machine.groups",
    "Handle": "axisbus.machine.handle",
    "InputsOutputs": "axisbus.machine.io",
    "Machine": "axisbus.machine.machine",
    "SimulationControl": "axisbus.machine.sim_control",
    "Controller": "axisbus.machine.streaming.controller",
    "AxisFeedback": "axisbus.machine.streaming.controller",
    "PointStream": "axisbus.machine.streaming.points",
    "UserKinematics": "axisbus.machine.user_kinematics.kinematics",
    "ProbeHandle": "axisbus.machine.probing",
    "ProbeResult": "axisbus.machine.probing",
    "Recorder": "axisbus.record.recorder",
    "SampledTrajectory": "axisbus.motion.trajectory",
    "Signal": "axisbus.machine.io",
    "SplineTrajectory": "axisbus.motion.spline",
    "TrajectoryPoint": "axisbus.motion.point_stream.timed",
    "Trajectory": "axisbus.motion.trajectory",
    "TrapezoidalTrajectory": "axisbus.motion.trajectory",
    "plot": "axisbus.record.plot",
    "wait": "axisbus.machine.handle",
}

__all__ = [
    "Axis",
    "AxisFeedback",
    "AxisState",
    "AxisbusError",
    "Cam",
    "Controller",
    "CoreXY",
    "Delta",
    "Fleet",
    "FleetAxis",
    "FleetCell",
    "Gantry",
    "Group",
    "Handle",
    "InputsOutputs",
    "Machine",
    "PointStream",
    "ProbeHandle",
    "ProbeResult",
    "Recorder",
    "SampledTrajectory",
    "Scara",
    "Signal",
    "SimulationControl",
    "SplineTrajectory",
    "Trajectory",
    "TrajectoryPoint",
    "TrapezoidalTrajectory",
    "UserKinematics",
    "plot",
    "wait",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'axisbus' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
