"""For each rule the smallest change that breaks it, the line of its report, and the nearest change that does not."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

Edit = str | Callable[[str], str | bytes]


class Case(NamedTuple):
    """Edits that break a rule, the place of the report, and edits that nearly do."""

    rule: str
    bad: tuple[Edit, ...]
    at: str
    near: tuple[Edit, ...]


DCF = (
    *("FileInfo:FileName=test.dcf", "FileInfo:LastEDS=test.eds"),
    ">\n[DeviceComissioning]\nNodeID=5\nNodeName=X axis\nBaudrate=500\nNetNumber=0\nNetworkName=Cell\nCANopenManager=0\n",
)
MODULES = (
    ">\n[SupportedModules]\nNrOfEntries=1\n\n[M1ModuleInfo]\nProductName=In\nProductVersion=1\nProductRevision=0\nOrderCode=I-1\n\n"
    "[M1FixedObjects]\nNrOfEntries=1\n1=0x3000\n\n[M1Fixed3000]\nParameterName=In\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\n\n"
    "[M1SubExtends]\nNrOfEntries=1\n1=0x2003\n\n[M1SubExt2003]\nParameterName=More\nObjectType=0x7\nDataType=0x0003\nAccessType=ro\n"
    "Count=2\nObjExtend=1\n",
)


def without(what: str, instead: str = "") -> Callable[[str], str]:
    """Replace a text once."""
    return lambda text: text.replace(what, instead, 1)


def cut_before(what: str) -> Callable[[str], str]:
    """Leave out a text and all behind it."""
    return lambda text: text[: text.index(what)]


def encoded(encoding: str) -> Callable[[str], bytes]:
    return lambda text: text.encode(encoding)


def crlf(lines: int) -> Callable[[str], bytes]:
    """End the first lines in CR LF."""
    return lambda text: text.replace("\n", "\r\n", lines).encode()


def concise(*writes: tuple[int, int, bytes], count: int | None = None) -> str:
    """Return a concise DCF as hexadecimal digits (CiA 302-3): count, then index, sub-index, size, data, little endian."""
    data = (len(writes) if count is None else count).to_bytes(4, "little")
    for index, subindex, value in writes:
        data += index.to_bytes(2, "little") + bytes((subindex,)) + len(value).to_bytes(4, "little") + value
    return data.hex()


SET_8 = (0x6060, 0, b"\x01")
MAPPED = ((0x1600, 0, b"\x00"), (0x1600, 1, b"\x10\x00\x40\x60"), (0x1600, 0, b"\x01"))
VERIFIED = (0x1020, 1, b"\x01\x00\x00\x00")
SECOND_TPDO = (
    "OptionalObjects:SupportedObjects=26", "OptionalObjects:25=0x1801", "OptionalObjects:26=0x1A01", "DeviceInfo:NrOfTXPDO=2",
    ">[1801]\nParameterName=TPDO 2\nObjectType=0x9\nSubNumber=3\n\n[1801sub0]\nParameterName=Highest sub-index\nObjectType=0x7\n"
    "DataType=0x0005\nAccessType=ro\nDefaultValue=2\nPDOMapping=0\n\n[1801sub1]\nParameterName=COB-ID\nObjectType=0x7\nDataType=0x0007\n"
    "AccessType=rw\nDefaultValue=$NODEID+0x280\nPDOMapping=0\n\n[1801sub2]\nParameterName=Type\nObjectType=0x7\nDataType=0x0005\n"
    "AccessType=rw\nDefaultValue=255\nPDOMapping=0\n\n",
    ">[1A01]\nParameterName=TPDO 2 mapping\nObjectType=0x9\nSubNumber=1\n\n"
    "[1A01sub0]\nParameterName=Number mapped\nObjectType=0x7\n"
    "DataType=0x0005\nAccessType=rw\nDefaultValue=0\nPDOMapping=0\n\n",
)  # fmt: skip
OVERFLOW = (
    *("OptionalObjects:SupportedObjects=25", "OptionalObjects:25=0x1019"),
    ">[1019]\nParameterName=Overflow\nObjectType=0x7\nDataType=0x0005\nAccessType=rw\nDefaultValue=240\nPDOMapping=0\n",
)
HOMING = (
    *("OptionalObjects:25=0x6098", "OptionalObjects:SupportedObjects=25"),
    ">[6098]\nParameterName=Homing method\nObjectType=0x7\nDataType=0x0002\nAccessType=rw\nDefaultValue=35\nPDOMapping=0\n",
)
SECOND_AXIS = tuple(
    edit
    for number, (index, name, kind, access) in enumerate(
        (
            ("6840", "Controlword 2", 6, "rw"),
            ("6841", "Statusword 2", 6, "ro"),
            ("6860", "Mode 2", 2, "rw"),
            ("6FFF", "Device type 2", 7, "ro"),
        ),
        25,
    )
    for edit in (
        *(f"OptionalObjects:{number}=0x{index}", f"OptionalObjects:SupportedObjects={number}"),
        f">[{index}]\nParameterName={name}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType={access}\nPDOMapping=1\n\n",
    )
)
AXIS_TYPE = (
    *("OptionalObjects:29=0x67FF", "OptionalObjects:SupportedObjects=29"),
    ">[67FF]\nParameterName=Single device type\nObjectType=0x7\n"
    "DataType=0x0007\nAccessType=ro\nDefaultValue=0x00020192\nPDOMapping=0\n",
)
NO_OPTION = ("-2005", "ManufacturerObjects:6", "ManufacturerObjects:SupportedObjects=5")


def not_optional(index: int, number: int, *edits: str) -> tuple[Edit, ...]:
    """Take an object out, with its sub-indices (named by ``edits``); the last of the list takes its number."""
    moved = f"OptionalObjects:{number}=0x6502"
    return (f"-{index:04X}", *edits, moved, "OptionalObjects:24", "OptionalObjects:SupportedObjects=23")


CASES = (
    # S: text
    Case("S001", ("2000:ParameterName=Verstärkung", encoded("utf-8")), "~ä", ("2000:ParameterName=Gain 2",)),
    Case("S002", (encoded("utf-16"),), "FileInfo", (encoded("ascii"),)),
    Case("S003", (">[2001]\nParameterName=Again\n",), "~[2001]\nParameterName=Again", (">;[2001]\n",)),
    Case("S004", ("2000>DefaultValue=6",), "~DefaultValue=5\nLowLimit", ("2000>;DefaultValue=6",)),
    Case("S005", (lambda text: "A file\n" + text,), "~A file", (lambda text: "; A file\n\n" + text,)),
    Case("S006", ("2000>no entry",), "~no entry", ("2000>; no entry",)),
    Case("S007", ("2001:DefaultValue=" + "x" * 242 + "!",), "~!", ("2001:DefaultValue=" + "x" * 242,)),
    Case("S008", (without("AccessType=rw", "AccessType =rw"),), "~ =rw", (without("AccessType=rw", "AccessType= rw"),)),
    Case("S009", (without("[2001]", " [2001]"),), "~[2001]", (without("[2001]", "[2001] "),)),
    Case("S010", (without("[2001]", "[2001"),), "~[2001\n", ()),
    Case("S011", (without("[2001]", "[2001] ; label"),), "~ ; label", (without("[2001]", "; label\n[2001]"),)),
    Case("S012", (">[Settings]\nA=1\n",), "~[Settings]", (">;[Settings]\n",)),
    Case("S013", ("2001> ; label",), "~; label", ("2001>; label",)),
    Case("S014", (without("\n\n", "\n"), lambda text: text.replace("\n", "\r").encode(),), "FileInfo", (crlf(-1),)),
    Case("S015", (crlf(3),), "FileInfo", (crlf(-1),)),
    Case("S016", ("2000:Unit=mm",), "~Unit", ("2000:Denotation=Gain",)),
    Case("S017", ("2000:AcessType=rw", "2000:AccessType"), "~AcessType", ("2000:AcessType=rw",)),
    Case("S018", ("2001:DefaultValue=le\x07ft",), "~\x07", ("2001:DefaultValue=le\tft",)),
    Case("S019", ("2000>#Unit=mm",), "~#Unit", ("2000>;Unit=mm",)),
    Case("S020", (cut_before("[2004]"),), "2003sub3:PDOMapping@", (cut_before("[2005]"),)),
    # F: [FileInfo]
    Case("F001", ("FileInfo:CreatedBy",), "FileInfo", ("FileInfo:EDSVersion",)),
    Case("F002", ("FileInfo:FileName=other.eds",), "FileInfo:FileName", ("FileInfo:FileName=TEST.EDS",)),
    Case("F003", ("FileInfo:FileVersion=1.2",), "FileInfo:FileVersion", ("FileInfo:FileVersion=255",)),
    Case("F004", ("FileInfo:CreationDate=25-03-2024",), "FileInfo:CreationDate", ("FileInfo:CreationDate=12-31-2023",)),
    Case("F005", ("FileInfo:CreationTime=09:30",), "FileInfo:CreationTime", ("FileInfo:CreationTime=12:59PM",)),
    Case("F006", ("FileInfo:Description=" + "x" * 244,), "FileInfo:Description", ("FileInfo:Description=" + "x" * 243,)),
    Case(
        *("F007", ("FileInfo:ModificationDate=03-24-2024",), "FileInfo:ModificationDate"),
        near=("FileInfo:ModificationDate=03-25-2024",),
    ),
    Case("F008", (*DCF, "FileInfo:LastEDS"), "FileInfo", DCF),
    Case("F009", ("FileInfo:EDSVersion=402",), "FileInfo:EDSVersion", ("FileInfo:EDSVersion=3.0",)),
    Case("F010", ("FileInfo:FileName=C:\\me\\test.eds",), "FileInfo:FileName", ("FileInfo:FileName=test.eds",)),
    Case("F011", ("FileInfo:EDSVersion",), "FileInfo", ("FileInfo:EDSVersion=3.0",)),
    # D: [DeviceInfo], [DummyUsage], [Comments]
    Case("D001", ("DeviceInfo:OrderCode",), "DeviceInfo", ("DeviceInfo:OrderCode=",)),
    Case("D002", ("DeviceInfo:VendorNumber=",), "DeviceInfo:VendorNumber", ("DeviceInfo:VendorName=",)),
    Case("D003", ("DeviceInfo:ProductNumber=0",), "DeviceInfo:ProductNumber", ("DeviceInfo:RevisionNumber=0",)),
    Case("D004", ("DeviceInfo:ProductNumber=8",), "DeviceInfo:ProductNumber", ("DeviceInfo:ProductNumber=0x7",)),
    Case("D005", ("DeviceInfo:LSS_Supported=yes",), "DeviceInfo:LSS_Supported", ("DeviceInfo:LSS_Supported=0x1",)),
    Case("D006", ("DeviceInfo:NrOfRXPDO=2",), "DeviceInfo:NrOfRXPDO", ("DeviceInfo:NrOfRXPDO=0x1",)),
    Case("D007", ("DeviceInfo:ProductName=" + "x" * 244,), "DeviceInfo:ProductName", ("DeviceInfo:ProductName=" + "x" * 243,)),
    Case(
        "D008",
        tuple(f"DeviceInfo:BaudRate_{rate}=0" for rate in (125, 250, 500, 1000)),
        "DeviceInfo:BaudRate_10",
        tuple(f"DeviceInfo:BaudRate_{rate}=0" for rate in (125, 250, 500)),
    ),
    Case("D009", ("DeviceInfo:ProductNumber=D-7",), "DeviceInfo:ProductNumber", ("DeviceInfo:OrderCode=D-8",)),
    Case("D010", ("DeviceInfo:BaudRate_500=2",), "DeviceInfo:BaudRate_500", ("DeviceInfo:BaudRate_500=0x0",)),
    Case("D011", ("DeviceInfo:BaudRate_100=1",), "DeviceInfo:BaudRate_100", ("DeviceInfo:BaudRate_20=1",)),
    Case(
        *("D012", (without("BaudRate_10=", "Baudrate_10="),), "DeviceInfo:Baudrate_10@"),
        near=("DeviceInfo:BaudRate_10= 0",),
    ),
    Case(
        *("D013", ("DeviceInfo:DynamicChannelsSupported=1",), "DeviceInfo:DynamicChannelsSupported"),
        near=("DeviceInfo:DynamicChannelsSupported=1", ">[DynamicChannels]\nNrOfSeg=0\n"),
    ),
    Case("D014", ("DeviceInfo:Granularity=65",), "DeviceInfo:Granularity", ("DeviceInfo:Granularity=64",)),
    Case("D015", ("DeviceInfo:CompactPDO=0x40",), "DeviceInfo:CompactPDO", ("DeviceInfo:CompactPDO=0x3F",)),
    Case("D016", ("DummyUsage:Dummy5=1",), "DummyUsage:Dummy5", ("DummyUsage:Dummy0010=1",)),
    Case("D017", ("Comments:Lines=2",), "Comments:Lines", ("Comments:Lines=2", "Comments:Line2=More")),
    Case("D019", ("DummyUsage:Dummy0003",), "DummyUsage", ("DummyUsage:Dummy0003=1",)),
    Case("D018", ("Comments:Line1=" + "x" * 250,), "Comments:Line1", ("Comments:Line1=" + "x" * 249,)),
    # L: lists of objects
    Case("L001", ("-ManufacturerObjects",), "2000", ("ManufacturerObjects:SupportedObjects=6",)),
    Case(
        *("L003", ("ManufacturerObjects:SupportedObjects=5",), "ManufacturerObjects:SupportedObjects"),
        near=("ManufacturerObjects:SupportedObjects=0x6",),
    ),
    Case(
        *("L004", (without("6=0x2005", "7=0x2005"),), "ManufacturerObjects:7@"),
        near=(without("5=0x2004\n6=0x2005", "5=0x2005\n6=0x2004"),),
    ),
    Case("L005", ("-2005",), "ManufacturerObjects:6", NO_OPTION),
    Case(
        *("L006", ("ManufacturerObjects:6", "ManufacturerObjects:SupportedObjects=5"), "2005"),
        near=("ManufacturerObjects:6=0x2FFF",),  # the entry is the mistake: L005
    ),
    Case(
        *("L007", ("ManufacturerObjects:7=0x2000", "ManufacturerObjects:SupportedObjects=7"), "ManufacturerObjects:7"),
        near=(),
    ),
    Case(
        "L008",
        ("ManufacturerObjects:6", "ManufacturerObjects:SupportedObjects=5", "OptionalObjects:25=0x2005",
         "OptionalObjects:SupportedObjects=25"),
        "OptionalObjects:25",
        ("MandatoryObjects:4=0x2005", "MandatoryObjects:SupportedObjects=4"),  # a maker may call more objects mandatory
    ),
    Case("L009", ("ManufacturerObjects:6=Ratio",), "ManufacturerObjects:6", ("ManufacturerObjects:6=8197",)),
    # O: objects
    Case("O001", ("2000:ParameterName",), "2000", ("2000:ParameterName=x",)),
    Case("O002", ("2000:DataType",), "2000", ("2002:DataType",)),  # a DOMAIN needs none
    Case("O003", ("2000:AccessType=read",), "2000:AccessType", ("2000:AccessType=rww",)),
    Case("O004", ("2000:ObjectType=0x55",), "2000:ObjectType", ("2000:ObjectType=7",)),
    Case("O005", (">[2FF0sub0]\nParameterName=Lost\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\n",), "2FF0sub0", ()),
    Case("O006", ("2003:ObjectType",), "2003", ("2000:ObjectType",)),
    Case("O007", ("2003:SubNumber=3",), "2003:SubNumber", ("2003:SubNumber=0x4",)),
    Case("O008", ("-2003sub0",), "2003", ("2003sub0:DefaultValue",)),
    Case("O009", ("2003sub0:DataType=0x0006",), "2003sub0:DataType", ("2003sub0:DataType=5",)),
    Case("O010", ("2003sub0:DefaultValue=2",), "2003sub0:DefaultValue", ("1A00sub0:DefaultValue=1",)),
    Case("O011", (">[2000sub1]\nParameterName=Part\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\n",), "2000:ObjectType", ()),
    Case("O012", (without("[2003sub3]", "[2003sub03]"),), "2003sub03", (without("[2003sub3]", "[2003Sub3]"),)),
    Case("O013", ("2004:CompactSubObj=300",), "2004:CompactSubObj", ("2004:CompactSubObj=0x02",)),
    Case(
        *("O014", ("2003sub2:ParameterName=Value 1",), "2003sub2:ParameterName"),
        near=("2003sub2:ParameterName=Highest sub-indexes",),
    ),
    Case("O015", ("2000:ParameterName=" + "x" * 242,), "2000:ParameterName", ("2000:ParameterName=" + "x" * 241,)),
    Case("O016", ("2000:PDOMapping=2",), "2000:PDOMapping", ("2000:PDOMapping=0x1",)),
    Case("O017", ("2000:SubNumber=1",), "2000:SubNumber", ("2000:SubNumber=0",)),
    Case("O018", ("2002:LowLimit=1",), "2002:LowLimit", ("2002:LowLimit=",)),
    Case("O019", ("2000:AccessType=RW",), "2000:AccessType", ("2000:AccessType=rww",)),
    Case("O020", ("2001:PDOMapping",), "2001", ("2001:PDOMapping=0x0",)),
    Case("O021", ("2000:ParameterName=",), "2000:ParameterName", ("2000:ParameterName=-",)),
    Case("O022", ("2003:AccessType=rw",), "2003:AccessType", ("2003:AccessType=",)),
    Case("O023", ("2003:DefaultValue=0",), "2003:DefaultValue", ("2003:PDOMapping=0",)),
    Case("O024", ("2003:SubNumber",), "2003", ("2004:SubNumber=0",)),
    Case("O025", ("2003sub0:DefaultValue",), "2003sub0", ("1003sub0:DefaultValue=0",)),
    Case("O026", ("2003sub3:DataType=0x0006",), "2003sub3:DataType", ("1018sub4:DataType=0x0006",)),
    Case("O027", ("2001:ParameterName=GAIN",), "2001:ParameterName", ("2003sub1:ParameterName=Gain",)),
    Case("O028", ("1010sub1:ObjFlags",), "1010sub1", ("1010sub1:ObjFlags=3",)),
    Case("O029", ("2000:ObjFlags=4",), "2000:ObjFlags", ("2000:ObjFlags=3",)),
    Case("O030", ("2003sub1:ObjectType=0x8",), "2003sub1:ObjectType", ("2003sub1:ObjectType=7",)),
    Case("O031", ("2000:ObjectType",), "2000", ("2000:ObjectType=7",)),
    Case("O032", ("2000:DataType=0x0060",), "2000:DataType", ("2000:DataType=0x0016",)),
    # B: compact sub-indices and the lists beside an object
    Case("B001", ("2004:SubNumber=3",), "2004:SubNumber", ("2004:SubNumber=0",)),
    Case("B002", ("2004Name:NrOfEntries=2",), "2004Name:NrOfEntries", ("2004Name:NrOfEntries=0x1",)),
    Case("B003", ("2004ObjectLinks:ObjectLinks=2",), "2004ObjectLinks:ObjectLinks", ("2004ObjectLinks:ObjectLinks=0x1",)),
    Case("B004", ("2004ObjectLinks:1=0x2999",), "2004ObjectLinks:1", ("2004ObjectLinks:1=0x2000",)),
    Case("B005", (">[2FF0Name]\nNrOfEntries=0\n",), "2FF0Name", (">[2003Name]\nNrOfEntries=0\n",)),
    # V: values
    Case("V001", ("2000:DefaultValue=five",), "2000:DefaultValue", ("2001:DefaultValue=five",)),
    Case("V002", ("2003sub1:DataType=0x0002", "2003sub1:LowLimit=0", "2003sub1:HighLimit=0xFF"), "2003sub1:HighLimit",
         ("2003sub1:DataType=0x0002", "2003sub1:LowLimit=0x80", "2003sub1:HighLimit=0x7F")),
    Case("V003", ("2000:DefaultValue=10",), "2000:DefaultValue", ("2000:DefaultValue=9",)),
    Case("V004", ("2000:LowLimit=10", "2000:DefaultValue"), "2000:LowLimit", ("2000:LowLimit=9", "2000:DefaultValue=9")),
    Case("V005", ("2000:DefaultValue=0x100000000", "2000:HighLimit"), "2000:DefaultValue",
         ("2000:DefaultValue=0xFFFFFFFF", "2000:HighLimit")),
    Case("V006", ("1014:DefaultValue=0x80+$NODEID",), "1014:DefaultValue", ("1014:DefaultValue=$NODEID + 0x80",)),
    Case("V007", ("1400sub1:DefaultValue=0x205",), "1400sub1:DefaultValue", ("1400sub1:DefaultValue=0x2FF",)),
    Case("V008", ("2001:LowLimit=0",), "2001:LowLimit", ("2005:LowLimit=0",)),
    Case("V009", ("2000:DefaultValue=-1", "2000:LowLimit"), "2000:DefaultValue", ("2003sub1:DefaultValue=-1",)),
    Case("V010", ("2003sub1:DefaultValue=0xFFFF",), "2003sub1:DefaultValue", ("2003sub1:DefaultValue=0x7FFF",)),
    Case("V011", ("2000:DefaultValue=5.5",), "2000:DefaultValue", ("2005:DefaultValue=5.5",)),
    Case("V012", ("2000:DefaultValue=07",), "2000:DefaultValue", ("2000:DefaultValue=0x07",)),
    Case("V013", ('2001:DefaultValue="left"',), "2001:DefaultValue", ('2001:DefaultValue=3" pipe',)),
    Case("V014", ("2005:DefaultValue=0x3FC00000",), "2005:DefaultValue", ("2005:DefaultValue=1.5e3",)),
    Case("V015", ("2000:DefaultValue=true", "2000:LowLimit=0"), "2000:DefaultValue", ("2001:DefaultValue=true",)),
    Case("V016", ("2003sub1:DefaultValue=$NODEID+0x7FF0",), "2003sub1:DefaultValue",
         ("2003sub1:DefaultValue=$NODEID+0x7F80",)),
    Case("V017", ("2002:DefaultValue=0x0102",), "2002:DefaultValue", ("2002:DefaultValue=01 02",)),
    Case("V018", ("2003sub1:LowLimit=0", "2003sub1:HighLimit=0"), "2003sub1:LowLimit",
         ("2003sub1:LowLimit=0", "2003sub1:HighLimit=0", "2003sub1:DefaultValue=0")),
    Case("V019", ("1400sub1:DefaultValue=0x200",), "1400sub1:DefaultValue", ("1400sub1:DefaultValue=0x380",)),
    Case("V020", ("1014:DefaultValue=$NODE+0x80",), "1014:DefaultValue", ("1014:DefaultValue=$NODEID+128",)),
    Case("V021", ("2003sub1:DefaultValue=0x-3",), "2003sub1:DefaultValue", ("2003sub1:DefaultValue=-0x3",)),
    # P: PDOs
    Case("P001", not_optional(0x1A00, 10, "-1A00sub0", "-1A00sub1", "-1A00sub2", "-1A00sub3"), "1800", SECOND_TPDO),
    Case("P002", ("1600sub2:DefaultValue=0x20990020",), "1600sub2:DefaultValue", ("1600sub2:DefaultValue=0x20000020",)),
    Case("P003", ("1600sub2:DefaultValue=0x607A0010",), "1600sub2:DefaultValue", ("1600sub2:DefaultValue=0x607A0020",)),
    Case("P004", ("1600sub2:DefaultValue=0x60810020",), "1600sub2:DefaultValue", ("1600sub2:DefaultValue=0x20000020",)),
    Case("P005", ("1600sub2:DefaultValue=0x60640020",), "1600sub2:DefaultValue", ("1A00sub1:DefaultValue=0x60400010",)),
    Case("P006", ("1A00sub0:DefaultValue=3", "1A00sub1:DefaultValue=0x60640020", "1A00sub3:DefaultValue=0x20000020"),
         "1A00sub3:DefaultValue", ("1A00sub1:DefaultValue=0x60640020",)),
    Case("P007", not_optional(0x1800, 9, *(f"-1800sub{sub}" for sub in (0, 1, 2, 3, 5)), "DeviceInfo:NrOfTXPDO=0"), "1A00",
         SECOND_TPDO),
    Case("P008", ("1A00sub0:DefaultValue=4",), "1A00sub0:DefaultValue", ("1A00sub0:DefaultValue=0xFF",)),  # FFh: an MPDO
    Case("P009", ("1800sub3:DataType=0x0007",), "1800sub3:DataType", ("1800sub3:DataType=6",)),
    Case("P010", ("1600sub2:DefaultValue=0x00070020",), "1600sub2:DefaultValue", ("1600sub2:DefaultValue=0x00060010",)),
    Case("P011", ("-1800sub2", "1800:SubNumber=4"), "1800", ("-1800sub3", "1800:SubNumber=5")),
    Case("P012", ("1400sub2:DefaultValue=253",), "1400sub2:DefaultValue", ("1800sub2:DefaultValue=253",)),
    Case("P013", ("1800sub1:DefaultValue=$NODEID+0x600",), "1800sub1:DefaultValue",
         ("1800sub1:DefaultValue=$NODEID+0x80000600",)),
    Case("P014", (*SECOND_TPDO, "1801sub1:DefaultValue=$NODEID+0x180"), "1801sub1:DefaultValue",
         (*SECOND_TPDO, "1801sub1:DefaultValue=$NODEID+0x80000180")),
    Case("P015", ("1A00sub0:DefaultValue=3",), "1A00sub3:DefaultValue", ("1A00sub3:DefaultValue=0x0",)),
    Case("P016", ("1A00sub0:DefaultValue=0",), "1A00sub0:DefaultValue",
         ("1A00sub0:DefaultValue=0", "1A00sub1:DefaultValue=0", "1A00sub2:DefaultValue")),
    Case("P017", ("1A00sub0:DefaultValue=3", "1A00sub3:DefaultValue=0x60410010"), "1A00sub3:DefaultValue",
         ("1A00sub3:DefaultValue=0x60410010",)),
    # C: CiA 301
    Case("C001", ("-1001", "MandatoryObjects:2=0x1018", "MandatoryObjects:3", "MandatoryObjects:SupportedObjects=2"),
         "MandatoryObjects", ("1001:ParameterName=Errors",)),
    Case("C002", ("1018:ObjectType=0x8",), "1018:ObjectType", ("1018:ObjectType=9",)),
    Case("C003", ("1017:DataType=0x0007",), "1017:DataType", ("1017:DataType=6",)),
    Case("C004", ("1001:AccessType=rw",), "1001:AccessType", ("1001:AccessType=const",)),
    Case("C005", ("1000:DefaultValue",), "1000", ("1000:DefaultValue=0x192",)),
    Case("C006", not_optional(0x1017, 5), "OptionalObjects", ("1017:AccessType=ro",)),
    Case("C007", not_optional(0x1014, 4), "1003", not_optional(0x1003, 1, "-1003sub0", "-1003sub1")),
    Case("C008", ("-1018", *(f"-1018sub{sub}" for sub in range(5)), "MandatoryObjects:3", "MandatoryObjects:SupportedObjects=2"),
         "MandatoryObjects", ("-1018sub4", "1018:SubNumber=4", "1018sub0:DefaultValue=3")),
    Case("C009", not_optional(0x1005, 2), "1800sub2:DefaultValue", (*not_optional(0x1005, 2), "1800sub2:DefaultValue=254")),
    Case("C010", ("1005:DefaultValue=0x40000080",), "1005:DefaultValue", ("1005:DefaultValue=0x80000080",)),
    Case("C011", ("OptionalObjects:25=0x100C", "OptionalObjects:SupportedObjects=25",
                  ">[100C]\nParameterName=Guard time\nObjectType=0x7\n"
                  "DataType=0x0006\nAccessType=rw\nDefaultValue=0\nPDOMapping=0\n"),
         "100C", ()),
    Case("C012", ("1200sub1:DefaultValue=$NODEID+0x580",), "1200sub1:DefaultValue", ("1200sub1:DefaultValue=0x605",)),
    Case("C013", ("1014:DefaultValue=$NODEID+0x81",), "1014:DefaultValue", ("1014:DefaultValue=$NODEID+0x80000080",)),
    Case("C014", (*OVERFLOW, "1019:DefaultValue=1"), "1019:DefaultValue", OVERFLOW),
    Case("C015", ("OptionalObjects:25=0x1021", "OptionalObjects:SupportedObjects=25",
                  ">[1021]\nParameterName=Store EDS\nObjectType=0x2\nDataType=0x000F\nAccessType=ro\n"), "1021", ()),
    Case("C016", ("1005:DefaultValue=0x40000000",), "1005:DefaultValue", ("1005:DefaultValue=0x40000081",)),
    Case("C017", ("-1200sub2", "1200:SubNumber=2", "1200sub0:DefaultValue=1"), "1200", ()),
    Case("C020", ("1A00:ObjectType=0x8",), "1A00:ObjectType", ("1A00:ObjectType=9",)),
    Case("C021", ("1017:AccessType=ro",), "1017:AccessType", ("1001:AccessType=ro",)),
    # M: CiA 402
    Case("M001", not_optional(0x6041, 14), "1000:DefaultValue",
         (*not_optional(0x6041, 14), "1000:DefaultValue=0x00020191")),  # an I/O device has none
    Case("M001c", not_optional(0x6083, 21), "6502:DefaultValue", (*not_optional(0x6083, 21), "6502:DefaultValue=0x80")),
    Case("M002", ("6064:DataType=0x0007",), "6064:DataType", ("6064:DataType=4",)),
    Case("M003", ("607D:ObjectType=0x9",), "607D:ObjectType", ("607D:ObjectType=8",)),
    Case("M004", ("6041:AccessType=rw",), "6041:AccessType", ("6040:AccessType=rww",)),
    Case("M005", ("6060:PDOMapping=0",), "6060:PDOMapping", ("6081:PDOMapping=0",)),
    Case("M006", ("6502:DefaultValue",), "6502", ("6502:DefaultValue=0",)),
    Case("M007", ("1000:DefaultValue=0x00020912",), "1000:DefaultValue", ("1000:DefaultValue=0xFFFF0192",)),
    Case("M008", ("6502:DefaultValue=0x000000A1",), "6502:DefaultValue", ("6502:DefaultValue=0x00000080",)),
    Case("M009", ("6502:DefaultValue=0x00000080",), "6502:DefaultValue", ("6502:DefaultValue=0x00000001",)),
    Case("M010", ("6502:DefaultValue=0x00001081",), "6502:DefaultValue", ("6502:DefaultValue=0x00010081",)),
    Case("M011", ("6060:DefaultValue=6",), "6060:DefaultValue", ("6060:DefaultValue=-6",)),
    Case("M012", not_optional(0x6086, 22), "6502:DefaultValue", (*not_optional(0x6086, 22), "6502:DefaultValue=0x80")),
    Case("M013", SECOND_AXIS, "OptionalObjects", (*SECOND_AXIS, *AXIS_TYPE)),
    Case("M014", ("-607Dsub2", "607D:SubNumber=2", "607Dsub0:DefaultValue=1"), "607D",
         ("-60C2sub2", "60C2:SubNumber=2", "60C2sub0:DefaultValue=1", "-60C2", "-60C2sub0", "-60C2sub1")),
    Case("M015", ("605A:DefaultValue=9",), "605A:DefaultValue", ("605A:DefaultValue=-9",)),
    Case("M016", ("605A:DefaultValue=0",), "605A:DefaultValue", ("605A:DefaultValue=1",)),
    Case("M017", ("607A:LowLimit=0",), "607A:LowLimit", ("6081:LowLimit=0",)),
    Case("M018", (*not_optional(0x6083, 21), "6502:DefaultValue"), "6081", ("6502:DefaultValue",)),
    Case("M019", (*HOMING, "6098:DefaultValue=36"), "6098:DefaultValue", (*HOMING, "6098:DefaultValue=-36")),
    Case("M020", (*not_optional(0x6061, 16), "6502:DefaultValue=0x80"), "6060", not_optional(0x6060, 15)),
    Case("M021", ("607Dsub1:DefaultValue=200",), "607Dsub1:DefaultValue", ("607Dsub1:DefaultValue=100",)),
    # K: DCF
    Case("K001", (*DCF, without("DeviceComissioning", "DeviceCommissioning")), "DeviceCommissioning", DCF),
    Case("K002", (*DCF, "-DeviceComissioning"), "", DCF),
    Case("K003", (*DCF, "DeviceComissioning:NodeID=128"), "DeviceComissioning:NodeID", (*DCF, "DeviceComissioning:NodeID=127")),
    Case("K004", (*DCF, "DeviceComissioning:Baudrate=100"), "DeviceComissioning:Baudrate",
         (*DCF, "DeviceComissioning:Baudrate=1000")),
    Case("K005", (*DCF, "1018sub2:ParameterValue=9"), "1018sub2:ParameterValue", (*DCF, "1018sub4:ParameterValue=9")),
    Case("K006", (*DCF, "2000:DownloadFile=gain.bin"), "2000:DownloadFile", (*DCF, "2002:DownloadFile=firmware.bin")),
    Case("K007", ("2000:ParameterValue=6",), "2000:ParameterValue", (*DCF, "2000:ParameterValue=6")),
    Case("K008", (*DCF, "DeviceComissioning:NodeName=" + "x" * 247), "DeviceComissioning:NodeName",
         (*DCF, "DeviceComissioning:NodeName=" + "x" * 246)),
    Case("K009", (*DCF, "DeviceComissioning:NetNumber=one"), "DeviceComissioning:NetNumber",
         (*DCF, "DeviceComissioning:NetNumber=0xFFFFFFFF")),
    Case("K010", ("1F22sub1:DefaultValue=" + concise(SET_8, count=2),), "1F22sub1:DefaultValue",
         ("1F22sub1:DefaultValue=" + concise(SET_8),)),
    Case("K011", ("1F22sub1:DefaultValue=" + concise(*MAPPED[1:]),), "1F22sub1:DefaultValue",
         ("1F22sub1:DefaultValue=" + concise(*MAPPED),)),
    Case("K012", ("1F22sub1:DefaultValue=" + concise(VERIFIED, SET_8),), "1F22sub1:DefaultValue",
         ("1F22sub1:DefaultValue=" + concise(SET_8, VERIFIED),)),
    Case("K013", (*DCF, "2000:Denotation=" + "x" * 242), "2000:Denotation", (*DCF, "2000:Denotation=" + "x" * 241)),
    Case("K014", (*DCF, "DeviceComissioning:Baudrate=10"), "DeviceComissioning:Baudrate", DCF),
    Case("K015", (*DCF, "DeviceComissioning:CANopenManager=yes"), "DeviceComissioning:CANopenManager",
         (*DCF, "DeviceComissioning:CANopenManager=1")),
    # X: modules
    Case("X001", (*MODULES, "SupportedModules:NrOfEntries=2"), "SupportedModules:NrOfEntries", MODULES),
    Case("X002", (*MODULES, ">\n[M2Comments]\nLines=0\n"), "M2Comments", (*MODULES, ">\n[M1Comments]\nLines=0\n")),
    Case("X003", (*MODULES, "M1ModuleInfo:OrderCode"), "M1ModuleInfo", MODULES),
    Case("X004", (*MODULES, "M1FixedObjects:NrOfEntries=2"), "M1FixedObjects:NrOfEntries", MODULES),
    Case("X005", (*MODULES, "-M1Fixed3000"), "M1FixedObjects:1", MODULES),
    Case("X006", (*MODULES, "M1SubExt2003:Count=two"), "M1SubExt2003:Count", (*MODULES, "M1SubExt2003:Count=0;2")),
    Case("X007", (*MODULES, ">\n[ConnectedModules]\nNrOfEntries=1\n1=2\n"), "ConnectedModules:1",
         (*MODULES, ">\n[ConnectedModules]\nNrOfEntries=1\n1=1\n")),
)  # fmt: skip
