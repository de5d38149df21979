"""Statusword bits per mode, modes, option codes and homing methods as values."""

from axisbus.cia402 import dictionary, homing, modes, options, statusword
from axisbus.cia402.modes import ModeOfOperation


def test_bits_12_and_13_are_read_by_the_mode():
    word = 0x1637 | 1 << 13
    assert "set-point acknowledge" in statusword.bit_words(word, ModeOfOperation.PROFILE_POSITION)
    assert "following error" in statusword.bit_words(word, ModeOfOperation.PROFILE_POSITION)
    assert "speed is zero" in statusword.bit_words(word, ModeOfOperation.PROFILE_VELOCITY)
    assert "homing attained" in statusword.bit_words(word, ModeOfOperation.HOMING)
    assert "homing error" in statusword.bit_words(word, ModeOfOperation.HOMING)
    assert "bit 12" in statusword.bit_words(word, None)


def test_hints_name_why_a_drive_refuses():
    texts = " ".join(statusword.hints(0x0840))  # no voltage, no remote, internal limit
    assert "bit 4 (voltage enabled) is 0" in texts
    assert "bit 9 (remote) is 0" in texts
    assert "bit 11 (internal limit active)" in texts
    assert statusword.hints(0x0237) == []


def test_supported_modes_of_6502():
    # 0x3ED: bits 0, 2, 3, 5, 6, 7, 8, 9, typed off by hand
    assert [modes.short(mode) for mode in modes.supported(0x3ED)] == [
        "pp",
        "pv",
        "tq",
        "hm",
        "ip",
        "csp",
        "csv",
        "cst",
    ]
    # the claims of the module's 0x761 by CiA 402's layout
    assert [modes.short(mode) for mode in modes.supported(0x761)] == ["pp", "hm", "ip", "csv", "cst", "cstca"]


def test_unknown_modes_are_members():
    assert ModeOfOperation(-3).value == -3
    assert modes.short(ModeOfOperation(42)) == "mode 42"


def test_coasting_is_called_by_its_name():
    assert "coasts" in options.QUICK_STOP.meaning(0)
    assert "stays energised" in options.QUICK_STOP.meaning(6)
    assert "manufacturer-specific" in options.QUICK_STOP.meaning(-1)
    assert options.CONNECTION_LOSS.words["quick-stop"] == 3


def test_every_option_word_has_a_meaning():
    for option in options.ALL:
        for value in option.words.values():
            assert value in option.meanings


def test_homing_methods_have_texts():
    assert homing.describe(17) == "negative limit switch"
    assert homing.describe(-5) == "manufacturer-specific"
    assert homing.describe(99) == "reserved"


def test_object_names_are_those_of_the_table():
    assert dictionary.name(0x6081) == "Profile velocity"
    assert dictionary.name(0x607D) == "Software position limit"


def test_bit_12_of_a_cyclic_mode_is_named_if_the_drive_does_not_follow():
    """CiA 402-2 14.3: bit 12 of csp is 1 while the drive follows the command value."""
    follows, ignores = 0x1637, 0x0637
    assert not any("bit 12" in hint for hint in statusword.hints(follows, 8))
    assert any("bit 12 is 0" in hint for hint in statusword.hints(ignores, 8))
    assert not any("bit 12" in hint for hint in statusword.hints(ignores, 1))  # in pp it is the acknowledge
