"""The part of the plug-in that runs the modules of a cell."""

from __future__ import annotations

from axisbus.core.other_protocols import CorePart
from axisbus.drives.gim6010.core.modules import CanSimpleModules
from axisbus.drives.gim6010.core.simulated_modules import simulated_modules
from axisbus.drives.gim6010.core.stop import holding, stop_axes

PART = CorePart(
    nodes=CanSimpleModules,
    stop=stop_axes,
    holding=holding,
    simulated=simulated_modules,
)
