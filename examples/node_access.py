"""Direct access to a device beside its axes: objects by name or number, NMT state, emergency messages, PDOs."""

from pathlib import Path

from axisbus import Machine

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    node = cell.node(1)
    print("device name:", node.sdo[0x1008])
    print("vendor:", hex(node.sdo[0x1018, 1]))
    print("supply:", node.sdo["DC link circuit voltage"], "mV")
    node.sdo["Position window"] = 50  # checked against type and limits before it is sent
    print("position window:", node.sdo[0x6067])
    print("NMT state:", node.nmt.text)
    print("emergency messages:", len(node.emcy))
    print("\n".join(node.pdos()))
