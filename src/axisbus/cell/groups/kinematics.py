"""How the axes of a group make a place, as a cell file says it: what each kind needs, and what it becomes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from axisbus.cell.model import KinematicsConfig
from axisbus.cell.schema import KINEMATICS
from axisbus.motion.group.kinematics import CoreXY, Delta, Kinematics, Scara
from axisbus.wording import counted


class KinematicsKind(NamedTuple):
    """One kind: the keys that it ``needs`` and those that it ``may`` have, how many ``axes`` it takes, and what is made."""

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
    """What is wrong: at which key (empty: of the table), why, and what to do."""

    key: str
    message: str
    remedy: str


def wrong(config: KinematicsConfig, axes: int) -> Iterator[Wrong]:
    """Yield what is wrong with a sound table of a group of so many axes."""
    kind = KINDS[config.kind]
    for key in kind.needs:
        if not config.at.gives(key):
            yield Wrong(
                "", f"{key} is missing in [{config.at.name}]", f"add {key} = ..., which {config.kind} needs"
            )
    for key in KINEMATICS:
        if config.at.gives(key) and key not in ("kind", *kind.needs, *kind.may):
            yield Wrong(key, f"{key} is none of {config.kind}", f"leave {key} out, or give another kind")
    if axes < kind.axes:
        yield Wrong(
            "kind",
            f"{config.kind} takes {counted(kind.axes, 'axis', 'axes')}, and the group has {axes}",
            "name its axes, in their order",
        )


def kinematics_of(config: KinematicsConfig | None) -> Kinematics | None:
    """Return the kinematics of a group whose table is sound; None where it has none."""
    if config is None:
        return None
    kind = KINDS[config.kind]
    given: dict[str, Any] = {
        key: value for key in (*kind.needs, *kind.may) if (value := getattr(config, key)) is not None
    }
    return kind.make(**given)
