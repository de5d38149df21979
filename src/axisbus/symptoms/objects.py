"""Symptoms of a node's objects: boot-up, configuration, SDO and process data; and of the files that describe them."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

SYMPTOMS = (
    Symptom(
        name="does-not-boot",
        title="A node does not come up",
        seen="A node is booted by CiA 302-2: looked for, identified, configured, watched, started. The report of "
        "`axisbus boot CELL` says at which step it ended, at which object, what was expected and what came. The "
        "other nodes are looked at all the same; nothing is energised.",
        checks=(
            "`axisbus boot CELL` tells step, object and letter. Many letters have a page of their own: `axisbus "
            "explain J`.",
            "An object could not be set: the report says who asked for it. Take it out of the cell file, or give it "
            "a value that the drive takes.",
            "A value reads back as another one: the drive limits or rounds it.",
            "Is the EDS that of this firmware? `axisbus eds verify FILE NODE --cell CELL` compares it with the node.",
            "The drive takes its configuration only while it is pre-operational, or not while it is energised: "
            "`axisbus nmt reset-node NODE --cell CELL`, then boot again.",
        ),
        errors=("BootError",),
        letters="JL",
        read_on=("commissioning.md#6-boot", "cell-file.md#nodesn"),
    ),
    Symptom(
        name="another-device",
        title="A node is another device than the cell file says",
        seen="Device type, vendor, product, revision or serial number (1000h, 1018h) differ from what the cell "
        "file or its EDS expects, or nobody has listed the node. It was not configured.",
        checks=(
            "`axisbus scan CELL` says who is at this node-ID. Are two drives exchanged, or was one replaced?",
            "It was replaced by one of the same kind: correct `serial` in `[nodes.N]`, or leave it out.",
            "It has another firmware: take the EDS of that firmware. `revision` in `[nodes.N]` says which one is "
            "wanted.",
            "Its EDS is of a sibling: `axisbus eds verify FILE NODE --cell CELL` tells what else differs.",
        ),
        letters="ACDMNO",
        read_on=("cell-file.md#nodesn", "commissioning.md#6-boot"),
    ),
    Symptom(
        name="wrong-program",
        title="A node has another program than expected",
        seen="The cell file says which program (firmware) the node must have (`[nodes.N.program]`), and it has "
        "another, which may not be replaced; or its download failed. A node whose download broke off stays in "
        "its boot loader.",
        checks=(
            "The report of `axisbus boot CELL` has the date or the number that was expected, and the one that came.",
            "Take the file of this very device, and write its date or number into `[nodes.N.program]`.",
            "Keep supply and cable still, and boot again: a download that broke off is begun anew.",
            "It stays in its boot loader: the maker's own tool brings it back.",
        ),
        letters="GHI",
        read_on=("cell-file.md#nodesnprogram",),
    ),
    Symptom(
        name="object-refused",
        title="A drive refuses to read or write an object",
        seen="The drive answered an SDO request by an abort code: it will not do it, not now, or not in this way. "
        "Its other objects are as they were.",
        checks=(
            "The message names the object and the code in words; `axisbus explain 0x06010002` finds the page of a "
            "code.",
            "Not in this state: disable the axis, or bring the node to pre-operational (`axisbus nmt "
            "pre-operational NODE --cell CELL`). Under local control (keypad, the maker's tool) a drive refuses the "
            "bus.",
            "Read-only, write-only, protected: see the drive's manual. The EDS may say otherwise: `axisbus eds "
            "verify FILE NODE --cell CELL`.",
            "An error of the device itself (hardware, memory): read its errors, `axisbus od read --cell CELL "
            "NODE:1003:1`.",
        ),
        errors=("SdoError", "SdoAbort"),
        aborts=(
            *(0x05040005, 0x06010000, 0x06010001, 0x06010002, 0x06040047, 0x06060000, 0x060A0023, 0x08000000),
            *(0x08000020, 0x08000021, 0x08000022, 0x08000024),
        ),
        read_on=("commissioning.md#while-it-runs",),
    ),
    Symptom(
        name="object-missing",
        title="A drive does not have an object",
        seen="The object or sub-index that was asked for is not in the drive's dictionary. Mostly the EDS "
        "describes another firmware than the drive has.",
        checks=(
            "`axisbus eds verify FILE NODE --cell CELL` compares the whole EDS with the drive.",
            "Get the EDS of this firmware, or update the drive. `axisbus eds from-device NODE` makes one of what "
            "the drive has, for want of the maker's.",
            "Is the number right, and hexadecimal? `axisbus od dump NODE --cell CELL` lists what there is.",
            "On a drive of several axes the objects of the second axis begin at 6800h: axisbus adds that by itself.",
        ),
        aborts=(0x06020000, 0x06090011, 0x08000023),
        read_on=("eds-workbench.md#against-the-live-drive",),
    ),
    Symptom(
        name="value-refused",
        title="A drive does not take a value",
        seen="The object is there, and the value is not one that the drive takes: beyond its limits, of another "
        "length, or against another setting.",
        checks=(
            "See the range in the drive's manual; `axisbus od read --cell CELL NODE:6065` shows what it has now.",
            "Length or type differ: the EDS describes it otherwise than it is (`axisbus eds verify FILE NODE --cell "
            "CELL`).",
            "One limit above another (minimum, maximum): write them in the other order, or both.",
            "A mode that the drive does not have, or a PDO's parameter while the PDO is valid: 6502h lists the "
            "modes, bit 31 of the COB-ID switches a PDO off.",
        ),
        aborts=(
            *(0x06040043, 0x06070010, 0x06070012, 0x06070013, 0x06090030, 0x06090031, 0x06090032, 0x06090036),
        ),
        read_on=("cell-file.md#nodesn",),
    ),
    Symptom(
        name="pdo-mapping",
        title="Process data does not fit",
        seen="A PDO cannot be mapped as asked, or a PDO that came has another length than its mapping.",
        checks=(
            "A PDO holds 8 bytes. `axisbus boot CELL` tells which values travel in which PDO, `axisbus plan CELL` "
            "what that costs.",
            "Not every object may be mapped: the EDS says which (PDOMapping).",
            "Some drives have a fixed mapping: `remap` never in `[nodes.N]` leaves it as it is.",
            "Does another program or tool map the same drive? `axisbus trace CELL --seconds 5` shows its frames.",
        ),
        aborts=(0x06040041, 0x06040042),
        faults=("82xx",),
        read_on=("cell-file.md#nodesnpdoname",),
    ),
    Symptom(
        name="cell-file",
        title="The cell file is wrong",
        seen="`cell.toml` cannot be read, or says something that cannot be. Nothing was sent.",
        checks=(
            "The message has file and line. `axisbus check CELL` tells everything else that is wrong with it as "
            "well.",
            "Times have their unit (4ms), texts their quotes, tables their brackets; a misspelt key is named with "
            "the one that may be meant.",
            "`axisbus check --schema` prints a JSON Schema: an editor that takes it completes the keys.",
            "`axisbus init -i socketcan -c can0 -o new.toml` writes a fresh one of what is on the bus.",
        ),
        errors=("ConfigError",),
        read_on=("cell-file.md",),
    ),
    Symptom(
        name="eds",
        title="An EDS or DCF cannot serve",
        seen="The file that describes the device cannot be read, or lacks what is needed of it. Nothing was sent.",
        checks=(
            "`axisbus eds check FILE` tells everything that is wrong with it; `axisbus eds check --explain D002` "
            "explains a rule.",
            "`axisbus eds fix FILE` mends what can be mended without knowing the device.",
            "Is it an EDS? An XDD (XML), an archive or a picture is told as such.",
            "Ask the maker for the file of your firmware; until then a built-in one may do "
            "(`builtin:generic-cia402`).",
        ),
        errors=("EdsError",),
        read_on=("eds-workbench.md",),
    ),
)
