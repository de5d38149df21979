"""The pages of the symptoms: every error, letter and code leads to one, their commands are there, and messages name them."""

from __future__ import annotations

import inspect
import pickle
import re
import shlex
import subprocess
import sys
import traceback

import click
import pytest

from axisbus import errors
from axisbus.boot.report import NodeReport
from axisbus.cell.json_schema import schema_of_cells
from axisbus.cia301 import abort, emcy, tables
from axisbus.cia302.types import Letter
from axisbus.cli.explain import further_reading, markdown, notes_of
from axisbus.cli.main import cli
from axisbus.cli.shared.common import with_page
from axisbus.drives import registry
from axisbus.errors import AxisbusError, BootError, DriveFault, FollowingError, NodeTimeout, SdoAbort
from axisbus.ipc.errors import from_fields, to_fields
from axisbus.motion.stop.diagnosis import remedy
from axisbus.symptoms import lookup
from axisbus.symptoms.lookup import FAMILIES, SYMPTOMS, page_of
from axisbus.symptoms.symptom import SymptomNote
from kit import command_line
from kit.pages import ROOT

CLASSES = {name: each for name, each in vars(errors).items() if inspect.isclass(each)}
ABORTS = [int(row["code"], 16) for row in tables.rows("axisbus.cia301", "abort.tsv")]
FAULTS = [int(row["code"], 16) for row in tables.rows("axisbus.cia301", "emcy.tsv")]
each_symptom = pytest.mark.parametrize("symptom", SYMPTOMS.values(), ids=list(SYMPTOMS))
# Placeholders on the pages, with a possible value.
STANDS_FOR = {
    "CELL": "examples/cell.toml",
    "AXIS": "x",
    "NODE": "5",
    "FILE": "eds/gim6010-8.eds",
    "COMMAND": "boot",
}


def boot(letter="", number=None):
    error = BootError("no", node=5, step="configure")
    error.letter, error.abort = letter, number
    return error


def abort_of(code):
    return SdoAbort("no", node=5, index=0x6065, subindex=0, code=code)


# -- the tables ----------------------------------------------------------------------------------------------------------------


def test_no_name_is_there_twice():
    names = [each.name for family in FAMILIES.values() for each in family]
    assert len(names) == len(set(names)) == len(SYMPTOMS) > 30
    assert all(re.fullmatch(r"[a-z]+(-[a-z]+)*", name) for name in names)


@pytest.mark.parametrize("kind", ["errors", "letters", "aborts", "faults"])
def test_no_error_has_two_pages(kind):
    given = [one for symptom in SYMPTOMS.values() for one in getattr(symptom, kind)]
    assert len(given) == len(set(given)) > 0


def test_every_error_has_a_page_and_every_name_is_an_error():
    assert {name for symptom in SYMPTOMS.values() for name in symptom.errors} == set(CLASSES)


def test_every_letter_abort_code_and_error_code_has_a_page():
    assert {letter for symptom in SYMPTOMS.values() for letter in symptom.letters} == {
        each.name for each in Letter
    }
    assert {code for symptom in SYMPTOMS.values() for code in symptom.aborts} == set(ABORTS)
    assert all(lookup.page_of_fault(code) in SYMPTOMS for code in (*FAULTS, 0x0000, 0xFF00, 0xFFFF, 0xA123))


@each_symptom
def test_every_page_is_complete_and_belongs_to_an_error(symptom):
    assert symptom.title
    assert len(symptom.seen) > 60
    assert len(symptom.checks) >= 3
    assert symptom.errors or symptom.letters or symptom.aborts or symptom.faults
    assert all(re.fullmatch(r"[0-9A-F][0-9A-Fx]{3}", digits) for digits in symptom.faults)


@each_symptom
def test_every_code_that_a_page_names_is_one_of_a_table(symptom):
    given = {digits.replace("x", "[0-9A-F]") for digits in symptom.faults}
    unused = set("ABCDE")  # first digits that no standard uses
    for pattern in given:
        assert pattern[0] in unused or any(re.fullmatch(pattern, f"{code:04X}") for code in FAULTS), pattern


OF_THE_BUS = {"bus-off", "late-cycles", "pdo-mapping", "second-master", "node-lost"}


@pytest.mark.parametrize("code", [code for code in FAULTS if lookup.page_of_fault(code) in OF_THE_BUS])
def test_the_remedy_is_of_the_same_kind_as_the_page(code):
    assert re.search(r"bus|cable|frames|cycles|node-ID", remedy(code)), remedy(code)
    assert "tuning" not in remedy(code)


@each_symptom
def test_the_pages_for_further_reading_exist(symptom):
    assert symptom.read_on
    for page in further_reading(symptom, notes_of(symptom)):
        assert (ROOT / "docs" / page.partition("#")[0]).exists(), page  # the anchors: when the site is made


