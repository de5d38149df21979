"""Backups by the EDS files of manufacturers, if there are any: the values read are restored from the DCF, byte by byte."""

from __future__ import annotations

import pytest

from axisbus.configuration.dcf_backup import backup
from axisbus.configuration.dcf_values import select
from axisbus.configuration.restore import Restore, ValueEnd
from axisbus.drives.plugin import GENERIC
from axisbus.eds import dcf, writer
from axisbus.eds.io import reader
from axisbus.sim.dictionary import Dictionary
from kit.corpus import CORPUS as FOLDER

FILES = sorted(FOLDER.rglob("*.eds"))[::7] if FOLDER.is_dir() else []
NODE = 5

pytestmark = pytest.mark.skipif(not FILES, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")


class Scrambled:
    """A device whose restorable values all differ; accepts any value."""

    def __init__(self, dictionary: Dictionary, keys: list[tuple[int, int]]) -> None:
        self._dictionary = dictionary
        self.values = {key: bytes(each ^ 0x5A for each in dictionary.upload(*key)) for key in keys}

    def upload(self, index: int, subindex: int = 0) -> bytes:
        held = self.values.get((index, subindex))
        return self._dictionary.upload(index, subindex) if held is None else held

    def download(self, index: int, subindex: int, data: bytes) -> None:
        self.values[index, subindex] = data


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem[:40])
def test_a_restore_writes_the_values_that_the_device_had_answered(path):
    drive = Dictionary(reader.read(path.read_bytes(), str(path)).eds, NODE)
    made = backup(drive, reader.read(path.read_bytes(), str(path)), dcf.Settings(NODE))
    again = reader.read(writer.dumps(made.reading), "backup.dcf").eds
    selection = select(again, NODE, GENERIC)
    assert Restore(drive, selection).read_present() == []
    device = Scrambled(drive, [item.key for item in selection.items])
    report = Restore(device, selection).run()
    assert {each.outcome for each in report.results} <= {ValueEnd.RESTORED, ValueEnd.SAME}
    assert {key: drive.upload(*key) for key in device.values} == device.values
