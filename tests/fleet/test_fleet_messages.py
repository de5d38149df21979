"""The kinds of messages of a fleet: all are known before a thread reads the first of any."""

from __future__ import annotations

import subprocess
import sys

# Whatever msgspec has to look at by now, it finds spoilt.
PROGRAM = """
import msgspec
from axisbus.fleet import messages
from axisbus.ipc import errors
messages.str = messages.int = messages.tuple = messages.Value = errors.str = "no such type"
for kind in (*messages.KINDS, errors.ErrorFields):
    msgspec.json.Decoder(kind)
print(len(messages.KINDS))
"""


def test_no_thread_that_reads_a_first_message_looks_at_its_kind_while_another_one_does():
    # two threads that did so ended the interpreter by a segmentation fault: a bridge or a fleet that had just begun
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) >= 14
