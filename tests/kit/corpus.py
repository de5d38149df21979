"""Makers' EDS files for trials, if the folder AXISBUS_EDS_CORPUS (or one beside the checkout) exists."""

from __future__ import annotations

import csv
import os
from functools import cache
from pathlib import Path

CHECKOUT = Path(__file__).parents[2].resolve()
CORPUS = Path(os.environ.get("AXISBUS_EDS_CORPUS", CHECKOUT.parent / "shared" / "eds-corpus"))
# Of all kinds of devices.
FILES = (
    sorted(path for path in CORPUS.glob("*") if path.suffix in (".eds", ".dcf")) if CORPUS.is_dir() else []
)


@cache
def corpus_files() -> tuple[Path, ...]:
    """The files of CiA 402 drives; none where there is no folder."""
    manifest = CORPUS / "manifest.tsv"
    if not manifest.is_file():
        return ()
    rows = csv.DictReader(manifest.read_text(encoding="utf-8").splitlines(), delimiter="\t")
    return tuple(CORPUS / row["file"] for row in rows if row["profile"] == "402")