def typed(symptom):
    """The commands that a page says to type, as lists of words."""
    noted = [check for note in notes_of(symptom) for check in note.checks]
    spans = re.findall(r"`axisbus ([^`]+)`", " ".join((symptom.seen, *symptom.checks, *noted)))
    return [[STANDS_FOR.get(word, word) for word in shlex.split(_placeholder_value(span))] for span in spans]


def _placeholder_value(span):
    return re.sub(r"\b([A-Z]+)(?=[:=])", lambda found: STANDS_FOR[found[1]], span)


def parsed(words):
    """Parse the words of a command, up to its arguments and options; nothing is run."""
    command, context, left = cli, click.Context(cli, info_name="axisbus", **cli.context_settings), list(words)
    while isinstance(command, click.Group):
        name = left.pop(0)
        command = command.get_command(context, name)
        assert command is not None, words
        context = click.Context(command, parent=context, info_name=name)
    if left != ["--help"]:
        command.make_context(name, left, parent=context.parent)


@each_symptom
def test_each_command_to_type_is_accepted_as_printed(symptom, monkeypatch):
    monkeypatch.chdir(ROOT)
    for words in typed(symptom):
        parsed(words)


@pytest.mark.parametrize("words", [["check", "x.toml", "--nonsense"], ["od", "read"], ["boot"]])
def test_a_command_that_is_wrong_would_be_noticed(words):
    with pytest.raises(click.UsageError):
        parsed(words)


def test_most_pages_name_commands():
    assert sum(bool(typed(symptom)) for symptom in SYMPTOMS.values()) > len(SYMPTOMS) * 3 // 4


def test_every_note_of_a_plug_in_is_on_a_page_that_is_there():
    noted = {name for notes in registry.parts("symptoms") for name in notes}
    assert noted <= set(SYMPTOMS)


def test_a_note_of_a_plug_in_follows_the_checks():
    note = SymptomNote("Painted servo", ("Is its paint dry?",), ("drives.md",))
    text = markdown(SYMPTOMS["drive-fault"], [note])
    assert text.index("What to check") < text.index(
        "## If the drive is a Painted servo\n\n- Is its paint dry?"
    )
    assert "- docs/drives.md" in text
    assert "Painted" not in markdown(SYMPTOMS["drive-fault"])


