"""The heartbeat in its three layouts (manual 4.1.2)."""

from __future__ import annotations

from axisbus.sim.can_simple.axis import ModuleAxis
from axisbus.sim.can_simple.fault_injection import ModuleDials
from axisbus.sim.can_simple.firmware import OLD_HEARTBEAT, SYSTEM_FLAG, Firmware


def heartbeat(axis: ModuleAxis, firmware: Firmware, dials: ModuleDials, life: int) -> bytes:
    """Return the 8 bytes of a heartbeat; ``life`` is the life counter."""
    head = int(axis.error).to_bytes(4, "little") + bytes([axis.state & 0xFF])
    faults = [bool(axis.motor_error), bool(axis.encoder_error), bool(axis.controller_error)]
    if firmware >= SYSTEM_FLAG:
        faults.append(bool(axis.system_error))
    bits = [fault != dials.flags_inverted for fault in faults]
    done = axis.controller.trajectory_done
    if firmware <= OLD_HEARTBEAT:
        motor, encoder, controller = bits
        return head + bytes([motor, encoder, controller | done << dials.done_bit])
    flags = sum(bit << place for place, bit in enumerate(bits)) | done << 7
    return head + bytes([flags, 0, life & 0xFF])
