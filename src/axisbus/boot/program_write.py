"""Write the program (firmware) of a node by command, with the objects of CiA 302-3; energises nothing.

Theory of operation
-------------------
The program is replaced as at boot-up (``cia302.program_download``): stop, clear, transfer, start. Each run begins with stop and
clear. So a run after an interruption, or after the node has lost its supply, needs nothing from the run before: the node answers
from its boot loader, which reports *stopped* or *cleared* in 1F51h, and the write begins again.
"""

from __future__ import annotations

from axisbus.boot.comms import NodeServices
from axisbus.boot.objects import Progress
from axisbus.boot.program_facts import ProgramOrder, ProgramWritten, read_programs, require_writable
from axisbus.boot.program_text import write_failed
from axisbus.boot.requests import Answerer
from axisbus.bus.node.node import CanopenNode
from axisbus.cia302.program_download import write_program as dialogue
from axisbus.configuration.preconditions import require_not_energised


def write_program(node: CanopenNode, order: ProgramOrder, progress: Progress | None = None) -> ProgramWritten:
    """Replace the first program of a node, whose drives must not be energised; blocks for minutes.

    ``progress`` is called in this thread with the bytes that the node has confirmed.

    Raises:
        StateError: its program cannot be written over CANopen, or one of its drives is energised; nothing was sent.
        NodeError: the write has failed; the node cannot be used until a write has succeeded, unless the error says otherwise.
        SdoTimeout, AdapterError: the node did not answer before the write began; the channel failed.
    """
    before = read_programs(node.node_id, node.sdo)
    require_writable(before)
    require_not_energised(node)
    answerer = Answerer(node.sdo, NodeServices(node), {}, progress)
    outcome = answerer.run(dialogue(node.node_id, order.node_program))
    if not outcome.ok:
        raise write_failed(outcome, answerer.error)
    after = read_programs(node.node_id, node.sdo)
    return ProgramWritten(before, after, len(order.data), outcome.retries)
