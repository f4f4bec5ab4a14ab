"""Operator: compare the field of the active mesh with another one, and color the lines by the angle."""

from __future__ import annotations

from typing import Any

import numpy as np
from bpy.types import Context, Operator

from ..rosy_addon.core.errors import counted
from ..rosy_addon.field.analysis import FieldComparison, format_degrees
from ..rosy_addon.scene import computed_attributes
from ..rosy_addon.scene.datablocks import field_mesh
from ..rosy_addon.ui.operator_settings import draw_settings
from ..rosy_addon.ui.property_makers import text, toggle
from ..rosy_addon.worker.job import Steps
from .base import selected_mesh_objects
from .modal_job import ActiveMeshMixin, ModalJobMixin


def _search_fields(_operator: Any, context: Context, _typed: str) -> list[str]:
    return computed_attributes.other_field_names(field_mesh(selected_mesh_objects(context)[0]))


class ROSY_OT_field_compare(ActiveMeshMixin, ModalJobMixin, Operator):
    """Compute the angle between the field of the active mesh and another one, store it as an attribute, and color the lines by it"""

    bl_label = "Compare"

    other: text(
        "With",
        "Attribute of the active mesh that holds the other field, of the same degree. Empty: the only "
        "other one",
        search=_search_fields,
    )
    use_as_color: toggle(
        "Color Lines",
        "Color the lines by the angle: light where the fields are the same, dark at 180/N degrees",
        default=True,
    )

    def begin(self, context: Context) -> Steps[tuple[str, int, FieldComparison]]:
        return computed_attributes.store_difference.begin(field_mesh(self.objects[0]), self.other)

    def finish(self, context: Context, result: tuple[str, int, FieldComparison]) -> None:
        other, degree, comparison = result
        if self.use_as_color:
            settings = context.scene.rosy
            settings.color_attribute = computed_attributes.DIFFERENCE_ATTRIBUTE
            # The range is reversed. So lines are light, and can be seen, where the fields are the same.
            settings.look.hue, settings.look.color_map = "values", "magma"
            settings.look.color_range = 180.0 / degree, 0.0
        difference = comparison.difference
        mean, p95, largest = (
            format_degrees(np.degrees(angle))
            for angle in (difference.mean, difference.p95, difference.max)
        )
        self.report_done(
            f"Off by {mean} degrees on average, {p95} on 95 % of the area, at most {largest} on "
            f"face {difference.worst_face}; {comparison.matched_count} of "
            f"{counted(comparison.singularity_count, 'singularity', 'singularities')} match the "
            f"{comparison.other_count} of '{other}'"
        )

    def draw(self, context: Context) -> None:
        draw_settings(self.layout, self, "other", "use_as_color")
