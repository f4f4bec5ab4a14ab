"""Ambient occlusion as the tone of the meshes that are drawn."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..rosy_addon.progress import Work
from ..rosy_addon.projection.occlusion import DIRECTIONS
from ..rosy_addon.scene.bodies import rosy_objects
from ..rosy_addon.scene.occlusion import OCCLUSION, storing_occlusion
from .meshes import can_draw
from .ticking import Ticking


class ROSY_OT_occlusion(Ticking, bpy.types.Operator):
    """Store how much of the sky each part of the meshes with a field sees, and take tones from that"""

    bl_idname = "rosy.occlusion"
    bl_label = "Tone by Occlusion"
    bl_options = {"REGISTER", "UNDO"}

    directions: bpy.props.IntProperty(
        name="Directions",
        description="From how many sides it is looked at: more take longer and are smoother",
        default=DIRECTIONS,
        min=1,
        soft_min=32,
        max=65536,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_draw(cls, context)

    def work(self, context: bpy.types.Context) -> Work[None]:
        depsgraph = context.evaluated_depsgraph_get()
        objects = rosy_objects(context.view_layer)
        return storing_occlusion(depsgraph, objects, directions=self.directions)

    def needed(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return rosy_objects(context.view_layer)

    def finish(self, context: bpy.types.Context, result: None) -> None:
        settings = context.scene.rosy
        settings.tone_attribute, settings.look.tone = OCCLUSION, "attribute"
        self.report({"INFO"}, f"Stored as attribute '{OCCLUSION}', which the tone now comes from")


CLASSES = (ROSY_OT_occlusion,)
