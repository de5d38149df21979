"""Drive plug-ins: properties of a vendor's drive family, such as identity, fault tables and deviations from CiA 402."""

from axisbus.drives.plugin import Behaviour, DrivePlugin, FaultObject, FaultTexts, MeasuredObject

__all__ = ["Behaviour", "DrivePlugin", "FaultObject", "FaultTexts", "MeasuredObject"]
