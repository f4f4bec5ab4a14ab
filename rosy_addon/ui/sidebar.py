"""Base class and helpers of the panels in the sidebar of the 3D view."""

from __future__ import annotations

import bpy

from . import job_status


class SidebarPanel:
    """Base of the panels: the tab RoSy in the sidebar of the 3D view."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "RoSy"


def use_property_columns(layout: bpy.types.UILayout) -> None:
    """Draw labels and values in two columns, without buttons for keyframes."""
    layout.use_property_split = True
    layout.use_property_decorate = False


def draw_progress(layout: bpy.types.UILayout) -> None:
    """Draw the progress of the running task."""
    layout.progress(factor=job_status.current.fraction, text=job_status.current.label.capitalize())
    layout.label(text="Press ESC to cancel")
