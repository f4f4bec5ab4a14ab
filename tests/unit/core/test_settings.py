"""Labels and panels of settings."""

from rosy_addon.compositor.look import Look
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


def test_the_advanced_panel_has_only_details_of_a_method():
    assert panel_settings(Look, "") == ("weights", "view_plane")
