"""The modules of a modular device, and other parts that only some files have."""

from __future__ import annotations

from axisbus.cia301.datatypes import DataType
from axisbus.eds import Number, ObjectType
from kit.eds.texts import read, record, rules, variable

MODULES = """[SupportedModules]
NrOfEntries=2

[M1ModuleInfo]
ProductName=Eight inputs
ProductVersion=1
OrderCode=DI-8

[M1Comments]
Lines=2
Line1=first
Line2=second

[M1FixedObjects]
NrOfEntries=2
1=0x6423
2=0x6424

[M1Fixed6423]
ParameterName=Interrupts
ObjectType=0x8
SubNumber=2

[M1Fixed6423sub0]
ParameterName=Highest
DataType=0x0005
AccessType=ro
DefaultValue=1

[M1Fixed6423sub1]
ParameterName=Enable
DataType=0x0001
AccessType=rw

[M1SubExtends]
NrOfEntries=2
1=0x6000
2=0x6100

[M1SubExt6000]
ParameterName=Inputs
DataType=0x0005
AccessType=ro
PDOMapping=1
Count=1
ObjExtend=254

[M1SubExt6100]
ParameterName=Nibble
DataType=0x0005
AccessType=ro
Count=0;4

[M12ModuleInfo]
ProductName=Power supply

[ConnectedModules]
NrOfEntries=3
2=12
1=1
3=1
"""


def test_a_modular_device_names_its_kinds_of_module() -> None:
    eds = read(MODULES)
    assert list(eds.modules) == [1, 12]
    inputs = eds.modules[1]
    assert inputs.info == {"productname": "Eight inputs", "productversion": "1", "ordercode": "DI-8"}
    assert inputs.comments == ("first", "second")
    assert eds.modules[12].info == {"productname": "Power supply"}
    assert eds.findings == ()


def test_a_module_has_fixed_objects_of_its_own() -> None:
    fixed = read(MODULES).modules[1].fixed
    assert list(fixed) == [0x6423, 0x6424]
    assert fixed[0x6424] is None
    interrupts = fixed[0x6423]
    assert interrupts is not None
    assert (interrupts.name, interrupts.object_type) == ("Interrupts", ObjectType.ARRAY)
    assert interrupts.subs[1].data_type is DataType.BOOLEAN
    assert interrupts.subs[0].default == Number(1)


def test_a_module_extends_the_objects_of_the_device() -> None:
    extends = read(MODULES).modules[1].extends
    whole, part = extends[0x6000], extends[0x6100]
    assert whole is not None
    assert part is not None
    assert (whole.variable.name, whole.variable.data_type, whole.variable.pdo_mapping) == ("Inputs", 5, True)
    assert (whole.count, whole.bits, whole.object_extend) == (1, 0, 254)
    assert (part.count, part.bits, part.object_extend) == (0, 4, 0)


def test_a_dcf_names_the_connected_modules_in_their_order() -> None:
    assert read(MODULES).connected == (1, 12, 1)


def test_a_modules_objects_are_no_objects_of_the_device() -> None:
    assert 0x6423 not in read(MODULES)


def test_a_defect_in_an_object_of_a_module_is_found() -> None:
    eds = read(
        MODULES.replace(
            "[M1Fixed6423sub1]\nParameterName=Enable\nDataType=0x0001", "[M1Fixed6423sub1]\nDataType=x"
        )
    )
    assert rules(eds) == ["O001", "O002"]
    assert {finding.index for finding in eds.findings} == {0x6423}


def test_a_device_without_modules_lists_no_module() -> None:
    eds = read("")
    assert (eds.modules, eds.connected, eds.dynamic_channels) == ({}, (), ())


def test_dynamic_channels_are_ranges_of_indices() -> None:
    eds = read(
        "[DynamicChannels]\nNrOfSeg=4\nType1=0x07\nDir1=RO\nRange1=0xA080-0xA0BF\nPPOffset1=0\n"
        "Type2=0x01\nDir2=rww\nRange2=0xA0C0 - 0xA0FF\nPPOffset2=64, 1\nType3=0x05\nDir3=ro\nRange3=backwards\n"
        "Type5=0x05\nDir5=ro\nRange5=0xA000-0xA001\n"
    )
    first, second = eds.dynamic_channels
    assert (first.data_type, first.access, first.indices) == (
        DataType.UNSIGNED32,
        "ro",
        range(0xA080, 0xA0C0),
    )
    assert (first.offset, first.step) == (0, None)
    assert (second.indices, second.offset, second.step) == (range(0xA0C0, 0xA100), 64, 1)


def test_object_links_and_names_and_keys_of_other_drafts_are_kept() -> None:
    eds = read(
        record("2000", variable("2000sub1", NodeRefd="7", Denotation="left", ParamRefd="0x20000120")).replace(
            "SubNumber", "Denotation=Drive\nUniqueIDRef=12\nSubNumber"
        )
        + "[2000ObjectLinks]\nObjectLinks=2\n1=0x6040\n2=0x6041\n\n"
        + variable("1F50", ObjectType="2", DownloadFile="program.bin", UploadFile="old.bin")
    )
    entry, program = eds.objects[0x2000], eds.get(0x1F50)
    assert (entry.links, entry.denotation, entry.more) == ((0x6040, 0x6041), "Drive", {"uniqueidref": "12"})
    assert entry.subs[1].denotation == "left"
    assert entry.subs[1].more == {"noderefd": "7", "paramrefd": "0x20000120"}
    assert program is not None
    assert program.more == {"downloadfile": "program.bin", "uploadfile": "old.bin"}


def test_malformed_modules_are_read_as_far_as_possible() -> None:
    eds = read(
        "[SupportedModules]\n[M1FixedObjects]\nNrOfEntries=x\n1=\n2=0x12345\n3=0x6000\n[M1SubExt6000]\nCount=;\n"
        "[M1Fixed7000sub1]\nParameterName=A\n[ConnectedModules]\n1=one\n2=2\n"
    )
    module = eds.modules[1]
    assert list(module.fixed) == [0x6000, 0x7000]
    assert module.extends[0x6000] is not None
    assert (module.extends[0x6000].count, module.extends[0x6000].bits) == (0, 0)
    assert eds.connected == (2,)