# -- which page ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "page"),
    [
        (NodeTimeout("no", node=5), "no-answer"),
        (FollowingError("no"), "following-error"),
        (boot(), "does-not-boot"),
        (boot("B"), "no-answer"),
        (boot("M"), "another-device"),
        (boot("J"), "does-not-boot"),
        (boot("J", 0x06090031), "value-refused"),
        (boot("", 0x06020000), "object-missing"),
        (boot("C", 0x06020000), "another-device"),
        (abort_of(0x08000021), "object-refused"),
        (abort_of(0x06090011), "object-missing"),
        (abort_of(0x12345678), "object-refused"),
        (DriveFault("no"), "drive-fault"),
        (DriveFault("no", code=0x8611), "following-error"),
        (DriveFault("no", code=0x8130), "node-lost"),
        (DriveFault("no", code=0x7305), "encoder-fault"),
        (DriveFault("no", code=0xFF00), "drive-fault"),
        (DriveFault("no", code=-1), "drive-fault"),
        (ValueError("no"), lookup.LAST),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_the_page_is_chosen_by_the_code_then_by_the_class(error, page):
    assert page_of(error) == page


def test_an_error_of_a_program_s_own_has_the_page_of_its_base():
    class Lost(NodeTimeout):
        pass

    assert Lost("no", node=5).page == "no-answer"


@pytest.mark.parametrize("name", CLASSES)
def test_a_command_names_the_page_below_the_texts(name):
    error = CLASSES[name].__new__(CLASSES[name], "no")
    AxisbusError.__init__(error, "no", observed="nothing", remedy="look")
    assert error.page in SYMPTOMS
    assert str(error) == "no\n  observed: nothing\n  remedy:   look"
    assert with_page(error) == f"{error}\n  more:     axisbus explain {error.page}"


def test_a_traceback_names_the_page_of_the_final_code_of_an_error():
    error = BootError("no", node=5, step="configure", observed="nothing")
    error.add_note("while stopping: x")
    error.letter = "M"
    for each in (error, pickle.loads(pickle.dumps(error)), from_fields(to_fields(error))):
        told = "".join(traceback.format_exception(each)).splitlines()[-4:]
        assert told[0].endswith("BootError: no")
        assert told[1:] == [
            "  observed: nothing",
            "while stopping: x",
            "  more:     axisbus explain another-device",
        ]


def test_the_error_that_ends_a_program_names_its_page():
    program = "from axisbus.errors import FollowingError; raise FollowingError('no', remedy='look')"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ran.stderr.endswith("no\n  remedy:   look\n  more:     axisbus explain following-error\n")


def test_a_foreign_error_has_no_page():
    assert with_page(ValueError("no")) == "no"


def test_a_command_that_fails_names_the_page(axisbus, tmp_path):
    code, _, err = axisbus("boot", tmp_path / "gone.toml")
    assert code == 1
    assert err.endswith("\n  more:     axisbus explain cell-file\n")


# -- explain -------------------------------------------------------------------------------------------------------------------


def test_without_a_name_all_pages_are_listed(axisbus):
    code, out, _ = axisbus("explain")
    assert code == 0
    assert all(f"  {each.name} " in out and each.title in out for each in SYMPTOMS.values())


@each_symptom
def test_a_page_is_printed(symptom, axisbus):
    code, out, err = axisbus("explain", symptom.name)
    assert (code, err) == (0, "")
    assert out.startswith(f"# {symptom.title}\n")
    assert all(check in out for check in symptom.checks)
    assert all(f"`{name}`: " in out for name in symptom.errors)


@pytest.mark.parametrize(
    ("word", "page"),
    [
        ("FollowingError", "following-error"),
        ("nodetimeout", "no-answer"),
        ("K", "node-lost"),
        ("o", "another-device"),
        ("0x06090030", "value-refused"),
        ("06090030", "value-refused"),
        ("0x6090030", "value-refused"),
        ("0xDEADBEEF", "object-refused"),
        ("8611h", "following-error"),
        ("0x3210", "supply-voltage"),
        ("FF00", "drive-fault"),
    ],
)
def test_a_class_a_letter_or_a_code_gives_its_page(axisbus, word, page):
    assert axisbus("explain", word).out.startswith(f"# {SYMPTOMS[page].title}\n")


@pytest.mark.parametrize("word", ["node-lots", "P", "0x12", "", "\udcff", "0x", "12345", "é" * 1000])
def test_a_reference_without_a_page_is_reported(axisbus, word):
    code, out, err = axisbus("explain", word)
    assert (code, out) == (1, "")
    assert "there is no page" in err
    assert ("did you mean node-lost" in err) == (word == "node-lots")


def test_on_a_terminal_the_page_is_laid_out(monkeypatch, capsys):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    out = command_line.runner(monkeypatch, capsys)("explain", "node-lost").out
    assert "# A node is lost" not in out
    assert "A node is lost" in out
    assert "axisbus scan CELL" in out


def test_a_node_that_did_not_boot_names_its_page():
    error = boot("M")
    report = NodeReport(5, error=error)
    assert "\n    more:     axisbus explain another-device\n" in report.text() + "\n"
    assert report.as_json()["error"]["page"] == "another-device"


def test_the_page_has_the_texts_of_the_tables():
    text = markdown(SYMPTOMS["value-refused"])
    assert f"`0x06090030`: {abort.explain(0x06090030).text}" in text
    assert emcy.explain(0x8611) in markdown(SYMPTOMS["following-error"])
    assert Letter.K.sentence in markdown(SYMPTOMS["node-lost"])


def test_a_page_with_many_codes_lists_their_classes_in_a_terminal_and_each_for_the_site():
    few, all_of_them = (markdown(SYMPTOMS["over-current"], every_code=each) for each in (False, True))
    assert "`0x2131`" not in few
    assert "`0x2131`: Short circuit phases L1-L2" in all_of_them


# -- names in the texts ----------------------------------------------------------------------------------------------------------


def keys_and_tables(schema, name=""):
    """Every key of a cell file, and the name of every table that has it, with N and NAME for the user's names."""
    for key, each in (*schema.get("properties", {}).items(), *schema.get("patternProperties", {}).items()):
        inner = f"{name}.{key}" if key.isidentifier() else f"{name}.*"
        yield key
        yield inner
        yield from keys_and_tables(each, inner)


NAMED = set(keys_and_tables(schema_of_cells()))
OTHER_NAMES = {"lateness": "Machine", "buffer": "a parameter of moves", "restart-ms": "of ip link"}


@each_symptom
def test_the_keys_and_tables_that_a_page_names_are_those_of_a_cell_file(symptom):
    spans = re.findall(r"`([^`]+)`", " ".join((symptom.seen, *symptom.checks)))
    for span in spans:
        if re.fullmatch(r"[a-z][a-z_-]*", span) and span not in OTHER_NAMES:
            assert span in NAMED, span
        if table := re.fullmatch(r"\[(.*)\]", span):
            assert "." + re.sub(r"\b(NAME|N)\b", "*", table[1]) in NAMED, span


def test_a_key_that_is_not_there_would_be_noticed():
    assert {"transition_time", "scan_period", ".axes.*.homing", ".bus"} <= NAMED
    assert not {"transition_times", ".axes.*.stopping"} & NAMED
