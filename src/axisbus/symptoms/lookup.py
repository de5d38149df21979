"""Choose the page of an error: the most specific page in the tables of symptoms, by its codes or otherwise by its class."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from axisbus.symptoms import bus, drive, motion, objects, usage
from axisbus.symptoms.symptom import Symptom

# In the order in which a user encounters them: from the adapter to the motion.
FAMILIES: Mapping[str, tuple[Symptom, ...]] = {
    "The bus": bus.SYMPTOMS,
    "Boot, objects and files": objects.SYMPTOMS,
    "The drive": drive.SYMPTOMS,
    "Motion": motion.SYMPTOMS,
    "Requests of programs": usage.SYMPTOMS,
}
SYMPTOMS: Mapping[str, Symptom] = {each.name: each for family in FAMILIES.values() for each in family}
LAST = "cannot-be"  # the page of an error that belongs to no class of axisbus

_BY_CLASS = {name: each.name for each in SYMPTOMS.values() for name in each.errors}
_BY_LETTER = {letter: each.name for each in SYMPTOMS.values() for letter in each.letters}
_BY_ABORT = {code: each.name for each in SYMPTOMS.values() for code in each.aborts}
_BY_FAULT = {digits.upper(): each.name for each in SYMPTOMS.values() for digits in each.faults}
_LETTERS_OF_AN_OBJECT = ("", "J")  # a boot that ended at an object: the abort code is more specific


def page_of(error: BaseException) -> str:
    """Return the name of the most specific page for an error."""
    for kind in type(error).__mro__:
        finer = _FINER.get(kind.__name__)
        page = (finer(error) if finer is not None else None) or _BY_CLASS.get(kind.__name__)
        if page is not None:
            return page
    return LAST


def page_of_fault(code: object) -> str | None:
    """Return the page of an error code (603Fh, EMCY); None if ``code`` is not an error code."""
    if not isinstance(code, int) or not 0 <= code <= 0xFFFF:
        return None
    digits = f"{code:04X}"
    ways = (digits[:known] + "X" * (4 - known) for known in (4, 3, 2, 1))
    return next((_BY_FAULT[way] for way in ways if way in _BY_FAULT), None)


def page_of_abort(code: object) -> str | None:
    """Return the page of an SDO abort code; None for a device-specific code."""
    return _BY_ABORT.get(code) if isinstance(code, int) else None


def page_of_letter(letter: str) -> str | None:
    """Return the page of a letter of CiA 302-2; None if there is no such letter."""
    return _BY_LETTER.get(letter)


def _boot(error: BaseException) -> str | None:
    letter = getattr(error, "letter", "")
    by_abort = page_of_abort(getattr(error, "abort", None)) if letter in _LETTERS_OF_AN_OBJECT else None
    return by_abort or page_of_letter(letter)


_FINER: Mapping[str, Callable[[BaseException], str | None]] = {
    "BootError": _boot,
    "SdoAbort": lambda error: page_of_abort(getattr(error, "code", None)),
    "DriveFault": lambda error: page_of_fault(getattr(error, "code", None)),
}


def found(word: str) -> Symptom | None:
    """Return the symptom for a page name, an error class, a letter, or a code (0x06020000, 8611h); None if there is none."""
    name = word if word in SYMPTOMS else _by_class(word) or _by_number(word) or page_of_letter(word.upper())
    return None if name is None else SYMPTOMS[name]


def _by_class(word: str) -> str | None:
    return next((page for name, page in _BY_CLASS.items() if name.lower() == word.lower()), None)


def error_code(word: str) -> int | None:
    """Return the error code (603Fh, EMCY) that a word of four hexadecimal digits is (8611h, 0x8611); None for another word."""
    digits = _digits(word)
    return int(digits, 16) if len(digits) == 4 else None


def _by_number(word: str) -> str | None:
    digits = _digits(word)
    if len(digits) not in (4, 7, 8):
        return None
    code = int(digits, 16)
    return page_of_fault(code) if len(digits) == 4 else page_of_abort(code) or _BY_CLASS["SdoAbort"]


def _digits(word: str) -> str:
    """Return the hexadecimal digits of a word, empty if it has other characters."""
    digits = word.lower().removeprefix("0x").removesuffix("h")
    return digits if all(each in "0123456789abcdef" for each in digits) else ""


def words() -> Iterable[str]:
    """Return the names of all pages and error classes, to suggest one for a misspelled word."""
    return (*SYMPTOMS, *_BY_CLASS)
