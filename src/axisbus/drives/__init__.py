"""Drive plug-ins: properties of a vendor's drive family, such as identity, fault tables and deviations from CiA 402."""

from axisbus.drives.plugin import (
    Behaviour,
    DrivePlugin,
    Extension,
    FaultObject,
    FaultTexts,
    MeasuredObject,
    NodeIdObject,
)

__all__ = [
    "Behaviour",
    "DrivePlugin",
    "Extension",
    "FaultObject",
    "FaultTexts",
    "MeasuredObject",
    "NodeIdObject",
]
