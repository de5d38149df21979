"""Build the site: ``python docs/site/build.py [FOLDER]``; a warning of Sphinx and a broken link are errors."""

from __future__ import annotations

import sys
from pathlib import Path

import links
import staging
from sphinx.cmd.build import main as sphinx

FOLDER = staging.ROOT / "build" / "docs"


def main(folder: Path) -> int:
    """Build the site; return 0 if it has no errors."""
    source, html = folder / "source", folder / "html"
    staging.stage(source)
    options = [
        "-W",
        "--keep-going",
        "-q",
        "-E",
        "-b",
        "html",
        "-c",
        str(staging.HERE),
        "-d",
        str(folder / "doctrees"),
    ]
    code = sphinx([*options, str(source), str(html)])
    if code:
        return code
    broken = links.report(html)
    print(f"the site: {html / 'index.html'}" if not broken else "the site has broken links")
    return int(broken)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER))
