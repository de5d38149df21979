"""The EDS of a drive that has interpolated position mode and no csp: the builtin one, with other modes and three objects more."""

from __future__ import annotations

from pathlib import Path

from axisbus.eds.builtin import resolve

_MORE = """
[60C0]
ParameterName=Interpolation sub mode select
ObjectType=0x7
DataType=0x0003
AccessType=rw
DefaultValue=-1
PDOMapping=0

[60C1]
ParameterName=Interpolation data record
ObjectType=0x8
SubNumber=2

[60C1sub0]
ParameterName=Highest sub-index supported
ObjectType=0x7
DataType=0x0005
AccessType=const
DefaultValue=1
PDOMapping=0

[60C1sub1]
ParameterName=1st set-point
ObjectType=0x7
DataType=0x0004
AccessType=rww
DefaultValue=0
PDOMapping=1
"""
PP, PV, TQ, HM, IP, CSP = 0x01, 0x04, 0x08, 0x20, 0x40, 0x80  # bits of 6502h
USUAL = PP | PV | TQ | HM | IP


def write_eds(folder: Path, modes: int = USUAL) -> str:
    """Write it into ``folder``, with these bits of 6502h; return its name."""
    text = resolve("builtin:generic-cia402", folder).read_text(encoding="utf-8")
    text = text.replace("DefaultValue=0x000003AD", f"DefaultValue={modes:#010x}")
    head, _, tail = text.partition("[OptionalObjects]\n")
    count = next(line for line in tail.splitlines() if line.startswith("SupportedObjects="))
    number = int(count.split("=")[1], 0)
    more = f"SupportedObjects={number + 2}\n{number + 1}=0x60C0\n{number + 2}=0x60C1"
    tail = tail.replace(count, more, 1)
    (folder / "ip.eds").write_text(f"{head}[OptionalObjects]\n{tail.rstrip()}\n{_MORE}", encoding="utf-8")
    return "ip.eds"
