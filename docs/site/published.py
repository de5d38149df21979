"""Put a built site into the folder of all versions: ``FOLDER/0.1.0``, a list of versions, a first page that leads to the newest."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from packaging.version import InvalidVersion, Version

_FIRST_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>axisbus</title>
<meta http-equiv="refresh" content="0; url={newest}/index.html"></head>
<body><p><a href="{newest}/index.html">axisbus {newest}</a></p></body></html>
"""


def publish(html: Path, folder: Path, version: str) -> None:
    """Copy a site to ``folder/version``, in place of an earlier one of that version; the other versions stay.

    An earlier site is replaced only after the copy is complete. Raises ``InvalidVersion`` and ``OSError``.
    """
    Version(version)
    folder.mkdir(parents=True, exist_ok=True)
    copied, old = folder / ".new", folder / ".old"
    for left in (copied, old):
        shutil.rmtree(left, ignore_errors=True)
    shutil.copytree(html, copied)
    if (folder / version).exists():
        (folder / version).rename(old)
    copied.rename(folder / version)
    shutil.rmtree(old, ignore_errors=True)
    found = versions(folder)
    (folder / "versions.js").write_text(f"axisbusVersions({json.dumps(found)});\n", encoding="utf-8")
    (folder / "index.html").write_text(_FIRST_PAGE.format(newest=found[0]), encoding="utf-8")


def versions(folder: Path) -> list[str]:
    """Return the published versions, releases before pre-releases, each from the newest to the oldest."""
    found = {each.name: _version(each.name) for each in folder.iterdir() if (each / "index.html").is_file()}
    known = {name: version for name, version in found.items() if version is not None}
    return sorted(known, key=lambda name: (not known[name].is_prerelease, known[name]), reverse=True)


def _version(name: str) -> Version | None:
    try:
        return Version(name)
    except InvalidVersion:  # another folder
        return None
