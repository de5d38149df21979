"""Accessibility checks of a page: axe-core, as a package of the test environment has it, run in the page by the web driver."""

from __future__ import annotations

from importlib.resources import files

from kit.browser import Page

SEVERE = ("serious", "critical")
_RUN = """\
const done = arguments[arguments.length - 1], exclude = arguments[0];
axe.run(exclude ? { exclude: [[exclude]] } : document).then(done, (error) => done(String(error)));
"""


def violations(page: Page, without: str = "") -> list[str]:
    """Return the serious and critical violations of the displayed page; ``without``: a selector to leave out."""
    page.driver.execute_script(_script())
    found = page.driver.execute_async_script(_RUN, without)
    assert isinstance(found, dict), found
    assert found["passes"], "nothing was looked at"
    return [
        f"{rule['id']} ({rule['impact']}): {node['target']} {node['failureSummary']}"
        for rule in found["violations"]
        if rule["impact"] in SEVERE
        for node in rule["nodes"]
    ]


def _script() -> str:
    return files("axe_core_python").joinpath("axe.min.js").read_text("utf-8")
