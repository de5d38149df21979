"""Read an EDS: objects, COB-IDs and findings. This needs no bus, no drive and no other library."""

from axisbus import eds

drive = eds.load("builtin:gim6010-8")
print(drive.source, "has", len(drive.objects), "objects")
print("vendor:", hex(drive.identity.vendor_id or 0))
target = drive.get(0x607A)
print(
    f"607Ah is {target.name!r}, {target.data_type.name}, {target.access}, mappable: {target.pdo_mapping}, line {target.line}"
)
print("COB-ID of RPDO1 for node 5:", hex(drive.get(0x1400, 1).initial(5)))
for finding in drive.findings:
    print(f"line {finding.line}: {finding.severity.value} {finding.rule}: {finding.message}")
