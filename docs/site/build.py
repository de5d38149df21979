"""Build the site: ``python docs/site/build.py [FOLDER] [--publish SITE]``; a warning of Sphinx and a broken link are errors.

``--publish SITE`` then copies it to the folder of this version in ``SITE``, the folder that a web server shows.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import links
import published
import staging
from sphinx.cmd.build import main as sphinx

from axisbus.version import __version__

FOLDER = staging.ROOT / "build" / "docs"


def main(folder: Path, site: Path | None = None) -> int:
    """Build the site, and publish it to ``site`` if that is given; return 0 if it has no errors."""
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
    if links.report(html):
        print("the site has broken links")
        return 1
    print(f"the site: {html / 'index.html'}")
    if site is not None:
        published.publish(html, site, __version__)
        print(f"published: {site / __version__}")
    return 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Build the site of the documentation.")
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER, help="where it is built")
    parser.add_argument(
        "--publish", type=Path, metavar="SITE", help="copy it to SITE/VERSION, beside other versions"
    )
    given = parser.parse_args()
    sys.exit(main(given.folder, given.publish))
