"""Boot-ups of a cell whose wire loses frames at random: ``python tests/lossy_boot.py [boot-ups] [nodes] [loss in %]``.

Prints each boot-up that failed and how many succeeded; 50 boot-ups of 16 nodes with 2 % without arguments.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

from axisbus import eds
from axisbus.boot.report import NodeReport
from axisbus.eds.builtin import resolve
from axisbus.machine.opening import boot
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from kit.lossy_line import LossyLine

EDS = "builtin:generic-cia402"
BUS = '[bus]\ninterface = "virtual"\nchannel = "{channel}"\nscan_period = "10ms"\nheartbeat = "100ms"\n'
NODE = '[nodes.{node}]\neds = "{eds}"\n[nodes.{node}.objects]\n"6065" = 3000\n'
AXIS = '[axes.a{node}]\nnode = {node}\nunit = "deg"\nscale = 100\n'


def boot_once(folder: Path, nodes: int, loss: float, seed: int) -> tuple[list[NodeReport], LossyLine]:
    """Power ``nodes`` simulated drives on, boot them over a wire that loses frames, and return the reports."""
    near, far = (f"axisbus-lossy-{end}-{os.getpid()}-{seed}" for end in ("near", "far"))
    cell = folder / "cell.toml"
    text = BUS.format(channel=near)
    text += "".join((NODE + AXIS).format(node=node, eds=EDS) for node in range(1, nodes + 1))
    cell.write_text(text, encoding="utf-8")
    described = eds.load(resolve(EDS, folder))
    devices = [device_from_eds(described, node, seed=node) for node in range(1, nodes + 1)]
    with LossyLine(near, far, loss, seed) as line, SimulatedNetwork(far, devices):
        return boot(cell), line


def main() -> int:
    """Boot again and again."""
    boots, nodes, percent = [float(text) for text in (*sys.argv[1:], *("50", "16", "2")[len(sys.argv) - 1 :])]
    good = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(1, int(boots) + 1):
            start = time.monotonic()
            reports, line = boot_once(Path(folder), int(nodes), percent / 100, number)
            failed = [report for report in reports if not report.ok]
            good += not failed
            again = sum(report.outcome.retries for report in reports if report.outcome is not None)
            print(
                f"boot-up {number}: {len(reports) - len(failed)} of {len(reports)} nodes, {time.monotonic() - start:.1f} s, "
                f"{line.lost} of {line.lost + line.carried} frames lost, {again} requests repeated",
                flush=True,
            )
            for report in failed:
                print(report.text(), flush=True)
    print(f"{good} boot-ups of {int(boots)} succeeded")
    return 0 if good == boots else 1


if __name__ == "__main__":
    sys.exit(main())
