"""mypy with the types of Windows and of macOS: outside the modules of a need, no module uses what that system lacks."""

from __future__ import annotations

import subprocess
import sys

import pytest

from kit.other_system import SYSTEMS
from kit.pages import ROOT
from kit.system_needs import ALLOWED


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_types_of_a_system_fit_all_modules_but_those_of_a_need(system, tmp_path):
    words = ["--platform", system, "--cache-dir", str(tmp_path), "--no-error-summary", "--no-pretty"]
    ran = subprocess.run(
        [sys.executable, "-m", "mypy", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 1, ran.stdout + ran.stderr
    assert ran.stderr == ""
    lines = [line for line in ran.stdout.splitlines() if ": note:" not in line]
    names = {
        line.partition(":")[0].removeprefix("src/axisbus/").removesuffix(".py").replace("/", ".")
        for line in lines
    }
    assert names - ALLOWED == set(), ran.stdout
    assert "core.process.launch" in names  # which uses memfd_create
