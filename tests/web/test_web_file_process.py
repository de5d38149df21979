"""A DCF of a page in a process of its own: its limits, its end, and the files that the server parses itself."""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
from types import SimpleNamespace
from typing import Any

import pytest

from axisbus.errors import StateError, Stopped
from axisbus.web.config import file_process, files
from axisbus.web.config.file_process import FileProcess, FileTask
from axisbus.web.config.files import Dcf
from axisbus.web.config.report import ConfigJobKind
from axisbus.web.objects.verifying import PacedSdo
from kit.command_line import ROOT

EDS = Dcf("x.eds", (ROOT / "eds" / "generic-cia402.eds").read_bytes())
HEAD = b"[FileInfo]\nFileName=x.dcf\n[DeviceInfo]\nVendorNumber=1\n[1000]\nDataType=7\n"


def running(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    """Let the process of a file run another program."""
    monkeypatch.setattr(file_process, "_COMMAND", [sys.executable, "-c", program])


def test_a_file_is_described_as_in_the_server():
    assert file_process.summary(EDS) == files.summary(EDS)


def test_a_process_that_computes_for_too_long_is_killed(monkeypatch):
    monkeypatch.setattr(file_process, "SILENCE_TIMEOUT", 0.5)
    running(monkeypatch, "while True: pass")
    process = FileProcess(EDS, FileTask(EDS.name, len(EDS.data)))
    with pytest.raises(StateError, match=r"^x\.eds could not be read") as caught, process:
        process.next(lambda: None)
    assert caught.value.observed == "its process sent nothing for 0.5 s"
    assert "axisbus config" in caught.value.remedy
    assert process._process.returncode not in (None, 0)


def test_a_process_that_reads_no_input_is_killed(monkeypatch):
    """The file is longer than the capacity of a pipe."""
    monkeypatch.setattr(file_process, "SILENCE_TIMEOUT", 0.5)
    running(monkeypatch, "import time; time.sleep(1000)")
    with pytest.raises(StateError, match="could not be read"):
        file_process.summary(Dcf("x.dcf", bytes(1 << 20)))


def test_a_process_that_ends_early_is_reported_with_its_exit_code(monkeypatch):
    running(monkeypatch, "raise SystemExit(7)")
    with pytest.raises(StateError, match="could not be read") as caught:
        file_process.summary(EDS)
    assert caught.value.observed == "its process ended with exit code 7"


def test_a_process_that_cannot_be_started_is_reported(monkeypatch):
    monkeypatch.setattr(file_process, "_COMMAND", ["/nowhere/python"])
    with pytest.raises(StateError, match="could not be read") as caught:
        file_process.summary(EDS)
    assert "cannot be started" in caught.value.observed
    assert caught.value.remedy


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not limit the memory of a process")
def test_a_process_that_exceeds_its_memory_limit_reports_it(monkeypatch):
    program = (
        "from axisbus.web.config import file_process, files; file_process.MEMORY = 200 << 20; "
        "files.summary = lambda file: str(bytes(1 << 30)); file_process.main()"
    )
    running(monkeypatch, program)
    with pytest.raises(StateError, match=r"^x\.eds could not be read") as caught:
        file_process.summary(EDS)
    assert caught.value.observed == "it needs more than 200 MB of memory"
    assert "a smaller file" in caught.value.remedy


@pytest.mark.skipif(not hasattr(os, "getpriority"), reason="this system knows no such priorities")
def test_the_process_has_a_low_priority_and_limited_processor_time(monkeypatch):
    program = (
        "import os, resource; from axisbus.web.config import file_process, files; "
        "files.summary = lambda file: f'{os.getpriority(0, 0)} {resource.getrlimit(resource.RLIMIT_CPU)[0]}'; "
        "file_process.main()"
    )
    running(monkeypatch, program)
    assert file_process.summary(EDS) == f"{max(15, os.getpriority(0, 0))} 600"


def test_a_job_that_is_cancelled_while_its_file_is_parsed_ends_at_once(monkeypatch):
    running(monkeypatch, "import time; time.sleep(1000)")
    cancelled = threading.Event()
    node: Any = SimpleNamespace(
        node_id=1, cell=None, cyclic=frozenset(), sdo=SimpleNamespace(dictionary=None)
    )
    sdo = PacedSdo(node, cancelled, "the comparison")
    threading.Timer(0.3, cancelled.set).start()
    began = time.monotonic()
    with pytest.raises(Stopped, match="the comparison of node 1 was cancelled"):
        file_process.carry_out(ConfigJobKind.COMPARE, node, EDS, lambda *_: None, sdo.require_not_cancelled)
    assert time.monotonic() - began < file_process.SILENCE_TIMEOUT / 2


# -- files that the server parses ----------------------------------------------------------------------------------------


def filled(text: str) -> bytes:
    """Return the largest file of one repeated text that is parsed in the server; {} is a number."""
    data, number = bytearray(HEAD), 0
    while len(data) < files._SHORT - 2 * len(text) and data.count(b"[") < files._MAX_SECTIONS:
        data += text.format(number, index=f"{0x1000 + number % 0xE000:04X}").encode()
        number += 1
    return bytes(data)


HOSTILE = {
    "objects": "[{index}]\nDataType=7\nAccessType=rw\nParameterValue={}\n",
    "names": "[{index}]\nParameterName=n{}\n",
    "entries": "[1600sub{}]\nDataType=7\nParameterValue=1\n",
    "sections": "[{}]\n",
    "keys": "k{}=1\n",
    "lines": "\n",
    "modules": "[M{}ModuleInfo]\nProductName=x\n",
    "extensions": "[M{}SubExt1000]\nParameterName=x\nCount=255\n",
    "a number": "9",
    "a line": "x",
    "brackets": "[",
    "lists": "{}=0x1000\n",
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_the_server_parses_only_files_that_take_less_than_200_ms(text):
    file = Dcf("x.dcf", filled(text))
    assert file.is_short
    gc.disable()  # the collected tests are a million objects, which a server does not have
    try:
        began = time.process_time()
        files.summary(file)
        took = time.process_time() - began
    finally:
        gc.enable()
    assert took < 0.2  # a jog ends if the server does not receive its messages for so long


@pytest.mark.parametrize("encoding", ["ascii", "utf-16"])
def test_the_server_does_not_parse_a_small_file_that_defines_many_entries(encoding):
    text = "[2000]\nObjectType=8\nDataType=7\nCompactSubobj=254\n"
    assert not Dcf("x.dcf", text.encode(encoding)).is_short
    assert Dcf("x.dcf", text.replace("Compact", "").encode(encoding)).is_short


def test_the_server_does_not_parse_a_small_file_of_many_sections():
    assert not Dcf("x.dcf", b"[1]\n" * (files._MAX_SECTIONS + 1)).is_short
