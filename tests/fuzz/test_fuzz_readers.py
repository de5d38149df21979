"""A small part of ``make fuzz``: mutated files end in the library's own error, which names the file, within time and memory."""

from __future__ import annotations

import pytest

from kit.readers import READERS, fuzzed, inputs

INPUTS = 60


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", READERS)
def test_a_mutated_file_is_read_or_refused_by_its_name(name, tmp_path):
    reader = READERS[name]
    path = tmp_path / f"input{reader.suffix}"
    valid = reader.valid(tmp_path)
    for data in valid:
        assert fuzzed(reader, path, data) == ("", True)
    made = inputs(valid, 37)
    found = [fuzzed(reader, path, made(number), measured=number == 0) for number in range(INPUTS)]
    assert [each.finding for each in found if each.finding] == []
