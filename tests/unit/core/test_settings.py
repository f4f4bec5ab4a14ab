"""Labels and panels of settings."""

import pytest

from rosy_addon.compositor.look import Look
from rosy_addon.core.color import alpha_from_hex, from_hex, to_hex
from rosy_addon.core.errors import RosyError
from rosy_addon.core.settings import panel_settings, settings_of


def test_every_setting_is_in_one_panel():
    panels = {setting.panel for setting in settings_of(Look).values()}
    shown = [name for panel in panels for name in panel_settings(Look, panel)]
    assert sorted(shown) == sorted(settings_of(Look))


def test_settings_are_shown_above_those_that_they_name():
    for panel in ("streaks", "ink", "quality"):
        names = panel_settings(Look, panel)
        for name in names:
            before = settings_of(Look)[name].panel_before
            assert not before or names.index(name) < names.index(before)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"color_range": (1.0, 2.0, 3.0)}, "2 numbers: bottom value, top value"),
        ({"length": 0}, "a number from 1"),
        ({"method": "magic"}, "one of"),
        ({"gain": "much"}, "a number"),
        ({"view_plane": 1}, "true or"),
        ({"color_range": (0.0, float("nan"))}, "top value from -1e\\+30 to 1e\\+30"),
        ({"tone_levels": [0.0, 1.0, 0.0]}, "gamma from 0.05 to 20.0"),
        ({"paper_color": "#1234567"}, "a color like #08080d or #08080d80"),
        ({"ink_color": "#12345678"}, "a color like #08080d$"),
    ],
    ids=str,
)
def test_values_that_are_not_allowed(settings, expected):
    with pytest.raises(RosyError, match=f"'{next(iter(settings))}' is .*, expected {expected}"):
        Look().with_settings(settings)


def test_numbers_from_files_and_from_the_command_line():
    """Lists and texts become tuples, so that they can be compared and hashed."""
    assert settings_of(Look)["tone_levels"].parse("0.1, 1,-2e-1") == (0.1, 1.0, -0.2)
    look = Look().with_settings({"tone_levels": [0, 1, 2], "paper_color": "#ABCDEF80"})
    assert look.tone_levels == (0, 1, 2) and hash(look)
    assert alpha_from_hex(look.paper_color) == 128 / 255
    assert to_hex([*from_hex(look.paper_color), 128 / 255]) == "#abcdef80"
    assert to_hex([*from_hex("#abcdefff"), 1.0]) == "#abcdef"
