"""Changes a module's node ID over Modbus: the new ID must be unused, and the module must answer under it before it is saved."""

from __future__ import annotations

from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.registers import named
from axisbus.errors import NodeError, NodeTimeout, StateError

_NODE_ID = named("node_id")


def set_node_id(module: ModbusModule, new: int, *, save: bool = True) -> ModbusModule:
    """Change a module's node ID to ``new`` (1 to 63), and return the module under its new address; blocks.

    If this is interrupted before saving, the module has the new ID until it is switched off, and the old one afterwards.

    Raises:
        ArgumentError, LimitError: the ID is invalid. StateError: the module is not idle, or a module already answers to ``new``.
        NodeError: no answer, or it does not accept the ID.
    """
    request = requests.write(_NODE_ID, new)
    moved = ModbusModule(module.wire, new)
    if new == module.device:
        raise StateError(f"the module already has the node ID {new}", remedy="give another one")
    module.require_idle("its node ID is written")
    if moved.answers():
        raise StateError(
            f"another module on this line already answers to node ID {new}; nothing was written",
            remedy="give an ID that is free",
        )
    module.dialogue.write(request)
    found = _found(module, moved, new)
    if not save:
        return found
    found.save_and_leave()
    return _saved(module, moved, new)


def _found(module: ModbusModule, moved: ModbusModule, new: int) -> ModbusModule:
    """Return the module under the address at which it answers with the new ID in its register."""
    for each in (moved, module):
        if each.answers() and int(each.read(_NODE_ID.name)) == new:
            return each
    raise NodeError(
        f"module {module.device} does not accept node ID {new}",
        node=module.device,
        observed="neither with the new ID nor with the old one does a module confirm the new ID",
        remedy="ask for both: axisbus gim6010 modbus state --node ...; switched off and on, it has the old one again",
    )


def _saved(module: ModbusModule, moved: ModbusModule, new: int) -> ModbusModule:
    """Return the module under its new address once it answers there."""
    try:
        moved.wait_back()
    except NodeTimeout as error:
        raise NodeTimeout(
            f"module {module.device} does not answer to node ID {new} after it was saved",
            node=new,
            observed=f"a module answers with {module.device}" if module.answers() else error.observed,
            remedy="switch it off and on, and ask for both IDs",
        ) from error
    return moved
