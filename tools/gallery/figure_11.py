"""Fill the tables of figure 11: fields on surfaces. `pictures.toml` describes its pictures."""

import numpy as np

from rosy_addon.compositor.contrast import expected_std
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.surface import Surface
from rosy_addon.rendering.view_input import ViewInput

from .page import fill_tables, signed
from .plane import enlarged
from .sheets import PAGES, described
from .solid import layer_in_view


def write() -> None:
    """Measure the tables."""
    page, census, spread = PAGES["figure-11"], {}, []
    for sheet in page["sheets"].values():
        for panel in sheet["rows"][0]:
            view = described(page, sheet, panel)
            spread.append([panel["label"], *_spread(view)])
            (instance,) = view.instances
            census[instance.surface.name] = _census(instance.surface, instance.field)
    fill_tables("figure-11", list(census.values()), spread)


def _census(surface: Surface, field: RosyField) -> list[object]:
    """Return a table row: counts of singularities by index, sum of the indices, and sum by Poincaré-Hopf."""
    _, index = find_singularities(surface, field)
    kinds, counts = np.unique(index, return_counts=True)
    shown = [f"{count} of {signed(kind)}" for kind, count in zip(kinds, counts, strict=True)]
    expected = field.degree * surface.euler_characteristic
    listed = ", ".join(shown) or "none"
    return [surface.name, surface.face_count, field.degree, listed, int(index.sum()), expected]


def _spread(view: ViewInput) -> list[object]:
    """Return the mean and the deviation of the tone of a picture, and the deviation by theory."""
    (instance,), look = view.instances, view.look
    camera = view.camera.scaled(look.supersampling)
    tone = layer_in_view(instance.surface, instance.field, look, camera).tone
    theory = look.gain * expected_std(pixel_look(enlarged(look, look.supersampling)))
    return [float(tone.mean()), float(tone.std()), theory]
