"""A small drive's EDS in which no rule finds anything, and edits to it, written as a person would say them.

An edit is ``6041:DataType=0x0007`` (a key gets a value, or is added), ``6041:DataType`` (a key is removed), ``-6041`` (a section
is removed), ``6041>text`` (a line is put behind the header) or ``>text`` (text is added at the end).

A place is ``6041`` (its header), ``6041:DataType`` (the value), ``6041:DataType@`` (the beginning of that line), ``~text`` (where
this text begins) or empty (no line).
"""

from __future__ import annotations


def variable(section: str, name: str, kind: int, access: str, default: str = "", mapping: int = 0) -> str:
    value = f"DefaultValue={default}\n" if default else ""
    return (
        f"[{section}]\nParameterName={name}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType={access}\n"
        f"{value}PDOMapping={mapping}\n\n"
    )


def record(section: str, name: str, kind: int, *subs: str) -> str:
    return f"[{section}]\nParameterName={name}\nObjectType=0x{kind:X}\nSubNumber={len(subs)}\n\n" + "".join(
        subs
    )


def listed(name: str, *indices: int) -> str:
    rows = "".join(f"{number}=0x{index:04X}\n" for number, index in enumerate(indices, 1))
    return f"[{name}]\nSupportedObjects={len(indices)}\n{rows}\n"


BASE = "".join(
    (
        "[FileInfo]\nFileName=test.eds\nFileVersion=1\nFileRevision=2\nEDSVersion=4.0\nDescription=A drive\nCreationTime=09:30AM\n"
        "CreationDate=03-25-2024\nCreatedBy=Somebody\nModificationTime=10:15PM\nModificationDate=04-01-2024\nModifiedBy=Somebody\n\n",
        "[DeviceInfo]\nVendorName=Maker\nVendorNumber=0x123\nProductName=Drive\nProductNumber=7\nRevisionNumber=0x10002\n"
        "OrderCode=D-7\nBaudRate_10=0\nBaudRate_20=0\nBaudRate_50=0\nBaudRate_125=1\nBaudRate_250=1\nBaudRate_500=1\nBaudRate_800=0\n"
        "BaudRate_1000=1\nSimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\nDynamicChannelsSupported=0\nGroupMessaging=0\n"
        "NrOfRXPDO=1\nNrOfTXPDO=1\nLSS_Supported=0\nCompactPDO=0\n\n",
        "[DummyUsage]\nDummy0001=0\nDummy0002=0\nDummy0003=0\nDummy0004=0\nDummy0005=1\nDummy0006=1\nDummy0007=0\n\n",
        "[Comments]\nLines=1\nLine1=For tests\n\n",
        listed("MandatoryObjects", 0x1000, 0x1001, 0x1018),
        listed(
            "OptionalObjects",
            *(0x1003, 0x1005, 0x1010, 0x1014, 0x1017, 0x1200, 0x1400, 0x1600, 0x1800, 0x1A00, 0x1F22),
            *(
                0x605A,
                0x6040,
                0x6041,
                0x6060,
                0x6061,
                0x6064,
                0x607A,
                0x607D,
                0x6081,
                0x6083,
                0x6086,
                0x60C2,
                0x6502,
            ),
        ),
        listed("ManufacturerObjects", 0x2000, 0x2001, 0x2002, 0x2003, 0x2004, 0x2005),
        variable("1000", "Device type", 7, "ro", "0x00020192"),
        variable("1001", "Error register", 5, "ro"),
        record(
            *("1003", "Error history", 8),
            variable("1003sub0", "Number of errors", 5, "rw"),
            variable("1003sub1", "Last error", 7, "ro"),
        ),
        variable("1005", "COB-ID SYNC", 7, "rw", "0x80"),
        record(
            *("1010", "Store parameters", 8),
            variable("1010sub0", "Highest sub-index", 5, "ro", "1"),
            variable("1010sub1", "Save all", 7, "rw").replace("\n\n", "\nObjFlags=0x1\n\n"),
        ),
        variable("1014", "COB-ID EMCY", 7, "rw", "$NODEID+0x80"),
        variable("1017", "Producer heartbeat time", 6, "rw", "0"),
        record(
            *("1018", "Identity", 9),
            variable("1018sub0", "Highest sub-index", 5, "ro", "4"),
            variable("1018sub1", "Vendor-ID", 7, "ro", "0x123"),
            variable("1018sub2", "Product code", 7, "ro", "7"),
            variable("1018sub3", "Revision number", 7, "ro", "0x10002"),
            variable("1018sub4", "Serial number", 7, "ro"),
        ),
        record(
            *("1200", "SDO server", 9),
            variable("1200sub0", "Highest sub-index", 5, "ro", "2"),
            variable("1200sub1", "COB-ID to the server", 7, "ro", "$NODEID+0x600"),
            variable("1200sub2", "COB-ID to the client", 7, "ro", "$NODEID+0x580"),
        ),
        record(
            *("1400", "RPDO 1", 9),
            variable("1400sub0", "Highest sub-index", 5, "ro", "2"),
            variable("1400sub1", "COB-ID", 7, "rw", "$NODEID+0x200"),
            variable("1400sub2", "Transmission type", 5, "rw", "255"),
        ),
        record(
            *("1600", "RPDO 1 mapping", 9),
            variable("1600sub0", "Number mapped", 5, "rw", "2"),
            variable("1600sub1", "First", 7, "rw", "0x60400010"),
            variable("1600sub2", "Second", 7, "rw", "0x607A0020"),
        ),
        record(
            *("1800", "TPDO 1", 9),
            variable("1800sub0", "Highest sub-index", 5, "ro", "5"),
            variable("1800sub1", "COB-ID", 7, "rw", "$NODEID+0x180"),
            variable("1800sub2", "Transmission type", 5, "rw", "1"),
            variable("1800sub3", "Inhibit time", 6, "rw", "0"),
            variable("1800sub5", "Event timer", 6, "rw", "0"),
        ),
        record(
            *("1A00", "TPDO 1 mapping", 9),
            variable("1A00sub0", "Number mapped", 5, "rw", "2"),
            variable("1A00sub1", "First", 7, "rw", "0x60410010"),
            variable("1A00sub2", "Second", 7, "rw", "0x60640020"),
            variable("1A00sub3", "Third", 7, "rw", "0"),
        ),
        record(
            *("1F22", "Concise DCF", 8),
            variable("1F22sub0", "Highest sub-index", 5, "ro", "1"),
            "[1F22sub1]\nParameterName=Node 1\nObjectType=0x2\nDataType=0x000F\nAccessType=rw\n\n",
        ),
        variable("605A", "Quick stop option code", 3, "rw", "2"),
        variable("6040", "Controlword", 6, "rw", "", 1),
        variable("6041", "Statusword", 6, "ro", "", 1),
        variable("6060", "Modes of operation", 2, "rw", "1", 1),
        variable("6061", "Modes of operation display", 2, "ro", "", 1),
        variable("6064", "Position actual value", 4, "ro", "", 1),
        variable("607A", "Target position", 4, "rw", "", 1).replace(
            "PDOM", "LowLimit=-1000\nHighLimit=1000\nPDOM"
        ),
        record(
            *("607D", "Software position limit", 8),
            variable("607Dsub0", "Highest sub-index", 5, "const", "2"),
            variable("607Dsub1", "Min position limit", 4, "rw", "-100"),
            variable("607Dsub2", "Max position limit", 4, "rw", "100"),
        ),
        variable("6081", "Profile velocity", 7, "rw", "100"),
        variable("6083", "Profile acceleration", 7, "rw", "1000"),
        variable("6086", "Motion profile type", 3, "rw", "0"),
        record(
            *("60C2", "Interpolation time period", 9),
            variable("60C2sub0", "Highest sub-index", 5, "const", "2"),
            variable("60C2sub1", "Interpolation time period value", 5, "rw", "1"),
            variable("60C2sub2", "Interpolation time index", 2, "rw", "-3"),
        ),
        variable("6502", "Supported drive modes", 7, "ro", "0x00000081"),
        variable("2000", "Gain", 7, "rw", "5", 1).replace("PDOM", "LowLimit=1\nHighLimit=9\nPDOM"),
        variable("2001", "Label", 9, "rw", "left"),
        "[2002]\nParameterName=Firmware\nObjectType=0x2\nDataType=0x000F\nAccessType=wo\n\n",
        record(
            *("2003", "Table", 8),
            variable("2003sub0", "Highest sub-index", 5, "ro", "3"),
            variable("2003sub1", "Value 1", 3, "rw", "1"),
            variable("2003sub2", "Value 2", 3, "rw", "2"),
            variable("2003sub3", "Value 3", 3, "rw", "3"),
        ),
        "[2004]\nParameterName=Compact\nObjectType=0x8\nDataType=0x0006\nAccessType=rw\nPDOMapping=0\nCompactSubObj=2\n\n",
        "[2004Name]\nNrOfEntries=1\n1=Front\n\n[2004ObjectLinks]\nObjectLinks=1\n1=0x2003\n\n",
        variable("2005", "Ratio", 8, "rw", "1.5"),
    )
)


