"""Check that each link of a site has a target in it, and that it loads nothing from another host: ``python links.py FOLDER``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# Attributes from which a browser loads something when it shows the page; links are only followed by the user.
_FETCHED = {
    ("script", "src"),
    ("img", "src"),
    ("link", "href"),
    ("iframe", "src"),
    ("source", "src"),
    ("use", "href"),
}
_LINKS = {("a", "href")}
_NOT_FETCHED = {"canonical", "next", "prev", "search", "index", "genindex", "author", "license", "help"}


class _Page(HTMLParser):
    """Collects the anchors and the links of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.leads: list[tuple[str, bool]] = []  # target, and whether it is loaded

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Store the anchor and the links of a tag."""
        given = dict(attrs)
        self.anchors |= {value for key in ("id", "name") if (value := given.get(key))}
        for key, value in attrs:
            if value and (tag, key) in _FETCHED | _LINKS:
                rel = set((given.get("rel") or "").split())
                self.leads.append((value, (tag, key) in _FETCHED and not rel & _NOT_FETCHED))


def _read(path: Path) -> _Page:
    page = _Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def broken(folder: Path) -> Iterator[str]:
    """Yield each error with its page: a missing file, a missing anchor, or a resource on another host."""
    pages = {path: _read(path) for path in sorted(folder.resolve().rglob("*.html"))}
    if not pages:
        yield f"{folder}: there is no page"
    for path, page in pages.items():
        for lead, fetched in page.leads:
            why = _wrong(path, lead, fetched, pages)
            if why:
                yield f"{path.relative_to(folder.resolve())}: {lead}: {why}"
    yield from _imports(folder)


def _wrong(path: Path, lead: str, fetched: bool, pages: dict[Path, _Page]) -> str:
    parts = urlsplit(lead)
    if parts.scheme == "data":
        return ""
    if parts.scheme or parts.netloc:
        return "it is loaded from another host" if fetched else ""
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not target.is_file():
        return "there is no such file"
    anchor = unquote(parts.fragment)
    if anchor and target in pages and anchor not in pages[target].anchors:
        return "there is no such anchor"
    return ""


def _imports(folder: Path) -> Iterator[str]:
    """Yield the style sheets that load something from another host."""
    for path in sorted(folder.rglob("*.css")):
        text = path.read_text(encoding="utf-8")
        if any(
            each in text
            for each in ("url(http", "url('http", 'url("http', "url(//", '@import "http', "@import 'http")
        ):
            yield f"{path.relative_to(folder)}: it loads something from another host"


def report(folder: Path) -> bool:
    """Print the errors; return whether there are any."""
    found = list(broken(folder))
    for line in found:
        print(line, file=sys.stderr)
    return bool(found)


if __name__ == "__main__":
    sys.exit(report(Path(sys.argv[1])))
