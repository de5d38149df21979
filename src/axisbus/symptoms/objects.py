"""Symptoms of a node's objects: boot-up, configuration, SDO and process data; and of the files that describe them."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

SYMPTOMS = (
    Symptom(
        name="does-not-boot",
        title="A node cannot be booted",
        seen="The boot of a node follows CiA 302-2: find, identify, configure, monitor and start the node. The report of "
        "`axisbus boot CELL` names the step and the object at which the boot ended, the expected value and the "
        "received one. The other nodes are checked nevertheless; nothing is energised.",
        checks=(
            "`axisbus boot CELL` reports step, object and letter. Many letters have a page of their own: `axisbus "
            "explain J`.",
            "An object could not be set: the report says which entry requires it. Remove it from the cell file, or give "
            "it a value that the drive accepts.",
            "The value that is read back differs from the written one: the drive limits or rounds it.",
            "Does the EDS belong to this firmware? `axisbus eds verify FILE NODE --cell CELL` compares it with the node.",
            "The drive accepts its configuration only while it is pre-operational, or only while it is not energised: "
            "`axisbus nmt reset-node NODE --cell CELL`, then boot again.",
        ),
        errors=("BootError",),
        letters="JL",
        read_on=("commissioning.md#6-boot", "cell-file.md#nodesn"),
    ),
    Symptom(
        name="another-device",
        title="A node is not the device that the cell file describes",
        seen="Device type, vendor, product, revision or serial number (1000h, 1018h) differs from the value in the cell "
        "file or its EDS, or the node is not listed in the cell file. The node was not configured.",
        checks=(
            "`axisbus scan CELL` shows the device at this node-ID. Are two drives exchanged, or was one replaced?",
            "The drive was replaced by one of the same kind: correct `serial` in `[nodes.N]`, or leave it out.",
            "The drive has another firmware: use the EDS of that firmware. `revision` in `[nodes.N]` is the required "
            "revision.",
            "The EDS describes a similar device: `axisbus eds verify FILE NODE --cell CELL` lists all differences.",
        ),
        letters="ACDMNO",
        read_on=("cell-file.md#nodesn", "commissioning.md#6-boot"),
    ),
    Symptom(
        name="wrong-program",
        title="A node does not have the expected program",
        seen="The cell file defines the program (firmware) of the node (`[nodes.N.program]`). The node has another "
        "program that must not be replaced, or the download failed. If a download is interrupted, the node remains in "
        "its boot loader.",
        checks=(
            "The report of `axisbus boot CELL` contains the expected date or number, and the received one.",
            "Use the program file of exactly this device, and write its date or number into `[nodes.N.program]`.",
            "Keep supply and cable stable, and boot again: an interrupted download starts again from the beginning.",
            "The node remains in its boot loader: repair it with the manufacturer's tool.",
        ),
        letters="GHI",
        read_on=("cell-file.md#nodesnprogram",),
    ),
    Symptom(
        name="object-refused",
        title="A drive refuses to read or write an object",
        seen="The drive answered an SDO request with an abort code: it does not support the request, not at present, or "
        "not in this form. Its other objects are unchanged.",
        checks=(
            "The message names the object and explains the code. `axisbus explain 0x06010002` prints the page of a "
            "code.",
            "Not permitted in this state: disable the axis, or bring the node to pre-operational (`axisbus nmt "
            "pre-operational NODE --cell CELL`). Under local control (keypad, the manufacturer's tool) a drive refuses "
            "access from the bus.",
            "The object is read-only, write-only or protected: see the drive's manual. The EDS may differ: `axisbus eds "
            "verify FILE NODE --cell CELL`.",
            "The device itself has an error (hardware, memory): read its list of errors, `axisbus od read --cell CELL "
            "NODE:1003:1`.",
        ),
        errors=("SdoError", "SdoAbort"),
        aborts=(
            *(0x05040005, 0x06010000, 0x06010001, 0x06010002, 0x06040047, 0x06060000, 0x060A0023, 0x08000000),
            *(0x08000020, 0x08000021, 0x08000022, 0x08000024),
        ),
        read_on=("commissioning.md#during-operation",),
    ),
    Symptom(
        name="object-missing",
        title="A drive does not have an object",
        seen="The requested object or sub-index is not in the drive's dictionary. Usually the EDS describes another "
        "firmware than that of the drive.",
        checks=(
            "`axisbus eds verify FILE NODE --cell CELL` compares the whole EDS with the drive.",
            "Get the EDS of this firmware, or update the drive. If the manufacturer provides no EDS, `axisbus eds "
            "from-device NODE` makes one from the objects of the drive.",
            "Is the index correct, and hexadecimal? `axisbus od dump NODE --cell CELL` lists the existing objects.",
            "On a drive with several axes the objects of the second axis begin at 6800h: axisbus adds the offset "
            "automatically.",
        ),
        aborts=(0x06020000, 0x06090011, 0x08000023),
        read_on=("eds-workbench.md#compare-with-the-connected-drive",),
    ),
    Symptom(
        name="value-refused",
        title="A drive does not accept a value",
        seen="The object exists, but the drive does not accept the value: it is beyond the limits, has another length, or "
        "conflicts with another setting.",
        checks=(
            "See the range in the drive's manual. `axisbus od read --cell CELL NODE:6065` shows the present value.",
            "Length or type differs: the EDS describes the object incorrectly (`axisbus eds verify FILE NODE --cell "
            "CELL`).",
            "The minimum would be above the maximum: write the two limits in the other order, or write both.",
            "The drive does not have the mode: 6502h lists the modes. Or the parameter of a PDO was written while the "
            "PDO is valid: bit 31 of the COB-ID switches a PDO off.",
        ),
        aborts=(
            *(0x06040043, 0x06070010, 0x06070012, 0x06070013, 0x06090030, 0x06090031, 0x06090032, 0x06090036),
        ),
        read_on=("cell-file.md#nodesn",),
    ),
    Symptom(
        name="pdo-mapping",
        title="Process data does not fit",
        seen="A PDO cannot be mapped as requested, or the length of a received PDO differs from its mapping.",
        checks=(
            "A PDO holds 8 bytes. `axisbus boot CELL` shows which values are in which PDO, and `axisbus plan CELL` the "
            "resulting load of the bus.",
            "Not every object can be mapped: the EDS shows which ones can (PDOMapping).",
            "Some drives have a fixed mapping. If `remap` in `[nodes.N]` is never, axisbus leaves it unchanged.",
            "Does another program or tool map the same drive? `axisbus trace CELL --seconds 5` shows its frames.",
        ),
        aborts=(0x06040041, 0x06040042),
        faults=("82xx",),
        read_on=("cell-file.md#nodesnpdoname",),
    ),
    Symptom(
        name="cell-file",
        title="The cell file is not valid",
        seen="`cell.toml` cannot be read, or contains an invalid or impossible setting. Nothing was sent.",
        checks=(
            "The message contains file and line. `axisbus check CELL` lists all other errors too.",
            "Times need a unit (4ms), texts need quotation marks, and tables need brackets. For a misspelled key the "
            "message proposes a similar one.",
            "`axisbus check --schema` prints a JSON Schema. An editor that supports it completes the keys.",
            "`axisbus init -i socketcan -c can0 -o new.toml` writes a new file from the devices on the bus.",
        ),
        errors=("ConfigError",),
        read_on=("cell-file.md",),
    ),
    Symptom(
        name="eds",
        title="An EDS or DCF cannot be used",
        seen="The file that describes the device cannot be read, or lacks required entries. Nothing was sent.",
        checks=(
            "`axisbus eds check FILE` lists all errors in the file. `axisbus eds check --explain D002` explains a rule.",
            "`axisbus eds fix FILE` repairs the errors that can be repaired without knowing the device.",
            "Is the file an EDS? The message says if it is an XDD (XML), an archive or a picture.",
            "Ask the manufacturer for the file of your firmware. Until then a built-in file may be sufficient "
            "(`builtin:generic-cia402`).",
        ),
        errors=("EdsError",),
        read_on=("eds-workbench.md",),
    ),
)
