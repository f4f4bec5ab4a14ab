"""Operator: compute ambient occlusion, and use it as the tone."""

from __future__ import annotations

import bpy

from ..rosy_addon.projection.ambient_occlusion import DIRECTION_COUNT
from ..rosy_addon.scene.computed_attributes import OCCLUSION_ATTRIBUTE, store_occlusion
from ..rosy_addon.scene.visible_objects import field_objects
from ..rosy_addon.ui.property_makers import integer
from ..rosy_addon.worker.job import Steps
from .base import IDLE, VISIBLE_FIELD
from .modal_job import ModalJobMixin


class ROSY_OT_occlusion(ModalJobMixin, bpy.types.Operator):
    """Compute the ambient occlusion of all meshes with a field, store it as an attribute, and use it as the tone"""

    bl_idname = "rosy.occlusion"
    bl_label = "Tone by Occlusion"
    bl_options = {"REGISTER", "UNDO"}
    conditions = (IDLE, VISIBLE_FIELD)

    directions: integer(
        "Directions",
        "Number of sampled directions of light. More are smoother and take longer",
        default=DIRECTION_COUNT,
        min=1,
        soft_min=32,
        max=65536,
    )

    def begin(self, context: bpy.types.Context) -> Steps[None]:
        depsgraph = context.evaluated_depsgraph_get()
        objects = field_objects(context.view_layer)
        return store_occlusion.begin(depsgraph, objects, direction_count=self.directions)

    def finish(self, context: bpy.types.Context, result: None) -> None:
        settings = context.scene.rosy
        settings.tone_attribute, settings.look.tone = OCCLUSION_ATTRIBUTE, "attribute"
        self.report_done(
            f"Stored ambient occlusion as attribute '{OCCLUSION_ATTRIBUTE}', the source of the tone"
        )
