"""Files for the tests of reports: the built-in ones, those of a corpus where there is one, and a small drive of our own."""

from __future__ import annotations

from pathlib import Path

from axisbus.eds import Eds, load, loads
from axisbus.eds.builtin import names, resolve
from kit.corpus import CORPUS as FOLDER
from kit.eds.texts import record, variable

CORPUS = (
    sorted(path for path in FOLDER.glob("*") if path.suffix in (".eds", ".dcf")) if FOLDER.is_dir() else []
)
BUILTIN = [resolve(f"builtin:{name}", Path()) for name in names()]
EVERY_TENTH = [*BUILTIN, *CORPUS[::10]]


def builtin(name: str) -> Eds:
    return load(f"builtin:{name}")


def mapped(index: str, *entries: str, count: str = "") -> str:
    """Return a mapping parameter of these UNSIGNED32."""
    subs = [variable(f"{index}sub0", DataType="0x5", DefaultValue=count or str(len(entries)))]
    subs += [variable(f"{index}sub{at}", DefaultValue=entry) for at, entry in enumerate(entries, 1)]
    return record(index, *subs)


def communication(index: str, cob_id: str, transmission: str = "255") -> str:
    """Return a communication parameter."""
    return record(
        index,
        variable(f"{index}sub0", DataType="0x5", DefaultValue="2"),
        variable(f"{index}sub1", ParameterName="COB-ID", DefaultValue=cob_id),
        variable(f"{index}sub2", ParameterName="Transmission", DataType="0x5", DefaultValue=transmission),
    )


HEAD = """[DeviceInfo]
VendorName=Muster & Co
ProductName=Axle <2>
BaudRate_500=1
[DummyUsage]
Dummy0001=1
Dummy0005=1
"""


def small(body: str) -> Eds:
    """Read a drive with device type, 6040h, 6041h, 6061h and 6064h, and ``body``."""
    return loads(small_text(body).encode(), "axle.eds")


def small_text(body: str) -> str:
    return (
        HEAD
        + variable("1000", ParameterName="Device type", AccessType="ro", DefaultValue="0x00020192")
        + variable("6040", ParameterName="Controlword", DataType="0x6", PDOMapping="1")
        + variable("6041", ParameterName="Statusword", DataType="0x6", AccessType="ro", PDOMapping="1")
        + variable("6061", ParameterName="Mode display", DataType="0x2", AccessType="ro", PDOMapping="1")
        + variable("6064", ParameterName="Position", DataType="0x4", AccessType="ro", PDOMapping="1")
        + body
    )


BITS = (
    communication("1800", "$NODEID+0x180", "1")
    + mapped("1A00", "0x20000001", "0x20010003", "0x00050004", "0x60640020", "0x20020018")
    + variable("2000", ParameterName='Ready "now"', DataType="0x1", AccessType="ro", PDOMapping="1")
    + variable("2001", ParameterName="Gear", DataType="0x5", AccessType="ro", PDOMapping="1")
    + variable("2002", ParameterName="Pressure", DataType="0x10", AccessType="ro", PDOMapping="1")
)
STATUS = communication("1800", "$NODEID+0x180") + mapped("1A00", "0x60410010", "0x60610008", "0x60640020")
