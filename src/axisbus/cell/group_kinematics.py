"""The kinematics of a group in a cell file: the keys that each kind needs, and its conversion."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from axisbus.cell.model import KinematicsConfig
from axisbus.cell.schema import KINEMATICS
from axisbus.motion.group.kinematics import CoreXY, Delta, Kinematics, Scara
from axisbus.wording import counted


class KinematicsKind(NamedTuple):
    """One kind: the keys that it ``needs``, the optional keys (``may``), the number of ``axes``, and the class to ``make``."""

    needs: tuple[str, ...]
    may: tuple[str, ...]
    axes: int
    make: Callable[..., Kinematics]


KINDS: Mapping[str, KinematicsKind] = {
    "corexy": KinematicsKind((), (), 2, CoreXY),
    "scara": KinematicsKind(("upper", "fore"), ("left", "middle"), 2, Scara),
    "delta": KinematicsKind(("base", "plate", "upper", "fore"), (), 3, Delta),
}


class Wrong(NamedTuple):
    """An error: its key (empty: the table), the reason, and the remedy."""

    key: str
    message: str
    remedy: str


def wrong(config: KinematicsConfig, axes: int) -> Iterator[Wrong]:
    """Yield the errors of a table whose values are valid, for a group of ``axes`` axes."""
    kind = KINDS[config.kind]
    for key in kind.needs:
        if not config.at.gives(key):
            yield Wrong(
                "", f"{key} is missing in [{config.at.name}]", f"add {key} = ..., which {config.kind} needs"
            )
    for key in KINEMATICS:
        if config.at.gives(key) and key not in ("kind", *kind.needs, *kind.may):
            yield Wrong(key, f"{config.kind} has no {key}", f"leave {key} out, or give another kind")
    if axes < kind.axes:
        yield Wrong(
            "kind",
            f"{config.kind} needs {counted(kind.axes, 'axis', 'axes')}, and the group has {axes}",
            "name its axes, in their order",
        )


def kinematics_of(config: KinematicsConfig | None) -> Kinematics | None:
    """Return the kinematics of a group whose table is free of errors; None if it has no table."""
    if config is None:
        return None
    kind = KINDS[config.kind]
    given: dict[str, Any] = {
        key: value for key in (*kind.needs, *kind.may) if (value := getattr(config, key)) is not None
    }
    return kind.make(**given)
