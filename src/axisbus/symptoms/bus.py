"""Symptoms of the bus: adapter, wiring, other masters, and nodes that do not answer."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

SYMPTOMS = (
    Symptom(
        name="adapter",
        title="The CAN adapter cannot be used",
        seen="The adapter cannot be opened, accepts no frames, or has stopped receiving. The master knows nothing "
        "about the drives on this adapter. Only the drives' own watchdogs stop axes that were enabled.",
        checks=(
            "Is the adapter plugged in, and is its driver loaded? On Linux `ip -details link show can0` shows the "
            "link, its state and its bit rate.",
            "Is the adapter correct in the cell file? `axisbus check CELL` compares interface, channel and bit rate. "
            "The message lists the interfaces that python-can knows.",
            "Does another program use the adapter? Most adapters serve one program at a time.",
            "The adapter is open, but accepts no frames: no device on the bus acknowledges them. Check that a drive "
            "has power, a cable and terminators (60 Ω between the two wires), and check the bit rate.",
            "The adapter is blocked, or was unplugged: plug it in again. `axisbus boot CELL --reconnect` lets a machine "
            "that runs open it again.",
        ),
        errors=("AdapterError", "TransmitQueueFull"),
        read_on=("cell-file.md#bus", "commissioning.md#1-the-adapter"),
    ),
    Symptom(
        name="bus-off",
        title="The bus is disturbed: bus-off, error passive, lost frames",
        seen="A CAN controller counts errors on the bus until it becomes error passive. If there are more errors, it "
        "leaves the bus: bus-off (ISO 11898-1). From then on axisbus sends nothing to the adapter. When the bus "
        "returns, no axis moves until it gets a new command.",
        checks=(
            "Make sure that the axes are at standstill: during bus-off only the drives' own watchdogs can stop them.",
            "Check the wiring: two terminators of 120 Ω, so 60 Ω in total; no long stubs; shield and ground; no "
            "motor cables near the bus cable.",
            "Do all nodes have the same bit rate? One node with a wrong bit rate destroys the frames of all nodes.",
            "`axisbus load CELL` shows the load of the bus, and the error counters if the driver reports them. "
            "`axisbus trace CELL --errors-only` shows other protocol errors.",
            "On Linux `sudo ip link set can0 type can restart` restarts the controller. With `restart-ms` in the "
            "configuration of the link, the controller restarts automatically.",
            "Then reset each axis: `axisbus reset CELL`. If nodes have restarted, boot the cell again.",
        ),
        errors=("BusOff",),
        faults=("8110", "8120", "8140"),
        read_on=("stopping.md#bus-off",),
    ),
    Symptom(
        name="second-master",
        title="Another master is on the bus",
        seen="axisbus listens before it sends its first frame. It received frames that only a master or a tool sends, "
        "or another program on this computer has the channel. In these cases axisbus has sent nothing. If such frames "
        "arrived while a machine was running, the machine has stopped the axes that the frames command. Two masters "
        "send conflicting commands to the same drives.",
        checks=(
            "The message names the frames or the program. End that program or tool, or disconnect it. A commissioning "
            "tool is also a master.",
            "Is the other master axisbus itself? `axisbus monitor CELL` joins a running machine, and `axisbus stop "
            "CELL` stops it from outside.",
            "`axisbus trace CELL --seconds 5` shows which frames are sent. It sends nothing itself.",
            "A PLC that only reads may use SDO, and axisbus takes SDO requests for those of a master. If you know that "
            "the PLC commands nothing, open the bus beside it: `axisbus boot CELL --beside`.",
        ),
        errors=("SecondMasterError",),
        faults=("8150",),
        read_on=("commissioning.md#rules-for-all-commands", "programs.md"),
    ),
    Symptom(
        name="no-answer",
        title="A node does not answer",
        seen="A node did not answer a request, although the request was repeated. The node has no power, is not on this "
        "bus, has another node-ID or bit rate, or uses another protocol. The motion of its motor is "
        "unknown.",
        checks=(
            "`axisbus scan CELL` asks all 127 node-IDs. It also listens at other bit rates if the adapter can do so "
            "without disturbing the bus.",
            "No node answers: check the supply, both wires, the 60 Ω between them, and the bit rate.",
            "The other nodes answer: check the supply and the plug of this node, and its node-ID (switches, or "
            "`axisbus lss find CELL` if it has none).",
            "It answers sometimes: `axisbus load CELL` shows the load of the bus, `axisbus trace CELL --errors-only` "
            "shows lost frames. A drive that stores its parameters or restarts is silent for seconds.",
        ),
        errors=("NodeTimeout", "SdoTimeout"),
        letters="B",
        aborts=(0x05030000, 0x05040000, 0x05040001, 0x05040002, 0x05040003, 0x05040004),
        read_on=("commissioning.md#3-nodes-on-the-bus",),
    ),
    Symptom(
        name="node-lost",
        title="A node is lost",
        seen="A node that was present is silent, has restarted, or has left *operational* without a command. The master "
        "has commanded its axes to stop. It does not know the reaction of the node's own watchdog. Depending on "
        "`on_lost_node`, the master has also stopped the node's group or the whole cell.",
        checks=(
            "Make sure that the axes of the node are at standstill.",
            "Check its supply: a voltage drop while axes accelerate or brake can restart a drive. Check its plug, also "
            "while the axis moves.",
            "Its emergency messages say why it left *operational*: `axisbus monitor CELL`. 8130h means that the node "
            "missed the heartbeat of the master: the computer was busy, or the time in 1016h is too short.",
            "Did this program run all the time? A debugger, a suspended computer or a long call that blocks all threads "
            "can stop the program. The message then says so.",
            "Heartbeats are lost on a full or disturbed bus: `axisbus load CELL`, `axisbus trace CELL --errors-only`.",
            "If the node is present again (`axisbus scan CELL`) and has not restarted, start it (`axisbus nmt start NODE "
            "--cell CELL`). Then reset its axes (`axisbus reset CELL AXIS`). `axis.reset()` alone is rejected, and the "
            "error names the missing step.",
            "If the node has restarted, its configuration is lost. Boot it while the machine runs (`axisbus boot CELL --node "
            "NODE`; in a program: `machine.node(NODE).boot()`), then reset its axes. Nothing is enabled by that.",
        ),
        errors=("NodeError", "NodeStateError"),
        letters="EFK",
        faults=("8130",),
        read_on=(
            "stopping.md#after-an-emergency-stop",
            "stopping.md#which-other-axes-stop",
            "stopping.md#when-the-master-dies",
        ),
    ),
    Symptom(
        name="duplicate-node-id",
        title="Two devices have the same node-ID",
        seen="The master received a boot-up message from a node-ID whose drive did not restart, or two NMT states "
        "alternate under one node-ID. Each command reaches both devices, and an answer may come from either of them. "
        "The master has stopped the axes of the node by every path. If only the other device may have confirmed a "
        "stop, the stop is reported as not confirmed.",
        checks=(
            "Make sure that the axes of the node are at standstill.",
            "Which device was added, replaced or reset last? Disconnect it, and check its switches.",
            "While one of them is disconnected, `axisbus scan CELL` shows the other. Give one of them another node-ID, "
            "by its switches or by LSS.",
            "A gateway, a simulation or a tool may send frames in the name of the node: `axisbus trace CELL "
            "--seconds 5`.",
            "Then boot the cell again.",
        ),
        errors=("DuplicateNodeError",),
        read_on=("stopping.md#how-a-stop-reaches-the-drive", "commissioning.md#3-nodes-on-the-bus"),
    ),
    Symptom(
        name="not-operational",
        title="A node answers, but does not change its NMT state",
        seen="The node reports an NMT state that differs from the commanded one. It does not follow the command, or "
        "another master or tool commands another state.",
        checks=(
            "Does an error keep the node in its state? Read its emergency messages (`axisbus monitor CELL --listen`) "
            "and its list of errors (`axisbus od read --cell CELL NODE:1003:1`). 1029h defines which NMT state an error "
            "causes.",
            "Does another master or tool command the node? `axisbus trace CELL --seconds 5` shows NMT commands from "
            "other senders.",
            "Reset the node. This restarts it: `axisbus nmt reset-node NODE --cell CELL`.",
        ),
        errors=("NodeRefused",),
        read_on=("commissioning.md#during-operation",),
    ),
    Symptom(
        name="no-sync",
        title="SYNC is missing, or has another period",
        seen="In the cell file another device sends SYNC (`sync_producer` is external). SYNC is missing, or its period "
        "differs from `scan_period`. The master has stopped every axis by SDO, which needs no SYNC.",
        checks=(
            "`axisbus trace CELL --seconds 2` shows whether SYNC is sent, and with which identifier.",
            "Start its producer: bit 30 of 1005h, and the period in 1006h.",
            "Set `scan_period` and `sync_cob_id` in the cell file to the values of the producer.",
            "If no other device is intended to send SYNC, set `sync_producer` to master, or leave it out.",
        ),
        errors=("SyncError",),
        read_on=("cell-file.md#bus",),
    ),
    Symptom(
        name="lss",
        title="A node does not accept a node-ID or a bit rate by LSS",
        seen="A layer setting service (CiA 305) failed: no slave answered, several slaves answered instead of one, or "
        "the slave refused.",
        checks=(
            "`axisbus lss find CELL` shows slaves without a node-ID. If it shows none, all slaves have a node-ID, do "
            "not support fast scan, or listen at another bit rate.",
            "Two slaves with the same identity cannot be distinguished: connect one at a time.",
            "A slave that refuses sends an error code, and the message explains it. Many drives store the setting only "
            "if a switch or their own tool permits it.",
            "A second LSS master, such as the manufacturer's tool, disturbs the service: end it.",
            "If the slaves are slow, raise `--timeout`.",
        ),
        errors=("LssError", "LssRefused", "LssTimeout"),
        read_on=("commissioning.md#2-nodes-without-a-node-id",),
    ),
    Symptom(
        name="late-cycles",
        title="Cycles are late, or skipped",
        seen="Targets and SYNC must be sent once in each `scan_period`. The computer was busy, or the load of the bus was "
        "too high. Cycles were late or were skipped, and a drive may have missed its process data.",
        checks=(
            "`axisbus jitter CELL --for 10s` measures SYNC against its period, and the time that each node takes to "
            "answer it.",
            "`axisbus monitor CELL` counts the skipped cycles. `lateness` of a machine gives the reason for the last "
            "late cycle.",
            "`axisbus plan CELL` shows the shortest `scan_period` that fits the bus, and `axisbus load CELL` the load "
            "of the bus.",
            "Use a longer `scan_period`, map fewer objects, or raise the bit rate.",
            "Keep the computer free: real-time priority if the system permits it, no energy saving, and no other "
            "program that uses all processors. No program can delay a core that has a process of its own (`process`).",
        ),
        faults=("825x", "8700"),
        read_on=("stopping.md#the-core-process", "decisions/cycle.md"),
    ),
    Symptom(
        name="scan-ended",
        title="The machine has ended: its cyclic scan was aborted",
        seen="The machine controls no axis any more. Unless the adapter was the cause, it can only be closed. If it was "
        "possible, the master sent a quick stop to every drive that it had commanded. The message says whether it did.",
        checks=(
            "Make sure that every axis is at standstill: `axisbus stop CELL` stops drives from outside.",
            "The message names the first cause: a lost adapter, a missing SYNC, an exception in a callback of the "
            "program, a computer that had no time, or a process that was ended.",
            "The journal of the cell in `~/.local/state/axisbus` records the actions of a core process, and how it "
            "left each drive.",
            "If the adapter was lost: `axisbus boot CELL --reconnect` opens it again, and boots the nodes.",
            "Otherwise remove the cause, then open the machine again. This enables no axis.",
        ),
        errors=("ScanError", "BusError"),
        read_on=("stopping.md#automatic-stops", "stopping.md#the-core-process"),
    ),
)