def edited(*edits: str, text: str = BASE) -> str:
    """Return the base (or another text) with some edits made one after the other."""
    for edit in edits:
        text = _edited(text, edit)
    return text


def _edited(text: str, edit: str) -> str:
    if edit.startswith(">"):
        return text + edit[1:]
    if edit.startswith("-"):
        start, end = _extent(text, edit[1:])
        return text[:start] + text[end:]
    if ">" in edit.partition("=")[0]:
        section, _, line = edit.partition(">")
        return text.replace(f"[{section}]\n", f"[{section}]\n{line}\n", 1)
    section, _, entry = edit.partition(":")
    start, end = _extent(text, section)
    rows = text[start:end].rstrip("\n").split("\n")
    key = entry.partition("=")[0]
    at = next((number for number, row in enumerate(rows) if row.partition("=")[0] == key), None)
    if at is not None:
        rows[at : at + 1] = [entry] if "=" in entry else []
    else:
        assert "=" in entry, f"there is no {edit}"
        rows.append(entry)
    return text[:start] + "\n".join(rows) + "\n\n" + text[end:]


def _extent(text: str, section: str) -> tuple[int, int]:
    start = text.index(f"[{section}]\n")
    end = text.find("\n[", start)
    return start, len(text) if end < 0 else end + 1


def place(text: str, where: str) -> tuple[int, int]:
    """Return line and column (from 1) of a place; (0, 0) for none."""
    if not where:
        return 0, 0
    if where.startswith("~"):
        at = text.index(where[1:])
        return text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)
    section, _, key = where.partition(":")
    header = text.index(f"[{section}]") if f"[{section}]" in text else text.index(f"[{section}")
    line = text.count("\n", 0, header) + 1
    if not key:
        return line, 1
    rows = text[header:].split("\n")
    number, row = next(
        (number, row) for number, row in enumerate(rows) if row.partition("=")[0] == key.rstrip("@")
    )
    return line + number, 1 if key.endswith("@") else row.index("=") + 2
