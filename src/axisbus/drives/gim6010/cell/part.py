"""The part of the plug-in that reads and describes the modules of a cell."""

from __future__ import annotations

from axisbus.cell.other_protocols import CellPart
from axisbus.drives.gim6010.can_simple.coexistence import commands_to, sent_by
from axisbus.drives.gim6010.cell.module import CAN_SIMPLE, MODBUS, READERS, WORDS, ModuleConfig
from axisbus.drives.gim6010.cell.modules import (
    descriptions,
    line_options,
    module_frames,
    module_parameters,
    no_objects,
    no_virtual_time,
)
from axisbus.toml.tables import CellKey

PART = CellPart(
    keys={key: CellKey(*each) for key, each in READERS.items()},
    descriptions=WORDS,
    tables={
        CAN_SIMPLE: "Properties that a module with CAN Simple does not report.",
        MODBUS: "The same for a module on RS485: as [nodes.N.can_simple], with endpoints, without filter; torques for the mode tq.",
    },
    settings=lambda protocol, fields: ModuleConfig(**fields, protocol=protocol),
    dictionaries=descriptions,
    parameters=module_parameters,
    frames=module_frames,
    sent_by=sent_by,
    commands_to=commands_to,
    adapter_options=line_options,
    no_objects=no_objects,
    no_virtual_time=no_virtual_time,
)
