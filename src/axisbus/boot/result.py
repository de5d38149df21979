"""The result of booting a node."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from axisbus.boot.report import NodeReport
from axisbus.motion.parameters import AxisParameters

if TYPE_CHECKING:  # a program whose core is another process does not need the boot code
    from axisbus.boot.configure import DriveMonitoringSetup


@dataclass(slots=True)
class Booted:
    """A booted node: its report, the parameters of its axes, and the monitoring setup that is undone when the node is released."""

    report: NodeReport
    parameters: dict[str, AxisParameters]
    watch: DriveMonitoringSetup | None = None
    found_enabled: bool = False
