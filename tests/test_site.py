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


def published(folder, *versions):
    """Publish a page of each version in turn; return what was printed to standard error."""
    program = "import sys, pathlib, published; published.publish(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3])"
    for version in versions:
        built = folder / "html"
        built.mkdir(exist_ok=True)
        (built / "index.html").write_text(f"the site of {version}", encoding="utf-8")
        ran = subprocess.run(
            [sys.executable, "-c", program, str(built), str(folder / "site"), version],
            env={**os.environ, "PYTHONPATH": str(SITE)},
            capture_output=True,
            text=True,
            check=False,
        )
        if ran.returncode:
            return ran.stderr
    return ""


def test_a_published_site_lists_releases_before_pre_releases_and_the_newest_first(tmp_path):
    (tmp_path / "site" / "pictures").mkdir(parents=True)
    (tmp_path / "site" / "pictures" / "index.html").write_text("no version", encoding="utf-8")
    assert not published(tmp_path, "0.9.0", "0.10.0", "1.0.0rc1", "0.9.0")
    listed = (tmp_path / "site" / "versions.js").read_text(encoding="utf-8")
    assert listed == 'axisbusVersions(["0.10.0", "0.9.0", "1.0.0rc1"]);\n'
    assert "url=0.10.0/index.html" in (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    assert (tmp_path / "site" / "pictures" / "index.html").read_text(encoding="utf-8") == "no version"
    assert checked(tmp_path / "site").returncode == 0


def test_a_published_version_is_replaced_whole_and_a_wrong_one_is_refused(tmp_path):
    assert not published(tmp_path, "1.0.0")
    (tmp_path / "site" / "1.0.0" / "gone.html").write_text("of the first build", encoding="utf-8")
    assert not published(tmp_path, "1.0.0")
    assert [each.name for each in (tmp_path / "site" / "1.0.0").iterdir()] == ["index.html"]
    assert "InvalidVersion" in published(tmp_path, "../elsewhere")
    assert sorted(each.name for each in (tmp_path / "site").iterdir()) == [
        "1.0.0",
        "index.html",
        "versions.js",
    ]
