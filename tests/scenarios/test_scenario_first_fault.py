"""The first faults of a program are reported without reading the disk: their texts were read before the scan began."""

from __future__ import annotations

from kit.scenarios.program import Program


def test_no_thread_of_a_scan_opens_a_file_when_something_goes_wrong_for_the_first_time(tmp_path):
    told, _ = Program("first_fault", str(tmp_path)).process.communicate(timeout=500)
    assert told.splitlines()[-1:] == ["opened: []"]
    for cause in ("went into fault", "node 1", "does not enter mode 3"):
        assert cause in told
