"""A small part of ``make fuzz``: the readers of files and messages of the GIM6010-8 beside CANopen."""

from __future__ import annotations

from pathlib import Path

import pytest

from kit.gim6010_readers import READERS
from kit.reader_limits import few_mutations


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", READERS)
def test_a_mutated_input_is_read_or_refused_by_its_name(name: str, tmp_path: Path) -> None:
    assert few_mutations(READERS[name], tmp_path, seed=37, count=60) == []
