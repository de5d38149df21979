"""Texts follow the code: the names in them exist, names are unique and plain, and the language gets no worse."""

import re
from collections import Counter

import pytest

from kit import language
from kit.pages import PAGES, ROOT
from kit.source_names import (
    SOURCE,
    exists,
    mentioned,
    module_name,
    modules,
    paths_in,
    source_files,
)

TEXT_PAGES = sorted(
    {*PAGES, *ROOT.glob("*.md")} - {ROOT / "docs" / "decisions" / "names.md"}
)  # that has the old names
CODE = [*source_files(), *sorted((ROOT / "tests").rglob("*.py"))]

# -- names in texts ------------------------------------------------------------------------------------------------------------


def test_every_dotted_name_in_docstrings_and_comments_exists():
    assert [
        f"{path.relative_to(ROOT)}: {name}"
        for path in CODE
        if path.name != "test_names.py"
        for name in mentioned(path.read_text(encoding="utf-8"), page=False)
        if not exists(name, path)
    ] == []


@pytest.mark.parametrize("page", TEXT_PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_dotted_name_on_a_page_exists(page):
    assert [name for name in mentioned(page.read_text(encoding="utf-8"), page=True) if not exists(name)] == []


def test_every_path_in_the_source_and_on_pages_exists():
    texts = [*source_files(), *TEXT_PAGES, ROOT / "pyproject.toml", ROOT / ".importlinter"]
    assert [
        f"{path.relative_to(ROOT)}: {named}"
        for path in texts
        for named in paths_in(path.read_text(encoding="utf-8"))
        if not (ROOT / named).exists()
    ] == []


def test_the_search_finds_dotted_names_and_paths():
    text = "As ``motion.stop.policy`` and ``Axis.halt(now)``; not ``two words.``, `one.tick` or ``plain``."
    assert list(mentioned(text, page=False)) == ["motion.stop.policy", "Axis.halt"]
    assert list(mentioned("`cell.cycle_jitter`\n```\n`in.block`\n```\n", page=True)) == ["cell.cycle_jitter"]
    assert paths_in("see `src/axisbus/units.py`, tests/kit; not tests/web*") == [
        "src/axisbus/units.py",
        "tests/kit",
    ]


@pytest.mark.parametrize(
    "name",
    [
        "axisbus.Machine",
        "axisbus.eds",
        "motion.stop.policy",
        "Axis.halt",
        "cell.cycle_jitter",
        "x.move_absolute",
        "os.path",
        "serial.Serial.read",
    ],
)
def test_a_name_that_exists_or_is_of_another_package_is_accepted(name):
    assert exists(name, SOURCE / "units.py")
    assert exists(name)


@pytest.mark.parametrize(
    "name",
    [
        "axisbus.Motor",
        "axisbus.motion.nothing",
        "motion.nothing",
        "motion.stop.policy.Nothing",
        "Axis.nothing",
        "cell.nothing",
    ],
)
def test_a_missing_name_of_our_package_is_found(name):
    assert not exists(name, SOURCE / "units.py")
    assert not exists(name)


# -- names of classes and modules ---------------------------------------------------------------------------------------------


def test_public_class_names_are_unique():
    # The simulated drive has the master's words for the same things on purpose.
    named = Counter(
        name
        for module, one in modules().items()
        if module.partition(".")[0] != "sim" and not module.startswith("drives.gim6010.sim.")
        for name in one.classes
        if not name.startswith("_")
    )
    assert [name for name, count in named.items() if count > 1] == []


# Participles, adverbs, and words that do not name the contents of a module.
UNCLEAR_MODULES = re.compile(
    r"told|asked|looked|kept|known|shown|wanted|armed|fitted|led|bent|mapped|packed|softened|answered|given|reached|"
    r"described|listed|commanded|served|booted|checked|inherited|relayed|guarded|protected|numbered|found|looking|hearing|"
    r"telling|saying|doing|holding|following|asking|reading|turning|leading|listening|joining|parting|ending|working|"
    r"watching|sending|keeping|updating|feeding|merging|waking|anew|beside|alone|aside|softly|onward|goingon|together|far|"
    r"ours|own|door|desk|ear|outlet|duty|tally|ledger|warden|guest|guests|place|places|words|speech|case|sheet|house|"
    r"cruise|relief|aftermath|rundown|room|gate|stage|board|roster|linger|reach|drops|grain"
)


def unclear_modules():
    return {
        module_name(path)
        for path in source_files()
        if path.stem != "__init__" and UNCLEAR_MODULES.fullmatch(module_name(path).rpartition(".")[2])
    }


def test_modules_are_named_by_nouns():
    assert unclear_modules() == set()


# -- language ------------------------------------------------------------------------------------------------------------------

# Phrases of kit/language.py per 1,000 words, at most: the figures of today, rounded up. They may only come down, to 4, 4 and 3.
PHRASES_AT_MOST = {language.documentation: 2, language.docstrings: 2, language.messages: 1}


@pytest.mark.parametrize("kind", PHRASES_AT_MOST, ids=lambda kind: kind.__name__)
def test_the_language_gets_no_worse(kind):
    texts = kind()
    rates = {name: language.rate(parts) for name, parts in texts.items()}
    found = language.rate([text for parts in texts.values() for text in parts])
    worst = ", ".join(f"{name} {rates[name]:.0f}" for name in sorted(rates, key=rates.get)[-5:])
    assert found <= PHRASES_AT_MOST[kind], f"{found:.1f} phrases per 1,000 words; the most: {worst}"


@pytest.mark.parametrize(
    ("sentence", "count"),
    [
        ("What is told of it stands here, and nobody asks anew.", 5),
        ("The wire is cut; where the drive moves, its slave goes on by itself in its own way.", 4),
        ("The axis is led from a place of which none is known; a value that is none.", 3),
        ("The master controls the axis and reports the last received position.", 0),
        (
            "What is a heartbeat? The standstill window stands for nothing else, and both can be told apart.",
            0,
        ),
        ("A leading zero is dropped on the way to the drive.", 0),
    ],
)
def test_the_phrases_are_found(sentence, count):
    assert len(language.found_in(sentence)) == count, language.found_in(sentence)


def test_a_rate_is_per_thousand_words():
    assert language.rate(["It is told. " + "Word " * 97]) == pytest.approx(10.0)


def test_code_is_not_language():
    assert (
        re.sub(r"\s+", " ", language.without_code("# Told\n```\ntold\n```\nA `told` and ``told``.")).strip()
        == "A x and x."
    )
