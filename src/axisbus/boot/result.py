"""What booting a node has come to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from axisbus.boot.report import NodeReport
from axisbus.motion.parameters import AxisParameters

if TYPE_CHECKING:  # a program whose core is another process has no need of what boots
    from axisbus.boot.configure import DriveMonitoringSetup


@dataclass(slots=True)
class Booted:
    """A node that is up: what it reported, the parameters of its axes, and how to let it go again."""

    report: NodeReport
    parameters: dict[str, AxisParameters]
    watch: DriveMonitoringSetup | None = None
    found_enabled: bool = False
