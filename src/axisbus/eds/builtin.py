"""The EDS files that come with axisbus, by name."""

from __future__ import annotations

import difflib
from pathlib import Path

from axisbus.errors import EdsError

PREFIX = "builtin:"

# In an installed package the files are in this package's folder; in a checkout, in the top folder.
_FOLDERS = (Path(__file__).parent / "builtin", Path(__file__).parents[3] / "eds")


def names() -> list[str]:
    """Return the names that may follow ``builtin:``."""
    return sorted({file.stem for folder in _FOLDERS for file in folder.glob("*.eds")})


def resolve(spec: str, base: Path) -> Path:
    """Return the path of ``spec``: ``builtin:gim6010-8``, or a path relative to the folder ``base``.

    The path may not exist; ``load`` then reports it and names similar files.

    Raises:
        EdsError: there is no built-in file of this name, or the home directory of ``~`` is unknown.
    """
    if not spec.startswith(PREFIX):
        try:
            return base / Path(spec).expanduser()
        except RuntimeError as error:
            raise EdsError(
                f"{spec}: the home directory with which it begins is not known",
                observed=str(error),
                remedy="give the full path, or ./~... for a file whose name begins with ~",
            ) from error
    name = spec[len(PREFIX) :].strip()
    known = names()
    if name not in known:
        similar = difflib.get_close_matches(name.lower(), known, n=1)
        hint = f"did you mean {PREFIX}{similar[0]}? " if similar else ""
        raise EdsError(
            f"there is no built-in EDS {name!r}",
            observed=f"there are: {', '.join(PREFIX + each for each in known)}",
            remedy=f"{hint}take one of these, or give the path of the drive's own EDS",
        )
    return next(file for folder in _FOLDERS if (file := folder / f"{name}.eds").is_file())
