"""Kinematics in a cell file: the lines of the group are in a workspace, and an error in the table is reported with its line."""

from __future__ import annotations

import pytest

from axisbus import CoreXY, Delta, Scara
from axisbus.cell import reader
from axisbus.cell.group_kinematics import kinematics_of
from axisbus.errors import ConfigError
from kit.cell import cell_text


def written(folder, table: str, axes: str = "xyz"):
    path = folder / "cell.toml"
    names = ", ".join(f'"{name}"' for name in axes)
    path.write_text(
        cell_text("xyz", more=f"[groups.arm]\naxes = [{names}]\n[groups.arm.kinematics]\n{table}\n")
    )
    return path


@pytest.mark.parametrize(
    ("table", "made"),
    [
        ('kind = "corexy"', CoreXY()),
        ('kind = "scara"\nupper = 200\nfore = 150.5', Scara(200.0, 150.5)),
        (
            'kind = "scara"\nupper = 200\nfore = 150\nleft = false\nmiddle = 90',
            Scara(200.0, 150.0, False, 90.0),
        ),
        ('kind = "delta"\nbase = 0\nplate = 20\nupper = 100\nfore = 250', Delta(0.0, 20.0, 100.0, 250.0)),
    ],
)
def test_a_group_has_the_kinematics_of_its_table(tmp_path, table, made):
    cell = reader.load(written(tmp_path, table))
    assert kinematics_of(cell.groups["arm"].kinematics) == made


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("upper = 1", "kind is missing"),
        ('kind = "robot"', "kind"),
        ('kind = "scara"\nupper = 1', "fore is missing in [groups.arm.kinematics]"),
        ('kind = "scara"\nupper = 1\nfore = 0', "fore"),
        ('kind = "corexy"\nupper = 1', "corexy has no upper"),
        ('kind = "delta"\nbase = 1\nplate = 1\nupper = 1\nfore = 1\nleft = true', "delta has no left"),
        ('kind = "scara"\nupper = 1\nfore = 1\nlength = 3', "length"),
    ],
)
def test_an_error_in_a_table_is_reported(tmp_path, table, words):
    with pytest.raises(ConfigError) as caught:
        reader.load(written(tmp_path, table))
    assert words in str(caught.value)


def test_a_group_of_too_few_axes_is_reported(tmp_path):
    with pytest.raises(ConfigError, match="delta needs 3 axes, and the group has 2"):
        reader.load(written(tmp_path, 'kind = "delta"\nbase = 1\nplate = 1\nupper = 1\nfore = 1', "xy"))
