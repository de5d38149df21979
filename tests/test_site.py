"""The parts of ``make docs``: the check of its links finds broken ones, and no page is left out of the navigation."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from kit.pages import ROOT

SITE = ROOT / "docs" / "site"
PAGE = '<html><head><title>x</title>{head}</head><body><h1 id="top">x</h1>{body}</body></html>'


def checked(folder):
    return subprocess.run(
        [sys.executable, str(SITE / "links.py"), str(folder)], capture_output=True, text=True, check=False
    )


def site(folder, *, head="", body="", css=""):
    (folder / "a").mkdir()
    (folder / "index.html").write_text(PAGE.format(head=head, body=body), encoding="utf-8")
    (folder / "a" / "b c.html").write_text(
        PAGE.format(head="", body='<a href="../index.html#top">x</a>'), encoding="utf-8"
    )
    (folder / "style.css").write_text(css, encoding="utf-8")
    return folder


WHOLE = '<a href="a/b%20c.html#top">x</a><a href="#top">x</a><a href="https://can-cia.org">x</a><img src="data:image/png;base64,x">'


def test_a_site_that_is_whole_is_taken(tmp_path):
    head = '<link rel="stylesheet" href="style.css?v=1"><link rel="canonical" href="https://example.org/">'
    ran = checked(site(tmp_path, head=head, body=WHOLE, css="a { background: url(data:x) }"))
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.parametrize(
    ("head", "body", "css", "told"),
    [
        ("", '<a href="gone.html">x</a>', "", "index.html: gone.html: there is no such file"),
        ("", '<a href="a/b%20c.html#gone">x</a>', "", "there is no such anchor"),
        ("", '<a href="#gone">x</a>', "", "there is no such anchor"),
        ("", '<a href="a">x</a>', "", "there is no such file"),
        ("", '<img src="gone.png">', "", "there is no such file"),
        ("", '<img src="//example.org/x.png">', "", "it is loaded from another host"),
        ('<script src="https://example.org/x.js"></script>', "", "", "it is loaded from another host"),
        (
            '<link rel="stylesheet" href="https://example.org/x.css">',
            "",
            "",
            "it is loaded from another host",
        ),
        ("", "", "@font-face { src: url(https://example.org/x.woff2) }", "style.css: it loads something"),
    ],
)
def test_broken_links_and_pages_are_reported(tmp_path, head, body, css, told):
    ran = checked(site(tmp_path, head=head, body=WHOLE + body, css=css))
    assert ran.returncode == 1
    assert told in ran.stderr
    assert ran.stderr.count("\n") == 1


def test_an_empty_folder_is_no_site(tmp_path):
    ran = checked(tmp_path)
    assert ran.returncode == 1
    assert "there is no page" in ran.stderr


def navigation(tmp_path, *pages):
    for page in pages:
        (tmp_path / page).parent.mkdir(exist_ok=True)
        (tmp_path / page).write_text("# x\n", encoding="utf-8")
    program = "import sys, pathlib, staging; print(staging.toctrees(pathlib.Path(sys.argv[1])))"
    ran = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)],
        env={**os.environ, "PYTHONPATH": str(SITE)},
        capture_output=True,
        text=True,
        check=True,
    )
    return ran.stdout.split("```{toctree}\n")[1:]


def test_an_unlisted_page_is_in_the_navigation(tmp_path):
    guide, further, how = navigation(tmp_path, "index.md", "guide.md", "news.md", "decisions/two.md")
    assert "\nguide\n" in guide
    assert ":caption: Further\n\nnews\n" in further
    assert "\ndecisions/two\n" in how
