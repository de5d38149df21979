"""Every rule that an EDS or DCF is checked by, as one table: how bad a breach is, where the rule stands, and what to do."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.eds.model import Severity


class Rule(NamedTuple):
    """One rule.

    ``severity`` is the worst that a breach can be, ``clause`` where the rule stands, ``title`` a sentence that says what is found,
    ``remedy`` what to do first, ``explanation`` why it matters.
    """

    severity: Severity
    clause: str
    title: str
    remedy: str
    explanation: str


_E, _W, _N = Severity.ERROR, Severity.WARNING, Severity.NOTE
_306, _301, _402 = "CiA DS 306", "CiA 301", "CiA 402-2"

# S: text; F: [FileInfo]; D: [DeviceInfo], [DummyUsage], [Comments]; L: object lists.
_FILE = {
    "S000": Rule(
        _E, f"{_306} 4.1",
        "The file cannot be read as an EDS or DCF.",
        "give an EDS or DCF: a text with sections such as [DeviceInfo] and [1000]",
        "Nothing else was checked. The message says whether the file is missing, cannot be opened, or holds something else: a "
        "picture, an XML device description (XDD), an archive.",
    ),
    "S001": Rule(
        _W, f"{_306} 4.2",
        "The file holds letters beyond ASCII.",
        "write the file in ASCII (DS 306 4.2)",
        "The standard allows ISO 646 only. What a µ or ü is depends on the code page that a tool assumes; many stop with an "
        "error at a byte that their code page does not have.",
    ),
    "S002": Rule(
        _E, f"{_306} 4.2",
        "The file begins with a byte order mark or is written in UTF-16.",
        "save the file as ASCII without a byte order mark; other tools will not read it",
        "The mark stands before the first '[', so that most readers do not see the first section; UTF-16 they do not read at all.",
    ),
    "S003": Rule(
        _E, f"{_306} 4.2",
        "A section is there twice.",
        "delete one of the two; the first is used, the second is ignored as a whole",
        "Tools differ in which one they take, or refuse the file; two descriptions of one object that disagree are then two "
        "devices. [2000sub1] and [2000sub01] are the same section too.",
    ),
    "S004": Rule(
        _E, f"{_306} 4.2",
        "A key is there twice in its section.",
        "delete one of the two; the first is used",
        "Tools differ in which value they take, or refuse the file. In a list of objects one of the two objects is lost.",
    ),
    "S005": Rule(
        _E, f"{_306} 4.2",
        "Text stands before the first section.",
        "put it under a section, or behind ';' as a comment",
        "Readers of INI files refuse a file that does not begin with a section or a comment.",
    ),
    "S006": Rule(
        _E, f"{_306} 4.2",
        "A line is neither a section, nor key=value, nor a comment.",
        "write key=value, or ';' in column 1 for a comment",
        "Often the rest of a value that was broken over two lines, or a comment with another mark than ';'. Readers of INI "
        "files refuse it or append it to the value before.",
    ),
    "S007": Rule(
        _W, f"{_306} 4.2",
        "A line has more than 255 characters.",
        "shorten the text",
        "A tool may read lines into a buffer of 255 characters and take the rest for a line of its own.",
    ),
    "S008": Rule(
        _N, f"{_306} 4.2",
        "A space stands before an equals sign.",
        "write the equals sign directly after the key",
        "The standard wants the key followed by '=' directly. Most tools do not mind; one that does will not find the key.",
    ),
    "S009": Rule(
        _W, f"{_306} 4.2",
        "The line of a section is indented.",
        "begin the line with '['; some readers take an indented line as part of the value before it",
        "Python's configparser, on which many tools stand, continues the value of the line before with an indented line, and "
        "so loses the section.",
    ),
    "S010": Rule(
        _E, f"{_306} 4.2",
        "The name of a section is not closed.",
        "close the section's name with ']'",
        "Tools lose the section, and give its keys to the section before.",
    ),
    "S011": Rule(
        _W, f"{_306} 4.2",
        "A comment or other text follows a value or a section's name.",
        "comments stand on a line of their own, ';' in column 1; this one is ignored",
        "A comment begins in column 1 only. To most tools what follows belongs to the value, which then is no number any more.",
    ),
    "S012": Rule(
        _W, f"{_306} 4.4 to 6",
        "A section is not of DS 306.",
        "other tools may refuse it; remove it if nothing uses it",
        "Editors leave sections of their own behind. Often a misspelt name, so that the section that was meant is missing.",
    ),
    "S013": Rule(
        _N, f"{_306} 4.2",
        "A comment does not begin in column 1.",
        "begin the comment in column 1",
        "The standard knows ';' as the mark of a comment in column 1 only; elsewhere a tool may take it for text.",
    ),
    "S014": Rule(
        _W, f"{_306} 4.2",
        "The lines end in CR alone.",
        "save the file with LF or CR LF at the end of each line",
        "To most tools the whole file is then one line.",
    ),
    "S015": Rule(
        _N, f"{_306} 4.2",
        "Some lines end in LF, others in CR LF.",
        "save the file with one kind of line end",
        "Comes of editing on two kinds of computers; harmless to most tools, and a nuisance when versions are compared.",
    ),
    "S016": Rule(
        _N, f"{_306} 4.3 to 5",
        "A key is not of DS 306.",
        "nothing, if it is a key of the maker's own tool",
        "Other tools ignore it. Each such key is named once in a file, where it comes first.",
    ),
    "S017": Rule(
        _W, f"{_306} 4.3 to 5",
        "A key looks like a misspelling of one that is missing.",
        "correct the spelling; as it is the entry counts as absent",
        "Tools ignore a key that they do not know, and the entry that was meant takes its default.",
    ),
    "S018": Rule(
        _W, f"{_306} 4.2",
        "The file holds a control character.",
        "remove it",
        "An unprinted character inside a value makes it another value; some tools stop reading at it.",
    ),
    "S099": Rule(
        _N, "",
        "More was found than is listed.",
        "mend the findings listed and read the file again",
        "So that a file of noise does not fill the screen, and the memory, with texts about it.",
    ),
    "F001": Rule(
        _W, f"{_306} 4.4",
        "[FileInfo] or one of its entries is missing.",
        "add FileName, FileVersion, FileRevision, Description, CreationTime, CreationDate and CreatedBy",
        "Nobody can tell then which of two files is the newer one. EDSVersion may be missing, which means 3.0.",
    ),
    "F002": Rule(
        _N, f"{_306} 4.4",
        "FileName is not the name of the file.",
        "give the file its name back, or correct FileName",
        "Most files were renamed since; it is the maker's name for the file, worth knowing when asking the maker about it.",
    ),
    "F003": Rule(
        _W, f"{_306} 4.4",
        "FileVersion or FileRevision is no UNSIGNED8.",
        "give a whole number, 0 to 255",
        "Version 1.2 of a file is FileVersion=1 and FileRevision=2. A tool that reads numbers may refuse the file.",
    ),
    "F004": Rule(
        _W, f"{_306} 4.4",
        "A date has not the form mm-dd-yyyy.",
        "write the month first: 03-25-2024",
        "Written with the day first, 03-04-2024 means another day and nobody can tell.",
    ),
    "F005": Rule(
        _W, f"{_306} 4.4",
        "A time has not the form hh:mm(AM|PM).",
        "write it on the twelve-hour clock, such as 02:38PM",
        "02:38 without AM or PM means two times. Only tools that show the entry notice.",
    ),
    "F006": Rule(
        _W, f"{_306} 4.4",
        "A text of [FileInfo] is too long.",
        "shorten it: Description 243, CreatedBy 245, ModifiedBy 244 characters",
        "With the key such a line exceeds 255 characters, which a tool need not read.",
    ),
    "F007": Rule(
        _N, f"{_306} 4.4",
        "The file was modified before it was created.",
        "correct the dates",
        "Often day and month are exchanged in one of them, or the file was made from an older one.",
    ),
    "F008": Rule(
        _N, f"{_306} 5",
        "A DCF does not name the EDS of which it was made.",
        "add LastEDS with the name of the EDS",
        "The DCF can otherwise not be brought up to date when the maker gives out a new EDS.",
    ),
    "F009": Rule(
        _W, f"{_306} 4.4",
        "EDSVersion is no version of the format.",
        "write EDSVersion=4.0",
        "It is the version of the standard by which the file is written, x.y with three characters: 3.0 or 4.0. It is not the "
        "number of the device profile, and not the version of the file.",
    ),
    "F010": Rule(
        _N, f"{_306} 4.4",
        "FileName is a path of somebody's computer.",
        "leave only the file's name",
        "It tells everyone who gets the file the folders and customers of whoever wrote it.",
    ),
    "D001": Rule(
        _N, f"{_306} 4.5",
        "[DeviceInfo] or one of its entries is missing.",
        "add what is missing",
        "A tool assumes a value, or refuses the file. Missing identity numbers are D002, missing bit rates D008.",
    ),
    "D002": Rule(
        _W, f"{_306} 4.5",
        "VendorNumber, ProductNumber or RevisionNumber is missing.",
        "give the values of 1018h",
        "By these numbers a tool finds the file that belongs to a device which it has found on the bus.",
    ),
    "D003": Rule(
        _N, f"{_306} 4.5",
        "VendorNumber or ProductNumber is 0.",
        "give the values of 1018h; CiA assigns the vendor-ID",
        "0 stands for no vendor and no product: the file cannot be matched with a device on the bus.",
    ),
    "D004": Rule(
        _W, f"{_306} 4.5, {_301} 7.5.2.19",
        "[DeviceInfo] has another identity than the defaults of 1018h.",
        "give both the number that the device answers with",
        "A tool compares one of the two with the device; if that is the wrong one, it refuses the device or takes another file "
        "for it.",
    ),
    "D005": Rule(
        _W, f"{_306} 4.5",
        "An entry of [DeviceInfo] that says yes or no is neither 1 nor 0.",
        "write 1 or 0",
        "SimpleBootUpMaster, SimpleBootUpSlave, GroupMessaging and LSS_Supported are BOOLEAN.",
    ),
    "D006": Rule(
        _W, f"{_306} 4.5",
        "NrOfRXPDO or NrOfTXPDO is not the number of PDOs that are described.",
        "count the communication parameters: 1400h to 15FFh, and 1800h to 19FFh",
        "A tool that lays out memory by the number leaves PDOs out, or offers some that are not there.",
    ),
    "D007": Rule(
        _W, f"{_306} 4.5",
        "A text of [DeviceInfo] is too long.",
        "shorten it: VendorName 244, ProductName 243, OrderCode 245 characters",
        "With the key such a line exceeds 255 characters, which a tool need not read.",
    ),
    "D008": Rule(
        _W, f"{_306} 4.5",
        "No bit rate is supported.",
        "set those of BaudRate_10 to BaudRate_1000 to 1 that the device supports",
        "A tool that offers only supported bit rates cannot configure the device.",
    ),
    "D009": Rule(
        _E, f"{_306} 4.5",
        "VendorNumber, ProductNumber or RevisionNumber is no number.",
        "give an UNSIGNED32, such as 0x00000123",
        "Tools read a number here and stop with an error at anything else.",
    ),
    "D010": Rule(
        _W, f"{_306} 4.5",
        "The entry of a bit rate is neither 1 nor 0.",
        "write 1 where the device supports the bit rate, else 0",
        "BaudRate_10 to BaudRate_1000 are BOOLEAN.",
    ),
    "D011": Rule(
        _W, f"{_306} 4.5",
        "A bit rate is not of CiA 301.",
        "remove the entry; 10, 20, 50, 125, 250, 500, 800 and 1000 kbit/s are defined",
        "Tools ignore it. 100 kbit/s is the one seen most.",
    ),
    "D012": Rule(
        _N, f"{_306} 4.5",
        "BaudRate_ is written in other letters.",
        "write BaudRate_, with two capitals",
        "Keys are not case-sensitive, but some tools compare them exactly and then know no bit rate.",
    ),
    "D013": Rule(
        _W, f"{_306} 4.5",
        "Dynamic channels are supported, but not described.",
        "add [DynamicChannels], or set DynamicChannelsSupported=0",
        "Without the section no tool can lay out network variables.",
    ),
    "D014": Rule(
        _W, f"{_306} 4.5",
        "Granularity is not in 0 to 64.",
        "give the smallest number of bits that can be mapped: 1, 8 or 64; 0 where the mapping is fixed",
        "By it a tool knows whether it may map single bits.",
    ),
    "D015": Rule(
        _W, f"{_306} 4.5",
        "CompactPDO is no mask of the sub-indices of a communication parameter.",
        "set bit n-1 for sub-index n; there are six",
        "Reserved bits stand for sub-indices that no PDO has.",
    ),
    "D016": Rule(
        _W, f"{_306} 4.6.2",
        "An entry of [DummyUsage] is not Dummyxxxx=0 or 1.",
        "write the index of a data type with four digits, such as Dummy0005=1",
        "A tool that does not understand the entry cannot leave gaps in an RPDO.",
    ),
    "D017": Rule(
        _W, f"{_306} 4.6.5",
        "Lines is not the number of comment lines.",
        "give the number of Line1, Line2, …",
        "A tool shows only as many lines as the number says.",
    ),
    "D018": Rule(
        _W, f"{_306} 4.6.5",
        "A comment line is too long.",
        "break it into lines of at most 249 characters",
        "With the key such a line exceeds 255 characters, which a tool need not read.",
    ),
    "L001": Rule(
        _W, f"{_306} 4.6.3.1",
        "A list of objects is missing.",
        "add [MandatoryObjects], [OptionalObjects] or [ManufacturerObjects] with SupportedObjects and the objects' indices",
        "Tools read the objects that the lists name; what is in no list does not exist for them.",
    ),
    "L003": Rule(
        _E, f"{_306} 4.6.3.1",
        "SupportedObjects is not the number of objects in its list.",
        "correct SupportedObjects",
        "Tools read as many entries as the number says: they lose objects at the end, or stop with an error at the entry that "
        "is not there.",
    ),
    "L004": Rule(
        _W, f"{_306} 4.6.3.1",
        "The entries of a list of objects are not numbered 1, 2, 3, …",
        "number the entries from 1, in decimal, without a gap",
        "Tools count up from 1 and stop, or fail, at the gap. Only the first place is shown in each list.",
    ),
    "L005": Rule(
        _E, f"{_306} 4.6.3.1",
        "An object is listed, but not described.",
        "add its section, or take it out of the list",
        "Tools stop with an error, or show an object without name and type.",
    ),
    "L006": Rule(
        _W, f"{_306} 4.6.3.1",
        "An object is described, but not listed.",
        "add it to the list and count it in SupportedObjects",
        "Tools that go by the lists do not see the object at all.",
    ),
    "L007": Rule(
        _W, f"{_306} 4.6.3.1",
        "An object is listed twice.",
        "take it out of one of the lists",
        "A tool may show it twice, or refuse the file.",
    ),
    "L008": Rule(
        _W, f"{_306} 4.6.3.1",
        "An object stands in the wrong list.",
        "list 1000h, 1001h and 1018h as mandatory, 2000h to 5FFFh as the manufacturer's, all others as optional",
        "Tools sort objects by list; code generators give the manufacturer's objects names of their own.",
    ),
    "L009": Rule(
        _E, f"{_306} 4.6.3.1",
        "An entry of a list is no index.",
        "write the index, such as 0x6040",
        "A tool stops with an error, or takes decimal digits for another object.",
    ),
}  # fmt: skip

# O: objects and sub-indices; B: compact sub-indices and the lists beside an object; V: values.
_OBJECTS = {
    "O001": Rule(
        _E, f"{_306} 4.6.3.2",
        "ParameterName is missing.",
        "add ParameterName",
        "It is mandatory for every object and sub-index; tools stop with an error without it.",
    ),
    "O002": Rule(
        _E, f"{_306} 4.6.3.2",
        "DataType is missing or unknown.",
        "add DataType with a type of CiA 301, such as 0x0007 for UNSIGNED32",
        "Without it nobody knows how many octets to send, nor what those received mean.",
    ),
    "O003": Rule(
        _E, f"{_306} 4.6.3.2",
        "AccessType is missing or unknown.",
        "write one of ro, wo, rw, rwr, rww, const; rw is assumed",
        "Tools offer a write that the device refuses, or refuse a PDO mapping that it would take.",
    ),
    "O004": Rule(
        _E, f"{_306} 4.6.3.2",
        "ObjectType is unknown.",
        "write one of 0x2 (DOMAIN), 0x7 (VAR), 0x8 (ARRAY), 0x9 (RECORD)",
        "By it a tool knows whether the object has sub-indices.",
    ),
    "O005": Rule(
        _E, f"{_306} 4.6.3.2",
        "A sub-index is described, its object is not.",
        "add the section of the object itself; a RECORD is assumed",
        "Tools look for the object first, and never see the sub-index.",
    ),
    "O006": Rule(
        _W, f"{_306} 4.6.3.2",
        "ObjectType is missing where there are sub-indices.",
        "add ObjectType; without it VAR is meant, but this object has sub-indices: a RECORD is assumed",
        "A missing ObjectType means VAR, and a VAR has no sub-indices.",
    ),
    "O007": Rule(
        _E, f"{_306} 4.6.3.2",
        "SubNumber is not the number of sub-indices described.",
        "count the sub-index sections, sub-index 0 among them",
        "Tools read until they have found as many as the number says: too few and they lose sub-indices, too many and they "
        "stop with an error. It is not the highest sub-index: gaps do not count, sub-index 0 does.",
    ),
    "O008": Rule(
        _E, f"{_306} 4.6.3.2, {_301} 7.4.4",
        "An ARRAY or RECORD has no sub-index 0.",
        "add sub-index 0 (UNSIGNED8), or make the object a VAR",
        "Sub-index 0 holds the highest sub-index, which a master reads first.",
    ),
    "O009": Rule(
        _E, f"{_301} 7.4.4",
        "Sub-index 0 is not UNSIGNED8.",
        "give it DataType=0x0005",
        "A master sends one octet to set it, as with every PDO mapping; a tool by this file sends more, and the device aborts.",
    ),
    "O010": Rule(
        _W, f"{_301} 7.4.4",
        "The default of sub-index 0 is not the highest sub-index.",
        "give the highest sub-index that is described",
        "A master that reads as many sub-indices as it says misses some, or asks for some that are not there. Objects whose "
        "sub-index 0 can be written, mappings and the error history count what is in use, and are left out.",
    ),
    "O011": Rule(
        _E, f"{_306} 4.6.3.2",
        "An object that can have no sub-indices has some.",
        "make it an ARRAY (0x8) or RECORD (0x9), or delete the sub-indices, which are ignored",
        "Tools read it as one value, and the sub-indices are lost.",
    ),
    "O012": Rule(
        _W, f"{_306} 4.6.3.2",
        "A sub-index has leading zeros in its section's name.",
        "write the sub-index without leading zeros",
        "[1018sub01] is not the name that tools look for; they do not find the sub-index.",
    ),
    "O013": Rule(
        _E, f"{_306} 4.6.3.2",
        "The number of compact sub-indices, or an entry beside them, is none.",
        "give the number of entries, 0 to 254",
        "CompactSubObj says how many sub-indices there are; the keys of [xxxxName] and [xxxxValue] are sub-indices in decimal.",
    ),
    "O014": Rule(
        _N, f"{_306} 4.6.3.2",
        "Two sub-indices of an object share a name.",
        "give each its own name",
        "Looking an entry up by its name finds the first only, and generated code has to number them. One place is shown per "
        "object.",
    ),
    "O015": Rule(
        _W, f"{_306} 4.6.3.2",
        "A name is too long.",
        "shorten it to 241 characters",
        "With the key such a line exceeds 255 characters, which a tool need not read.",
    ),
    "O016": Rule(
        _W, f"{_306} 4.6.3.2",
        "PDOMapping is neither 0 nor 1.",
        "write 1 where the entry can be mapped into a PDO, else 0",
        "It is BOOLEAN; by it a tool decides what to offer for mapping.",
    ),
    "O017": Rule(
        _W, f"{_306} 4.6.3.2",
        "SubNumber or CompactSubObj stands at an object without sub-indices.",
        "remove it, or make the object an ARRAY or RECORD",
        "Both belong to ARRAY and RECORD only; a tool may look for sub-indices that are not there.",
    ),
    "O018": Rule(
        _W, f"{_306} 4.6.3.2",
        "A DOMAIN can be mapped or has limits.",
        "remove PDOMapping and the limits",
        "A DOMAIN is a block of any length, which fits no PDO and has no smallest value.",
    ),
    "O019": Rule(
        _N, f"{_306} 4.6.3.2",
        "AccessType is written in capitals.",
        "write it in small letters",
        "The standard prints ro, wo, rw, rwr, rww and const; some tools compare exactly.",
    ),
    "O020": Rule(
        _N, f"{_306} 4.6.3.2",
        "PDOMapping is missing.",
        "write PDOMapping=0 or 1",
        "The standard lets it be missing, which means 0; tools exist that ask for it, or take it for 1.",
    ),
    "O021": Rule(
        _W, f"{_306} 4.6.3.2",
        "A name is empty.",
        "give the entry a name",
        "Nobody can tell what the entry is, and it cannot be looked up.",
    ),
    "O022": Rule(
        _W, f"{_306} 4.6.3.2",
        "DataType or AccessType stands at an ARRAY or RECORD.",
        "leave them to the sub-indices",
        "Only an object with CompactSubObj has them. A tool may take the object for a single value.",
    ),
    "O023": Rule(
        _W, f"{_306} 4.6.3.2",
        "A value, limit or PDOMapping stands at an ARRAY or RECORD.",
        "leave them to the sub-indices",
        "The object as a whole has no value; a tool ignores the entry, or refuses the file.",
    ),
    "O024": Rule(
        _E, f"{_306} 4.6.3.2",
        "SubNumber is missing.",
        "add SubNumber with the number of sub-index sections",
        "It is mandatory for ARRAY and RECORD; a tool that counts by it finds no sub-indices.",
    ),
    "O025": Rule(
        _N, f"{_306} 4.6.3.2",
        "Sub-index 0 has no default.",
        "give the highest sub-index as DefaultValue",
        "The standard does not ask for it; but tools work without the device, and then take 0 sub-indices.",
    ),
    "O026": Rule(
        _W, f"{_301} 7.4.4",
        "The elements of an ARRAY have different types.",
        "give all the same type, or make the object a RECORD",
        "All elements of an ARRAY are of one type; a tool may use that of the first for all. One place is shown per object.",
    ),
    "O027": Rule(
        _N, f"{_306} 4.6.3.2",
        "Two objects share a name.",
        "give each its own name",
        "Looking an object up by its name finds the first only, and generated code has to number them.",
    ),
    "O028": Rule(
        _N, f"{_306} 4.6.3.3",
        "A write to the object does something, and a DCF download is not kept from it.",
        "add ObjFlags=0x1, so that a download leaves the object out",
        "1010h stores, 1011h restores, 1F50h and those behind it load programs. A tool that downloads a DCF writes every value "
        "in it.",
    ),
    "O029": Rule(
        _W, f"{_306} 4.6.3.3",
        "ObjFlags has reserved bits.",
        "keep bit 0 (refuse write on download) and bit 1 (refuse read on scan), and clear the others",
        "Later versions of the standard may give them a meaning.",
    ),
    "O030": Rule(
        _W, f"{_306} 4.6.3.2",
        "A sub-index is an ARRAY or RECORD.",
        "write ObjectType=0x7",
        "A sub-index is a single value; a tool may look for sub-indices of it.",
    ),
    "B001": Rule(
        _W, f"{_306} 4.6.3.2",
        "SubNumber stands beside CompactSubObj.",
        "write SubNumber=0, or leave it out",
        "An object describes its sub-indices one by one or in short, not both.",
    ),
    "B002": Rule(
        _W, f"{_306} 4.6.3.2, 5",
        "NrOfEntries is not the number of entries.",
        "correct NrOfEntries",
        "Tools read as many names, values or denotations as the number says.",
    ),
    "B003": Rule(
        _W, f"{_306} 4.6.4",
        "ObjectLinks is not the number of links.",
        "correct ObjectLinks",
        "Tools read as many links as the number says.",
    ),
    "B004": Rule(
        _W, f"{_306} 4.6.4",
        "A link leads to an object that is not described.",
        "correct or remove the link",
        "Links group objects that belong together; a tool shows nothing, or stops with an error.",
    ),
    "B005": Rule(
        _W, f"{_306} 4.6.3.2, 4.6.4",
        "Names, values or links belong to no object.",
        "add the object's section, or remove this one",
        "The section says something about an object that the file does not describe.",
    ),
    "V001": Rule(
        _E, f"{_306} 4.3",
        "A value is none of its type.",
        "correct the value; until then it counts as absent",
        "Tools stop with an error, or take 0.",
    ),
    "V002": Rule(
        _E, f"{_306} 4.3",
        "A limit is beyond the data type.",
        "give limits that the data type can hold; until then there are none",
        "0 to 0xFF for an INTEGER8 means 0 to -1 to a tool that reads two's complement: no value at all is allowed. Often the sign "
        "of the data type is the mistake.",
    ),
    "V003": Rule(
        _W, f"{_306} 4.6.3.2",
        "A value lies outside its limits.",
        "correct the value or the limits",
        "A tool refuses to download the device's own default, or the device aborts the download.",
    ),
    "V004": Rule(
        _E, f"{_306} 4.6.3.2",
        "LowLimit is above HighLimit.",
        "give LowLimit <= HighLimit; until then there are none",
        "No value is allowed then, and a tool refuses every write.",
    ),
    "V005": Rule(
        _E, f"{_306} 4.3",
        "A value does not fit its data type.",
        "give a value that the data type can hold, or another data type; until then it counts as absent",
        "Tools stop with an error, or send the low octets of it.",
    ),
    "V006": Rule(
        _W, f"{_306} 4.3",
        "A formula has $NODEID in another case or place.",
        "write $NODEID+number, in capitals and in this order",
        "Tools that look for $NODEID+ do not find it and take the number alone: every node then has the same identifiers.",
    ),
    "V007": Rule(
        _W, f"{_301} 7.3.5",
        "A COB-ID has a node ID built in.",
        "write $NODEID and the base of the identifier",
        "The file is then right for one node ID only; on another the tool sets identifiers of a stranger. Usual in files that "
        "were saved from a running device.",
    ),
    "V008": Rule(
        _N, f"{_306} 4.6.3.2",
        "A text, time or block of octets has limits.",
        "remove LowLimit and HighLimit",
        "There is no smallest text; a tool may try to read the limit as a number.",
    ),
    "V009": Rule(
        _E, f"{_306} 4.3",
        "An unsigned value is negative.",
        "an unsigned type has no negative values; until it is corrected the value counts as absent",
        "Often the data type should be signed.",
    ),
    "V010": Rule(
        _N, f"{_306} 4.3",
        "A negative number is written in hexadecimal.",
        "write the negative number in decimal",
        "The standard leaves open whether 0x80000000 is allowed for an INTEGER32. Tools that do not know two's complement take "
        "it for a positive number beyond the type.",
    ),
    "V011": Rule(
        _E, f"{_306} 4.3",
        "An integer has a decimal point.",
        "an integer type has no fractions",
        "Tools stop with an error. The unit is often meant, and belongs into the name.",
    ),
    "V012": Rule(
        _W, f"{_306} 4.3",
        "A number has a leading zero, which means octal.",
        "a leading 0 means octal in DS 306: write the number without it",
        "010 is 8 by the standard, and 10 to many tools and to whoever wrote it.",
    ),
    "V013": Rule(
        _W, f"{_306} 4.3",
        "A text is in quotation marks.",
        "write the text without quotation marks, which are not part of it",
        "Texts stand without them; a tool takes them for a part of the text and compares it with what the device answers.",
    ),
    "V014": Rule(
        _W, f"{_306} 4.3",
        "A REAL is written as its bit pattern.",
        "write the number in decimal; as hexadecimal digits it is read as the bit pattern of the type",
        "The standard leaves open how a REAL is written; nearly all files write decimal, and tools read the digits as a whole "
        "number.",
    ),
    "V015": Rule(
        _W, f"{_306} 4.3",
        "A number is written as a word.",
        "write 1 or 0",
        "true and false are no numbers of the standard.",
    ),
    "V016": Rule(
        _W, f"{_306} 4.3",
        "A formula exceeds its data type for high node IDs.",
        "give a larger data type, or another base",
        "With the node ID added the value does not fit any more, and a tool sends its low octets.",
    ),
    "V017": Rule(
        _W, f"{_306} 4.3",
        "A string of octets is not written in pairs of hexadecimal digits.",
        "write pairs of hexadecimal digits without 0x, or leave the value empty",
        "0, 0x0 and NULL are seen where nothing is meant; a tool takes them for octets or stops with an error.",
    ),
    "V018": Rule(
        _W, f"{_306} 4.6.3.2",
        "LowLimit and HighLimit are both 0.",
        "leave both limits out when there are none; LowLimit=HighLimit=0 would allow only 0",
        "An editor's way to say that there are no limits; a tool that takes it by the word refuses every value but 0.",
    ),
    "V019": Rule(
        _W, f"{_301} 7.3.5",
        "A COB-ID is the base of an identifier without $NODEID.",
        "write $NODEID+ before the number",
        "Every node then has the same identifier, and two that send it disturb each other.",
    ),
    "V020": Rule(
        _E, f"{_306} 4.3",
        "A formula is not $NODEID+number.",
        "write $NODEID+number",
        "The standard knows one variable and one sum. Tools stop with an error, or take the text for 0.",
    ),
}  # fmt: skip

# P: PDOs; C: CiA 301; M: CiA 402.
_DEVICE = {
    "P001": Rule(
        _E, f"{_301} 7.5.2.36, 7.5.2.38",
        "A PDO has communication parameters, but no mapping.",
        "add the mapping parameter, 200h above the communication parameter",
        "Nobody can tell what the PDO holds.",
    ),
    "P002": Rule(
        _E, f"{_301} 7.5.2.36, 7.5.2.38",
        "A mapping names an object that is not described.",
        "describe the object, or correct the mapping (index, sub-index and bits, as 0xIIIISSBB)",
        "A tool cannot decode the PDO, and a device refuses the mapping when it is written.",
    ),
    "P003": Rule(
        _E, f"{_301} 7.5.2.36, 7.5.2.38",
        "A mapping takes another number of bits than its object has.",
        "give the bits of the object's data type in the last two digits, or correct the data type",
        "Everything behind it in the frame is read from the wrong place. Where the standard gives the object this size, the "
        "object's data type is the mistake and is reported there (C003, M002).",
    ),
    "P004": Rule(
        _E, f"{_301} 7.5.2.36, 7.5.2.38",
        "A mapping names an object that cannot be mapped.",
        "set PDOMapping=1 on the object if the device allows it, or take it out of the mapping",
        "The file contradicts itself: a tool refuses the default mapping, or leaves the object out.",
    ),
    "P005": Rule(
        _E, f"{_301} 7.5.2.36, 7.5.2.38",
        "A mapping names an object that cannot be written, or read, in this direction.",
        "map objects with rw, wo or rww in an RPDO, with ro, rw, rwr or const in a TPDO",
        "An RPDO writes what it maps, a TPDO reads it. Where the standard allows the direction, the object's access is the "
        "mistake and is reported there (M004).",
    ),
    "P006": Rule(
        _E, f"{_301} 7.4.9",
        "A mapping has more than 64 bits.",
        "take objects out, or spread them over two PDOs",
        "A CAN frame holds eight octets. The place is the entry that crosses the 64 bits.",
    ),
    "P007": Rule(
        _W, f"{_301} 7.5.2.36, 7.5.2.38",
        "A mapping has no communication parameters.",
        "add the communication parameter, 200h below the mapping, or remove the mapping",
        "Some drives offer fixed mappings in this way, of which one is chosen; by the standard it belongs to no PDO.",
    ),
    "P008": Rule(
        _E, f"{_301} 7.5.2.36, 7.5.2.38",
        "More objects are mapped than there are entries.",
        "correct the default of sub-index 0, or add the entries",
        "Nobody can tell what the PDO holds behind the entries that are described.",
    ),
    "P009": Rule(
        _W, f"{_301} 7.5.2.35 to 7.5.2.38",
        "A parameter of a PDO has another type than in CiA 301.",
        "COB-ID and mapping entries are UNSIGNED32, inhibit time and event timer UNSIGNED16, the others UNSIGNED8",
        "A tool that writes by this file sends another number of octets than the device takes.",
    ),
    "P010": Rule(
        _W, f"{_306} 4.6.2",
        "A mapping has a dummy that is not allowed.",
        "set Dummyxxxx=1 in [DummyUsage] if the device supports it, or take it out",
        "Dummies keep space free in an RPDO; [DummyUsage] says for which data types the device can do it.",
    ),
    "P011": Rule(
        _W, f"{_301} 7.5.2.35, 7.5.2.37",
        "COB-ID or transmission type of a PDO is missing.",
        "add sub-indices 1 and 2",
        "Both are mandatory; without them a master cannot find out when the PDO is sent, and under which identifier.",
    ),
    "P012": Rule(
        _W, f"{_301} 7.5.2.35, 7.5.2.37",
        "A transmission type is reserved.",
        "give 0 to 240, 254 or 255; a TPDO may have 252 or 253 too",
        "What the device does is not defined.",
    ),
    "P013": Rule(
        _W, f"{_301} 7.3.5, table 41",
        "A PDO has a COB-ID that is kept for another service.",
        "give another identifier, or set bit 31 where the PDO does not exist after power-up",
        "It collides with NMT, SDO, heartbeat or LSS of some node. A missing $NODEID is often the reason.",
    ),
    "P014": Rule(
        _W, f"{_301} 7.3.5",
        "Two PDOs have the same COB-ID.",
        "give each its own identifier, or set bit 31 in those that do not exist after power-up",
        "Two senders of one identifier disturb each other; two RPDOs with one both take the frame.",
    ),
    "P015": Rule(
        _W, f"{_301} 7.5.2.36, 7.5.2.38",
        "A mapping counts an entry that maps nothing.",
        "lower the default of sub-index 0, or fill the entry",
        "A device that checks its mapping refuses it.",
    ),
    "C001": Rule(
        _E, f"{_301} 7.5.2.1, 7.5.2.2",
        "A mandatory object is missing: 1000h or 1001h.",
        "describe and list it",
        "Every CANopen device has a device type and an error register; a master reads the first to find out what it is.",
    ),
    "C002": Rule(
        _W, f"{_301} 7.5.2",
        "An object of CiA 301 has another object type.",
        "write ObjectType as CiA 301 has it: 0x7 (VAR), 0x8 (ARRAY), 0x9 (RECORD)",
        "ARRAY and RECORD look the same on the bus, but a tool that knows the standard shows or generates something else.",
    ),
    "C003": Rule(
        _W, f"{_301} 7.5.2",
        "An object of CiA 301 has another data type.",
        "write DataType as CiA 301 has it",
        "A master that goes by the standard sends or expects another number of octets.",
    ),
    "C004": Rule(
        _W, f"{_301} 7.5.2",
        "An object that CiA 301 has as read-only can be written.",
        "write AccessType=ro, or const where the value never changes",
        "A DCF download writes it, and the device aborts.",
    ),
    "C005": Rule(
        _W, f"{_301} 7.5.2.1",
        "The device type has no default.",
        "give 1000h its DefaultValue; a drive has 402 = 0x192 in the low word",
        "Without the device nobody can tell what kind of device the file is for.",
    ),
    "C006": Rule(
        _W, f"{_301} 7.2.8.2.2, 7.5.2.20",
        "The device has neither heartbeat nor node guarding.",
        "describe 1017h, or 100Ch and 100Dh",
        "One of the two is mandatory; without it a master does not notice that the device is gone.",
    ),
    "C007": Rule(
        _W, f"{_301} 7.5.2.17",
        "The device keeps errors, but 1014h is missing.",
        "describe 1014h, the COB-ID of EMCY",
        "It is mandatory where EMCY is sent, and 1003h holds what EMCY has sent.",
    ),
    "C008": Rule(
        _W, f"{_301} 7.5.2.19",
        "The identity 1018h, or its vendor-ID, is missing.",
        "describe 1018h with sub-index 1",
        "It is mandatory since CiA 301 V4; by it a master knows that it talks to the right device.",
    ),
    "C009": Rule(
        _W, f"{_301} 7.5.2.5",
        "A PDO is synchronous, but 1005h is missing.",
        "describe 1005h, the COB-ID of SYNC",
        "It is mandatory where a PDO follows SYNC.",
    ),
    "C010": Rule(
        _W, f"{_301} 7.5.2.6",
        "The device produces SYNC, but 1006h is missing.",
        "describe 1006h, or clear bit 30 of 1005h",
        "Without the cycle period nobody can tell how often it sends SYNC; often bit 30 is set by mistake.",
    ),
    "C011": Rule(
        _W, f"{_301} 7.5.2.11, 7.5.2.12",
        "Node guarding is described by half.",
        "describe both 100Ch and 100Dh",
        "The life time is the product of the two.",
    ),
    "C012": Rule(
        _W, f"{_301} 7.5.2.33",
        "The default SDO has other identifiers.",
        "write $NODEID+0x600 in sub-index 1 and $NODEID+0x580 in sub-index 2",
        "They are fixed, as a master must be able to speak to a device of which it knows nothing. The two are easily exchanged.",
    ),
    "C013": Rule(
        _N, f"{_301} 7.5.2.17",
        "EMCY has another identifier than the predefined one.",
        "write $NODEID+0x80, if the device has no reason for another",
        "A master that listens by the predefined connection set does not hear the device's errors.",
    ),
    "C014": Rule(
        _W, f"{_301} 7.5.2.22",
        "The overflow value of the SYNC counter is not allowed.",
        "give 0, or 2 to 240",
        "A device refuses other values.",
    ),
    "C015": Rule(
        _N, f"{_301} 7.5.2.24, 7.5.2.25",
        "The device stores an EDS, but 1022h is missing.",
        "describe 1022h, the storage format",
        "A tool cannot tell whether what it reads from 1021h is compressed.",
    ),
    "C020": Rule(
        _N, f"{_301} 7.5.2.35 to 7.5.2.38",
        "A PDO or SDO parameter is no RECORD.",
        "write ObjectType=0x9",
        "ARRAY and RECORD look the same on the bus; mapping parameters are often written as ARRAY.",
    ),
    "C021": Rule(
        _N, f"{_301} 7.5.2",
        "An object that CiA 301 has as rw cannot be written.",
        "check with the maker that it is fixed in this device",
        "Many devices fix such values. A master that wants to set it, such as the heartbeat time, cannot.",
    ),
    "M001": Rule(
        _E, f"{_402} 8.4",
        "A drive has no controlword or no statusword.",
        "describe 6040h and 6041h, or correct the device type in 1000h",
        "Without them no master can enable the drive, nor see its state.",
    ),
    "M001c": Rule(
        _W, f"{_402} 8 to 17",
        "An object that a claimed mode of operation needs is missing.",
        "describe the object, or clear the mode's bit in 6502h",
        "6502h says which modes the drive has; each has objects that are mandatory. A mode of which nothing at all is "
        "described is M008.",
    ),
    "M002": Rule(
        _W, f"{_402}",
        "An object of CiA 402 has another data type.",
        "write DataType as CiA 402 has it, if the device does so",
        "A target velocity without a sign has no reverse, a mode of operation without a sign no modes of the maker's. A master "
        "that goes by the standard sends another number of octets. A note where the standard's row is not certain.",
    ),
    "M003": Rule(
        _W, f"{_402}",
        "An object of CiA 402 has another object type.",
        "write ObjectType as CiA 402 has it: 0x7 (VAR), 0x8 (ARRAY), 0x9 (RECORD)",
        "Where one is a VAR and the other is not, the value is at another sub-index; ARRAY and RECORD look the same on the "
        "bus. A note where the standard's row is not certain.",
    ),
    "M004": Rule(
        _W, f"{_402}",
        "An object of CiA 402 has another access.",
        "write AccessType as CiA 402 has it, if the device does so",
        "What is fixed in the drive cannot be configured by a master that goes by the standard; what the drive reports cannot "
        "be written. rww and rwr stand for rw. A note where the standard's row is not certain.",
    ),
    "M005": Rule(
        _W, f"{_402}",
        "A word, target or actual value of the drive cannot be mapped.",
        "set PDOMapping=1, if the device does so",
        "A master moves it in PDOs on every cycle, and has to do so by SDO here.",
    ),
    "M006": Rule(
        _N, f"{_402} 8.4.11",
        "The supported modes are unknown: 6502h is missing or has no default.",
        "describe 6502h with a bit for each mode, as its DefaultValue",
        "Without it a tool cannot tell which modes the drive has before it is connected. Mandatory in DSP 402 V2, and seen as "
        "optional.",
    ),
    "M007": Rule(
        _W, f"{_301} 7.5.2.1, {_402} 7",
        "The device type is not that of a drive, but the objects are.",
        "give 1000h the number 402 = 0x192 in its low word (0x00020192 for a servo drive)",
        "A master that looks for drives does not take the device for one. Exchanged digits are seen: 0x912 for 0x192.",
    ),
    "M008": Rule(
        _N, f"{_402} 8.4.11",
        "A mode of operation is claimed of which nothing is described.",
        "clear the mode's bit in 6502h, or describe the mode's objects",
        "Either the bit or the objects are wrong, and the file cannot tell which: drives exist whose 6502h has the bits in "
        "another order. Try the mode and judge by 6061h.",
    ),
    "M009": Rule(
        _N, f"{_402} 8.4.11",
        "A mode of operation is described that is not claimed.",
        "set the mode's bit in 6502h, if the drive has the mode",
        "All objects are there that the mode needs. Cyclic modes share their objects with others and are not told from them.",
    ),
    "M010": Rule(
        _N, f"{_402} 8.4.11",
        "6502h has reserved bits.",
        "clear bits 4 and 11 to 15; the high word is the maker's",
        "A later version of the standard may give them a meaning.",
    ),
    "M011": Rule(
        _N, f"{_402} 8.4.9",
        "The mode after power-up is not claimed.",
        "set the mode's bit in 6502h, or give 6060h another default",
        "The drive begins in a mode that it does not have, by its own word.",
    ),
    "M012": Rule(
        _N, f"{_402}",
        "An object that usually belongs to a claimed mode is missing.",
        "describe it, if the drive has it",
        "DSP 402 V2 had some objects as mandatory that are optional since (6086h, 6088h, 6069h, 606Bh); the cyclic modes need the "
        "interpolation time 60C2h on drives that do not measure SYNC.",
    ),
    "M013": Rule(
        _N, f"{_402} 7",
        "An axis of several has no device type of its own.",
        "describe 67FFh, and 800h more for each further axis",
        "It tells a master what kind of drive the axis is.",
    ),
    "M014": Rule(
        _W, f"{_402}",
        "A sub-index that CiA 402 has as mandatory is missing.",
        "describe the sub-index",
        "A limit without its other end, or a speed without its partner, cannot be set by a master that goes by the standard. A "
        "note where the standard's row is not certain.",
    ),
    "M015": Rule(
        _N, f"{_402} 8.4.5 to 8.4.8",
        "A reaction is set to a value that is not defined.",
        "give a value of CiA 402, or a negative one, which is the maker's",
        "605Ah to 605Eh and 6007h say what the drive does on quick stop, shutdown, halt, fault and lost connection.",
    ),
    "M016": Rule(
        _N, f"{_402} 8.4.5 to 8.4.8",
        "By default the motor is left to coast.",
        "write a ramp before the drive is enabled, if the axis must be braked",
        "0 in 605Ah, 605Ch, 605Dh or 605Eh switches the power off at once: a vertical axis falls, a moving one rolls on.",
    ),
    "M017": Rule(
        _N, f"{_402}",
        "A target has no negative values by its limits.",
        "correct LowLimit, if the axis can move both ways",
        "A tool that heeds the limits refuses every move in the other direction.",
    ),
}  # fmt: skip

# K: DCF; X: modules.
_CONFIGURED = {
    "K001": Rule(
        _W, f"{_306} 5",
        "[DeviceComissioning] is spelt with two m.",
        "the standard spells it [DeviceComissioning], with one m",
        "Tools look for the standard's spelling and do not find the node ID.",
    ),
    "K002": Rule(
        _E, f"{_306} 5",
        "A DCF has no section [DeviceComissioning].",
        "add it with NodeID and Baudrate, or call the file .eds",
        "A DCF is made for one node, and nobody can tell for which.",
    ),
    "K003": Rule(
        _E, f"{_306} 5",
        "The node ID is missing or not in 1 to 127.",
        "give the node ID, 1 to 127",
        "A DCF is made for one node, and nobody can tell for which.",
    ),
    "K004": Rule(
        _W, f"{_306} 5",
        "Baudrate is missing or no bit rate of CiA 301.",
        "give 10, 20, 50, 125, 250, 500, 800 or 1000 (kbit/s)",
        "It is in kbit/s. A tool that sets the device's bit rate by it cannot.",
    ),
    "K005": Rule(
        _W, f"{_306} 5",
        "A value is configured for an object that cannot be written.",
        "remove ParameterValue, or correct the access",
        "The download of the DCF is aborted by the device. Files saved from a running device hold what was read.",
    ),
    "K006": Rule(
        _W, f"{_306} 5",
        "UploadFile or DownloadFile stands at an object that is no DOMAIN.",
        "give the value as ParameterValue",
        "Only a DOMAIN is transferred from or to a file.",
    ),
    "K007": Rule(
        _N, f"{_306} 5",
        "An EDS holds parameter values.",
        "give the values as DefaultValue, or make the file a DCF with [DeviceComissioning]",
        "ParameterValue belongs to a DCF; a tool that reads an EDS ignores it.",
    ),
    "K008": Rule(
        _W, f"{_306} 5",
        "NodeName or NetworkName is too long.",
        "shorten it: NodeName 246, NetworkName 243 characters",
        "With the key such a line exceeds 255 characters, which a tool need not read.",
    ),
    "K009": Rule(
        _W, f"{_306} 5",
        "NetNumber or LSS_SerialNumber is no UNSIGNED32.",
        "give a number, 0 to 4294967295",
        "A tool stops with an error, or finds another device by LSS.",
    ),
    "K010": Rule(
        _W, "CiA 302-3, 1F22h",
        "A concise DCF is not whole.",
        "give the number of entries, then index (2 octets), sub-index (1), size (4) and data of each, little endian",
        "A manager writes as many entries to the node as the number says, and stops at the first that is not whole.",
    ),
    "K011": Rule(
        _W, "CiA 302-3, 1F22h; CiA 301 7.5.2.36",
        "A concise DCF writes a mapping without clearing it first.",
        "write 0 to sub-index 0 of the mapping before its entries, and their number after them",
        "A device refuses to change the entries of a mapping that is in use.",
    ),
    "K012": Rule(
        _N, "CiA 302-3, 1F22h; CiA 301 7.5.2.23",
        "A concise DCF writes on after 1020h.",
        "write 1020h (Verify configuration) last",
        "A write to any other object makes the device forget 1020h, and the manager configures it again at each boot.",
    ),
    "K013": Rule(
        _W, f"{_306} 5",
        "A denotation is too long.",
        "shorten it to 241 characters",
        "It takes the place of the name, with the same length.",
    ),
    "K014": Rule(
        _W, f"{_306} 5, 4.5",
        "The node is set to a bit rate that the device does not support.",
        "give a bit rate whose BaudRate_ entry in [DeviceInfo] is 1",
        "The file contradicts itself; the device would not be heard on the bus.",
    ),
    "K015": Rule(
        _W, f"{_306} 5",
        "CANopenManager is neither 1 nor 0.",
        "write 1 where the node is the manager of the network, else 0",
        "It is BOOLEAN.",
    ),
    "X001": Rule(
        _E, f"{_306} 6",
        "A module is counted, but not described.",
        "add [MxModuleInfo], or correct NrOfEntries",
        "A tool that offers the modules for selection stops with an error.",
    ),
    "X002": Rule(
        _W, f"{_306} 6",
        "A section belongs to a module that is not counted.",
        "correct NrOfEntries of [SupportedModules], or the number in the section's name",
        "Tools do not see the module.",
    ),
    "X003": Rule(
        _W, f"{_306} 6",
        "The description of a module lacks an entry.",
        "add ProductName, ProductVersion, ProductRevision and OrderCode",
        "By these a user, and the tool, tells one module from another.",
    ),
    "X004": Rule(
        _W, f"{_306} 6",
        "NrOfEntries is not the number of entries of a module's list.",
        "correct NrOfEntries",
        "Tools read as many entries as the number says.",
    ),
    "X005": Rule(
        _E, f"{_306} 6",
        "An object of a module is listed, but not described.",
        "add its section, such as [M1Fixed6000] or [M1SubExt6000], or take it out of the list",
        "A tool cannot add the object when the module is connected.",
    ),
    "X006": Rule(
        _W, f"{_306} 6",
        "The number of sub-indices that a module adds is missing or not understood.",
        "write Count=n, or Count=0;bits for entries that are packed",
        "A tool cannot tell how many sub-indices the module brings.",
    ),
    "X007": Rule(
        _W, f"{_306} 6",
        "A module is connected that is not supported.",
        "give the number of a module of [SupportedModules]",
        "The DCF names a module that the file does not describe.",
    ),
}  # fmt: skip

RULES: dict[str, Rule] = {**_FILE, **_OBJECTS, **_DEVICE, **_CONFIGURED}
