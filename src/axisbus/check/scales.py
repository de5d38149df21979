"""Check that the scales of an axis fit the drive's objects for encoder, gear and units."""

from __future__ import annotations

from axisbus.cell import scale_proposal
from axisbus.cell.quantities import units_of
from axisbus.check.context import Check, CheckContext, Problems, own_title
from axisbus.cia402 import objects


def disagreement(case: CheckContext) -> Problems:
    """Check each scale against 608Fh and 6091h of the EDS, as ``boot`` does with the drive's values.

    A 608Fh of 1 increment per turn is no information and is skipped.
    """
    for drive in case.drives:
        axis = drive.axis
        if axis.scale is None or not axis.at.sound("unit", "scale"):
            continue
        values = {(index, sub): drive.number(index, sub) for index, sub in scale_proposal.OBJECTS}
        if values[objects.ENCODER_RESOLUTION, 1] == values[objects.ENCODER_RESOLUTION, 2]:
            continue
        found = scale_proposal.compare(units_of(axis).position, values)
        if found.agrees is False:
            yield case.warning(
                axis.at.of("scale"),
                f"the scale of axis {axis.name} differs from the objects of its drive",
                f"{found.configured}; {found.proposed}, by {own_title(drive, objects.ENCODER_RESOLUTION)} and "
                f"{own_title(drive, objects.GEAR_RATIO)}",
                "correct scale (or unit), or the objects; axisbus boot compares it with the drive's own values",
            )


def other_units(case: CheckContext) -> Problems:
    """Check velocity and acceleration scales against the drive's units; an error if the conflict is certain."""
    for drive in case.drives:
        axis = drive.axis
        if not axis.at.sound("unit", "scale", "velocity_scale", "acceleration_scale"):
            continue
        values = {(index, sub): drive.number(index, sub) for index, sub in scale_proposal.OBJECTS}
        for found in scale_proposal.contradictions(axis, values):
            report = case.error if found.is_certain else case.warning
            at = axis.at.of(found.key) if axis.at.gives(found.key) else axis.at.of("unit")
            yield report(at, found.message, found.observed, found.remedy)


CHECKS: tuple[Check, ...] = (disagreement, other_units)
