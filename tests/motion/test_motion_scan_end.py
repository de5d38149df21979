"""The end of the scan ends every command of an axis in any phase, with the scan's own reason."""

from __future__ import annotations

from axisbus.errors import ScanError
from kit.motion.rig import rig


def test_all_commands_of_an_axis_end(recwarn):
    made = rig().enabled()
    made.axis.move_absolute(500.0, velocity=50.0)
    made.run(0.5)
    handles = [made.axis.halt(), made.axis.stop(), made.axis.disable()]
    made.run(0.02)
    assert all(handle.busy for handle in handles)
    made.core.abandon(lambda name: ScanError(f"{name}: the scan has ended"))
    assert [str(handle.exception()).splitlines()[0] for handle in handles] == [
        f"{handle.name}: the scan has ended" for handle in handles
    ]
