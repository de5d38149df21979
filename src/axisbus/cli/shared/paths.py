"""A path as a command takes it: whoever opens the file says what is wrong with it, always in the same words."""

from __future__ import annotations

from pathlib import Path

import click

PATH = click.Path(
    path_type=Path, readable=False
)  # click itself would refuse what cannot be read, without a remedy
