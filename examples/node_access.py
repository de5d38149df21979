"""Access a node directly: objects by name or index, NMT state, emergency messages, PDO mapping."""

from pathlib import Path

from axisbus import Machine

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    node = cell.node(1)
    print("device name:", node.sdo[0x1008])
    print("vendor:", hex(node.sdo[0x1018, 1]))
    print("supply:", node.sdo["DC link circuit voltage"], "mV")
    node.sdo["Position window"] = 50  # the master checks data type and limits before it sends the value
    print("position window:", node.sdo[0x6067])
    print("NMT state:", node.nmt.text)
    print("emergency messages:", len(node.emcy))
    print("\n".join(node.pdos()))
