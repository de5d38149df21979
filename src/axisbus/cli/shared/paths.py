"""The parameter type of paths: unchecked, so that the code that opens the file reports errors in a uniform text."""

from __future__ import annotations

from pathlib import Path

import click

PATH = click.Path(
    path_type=Path, readable=False
)  # click itself would refuse an unreadable file without a remedy
