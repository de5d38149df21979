"""Symptoms of the bus: adapter, wire, other masters, and nodes that are not heard."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

SYMPTOMS = (
    Symptom(
        name="adapter",
        title="The CAN adapter cannot be used",
        seen="The adapter cannot be opened, takes no frames, or stopped receiving. Nothing is known of the drives "
        "by it; where axes were enabled, only the drives' own watchdogs stop them.",
        checks=(
            "Is the adapter plugged in, and is its driver loaded? On Linux `ip -details link show can0` shows the "
            "link, its state and its bit rate.",
            "Does the cell file name it rightly? `axisbus check CELL` compares interface, channel and bit rate; the "
            "message lists the interfaces that python-can knows.",
            "Has another program the adapter? Most adapters serve one at a time.",
            "It is refused frames although it is open: nobody on the bus acknowledges. Check that a drive has "
            "power, cable and terminators (60 Ω between the two wires), and the bit rate.",
            "It is stuck: pull it out, plug it in again, and open the machine again.",
        ),
        errors=("AdapterError", "TransmitQueueFull"),
        read_on=("cell-file.md#bus", "commissioning.md#1-the-adapter"),
    ),
    Symptom(
        name="bus-off",
        title="The bus is disturbed: bus-off, error passive, lost frames",
        seen="A controller counts errors on the wire until it is passive, and then leaves the bus (ISO 11898-1). "
        "From then on axisbus gives nothing to the adapter; nothing moves by itself when the bus is back.",
        checks=(
            "Make sure that the axes stand: only the drives' own watchdogs can stop them meanwhile.",
            "Check the wire: two terminators of 120 Ω, so 60 Ω in all; no stubs that are long; shield and ground; "
            "motor cables away from it.",
            "Have all nodes the same bit rate? A single wrong one destroys the frames of all.",
            "`axisbus load CELL` shows the error counters where the driver tells them, and how full the bus is; "
            "`axisbus trace CELL --errors-only` shows what else is against the protocol.",
            "On Linux `sudo ip link set can0 type can restart` brings the controller back; `restart-ms` in the link "
            "does so by itself.",
            "Then reset each axis: `axisbus reset CELL`; where nodes have restarted, boot the cell again.",
        ),
        errors=("BusOff",),
        faults=("8110", "8120", "8140"),
        read_on=("stopping.md#bus-off",),
    ),
    Symptom(
        name="second-master",
        title="Another master is on the bus",
        seen="Before its first frame axisbus listens. It heard frames that only a master or a tool sends, or "
        "another program of this computer has the channel; nothing was sent. Or such frames came while a machine "
        "ran: it stopped the axes that they command. Two masters command the same drives against each other.",
        checks=(
            "The message says what was heard. End that program or tool, or disconnect it: a commissioning tool "
            "counts as a master, too.",
            "Is it axisbus itself? `axisbus monitor CELL` joins a machine that runs, `axisbus stop CELL` stops it "
            "from beside.",
            "`axisbus trace CELL --seconds 5` shows who sends what, and sends nothing itself.",
            "A PLC that only reads may use SDO: that counts as a master's sign. Where you know that it commands "
            "nothing, `axisbus boot CELL --beside` opens the bus beside it.",
        ),
        errors=("SecondMasterError",),
        faults=("8150",),
        read_on=("commissioning.md#what-holds-for-every-command", "programs.md"),
    ),
    Symptom(
        name="no-answer",
        title="A node does not answer",
        seen="A request to a node stayed without its answer, however often it was repeated: it has no power, is "
        "not on this wire, has another node-ID or bit rate, or speaks another protocol. Nothing is known of "
        "what its motor does.",
        checks=(
            "`axisbus scan CELL` asks all 127 node-IDs, and listens at other bit rates where the adapter can do so "
            "without disturbing.",
            "Nobody answers: supply, both wires, 60 Ω between them, bit rate.",
            "The others answer: this node's supply and plug; its node-ID (switches, or `axisbus lss find CELL` "
            "where it has none).",
            "A GIM6010-8 speaks CAN Simple as it leaves its factory: `axisbus gim6010 find -i socketcan -c can0`.",
            "It answers now and then: `axisbus load CELL` says how full the bus is, `axisbus trace CELL "
            "--errors-only` what is lost. A drive that stores its parameters or restarts is silent for seconds.",
        ),
        errors=("NodeTimeout", "SdoTimeout"),
        letters="B",
        aborts=(0x05030000, 0x05040000, 0x05040001, 0x05040002, 0x05040003, 0x05040004),
        read_on=("commissioning.md#3-who-is-there", "gim6010-8.md#finding-modules"),
    ),
    Symptom(
        name="node-lost",
        title="A node is lost",
        seen="A node that was there is silent, has restarted, or has left operational by itself. Its axes were "
        "told to stop; what its own watchdog does is its own affair. By `on_lost_node` its group or the whole "
        "cell was stopped, too.",
        checks=(
            "Make sure that its axes stand.",
            "Its supply: a supply that drops when axes accelerate or brake restarts a drive. Its plug, in motion as "
            "well.",
            "Its emergency messages tell why it left operational: `axisbus monitor CELL`. 8130h means that it "
            "missed our heartbeat: the computer was busy, or its time of 1016h is short.",
            "Did this program run all the time? A debugger, a suspended computer or a long call that lets no thread "
            "run starves it; the message then says so.",
            "A full or disturbed bus loses heartbeats: `axisbus load CELL`, `axisbus trace CELL --errors-only`.",
            "It is there again (`axisbus scan CELL`) and has not restarted: start it (`axisbus nmt start NODE --cell CELL`), "
            "then reset its axes (`axisbus reset CELL AXIS`). `axis.reset()` alone is refused, and names the missing step.",
            "It has restarted: its configuration is lost. End the program that has the machine (`axisbus run CELL`), "
            "and start it again: the boot configures the node.",
        ),
        errors=("NodeError", "NodeStateError"),
        letters="EFK",
        faults=("8130",),
        read_on=("stopping.md#who-else-stops", "stopping.md#when-the-master-dies"),
    ),
    Symptom(
        name="duplicate-node-id",
        title="Two devices have the same node-ID",
        seen="A boot-up message came from a node-ID whose drive did not restart, or two NMT states are reported in turn "
        "under one node-ID. Each command reaches both devices, and an answer may come from either. The axes of "
        "the node were stopped by every path; a stop that only the other device may have confirmed is reported as not confirmed.",
        checks=(
            "Make sure that its axes are at standstill.",
            "Which device was added, replaced or reset last? Disconnect it, and look at its switches.",
            "With one of them disconnected, `axisbus scan CELL` shows the other. Give one of them a node-ID of its "
            "own: by its switches, or by LSS.",
            "A gateway, a simulation or a tool may send frames in the name of the node: `axisbus trace CELL "
            "--seconds 5`.",
            "Then boot the cell again.",
        ),
        errors=("DuplicateNodeError",),
        read_on=("stopping.md#what-each-stop-reaches", "commissioning.md#3-who-is-there"),
    ),
    Symptom(
        name="not-operational",
        title="A node is there, and does not take the NMT state",
        seen="The node reports its state, and it is not the one that it was told to take: it is told in vain, or "
        "somebody else tells it otherwise.",
        checks=(
            "It has an error that keeps it there: its emergency messages (`axisbus monitor CELL --listen`), its "
            "list of errors (`axisbus od read --cell CELL NODE:1003:1`), and 1029h, which says what an error does "
            "to its state.",
            "Another master or tool commands it: `axisbus trace CELL --seconds 5` shows NMT commands that are not "
            "ours.",
            "Reset the node, which restarts it: `axisbus nmt reset-node NODE --cell CELL`.",
        ),
        errors=("NodeRefused",),
        read_on=("commissioning.md#while-it-runs",),
    ),
    Symptom(
        name="no-sync",
        title="SYNC is missing, or comes at another pace",
        seen="The cell file says that another device sends SYNC (`sync_producer` is external), and it is missing "
        "or has another period than `scan_period`. Every axis was stopped by SDO, which needs no SYNC.",
        checks=(
            "`axisbus trace CELL --seconds 2` shows whether SYNC is there, and on which identifier.",
            "Start its producer: 1005h bit 30 and the period in 1006h.",
            "Give `scan_period` and `sync_cob_id` in the cell file the values that it has.",
            "No other device is to send it? Then `sync_producer` is master, or left out.",
        ),
        errors=("SyncError",),
        read_on=("cell-file.md#bus",),
    ),
    Symptom(
        name="lss",
        title="A node does not take a node-ID or a bit rate over LSS",
        seen="A layer setting service (CiA 305) failed: no slave answered, several did where one was meant, or it "
        "refused.",
        checks=(
            "`axisbus lss find CELL` shows slaves without a node-ID. Nobody: all have one, have no fast scan, or "
            "listen at another bit rate.",
            "Two slaves with one identity cannot be told apart: connect one at a time.",
            "A slave that refuses tells an error code: the message has it in words. Many drives store only where it "
            "is allowed by a switch or in their own tool.",
            "A second LSS master, such as the maker's tool, disturbs: end it.",
            "Slow slaves: raise `--timeout`.",
        ),
        errors=("LssError", "LssRefused", "LssTimeout"),
        read_on=("commissioning.md#2-nodes-without-a-node-id",),
    ),
    Symptom(
        name="late-cycles",
        title="Cycles are late, or left out",
        seen="Targets and SYNC are to go out once in each `scan_period`. The computer was busy, or the bus too "
        "full: cycles came late or were skipped, and a drive may have missed its process data.",
        checks=(
            "`axisbus jitter CELL --for 10s` measures SYNC against its period, and the answers of each node after "
            "it.",
            "`axisbus monitor CELL` counts the skipped cycles; `lateness` of a machine says why the last one was "
            "late.",
            "`axisbus plan CELL` tells the shortest `scan_period` that fits the bus, `axisbus load CELL` how full "
            "it is.",
            "Choose a longer `scan_period`; map fewer objects; raise the bit rate.",
            "Keep the computer free: real-time priority where the system permits it, no energy saving, nothing else "
            "that takes all processors. A core in a process of its own (`process`) is kept waiting by no program.",
        ),
        faults=("825x", "8700"),
        read_on=("stopping.md#a-core-in-a-process-of-its-own", "decisions/cycle.md"),
    ),
    Symptom(
        name="scan-ended",
        title="The machine has ended: its cyclic scan broke off",
        seen="Nothing moves under the control of this machine any more; it can only be closed. A quick stop was "
        "sent to every drive that it had commanded, where that was possible: the message says so.",
        checks=(
            "Make sure that every axis stands: `axisbus stop CELL` stops drives from beside.",
            "The message names the first cause: an adapter that is gone, a SYNC that is missing, a callback of the "
            "program that raised, a computer that had no time, or a process that was ended.",
            "What a core in a process of its own did, and how it left each drive, stands in the cell's journal in "
            "`~/.local/state/axisbus`.",
            "Mend the cause, then open the machine again. Nothing is enabled by that.",
        ),
        errors=("ScanError", "BusError"),
        read_on=("stopping.md#what-axisbus-stops-by-itself", "stopping.md#a-core-in-a-process-of-its-own"),
    ),
)
